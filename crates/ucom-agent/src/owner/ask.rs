//! Requests to the owner of a bus: short requests and jobs.
use std::sync::Arc;
use std::time::{Duration, Instant};

use agent_kit::api::Problem;
use agent_kit::lease::ClientId;
use host_kit::ErrorKind;
use host_kit::owner::{Kind, Refused, Request};
use tokio::sync::oneshot;

use super::Worker;
use super::shared::{CANCELLED, STOPPED, Shared};
use crate::event::ChainEvent;
use crate::jobs::{Done, Job, Stage};

/// Maximum time for which a request is queued. The owner refuses a request after 5 s in the queue, because the HTTP request times out
/// after ten seconds. A request that can only end a motion has no time limit in the queue.
const PATIENCE: Duration = Duration::from_secs(5);

/// Maximum number of queued commands. `QUESTIONS_MAX` is the limit for queued queries without the lease. The limits for commands and
/// queries are separate, so that queries do not block commands.
const WAITING_MAX: usize = 32;
const QUESTIONS_MAX: usize = 8;

/// Queue of requests to the owner of the bus.
pub(super) type Queue = host_kit::owner::Queue<Worker, Tag>;
type Place<'a> = host_kit::owner::Place<'a, Worker, Tag>;

/// Request of the lease holder. The data show whether a Stop or another lease holder came before the execution of the
/// request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Asked {
    pub client: ClientId,
    /// Number of the last Stop before the request.
    pub halt: u64,
    /// `true` if the request may move boards. A request that can only end a motion is executed even if its client has disconnected.
    pub moves: bool,
}

/// Data about a request in the queue.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Tag {
    /// Number of the job; `None` if the request is not a job.
    pub job: Option<u64>,
    /// Request of the lease holder; `None` for a query without the lease and for the check after a Stop.
    pub asked: Option<Asked>,
}

impl Tag {
    /// Returns `true` for a request of this client that may move boards.
    pub(super) fn moves_for(&self, client: ClientId) -> bool {
        self.asked.is_some_and(|asked| asked.moves && asked.client == client)
    }
}

