//! Answers of a board that consist of several frames (DSP_INFO, dumps, outputs, texts). The node creates the frames of an answer one at a
//! time.

use super::jobs::{Place, package};
use super::{App, Application, Flash, Node, Pins, Store, Text};
use crate::buffer::{BufferPackage, package_count};
use crate::info::BoardInfo;
use crate::message::FromBoard;

impl<F: Flash, P: Pins, S: Store, A: Application> Node<F, P, S, A> {
    /// Returns the next frame of the most urgent answer.
    pub(super) fn next_of_answers(&mut self) -> Option<FromBoard> {
        if self.jobs.info.is_some() {
            return self.next_of_info();
        }
        self.next_of_so()
            .or_else(|| self.next_of_dump_io())
            .or_else(|| self.next_of_dump_ci())
            .or_else(|| self.next_of_text())
    }

    fn board_info(&self, number: u8) -> BoardInfo {
        BoardInfo {
            flash_number: self.config.flash_number,
            sequence: number,
            status: self.status(),
            program_id: self.record.map_or(0xFFFF, |record| record.program_id),
            date: self.record.map_or(0xFFFF, |record| record.date),
        }
    }

    fn next_of_info(&mut self) -> Option<FromBoard> {
        let profile = &self.config.profile;
        let made = match self.jobs.info? {
            Place::First => {
                let info = self.board_info(self.number?.number());
                Some((info.payload(profile.endian), Place::String { string: 0, package: 0 }))
            }
            Place::String { package: at, .. } => package(self.store.description(), 0, at, profile),
        };
        match made {
            Some((_, next @ Place::String { string: 0, .. })) => self.jobs.info = Some(next),
            // The next package does not exist. Either the answer is complete, or the description became shorter
            // during the answer; the PC must then request it again.
            _ => self.jobs.info_done(),
        }
        made.map(|(payload, _)| FromBoard::Info(payload))
    }

    /// Returns the `string`-th text of the IO description (D-36).
    fn io_text(&self, string: u32) -> &[u8] {
        let dimensions = self.application.dimensions();
        let Some(mut index) = string.checked_sub(1) else { return self.application.text(Text::Application) };
        for (dimension, text) in [
            (dimensions.ci, Text::Ci as fn(u16) -> Text),
            (dimensions.so, Text::So),
            (dimensions.par, Text::Par),
        ] {
            match index.checked_sub(u32::from(dimension)) {
                Some(rest) => index = rest,
                None => return self.application.text(text(index as u16)),
            }
        }
        &[]
    }

    fn next_of_dump_io(&mut self) -> Option<FromBoard> {
        if self.jobs.dump_io_at > self.now_us {
            return None;
        }
        let profile = &self.config.profile;
        let dimensions = self.application.dimensions();
        let made = match self.jobs.dump_io? {
            Place::First => {
                Some((dimensions.payload(profile.endian), Place::String { string: 0, package: 0 }))
            }
            Place::String { string, package: at } => package(self.io_text(string), string, at, profile),
        };
        match made {
            Some((_, next @ Place::String { string, .. })) if string < dimensions.strings() => {
                self.jobs.dump_io = Some(next);
            }
            // The next package does not exist. Either the answer is complete, or a text became shorter during the
            // answer; the PC must then request the answer again.
            _ => self.jobs.dump_io_done(),
        }
        made.map(|(payload, _)| FromBoard::IoDescription(payload))
    }

    fn next_of_so(&mut self) -> Option<FromBoard> {
        let offset = self.jobs.so?;
        let dimension = usize::from(self.application.dimensions().so);
        let so = self.application.so();
        let package = BufferPackage::at(so.get(..dimension).unwrap_or(so), offset);
        let last = package.is_none_or(|package| package.covers_last(dimension));
        self.jobs.so = if last { None } else { offset.checked_add(3) };
        package.map(FromBoard::So)
    }

    fn next_of_dump_ci(&mut self) -> Option<FromBoard> {
        let offset = self.jobs.dump_ci?;
        let dimension = self.application.dimensions().ci;
        let mut package = BufferPackage { offset, count: 0, words: [0; 3] };
        for (index, place) in (offset..dimension).zip(&mut package.words) {
            *place = self.application.initial_ci(index);
            package.count += 1;
        }
        let done = offset / 3 + 1 >= package_count(dimension);
        let again = done && core::mem::take(&mut self.jobs.dump_ci_again) && dimension > 0;
        self.jobs.dump_ci = if again { Some(0) } else { offset.checked_add(3).filter(|_| !done) };
        (package.count > 0).then_some(FromBoard::Ci(package))
    }

    /// Returns `true` if a debug text is waiting and its transmission has not begun.
    pub(super) fn wants_text(&self) -> bool {
        let up = matches!(self.app, App::Up | App::Running);
        up && self.jobs.text.is_none()
            && (self.jobs.own_text.is_some() || self.application.debug_text().is_some())
    }

    /// Returns the next package of a debug text. The board sends texts only if the PC has set a debug flag, and at a
    /// limited rate (D-38).
    fn next_of_text(&mut self) -> Option<FromBoard> {
        if self.wants_text() {
            let own = self.jobs.own_text.is_some();
            let wanted = self.debug || self.global_debug;
            if wanted && self.debug_rate.allow(self.now_us, self.config.profile.debug_rate) {
                self.jobs.text = Some((0, own));
            } else {
                self.counters.texts_dropped = self.counters.texts_dropped.saturating_add(1);
                self.text_done(own);
            }
        }
        let (at, own) = self.jobs.text?;
        let text = if own { self.jobs.own_text } else { self.application.debug_text() };
        let Some((payload, next)) = package(text.unwrap_or(&[]), 0, at, &self.config.profile) else {
            self.text_done(own);
            return None;
        };
        match next {
            Place::String { string: 0, package } => self.jobs.text = Some((package, own)),
            _ => self.text_done(own),
        }
        Some(FromBoard::Debug(payload))
    }

    fn text_done(&mut self, own: bool) {
        self.jobs.text = None;
        if own {
            self.jobs.own_text = None;
        } else {
            self.application.debug_done();
        }
    }
}
