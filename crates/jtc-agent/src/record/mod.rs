//! Recordings of every motion, whoever commanded it: a client of the agent that only looks.
//!
//! [`Prepared`] opens the directory, [`Witness`] sees what goes over the line, [`Recorder`] follows the statuses. Two threads do that: one
//! follows, and one writes, which a slow disk holds up alone. Neither holds up the line: what finds no room between them is counted, and
//! the recording states how much.
mod disk;
mod motion;
mod shelf;

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
use shelf::Shelf;

pub use disk::{Notice, Notify};

/// Frames that wait for the follower.
const SEEN_MAX: usize = 256;
/// Statuses that wait while the controller is asked who it is.
const ARRIVED_MAX: usize = 1 << 12;
/// Longest that is waited for a status before it is looked whether all is to end.
const LOOK: Duration = Duration::from_millis(50);
/// A line on which nothing was commanded for so long is quiet: the controller may be asked who it is.
const QUIET: Duration = Duration::from_millis(300);
/// A controller that did not answer is asked again after this time.
const ASK_AGAIN: Duration = Duration::from_secs(30);
/// Longest that the end waits for the disk.
const LAST_WORDS: Duration = Duration::from_secs(5);
/// As others see the recorder on the line.
const NAME: &str = "recorder of the agent";

/// What goes to the controller, as far as recordings need it.
enum Seen {
    /// A Trajectory frame.
    Segment(Vec<u8>),
    /// Whether such a frame was accepted.
    Answered(bool),
    /// A Jog, at this time of the line.
    Jog(Duration),
    /// Something that may change the arm, at this time of the line.
    Change(Duration),
}

/// Sees what happens on the line, for the recorder. It never waits.
pub struct Witness {
    seen: SyncSender<Seen>,
    missed: Arc<AtomicBool>,
}

impl Witness {
    /// Something happened on the line.
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

/// A directory for recordings, and what is needed to begin.
pub struct Prepared {
    shelf: Shelf,
    witness: Option<Witness>,
    seen: Receiver<Seen>,
    missed: Arc<AtomicBool>,
}

impl Prepared {
    /// Opens the directory, or makes it; recordings take no more than `limit` bytes of it.
    ///
    /// # Errors
    ///
    /// It cannot be made or written to, or another agent records into it.
    pub fn open(dir: &Path, limit: u64) -> io::Result<Self> {
        let (sender, seen) = sync_channel(SEEN_MAX);
        let missed = Arc::new(AtomicBool::new(false));
        let witness = Some(Witness { seen: sender, missed: missed.clone() });
        Ok(Self { shelf: Shelf::open(dir, limit)?, witness, seen, missed })
    }

    /// Sees what happens on the line: for the observer of its owner. There is one.
    pub fn witness(&mut self) -> Option<Witness> {
        self.witness.take()
    }

    /// Begins to record what happens on `line`, which `source` is a name of.
    ///
    /// # Errors
    ///
    /// The system has no threads.
    pub fn begin(self, line: Line, source: &str, notify: Notify) -> io::Result<Recorder> {
        let Self { shelf, seen, missed, .. } = self;
        let (disk, writer) = Disk::begin(shelf, notify)?;
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

/// Records until it is dropped.
pub struct Recorder {
    ended: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Recorder {
    /// Ends a recording that is being made, and waits until it is written; not for ever for a disk that does not take it.
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

/// Who the controller is.
struct Identity {
    arm: Arm,
    device: Option<DeviceIdentity>,
    hash: Option<u64>,
    delay_ticks: u8,
}

impl Identity {
    /// That of a device which does not report it. One whose hash is that of the built-in arm need not be asked for more.
    fn built_in() -> Self {
        let arm = Arm::avena();
        Self { delay_ticks: arm.config().delay_ticks, hash: arm.hash().ok().flatten(), arm, device: None }
    }
}

/// The arm may be another than it was.
struct Doubt {
    /// Since this time of the line.
    since: Duration,
    asked: Option<Duration>,
}

/// A recording that is being made.
struct Reel {
    trajectory: Option<Arc<Trajectory>>,
    /// It begins with the first status.
    clock: Option<StatusClock>,
}

/// Statuses with the times at which they came, and how many found no room.
type Arrived = Rc<RefCell<(VecDeque<(Duration, Status)>, u64)>>;

/// The thread that follows.
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

/// A client that looks, and what it receives whatever it does.
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
                // It was put out, for a computer that stood still: it comes again.
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
        let steps = self.follower.end("stopped", "the agent was ended");
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

    /// A controller that starts may have another arm, and has no trajectory.
    fn look_at(&mut self, now: Duration, status: &Status) {
        if status.state.is_in(&[ControllerState::Start, ControllerState::Init]) {
            self.upload.forget();
            self.doubt = Some(Doubt { since: now, asked: None });
        }
    }

    /// Asks who the controller is where that is in doubt, while the line is quiet. No more often than needed: for the controller's
    /// supervision of its host each question is a sign of it (J-59).
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

    /// Asks who the controller is, and what its arm is where that is another one.
    fn ask(&mut self, session: &mut Session<ClientPort>) {
        let asked = Some(session.now());
        if let Some(doubt) = &mut self.doubt {
            doubt.asked = asked;
        }
        let identity = match session.info() {
            // A device of the protocol without extensions.
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

    /// Begins a recording whose first status came at `from`.
    fn begin(&mut self, motion: Motion, from: Duration, session: &Session<ClientPort>) {
        let trajectory = match motion {
            Motion::Execution => self.upload.trajectory(true),
            Motion::Jog | Motion::Teaching => None,
        };
        let start = host_kit::unix_time().saturating_sub(session.now().saturating_sub(from));
        let mut info = RecordingInfo {
            source: self.source.clone(),
            commanded_by: session.port().line().commander().unwrap_or_default(),
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
