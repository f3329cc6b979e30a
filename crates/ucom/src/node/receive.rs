//! Reaction of the board to received frames.

use super::{App, Application, Flash, Node, Pins, Store};
use crate::error_code::ErrorCode;
use crate::foreign::Foreign;
use crate::frame::{Format, Frame};
use crate::function::{Function, Sequence};
use crate::message::{DecodeError, ToBoard};
use crate::profile::AliveMode;

impl<F: Flash, P: Pins, S: Store, A: Application> Node<F, P, S, A> {
    /// Handles a frame from the bus.
    pub fn receive(&mut self, now_us: u64, frame: &Frame) {
        self.advance(now_us);
        if self.boot_until.is_some() {
            return;
        }
        let Ok((function, to)) = frame.address() else { return self.count_foreign() };
        if !function.from_pc() || !self.is_meant(function, to) {
            return;
        }
        match ToBoard::decode(frame, &self.config.profile) {
            Ok((_, message)) => self.act(to, message),
            Err(error) if error.is_length() => self.wrong_length(function, to),
            Err(DecodeError::Foreign(_)) => self.count_foreign(),
            // The frame is a message that only boards send, or one of its flags is neither 0 nor 1.
            Err(_) => self.ignore(),
        }
    }

    /// Handles a frame of any format, as a CAN driver receives it (D-02).
    pub fn receive_any(&mut self, now_us: u64, id: u32, format: Format, data: &[u8]) -> Result<(), Foreign> {
        match Frame::received(id, format, data) {
            Ok(frame) => {
                self.receive(now_us, &frame);
                Ok(())
            }
            Err(foreign) => {
                self.count_foreign();
                Err(foreign)
            }
        }
    }

    fn count_foreign(&mut self) {
        self.counters.foreign = self.counters.foreign.saturating_add(1);
    }

    fn ignore(&mut self) {
        self.counters.ignored = self.counters.ignored.saturating_add(1);
    }

    fn is_broadcast(&self, to: Sequence) -> bool {
        self.config.profile.broadcast_number() == Some(to)
    }

    /// Returns `true` if a message is addressed to this board (D-04).
    fn is_meant(&self, function: Function, to: Sequence) -> bool {
        match (function, self.number) {
            (Function::Init, _) => self.config.profile.is_board(to),
            (Function::Reset | Function::AskReport, None) => to == self.config.profile.unnumbered(),
            (_, None) => false,
            (function, Some(number)) => number == to || (function.broadcast() && self.is_broadcast(to)),
        }
    }

    /// Sends DSP_ERROR 7 (D-12), except for messages that the board ignores anyway. A board without a number does not send DSP_ERROR 7.
    /// Otherwise, all boards without a number would send this error at the same time with the same identifier (D-06).
    fn wrong_length(&mut self, function: Function, to: Sequence) {
        self.counters.wrong_length = self.counters.wrong_length.saturating_add(1);
        let served = matches!(self.app, App::Up | App::Running);
        match function {
            _ if self.number.is_none() => {}
            Function::Init if self.number != Some(to) => {}
            Function::Prog if self.programming.discarding() => {}
            Function::Prog if self.prog => self.abort(ErrorCode::CanReceive),
            Function::Prog if self.is_broadcast(to) => {}
            Function::Ci
            | Function::Par
            | Function::McaStart
            | Function::Admin
            | Function::DumpCi
            | Function::Alive
                if !served => {}
            _ => self.error(ErrorCode::CanReceive),
        }
    }

    fn act(&mut self, to: Sequence, message: ToBoard) {
        let served = matches!(self.app, App::Up | App::Running);
        match message {
            ToBoard::Reset => self.reboot(self.now_us, true),
            ToBoard::Report => self.report(),
            ToBoard::Init => self.init(to),
            ToBoard::XReset => self.xreset(),
            ToBoard::SetStatus { mask, value } => self.set_status(mask, value),
            ToBoard::Info => self.jobs.ask_info(),
            ToBoard::Prog(data) => self.program(data, self.is_broadcast(to)),
            ToBoard::Start => self.start(),
            ToBoard::Alive => self.pc_is_alive(to),
            // The messages below need the application. The board ignores them unless the application runs.
            _ if !served => self.ignore(),
            ToBoard::Ci(package) => self.receive_ci(&package),
            ToBoard::Par(package) => self.receive_par(&package),
            ToBoard::McaStart => {
                self.run_loop();
                self.answer_admin();
            }
            ToBoard::Admin(admin) => self.set_admin(admin),
            ToBoard::DumpIo => {
                let due = self.after_ms(self.config.profile.shared_delay);
                self.jobs.ask_dump_io(due);
            }
            ToBoard::DumpCi => self.jobs.ask_dump_ci(),
        }
    }

    /// Handles PC_INIT(n): the next board of the chain takes the number (section 5.2).
    fn init(&mut self, number: Sequence) {
        match self.number {
            Some(own) if own == number => self.outbox.ack = true,
            Some(_) => {}
            None if !self.pins.init_in() => self.ignore(),
            None if self.taking.is_some() => self.error(ErrorCode::Reinit),
            None => {
                self.taking = Some(number);
                self.outbox.ack = true;
            }
        }
    }

    fn pc_is_alive(&mut self, to: Sequence) {
        let unicast_only = self.config.profile.alive_mode == AliveMode::Unicast;
        if unicast_only && self.number != Some(to) {
            return self.ignore();
        }
        if self.pc_lost_at.is_some() {
            self.pc_lost_at = Some(self.after_ms(self.config.profile.alive_pc_lost));
        }
    }
}
