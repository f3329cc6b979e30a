//! Board of the controller. The controller, the receive buffers of the host link and the watchdog are connected as in the
//! firmware.
use std::collections::VecDeque;

use jtc_bus::Frame;
use jtc_core::recorder::{BLOCK_WORDS, Block, Recorder};
use jtc_core::{
    BusState, Config, Controller, HOST_LINES, HostEvent, Identity, Inputs, Outputs, POINTS_MAX, Telemetry,
};
use jtc_wire::{
    BootCause, EVENTS_MAX, EventBatch, FRAME_MAX, FrameStatus, FrameType, LinkEvent, RawPoint, ReceivedEvent,
    Receiver, SIMULATOR, STATUS_LEN, StoreState, UrgentWatch,
};

/// Number of the serial line of the host. The simulation has only one serial line.
const LINE: usize = 0;
/// Maximum number of bytes that wait for the parser. The number of bytes is the size of the ring buffer that the DMA of
/// the board fills.
const RING: usize = 32 * 1024;
/// Length of a tick, µs.
const TICK_US: u32 = 1000;
/// Maximum number of bytes that are passed to the parser at once.
const CHUNK: usize = 4096;

/// Number of ticks that storing the arm parameters takes. This is the erase time of a flash sector.
const STORE_MS: u32 = 2_000;

/// Maximum number of polls of the parser between two ticks. The polls represent the free processor time of the real
/// board.
const POLLS: usize = 64;

/// Result of the processing of bytes from the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Worked {
    /// A valid frame, with the type byte of the frame.
    Frame(u8),
    /// A valid Execute, Pause or Stop, with the command byte.
    Exec(u8),
    /// Bytes that are not a valid frame, with the status of the error.
    Bad(FrameStatus),
}

impl From<&LinkEvent<'_>> for Worked {
    fn from(event: &LinkEvent<'_>) -> Self {
        match event {
            LinkEvent::Frame(frame) => match (frame.frame_type, frame.body()) {
                (FrameType::TrajSetExecStatus, [command]) => Self::Exec(*command),
                (frame_type, _) => Self::Frame(frame_type as u8),
            },
            LinkEvent::Bad(response) | LinkEvent::Noise(response) => Self::Bad(response.status),
        }
    }
}

/// Inputs of a tick, except the bytes from the host.
#[derive(Clone, Copy, Debug)]
pub struct Pins<'a> {
    /// Answers of the nodes on the joint bus.
    pub bus: &'a [Frame],
    /// State of the joint bus.
    pub bus_state: BusState,
    /// Level of the safety input.
    pub safety_input: bool,
    /// `true` if the serial transmitter is idle.
    pub status_free: bool,
}

/// Memory that keeps an arm during a reset (J-54).
#[derive(Clone, Debug, Default)]
struct Memory {
    arm: Option<Vec<u8>>,
    sequence: u32,
    /// Arm image that is being written, and the number of ticks until it is stored.
    writing: Option<(Vec<u8>, u32)>,
}

/// The controller's board.
pub struct Board {
    controller: Controller<Vec<RawPoint>>,
    ring: VecDeque<u8>,
    receiver: Receiver<Vec<u8>>,
    watch: UrgentWatch<HOST_LINES>,
    batch: Box<EventBatch>,
    config: Config,
    memory: Memory,
    inter_byte_timeout_us: u32,
    watchdog_ms: u32,
    /// Number of consecutive missed ticks.
    missed: u32,
    /// Host frames that the tick has processed, including invalid frames.
    pub worked: Vec<Worked>,
    /// Number of bytes from the host that were lost because the ring buffer was full.
    pub lost_bytes: u64,
    /// Number of resets by the watchdog.
    pub watchdog_resets: u32,
    /// Telemetry of the last tick.
    telemetry: Telemetry,
    recorder: SimRecorder,
}

/// Flight recorder with as much memory as on the board.
pub type SimRecorder = Recorder<Vec<Block>, 3>;

