//! Jobs of HTTP clients, which are not connected to the serial line themselves. For each such client, the agent keeps
//! a connection to the serial line and runs the client's jobs. The agent also writes a journal that a client can read
//! when it reconnects.
mod event;
mod http_session;
mod poses;
mod push_arm;
mod recover;
mod report;
mod run;
mod stops;
mod store;
mod task;

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use agent_kit::api::Problem;
use jtc_host::{Arm, Session};

pub use event::{ArmEvent, Journal};
pub use http_session::{HttpSession, Turn, Unable, Wish};
pub use poses::{POSES_MAX, PoseStore, PoseStoreError};
pub use push_arm::{Given, give};
pub use recover::recover;
pub use report::MotionReport;
pub use run::{Course, Done, Order, run};
pub use stops::Stops;
pub use store::{NUMBER_MAX, Store, StoreError, Stored};

use crate::line::{Introduction, Policy, Role};
use crate::owner::{ClientPort, Line};
pub use task::{STOPPED, Task, stopped};

/// Number of jobs that the agent stores.
const KEPT: usize = 256;
/// Largest number of HTTP clients for which the agent keeps a connection to the serial line.
const COMMANDERS_MAX: usize = 32;
/// Time after which the agent removes a silent client whose lease has ended.
const FORGOTTEN: Duration = Duration::from_secs(60);
/// Shortest interval between two events for Stops and Pauses, so that repeated Stops do not remove other events from
/// the journal. The event for the last Stop or Pause is always written.
const HALTS_APART: Duration = Duration::from_millis(200);
/// Interval at which the agent checks for changes that the serial line does not announce.
const LOOK: Duration = Duration::from_millis(200);

/// Stage of a job: running, or the outcome after its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The job is running.
    Running,
    /// The job was completed.
    Finished,
    /// The job was stopped by a client.
    Stopped,
    /// The job has failed.
    Failed,
}

/// Job that runs or has ended.
#[derive(Clone, Debug)]
pub struct Job {
    /// Number of the job.
    pub number: u64,
    /// Description of the job.
    pub what: String,
    /// Name of the client that requested the job.
    pub client: String,
    /// Stage of the job.
    pub stage: Stage,
    /// Progress and results.
    pub done: Done,
    /// Reason why the job has failed.
    pub error: Option<Problem>,
}

#[derive(Default)]
struct Kept {
    http_sessions: BTreeMap<String, (Arc<HttpSession>, Duration)>,
    jobs: VecDeque<Job>,
    last: u64,
    ended: Ended,
}

/// Counts of jobs that have ended, one count per outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ended {
    /// Number of completed jobs.
    pub finished: u64,
    /// Number of jobs that a client stopped.
    pub stopped: u64,
    /// Number of failed jobs.
    pub failed: u64,
}

/// Jobs of an agent, and the clients that request them.
pub struct Jobs {
    line: Line,
    /// Journal of the events of the arm and of the jobs.
    pub journal: Journal,
    /// Store of trajectories, which are identified by number.
    pub store: Store,
    arm: Arm,
    /// Session through which the agent sends the queries of all clients.
    asker: Arc<HttpSession>,
    /// Held stops of the arm, and their causes.
    pub stops: Stops,
    kept: Mutex<Kept>,
}

impl Jobs {
    /// Creates the job list of a serial line. The agent uses `arm` if the controller cannot return its own arm.
    pub fn new(line: Line, store: Store, arm: Arm) -> Arc<Self> {
        let introduction =
            Introduction { name: "the agent".into(), role: Role::Viewer, policy: Policy::Continue };
        let asker = HttpSession::new(&line, introduction);
        let jobs = Arc::new(Self {
            line,
            journal: Journal::default(),
            store,
            arm,
            asker,
            stops: Stops::default(),
            kept: Mutex::default(),
        });
        let watched = Arc::downgrade(&jobs);
        std::thread::spawn(move || watch(&watched));
        jobs
    }

    /// Returns the session through which the agent sends the queries of all clients.
    pub fn asker(&self) -> &Arc<HttpSession> {
        &self.asker
    }

    /// Returns the arm that the agent uses if the controller cannot return its own arm.
    pub fn arm(&self) -> &Arm {
        &self.arm
    }

