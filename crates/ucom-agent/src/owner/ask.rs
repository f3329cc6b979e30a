//! Requests to the owner of a bus: short ones, and jobs.
use std::sync::Arc;
use std::time::{Duration, Instant};

use agent_kit::api::Problem;
use tokio::sync::oneshot;

use super::Hands;
use super::shared::{CANCELLED, STOPPED, Shared, cancelled};
use crate::happening::Happening;
use crate::jobs::{Done, Job, Stage};
use crate::work::{Asked, Cancelled, Kind, Work};

/// Longest wait for a turn; after it the request is refused, because its HTTP request times out after ten seconds.
const PATIENCE: Duration = Duration::from_secs(5);

impl Shared {
    /// Runs a short function in the owner's thread and waits for it: a command, or a question that needs no lease.
    pub async fn call<T: Send + 'static>(
        &self,
        asked: Option<Asked>,
        act: impl FnOnce(&mut Hands) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let (answer, answered) = oneshot::channel();
        let kind = if asked.is_some() { Kind::Command } else { Kind::Question };
        let only_ends = asked.is_some_and(|asked| !asked.moves);
        let begun = Instant::now();
        let act = move |hands: Result<&mut Hands, Problem>| {
            // A request of a client that has given up must not move boards later.
            if answer.is_closed() && !only_ends {
                return;
            }
            // Its answer would be too late, even if it ran.
            let hands = hands.and_then(|hands| match begun.elapsed() > PATIENCE && !only_ends {
                true => {
                    Err(Problem::new("busy", "its turn did not come in time: it is not done", "ask again"))
                }
                false => Ok(hands),
            });
            // A client that has disconnected needs no answer.
            let _ = answer.send(hands.and_then(|hands| {
                let done = act(hands);
                hands.settle();
                done
            }));
        };
        self.queue.place(asked.is_none())?.fill(Work { kind, job: None, asked, act: Box::new(act) });
        answered.await.unwrap_or_else(|_| Err(fault()))
    }

    /// Begins a job.
    pub fn begin(
        self: &Arc<Self>,
        (kind, asked): (Kind, Asked),
        (what, client): (&str, &str),
        act: impl FnOnce(&mut Hands) -> Result<(Done, Option<Problem>), Problem> + Send + 'static,
    ) -> Result<Job, Problem> {
        let place = self.queue.place(false)?;
        let job = self.jobs.add(what, client);
        let (number, own, begun) = (job.number, self.clone(), job.clone());
        let unfinished = Unfinished { shared: self.clone(), number };
        let act = move |hands: Result<&mut Hands, Problem>| {
            let Job { number, what, client, .. } = begun;
            own.journal.write(Happening::Begun { job: number, what, client });
            let acted = hands.and_then(|hands| {
                let done = act(hands);
                hands.settle();
                done
            });
            let (done, error) = match acted {
                Ok((done, error)) => (Some(done), error),
                Err(error) => (None, Some(error)),
            };
            // Results from before a cancellation are kept.
            let stage = match &error {
                None => Stage::Finished,
                Some(error) if error.code == CANCELLED || error.code == STOPPED => Stage::Cancelled,
                Some(_) => Stage::Failed,
            };
            unfinished.end(stage, done, error);
        };
        place.fill(Work { kind, job: Some(number), asked: Some(asked), act: Box::new(act) });
        Ok(job)
    }

    /// Cancels a job, which still undoes its steps on the boards. Returns `false` if it has ended.
    pub fn cancel_job(&self, number: u64) -> bool {
        match self.queue.cancel_job(number) {
            Some(Cancelled::Current) => true,
            Some(Cancelled::Waiting(work)) => {
                (work.act)(Err(cancelled()));
                true
            }
            None => false,
        }
    }
}

/// Returns the problem for a fault of the agent itself.
pub(crate) fn fault() -> Problem {
    Problem::new("fault", "the agent has a fault", "look at what the agent printed")
        .kind(host_kit::ErrorKind::Fault)
}

/// Job that has not ended; if this is dropped because of a fault of the agent, the job ends as failed.
struct Unfinished {
    shared: Arc<Shared>,
    number: u64,
}

impl Unfinished {
    fn end(&self, stage: Stage, done: Option<Done>, error: Option<Problem>) {
        if self.shared.jobs.end(self.number, stage, done, error.clone()) {
            let outcome = stage.name().to_owned();
            self.shared.journal.write(Happening::Ended { job: self.number, outcome, error });
        }
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        self.end(Stage::Failed, None, Some(fault()));
    }
}