/// Number of blocks in each part of the flight recorder's memory, 157 KiB in total.
pub const RECORDER_BLOCKS: [usize; 3] = [63, 31, 63];

fn recorder_memory() -> [Vec<Block>; 3] {
    RECORDER_BLOCKS.map(|blocks| vec![[0; BLOCK_WORDS]; blocks])
}

impl Board {
    /// Creates a board that was just switched on. The non-volatile memory of the board contains `arm`.
    pub fn new(config: Config, arm: Option<Vec<u8>>, inter_byte_timeout_us: u32, watchdog_ms: u32) -> Self {
        let mut board = Self {
            controller: Controller::new(config.clone(), vec![RawPoint::default(); POINTS_MAX]),
            ring: VecDeque::new(),
            receiver: Receiver::new(vec![0; FRAME_MAX], inter_byte_timeout_us),
            watch: UrgentWatch::new(inter_byte_timeout_us + TICK_US),
            batch: Box::new(EventBatch::new()),
            config,
            memory: Memory { sequence: arm.is_some().into(), arm, writing: None },
            inter_byte_timeout_us,
            watchdog_ms,
            missed: 0,
            worked: Vec::new(),
            lost_bytes: 0,
            watchdog_resets: 0,
            telemetry: Telemetry::default(),
            recorder: Recorder::new(recorder_memory(), false),
        };
        board.boot();
        board
    }

    /// Starts the controller, and executes everything that the board does before the first tick.
    fn boot(&mut self) {
        let boot_cause = if self.watchdog_resets > 0 { BootCause::Watchdog } else { BootCause::PowerOn };
        self.controller.set_identity(Identity {
            board: SIMULATOR,
            firmware: env!("CARGO_PKG_VERSION"),
            revision: "",
            boots: 1 + self.watchdog_resets,
            boot_cause,
            program: None,
        });
        let state = match &self.memory.arm {
            None => StoreState::Empty,
            Some(arm) if self.controller.load_arm(arm) => StoreState::Stored,
            Some(_) => StoreState::Failed,
        };
        self.controller.set_store_state(state, self.memory.sequence);
    }

    /// Resets the board, which loses everything except the contents of its non-volatile memory.
    pub fn reset(&mut self) {
        let resets = self.watchdog_resets;
        // An unfinished write is lost, and the previously stored arm remains.
        let memory = Memory { writing: None, ..core::mem::take(&mut self.memory) };
        let recorder =
            core::mem::replace(&mut self.recorder, Recorder::new([const { Vec::new() }; 3], false));
        *self = Self::new(self.config.clone(), None, self.inter_byte_timeout_us, self.watchdog_ms);
        (self.watchdog_resets, self.memory) = (resets, memory);
        // The recorder keeps the contents of its memory, and treats a reset by the watchdog as a failure.
        self.recorder = Recorder::new(recorder.into_memory(), resets > 0);
        self.boot();
    }

    /// Returns the settings of the controller.
    pub fn controller_config(&self) -> &Config {
        self.controller.config()
    }

    /// Returns the arm in the non-volatile memory, and its sequence number.
    pub fn stored_arm(&self) -> Option<(&[u8], u32)> {
        self.memory.arm.as_deref().map(|arm| (arm, self.memory.sequence))
    }

    /// Returns the answer to an extension request from the last tick. The answer is valid if the outputs of that tick had
    /// `answer_line` set.
    pub fn answer_frame(&self) -> &[u8] {
        self.controller.answer_frame()
    }

    /// Writes the arm to the non-volatile memory while the controller continues.
    fn store(&mut self, requested: bool) {
        let memory = &mut self.memory;
        if requested {
            memory.writing = Some((self.controller.stored_arm().to_vec(), STORE_MS));
        }
        match memory.writing.take() {
            Some((arm, 0)) => {
                memory.sequence += 1;
                memory.arm = Some(arm);
                self.controller.set_store_state(StoreState::Stored, memory.sequence);
            }
            Some((arm, ms)) => memory.writing = Some((arm, ms - 1)),
            None => {}
        }
    }