    /// Registers a client that sends its requests with `key`. The lease of the client lapses if the client sends no
    /// request for `lasts`. Returns `None` if the maximum number of clients is registered and none of them is idle.
    pub fn admit(&self, key: &str, introduction: Introduction, lasts: Duration) -> Option<Arc<HttpSession>> {
        let http_session = HttpSession::new(&self.line, introduction);
        let mut kept = self.lock();
        if kept.http_sessions.len() >= COMMANDERS_MAX {
            // If the list of clients is full, a client without a lease and without a job is removed. A program that
            // restarts repeatedly therefore does not block other clients.
            let holder = self.line.with(|line, _| line.lease().map(|lease| lease.holder));
            let idle = kept
                .http_sessions
                .iter()
                .filter(|(_, (other, _))| Some(other.client) != holder && other.idle() > Duration::ZERO);
            let longest = idle.max_by_key(|(_, (other, _))| other.idle()).map(|(key, _)| key.clone())?;
            kept.http_sessions.remove(&longest);
        }
        kept.http_sessions.insert(key.to_owned(), (http_session.clone(), lasts));
        Some(http_session)
    }

    /// Returns the client with this key. Also returns the time without a request after which the client's lease
    /// lapses.
    pub fn http_session(&self, key: &str) -> Option<(Arc<HttpSession>, Duration)> {
        let found = self.lock().http_sessions.get(key).cloned()?;
        found.0.see();
        Some(found)
    }

    /// Removes the client with this key.
    pub fn dismiss(&self, key: &str) {
        self.lock().http_sessions.remove(key);
    }

