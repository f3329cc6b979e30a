//! The owner of a bus: one thread with a session on it, for all clients.
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use agent_kit::api::Problem;
use agent_kit::lease::{ClientId, Leases};
use host_kit::{Diagnose as _, ErrorKind};
use tokio::sync::{oneshot, watch};
use ucom::{Profile, Status};
use ucom_host::files::SignalTable;
use ucom_host::master::io::Snapshot;
use ucom_host::master::{Event, Master, Request, StopLevel, Supervision};
use ucom_host::session::{Boards, Cache, CleanupList, Driver, Followed, Known, Link, Operator, SessionError};

use crate::bus::Prompt;
use crate::happening::{Happening, Journal, Policy};
use crate::jobs::{Done, Job, Jobs, Stage};
use crate::picture::{Picture, Values};
use crate::work::{Kind, Queue, Work};

/// How often the picture is made anew.
const PICTURE: Duration = Duration::from_millis(40);
/// Longest wait of a turn.
const TURN: Duration = Duration::from_millis(5);
/// Before anything is asked the bus is listened to: another PC may be its master (D-08).
const LISTEN: Duration = Duration::from_millis(600);
/// For so long after somebody else's Stop nothing is begun that moves.
const CALM: Duration = Duration::from_secs(3);
/// Another PC that has sent nothing for so long is gone, µs.
const COMPETING_US: u64 = 3_000_000;

/// What is known of the boards beforehand.
#[derive(Clone, Debug, Default)]
pub struct Config {
    /// How they read the protocol.
    pub profile: Profile,
    /// What their words mean.
    pub signals: SignalTable,
    /// Where names are remembered.
    pub cache: Cache,
}

/// The Stops that were asked for.
#[derive(Default)]
struct Halts {
    count: u64,
    last: Option<(String, Option<ClientId>, Instant)>,
}

/// What the owner and those who ask it share.
pub(crate) struct Shared {
    start: Instant,
    picture: Mutex<Arc<Picture>>,
    changed: watch::Sender<()>,
    queue: Queue,
    halts: Mutex<Halts>,
    cancel: AtomicBool,
    ended: AtomicBool,
    lost: Mutex<Option<String>>,
    pub journal: Journal,
    pub jobs: Jobs,
    pub leases: Mutex<Leases<Policy>>,
    /// Who commanded when it was last looked.
    holder: Mutex<Option<String>>,
    /// This agent has started boards.
    runs: AtomicBool,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A panic of another thread leaves no half-done state behind that matters more than a Stop.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    /// Time of the agent.
    pub fn now(&self) -> Duration {
        self.start.elapsed()
    }

    /// The boards as last seen.
    pub fn picture(&self) -> Arc<Picture> {
        lock(&self.picture).clone()
    }

    /// Announces each new picture.
    pub fn changes(&self) -> watch::Receiver<()> {
        self.changed.subscribe()
    }

    /// Why the bus is gone; `None` while it is there.
    pub fn lost(&self) -> Option<String> {
        lock(&self.lost).clone()
    }

    /// Stops all boards, ahead of all else, and sees to it that they have stopped.
    pub fn halt(&self, by: &str, client: Option<ClientId>) {
        {
            let mut halts = lock(&self.halts);
            halts.count += 1;
            halts.last = Some((by.to_owned(), client, Instant::now()));
        }
        if self.queue.current().is_some_and(|(kind, _)| matches!(kind, Kind::Command | Kind::Question)) {
            self.cancel.store(true, Ordering::Relaxed);
        }
        self.journal.write(Happening::Halt { by: by.to_owned() });
        let act = |hands: Result<&mut Hands, Problem>| {
            if let Ok(hands) = hands {
                hands.see_to_stop();
            }
        };
        // Refused where the bus is gone only.
        let _ = self.queue.push(Work { kind: Kind::Stop, job: None, halt: 0, act: Box::new(act) });
    }

