//! Recorder of the motions of all clients. The recorder is itself a client of the agent, with read-only access.
//!
//! The type [`Prepared`] opens the directory, [`Witness`] receives the frames on the serial line, and [`Recorder`] reads the statuses. A thread
//! reads the statuses and another thread writes the recordings. A slow disk therefore delays only the thread that writes the recordings.
//! The two threads of the recorder do not delay the serial line. If the queue between these threads is full, samples are dropped, and the
//! recording contains the number of dropped samples.
mod disk;
mod motion;
mod retention;

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use jtc_host::recording::{DeviceIdentity, RecordingInfo};
use jtc_host::session::StatusClock;
use jtc_host::{Arm, Sample, Session, Trajectory};
use jtc_wire::{ControllerState, FrameType, Status};

use crate::line::{Introduction, LineEvent, Policy, Role, may_change_the_arm};
use crate::owner::{ClientPort, Line};
use crate::upload::Upload;
use disk::Disk;
use motion::{Follower, Motion, Step};
use retention::Retention;

pub use disk::{Notice, Notify};

/// Largest number of frames that are queued for the thread that reads the statuses.
const SEEN_MAX: usize = 256;
/// Largest number of statuses that are queued while the recorder requests the identity of the controller.
const ARRIVED_MAX: usize = 1 << 12;
/// Longest wait for a status before the recorder checks whether it must end.
const LOOK: Duration = Duration::from_millis(50);
/// Time without a command after which the recorder may request the identity of the controller.
const QUIET: Duration = Duration::from_millis(300);
/// Time after which the recorder repeats its request for the identity, if the controller did not answer.
const ASK_AGAIN: Duration = Duration::from_secs(30);
/// Longest wait for the disk when the recorder ends.
const LAST_WORDS: Duration = Duration::from_secs(5);
/// Name of the recorder on the serial line.
const NAME: &str = "recorder of the agent";

/// Data that a recording needs about a frame to the controller, or about its answer.
enum Seen {
    /// Bytes of a Trajectory frame.
    Segment(Vec<u8>),
    /// Answer to a Trajectory frame; `true` if the controller accepted the frame.
    Answered(bool),
    /// Time when a Jog frame was sent.
    Jog(Duration),
    /// Time when a frame was sent that may change the arm.
    Change(Duration),
}

/// Receiver that passes events of the serial line to the recorder. Never waits for the recorder.
pub struct Witness {
    seen: SyncSender<Seen>,
    missed: Arc<AtomicBool>,
}

impl Witness {
    /// Processes an event of the serial line.
    pub fn see(&self, now: Duration, event: &LineEvent) {
        let seen = match event {
            LineEvent::Sent { frame_type: FrameType::Trajectory, bytes, .. } => Seen::Segment(bytes.clone()),
            LineEvent::Sent { frame_type: FrameType::Jog, .. } => Seen::Jog(now),
            LineEvent::Sent { frame_type, .. } if may_change_the_arm(*frame_type) => Seen::Change(now),
            LineEvent::Answered { response, .. } => match Upload::answer(response) {
                Some(accepted) => Seen::Answered(accepted),
                None => return,
            },
            _ => return,
        };
        if self.seen.try_send(seen).is_err() {
            self.missed.store(true, Ordering::Relaxed);
        }
    }
}

/// Directory for recordings, before the recorder begins.
pub struct Prepared {
    retention: Retention,
    witness: Option<Witness>,
    seen: Receiver<Seen>,
    missed: Arc<AtomicBool>,
}

impl Prepared {
    /// Opens or creates the directory for recordings. All recordings together use at most `limit` bytes.
    ///
    /// # Errors
    ///
    /// The directory cannot be created or written, or another agent uses the directory for its recordings.
    pub fn open(dir: &Path, limit: u64) -> io::Result<Self> {
        let (sender, seen) = sync_channel(SEEN_MAX);
        let missed = Arc::new(AtomicBool::new(false));
        let witness = Some(Witness { seen: sender, missed: missed.clone() });
        Ok(Self { retention: Retention::open(dir, limit)?, witness, seen, missed })
    }

    /// Returns the [`Witness`], which must receive each event of the serial line. Returns `None` at each later call.
    pub fn witness(&mut self) -> Option<Witness> {
        self.witness.take()
    }