    /// Begins a job for a client. The job needs the permit to use the client's session.
    ///
    /// # Errors
    ///
    /// [`Unable`] if the job was not begun.
    pub fn begin(
        self: &Arc<Self>,
        http_session: &Arc<HttpSession>,
        turn: Turn,
        what: String,
        act: impl FnOnce(&Task<'_>, &mut Session<ClientPort>) -> (Done, Option<Problem>) + Send + 'static,
    ) -> Result<Job, Unable> {
        let client = http_session.name.clone();
        let job = {
            let mut kept = self.lock();
            kept.last += 1;
            Job { number: kept.last, what, client, stage: Stage::Running, done: Done::default(), error: None }
        };
        // The job is stored before it begins, because it may end at once.
        self.remember(job.clone());
        let (own, begun, whose) = (self.clone(), job.clone(), Arc::downgrade(http_session));
        let unfinished = Unfinished { jobs: self.clone(), number: job.number };
        let work = move |session: &mut Session<ClientPort>, wishes: &Receiver<Wish>| {
            let Some(http_session) = whose.upgrade() else { return (Done::default(), None) };
            let Job { number, what, client, .. } = begun;
            let Self { line, journal, arm, .. } = &*own;
            journal.write(ArmEvent::Begun { job: number, what: what.clone(), client });
            act(
                &Task { wishes, job: number, what: &what, journal, line, http_session: &http_session, arm },
                session,
            )
        };
        let accepted =
            http_session.begin(turn, job.number, work, move |(done, error)| unfinished.end(done, error));
        accepted.map(|()| job)
    }

    /// Returns a job by its number.
    pub fn job(&self, number: u64) -> Option<Job> {
        self.lock().jobs.iter().find(|job| job.number == number).cloned()
    }

    /// Returns the stored jobs, oldest first.
    pub fn list(&self) -> Vec<Job> {
        self.lock().jobs.iter().cloned().collect()
    }

    /// Returns the number of running jobs, and the counts of the jobs that have ended.
    pub fn counts(&self) -> (usize, Ended) {
        let kept = self.lock();
        (kept.jobs.iter().filter(|job| job.stage == Stage::Running).count(), kept.ended)
    }

    fn remember(&self, job: Job) {
        let mut kept = self.lock();
        if kept.jobs.len() == KEPT
            && let Some(old) = kept.jobs.iter().position(|job| job.stage != Stage::Running)
        {
            kept.jobs.remove(old);
        }
        kept.jobs.push_back(job);
    }

    fn end(&self, number: u64, done: Done, error: Option<Problem>) {
        let stage = match &error {
            None if done.finished => Stage::Finished,
            None => Stage::Stopped,
            Some(error) if error.code == STOPPED => Stage::Stopped,
            Some(_) => Stage::Failed,
        };
        let outcome = stage.name().to_owned();
        let mut kept = self.lock();
        match stage {
            Stage::Running => {}
            Stage::Finished => kept.ended.finished += 1,
            Stage::Stopped => kept.ended.stopped += 1,
            Stage::Failed => kept.ended.failed += 1,
        }
        if let Some(job) = kept.jobs.iter_mut().find(|job| job.number == number) {
            (job.stage, job.done) = (stage, done);
            job.error.clone_from(&error);
        }
        report::make_room(&mut kept.jobs);
        drop(kept);
        self.journal.write(ArmEvent::Ended { job: number, outcome, error });
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Guard of a running job. If the agent panics and drops the guard, the job ends as failed.
struct Unfinished {
    jobs: Arc<Jobs>,
    number: u64,
}

impl Unfinished {
    fn end(&self, done: Done, error: Option<Problem>) {
        self.jobs.end(self.number, done, error);
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if self.jobs.job(self.number).is_some_and(|job| job.stage == Stage::Running) {
            let next = "check the arm with GET /api/status, and read the output of the agent";
            self.end(Done::default(), Some(Problem::new("fault", "internal error of the agent", next)));
        }
    }
}

impl Stage {
    /// Returns the name of the job's stage.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Finished => "finished",
            Self::Stopped => "stopped",
            Self::Failed => "failed",
        }
    }
}

/// State of the serial line that was last written to the journal.
#[derive(Default)]
struct Seen {
    holder: Option<String>,
    halt: u64,
    /// Time of the last event for a Stop or a Pause.
    halted: Option<Instant>,
    state: Option<(String, String, Vec<String>)>,
    lost: Option<String>,
}

/// Writes changes on the serial line to the journal until the agent ends. Also removes clients that have stopped
/// sending requests.
fn watch(jobs: &Weak<Jobs>) {
    let (mut seen, mut looked) = (Seen::default(), Instant::now());
    loop {
        let Some(jobs) = jobs.upgrade() else { return };
        see(&jobs, &mut seen);
        if looked.elapsed() >= Duration::from_secs(1) {
            looked = Instant::now();
            jobs.lock()
                .http_sessions
                .retain(|_, (http_session, lasts)| http_session.idle() < *lasts + FORGOTTEN);
        }
        let line = jobs.line.clone();
        drop(jobs);
        line.wait(LOOK);
    }
}

fn see(jobs: &Jobs, seen: &mut Seen) {
    let lost = jobs.line.lost();
    let (holder, halt, by, status) = jobs.line.with(|line, _| {
        let holder = line.lease().and_then(|lease| line.introduction(lease.holder)).map(|c| c.name.clone());
        let (by, command) = line.last_halt_by();
        let by = (by.to_owned(), command.name().to_owned());
        (holder, line.last_halt(), by, line.status().map(|(_, status)| *status))
    });
    if let Some(status) = &status {
        jobs.stops.see(status, &jobs.asker);
    }
    let state = status.as_ref().map(|status| {
        let errors = jtc_host::labels::causes(status);
        (status.state.name().to_owned(), status.trajectory.name().to_owned(), errors)
    });
    if holder != seen.holder {
        seen.holder.clone_from(&holder);
        jobs.journal.write(ArmEvent::Lease { holder });
    }
    if halt != seen.halt && seen.halted.is_none_or(|at| at.elapsed() >= HALTS_APART) {
        (seen.halt, seen.halted) = (halt, Some(Instant::now()));
        let (by, command) = by;
        jobs.journal.write(ArmEvent::Halt { command, by });
    }
    if state != seen.state {
        seen.state.clone_from(&state);
        if let Some((state, trajectory, errors)) = state {
            jobs.journal.write(ArmEvent::State { state, trajectory, errors });
        }
    }
    if lost != seen.lost {
        seen.lost.clone_from(&lost);
        if let Some(why) = lost {
            jobs.journal.write(ArmEvent::Lost { why });
        }
    }
}
