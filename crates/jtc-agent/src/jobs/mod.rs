//! What an agent does for clients that have no connection of their own: it keeps their end of the line, runs what they ask for, and
//! writes down what happens, so that they can come back and read it.
mod commander;
mod give;
mod happening;
mod poses;
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

pub use commander::{Commander, Turn, Unable, Wish};
pub use give::{Given, give};
pub use happening::{Happening, Journal};
pub use poses::{POSES_MAX, PoseStore, PoseStoreError};
pub use recover::{Numbers, recover};
pub use report::MotionReport;
pub use run::{Course, Done, Order, run};
pub use stops::Stops;
pub use store::{NUMBER_MAX, Store, StoreError, Stored};

use crate::line::{Introduction, Policy, Role};
use crate::owner::{ClientPort, Line};
pub use task::{STOPPED, Task, stopped};

/// Jobs that are remembered.
const KEPT: usize = 256;
/// Clients without a connection at once.
const COMMANDERS_MAX: usize = 32;
/// A client that has asked for nothing for so long behind the end of its lease is forgotten.
const FORGOTTEN: Duration = Duration::from_secs(60);
/// Stops and Pauses are written at most so often, the last one always: one who repeats them is not to crowd out what others did.
const HALTS_APART: Duration = Duration::from_millis(200);
/// How often is looked whether something has changed where nothing announces it.
const LOOK: Duration = Duration::from_millis(200);

/// How a job is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stage {
    /// It goes on.
    Running,
    /// It came to its end.
    Finished,
    /// Somebody stopped it.
    Stopped,
    /// It failed.
    Failed,
}

/// A job, while it goes on and afterwards.
#[derive(Clone, Debug)]
pub struct Job {
    /// Its number.
    pub number: u64,
    /// What it does.
    pub what: String,
    /// Who asked for it.
    pub client: String,
    /// How it is.
    pub stage: Stage,
    /// How far it came.
    pub done: Done,
    /// Why it failed.
    pub error: Option<Problem>,
}

#[derive(Default)]
struct Kept {
    commanders: BTreeMap<String, (Arc<Commander>, Duration)>,
    jobs: VecDeque<Job>,
    last: u64,
    ended: Ended,
}

/// How many jobs have ended, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ended {
    /// They came to their end.
    pub finished: u64,
    /// Somebody stopped them.
    pub stopped: u64,
    /// They failed.
    pub failed: u64,
}

/// The jobs of an agent, and who asks for them.
pub struct Jobs {
    line: Line,
    /// What happened.
    pub journal: Journal,
    /// Trajectories by number.
    pub store: Store,
    arm: Arm,
    /// Asks questions for all who may look.
    asker: Arc<Commander>,
    /// Held stops and their causes.
    pub stops: Stops,
    kept: Mutex<Kept>,
}

