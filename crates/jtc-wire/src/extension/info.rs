//! Identity of a device and of its firmware (J-52).
use core::fmt;

use super::reactions::{REACTIONS_LEN, Reactions};
use super::{EXTENSION_VERSION, LogState, NAME_LEN, Name};
use crate::bits::missing_parameter;
use crate::code::codes;
use crate::frame::FRAME_MIN;
use crate::layout::{ANSWER_MAX, INFO_LEN};
use crate::words::{self, Bits};

/// Length of an [`Info`] that this version writes.
pub const INFO_WRITTEN: usize = 168;
/// Board name of a simulator, whose drives are simulated (J-52).
pub const SIMULATOR: &str = "simulator";
/// Length of the firmware version text and of the firmware revision text.
const SHORT_TEXT: usize = 16;

/// Positions of the parts of an Info frame, counted from the first byte of the body.
mod field {
    use core::ops::Range;

    pub(super) const VERSION: usize = 0;
    pub(super) const MISSING: usize = 1;
    pub(super) const NODES: usize = 2;
    pub(super) const BOOT_CAUSE: usize = 3;
    pub(super) const BOOTS: Range<usize> = 4..8;
    pub(super) const UPTIME: Range<usize> = 8..16;
    pub(super) const LOST: Range<usize> = 16..20;
    pub(super) const HASH: Range<usize> = 20..28;
    pub(super) const CAPABILITIES: Range<usize> = 28..32;
    pub(super) const STORED: usize = 32;
    pub(super) const STORE: usize = 33;
    pub(super) const SEQUENCE: Range<usize> = 34..38;
    pub(super) const LOG: usize = 38;
    // Byte 39 of the body is always zero.
    pub(super) const NAME: Range<usize> = 40..72;
    pub(super) const FIRMWARE: Range<usize> = 72..88;
    pub(super) const REVISION: Range<usize> = 88..104;
    pub(super) const BOARD: Range<usize> = 104..136;
    // A later version added this part (J-67).
    pub(super) const PROGRAM_BYTES: Range<usize> = 136..140;
    pub(super) const PROGRAM_CRC: Range<usize> = 140..144;
    // A later version added this part (J-69).
    pub(super) const REACTIONS: Range<usize> = 144..168;
}

/// Bits for optional capabilities of a device. Version 1 of the extensions does not require these capabilities.
pub mod capability {
    /// Settings, names, and requests that read back the arm (J-53, J-54).
    pub const SETTINGS: u32 = 1;
    /// Storage of an arm in non-volatile memory (J-54).
    pub const STORE: u32 = 1 << 1;
    /// Speed override (J-57).
    pub const SPEED: u32 = 1 << 2;
    /// Jogging (J-58).
    pub const JOG: u32 = 1 << 3;
    /// Payload (J-60).
    pub const PAYLOAD: u32 = 1 << 4;
    /// Flight recorder (J-56).
    pub const RECORDER: u32 = 1 << 5;
    /// Report of the cause of a held stop (J-69).
    pub const STOP_CAUSE: u32 = 1 << 6;
}

codes! {
    /// Reason why the device started.
    #[derive(Default)]
    #[allow(missing_docs)]
    BootCause {
        #[default]
        Unknown = 0, "unknown";
        PowerOn = 1, "power-on";
        Pin = 2, "reset pin";
        Software = 3, "software";
        Watchdog = 4, "watchdog";
        HardFault = 5, "hard fault";
        Panic = 6, "panic";
    }
}

codes! {
    /// State of the memory for a stored arm (J-54).
    #[derive(Default)]
    #[allow(missing_docs)]
    StoreState {
        #[default]
        Absent = 0, "no memory for it";
        Empty = 1, "none stored";
        Stored = 2, "stored";
        Busy = 3, "being stored";
        Failed = 4, "storing failed";
    }
}

/// Program in flash that the device runs. The device has read these values from the flash at its start (J-67).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Program {
    /// Length of the program from the first byte of the flash, bytes.
    pub bytes: u32,
    /// CRC-32 of the program (ISO-HDLC, as in zlib and Ethernet).
    pub crc32: u32,
}

impl fmt::Display for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes, CRC-32 {:08x}", self.bytes, self.crc32)
    }
}