    /// Whether this client may begin something that moves.
    ///
    /// # Errors
    ///
    /// Somebody else has just stopped the boards.
    pub fn may_move(&self, client: ClientId) -> Result<(), Problem> {
        match &lock(&self.halts).last {
            Some((by, who, at)) if *who != Some(client) && at.elapsed() < CALM => Err(stopped(by)),
            _ => Ok(()),
        }
    }

    /// A lease that has lapsed ends, and what it moved follows its policy.
    pub fn look_at_lease(&self) {
        let (lapsed, holder) = {
            let mut leases = lock(&self.leases);
            (leases.lapse(self.now()), leases.lease().map(|lease| lease.holder))
        };
        let new = {
            let mut known = lock(&self.holder);
            let new = *known != holder;
            known.clone_from(&holder);
            new
        };
        if new {
            self.journal.write(Happening::Lease { holder });
        }
        if let Some(client) = lapsed
            && client.policy == Policy::Stop
            && self.runs.load(Ordering::Relaxed)
        {
            self.halt(&format!("the policy of {}, who has gone,", client.name), None);
        }
    }

    /// Has the owner do something soon, and waits for it.
    pub async fn call<T: Send + 'static>(
        &self,
        kind: Kind,
        act: impl FnOnce(&mut Hands) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let (answer, answered) = oneshot::channel();
        let act = move |hands: Result<&mut Hands, Problem>| {
            // Who has gone needs no answer.
            let _ = answer.send(hands.and_then(|hands| {
                let done = act(hands);
                hands.settle();
                done
            }));
        };
        let halt = lock(&self.halts).count;
        self.queue.push(Work { kind, job: None, halt, act: Box::new(act) })?;
        answered.await.unwrap_or_else(|_| Err(fault()))
    }

    /// Begins a job.
    pub fn begin(
        self: &Arc<Self>,
        kind: Kind,
        what: &str,
        client: &str,
        act: impl FnOnce(&mut Hands) -> Result<(Done, Option<Problem>), Problem> + Send + 'static,
    ) -> Result<Job, Problem> {
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
            // What was brought about before it was cancelled is its result all the same.
            let stage = match &error {
                None => Stage::Finished,
                Some(error) if error.code == CANCELLED || error.code == STOPPED => Stage::Cancelled,
                Some(_) => Stage::Failed,
            };
            unfinished.end(stage, done, error);
        };
        let halt = lock(&self.halts).count;
        let pushed = self.queue.push(Work { kind, job: Some(number), halt, act: Box::new(act) });
        pushed.map(|()| job).inspect_err(|_| self.jobs.remove(number))
    }

    /// Cancels a job: what it has to undo on the boards it still does. False: it does not go on.
    pub fn cancel(&self, number: u64) -> bool {
        let goes_on = self.queue.current().is_some_and(|(_, job)| job == Some(number));
        if goes_on {
            self.cancel.store(true, Ordering::Relaxed);
        }
        goes_on
    }
}

const CANCELLED: &str = "cancelled";
const STOPPED: &str = "stopped";

fn stopped(by: &str) -> Problem {
    let message = format!("{by} has stopped the boards: what was asked for before that is not done");
    Problem::new(STOPPED, message, "wait three seconds, and ask again when the boards may move")
}

fn fault() -> Problem {
    Problem::new("fault", "the agent has a fault", "look at what the agent printed")
        .kind(host_kit::ErrorKind::Fault)
}

/// A job that has not ended: where it does so by a fault of the agent, that is its end.
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

