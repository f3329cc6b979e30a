//! Serial line of the measurement. The line consists of a pseudo-terminal to the controller, and of a model of a UART
//! that transmits the bytes of the agent.
use std::os::fd::OwnedFd;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use jtc_host::port::{SerialPort, line_time};
use jtc_host::{Port, PortError};
use jtc_wire::{ExecCommand, fixed};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use crate::common::simulated;

/// Bit rate of the serial line, Bd.
pub(crate) const BAUD: u32 = 115_200;
const STOP: [u8; 7] = fixed::exec(ExecCommand::Stop);

/// Stop that was sent on the line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stop {
    pub first_byte: Instant,
    pub last_byte: Instant,
    /// Silence before the Stop, if the Stop follows an interrupted frame.
    pub gap: Option<Duration>,
}

/// Record of the bytes that the agent has written to the line.
#[derive(Debug)]
pub(crate) struct Seen {
    /// Time at which the line has transmitted all bytes.
    free_at: Instant,
    /// Number of bytes of the current frame that are not sent yet.
    left: usize,
    /// Largest number of bytes that waited for transmission at the same time.
    pub queued_most: usize,
    /// Number of bytes in frames since the last Stop.
    pub since_stop: usize,
    pub stops: Vec<Stop>,
}

impl Seen {
    /// Returns `true` while a frame on the line is incomplete.
    pub(crate) fn is_in_a_frame(&self) -> bool {
        self.left > 0
    }

    /// Records bytes that the agent wrote between `began` and `ended`.
    fn take(&mut self, mut bytes: &[u8], began: Instant, ended: Instant) {
        let queued = self.free_at.saturating_duration_since(began).as_secs_f64() * f64::from(BAUD) / 10.0;
        self.queued_most = self.queued_most.max(queued as usize + bytes.len());
        let begins = self.free_at.max(ended);
        let silence = begins.saturating_duration_since(self.free_at);
        self.free_at = begins + line_time(bytes.len(), Some(BAUD));
        if let Some(before) = bytes.strip_suffix(&STOP) {
            let gap = (self.left > before.len()).then_some(silence);
            let first_byte = begins + line_time(before.len(), Some(BAUD));
            self.stops.push(Stop { first_byte, last_byte: self.free_at, gap });
            (self.left, self.since_stop) = (0, 0);
            return;
        }
        self.since_stop += bytes.len();
        while !bytes.is_empty() {
            if self.left == 0 {
                // The header contains the length, and the first part of a frame always contains the complete header.
                self.left = usize::from(u16::from_be_bytes([bytes[2], bytes[3]]));
            }
            let taken = self.left.min(bytes.len());
            self.left -= taken;
            bytes = &bytes[taken..];
        }
    }
}

/// The agent's port, which records the bytes that the agent writes.
pub(crate) struct Watched {
    port: SerialPort,
    seen: Arc<Mutex<Seen>>,
}

/// Access to the record of the bytes on the line.
#[derive(Clone)]
pub(crate) struct Watch(Arc<Mutex<Seen>>);

impl Watch {
    pub(crate) fn look(&self) -> MutexGuard<'_, Seen> {
        self.0.lock().expect("nobody panics with it")
    }
}

/// Creates a line with a controller.
pub(crate) fn begin() -> (Watched, Watch) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
    grantpt(&master).and_then(|()| unlockpt(&master)).expect("it is granted");
    let name = ptsname(&master, Vec::new()).expect("a name").into_string().expect("of letters");
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let slave = rustix::fs::open(&name, flags, Mode::empty()).expect("it is there");
    let mut settings = tcgetattr(&slave).expect("its settings");
    settings.make_raw();
    tcsetattr(&slave, OptionalActions::Now, &settings).expect("raw mode");
    let port = SerialPort::open(&name, BAUD).expect("it is a port");
    std::thread::spawn(move || control(&master, &slave));
    let seen = Seen { free_at: Instant::now(), left: 0, queued_most: 0, since_stop: 0, stops: Vec::new() };
    let seen = Arc::new(Mutex::new(seen));
    (Watched { port, seen: seen.clone() }, Watch(seen))
}

/// Runs the controller side of the line until this program ends. `_slave` stays open, because a pseudo-terminal without
/// a host would report a hang-up.
fn control(master: &OwnedFd, _slave: &OwnedFd) {
    let flags = rustix::fs::fcntl_getfl(master).expect("flags");
    rustix::fs::fcntl_setfl(master, flags | OFlags::NONBLOCK).expect("flags");
    let mut controller = simulated(BAUD);
    let mut buffer = [0; 4096];
    loop {
        while let Ok(n @ 1..) = rustix::io::read(master, &mut buffer) {
            controller.write_all(&buffer[..n]).expect("it takes everything");
        }
        let n = controller.read(&mut buffer, Duration::from_millis(2)).expect("it is there");
        if n > 0 {
            rustix::io::write(master, &buffer[..n]).expect("there is room");
        }
    }
}

impl Port for Watched {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        self.port.read(buffer, timeout)
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let began = Instant::now();
        self.port.write_all(bytes)?;
        self.seen.lock().expect("nobody panics with it").take(bytes, began, Instant::now());
        Ok(())
    }

    fn now(&self) -> Duration {
        self.port.now()
    }

    fn baud(&self) -> Option<u32> {
        self.port.baud()
    }

    fn name(&self) -> String {
        self.port.name()
    }
}
