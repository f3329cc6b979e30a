//! Test bus in memory with a chain of boards, in virtual time.

use ucom::node::{Node, NodeConfig, Record};
use ucom::{BoardInfo, Frame, Header, Profile, checksum, data_block};
use ucom_sim::memory::{MemoryApplication, MemoryFlash, MemoryStore, WirePins};

pub(super) type Board = Node<MemoryFlash, WirePins, MemoryStore, MemoryApplication>;

pub(super) const MS: u64 = 1000;

/// Boards on a test bus, and the frames that they sent.
pub(super) struct Bus {
    pub boards: Vec<Board>,
    pub now: u64,
    /// Frames that the boards have sent since the last `take`, with their times.
    pub received: Vec<(u64, Frame)>,
    /// All DSP_ERROR frames since the start of the test.
    pub errors: Vec<Frame>,
    /// Function that returns `true` for frames that the bus delays. The bus calls `sent` for such a frame only after
    /// [`Bus::release`].
    pub hold: fn(&Frame) -> bool,
    pub held: Vec<(usize, Frame)>,
    /// Index (from 0) of a frame of the PC that the boards do not receive.
    pub lose_to_boards: Option<usize>,
    pub frames_to_boards: usize,
    /// Index (from 0) of a frame of the boards that the PC does not receive. The board gets a call of `sent` as if
    /// the frame had arrived.
    pub lose_from_boards: Option<usize>,
    pub frames_from_boards: usize,
}

/// Returns the worst-case duration of a classic frame at 1 Mbit/s, in microseconds.
pub(super) fn duration(frame: &Frame) -> u64 {
    55 + 10 * u64::from(frame.dlc())
}

pub(super) fn application() -> MemoryApplication {
    MemoryApplication::new(
        "UCoM2 head pan",
        &["pos_soll", "velocity"],
        &["pos_ist", "current", "temp", "state"],
        &["kp", "ki", "mode"],
    )
}

/// Record of the application in the examples of the protocol page: Program ID 0x1234, date 2008-03-14.
pub(super) const GOLDEN: Record = Record { program_id: 0x1234, date: 0x386E, address: 0, words: 4 };

impl Bus {
    /// Creates boards with these flash numbers. The boards are programmed, powered up at time 0 and ready to listen.
    pub(super) fn new(flash_numbers: &[u16], profile: Profile) -> Self {
        let mut boards = Vec::new();
        for (flash_number, pins) in flash_numbers.iter().zip(WirePins::chain(flash_numbers.len())) {
            let mut flash = MemoryFlash::default();
            flash.install(GOLDEN, &[0x11; 8]);
            let store = MemoryStore { description: b"UCoM2 head pan".to_vec(), ..MemoryStore::default() };
            let config = NodeConfig { profile, ..NodeConfig::new(*flash_number) };
            boards.push(Node::new(config, flash, pins, store, application(), 0));
        }
        let mut bus = Self {
            boards,
            now: 0,
            received: Vec::new(),
            errors: Vec::new(),
            hold: |_| false,
            held: Vec::new(),
            lose_to_boards: None,
            frames_to_boards: 0,
            lose_from_boards: None,
            frames_from_boards: 0,
        };
        bus.run(50);
        assert!(bus.received.is_empty(), "nothing is sent at power-up");
        bus
    }

    pub(super) fn one() -> Self {
        Self::new(&[0x21], Profile::default())
    }

    /// Returns a bus with a board that has number 1 and an active outgoing pin; `received` is empty.
    pub(super) fn initialised() -> Self {
        let mut bus = Self::one();
        bus.number(1);
        bus
    }

    /// Returns a bus with a board whose application has started.
    pub(super) fn started() -> Self {
        let mut bus = Self::initialised();
        bus.send("301#");
        bus.run(50);
        assert_eq!(bus.take(), frames("501# 681# 601#00000000"));
        bus
    }

    /// Returns a bus with a board whose control loop runs.
    pub(super) fn running() -> Self {
        let mut bus = Self::started();
        bus.send("541#");
        bus.run(5);
        assert_eq!(bus.take(), frames("601#01000000"));
        bus
    }

    /// Assigns a number to the next board of the chain.
    pub(super) fn number(&mut self, number: u8) {
        self.send(&format!("{:03X}#", 0x280 + u16::from(number)));
        self.run(5);
        self.send(&format!("{:03X}#0202", 0x1C0 + u16::from(number)));
        self.run(1);
        assert_eq!(self.take(), frames(&format!("{:03X}#{number:02X}", 0x0C0 + u16::from(number))));
    }

    /// Sends a frame of the PC immediately.
    pub(super) fn send(&mut self, text: &str) {
        self.send_frame(&text.parse().unwrap_or_else(|e| panic!("{text}: {e}")));
    }

    pub(super) fn send_frame(&mut self, frame: &Frame) {
        self.run_us(duration(frame));
        let number = self.frames_to_boards;
        self.frames_to_boards += 1;
        if self.lose_to_boards == Some(number) {
            return;
        }
        for board in &mut self.boards {
            board.receive(self.now, frame);
        }
        self.check();
    }

    /// Advances the time by `ms` milliseconds.
    pub(super) fn run(&mut self, ms: u64) {
        self.run_us(ms * MS);
    }

