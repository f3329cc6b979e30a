//! The board side of the protocol: a UCoM board as a state machine that uses no clock, no heap and no I/O. The firmware of a board can use
//! this state machine without changes, and every simulated board uses it.
//!
//! The caller passes received frames to the node ([`Node::receive`]), polls for frames to send ([`Node::poll`]) and reports when the CAN
//! controller has sent a frame ([`Node::sent`]). In each call, the caller passes the time in microseconds. [`Node::next_deadline`] returns
//! the time at which the caller must call the node next if no frame arrives. Flash, pins, non-volatile memory and the application are
//! traits ([`Flash`], [`Pins`], [`Store`], [`Application`]); the crate `ucom-sim` implements all four in memory.
//!
//! The node returns one frame at a time. The node returns the next frame only after [`Node::sent`] or [`Node::not_sent`]. The node creates
//! the frames of strings and dumps only when the bus is ready for them, so it needs no queue for these frames.

mod answers;
mod application;
mod config;
mod hardware;
mod jobs;
mod outbox;
mod programming;
mod rate;
mod receive;
mod record;
mod sending;
mod status;
mod timers;
mod transfer;

pub use config::{Counters, NodeConfig};
pub use hardware::{Application, Area, Flash, FlashError, FlashState, Pins, RECORD_LEN, Store, Text};
use jobs::Jobs;
use outbox::Outbox;
use rate::RateLimit;
pub use record::Record;
use transfer::Programming;

use crate::admin::Admin;
use crate::error_code::ErrorCode;
use crate::frame::Frame;
use crate::function::Sequence;
use crate::message::FromBoard;

/// Phase of the board, which corresponds to the states S1 to S6 of the protocol page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Phase {
    /// Boot phase: time between the reset and the moment when the board begins to listen.
    Booting,
    /// S1: the board has no number.
    Uninitialised,
    /// S2: the exloader runs, and the board has a number.
    Idle,
    /// S3: the exloader runs and accepts program data.
    Programming,
    /// S3x: the exloader runs, but an error has occurred during programming. The board discards program data until PC_XRESET arrives or
    /// PROG changes from 0 to 1.
    Aborted,
    /// S4: the application is starting.
    Starting,
    /// S5: the application serves requests.
    Ready,
    /// S6: the control loop runs.
    Running,
}

/// State of the application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum App {
    Stopped,
    Starting,
    Up,
    Running,
}

/// A UCoM board as a state machine.
#[derive(Debug)]
pub struct Node<F, P, S, A> {
    /// Flash of the board, and RAM for an exloader.
    pub flash: F,
    /// Init pins of the board.
    pub pins: P,
    /// Non-volatile memory of the board.
    pub store: S,
    /// Application program of the board.
    pub application: A,
    config: NodeConfig,
    counters: Counters,
    random: u32,
    now_us: u64,
    /// Time at which the board begins to listen after a reset; `None` while the board listens.
    boot_until: Option<u64>,
    number: Option<Sequence>,
    /// Number that the board is accepting: its INITACK has not been sent yet. When the INITACK has been sent, the
    /// board takes the number and sets the status bit INIT (D-24).
    taking: Option<Sequence>,
    /// Level of the board's outgoing init pin.
    opinit: bool,
    prog: bool,
    app: App,
    /// Flag `active` of MCA_ADMIN_DATA; the next two fields are the flags `debug` and `global_debug`. The flag `run`
    /// has no field, because it equals `app == Running`.
    active: bool,
    debug: bool,
    global_debug: bool,
    autostart_at: Option<u64>,
    /// Time at which the PC is considered lost; set while the control loop runs.
    pc_lost_at: Option<u64>,
    step_at: Option<u64>,
    so_at: Option<u64>,
    alive_at: Option<u64>,
    record: Option<Record>,
    programming: Programming,
    outbox: Outbox,
    jobs: Jobs,
    error_rates: [RateLimit<10>; ErrorCode::ALL.len()],
    debug_rate: RateLimit<20>,
}

impl<F: Flash, P: Pins, S: Store, A: Application> Node<F, P, S, A> {
    /// Creates a board at power-up.
    pub fn new(config: NodeConfig, flash: F, pins: P, store: S, application: A, now_us: u64) -> Self {
        let mut node = Self {
            flash,
            pins,
            store,
            application,
            config,
            counters: Counters::default(),
            // Boards with the same configured seed must generate different random numbers. Otherwise, they would
            // choose equal back-off times, and their frames would collide.
            random: (config.seed ^ u32::from(config.flash_number).wrapping_mul(0x9E37_79B9)).max(1),
            now_us,
            boot_until: None,
            number: None,
            taking: None,
            opinit: false,
            prog: false,
            app: App::Stopped,
            active: false,
            debug: false,
            global_debug: false,
            autostart_at: None,
            pc_lost_at: None,
            step_at: None,
            so_at: None,
            alive_at: None,
            record: None,
            programming: Programming::new(&config.profile),
            outbox: Outbox::new(),
            jobs: Jobs::new(),
            error_rates: [const { RateLimit::new() }; ErrorCode::ALL.len()],
            debug_rate: RateLimit::new(),
        };
        node.reboot(now_us, false);
        node
    }

