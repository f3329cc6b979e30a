//! Session of an HTTP client, which has no connection to the serial line. Each HTTP request shows that the client still
//! runs.
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

/// Interval at which an idle client reads the statuses of the controller.
const LOOK: Duration = Duration::from_millis(50);

/// Error code of a request about a motion that has already ended.
const MOTION_ENDED: &str = "motion-ended";

/// Function that runs on the session of a client.
type Work = Box<dyn FnOnce(&mut Session<ClientPort>) + Send>;

/// Connection of a client to the serial line, with its session on a separate thread.
pub struct HttpSession {
    /// Number that identifies the client on the serial line.
    pub client: ClientId,
    /// Name of the client, which users see.
    pub name: String,
    work: SyncSender<Work>,
    /// Semaphore that permits one function at a time on the session.
    free: Arc<Semaphore>,
    /// Number of the current job, and the queue of requests for this job.
    job: Mutex<Option<(u64, SyncSender<Wish>)>>,
    seen: Mutex<Instant>,
    /// Policy of the client's lease.
    pub policy: Policy,
    /// `true` while a motion runs. A running motion accepts requests.
    moves: AtomicBool,
}

/// Request that a client makes while a motion runs, and the channel for its result.
pub struct Wish {
    /// Change of the running motion that the client requests.
    pub flow: Flow,
    /// Channel for the result of the request.
    pub done: oneshot::Sender<Result<(), Problem>>,
}

/// Permit to use the session of a client. Dropping the permit returns it.
pub struct Turn(#[expect(dead_code, reason = "held until it is over")] OwnedSemaphorePermit);

/// Reason why the session of a client cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unable {
    /// A job or another function uses the session. The value is the number of the job; `None` if no job uses the
    /// session.
    Busy(Option<u64>),
    /// The serial line was lost, or the client was disconnected.
    Gone,
}

impl HttpSession {
    /// Adds a client to the serial line `line`.
    pub fn new(line: &Line, introduction: Introduction) -> Arc<Self> {
        let (name, policy) = (introduction.name.clone(), introduction.policy);
        let port = line.connect(introduction);
        let client = port.client();
        // The channel has space for one function while the thread receives the previous function.
        let (work, incoming) = sync_channel(1);
        std::thread::spawn(move || serve(port, &incoming));
        let seen = Mutex::new(Instant::now());
        let (free, job, moves) = (Arc::new(Semaphore::new(1)), Mutex::default(), AtomicBool::new(false));
        Arc::new(Self { client, name, policy, work, free, job, seen, moves })
    }

    /// Records that the client has sent a request.
    pub fn see(&self) {
        *self.seen.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }

    /// Returns `true` while a motion runs.
    pub fn is_moving(&self) -> bool {
        self.moves.load(Ordering::Acquire)
    }

    /// Marks the start of a motion. From this time, the motion accepts requests of the client.
    pub fn motion_begins(&self) {
        self.moves.store(true, Ordering::Release);
    }

    /// Marks the end of a motion. Drops the requests that arrived too late, together with their result channels. The
    /// closed channel informs each requester that the motion has ended.
    pub fn motion_ended(&self, wishes: &Receiver<Wish>) {
        let _job = self.job.lock().unwrap_or_else(PoisonError::into_inner);
        self.moves.store(false, Ordering::Release);
        while wishes.try_recv().is_ok() {}
    }

    /// Returns the time since the last request of the client; 0 while the session of the client is busy.
    pub fn idle(&self) -> Duration {
        if self.free.available_permits() == 0 {
            return Duration::ZERO;
        }
        self.seen.lock().unwrap_or_else(PoisonError::into_inner).elapsed()
    }

    /// Returns the number of the client's current job.
    pub fn job(&self) -> Option<u64> {
        self.job.lock().unwrap_or_else(PoisonError::into_inner).as_ref().map(|(job, _)| *job)
    }

    /// Returns a permit for the session.
    ///
    /// # Errors
    ///
    /// [`Unable::Busy`] if the session is not free.
    pub fn turn(&self) -> Result<Turn, Unable> {
        self.free.clone().try_acquire_owned().map(Turn).map_err(|_| Unable::Busy(self.job()))
    }

    /// Waits for a permit, and runs a short function on the session.
    ///
    /// # Errors
    ///
    /// [`Unable::Gone`] if the serial line was lost or the client was disconnected.
    pub async fn call_in_turn<T: Send + 'static>(
        &self,
        act: impl FnOnce(&mut Session<ClientPort>) -> T + Send + 'static,
    ) -> Result<T, Unable> {
        let turn = self.free.clone().acquire_owned().await.map_err(|_| Unable::Gone)?;
        self.act(Turn(turn), act).await
    }

    /// Runs a function on the session; `turn` is the permit for the session.
    ///
    /// # Errors
    ///
    /// [`Unable::Gone`] if the serial line was lost or the client was disconnected.
    pub async fn act<T: Send + 'static>(
        &self,
        turn: Turn,
        act: impl FnOnce(&mut Session<ClientPort>) -> T + Send + 'static,
    ) -> Result<T, Unable> {
        let (done, result) = oneshot::channel();
        let work: Work = Box::new(move |session| {
            let came = act(session);
            // The session becomes free before the caller receives the result. The caller can therefore send its next
            // request at once.
            drop(turn);
            // The function has already run. If the caller has disconnected, the result is dropped.
            let _ = done.send(came);
        });
        self.work.try_send(work).map_err(|_| Unable::Gone)?;
        result.await.map_err(|_| Unable::Gone)
    }

    /// Runs a function on the session without waiting for its result; `turn` is the permit for the session. The call
    /// has no effect if the serial line was lost.
    pub fn tell(&self, turn: Turn, act: impl FnOnce(&mut Session<ClientPort>) + Send + 'static) {
        let work: Work = Box::new(move |session| {
            act(session);
            drop(turn);
        });
        drop(self.work.try_send(work));
    }

    /// Begins a job. While the job runs, the job receives the client's requests. When the job has ended and the session
    /// is free again, `then` is called with the job's result.
    ///
    /// # Errors
    ///
    /// [`Unable`] if the job was not begun.
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

    /// Sends a request to the running motion and waits for its result. Returns `None` if no motion runs.
    pub async fn wish(&self, flow: Flow) -> Option<Result<(), Problem>> {
        let done = self.wished(flow)?;
        Some(done.await.unwrap_or_else(|_| {
            let next = "find the outcome of the motion with GET /api/jobs";
            Err(Problem::new(MOTION_ENDED, "the motion ended before the command was applied", next))
        }))
    }

    fn wished(&self, flow: Flow) -> Option<oneshot::Receiver<Result<(), Problem>>> {
        let (done, result) = oneshot::channel();
        let job = self.job.lock().unwrap_or_else(PoisonError::into_inner);
        // `motion_ended` takes the lock that is held here, so a request for one motion never reaches the next motion.
        let (_, wishes) = job.as_ref().filter(|_| self.is_moving())?;
        wishes.try_send(Wish { flow, done }).ok().map(|()| result)
    }

    fn set_job(&self, job: Option<(u64, SyncSender<Wish>)>) {
        *self.job.lock().unwrap_or_else(PoisonError::into_inner) = job;
    }
}

/// Runs the queued functions on the session until no caller remains. Between two functions, the thread reads the
/// messages from the shared line, because the line disconnects a client that does not read.
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
