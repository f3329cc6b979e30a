//! A client that has no connection of its own: it asks by HTTP, and shows by each request that it is there.
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use agent_kit::api::Problem;
use jtc_host::Session;
use jtc_host::session::Flow;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};

use crate::line::{ClientId, Introduction, Policy};
use crate::owner::{ClientPort, Line};

/// How often a client without work takes in what the controller reports.
const LOOK: Duration = Duration::from_millis(50);

/// The code of what was wished of a motion that had ended before.
const MOTION_ENDED: &str = "motion-ended";

/// What a client has its end of the line do.
type Work = Box<dyn FnOnce(&mut Session<ClientPort>) + Send>;

/// A client's end of the line, with a session on a thread of its own.
pub struct Commander {
    /// Its number on the line.
    pub client: ClientId,
    /// What people call it.
    pub name: String,
    work: SyncSender<Work>,
    /// One thing at a time.
    free: Arc<Semaphore>,
    /// The job that is going on, and what is wished of it.
    job: Mutex<Option<(u64, SyncSender<Wish>)>>,
    seen: Mutex<Instant>,
    /// The policy that its lease was taken with.
    pub policy: Policy,
    /// A motion is going on, and what is wished of it is done.
    moves: AtomicBool,
}

/// What is wished of a motion, and who is to know what came of it.
pub struct Wish {
    /// What.
    pub flow: Flow,
    /// Receives what came of it.
    pub done: oneshot::Sender<Result<(), Problem>>,
}

/// The turn to do something with a client's end of the line; it is over when this is dropped.
pub struct Turn(#[expect(dead_code, reason = "held until it is over")] OwnedSemaphorePermit);

/// Why a client's end of the line does nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unable {
    /// It is at something else: this job, where it is one.
    Busy(Option<u64>),
    /// The line is gone, or the client was put out.
    Gone,
}

impl Commander {
    /// A client of this line from now on.
    pub fn new(line: &Line, introduction: Introduction) -> Arc<Self> {
        let (name, policy) = (introduction.name.clone(), introduction.policy);
        let port = line.connect(introduction);
        let client = port.client();
        // One waits while the one before is being taken.
        let (work, incoming) = sync_channel(1);
        std::thread::spawn(move || serve(port, &incoming));
        let seen = Mutex::new(Instant::now());
        let (free, job, moves) = (Arc::new(Semaphore::new(1)), Mutex::default(), AtomicBool::new(false));
        Arc::new(Self { client, name, policy, work, free, job, seen, moves })
    }

    /// It has asked for something.
    pub fn see(&self) {
        *self.seen.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }

    /// A motion is going on.
    pub fn is_moving(&self) -> bool {
        self.moves.load(Ordering::Acquire)
    }

    /// A motion begins: what is wished of it is done from then on.
    pub fn motion_begins(&self) {
        self.moves.store(true, Ordering::Release);
    }

    /// A motion has ended. What was wished of it too late is known to have been: its senders are dropped.
    pub fn motion_ended(&self, wishes: &Receiver<Wish>) {
        let _job = self.job.lock().unwrap_or_else(PoisonError::into_inner);
        self.moves.store(false, Ordering::Release);
        while wishes.try_recv().is_ok() {}
    }

    /// For how long it has not asked for anything, nor has it anything going on.
    pub fn idle(&self) -> Duration {
        if self.free.available_permits() == 0 {
            return Duration::ZERO;
        }
        self.seen.lock().unwrap_or_else(PoisonError::into_inner).elapsed()
    }

    /// The job that is going on.
    pub fn job(&self) -> Option<u64> {
        self.job.lock().unwrap_or_else(PoisonError::into_inner).as_ref().map(|(job, _)| *job)
    }

    /// The turn to do something, where nothing else is going on.
    ///
    /// # Errors
    ///
    /// [`Unable::Busy`].
    pub fn turn(&self) -> Result<Turn, Unable> {
        self.free.clone().try_acquire_owned().map(Turn).map_err(|_| Unable::Busy(self.job()))
    }

