//! Table of the profile keys. Each line of the table contains field, default, range, rule and meaning of a key.

use core::fmt;

use super::values::{AliveMode, Broadcast, CiLatch, Endian, HeaderForm, OnLost, Plan, ReportMode, Value};
use crate::program::{Checksum, DateForm};

/// Kind of a key's value, for file formats with typed values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The value is a whole number.
    Number,
    /// The value is `yes` or `no`.
    YesNo,
    /// The value is a word from a fixed list.
    Word,
}

/// Key of the compatibility profile.
pub struct Key {
    /// Name of the key in files, for example `prog.frame_gap_us`.
    pub name: &'static str,
    /// Default of the key, as text.
    pub default: &'static str,
    /// Allowed values of the key, as text.
    pub range: &'static str,
    /// Rule and meaning of the key, with the unit.
    pub doc: &'static str,
    /// Kind of the key's values.
    pub kind: Kind,
    pub(super) set: fn(&mut Profile, &str) -> bool,
    write: fn(&Profile, &mut fmt::Formatter<'_>) -> fmt::Result,
}

impl Key {
    /// Returns the value of the key in a profile, as text for display.
    pub fn value<'a>(&'a self, profile: &'a Profile) -> impl fmt::Display + 'a {
        struct Shown<'a>(&'a Key, &'a Profile);
        impl fmt::Display for Shown<'_> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                (self.0.write)(self.1, f)
            }
        }
        Shown(self, profile)
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Key {}

macro_rules! keys {
    ($($field:ident: $type:ty = $value:expr, $kind:ident, $name:literal, $default:literal, $range:literal,
       $allowed:pat, $doc:literal;)+) => {
        /// Values of all profile keys. [`Profile::default`] is this project's interpretation of the protocol.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct Profile { $(#[doc = concat!("`", $name, "`: ", $doc, " Allowed: ", $range, ".")] pub $field: $type),+ }

        impl Profile {
            /// Defaults of all keys, as a constant.
            pub const DEFAULT: Self = Self { $($field: $value),+ };
        }

        /// All keys of the profile, in the order that files and help use.
        pub static KEYS: &[Key] = &[$(Key {
            name: $name,
            default: $default,
            range: $range,
            doc: $doc,
            kind: Kind::$kind,
            set: |profile, text| match <$type as Value>::read(text) {
                Some(value) if matches!(value, $allowed) => {
                    profile.$field = value;
                    true
                }
                _ => false,
            },
            write: |profile, f| profile.$field.write(f),
        }),+];
    };
}

impl Default for Profile {
    fn default() -> Self {
        Self::DEFAULT
    }
}

keys! {
    bitrate: u32 = 1_000_000, Number, "bitrate", "1000000", "10000 to 1000000", 10_000..=1_000_000,
        "D-03: nominal bit rate of the bus, bit/s. Other usual rates are 500000, 250000 and 125000.";
    sample_point: u32 = 875, Number, "sample_point", "875", "500 to 950", 500..=950,
        "D-03: sample point, in thousandths of the bit time.";
    endian: Endian = Endian::Little, Word, "endian", "little", "little or big", _,
        "D-10: byte order of 16-bit fields.";
    dlc_strict: bool = false, YesNo, "dlc.strict", "no", "yes or no", _,
        "D-12: with yes, receivers refuse messages with additional bytes.";
    addr_first: u32 = 1, Number, "addr.first", "1", "0 or 1", 0..=1,
        "D-04: number of the first board.";
    addr_broadcast: Broadcast = Broadcast::Zero, Word, "addr.broadcast", "0", "0, 31 or none", _,
        "D-04: number that addresses all boards.";
    shared_delay: u32 = 2, Number, "shared.delay", "2", "0 to 50", 0..=50,
        "D-05: shortest time before a board answers a function that PC and boards send, ms.";
    shared_backoff: u32 = 8, Number, "shared.backoff", "8", "1 to 50", 1..=50,
        "D-05: longest random delay before a board sends MCA_ADMIN_DATA without a request, ms.";
    report_mode: ReportMode = ReportMode::Flash7, Word, "report.mode", "flash7", "flash7, seq or all4", _,
        "D-07: form of the answers to PC_REPORT and PC_RESET.";
    report_window: u32 = 1000, Number, "report.window", "1000", "10 to 60000", 10..=60_000,
        "D-07: time for which the PC collects reports after PC_RESET, ms.";
    report_ask_window: u32 = 300, Number, "report.ask_window", "300", "10 to 60000", 10..=60_000,
        "D-07: time for which the PC collects reports after PC_REPORT, ms.";
    master_listen: u32 = 600, Number, "master.listen", "600", "0 to 60000", 0..=60_000,
        "D-08: time for which a tool listens for another PC before it changes boards, ms.";
    init_ack_timeout: u32 = 100, Number, "init.ack_timeout", "100", "1 to 60000", 1..=60_000,
        "D-24: longest wait for DSP_INITACK after PC_INIT, ms.";
    info_timeout: u32 = 100, Number, "info.timeout", "100", "1 to 60000", 1..=60_000,
        "Longest wait for the first frame of DSP_INFO, ms.";
    string_gap: u32 = 100, Number, "string.gap", "100", "1 to 60000", 1..=60_000,
        "D-14: time without a package after which a receiver drops an incomplete string, ms.";
    string_quiet: u32 = 50, Number, "string.quiet", "50", "0 to 60000", 0..=60_000,
        "D-14: time without a package after which a description is complete, ms.";
    string_count_includes_header: bool = false, YesNo, "string.count_includes_header", "no", "yes or no", _,
        "D-13: with yes, the count in the header of a string includes the header.";
    string_max: u32 = 512, Number, "string.max", "512", "8 to 512", 8..=512,
        "D-13: largest length of a string, characters.";
    chain_auto_opinit: bool = false, YesNo, "chain.auto_opinit", "no", "yes or no", _,
        "D-21: with yes, a board raises its outgoing init pin itself after DSP_INITACK.";
    autostart_holdoff: u32 = 500, Number, "autostart.holdoff", "500", "0 to 60000", 0..=60_000,
        "D-25: time from DSP_INITACK to the automatic start of the application, ms.";
    xreset_wait: u32 = 500, Number, "xreset.wait", "500", "0 to 60000", 0..=60_000,
        "D-46: time from PC_XRESET to the first PC_INFO, ms.";
    xreset_keeps_init: bool = true, YesNo, "xreset.keeps_init", "yes", "yes or no", _,
        "D-23: with yes, a board keeps its number and the level of its outgoing init pin after PC_XRESET.";
    start_timeout: u32 = 2000, Number, "start.timeout", "2000", "1 to 60000", 1..=60_000,
        "D-30: longest wait for MCA_DSP_READY after PC_START, ms.";
    admin_timeout: u32 = 100, Number, "admin.timeout", "100", "1 to 60000", 1..=60_000,
        "D-37: longest wait for the answer to MCA_ADMIN_DATA, ms.";
    debug_rate: u32 = 20, Number, "debug.rate", "20", "0 to 20", 0..=20,
        "D-38: largest number of debug texts that a board sends per second.";
    error_rate: u32 = 10, Number, "error.rate", "10", "1 to 10", 1..=10,
        "Largest number of DSP_ERROR frames with the same code that a board sends per second.";
    prog_endian: Endian = Endian::Little, Word, "prog.endian", "little", "little or big", _,
        "D-41: byte order of program words and of the header block.";
    prog_plan: Plan = Plan::VerifyWrite, Word, "prog.plan", "verify-write",
        "verify-write, exloader-app, pmem-xmem or raw", _, "D-40: contents of the two cycles of an update.";
    prog_header: HeaderForm = HeaderForm::V1, Word, "prog.header", "v1", "v1 or none", _,
        "D-41: header block of each cycle.";
    prog_checksum: Checksum = Checksum::Crc16, Word, "prog.checksum", "crc16", "crc16, sum16, xor16 or none", _,
        "D-44: checksum algorithm for the Program ID.";
    prog_date: DateForm = DateForm::Fat, Word, "prog.date", "fat", "fat, days2000, bcd or raw", _,
        "D-45: encoding of the flash date.";
    prog_frame_gap_us: u32 = 200, Number, "prog.frame_gap_us", "200", "0 to 100000", 0..=100_000,
        "D-46: time between two frames of a block, µs.";
    prog_frame_timeout: u32 = 200, Number, "prog.frame_timeout", "200", "1 to 60000", 1..=60_000,
        "D-43: longest time between two frames of a block, ms.";
    prog_ready_timeout: u32 = 1000, Number, "prog.ready_timeout", "1000", "1 to 600000", 1..=600_000,
        "D-42: longest wait for DSP_READY, ms.";
    prog_erase_timeout: u32 = 10_000, Number, "prog.erase_timeout", "10000", "1 to 600000", 1..=600_000,
        "D-42: longest wait for DSP_READY after the header of cycle 2, and for DSP_PROGFINISHED, ms.";
    prog_attempts: u32 = 3, Number, "prog.attempts", "3", "1 to 10", 1..=10,
        "D-46: largest number of attempts of an update.";
    so_period: u32 = 10, Number, "so.period", "10", "1 to 60000", 1..=60_000,
        "D-33: time between transfers of the sensor outputs, ms.";
    ci_period: u32 = 20, Number, "ci.period", "20", "1 to 60000", 1..=60_000,
        "D-34: time between repetitions of the controller inputs, ms.";
    ci_latch: CiLatch = CiLatch::Frame, Word, "ci.latch", "frame", "frame or last", _,
        "D-34: inputs take effect with each package (frame), or with the last package (last).";
    pd_short_last: bool = false, YesNo, "pd.short_last", "no", "yes or no", _,
        "D-15: with yes, senders do not fill the last package of a buffer with zeros.";
    pd_signed: bool = true, YesNo, "pd.signed", "yes", "yes or no", _,
        "D-11: with yes, tools show words without a type as signed numbers.";
    alive_mode: AliveMode = AliveMode::Broadcast, Word, "alive.mode", "broadcast",
        "broadcast, unicast or both", _, "D-04: address of the heartbeats of the PC.";
    alive_pc_period: u32 = 500, Number, "alive.pc_period", "500", "1 to 60000", 1..=60_000,
        "Time between heartbeats of the PC, ms.";
    alive_dsp_period: u32 = 1000, Number, "alive.dsp_period", "1000", "1 to 60000", 1..=60_000,
        "Time between heartbeats of a board, ms.";
    alive_pc_lost: u32 = 1500, Number, "alive.pc_lost", "1500", "2 to 600000", 2..=600_000,
        "D-50: time without a heartbeat of the PC after which a running board stops, ms.";
    alive_dsp_lost: u32 = 3000, Number, "alive.dsp_lost", "3000", "2 to 600000", 2..=600_000,
        "D-51: time without a heartbeat of a board after which the board is lost, ms.";
    on_lost: OnLost = OnLost::StopAll, Word, "on_lost", "stop-all", "report, stop-board or stop-all", _,
        "D-51: action of the PC if a board is lost.";
    load_limit: u32 = 70, Number, "load.limit", "70", "1 to 100", 1..=100,
        "Highest predicted bus load at which the PC starts boards, percent.";
}