/// The thread that owns a bus.
pub struct Owner {
    pub(crate) shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Owner {
    /// Opens the bus of this URL, and asks who is there unless another PC is its master.
    ///
    /// # Errors
    ///
    /// The URL is none, or the bus cannot be opened.
    pub fn open(url: &str, config: Config) -> Result<Self, SessionError> {
        let bus = can_link::open(url).map_err(|e| SessionError::Open(Box::new(e)))?;
        let link = Link::on(Box::new(Prompt(bus)), url);
        let shared = Arc::new(Shared {
            start: Instant::now(),
            picture: Mutex::new(Arc::new(Picture::new(config.profile))),
            changed: watch::Sender::new(()),
            queue: Queue::default(),
            halts: Mutex::default(),
            cancel: AtomicBool::new(false),
            ended: AtomicBool::new(false),
            lost: Mutex::default(),
            journal: Journal::default(),
            jobs: Jobs::default(),
            leases: Mutex::default(),
            holder: Mutex::default(),
            runs: AtomicBool::new(false),
        });
        let own = shared.clone();
        let thread = std::thread::spawn(move || own_bus(&own, config, link));
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Looks whether the bus is gone, and why.
    pub fn lost(&self) -> impl Fn() -> Option<String> + Send + use<> {
        let shared = self.shared.clone();
        move || shared.lost()
    }

    /// Stops what runs, and lets the bus go.
    pub fn end(mut self) {
        self.join();
    }

    fn join(&mut self) {
        self.shared.ended.store(true, Ordering::Relaxed);
        self.shared.cancel.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic of that thread has been printed.
            drop(thread.join());
        }
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        self.join();
    }
}

/// The bus is gone when this is, also where its thread has panicked.
struct Gone<'a>(&'a Shared, String);

impl Drop for Gone<'_> {
    fn drop(&mut self) {
        let why = std::mem::take(&mut self.1);
        *lock(&self.0.lost) = Some(why.clone());
        self.0.queue.close();
        self.0.journal.write(Happening::Lost { why });
        self.0.changed.send_replace(());
    }
}

/// What the owner's thread remembers, also in the middle of a procedure.
struct Local {
    followed: Followed,
    snapshots: BTreeMap<u8, Snapshot>,
    known: BTreeMap<u8, Arc<Known>>,
    states: BTreeMap<u8, &'static str>,
    /// Boards whose applications this agent has started, and those whose control loops.
    started: BTreeSet<u8>,
    running: BTreeSet<u8>,
    halts_sent: u64,
    job: Option<u64>,
    competing_us: Option<u64>,
    now_us: u64,
    /// When the picture was made; `None`: it is to be made anew at once.
    published: Option<Instant>,
    /// What has happened and is written down behind the next picture: who reads of it finds it there.
    happened: Vec<Happening>,
}

/// The operator of the session.
struct Hand {
    shared: Arc<Shared>,
    local: Rc<RefCell<Local>>,
}

impl Operator for Hand {
    fn stop_asked(&self) -> bool {
        self.shared.cancel.load(Ordering::Relaxed)
    }

    fn note(&self, text: String) {
        let mut local = self.local.borrow_mut();
        let note = match local.job {
            Some(job) => Happening::JobNote { job, text },
            None => Happening::Note { text },
        };
        local.happened.push(note);
    }

    fn happened(&self, event: &Event, text: Option<String>) {
        let mut local = self.local.borrow_mut();
        let now_us = local.now_us;
        local.followed.see(event, now_us);
        let job = local.job;
        let mut write = Vec::new();
        match event {
            Event::Snapshot { board, snapshot } => drop(local.snapshots.insert(*board, snapshot.clone())),
            Event::Supervision { board, change } => {
                let (board, change) = match change {
                    Supervision::Late => (Some(*board), "late"),
                    Supervision::Lost => (Some(*board), "lost"),
                    Supervision::Back => (Some(*board), "back"),
                    Supervision::Rebooted { .. } => (Some(*board), "rebooted"),
                    Supervision::UnknownRebooted { .. } => (None, "rebooted"),
                };
                write.push(Happening::Heartbeat { board, change: change.into() });
            }
            Event::BoardError { board, code, .. } => write.push(Happening::BoardError {
                board: *board,
                code: code.number(),
                name: code.name().into(),
                meaning: code.meaning().into(),
            }),
            Event::Debug { board, text } => write.push(Happening::Text { board: *board, text: text.clone() }),
            Event::Progress { progress, .. } => {
                if let Some(job) = job {
                    let (boards, attempt, cycle) =
                        (progress.boards.clone(), progress.attempt, progress.cycle);
                    let (bytes, total) = (progress.bytes, progress.total);
                    write.push(Happening::Progress { job, boards, attempt, cycle, bytes, total });
                }
            }
            Event::CompetingMaster { .. } => {
                let new = local.competing_us.is_none_or(|at| now_us.saturating_sub(at) > COMPETING_US);
                local.competing_us = Some(now_us);
                if let Some(text) = text.filter(|_| new) {
                    write.push(Happening::Note { text });
                }
            }
            _ => write.extend(text.map(|text| match job {
                Some(job) => Happening::JobNote { job, text },
                None => Happening::Note { text },
            })),
        }
        local.happened.extend(write);
    }

