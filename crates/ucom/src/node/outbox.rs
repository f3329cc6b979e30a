//! Single frames of a board that wait for the bus.

use crate::error_code::ErrorCode;
use crate::frame::Frame;
use crate::function::Sequence;

/// Largest number of DSP_ERROR frames that wait for the bus.
const ERRORS: usize = 8;
/// Largest number of reports that wait for the bus.
const REPORTS: usize = 4;

/// Single frames of a board that wait for the bus.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outbox {
    /// Frame that the CAN controller has not sent yet.
    pub in_flight: Option<Frame>,
    /// `true` if the CAN controller failed to send a frame; DSP_ERROR 6 follows after the next frame that is sent.
    pub trouble: bool,
    /// `true` if an INITACK waits for the bus.
    pub ack: bool,
    errors: [Option<(ErrorCode, Sequence)>; ERRORS],
    /// `true` if a DSP_READY waits for the bus.
    pub block_taken: bool,
    /// `true` if a DSP_PROGFINISHED waits for the bus.
    pub finished: bool,
    /// Reports that wait for the bus. Each entry contains the time at which the report is due, and the index of its
    /// next frame.
    pub reports: [Option<(u64, u8)>; REPORTS],
    /// `true` if the board must send a report after the boot.
    pub report_after_boot: bool,
    /// `true` if an MCA_DSP_READY waits for the bus.
    pub mca_ready: bool,
    /// `true` if a heartbeat waits for the bus.
    pub alive: bool,
    /// Time at which MCA_ADMIN_DATA must be sent.
    pub admin_at: Option<u64>,
}

impl Outbox {
    pub(super) const fn new() -> Self {
        Self {
            in_flight: None,
            trouble: false,
            ack: false,
            errors: [None; ERRORS],
            block_taken: false,
            finished: false,
            reports: [None; REPORTS],
            report_after_boot: false,
            mca_ready: false,
            alive: false,
            admin_at: None,
        }
    }

    /// Drops the waiting answers (DSP_READY and DSP_PROGFINISHED) of a transfer of program data that has ended.
    pub(super) fn forget_transfer(&mut self) {
        self.block_taken = false;
        self.finished = false;
    }

    /// Drops the waiting frames that only an application sends.
    pub(super) fn forget_application(&mut self) {
        self.mca_ready = false;
        self.alive = false;
        self.admin_at = None;
    }

    /// Queues a DSP_ERROR frame. The function returns `false` if the queue is full.
    pub(super) fn push_error(&mut self, code: ErrorCode, from: Sequence) -> bool {
        let place = self.errors.iter_mut().find(|place| place.is_none());
        place.map(|place| *place = Some((code, from))).is_some()
    }

    pub(super) fn pop_error(&mut self) -> Option<(ErrorCode, Sequence)> {
        let first = self.errors.first().copied().flatten();
        self.errors.rotate_left(1);
        if let Some(last) = self.errors.last_mut() {
            *last = None;
        }
        first
    }

    pub(super) fn push_report(&mut self, due_us: u64) {
        if let Some(place) = self.reports.iter_mut().find(|place| place.is_none()) {
            *place = Some((due_us, 0));
        }
    }

    /// Returns the earliest time at which a waiting frame is due.
    pub(super) fn deadline(&self) -> u64 {
        let first_error = self.errors.first().is_some_and(Option::is_some);
        if self.ack || first_error || self.block_taken || self.finished || self.mca_ready || self.alive {
            return 0;
        }
        let reports = self.reports.iter().flatten().map(|(due, _)| *due);
        reports.chain(self.admin_at).min().unwrap_or(u64::MAX)
    }
}