    /// Does something that is soon over when its turn has come.
    ///
    /// # Errors
    ///
    /// [`Unable::Gone`].
    pub async fn call_in_turn<T: Send + 'static>(
        &self,
        act: impl FnOnce(&mut Session<ClientPort>) -> T + Send + 'static,
    ) -> Result<T, Unable> {
        let turn = self.free.clone().acquire_owned().await.map_err(|_| Unable::Gone)?;
        self.act(Turn(turn), act).await
    }

    /// Does something in its turn.
    ///
    /// # Errors
    ///
    /// [`Unable::Gone`].
    pub async fn act<T: Send + 'static>(
        &self,
        turn: Turn,
        act: impl FnOnce(&mut Session<ClientPort>) -> T + Send + 'static,
    ) -> Result<T, Unable> {
        let (done, result) = oneshot::channel();
        let work: Work = Box::new(move |session| {
            let came = act(session);
            // Free again before anybody knows: it can be asked for the next thing at once.
            drop(turn);
            // Whoever asked may have gone; what was asked for is done all the same.
            let _ = done.send(came);
        });
        self.work.try_send(work).map_err(|_| Unable::Gone)?;
        result.await.map_err(|_| Unable::Gone)
    }

    /// Does something in its turn that nobody waits for; nothing where the line is gone.
    pub fn tell(&self, turn: Turn, act: impl FnOnce(&mut Session<ClientPort>) + Send + 'static) {
        let work: Work = Box::new(move |session| {
            act(session);
            drop(turn);
        });
        drop(self.work.try_send(work));
    }

    /// Begins a job, which is given what is wished of it on the way; `then` is called when the next thing can be asked for.
    ///
    /// # Errors
    ///
    /// [`Unable`]: nothing was begun.
    pub fn begin<T>(
        self: &Arc<Self>,
        turn: Turn,
        job: u64,
        act: impl FnOnce(&mut Session<ClientPort>, &Receiver<Wish>) -> T + Send + 'static,
        then: impl FnOnce(T) + Send + 'static,
    ) -> Result<(), Unable> {
        let (wishes, wished) = sync_channel(4);
        self.set_job(Some((job, wishes)));
        let own = Arc::downgrade(self);
        let work: Work = Box::new(move |session| {
            let came = act(session, &wished);
            if let Some(own) = own.upgrade() {
                own.see();
                own.set_job(None);
            }
            drop(turn);
            then(came);
        });
        self.work.try_send(work).map_err(|_| {
            self.set_job(None);
            Unable::Gone
        })
    }

    /// Wishes something of the motion that is going on, and waits for what comes of it. `None`: no motion is going on.
    pub async fn wish(&self, flow: Flow) -> Option<Result<(), Problem>> {
        let done = self.wished(flow)?;
        Some(done.await.unwrap_or_else(|_| {
            let next = "GET /api/jobs shows how";
            Err(Problem::new(MOTION_ENDED, "the motion had ended before this was done", next))
        }))
    }

    fn wished(&self, flow: Flow) -> Option<oneshot::Receiver<Result<(), Problem>>> {
        let (done, result) = oneshot::channel();
        let job = self.job.lock().unwrap_or_else(PoisonError::into_inner);
        // Under the lock that the end of a motion takes: it is not done in the next one.
        let (_, wishes) = job.as_ref().filter(|_| self.is_moving())?;
        wishes.try_send(Wish { flow, done }).ok().map(|()| result)
    }

    fn set_job(&self, job: Option<(u64, SyncSender<Wish>)>) {
        *self.job.lock().unwrap_or_else(PoisonError::into_inner) = job;
    }
}

/// Does what is asked until nobody can ask any more; takes in what comes meanwhile, or it would be put out.
fn serve(port: ClientPort, work: &Receiver<Work>) {
    let mut session = Session::new(port);
    loop {
        match work.recv_timeout(LOOK) {
            Ok(work) => work(&mut session),
            Err(RecvTimeoutError::Disconnected) => return,
            Err(RecvTimeoutError::Timeout) => loop {
                match session.poll(Duration::ZERO) {
                    Ok(Some(_)) => {}
                    Ok(None) => break,
                    Err(_) => return,
                }
            },
        }
    }
}
