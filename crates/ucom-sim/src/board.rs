//! Board of the simulated chain: the protocol code (node) of real boards, with simulated hardware and faults.

use std::collections::VecDeque;
use std::sync::atomic::Ordering;

use super::application::SimApplication;
use super::file::BoardConfig;
use super::texts::latin1;
use crate::memory::{MemoryFlash, MemoryStore, WirePins};
use ucom::node::{Node, NodeConfig, Phase, Pins, Record};
use ucom::profile::{Endian, HeaderForm};
use ucom::{Checksum, Format, Frame, Function, Payload, Sequence, Status, ToBoard, checksum};

/// Time step of the board while one of its frames waits for the bus, µs.
const WAIT_US: u64 = 500;
/// Delay of a board relative to another board with the same number, µs. Two boards that answer in the same bit time
/// would destroy each other's frames.
const BEHIND_US: u64 = 5_000;

pub(super) struct Board {
    node: Node<MemoryFlash, WirePins, MemoryStore, SimApplication>,
    /// `true` for the first board of the chain, whose incoming pin is strapped active.
    strapped: bool,
    /// `true` while the board has no power. `silent`, `deaf` and `ack_held` are `true` while the fault of the same
    /// name is active.
    pub unpowered: bool,
    pub silent: bool,
    pub deaf: bool,
    pub ack_held: bool,
    /// Delay of received frames, µs.
    behind_us: u64,
    /// Received frames that are delayed, with the time at which the board receives them.
    coming: VecDeque<(u64, u32, Format, Payload)>,
    /// Frame of the board that waits for the bus.
    waiting: Option<Frame>,
    /// INITACK that the board holds back because the fault `ack_held` is active.
    held: Option<Frame>,
    next_us: u64,
    /// Contradiction between status bits that the board has had, as text; `None` if its status was always possible.
    pub violation: Option<&'static str>,
}

impl Board {
    pub(crate) fn new(config: &BoardConfig, strapped: bool, seed: u64) -> Self {
        let mut flash = MemoryFlash::default();
        if config.application {
            let image = image(config);
            let program_id = program_id(config, &image);
            let record = Record { program_id, date: config.date, address: 0, words: image.len() as u32 / 2 };
            flash.install(record, &image);
        }
        let headerless_words = if config.profile.prog_header == HeaderForm::None { 500 } else { 0 };
        let node_config = NodeConfig {
            profile: config.profile,
            seed: (seed as u32) | 1,
            headerless_words,
            ..NodeConfig::new(config.flash_id)
        };
        let pins = WirePins::default();
        pins.input.store(strapped, Ordering::SeqCst);
        let store = MemoryStore { autostart: config.autostart, description: latin1(&config.description) };
        let node = Node::new(node_config, flash, pins, store, SimApplication::new(config), 0);
        Self {
            node,
            strapped,
            unpowered: false,
            silent: false,
            deaf: false,
            ack_held: false,
            behind_us: 0,
            coming: VecDeque::new(),
            waiting: None,
            held: None,
            next_us: 0,
            violation: None,
        }
    }

    /// Returns the time of the next action of the board, µs.
    pub(crate) fn next_us(&self) -> u64 {
        if self.unpowered { u64::MAX } else { self.next_us }
    }

    /// Advances the time of the board to `now_us`. The function returns the frame that the board puts into its CAN controller.
    pub(crate) fn poll(&mut self, now_us: u64) -> Option<Frame> {
        if self.unpowered {
            return None;
        }
        if !self.ack_held
            && let Some(frame) = self.held.take()
        {
            self.waiting = Some(frame);
            return Some(frame);
        }
        while let Some((_, id, format, payload)) = self.coming.pop_front_if(|(at, ..)| *at <= now_us) {
            // Frames of other protocols are passed too: the node counts and ignores them (D-02).
            let _ = self.node.receive_any(now_us, id, format, payload.bytes());
        }
        let frame = self.node.poll(now_us);
        let out = frame.and_then(|frame| self.through(now_us, frame));
        self.schedule(now_us);
        out
    }

    /// Applies the active faults to a frame that the board sends.
    fn through(&mut self, now_us: u64, frame: Frame) -> Option<Frame> {
        if self.silent {
            // The frame does not reach the bus, but the board's CAN controller still reports it as sent.
            self.node.sent(now_us, &frame);
            return None;
        }
        let acknowledges = frame.address().is_ok_and(|(function, _)| function == Function::InitAck);
        if self.ack_held && acknowledges {
            self.held = Some(frame);
            return None;
        }
        self.waiting = Some(frame);
        Some(frame)
    }

    fn schedule(&mut self, now_us: u64) {
        self.violation = self.violation.or(self.node.status().contradiction());
        self.next_us = match (&self.held, &self.waiting) {
            // The fault may end at any time, so the board checks the held frame every `WAIT_US`.
            (Some(_), _) => now_us + WAIT_US,
            (None, Some(_)) => self.node.next_deadline().max(now_us + WAIT_US),
            (None, None) => self.node.next_deadline().max(now_us + 1),
        };
        if let Some((at, ..)) = self.coming.front() {
            self.next_us = self.next_us.min(*at).max(now_us + 1);
        }
    }

    /// Reports to the board that its frame was on the bus.
    pub(crate) fn sent(&mut self, now_us: u64, frame: &Frame) {
        if self.waiting == Some(*frame) {
            self.waiting = None;
        }
        if !self.unpowered {
            self.node.sent(now_us, frame);
            self.next_us = now_us;
        }
    }

