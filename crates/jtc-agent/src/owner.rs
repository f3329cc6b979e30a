//! Owner of a serial port: a thread that reads and writes the port for all clients.
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use jtc_host::sample::Sample;
use jtc_host::{Port, PortError};
use jtc_wire::{JOINTS, Status};
use tokio::sync::watch;

use crate::line::{ClientId, Delivery, Denied, Introduction, LineEvent, SharedLine, may_change_the_arm};
use crate::upload::Upload;

/// Longest wait for bytes from the controller before the thread handles the requests of clients. A Stop therefore
/// waits at most for this time before it is written.
const TURN: Duration = Duration::from_millis(2);

/// Longest time for which the owner, when it ends, waits for its last frames and for the confirmation of a Stop.
const LAST_TURNS: Duration = Duration::from_secs(1);

/// Callback for each event on the serial line. The callback runs on the owner's thread, so it must return quickly.
pub type Observer = Box<dyn FnMut(Duration, &LineEvent) + Send>;

struct State {
    line: SharedLine,
    /// Reason why the port was lost.
    lost: Option<String>,
}

struct Shared {
    state: Mutex<State>,
    /// Condition variable that wakes blocking callers when a delivery arrives. Asynchronous callers use the channel
    /// `changes` instead.
    delivered: Condvar,
    changed: watch::Sender<()>,
    /// Trajectory that was uploaded to the controller.
    upload: Mutex<Upload>,
    /// Number of sent frames that may have changed the arm of the controller.
    arm_changes: AtomicU64,
    ended: AtomicBool,
    start: Instant,
    baud: Option<u32>,
    name: String,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // The lock is used even after a panic of another thread. A Stop is more important than a consistent state.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    fn wake(&self) {
        self.delivered.notify_all();
        self.changed.send_replace(());
    }
}

/// Guard that marks the port as lost when it is dropped, even after a panic of the owner thread.
struct Gone<'a>(&'a Shared, String);

impl Drop for Gone<'_> {
    fn drop(&mut self) {
        self.0.lock().lost = Some(std::mem::take(&mut self.1));
        self.0.wake();
    }
}

/// Handle through which clients and the API use the serial line. A separate thread owns the serial line.
#[derive(Clone)]
pub struct Line(Arc<Shared>);

impl Line {
    /// Returns the time since the start of the thread that owns the serial line.
    pub fn now(&self) -> Duration {
        self.0.now()
    }

    /// Calls a function with the serial line and the present time of the line.
    pub fn with<T>(&self, act: impl FnOnce(&mut SharedLine, Duration) -> T) -> T {
        act(&mut self.0.lock().line, self.0.now())
    }

    /// Returns the bit rate of the serial line in Bd; `None` if the line has no bit rate.
    pub fn baud(&self) -> Option<u32> {
        self.0.baud
    }

    /// Returns a receiver that announces that clients may have new deliveries.
    pub fn changes(&self) -> watch::Receiver<()> {
        self.0.changed.subscribe()
    }

    /// Returns the number of the last Stop or Pause.
    pub fn last_halt(&self) -> u64 {
        self.0.lock().line.last_halt()
    }

    /// Waits for a delivery to any client, at most for `timeout`.
    pub fn wait(&self, timeout: Duration) {
        // The result is not used, because the caller itself checks why the wait has ended.
        drop(self.0.delivered.wait_timeout(self.0.lock(), timeout));
    }

    /// Wakes all callers that wait for a delivery.
    pub fn wake(&self) {
        self.0.wake();
    }

    /// Returns the reason why the port was lost; `None` while the port is available.
    pub fn lost(&self) -> Option<String> {
        self.0.lock().lost.clone()
    }

    /// Returns the values in a status as a sample. Adds the commanded values, which a status does not contain, if a
    /// client uploaded the executed trajectory through this agent. `delay_ticks` is the age of the measurements in
    /// ticks (J-62).
    pub fn sample(&self, status: &Status, delay_ticks: u8) -> Sample {
        let given = self.0.upload.lock().unwrap_or_else(PoisonError::into_inner).trajectory(false);
        match given {
            Some(trajectory) => Sample::following(0.0, status, &trajectory, delay_ticks),
            None => Sample::from_status(0.0, status),
        }
    }