impl Shared {
    /// Reserves an entry in the queue for a request. While a job runs or is queued, other requests are refused.
    fn place(&self, is_question: bool) -> Result<Place<'_>, Problem> {
        let place = self.queue.place().ok_or_else(gone)?;
        if let Some(job) = place.tags().find_map(|tag| tag.job) {
            return Err(Problem::new(
                "busy",
                format!("job {job} is still running, and the agent runs one job at a time"),
                "wait until the job has ended; a Stop is always accepted, and DELETE /api/jobs/NUMBER \
                 cancels the job",
            ));
        }
        let most = if is_question { QUESTIONS_MAX } else { WAITING_MAX };
        if place.waiting(|kind| (kind == Kind::Question) == is_question) >= most {
            return Err(Problem::new(
                "busy",
                "too many requests are waiting",
                "repeat the request after a moment",
            ));
        }
        Ok(place)
    }

    /// Returns the worker if it may execute the request now. If the request is refused, returns the reason: a Stop came after the
    /// request, or the client has lost the lease.
    fn turn<'a>(
        &self,
        worker: Result<&'a mut Worker, Refused>,
        asked: Option<Asked>,
    ) -> Result<&'a mut Worker, Problem> {
        // In this case, the thread may already hold the lock of the leases. The lock is therefore taken only after
        // this check: here, `turn` runs in the owner's thread.
        let worker = worker.map_err(|refused| match refused {
            Refused::Stopped => self.stopped(),
            Refused::Cancelled => cancelled(),
            Refused::Closed => gone(),
        })?;
        let late = asked.and_then(|asked| {
            // A Stop may arrive while `too_late` checks the leases, so the number of Stops is checked after that.
            self.too_late(asked).or_else(|| (asked.halt < self.queue.stops()).then(|| self.stopped()))
        });
        if late.is_some() {
            // The request must be marked as done before its client receives the refusal.
            self.queue.done();
        }
        late.map_or(Ok(worker), Err)
    }

    /// Runs a short function in the thread that owns the bus, and waits for its result. The function is a command, or
    /// a query that needs no lease.
    pub(crate) async fn call<T: Send + 'static>(
        self: &Arc<Self>,
        asked: Option<Asked>,
        act: impl FnOnce(&mut Worker) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let (answer, answered) = oneshot::channel();
        let kind = if asked.is_some() { Kind::Command } else { Kind::Question };
        let only_ends = asked.is_some_and(|asked| !asked.moves);
        let begun = Instant::now();
        let own = self.clone();
        let act = move |worker: Result<&mut Worker, Refused>| {
            let worker = own.turn(worker, asked);
            // If the client has stopped waiting for the answer, its request must not move boards later.
            if answer.is_closed() && !only_ends {
                return;
            }
            // If the request was queued for too long, its answer would be too late.
            let worker = worker.and_then(|worker| match begun.elapsed() > PATIENCE && !only_ends {
                true => {
                    // The request is marked as done before its client receives the refusal.
                    own.queue.done();
                    Err(Problem::new(
                        "busy",
                        "the request waited too long and was not carried out",
                        "repeat the request",
                    ))
                }
                false => Ok(worker),
            });
            // A client that has disconnected receives no answer.
            let _ = answer.send(worker.and_then(|worker| {
                let done = act(worker);
                worker.settle();
                done
            }));
        };
        let (after, tag) = (asked.map_or(0, |asked| asked.halt), Tag { job: None, asked });
        self.place(asked.is_none())?.put(Request { kind, after, tag, act: Box::new(act) });
        answered.await.unwrap_or_else(|_| Err(fault()))
    }

    /// Begins a job of the lease holder.
    pub(crate) fn begin(
        self: &Arc<Self>,
        (kind, asked): (Kind, Asked),
        (what, client): (&str, &str),
        act: impl FnOnce(&mut Worker) -> Result<(Done, Option<Problem>), Problem> + Send + 'static,
    ) -> Result<Job, Problem> {
        let place = self.place(false)?;
        let job = self.jobs.add(what, client);
        let (number, own, begun) = (job.number, self.clone(), job.clone());
        let unfinished = Unfinished { shared: self.clone(), number };
        let act = move |worker: Result<&mut Worker, Refused>| {
            let worker = own.turn(worker, Some(asked));
            let Job { number, what, client, .. } = begun;
            own.journal.write(ChainEvent::Begun { job: number, what, client });
            let acted = worker.and_then(|worker| {
                let done = act(worker);
                worker.settle();
                done
            });
            let (done, error) = match acted {
                Ok((done, error)) => (Some(done), error),
                Err(error) => (None, Some(error)),
            };
            // A cancelled job keeps the results that it has already produced.
            let stage = match &error {
                None => Stage::Finished,
                Some(error) if error.code == CANCELLED || error.code == STOPPED => Stage::Cancelled,
                Some(_) => Stage::Failed,
            };
            unfinished.end(stage, done, error);
        };
        let tag = Tag { job: Some(number), asked: Some(asked) };
        place.put(Request { kind, after: asked.halt, tag, act: Box::new(act) });
        Ok(job)
    }

    /// Cancels a job that runs or is queued. The cancelled job still undoes its steps on the boards. Returns `false` if the job has
    /// already ended.
    pub(crate) fn cancel_job(&self, number: u64) -> bool {
        self.queue.cancel(|tag| tag.job == Some(number))
    }
}

/// Returns the problem for an internal error of the agent.
pub(crate) fn fault() -> Problem {
    Problem::new("fault", "the agent has an internal error", "read the output of the agent")
        .kind(ErrorKind::Fault)
}

/// Returns the problem for a cancelled request.
pub(super) fn cancelled() -> Problem {
    Problem::new(CANCELLED, "the request was cancelled", "repeat the request")
}

fn gone() -> Problem {
    Problem::new(
        "gone",
        "the bus is lost, or the agent is shutting down",
        "GET /api/status shows if the bus is available",
    )
    .kind(ErrorKind::NoLink)
}

/// Guard of a job that has not ended. If an internal error of the agent drops this guard, the job ends as failed.
struct Unfinished {
    shared: Arc<Shared>,
    number: u64,
}

impl Unfinished {
    fn end(&self, stage: Stage, done: Option<Done>, error: Option<Problem>) {
        if self.shared.jobs.end(self.number, stage, done, error.clone()) {
            let outcome = stage.name().to_owned();
            self.shared.journal.write(ChainEvent::Ended { job: self.number, outcome, error });
        }
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        self.end(Stage::Failed, None, Some(fault()));
    }
}