    /// Reports to the board that its CAN controller discarded the frame.
    pub(crate) fn not_sent(&mut self, now_us: u64, frame: &Frame) {
        if self.waiting == Some(*frame) {
            self.waiting = None;
        }
        if !self.unpowered {
            self.node.not_sent(now_us, frame);
            self.next_us = now_us;
        }
    }

    /// Passes a frame of another bus member to the board.
    pub(crate) fn receive(&mut self, now_us: u64, id: u32, format: Format, data: &[u8]) {
        if !self.unpowered && !self.deaf {
            if let (1.., Some(payload)) = (self.behind_us, Payload::new(data)) {
                self.coming.push_back((now_us + self.behind_us, id, format, payload));
                self.next_us = self.next_us.min(now_us + self.behind_us);
                return;
            }
            // Frames of other protocols are passed too: the node counts and ignores them (D-02).
            let _ = self.node.receive_any(now_us, id, format, data);
            self.next_us = now_us;
        }
    }

    /// Returns the level of the board's outgoing pin.
    pub(crate) fn outgoing(&self) -> bool {
        !self.unpowered && self.node.pins.output.load(Ordering::SeqCst)
    }

    /// Sets the level of the init wire from the previous board. The level is inactive if the init wire is broken or the previous board has
    /// no power.
    pub(crate) fn set_incoming(&mut self, now_us: u64, level: bool) {
        let level = self.strapped || level;
        if self.node.pins.input.swap(level, Ordering::SeqCst) != level {
            self.next_us = self.next_us.min(now_us);
        }
    }

    pub(crate) fn power(&mut self, now_us: u64, on: bool) {
        if on == self.unpowered {
            self.unpowered = !on;
            self.waiting = None;
            self.coming.clear();
            self.held = None;
            if on {
                self.node.power_up(now_us);
                self.next_us = now_us;
            } else {
                self.node.application.power_lost(now_us);
                self.node.flash.power_up();
                self.node.pins.set_init_out(false);
            }
        }
    }

    /// Simulates a crash of the application. After the crash, the watchdog reboots the board (D-26).
    pub(crate) fn crash(&mut self, now_us: u64) {
        if !self.unpowered {
            self.waiting = None;
            self.held = None;
            self.node.restart(now_us);
            self.next_us = now_us;
        }
    }

    /// Gives this board a number that another board already has, as if both boards had received one PC_INIT.
    pub(crate) fn take_number(&mut self, now_us: u64, number: Sequence) {
        if self.unpowered {
            return;
        }
        self.behind_us = BEHIND_US;
        let profile = self.node.config().profile;
        if let Some(own) = self.node.number() {
            let forget = ToBoard::SetStatus { mask: Status::INIT.0, value: 0 };
            self.node.receive(now_us, &forget.encode(own, &profile));
        }
        // The incoming pin is active only during this assignment of the number.
        let level = self.node.pins.input.swap(true, Ordering::SeqCst);
        self.node.receive(now_us, &ToBoard::Init.encode(number, &profile));
        self.node.pins.input.store(level, Ordering::SeqCst);
        self.next_us = now_us;
    }

    pub(crate) fn break_flash(&mut self, broken: bool) {
        self.node.flash.fail_after = broken.then_some(0);
    }

    pub(crate) fn state(&self) -> BoardState {
        BoardState {
            powered: !self.unpowered,
            phase: self.node.phase(),
            status: self.node.status(),
            number: self.node.number().map(|n| n.number()),
            program: self.node.record().map(|r| (r.program_id, r.date)),
            driven: self.node.application.is_driven(),
        }
    }
}

/// State of a board in the chain, for tests and displays. A PC on the bus cannot see this state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BoardState {
    /// `true` if the board has power.
    pub powered: bool,
    /// Phase of the board: S1 to S6.
    pub phase: Phase,
    /// Status byte of the board.
    pub status: Status,
    /// Sequence number of the board.
    pub number: Option<u8>,
    /// Program ID and flash date of the valid application.
    pub program: Option<(u16, u16)>,
    /// `true` if the outputs of the board drive the axes.
    pub driven: bool,
}

/// Returns the image of the application that a new board contains. The image is derived from the description, so that
/// boards have different applications.
fn image(config: &BoardConfig) -> Vec<u8> {
    let seed = config.description.bytes().fold(7_u32, |sum, b| sum.wrapping_mul(31).wrapping_add(b.into()));
    let mut image: Vec<u8> = (0..254_u32).map(|i| (seed.wrapping_mul(i + 1) >> 7) as u8).collect();
    image.extend([0, 0]);
    let Some(wanted) = config.program_id else { return image };
    // The last word of the image is selected so that the checksum has the value in the chain file.
    for word in 0..=u16::MAX {
        image.truncate(254);
        image.extend(word.to_le_bytes());
        if program_id(config, &image) == wanted {
            break;
        }
    }
    image
}

fn program_id(config: &BoardConfig, image: &[u8]) -> u16 {
    match (config.profile.prog_checksum, config.program_id) {
        (Checksum::None, given) => given.unwrap_or(0),
        (kind, _) => checksum(kind, words_order(config), image),
    }
}

fn words_order(config: &BoardConfig) -> Endian {
    config.profile.prog_endian
}