    /// Reboots the board, as after a crash, a watchdog reset or a brown-out. The board sends one report without a request (D-26).
    pub fn restart(&mut self, now_us: u64) {
        self.now_us = self.now_us.max(now_us);
        self.reboot(self.now_us, true);
    }

    /// Starts the board after a power loss. Only the contents of flash and [`Store`] are kept. The board does not
    /// send a report.
    pub fn power_up(&mut self, now_us: u64) {
        self.now_us = self.now_us.max(now_us);
        self.reboot(self.now_us, false);
    }

    /// Returns the next frame for the bus; `None` while no frame is due or the previous frame has not been sent. A frame blocks the
    /// frames after it until [`Node::sent`] or [`Node::not_sent`] is called for this frame, as in a CAN controller.
    pub fn poll(&mut self, now_us: u64) -> Option<Frame> {
        self.advance(now_us);
        if self.outbox.in_flight.is_some() || self.boot_until.is_some() {
            return None;
        }
        let frame = self.next_frame()?;
        self.outbox.in_flight = Some(frame);
        Some(frame)
    }

    /// Confirms that the CAN controller has sent the frame of the last [`Node::poll`]. The node ignores calls for other frames.
    pub fn sent(&mut self, now_us: u64, frame: &Frame) {
        self.advance(now_us);
        if self.outbox.in_flight != Some(*frame) {
            return;
        }
        self.outbox.in_flight = None;
        if core::mem::take(&mut self.outbox.trouble) {
            self.error(ErrorCode::CanTransmit);
        }
        match FromBoard::decode(frame, &self.config.profile) {
            // The INITACK counts only if it contains the number that the board is accepting now. The board may have
            // lost this number, for example by a reset, while the frame waited.
            Ok((_, FromBoard::InitAck(number))) if self.taking.is_some_and(|n| n.number() == number) => {
                self.numbered();
            }
            Ok((_, FromBoard::Ready)) => self.programming.answered(),
            _ => {}
        }
    }

    /// Reports that the CAN controller gave up sending the frame of the last [`Node::poll`], for example in bus-off.
    /// An INITACK is sent again later; any other frame is lost. After the next frame that is sent, the board sends
    /// DSP_ERROR 6.
    pub fn not_sent(&mut self, now_us: u64, frame: &Frame) {
        self.advance(now_us);
        if self.outbox.in_flight != Some(*frame) {
            return;
        }
        self.outbox.in_flight = None;
        self.outbox.trouble = true;
        self.counters.not_sent = self.counters.not_sent.saturating_add(1);
        match FromBoard::decode(frame, &self.config.profile) {
            Ok((_, FromBoard::InitAck(_))) => self.outbox.ack = self.taking.or(self.number).is_some(),
            Ok((_, FromBoard::Ready)) => self.programming.answered(),
            _ => {}
        }
    }

    /// Reports that frames were lost because the receive buffer of the CAN controller overflowed (DSP_ERROR 8).
    pub fn overrun(&mut self, now_us: u64) {
        self.advance(now_us);
        if self.boot_until.is_none() {
            self.error(ErrorCode::CanOverrun);
        }
    }

    /// Returns the time at which [`Node::poll`] must be called if no frame arrives. A time in the past means that the call is due
    /// immediately.
    pub fn next_deadline(&self) -> u64 {
        self.deadline()
    }

    /// Returns the settings of the board.
    pub const fn config(&self) -> &NodeConfig {
        &self.config
    }

    /// Returns the counters of the board, which count since [`Node::new`].
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Returns the sequence number of the board; returns `None` if the board has no number.
    pub const fn number(&self) -> Option<Sequence> {
        self.number
    }

    /// Returns the validity record of the application in flash.
    pub const fn record(&self) -> Option<Record> {
        self.record
    }

    /// Returns the phase of the board.
    pub const fn phase(&self) -> Phase {
        match self.app {
            _ if self.boot_until.is_some() => Phase::Booting,
            _ if self.number.is_none() => Phase::Uninitialised,
            App::Stopped if self.prog && self.programming.discarding() => Phase::Aborted,
            App::Stopped if self.prog => Phase::Programming,
            App::Stopped => Phase::Idle,
            App::Starting => Phase::Starting,
            App::Up => Phase::Ready,
            App::Running => Phase::Running,
        }
    }

    /// Returns the flags that the board sends in MCA_ADMIN_DATA.
    pub const fn admin(&self) -> Admin {
        Admin {
            run: matches!(self.app, App::Running),
            active: self.active,
            debug: self.debug,
            global_debug: self.global_debug,
        }
    }
}
