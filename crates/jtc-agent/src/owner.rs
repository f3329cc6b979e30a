//! The owner of a port: one thread that reads and writes it for all clients.
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

/// Longest that the owner waits for the device before it looks at what clients want: a Stop waits no longer for its turn.
const TURN: Duration = Duration::from_millis(2);

/// Longest that the end waits for what is on its way.
const LAST_TURNS: Duration = Duration::from_secs(1);

/// Called with what has happened, on the owner's thread: it is to return soon.
pub type Observer = Box<dyn FnMut(Duration, &LineEvent) + Send>;

struct State {
    line: SharedLine,
    /// The port is gone: why.
    lost: Option<String>,
}

struct Shared {
    state: Mutex<State>,
    /// Something was delivered: for those who block, and for those who do not.
    delivered: Condvar,
    changed: watch::Sender<()>,
    /// What the controller was given to follow.
    upload: Mutex<Upload>,
    /// Frames that may have changed the arm.
    arm_changes: AtomicU64,
    ended: AtomicBool,
    start: Instant,
    baud: Option<u32>,
    name: String,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        // A panic of another thread leaves no half-done state behind that matters more than a Stop.
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

/// The port is gone when this is, also where its thread has panicked.
struct Gone<'a>(&'a Shared, String);

impl Drop for Gone<'_> {
    fn drop(&mut self) {
        self.0.lock().lost = Some(std::mem::take(&mut self.1));
        self.0.wake();
    }
}

/// What clients and the API have of a line that a thread owns.
#[derive(Clone)]
pub struct Line(Arc<Shared>);

impl Line {
    /// Time of the line: since its owner began.
    pub fn now(&self) -> Duration {
        self.0.now()
    }

    /// Something with the line, now.
    pub fn with<T>(&self, act: impl FnOnce(&mut SharedLine, Duration) -> T) -> T {
        act(&mut self.0.lock().line, self.0.now())
    }

    /// Rate of the line, Bd, if it has one.
    pub fn baud(&self) -> Option<u32> {
        self.0.baud
    }

    /// Something may have been delivered.
    pub fn changes(&self) -> watch::Receiver<()> {
        self.0.changed.subscribe()
    }

    /// Number of the last Stop or Pause.
    pub fn last_halt(&self) -> u64 {
        self.0.lock().line.last_halt()
    }

    /// Waits until something is delivered, at most so long.
    pub fn wait(&self, timeout: Duration) {
        // Whoever waits looks for itself, whatever woke it.
        drop(self.0.delivered.wait_timeout(self.0.lock(), timeout));
    }

    /// Those who wait for something look whether it is there.
    pub fn wake(&self) {
        self.0.wake();
    }

    /// Why the port is gone; `None` while it is there.
    pub fn lost(&self) -> Option<String> {
        self.0.lock().lost.clone()
    }

    /// The values of a status, with the commanded ones where it executes a trajectory that was seen to be given to the controller: they
    /// stand in no status. Measurements are so many ticks old (J-62).
    pub fn sample(&self, status: &Status, delay_ticks: u8) -> Sample {
        let given = self.0.upload.lock().unwrap_or_else(PoisonError::into_inner).trajectory(false);
        match given {
            Some(trajectory) => Sample::following(0.0, status, &trajectory, delay_ticks),
            None => Sample::from_status(0.0, status),
        }
    }

    /// Joint positions that are commanded, rad, where the arm follows a trajectory that was seen to be given to the controller.
    pub fn commanded(&self, status: &Status) -> Option<[f64; JOINTS]> {
        let positions = self.sample(status, 0).joints.map(|joint| joint.set_position);
        positions.iter().all(|position| position.is_finite()).then_some(positions)
    }

    /// Frames that may have changed the arm of the controller.
    pub fn arm_changes(&self) -> u64 {
        self.0.arm_changes.load(Ordering::Relaxed)
    }

    /// Name of the client that commands now.
    pub fn commander(&self) -> Option<String> {
        self.with(|line, _| line.introduction(line.lease()?.holder).map(|client| client.name.clone()))
    }

    /// A client comes; it goes when what is returned is dropped.
    pub fn join(&self, introduction: Introduction) -> Joined {
        let client = self.with(|line, _| line.join(introduction));
        Joined { line: self.clone(), client }
    }

    /// A client's port: whatever speaks over a serial port speaks over it.
    pub fn connect(&self, introduction: Introduction) -> ClientPort {
        ClientPort { joined: self.join(introduction), read: Vec::new(), denied: None }
    }
}

/// A client, as long as it is there.
pub struct Joined {
    line: Line,
    client: ClientId,
}

impl Joined {
    /// Its number.
    pub fn client(&self) -> ClientId {
        self.client
    }
}

impl Drop for Joined {
    fn drop(&mut self) {
        self.line.with(|line, now| line.leave(self.client, now));
    }
}

/// The thread that owns the port.
pub struct Owner {
    line: Line,
    thread: Option<JoinHandle<()>>,
}

impl Owner {
    /// Takes a port. `observer` sees everything that happens on the line.
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

    /// The line.
    pub fn line(&self) -> Line {
        self.line.clone()
    }

    /// Lets the port go, when what is on its way is written.
    pub fn end(mut self) {
        self.join();
    }

    fn join(&mut self) {
        self.line.0.ended.store(true, Ordering::Relaxed);
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

/// Reads and writes until the port is gone or nobody wants it any more.
fn own_port(shared: &Shared, mut port: impl Port, mut observer: Observer) {
    let mut gone = Gone(shared, "the agent has a fault".to_owned());
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
            gone.1 = "the agent was ended".to_owned();
            return;
        }
    }
}

/// What is to be written, what there is to read, and who is to know.
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

/// A client's end of the line.
pub struct ClientPort {
    joined: Joined,
    /// Bytes that were delivered and not read yet.
    read: Vec<u8>,
    denied: Option<Denied>,
}

impl ClientPort {
    /// Whose it is.
    pub fn client(&self) -> ClientId {
        self.joined.client
    }

    /// The line that it is of.
    pub fn line(&self) -> &Line {
        &self.joined.line
    }

    fn shared(&self) -> &Shared {
        &self.joined.line.0
    }

    /// What was delivered, waiting for it at most so long.
    ///
    /// # Errors
    ///
    /// [`PortError::Gone`] when the port is, or when this client was put out.
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
