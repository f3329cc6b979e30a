//! Status byte, reset and sequence number of a board, and the effect of PC_SETSTATUS (D-20 to D-25).

use super::{App, Application, Flash, Node, Pins, Record, Store};
use crate::error_code::ErrorCode;
use crate::status::Status;

impl<F: Flash, P: Pins, S: Store, A: Application> Node<F, P, S, A> {
    /// Returns the status byte of the board.
    pub fn status(&self) -> Status {
        let started = self.app != App::Stopped;
        Status::default()
            .with(Status::MSTART, started)
            .with(Status::ASTART, self.store.autostart())
            .with(Status::MCARUN, self.app == App::Running)
            .with(Status::EXLRUN, !started)
            .with(Status::INIT, self.number.is_some())
            .with(Status::PROG, self.prog)
            .with(Status::OPINIT, self.opinit)
            .with(Status::IPINIT, self.pins.init_in())
    }

    /// Handles PC_RESET and similar resets: makes the outputs safe, clears the state and returns the board to the exloader.
    pub(super) fn reboot(&mut self, now_us: u64, report: bool) {
        self.stop_application();
        self.forget_number();
        self.prog = false;
        self.record = None;
        self.programming.restart(&self.config.profile);
        self.outbox = super::Outbox::new();
        self.outbox.report_after_boot = report;
        self.error_rates = [const { super::RateLimit::new() }; ErrorCode::ALL.len()];
        self.debug_rate = super::RateLimit::new();
        self.boot_until = Some(now_us.saturating_add(self.config.boot_us));
    }

    /// Ends the boot: from now on, the exloader listens for frames. Reads the validity record of the application from
    /// flash.
    pub(super) fn booted(&mut self) {
        self.boot_until = None;
        self.record = Record::parse(&self.flash.record());
        if core::mem::take(&mut self.outbox.report_after_boot) {
            self.report();
        }
    }

    /// Deletes the sequence number and all state of the board that depends on the number.
    pub(super) fn forget_number(&mut self) {
        self.number = None;
        self.taking = None;
        self.outbox.ack = false;
        self.autostart_at = None;
        self.drive_init_out(false);
        self.jobs = super::Jobs::new();
    }

    pub(super) fn drive_init_out(&mut self, active: bool) {
        self.opinit = active;
        self.pins.set_init_out(active);
    }

    /// Takes the number that the board has acknowledged. The node calls this function when the CAN controller has sent INITACK (D-24).
    pub(super) fn numbered(&mut self) {
        let Some(number) = self.taking.take() else { return };
        self.number = Some(number);
        if self.config.profile.chain_auto_opinit {
            self.drive_init_out(true);
        }
        if self.store.autostart() && !self.prog {
            self.autostart_at = Some(self.after_ms(self.config.profile.autostart_holdoff));
        }
    }

    /// Handles PC_XRESET: enters the exloader, enables programming and begins a new transfer (D-23).
    pub(super) fn xreset(&mut self) {
        self.stop_application();
        self.autostart_at = None;
        self.prog = true;
        self.programming.restart(&self.config.profile);
        self.outbox.forget_transfer();
        if !self.config.profile.xreset_keeps_init {
            self.forget_number();
        }
    }

    /// Handles PC_SETSTATUS: applies the published formula, and then the restrictions of the board (D-22).
    pub(super) fn set_status(&mut self, mask: u8, value: u8) {
        let old = self.status();
        let new = old.set(mask, value);
        if new.has(Status::ASTART) != old.has(Status::ASTART) {
            self.store.set_autostart(new.has(Status::ASTART));
        }
        if !new.has(Status::ASTART) {
            self.autostart_at = None;
        }
        if !new.has(Status::INIT) {
            self.stop_application();
            self.prog = false;
            self.programming.cancel(&self.config.profile);
            self.outbox.forget_transfer();
            self.forget_number();
            return;
        }
        match (old.has(Status::MSTART), new.has(Status::MSTART)) {
            (false, true) => self.start(),
            (true, false) => self.stop_application(),
            _ => {}
        }
        if self.app == App::Stopped && new.has(Status::PROG) != self.prog {
            self.prog = new.has(Status::PROG);
            self.outbox.forget_transfer();
            if self.prog {
                self.autostart_at = None;
                self.programming.restart(&self.config.profile);
            } else {
                self.programming.cancel(&self.config.profile);
            }
        }
        self.drive_init_out(new.has(Status::OPINIT));
    }

    /// Starts the application from the exloader, after PC_START, MSTART 0→1 or autostart (D-30).
    pub(super) fn start(&mut self) {
        self.autostart_at = None;
        match self.app {
            App::Up | App::Running => self.outbox.mca_ready = true,
            App::Starting => {}
            App::Stopped if self.record.is_none() => self.error(ErrorCode::AutostartForbidden),
            App::Stopped => {
                self.prog = false;
                self.programming.cancel(&self.config.profile);
                self.outbox.forget_transfer();
                (self.active, self.debug, self.global_debug) = (false, false, false);
                self.app = App::Starting;
                self.application.start(self.now_us);
                self.initial_ci();
            }
        }
    }
}
