//! Simulated controller on a simulated serial line, in virtual time. The simulation and the tested code share only
//! the parser of `jtc-wire`.
use std::collections::VecDeque;
use std::time::Duration;

use jtc_agent::line::{ClientId, Delivery};
use jtc_agent::{Introduction, Policy, Role, SharedLine};
use jtc_wire::{DataStatus, FRAME_MAX, FrameType, LinkEvent, Receiver, Response, Status};

/// Step of the virtual time, µs; at 115,200 Bd, one byte takes 86.8 µs.
const STEP_US: u64 = 20;
/// Interval between two calls of the shared line, µs. This interval equals the longest wait of the thread that owns a
/// real port.
const TURN_US: u64 = 2000;
/// Interval between two statuses, µs.
const REPORT_US: u64 = 15_500;

/// Serial line with the simulated controller board.
pub(crate) struct Board {
    pub line: SharedLine,
    baud: f64,
    now_us: u64,
    /// Bytes that the operating system has accepted. `byte_over_us` is the time at which the first queued byte has been sent.
    queue: VecDeque<u8>,
    byte_over_us: f64,
    /// Largest number of bytes that were queued in the operating system so far.
    pub queued_most: usize,
    /// Delay before the operating system accepts the bytes of each write, µs. `handed_over` contains the bytes of the present write, and
    /// the time at which the operating system accepts them.
    pub held_up_us: VecDeque<u64>,
    handed_over: Option<(u64, Vec<u8>)>,
    receiver: Receiver<Vec<u8>>,
    records: VecDeque<Response>,
    /// Frames that arrived at the board. Each entry contains the time, the type (`None` for an invalid frame) and the first bytes of the
    /// frame.
    pub frames: Vec<(Duration, Option<FrameType>, Vec<u8>)>,
    /// Time and bytes of each write to the operating system.
    pub written: Vec<(Duration, Vec<u8>)>,
    pub status: Status,
    /// Number of bytes that will arrive damaged, beginning with the next byte.
    pub damaged: usize,
    /// Time until which the statuses of the board are lost.
    pub deaf_until: Duration,
    /// Type of the frames that the board refuses.
    pub refuses: Option<FrameType>,
}

impl Board {
    pub(crate) fn new(baud: u32) -> Self {
        Self {
            line: SharedLine::new(Some(baud)),
            baud: f64::from(baud),
            now_us: 0,
            queue: VecDeque::new(),
            byte_over_us: 0.0,
            queued_most: 0,
            held_up_us: VecDeque::new(),
            handed_over: None,
            receiver: Receiver::new(vec![0; FRAME_MAX], 5000),
            records: VecDeque::new(),
            frames: Vec::new(),
            written: Vec::new(),
            damaged: 0,
            deaf_until: Duration::ZERO,
            refuses: None,
            status: Status { gripper: Some(Default::default()), ..Status::default() },
        }
    }

    pub(crate) fn join(&mut self, name: &str, role: Role, policy: Policy) -> ClientId {
        self.line.join(Introduction { name: name.into(), role, policy })
    }

    pub(crate) fn now(&self) -> Duration {
        Duration::from_micros(self.now_us)
    }

    pub(crate) fn send(&mut self, client: ClientId, bytes: &[u8]) {
        let now = self.now();
        self.line.from_client(client, bytes, now);
    }

    pub(crate) fn run_ms(&mut self, ms: u64) {
        for _ in 0..ms * 1000 / STEP_US {
            self.step();
        }
    }

    fn step(&mut self) {
        self.now_us += STEP_US;
        let now = self.now();
        if self.now_us.is_multiple_of(TURN_US) && self.handed_over.is_none() {
            let bytes = self.line.to_device(now);
            if !bytes.is_empty() {
                let held_up_us = self.held_up_us.pop_front().unwrap_or(0);
                self.handed_over = Some((self.now_us + held_up_us, bytes));
            }
        }
        if let Some((_, bytes)) = self.handed_over.take_if(|(at, _)| *at <= self.now_us) {
            if self.queue.is_empty() {
                self.byte_over_us = self.now_us as f64 + 1e7 / self.baud;
            }
            self.queue.extend(&bytes);
            self.written.push((now, bytes));
            self.line.handed_over(now);
        }
        while !self.queue.is_empty() && self.byte_over_us <= self.now_us as f64 {
            let mut byte = self.queue.pop_front().expect("it is not empty");
            if self.damaged > 0 {
                self.damaged -= 1;
                byte ^= 0x10;
            }
            self.byte_over_us += 1e7 / self.baud;
            assert_eq!(self.receiver.push(self.now_us, &[byte]), 1);
        }
        self.queued_most = self.queued_most.max(self.queue.len());
        while self.receiver.poll(self.now_us) {
            let (frame_type, response, bytes) = match self.receiver.event().expect("there is one") {
                LinkEvent::Frame(frame) => {
                    let n = frame.bytes.len();
                    let refused = self.refuses == Some(frame.frame_type);
                    let data = if refused { DataStatus::NotAllowed } else { DataStatus::NoError };
                    let good = Response::good(frame.frame_type, data, n as u16);
                    (Some(frame.frame_type), good, frame.bytes[..n.min(40)].to_vec())
                }
                LinkEvent::Bad(response) | LinkEvent::Noise(response) => (None, response, Vec::new()),
            };
            self.receiver.release();
            self.records.push_back(response);
            self.frames.push((now, frame_type, bytes));
        }
        if self.now_us % REPORT_US < STEP_US {
            self.status.response = self.records.pop_front().unwrap_or_default();
            let bytes = self.status.emit();
            if now >= self.deaf_until {
                self.line.from_device(&bytes, now);
            }
        }
    }

    /// Returns the number of frames of this type that have arrived.
    pub(crate) fn arrived(&self, frame_type: FrameType) -> usize {
        self.frames.iter().filter(|(_, t, _)| *t == Some(frame_type)).count()
    }

    /// Returns the response records that a client has received, and the reasons for its refused requests.
    pub(crate) fn take(&mut self, client: ClientId) -> (Vec<Response>, Vec<String>) {
        let (mut records, mut denied) = (Vec::new(), Vec::new());
        for delivery in self.line.take_deliveries(client).expect("it is there") {
            match delivery {
                Delivery::Bytes(bytes) => {
                    records.extend(Status::parse(&bytes).and_then(|status| status.response()))
                }
                Delivery::Denied(why) => denied.push(why.to_string()),
                Delivery::LeaseDenied(why) => denied.push(why.to_string()),
                Delivery::LeaseWanted(name) => denied.push(format!("{name} wants it")),
            }
        }
        (records, denied)
    }
}