    fn turned(&self, master: &mut Master, link: &mut Link) {
        let mut local = self.local.borrow_mut();
        local.now_us = link.now_us();
        let halts = lock(&self.shared.halts).count;
        if local.halts_sent < halts {
            local.halts_sent = halts;
            master.stop_at_once(local.now_us, None);
        }
        if !local.happened.is_empty() || local.published.is_none_or(|at| at.elapsed() >= PICTURE) {
            local.published = Some(Instant::now());
            self.publish(&mut local, master, link);
        }
    }
}

impl Hand {
    fn publish(&self, local: &mut Local, master: &Master, link: &mut Link) {
        let boards = master.boards();
        let states: BTreeMap<u8, &'static str> =
            boards.iter().map(|(number, board)| (number, board.state_name(local.now_us))).collect();
        for (number, state) in &states {
            if local.states.get(number) != Some(state) {
                let state = (*state).to_owned();
                local.happened.push(Happening::State { board: *number, state });
            }
        }
        local.states = states;
        let values = |(number, known): (&u8, &Arc<Known>)| {
            let outputs = local.snapshots.get(number).cloned();
            let (inputs, parameters) = (master.inputs(*number), master.parameters(*number));
            (*number, Values { known: known.clone(), outputs, inputs, parameters })
        };
        let picture = Picture {
            now_us: local.now_us,
            at: Instant::now(),
            profile: master.profile(),
            boards,
            statistics: master.statistics(),
            controller: link.controller(),
            is_master: master.is_master(),
            competing_us: local.competing_us.filter(|at| local.now_us.saturating_sub(*at) <= COMPETING_US),
            shared: master.shared_numbers().iter().map(ToString::to_string).collect(),
            values: local.known.iter().map(values).collect(),
        };
        *lock(&self.shared.picture) = Arc::new(picture);
        std::mem::take(&mut local.happened).into_iter().for_each(|event| self.shared.journal.write(event));
        self.shared.changed.send_replace(());
    }
}

/// The session, and what belongs to it.
pub(crate) struct Hands {
    pub driver: Driver,
    pub cache: Cache,
    pub signals: SignalTable,
    shared: Arc<Shared>,
    local: Rc<RefCell<Local>>,
}

fn own_bus(shared: &Arc<Shared>, config: Config, link: Link) {
    let mut gone = Gone(shared, "the agent has a fault".into());
    let local = Rc::new(RefCell::new(Local {
        followed: Followed::default(),
        snapshots: BTreeMap::new(),
        known: BTreeMap::new(),
        states: BTreeMap::new(),
        started: BTreeSet::new(),
        running: BTreeSet::new(),
        halts_sent: 0,
        job: None,
        competing_us: None,
        now_us: 0,
        published: None,
        happened: Vec::new(),
    }));
    let hand = Hand { shared: shared.clone(), local: local.clone() };
    let driver = Driver::new(config.profile, link, Box::new(hand), CleanupList::default());
    let Config { signals, cache, .. } = config;
    let mut hands = Hands { driver, cache, signals, shared: shared.clone(), local };
    match hands.serve() {
        Ok(()) => {
            hands.leave();
            gone.1 = "the agent was ended".into();
        }
        Err(error) => gone.1 = error.to_string(),
    }
}

