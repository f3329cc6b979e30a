//! Simulated board for `jtc firmware flash`, with a controller on a pseudo-terminal, and a folder as the USB drive of its ST-LINK.

use std::fs;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use jtc_wire::{
    ANSWER_MAX, Answer, ControllerState, DataStatus, FrameType, Info, Name, NodeState, Program, Response,
    Status, StoreState,
};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// Number of program bytes in an image of [`super::image`].
const PROGRAM: usize = 0x1000;

/// Returns the program data that a board with this image in flash reports. The function computes the checksum bit by bit, from its
/// definition.
pub(super) fn program_of(image: &[u8]) -> Program {
    let mut register = u32::MAX;
    for byte in &image[..PROGRAM] {
        register ^= u32::from(*byte);
        for _ in 0..8 {
            register = (register >> 1) ^ (0xEDB8_8320 * (register & 1));
        }
    }
    Program { bytes: PROGRAM as u32, crc32: !register }
}

/// Processor and ST-LINK of a simulated board. The processor and the ST-LINK stop when this value is dropped.
pub(super) struct Board {
    /// Serial port of the simulated board.
    pub port: String,
    flashed: Arc<Mutex<Flashed>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// State of the simulated processor.
struct Flashed {
    status: Status,
    program: Option<Program>,
    started: Instant,
    /// Operating time of the processor before the start of the test, ms.
    before_ms: u64,
}

impl Board {
    /// Creates a simulated board whose arm has no torque. The folder `drive` is the USB drive of the board and accepts an image of
    /// `length` bytes.
    pub(super) fn new(board: &str, drive: &Path, length: usize) -> Self {
        let (master, port) = pseudo_terminal();
        let mut status = Status { state: ControllerState::Init.into(), ..Status::default() };
        status.joints.iter_mut().for_each(|joint| joint.state = NodeState::READY);
        let flashed = Flashed { status, program: None, started: Instant::now(), before_ms: 3_600_000 };
        let (flashed, stop) = (Arc::new(Mutex::new(flashed)), Arc::new(AtomicBool::new(false)));
        let mut running = Running {
            master,
            board: board.to_owned(),
            drive: drive.to_owned(),
            length,
            flashed: Arc::clone(&flashed),
            sent: Instant::now(),
        };
        let ends = Arc::clone(&stop);
        let thread = thread::spawn(move || {
            while !ends.load(Ordering::Relaxed) {
                running.step();
            }
        });
        Self { port, flashed, stop, thread: Some(thread) }
    }

    /// Changes the status that the simulated board sends after this call.
    pub(super) fn set_status(&self, change: impl FnOnce(&mut Status)) {
        change(&mut self.flashed.lock().unwrap().status);
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let ended = self.thread.take().map(JoinHandle::join);
        assert!(matches!(ended, Some(Ok(()))) || thread::panicking());
    }
}

struct Running {
    master: OwnedFd,
    board: String,
    drive: PathBuf,
    length: usize,
    flashed: Arc<Mutex<Flashed>>,
    sent: Instant,
}

impl Running {
    fn step(&mut self) {
        let mut ends = [PollFd::new(&self.master, PollFlags::IN)];
        let few_ms = Timespec { tv_sec: 0, tv_nsec: 5_000_000 };
        let _ = poll(&mut ends, Some(&few_ms));
        if ends[0].revents().contains(PollFlags::HUP) {
            // No program has opened the port of the board, so the thread waits.
            thread::sleep(Duration::from_millis(5));
        } else {
            self.serve();
        }
        let file = self.drive.join("openjtc.bin");
        if fs::metadata(&file).is_ok_and(|found| found.len() == self.length as u64) {
            self.take(&file);
        }
    }

    /// Sends a status every 40 ms, and answers requests of the command.
    fn serve(&mut self) {
        let mut request = [0; 256];
        let asked = matches!(rustix::io::read(&self.master, &mut request), Ok(1..));
        let flashed = self.flashed.lock().unwrap();
        if asked {
            let response = Response::good(FrameType::GetInfo, DataStatus::NoError, 6);
            let info = Info {
                uptime_ms: flashed.before_ms + flashed.started.elapsed().as_millis() as u64,
                board: Name::cut(&self.board),
                program: flashed.program,
                store: StoreState::Stored,
                ..Info::default()
            };
            let mut out = Status { response, ..flashed.status }.emit().to_vec();
            let mut frame = [0; ANSWER_MAX];
            let n = Answer::Info(info.with_firmware("0.2.0", "0123456789abc")).emit(&mut frame).unwrap();
            out.extend(&frame[..n]);
            let _ = rustix::io::write(&self.master, &out);
        } else if self.sent.elapsed() >= Duration::from_millis(40) {
            self.sent = Instant::now();
            let _ = rustix::io::write(&self.master, &flashed.status.emit());
        }
    }

    /// Simulates the ST-LINK, which writes the image into the flash and resets the processor.
    fn take(&self, file: &Path) {
        let bytes = fs::read(file).unwrap();
        fs::remove_dir_all(&self.drive).unwrap();
        // The delay is longer than the time for which the command waits for a status, so the command must check the
        // USB drive again.
        thread::sleep(Duration::from_millis(1_800));
        let mut flashed = self.flashed.lock().unwrap();
        (flashed.program, flashed.started, flashed.before_ms) = (Some(program_of(&bytes)), Instant::now(), 0);
        appear(&self.drive);
    }
}

/// Creates a USB drive at this folder.
pub(super) fn appear(drive: &Path) {
    fs::create_dir_all(drive).unwrap();
    fs::write(drive.join("DETAILS.TXT"), "Version: V3J13M4B5S1\n").unwrap();
}

/// Creates a pseudo-terminal. Returns the side of the board, and the path of the other side.
fn pseudo_terminal() -> (OwnedFd, String) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&master).and_then(|()| unlockpt(&master)).unwrap();
    let name = ptsname(&master, Vec::new()).unwrap();
    let slave = rustix::fs::open(&*name, OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
    let mut modes = tcgetattr(&slave).unwrap();
    modes.make_raw();
    tcsetattr(&slave, OptionalActions::Now, &modes).unwrap();
    let flags = rustix::fs::fcntl_getfl(&master).unwrap();
    rustix::fs::fcntl_setfl(&master, flags | OFlags::NONBLOCK).unwrap();
    rustix::io::fcntl_setfd(&master, rustix::io::FdFlags::CLOEXEC).unwrap();
    (master, name.into_string().unwrap())
}