/// Answer to GetInfo (J-52).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Info {
    /// Version of the extensions that the device implements.
    pub version: u8,
    /// Missing parameters: bits of [`crate::missing_parameter`].
    pub missing: u8,
    /// Nodes that are not ready: bits of [`crate::words::NODES`].
    pub nodes_missing: u8,
    /// Cause of the last start.
    pub boot_cause: BootCause,
    /// Number of starts that the device has counted.
    pub boots: u32,
    /// Time since the last start, ms.
    pub uptime_ms: u64,
    /// Number of response records that were lost because too many records were waiting (J-04).
    pub lost_records: u32,
    /// Hash of all parameters that affect the motion of the arm ([`super::Hash`]).
    pub hash: u64,
    /// Bits of [`capability`].
    pub capabilities: u32,
    /// True if the UseDefault frames select the stored arm instead of the built-in arm.
    pub defaults_stored: bool,
    /// State of the memory for the stored arm.
    pub store: StoreState,
    /// Serial number of the stored arm. Each time an arm is stored, this number increases by one.
    pub sequence: u32,
    /// State of the flight recorder.
    pub log: LogState,
    /// Name of the arm that the controller uses.
    pub arm: Name,
    /// Version of the firmware.
    pub firmware: [u8; SHORT_TEXT],
    /// Git revision of the firmware.
    pub revision: [u8; SHORT_TEXT],
    /// Name of the board.
    pub board: Name,
    /// Program in flash; `None` if the device does not report its program.
    pub program: Option<Program>,
    /// Reactions of the controller; `None` if the device does not report its reactions (J-69).
    pub reactions: Option<Reactions>,
}

impl Default for Info {
    fn default() -> Self {
        Self {
            version: EXTENSION_VERSION,
            missing: 0,
            nodes_missing: 0,
            boot_cause: BootCause::Unknown,
            boots: 0,
            uptime_ms: 0,
            lost_records: 0,
            hash: 0,
            capabilities: 0,
            defaults_stored: false,
            store: StoreState::Absent,
            sequence: 0,
            log: LogState::Absent,
            arm: Name::default(),
            firmware: [0; SHORT_TEXT],
            revision: [0; SHORT_TEXT],
            board: Name::default(),
            program: None,
            reactions: None,
        }
    }
}

/// Returns the first `SHORT_TEXT` bytes of a text, padded with zeros.
pub(crate) fn short_text(text: &str) -> [u8; SHORT_TEXT] {
    let mut bytes = [0; SHORT_TEXT];
    for (to, from) in bytes.iter_mut().zip(text.bytes()) {
        *to = from;
    }
    bytes
}

/// Returns the text before the first zero byte, or `?` if the text is not valid UTF-8.
fn text(bytes: &[u8; SHORT_TEXT]) -> &str {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(SHORT_TEXT);
    bytes.get(..end).and_then(|text| core::str::from_utf8(text).ok()).unwrap_or("?")
}

impl Info {
    /// Sets the firmware version and the git revision. Cuts both texts to the available length.
    pub fn with_firmware(mut self, version: &str, revision: &str) -> Self {
        (self.firmware, self.revision) = (short_text(version), short_text(revision));
        self
    }

    /// Returns the version of the firmware.
    pub fn firmware(&self) -> &str {
        text(&self.firmware)
    }

    /// Returns the git revision of the firmware.
    pub fn revision(&self) -> &str {
        text(&self.revision)
    }