impl Jobs {
    /// Those of a line. `arm` is that of controllers that cannot be asked for theirs.
    pub fn new(line: Line, store: Store, arm: Arm) -> Arc<Self> {
        let introduction =
            Introduction { name: "the agent".into(), role: Role::Viewer, policy: Policy::Continue };
        let asker = Commander::new(&line, introduction);
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

    /// Asks questions for all who may look.
    pub fn asker(&self) -> &Arc<Commander> {
        &self.asker
    }

    /// The arm of controllers that cannot be asked for theirs.
    pub fn arm(&self) -> &Arm {
        &self.arm
    }

    /// A client comes that will ask with `key`, and shows at least so often that it is there. `None`: there is no room for another.
    pub fn admit(&self, key: &str, introduction: Introduction, lasts: Duration) -> Option<Arc<Commander>> {
        let commander = Commander::new(&self.line, introduction);
        let mut kept = self.lock();
        if kept.commanders.len() >= COMMANDERS_MAX {
            // One that neither commands nor does anything makes room: a program that is begun again and again keeps nobody out.
            let holder = self.line.with(|line, _| line.lease().map(|lease| lease.holder));
            let idle = kept
                .commanders
                .iter()
                .filter(|(_, (other, _))| Some(other.client) != holder && other.idle() > Duration::ZERO);
            let longest = idle.max_by_key(|(_, (other, _))| other.idle()).map(|(key, _)| key.clone())?;
            kept.commanders.remove(&longest);
        }
        kept.commanders.insert(key.to_owned(), (commander.clone(), lasts));
        Some(commander)
    }

    /// Who asks with this key, and how often at least.
    pub fn commander(&self, key: &str) -> Option<(Arc<Commander>, Duration)> {
        let found = self.lock().commanders.get(key).cloned()?;
        found.0.see();
        Some(found)
    }

    /// The client with this key goes.
    pub fn dismiss(&self, key: &str) {
        self.lock().commanders.remove(key);
    }

    /// Begins a job for a client, in its turn.
    ///
    /// # Errors
    ///
    /// [`Unable`]: nothing was begun.
    pub fn begin(
        self: &Arc<Self>,
        commander: &Arc<Commander>,
        turn: Turn,
        what: String,
        act: impl FnOnce(&Task<'_>, &mut Session<ClientPort>) -> (Done, Option<Problem>) + Send + 'static,
    ) -> Result<Job, Unable> {
        let client = commander.name.clone();
        let job = {
            let mut kept = self.lock();
            kept.last += 1;
            Job { number: kept.last, what, client, stage: Stage::Running, done: Done::default(), error: None }
        };
        // Before it can end.
        self.remember(job.clone());
        let (own, begun, whose) = (self.clone(), job.clone(), Arc::downgrade(commander));
        let unfinished = Unfinished { jobs: self.clone(), number: job.number };
        let work = move |session: &mut Session<ClientPort>, wishes: &Receiver<Wish>| {
            let Some(commander) = whose.upgrade() else { return (Done::default(), None) };
            let Job { number, what, client, .. } = begun;
            let Self { line, journal, arm, .. } = &*own;
            journal.write(Happening::Begun { job: number, what: what.clone(), client });
            act(
                &Task { wishes, job: number, what: &what, journal, line, commander: &commander, arm },
                session,
            )
        };
        let accepted =
            commander.begin(turn, job.number, work, move |(done, error)| unfinished.end(done, error));
        accepted.map(|()| job)
    }

    /// A job by its number.
    pub fn job(&self, number: u64) -> Option<Job> {
        self.lock().jobs.iter().find(|job| job.number == number).cloned()
    }

    /// Those that are remembered, oldest first.
    pub fn list(&self) -> Vec<Job> {
        self.lock().jobs.iter().cloned().collect()
    }

    /// How many go on, and how the others have ended.
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
        self.journal.write(Happening::Ended { job: number, outcome, error });
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A job that has not ended: where it does so by a fault of the agent, that is its end.
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
            let next = "GET /api/status shows where the arm is; look at what the agent printed";
            self.end(Done::default(), Some(Problem::new("fault", "the agent has a fault", next)));
        }
    }
}

impl Stage {
    /// In a word.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Finished => "finished",
            Self::Stopped => "stopped",
            Self::Failed => "failed",
        }
    }
}

/// What the journal says of the line itself.
#[derive(Default)]
struct Seen {
    holder: Option<String>,
    halt: u64,
    /// When the last one was written.
    halted: Option<Instant>,
    state: Option<(String, String, Vec<String>)>,
    lost: Option<String>,
}

/// Writes down what changes on the line, and forgets clients that do not come back, as long as there is an agent.
fn watch(jobs: &Weak<Jobs>) {
    let (mut seen, mut looked) = (Seen::default(), Instant::now());
    loop {
        let Some(jobs) = jobs.upgrade() else { return };
        see(&jobs, &mut seen);
        if looked.elapsed() >= Duration::from_secs(1) {
            looked = Instant::now();
            jobs.lock().commanders.retain(|_, (commander, lasts)| commander.idle() < *lasts + FORGOTTEN);
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
        let errors = jtc_host::words::causes(status);
        (status.state.name().to_owned(), status.trajectory.name().to_owned(), errors)
    });
    if holder != seen.holder {
        seen.holder.clone_from(&holder);
        jobs.journal.write(Happening::Lease { holder });
    }
    if halt != seen.halt && seen.halted.is_none_or(|at| at.elapsed() >= HALTS_APART) {
        (seen.halt, seen.halted) = (halt, Some(Instant::now()));
        let (by, command) = by;
        jobs.journal.write(Happening::Halt { command, by });
    }
    if state != seen.state {
        seen.state.clone_from(&state);
        if let Some((state, trajectory, errors)) = state {
            jobs.journal.write(Happening::State { state, trajectory, errors });
        }
    }
    if lost != seen.lost {
        seen.lost.clone_from(&lost);
        if let Some(why) = lost {
            jobs.journal.write(Happening::Lost { why });
        }
    }
}