    /// Returns the commanded joint positions, rad. Returns `None` if no client uploaded the executed trajectory
    /// through this agent.
    pub fn commanded(&self, status: &Status) -> Option<[f64; JOINTS]> {
        let positions = self.sample(status, 0).joints.map(|joint| joint.set_position);
        positions.iter().all(|position| position.is_finite()).then_some(positions)
    }

    /// Returns the number of sent frames that may have changed the controller's arm.
    pub fn arm_changes(&self) -> u64 {
        self.0.arm_changes.load(Ordering::Relaxed)
    }

    /// Returns the name of the lease holder.
    pub fn http_session(&self) -> Option<String> {
        self.with(|line, _| line.introduction(line.lease()?.holder).map(|client| client.name.clone()))
    }

    /// Adds a client to the serial line. The client is removed when the returned guard is dropped.
    pub fn join(&self, introduction: Introduction) -> Joined {
        let client = self.with(|line, _| line.join(introduction));
        Joined { line: self.clone(), client }
    }

    /// Adds a client and returns its port, for programs that expect a serial port.
    pub fn connect(&self, introduction: Introduction) -> ClientPort {
        ClientPort { joined: self.join(introduction), read: Vec::new(), denied: None }
    }
}

/// Guard of a client on the serial line, which removes the client when it is dropped.
pub struct Joined {
    line: Line,
    client: ClientId,
}

impl Joined {
    /// Returns the number of the client.
    pub fn client(&self) -> ClientId {
        self.client
    }
}

impl Drop for Joined {
    fn drop(&mut self) {
        self.line.with(|line, now| line.leave(self.client, now));
    }
}

/// Thread that owns the serial port.
pub struct Owner {
    line: Line,
    thread: Option<JoinHandle<()>>,
}

impl Owner {
    /// Starts the thread that owns `port`. `observer` receives every event on the serial line.
    pub fn new(port: impl Port + Send + 'static, observer: Observer) -> Self {
        let shared = Arc::new(Shared {
            state: Mutex::new(State { line: SharedLine::new(port.baud()), lost: None }),
            delivered: Condvar::new(),
            changed: watch::Sender::new(()),
            upload: Mutex::default(),
            arm_changes: AtomicU64::new(0),
            ended: AtomicBool::new(false),
            start: Instant::now(),
            baud: port.baud(),
            name: port.name(),
        });
        let own = shared.clone();
        let thread = std::thread::spawn(move || own_port(&own, port, observer));
        Self { line: Line(shared), thread: Some(thread) }
    }

    /// Returns the serial line.
    pub fn line(&self) -> Line {
        self.line.clone()
    }

    /// Ends the thread, which releases the port. The thread first waits until the line is idle, for at most 1 s.
    pub fn end(mut self) {
        self.join();
    }

    fn join(&mut self) {
        self.line.0.ended.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // If the owner thread has panicked, the panic was already printed.
            drop(thread.join());
        }
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        self.join();
    }
}

/// Reads and writes the port until the port is lost or the thread must end. Before it ends, the thread continues to
/// serve the port until the serial line is idle, for at most 1 s. If the port is lost, the thread ends at once.
fn own_port(shared: &Shared, mut port: impl Port, mut observer: Observer) {
    let mut gone = Gone(shared, "internal error of the agent".to_owned());
    let mut last_turns = None;
    loop {
        if let Err(error) = turn(shared, &mut port, &mut observer) {
            gone.1 = error.to_string();
            return;
        }
        if !shared.ended.load(Ordering::Relaxed) {
            continue;
        }
        let end = *last_turns.get_or_insert_with(|| shared.now() + LAST_TURNS);
        if shared.lock().line.is_idle() || shared.now() >= end {
            gone.1 = "the agent has ended".to_owned();
            return;
        }
    }
}