    /// Begins to record the motions on `line`; `source` is the name of the line.
    ///
    /// # Errors
    ///
    /// The operating system cannot start threads.
    pub fn begin(self, line: Line, source: &str, notify: Notify) -> io::Result<Recorder> {
        let Self { retention, seen, missed, .. } = self;
        let (disk, writer) = Disk::begin(retention, notify)?;
        let ended = Arc::new(AtomicBool::new(false));
        let (source, own_ended) = (source.to_owned(), ended.clone());
        let follow = move || {
            let mut following = Following {
                seen,
                missed,
                disk,
                source,
                follower: Follower::default(),
                upload: Upload::default(),
                identity: Identity::built_in(),
                doubt: Some(Doubt { since: Duration::ZERO, asked: None }),
                reel: None,
            };
            following.run(&line, &own_ended);
        };
        let follower = std::thread::Builder::new().name("recorder".into()).spawn(follow)?;
        Ok(Recorder { ended, threads: vec![follower, writer] })
    }
}

/// Recorder that runs until this value is dropped.
pub struct Recorder {
    ended: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Recorder {
    /// Ends the current recording. Waits for a limited time until the recording is written.
    pub fn end(self) {}
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        let end = Instant::now() + LAST_WORDS;
        while self.threads.iter().any(|thread| !thread.is_finished()) && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

/// Identity of the controller and its arm.
struct Identity {
    arm: Arm,
    device: Option<DeviceIdentity>,
    hash: Option<u64>,
    delay_ticks: u8,
}

impl Identity {
    /// Returns the identity for a controller that does not report one: the built-in arm without device data. The hash
    /// is set, so the recorder does not request the arm of a controller that reports the same hash.
    fn built_in() -> Self {
        let arm = Arm::avena();
        Self { delay_ticks: arm.config().delay_ticks, hash: arm.hash().ok().flatten(), arm, device: None }
    }
}

/// State after a possible change of the arm, until the controller reports its arm again.
struct Doubt {
    /// Time since which the recorder does not know the arm.
    since: Duration,
    asked: Option<Duration>,
}

/// Recording that is in progress.
struct Reel {
    trajectory: Option<Arc<Trajectory>>,
    /// Clock of the recording. The clock starts at the first status.
    clock: Option<StatusClock>,
}

/// Queue of statuses with their arrival times, and number of statuses that did not fit into the queue.
type Arrived = Rc<RefCell<(VecDeque<(Duration, Status)>, u64)>>;

/// State of the thread that reads the statuses.
struct Following {
    seen: Receiver<Seen>,
    missed: Arc<AtomicBool>,
    disk: Disk,
    source: String,
    follower: Follower,
    upload: Upload,
    identity: Identity,
    doubt: Option<Doubt>,
    reel: Option<Reel>,
}

/// Adds a client with read-only access to the serial line. Returns the session of this client and the queue of received statuses.
fn connect(line: &Line) -> (Session<ClientPort>, Arrived) {
    let introduction = Introduction { name: NAME.into(), role: Role::Viewer, policy: Policy::Continue };
    let mut session = Session::new(line.connect(introduction));
    session.timeouts.tries = 2;
    let arrived = Arrived::default();
    let taken = arrived.clone();
    session.observe(move |now, status| {
        let (waiting, lost) = &mut *taken.borrow_mut();
        if waiting.len() == ARRIVED_MAX {
            waiting.pop_front();
            *lost += 1;
        }
        waiting.push_back((now, *status));
    });
    (session, arrived)
}

impl Following {
    fn run(&mut self, line: &Line, ended: &AtomicBool) {
        let (mut session, mut arrived) = connect(line);
        while !ended.load(Ordering::Relaxed) {
            if session.poll(LOOK).is_err() {
                if let Some(why) = line.lost() {
                    let steps = self.follower.end("fault", &why);
                    self.follow(steps, &mut session);
                    return;
                }
                // The line has disconnected the recorder's client, for example because the computer was suspended.
                // The recorder therefore adds a new client.
                (session, arrived) = connect(line);
            }
            self.take_seen();
            loop {
                let (next, lost) = {
                    let (waiting, lost) = &mut *arrived.borrow_mut();
                    (waiting.pop_front(), std::mem::take(lost))
                };
                self.disk.lose(lost);
                let Some((at, status)) = next else { break };
                self.look_at(at, &status);
                let steps = self.follower.status(at, &status);
                self.follow(steps, &mut session);
            }
            let steps = self.follower.silence(session.now());
            self.follow(steps, &mut session);
            self.resolve_doubt(&mut session);
        }
        let steps = self.follower.end("stopped", "the agent has ended");
        self.follow(steps, &mut session);
    }

    fn take_seen(&mut self) {
        if self.missed.swap(false, Ordering::Relaxed) {
            self.upload.forget();
            self.doubt.get_or_insert(Doubt { since: Duration::ZERO, asked: None });
        }
        while let Ok(seen) = self.seen.try_recv() {
            match seen {
                Seen::Segment(frame) => self.upload.sent(&frame),
                Seen::Answered(accepted) => self.upload.answered(accepted),
                Seen::Jog(at) => self.follower.jog(at),
                Seen::Change(at) => self.doubt = Some(Doubt { since: at, asked: None }),
            }
        }
    }

    /// Processes a status of the controller. After a restart, the controller contains no trajectory and may have another arm.
    fn look_at(&mut self, now: Duration, status: &Status) {
        if status.state.is_in(&[ControllerState::Start, ControllerState::Init]) {
            self.upload.forget();
            self.doubt = Some(Doubt { since: now, asked: None });
        }
    }

    /// Requests the identity of the controller if the identity is uncertain and no client sends commands. Sends as few requests as
    /// possible. Each request prevents host supervision from detecting a silent host (J-59).
    fn resolve_doubt(&mut self, session: &mut Session<ClientPort>) {
        let now = session.now();
        let due = self.doubt.as_ref().is_some_and(|doubt| {
            now.saturating_sub(doubt.since) >= QUIET
                && doubt.asked.is_none_or(|at| now.saturating_sub(at) >= ASK_AGAIN)
        });
        if due && !self.follower.is_recording() && session.last().is_some() {
            self.ask(session);
        }
    }

    /// Requests the identity of the controller. Also requests the arm if the arm has changed.
    fn ask(&mut self, session: &mut Session<ClientPort>) {
        let asked = Some(session.now());
        if let Some(doubt) = &mut self.doubt {
            doubt.asked = asked;
        }
        let identity = match session.info() {
            // The controller does not support the extensions of the protocol.
            Ok(None) => Some(Identity::built_in()),
            Ok(Some(info)) if self.identity.hash == Some(info.hash) => {
                self.identity.device = Some((&info).into());
                self.doubt = None;
                None
            }
            Ok(Some(info)) => session.device_arm().ok().map(|arm| Identity {
                delay_ticks: arm.config().delay_ticks,
                arm,
                device: Some((&info).into()),
                hash: Some(info.hash),
            }),
            Err(_) => None,
        };
        if let Some(identity) = identity {
            (self.identity, self.doubt) = (identity, None);
        }
    }

    fn follow(&mut self, steps: Vec<Step>, session: &mut Session<ClientPort>) {
        for step in steps {
            match step {
                Step::Begin(motion, from) => {
                    if self.doubt.as_ref().is_some_and(|doubt| doubt.asked.is_none()) {
                        self.ask(session);
                    }
                    self.begin(motion, from, session);
                }
                Step::Status(at, status) => {
                    let Some(reel) = &mut self.reel else { continue };
                    let begin = || StatusClock::begin(at, status.point);
                    let time_s = reel.clock.get_or_insert_with(begin).at(at, &status);
                    let sample = match &reel.trajectory {
                        Some(trajectory) => {
                            Sample::following(time_s, &status, trajectory, self.identity.delay_ticks)
                        }
                        None => Sample::from_status(time_s, &status),
                    };
                    self.disk.write(&sample);
                }
                Step::End(ending) => {
                    self.reel = None;
                    self.disk.close(ending);
                }
            }
        }
    }

    /// Begins a recording whose first status arrived at `from`.
    fn begin(&mut self, motion: Motion, from: Duration, session: &Session<ClientPort>) {
        let trajectory = match motion {
            Motion::Execution => self.upload.trajectory(true),
            Motion::Jog | Motion::Teaching => None,
        };
        let start = host_kit::unix_time().saturating_sub(session.now().saturating_sub(from));
        let mut info = RecordingInfo {
            source: self.source.clone(),
            commanded_by: session.port().line().http_session().unwrap_or_default(),
            trajectory: motion.name().to_owned(),
            start_unix_ns: start.as_nanos() as u64,
            commanded: trajectory.clone(),
            device: self.identity.device.clone(),
            ..RecordingInfo::of(&self.identity.arm)
        };
        info.hash = self.identity.hash;
        self.disk.open(info);
        self.reel = Some(Reel { trajectory, clock: None });
    }
}
