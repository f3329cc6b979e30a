//! Times of the profile, converted to microseconds.

use ucom::Profile;

/// Microseconds per millisecond.
pub(crate) const MS: u64 = 1000;

/// Timeouts of the procedures, µs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Times {
    pub listen: u64,
    pub report_window: u64,
    pub report_ask: u64,
    pub init_ack: u64,
    pub info: u64,
    pub gap: u64,
    pub quiet: u64,
    pub xreset_wait: u64,
    pub start: u64,
    pub admin: u64,
    pub ready: u64,
    pub erase: u64,
    pub so: u64,
    pub ci: u64,
    pub alive_pc: u64,
    pub alive_late: u64,
    pub alive_lost: u64,
}

impl Times {
    pub(crate) fn of(p: &Profile) -> Self {
        let ms = |v: u32| u64::from(v) * MS;
        Self {
            listen: ms(p.master_listen),
            report_window: ms(p.report_window),
            report_ask: ms(p.report_ask_window),
            init_ack: ms(p.init_ack_timeout),
            info: ms(p.info_timeout),
            gap: ms(p.string_gap),
            quiet: ms(p.string_quiet),
            xreset_wait: ms(p.xreset_wait),
            start: ms(p.start_timeout),
            admin: ms(p.admin_timeout),
            ready: ms(p.prog_ready_timeout),
            erase: ms(p.prog_erase_timeout),
            so: ms(p.so_period),
            ci: ms(p.ci_period),
            alive_pc: ms(p.alive_pc_period),
            alive_late: ms(p.alive_dsp_period) * 3 / 2,
            alive_lost: ms(p.alive_dsp_lost),
        }
    }
}