    /// Returns the firmware version, followed by the git revision in brackets if the revision is known. Every program
    /// displays the version in this format.
    pub fn firmware_and_revision(&self) -> impl fmt::Display + '_ {
        FirmwareAndRevision(self)
    }

    /// Returns the body of an Info frame.
    pub fn emit(&self) -> [u8; INFO_WRITTEN] {
        use field::*;
        let mut b = [0; INFO_WRITTEN];
        b[VERSION] = self.version;
        b[MISSING] = self.missing;
        b[NODES] = self.nodes_missing;
        b[BOOT_CAUSE] = self.boot_cause as u8;
        b[BOOTS].copy_from_slice(&self.boots.to_be_bytes());
        b[UPTIME].copy_from_slice(&self.uptime_ms.to_be_bytes());
        b[LOST].copy_from_slice(&self.lost_records.to_be_bytes());
        b[HASH].copy_from_slice(&self.hash.to_be_bytes());
        b[CAPABILITIES].copy_from_slice(&self.capabilities.to_be_bytes());
        b[STORED] = self.defaults_stored.into();
        b[STORE] = self.store as u8;
        b[SEQUENCE].copy_from_slice(&self.sequence.to_be_bytes());
        b[LOG] = self.log as u8;
        b[NAME].copy_from_slice(self.arm.as_bytes());
        b[FIRMWARE].copy_from_slice(&self.firmware);
        b[REVISION].copy_from_slice(&self.revision);
        b[BOARD].copy_from_slice(self.board.as_bytes());
        if let Some(program) = self.program {
            b[PROGRAM_BYTES].copy_from_slice(&program.bytes.to_be_bytes());
            b[PROGRAM_CRC].copy_from_slice(&program.crc32.to_be_bytes());
        }
        b[REACTIONS].copy_from_slice(&self.reactions.unwrap_or_default().emit());
        b
    }

    /// Parses the body of an Info frame. Ignores bytes that a later version of the extensions adds. If this version of the crate
    /// does not know a cause or a state, the default of the type is used. Returns `None` if the body is too short or a name is not
    /// valid.
    pub fn parse(body: &[u8]) -> Option<Self> {
        use field::*;
        let (b, _) = body.split_first_chunk::<INFO_LEN>()?;
        // If the body comes from an earlier version and ends before this word, the word is zero (J-67).
        let word = |at: core::ops::Range<usize>| {
            body.get(at).and_then(|bytes| bytes.first_chunk()).map_or(0, |bytes| u32::from_be_bytes(*bytes))
        };
        let long = |at: core::ops::Range<usize>| {
            b.get(at).and_then(|bytes| bytes.first_chunk()).map_or(0, |bytes| u64::from_be_bytes(*bytes))
        };
        let short = |at: core::ops::Range<usize>| b.get(at).and_then(|bytes| bytes.first_chunk()).copied();
        let capabilities = word(CAPABILITIES);
        let reactions = body.get(REACTIONS).and_then(<[u8]>::first_chunk::<REACTIONS_LEN>);
        Some(Self {
            version: b[VERSION],
            missing: b[MISSING],
            nodes_missing: b[NODES],
            boot_cause: BootCause::from_byte(b[BOOT_CAUSE]).unwrap_or_default(),
            boots: word(BOOTS),
            uptime_ms: long(UPTIME),
            lost_records: word(LOST),
            hash: long(HASH),
            capabilities,
            defaults_stored: b[STORED] != 0,
            store: StoreState::from_byte(b[STORE]).unwrap_or_default(),
            sequence: word(SEQUENCE),
            log: LogState::from_byte(b[LOG]).unwrap_or_default(),
            arm: Name::parse(b.get(NAME)?)?,
            firmware: short(FIRMWARE)?,
            revision: short(REVISION)?,
            board: Name::parse(b.get(BOARD)?)?,
            program: Some(Program { bytes: word(PROGRAM_BYTES), crc32: word(PROGRAM_CRC) })
                .filter(|program| body.len() >= PROGRAM_CRC.end && program.bytes != 0),
            reactions: reactions.filter(|_| capabilities & capability::STOP_CAUSE != 0).map(Reactions::parse),
        })
    }
}

struct FirmwareAndRevision<'a>(&'a Info);

impl fmt::Display for FirmwareAndRevision<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.firmware())?;
        match self.0.revision() {
            "" => Ok(()),
            revision => write!(f, " ({revision})"),
        }
    }
}

impl fmt::Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Info: extension {}, arm \"{}\", hash {:016x}", self.version, self.arm, self.hash)?;
        write!(f, ", firmware {} on {}", self.firmware_and_revision(), self.board)?;
        let missing =
            self.missing & (missing_parameter::FRICTION | missing_parameter::PID | missing_parameter::MODEL);
        if missing != 0 {
            write!(f, "; missing: {}", Bits(missing.into(), &words::JTC_INIT))?;
        }
        if f.alternate() {
            write!(f, "\n  boots: {}, cause of the last: {}", self.boots, self.boot_cause)?;
            write!(f, "\n  up for {} ms, {} records lost", self.uptime_ms, self.lost_records)?;
            let stored = if self.defaults_stored { "stored" } else { "built in" };
            write!(f, "\n  defaults: {stored}; memory: {}, number {}", self.store, self.sequence)?;
            write!(f, "\n  flight recorder: {}", self.log)?;
            if let Some(program) = self.program {
                write!(f, "\n  program in flash: {program}")?;
            }
            if let Some((cause, ms)) = self.reactions.and_then(|reactions| reactions.stop) {
                write!(f, "\n  last held stop {:.1} s ago: {cause}", f64::from(ms) * 0.001)?;
            }
            write!(f, "\n  capabilities: {:#x}", self.capabilities)?;
        }
        Ok(())
    }
}

const _: () = assert!(field::REACTIONS.end == INFO_WRITTEN && INFO_WRITTEN + FRAME_MIN <= ANSWER_MAX);
const _: () = assert!(field::BOARD.end == INFO_LEN && field::NAME.end - field::NAME.start == NAME_LEN);