    /// Returns the flight recorder (J-56).
    pub fn recorder(&self) -> &SimRecorder {
        &self.recorder
    }

    /// Clears the log of the flight recorder.
    pub fn clear_log(&mut self) {
        self.recorder.clear();
    }

    /// Returns the controller. A replay of a recording needs this controller.
    pub fn controller(&self) -> &Controller<Vec<RawPoint>> {
        &self.controller
    }

    /// Returns the status of the last tick. The status is valid if the outputs of that tick had `status` set.
    pub fn status_frame(&self) -> &[u8; STATUS_LEN] {
        self.controller.status_frame()
    }

    /// Returns the telemetry of the last tick.
    pub fn telemetry(&self) -> &Telemetry {
        &self.telemetry
    }

    /// Handles bytes that have arrived by `now_us`, between ticks. Searches the bytes for urgent commands, and passes the
    /// bytes to the parser.
    pub fn receive(&mut self, now_us: u64, bytes: &[u8]) {
        self.watch.scan(LINE, now_us, bytes);
        self.ring.extend(bytes);
        if self.ring.len() > RING {
            // The host has sent more bytes than the controller can execute, so the ring buffer is full. All waiting
            // bytes are lost, but a Stop in these bytes is still executed.
            self.lost_bytes += self.ring.len() as u64;
            self.ring.clear();
            self.receiver.restart(self.watch.received(LINE));
        }
        // The parser also accepts bytes while a frame is executed, as on the real board. Otherwise these bytes would
        // wait in the ring buffer, and the parser would later detect a gap in their frame.
        let refill = self.batch.is_empty();
        for _ in 0..POLLS {
            let waiting = self.ring.as_slices().0;
            let taken = self.receiver.push(now_us, &waiting[..waiting.len().min(CHUNK)]);
            self.ring.drain(..taken);
            let found = self.receiver.poll(now_us);
            let moved = found && refill && self.hand_over();
            let more = (taken > 0 && !self.ring.is_empty()) || moved || (!found && self.receiver.busy());
            if !more {
                break;
            }
        }
    }

    /// Passes the parser's event to the controller. Returns `false` if the controller cannot accept the event.
    fn hand_over(&mut self) -> bool {
        let moved = self.receiver.received(LINE).is_some_and(|received| self.batch.push(&received));
        if moved {
            self.receiver.release();
        }
        moved
    }

    /// Skips a tick. Returns `true` if the watchdog resets the board because of the missed tick.
    pub fn miss(&mut self) -> bool {
        self.worked.clear();
        self.missed += 1;
        if self.missed < self.watchdog_ms {
            return false;
        }
        self.watchdog_resets += 1;
        self.reset();
        // After the restart the board reports the reason for its reset as a latched internal error (J-12, J-21).
        self.controller.raise_internal();
        true
    }

    /// Runs a tick of the controller.
    pub fn tick(&mut self, pins: &Pins<'_>) -> Outputs {
        let missed_ticks = core::mem::take(&mut self.missed).try_into().unwrap_or(u16::MAX);
        let urgent = self.watch.take();
        let host: Vec<HostEvent<'_>> = (0..EVENTS_MAX)
            .map_while(|n| self.batch.get(n))
            .map(|ReceivedEvent { line, position, plain, event }| HostEvent {
                line,
                overtaken: self.watch.overtaken(line, position),
                plain,
                event,
            })
            .collect();
        let inputs = Inputs {
            bus: pins.bus,
            bus_state: pins.bus_state,
            safety_input: pins.safety_input,
            missed_ticks,
            urgent,
            host: &host,
            status_free: pins.status_free,
        };
        let outputs = self.controller.tick(&inputs);
        self.recorder.record(&mut self.controller, &inputs, &outputs);
        self.telemetry = self.controller.telemetry();
        self.worked.clear();
        self.worked.extend(host.iter().take(outputs.host_done).map(|host| Worked::from(&host.event)));
        self.batch.done(outputs.host_done);
        self.store(outputs.store);
        outputs
    }
}
