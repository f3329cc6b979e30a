//! Order in which a board sends its frames.

use super::{Application, Flash, Node, Pins, Store};
use crate::frame::Frame;
use crate::function::Sequence;
use crate::message::FromBoard;
use crate::report::Report;

impl<F: Flash, P: Pins, S: Store, A: Application> Node<F, P, S, A> {
    /// Returns the sequence number that this board uses in the identifiers of its frames. A board without a sequence number uses the
    /// number that the profile requires (D-06).
    pub(super) fn own_number(&self) -> Sequence {
        self.number.unwrap_or(self.config.profile.unnumbered())
    }

    /// Queues a DSP_REPORT. The delay of the report in milliseconds equals the UCoM id (D-07).
    pub(super) fn report(&mut self) {
        let wait = u32::from(self.config.flash_number & 0xFF);
        self.outbox.push_report(self.after_ms(wait));
    }

    /// Queues MCA_ADMIN_DATA as an answer. The answer waits until the PC's frame with the same identifier has left the bus (D-05). If
    /// MCA_ADMIN_DATA without a request is already waiting, the answer replaces it.
    pub(super) fn answer_admin(&mut self) {
        self.outbox.admin_at = Some(self.after_ms(self.config.profile.shared_delay));
    }

    /// Queues MCA_ADMIN_DATA that the PC did not request. The board waits a random time, because the PC could send a
    /// frame with the same identifier at the same time (D-05). If MCA_ADMIN_DATA is already queued, no second frame
    /// is queued.
    pub(super) fn send_admin_unasked(&mut self) {
        let wait = self.random(self.config.profile.shared_backoff);
        let due = self.after_ms(wait);
        self.outbox.admin_at.get_or_insert(due);
    }

    /// Returns the next frame that the board must send. Single frames come first, ordered by urgency, and then answers that consist of
    /// several frames.
    pub(super) fn next_frame(&mut self) -> Option<Frame> {
        let profile = self.config.profile;
        if let Some(number) = self.taking.or(self.number)
            && core::mem::take(&mut self.outbox.ack)
        {
            return Some(FromBoard::InitAck(number.number()).encode(number, &profile));
        }
        if let Some((code, from)) = self.outbox.pop_error() {
            return Some(FromBoard::Error(code).encode(from, &profile));
        }
        if let Some(report) = self.due_report() {
            return Some(FromBoard::Report(report).encode(self.own_number(), &profile));
        }
        // A board without a sequence number sends none of the frames below.
        let number = self.number?;
        let message = self.single_message().or_else(|| self.next_of_answers())?;
        Some(message.encode(number, &profile))
    }

    fn single_message(&mut self) -> Option<FromBoard> {
        use core::mem::take;
        if take(&mut self.outbox.block_taken) {
            return Some(FromBoard::Ready);
        }
        if take(&mut self.outbox.finished) {
            return Some(FromBoard::ProgFinished);
        }
        if take(&mut self.outbox.mca_ready) {
            return Some(FromBoard::McaReady);
        }
        if take(&mut self.outbox.alive) {
            return Some(FromBoard::Alive);
        }
        if self.outbox.admin_at.is_some_and(|at| at <= self.now_us) {
            self.outbox.admin_at = None;
            return Some(FromBoard::Admin(self.admin()));
        }
        None
    }

    fn due_report(&mut self) -> Option<Report> {
        let own = self.own_number();
        let (mode, flash_number) = (self.config.profile.report_mode, self.config.flash_number);
        let now = self.now_us;
        let place = self.outbox.reports.iter_mut().find(|place| place.is_some_and(|(due, _)| due <= now))?;
        let (due, i) = (*place)?;
        let report = Report::nth(mode, i, flash_number, own)?;
        let more = Report::nth(mode, i + 1, flash_number, own).is_some();
        *place = more.then_some((due, i + 1));
        Some(report)
    }
}