    pub(super) fn run_us(&mut self, us: u64) {
        let end = self.now + us;
        // Number of consecutive steps without a frame on the bus. A large number means that a board is always due but
        // never sends; the test then fails.
        let mut quiet = 0;
        loop {
            let now = self.now;
            // Arbitration of the bus: every board has at most one frame ready. The frame with the lowest identifier is sent first, and the
            // other frames wait.
            let mut offers: Vec<(u16, usize, Frame)> = Vec::new();
            for (i, board) in self.boards.iter_mut().enumerate() {
                if let Some(frame) = board.poll(now) {
                    offers.push((frame.id(), i, frame));
                }
            }
            offers.sort_by_key(|(id, ..)| *id);
            self.check();
            for (_, i, frame) in offers {
                if (self.hold)(&frame) {
                    self.held.push((i, frame));
                    continue;
                }
                self.now += duration(&frame);
                self.boards[i].sent(self.now, &frame);
                self.received.push((self.now, frame));
                if (0x080..0x0A0).contains(&frame.id()) {
                    self.errors.push(frame);
                }
                let number = self.frames_from_boards;
                self.frames_from_boards += 1;
                if self.lose_from_boards == Some(number) {
                    self.received.pop();
                }
                for (other, board) in self.boards.iter_mut().enumerate() {
                    if other != i {
                        board.receive(self.now, &frame);
                    }
                }
                quiet = 0;
            }
            let next = self.boards.iter().map(Board::next_deadline).min().unwrap_or(u64::MAX);
            if next > end || self.now >= end {
                break;
            }
            quiet += 1;
            assert!(quiet < 100_000, "a board wakes up without end at {next}, now {}", self.now);
            self.now = self.now.max(next);
        }
        self.now = self.now.max(end);
        self.check();
    }

    /// Sends the delayed frames, and delays no further frames.
    pub(super) fn release(&mut self) {
        self.hold = |_| false;
        for (i, frame) in std::mem::take(&mut self.held) {
            self.boards[i].sent(self.now, &frame);
            self.received.push((self.now, frame));
        }
    }

    /// Checks the invariants of the status byte (D-20).
    pub(super) fn check(&self) {
        for board in &self.boards {
            let status = board.status();
            assert_eq!(status.contradiction(), None, "{status} at {}", self.now);
        }
    }

    /// Returns the frames that were received since the last call of `take`.
    pub(super) fn take(&mut self) -> Vec<Frame> {
        std::mem::take(&mut self.received).into_iter().map(|(_, frame)| frame).collect()
    }

    /// Sends a frame of the PC, waits, and returns the frames that boards sent after it.
    pub(super) fn ask(&mut self, text: &str, ms: u64) -> Vec<Frame> {
        self.received.clear();
        self.send(text);
        self.run(ms);
        self.take()
    }

    /// Returns the DSP_INFO of board `n`; returns `None` if the board does not answer.
    pub(super) fn info(&mut self, n: u8) -> Option<BoardInfo> {
        let id = 0x140 + u16::from(n);
        let endian = self.boards[0].config().profile.endian;
        let received = self.ask(&format!("{:03X}#", 0x200 + u16::from(n)), 20);
        let first = received.iter().find(|frame| frame.id() == id)?;
        BoardInfo::parse(&first.payload(), endian)
    }

    /// Returns the status byte of board `n`, as read with PC_INFO.
    pub(super) fn status(&mut self, n: u8) -> u8 {
        self.info(n).unwrap_or_else(|| panic!("board {n} does not answer")).status.0
    }

    /// Sends a block as frames 200 µs apart and waits for an answer of board 1. The function returns the received frames.
    pub(super) fn block(&mut self, block: &[u8; 64], wait_ms: u64) -> Vec<Frame> {
        self.received.clear();
        for data in block.chunks_exact(8) {
            self.send_frame(&Frame::new(0x2C1, data).unwrap());
            self.run_us(70);
        }
        for _ in 0..wait_ms {
            if !self.received.is_empty() {
                break;
            }
            self.run(1);
        }
        self.take()
    }
}

/// Parses frames in the format of candump that are separated by blanks.
pub(super) fn frames(text: &str) -> Vec<Frame> {
    text.split_whitespace().map(|frame| frame.parse().unwrap()).collect()
}

/// Returns the image of 1000 bytes that the examples of the protocol page use.
pub(super) fn image() -> Vec<u8> {
    (0..1000).map(|i| (37 * i + 11) as u8).collect()
}

/// Returns the header of an image that is intended for any board.
pub(super) fn header(image: &[u8], cycle: u16, profile: &Profile) -> Header {
    Header {
        cycle,
        memory: 0,
        address: 0,
        length: (image.len() / 2) as u32,
        program_id: checksum(profile.prog_checksum, profile.prog_endian, image),
        date: 0x3AC1,
        target: Header::ANY_BOARD,
    }
}

/// Returns all blocks of both cycles of an update: the header block and the data blocks of each cycle.
pub(super) fn blocks(image: &[u8], profile: &Profile) -> Vec<[u8; 64]> {
    let mut all = Vec::new();
    for cycle in 1..=2 {
        all.push(header(image, cycle, profile).build(profile.prog_endian));
        all.extend((0..).map_while(|i| data_block(image, i)));
    }
    all
}

/// Sorts frames by identifier.
pub(super) fn sorted(mut received: Vec<Frame>) -> Vec<Frame> {
    received.sort_by_key(Frame::id);
    received
}
