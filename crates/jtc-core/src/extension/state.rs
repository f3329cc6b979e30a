//! State of the controller for the extensions.
use jtc_wire::{BootCause, Hash, LogState, Name, Program, StoreState};

use super::answers::Answers;
use super::image::StoredArm;
use crate::config::defaults;

/// Request of a host to the recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LogRequest {
    /// The recorder must send a page of a block to this line, starting at byte `offset`.
    Page { line: usize, block: u32, offset: u16 },
    /// The recorder must discard the log and begin a new log.
    Clear,
}

/// Identity of the device, as set by its board (J-52).
#[derive(Clone, Copy, Debug, Default)]
pub struct Identity {
    /// Name of the board.
    pub board: &'static str,
    /// Version of the firmware.
    pub firmware: &'static str,
    /// Git revision of the firmware.
    pub revision: &'static str,
    /// Number of starts of the device.
    pub boots: u32,
    /// Cause of the last start.
    pub boot_cause: BootCause,
    /// Program in the flash of the board. `None` if the board has no program in the flash, or has not read it (J-67).
    pub program: Option<Program>,
}

/// State of the controller for the extensions.
#[derive(Clone, Debug)]
pub(crate) struct Extensions {
    pub answers: Answers,
    pub stored: StoredArm,
    /// `true` if the board must write the stored arm to non-volatile memory.
    pub store_requested: bool,
    /// `true` if an arm is stored but the controller could not load or write it. The controller does not use the
    /// built-in arm in its place.
    pub unusable: bool,
    /// Hash of the arm in use; `None` until it is computed again.
    pub hash: Option<u64>,
    /// Ticks since the controller received a frame of a host.
    pub hosts_silent_ms: u32,
    /// Remaining time in which the controller refuses a Jog with a velocity, ms. Each refused Jog starts this time again.
    pub jogs_refused_ms: u16,
    /// Progress of the hash of the arm.
    pub(super) hashed: (usize, Hash),
    pub identity: Identity,
    /// Hash of the firmware's version and revision.
    pub firmware_hash: u64,
    /// State of the flight recorder, and the pending request of a host to it (J-56).
    pub log: LogState,
    pub log_request: Option<LogRequest>,
    pub(super) name: Name,
    pub(super) store: StoreState,
    pub(super) sequence: u32,
}

impl Extensions {
    /// Refuses Jogs after a jog was stopped, so that a jog key that is still pressed causes no motion (J-58).
    pub(crate) fn refuse_jogs(&mut self) {
        self.jogs_refused_ms = crate::motion::JOG_LASTS_MS;
    }

    pub(crate) fn new() -> Self {
        Self {
            answers: Answers::new(),
            stored: StoredArm::new(),
            store_requested: false,
            unusable: false,
            hash: None,
            hosts_silent_ms: 0,
            jogs_refused_ms: 0,
            hashed: (0, Hash::new()),
            identity: Identity::default(),
            firmware_hash: firmware_hash("", ""),
            log: LogState::Absent,
            log_request: None,
            name: Name::cut(defaults::NAME),
            store: StoreState::Absent,
            sequence: 0,
        }
    }
}

/// Returns the hash of a firmware's version and revision, which identifies the firmware in a log (FNV-1a, 64 bits).
pub fn firmware_hash(version: &str, revision: &str) -> u64 {
    Hash::new().update(version.as_bytes()).update(&[0]).update(revision.as_bytes()).value()
}