impl Hands {
    /// Does what is asked for until the bus is gone or the agent ends.
    fn serve(&mut self) -> Result<(), SessionError> {
        let start = Instant::now();
        let mut looked = false;
        while !self.shared.ended.load(Ordering::Relaxed) {
            self.turn()?;
            if !looked && start.elapsed() >= LISTEN {
                looked = true;
                if self.local.borrow().competing_us.is_none() {
                    // Who is there is asked again whenever somebody wants to know; a bus that is gone is seen in the next turn.
                    let _ = self.driver.run(Request::Scan);
                }
            }
            self.shared.look_at_lease();
            while let Some(work) = self.shared.queue.take() {
                self.work(work);
                self.turn()?;
            }
        }
        Ok(())
    }

    /// Lets the bus go on for a moment.
    fn turn(&mut self) -> Result<(), SessionError> {
        self.driver.turn(TURN)?;
        while let Some(event) = self.driver.master.take_event() {
            self.driver.note_event(&event, None);
        }
        let now_us = self.driver.now_us();
        let notices = self.local.borrow_mut().followed.look(&mut self.driver.master, now_us);
        let events = notices.into_iter().map(|notice| {
            let (board, change) = (notice.board, notice.change.name().to_owned());
            Happening::Loop { board, change }
        });
        self.local.borrow_mut().happened.extend(events);
        Ok(())
    }

    /// What was done is in the picture, and what has happened is written down: before who asked for it knows that it is done.
    fn settle(&mut self) {
        self.local.borrow_mut().published = None;
        // A bus that is gone is seen in the next turn.
        let _ = self.driver.turn(Duration::ZERO);
    }

    fn work(&mut self, work: Work) {
        // What is asked in the background must not find a board busy.
        self.local.borrow_mut().followed.ask_no_more(&mut self.driver.master);
        // What was cancelled was what went on before. First, or a Stop that comes now were lost.
        self.shared.cancel.store(self.shared.ended.load(Ordering::Relaxed), Ordering::SeqCst);
        let halted = {
            let halts = lock(&self.shared.halts);
            let by = halts.last.as_ref().map(|(by, ..)| by.clone()).unwrap_or_default();
            (work.kind == Kind::Command && halts.count > work.halt).then_some(by)
        };
        self.local.borrow_mut().job = work.job;
        match halted {
            Some(by) => (work.act)(Err(stopped(&by))),
            None => (work.act)(Ok(self)),
        }
        self.local.borrow_mut().job = None;
        self.shared.queue.done();
    }

    /// An error of the session; where a Stop or the agent's end was its cause, that.
    pub fn problem(&self, error: &SessionError) -> Problem {
        if !error.is_cancelled() {
            let kind = match (error.kind(), error) {
                // The agent is there, and so is the bus: it is the board that is not.
                (
                    ErrorKind::NoLink,
                    SessionError::Procedure(_) | SessionError::NoBoards | SessionError::NoNumbers { .. },
                ) => ErrorKind::Device,
                (kind, _) => kind,
            };
            return Problem::diagnosed(error).kind(kind);
        }
        let halts = lock(&self.shared.halts);
        match &halts.last {
            Some((by, _, at)) if at.elapsed() < CALM => stopped(by),
            _ => Problem::new(CANCELLED, "it was cancelled", "ask for it again"),
        }
    }

    /// Asks each board after a Stop, and stops its application.
    fn see_to_stop(&mut self) {
        let stopped = self.driver.stop_each(&Boards::All, StopLevel::Application);
        let (boards, not_stopped) = match stopped {
            Ok(all) => {
                let failed = all.failed.iter().map(|(board, error)| format!("board {board}: {error}"));
                (all.boards.iter().map(|(board, _)| *board).collect(), failed.collect())
            }
            // Without a number no board runs.
            Err(SessionError::NoBoards | SessionError::NoNumbers { .. }) => (Vec::new(), Vec::new()),
            Err(error) => (Vec::new(), vec![error.to_string()]),
        };
        if not_stopped.is_empty() {
            self.runs_no_more(None);
        }
        self.local.borrow_mut().happened.push(Happening::Stopped { boards, not_stopped });
        self.settle();
    }