/// Writes the next bytes to the port, reads the received bytes, and calls the observer.
fn turn(shared: &Shared, port: &mut impl Port, observer: &mut Observer) -> Result<(), PortError> {
    let (now, bytes, due) = {
        let mut state = shared.lock();
        let now = shared.now();
        (now, state.line.to_device(now), state.line.due(now))
    };
    if !bytes.is_empty() {
        port.write_all(&bytes)?;
        let mut state = shared.lock();
        let now = shared.now();
        state.line.handed_over(now);
    }
    let wait = due.map_or(TURN, |due| due.saturating_sub(now).min(TURN));
    let mut buffer = [0; 4096];
    let read = port.read(&mut buffer, wait)?;
    let now = shared.now();
    let events = {
        let mut state = shared.lock();
        state.line.from_device(&buffer[..read], now);
        state.line.take_events()
    };
    if read > 0 || !events.is_empty() {
        shared.wake();
    }
    for event in events.iter().filter(|event| Upload::is_of(event)) {
        shared.upload.lock().unwrap_or_else(PoisonError::into_inner).see(event);
    }
    let changes = |event: &&LineEvent| matches!(event, LineEvent::Sent { frame_type, .. } if may_change_the_arm(*frame_type));
    shared.arm_changes.fetch_add(events.iter().filter(changes).count() as u64, Ordering::Relaxed);
    events.iter().for_each(|event| observer(now, event));
    Ok(())
}

/// Connection of a client to the serial line.
pub struct ClientPort {
    joined: Joined,
    /// Bytes that were delivered to the client, but that the client has not read yet.
    read: Vec<u8>,
    denied: Option<Denied>,
}

impl ClientPort {
    /// Returns the number of the client.
    pub fn client(&self) -> ClientId {
        self.joined.client
    }

    /// Returns the serial line of this connection.
    pub fn line(&self) -> &Line {
        &self.joined.line
    }

    fn shared(&self) -> &Shared {
        &self.joined.line.0
    }

    /// Returns the deliveries to the client; waits for them at most for `timeout`.
    ///
    /// # Errors
    ///
    /// [`PortError::Gone`] if the port was lost or the agent disconnected this client.
    pub fn deliveries(&mut self, timeout: Duration) -> Result<Vec<Delivery>, PortError> {
        let end = Instant::now() + timeout;
        let mut state = self.shared().lock();
        loop {
            let deliveries = state.line.take_deliveries(self.joined.client);
            let gone = || PortError::Gone { path: self.shared().name.clone() };
            match deliveries {
                Some(deliveries) if !deliveries.is_empty() => return Ok(deliveries),
                _ if state.lost.is_some() => return Err(gone()),
                None => return Err(gone()),
                Some(_) => {}
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(Vec::new());
            }
            let waited = self.shared().delivered.wait_timeout(state, left);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl Port for ClientPort {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        if self.read.is_empty() {
            for delivery in self.deliveries(timeout)? {
                match delivery {
                    Delivery::Bytes(bytes) => self.read.extend(bytes),
                    Delivery::Denied(denied) => self.denied = Some(denied),
                    Delivery::LeaseDenied(_) | Delivery::LeaseWanted(_) => {}
                }
            }
        }
        let n = buffer.len().min(self.read.len());
        buffer[..n].copy_from_slice(&self.read[..n]);
        self.read.drain(..n);
        Ok(n)
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let now = self.shared().now();
        let mut state = self.shared().lock();
        if state.lost.is_some() {
            return Err(PortError::Gone { path: self.shared().name.clone() });
        }
        state.line.from_client(self.joined.client, bytes, now);
        Ok(())
    }

    fn now(&self) -> Duration {
        self.shared().now()
    }

    fn baud(&self) -> Option<u32> {
        self.shared().baud
    }

    fn name(&self) -> String {
        self.shared().name.clone()
    }

    fn take_denial(&mut self) -> Option<String> {
        self.denied.take().map(|denied| denied.to_string())
    }
}