    /// Names and meanings of a board's values; asks for them where they are not known.
    pub fn known(&mut self, board: u8) -> Result<Arc<Known>, SessionError> {
        let kept = self.local.borrow().known.get(&board).cloned();
        let info = self.driver.master.boards().get(board).and_then(|board| board.info);
        let same = |known: &Arc<Known>| {
            info.is_some_and(|info| {
                (info.flash_number, info.program_id, info.date)
                    == (known.info.flash_number, known.info.program_id, known.info.date)
            })
        };
        if let Some(known) = kept.filter(same)
            && self.driver.master.description(board).is_some()
        {
            return Ok(known);
        }
        let started = info.is_some_and(|info| info.status.has(Status::MSTART));
        let known = match started {
            true => self.cache.described(&mut self.driver, &self.signals, board)?,
            false => self.cache.known(&mut self.driver, &self.signals, board)?,
        };
        Ok(self.knows(known))
    }

    /// The names of a board are known from now on, and its outputs are put together.
    pub fn knows(&mut self, known: Known) -> Arc<Known> {
        let known = Arc::new(known);
        self.driver.master.watch(known.board, Some(known.names.dimensions().so), true);
        self.local.borrow_mut().known.insert(known.board, known.clone());
        known
    }

    /// These boards run from now on.
    pub fn runs(&mut self, boards: &[u8]) {
        let now_us = self.driver.now_us();
        let mut local = self.local.borrow_mut();
        local.started.extend(boards);
        local.running.extend(boards);
        local.followed = Followed::new(local.running.clone().into_iter(), now_us);
        self.shared.runs.store(true, Ordering::Relaxed);
    }

    /// This board does not run any more, or none does; what it sent is no more its state.
    pub fn runs_no_more(&mut self, board: Option<u8>) {
        let now_us = self.driver.now_us();
        let mut local = self.local.borrow_mut();
        match board {
            Some(board) => {
                local.started.remove(&board);
                local.running.remove(&board);
                local.snapshots.remove(&board);
            }
            None => {
                local.started.clear();
                local.running.clear();
                local.snapshots.clear();
            }
        }
        local.followed = Followed::new(local.running.clone().into_iter(), now_us);
        self.shared.runs.store(!local.started.is_empty(), Ordering::Relaxed);
    }

    /// The application of this board was started.
    pub fn has_started(&mut self, board: u8) {
        self.local.borrow_mut().started.insert(board);
        self.shared.runs.store(true, Ordering::Relaxed);
    }

    /// The number or the application of this board is another one, or none.
    pub fn forget(&mut self, board: u8) {
        self.runs_no_more(Some(board));
        self.local.borrow_mut().known.remove(&board);
    }

    /// What is known of the values of a board.
    pub fn values_of(&self, known: &Arc<Known>) -> Values {
        let (master, board) = (&self.driver.master, known.board);
        let outputs = self.local.borrow().snapshots.get(&board).cloned();
        Values {
            known: known.clone(),
            outputs,
            inputs: master.inputs(board),
            parameters: master.parameters(board),
        }
    }

    /// The numbers of all boards are void.
    pub fn forget_all(&mut self) {
        self.runs_no_more(None);
        self.local.borrow_mut().known.clear();
    }

    /// Stops what this agent has started.
    fn leave(&mut self) {
        let started: Vec<u8> = self.local.borrow().started.iter().copied().collect();
        if !started.is_empty() {
            let not_stopped = self.driver.halt(&started, None);
            let not_stopped = not_stopped.iter().map(|board| format!("board {board}")).collect();
            self.shared.journal.write(Happening::Stopped { boards: started, not_stopped });
        }
    }
}
