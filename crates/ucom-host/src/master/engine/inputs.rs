//! Transmission of inputs and parameters to the boards.
use crate::master::engine::mailbox::Forget;
use crate::master::engine::shared::{Core, Session};
use crate::master::io::process_data::ProcessData;
use crate::master::load::frame_bits;
use ucom::{BufferPackage, Frame, Sequence, ToBoard};

/// Percentage of the bus time that repeated inputs may use.
const INPUTS_SHARE: u64 = 70;
/// Largest delay, in µs, that the master makes up for by repeating the inputs at shorter intervals.
const INPUTS_CREDIT: u64 = 5_000;

impl Core {
    /// Ends the repetition of a board's inputs and discards the queued inputs. If the board is still being started, its inputs are not
    /// repeated yet, so they stay queued.
    pub(crate) fn stop_inputs(&mut self, board: u8) {
        if self.data.get_mut(&board).is_some_and(|data| data.repeat.take().is_some()) {
            self.forget_inputs(board);
        }
    }

    pub(crate) fn stop_all_inputs(&mut self) {
        let all: Vec<u8> = self.data.keys().copied().collect();
        all.into_iter().for_each(|number| self.stop_inputs(number));
    }

    /// Repeats the controller inputs of each board every `ci.period`, so that the loss of a frame has no lasting
    /// effect (D-34). If the inputs of several boards are due, the board that has waited longest comes first.
    ///
    /// The repeated inputs use only a part of the bus time, even if boards were started with `force`. Without this
    /// limit, inputs would delay answers and heartbeats, which have a lower priority on the bus. The queue of a
    /// socket is not a limit, because it accepts more frames than the bus can carry.
    pub(crate) fn repeat_inputs(&mut self) {
        if self.session == Session::Quiet {
            return;
        }
        let packages = |data: &ProcessData| data.ci.len().div_ceil(3) as u64;
        while self.inputs_from <= self.now
            && let Some((_, board, packages)) = self
                .data
                .iter()
                .filter_map(|(board, data)| Some((data.repeat?, *board, packages(data))))
                .min()
                .filter(|(at, ..)| *at <= self.now)
        {
            let us = packages * frame_bits(8) * 1_000_000 / u64::from(self.profile.bitrate.max(1));
            let credit = self.now.saturating_sub(INPUTS_CREDIT);
            self.inputs_from = self.inputs_from.max(credit) + us * 100 / INPUTS_SHARE;
            self.send_inputs(board);
        }
    }

    /// Queues all inputs of a board, and sets the time of the next repetition.
    pub(crate) fn send_inputs(&mut self, board: u8) {
        let Some(data) = self.data.get_mut(&board) else { return };
        if let Some(at) = data.repeat {
            let next = at + self.times.ci;
            data.repeat = Some(if self.now >= next { self.now + self.times.ci } else { next });
        }
        let offsets: Vec<u16> = ucom::Packages::new(&data.ci).map(|package| package.offset).collect();
        offsets.into_iter().for_each(|offset| self.queue_inputs(board, offset));
    }

    /// Sends a changed controller input at once. If this PC repeats the inputs, it sends the whole package of three
    /// words that contains the input, because a package takes effect as a whole (D-34). Otherwise, it sends only the
    /// changed word (DLC 4, D-15), because it does not know the other words.
    pub(crate) fn send_input(&mut self, board: u8, index: u16) {
        let (Some(to), Some(data)) = (Sequence::new(board), self.data.get(&board)) else { return };
        if data.repeat.is_some() {
            return self.queue_inputs(board, index - index % 3);
        }
        let Some(word) = data.ci.get(usize::from(index)) else { return };
        let package = BufferPackage { offset: index, count: 1, words: [*word, 0, 0] };
        let payload = package.payload(self.profile.endian, true);
        let frame = Frame::of(ToBoard::Ci(package).function(), to, payload);
        self.queue_frame(None, frame, Forget::Nothing);
    }

    /// Invalidates the parameters (D-35) and inputs of a board whose application was restarted.
    pub(crate) fn forget_parameters(&mut self, board: u8) {
        self.stop_inputs(board);
        if let Some(data) = self.data.get_mut(&board) {
            data.par.forget();
            data.ci_known.clear();
            // The board can be running another application now, so it must send its description again.
            data.sent = false;
        }
    }

    /// Writes one parameter of a board. The PC cannot read the value back, so it marks the value in its own copy of
    /// the parameters as assumed (D-35).
    ///
    /// The package contains only the word of this parameter (DLC 4, which every receiver accepts). The other words of
    /// the buffer must not change, and the PC does not always know them.
    pub(crate) fn send_parameter(&mut self, board: u8, index: u16, value: u16) -> bool {
        let Some(to) = Sequence::new(board) else { return false };
        let Some(data) = self.data.get_mut(&board) else { return false };
        if index >= data.par.len() {
            return false;
        }
        data.par.wrote(index, value);
        let package = BufferPackage { offset: index, count: 1, words: [value, 0, 0] };
        let payload = package.payload(self.profile.endian, true);
        let frame = Frame::of(ToBoard::Par(package).function(), to, payload);
        self.queue_frame(None, frame, Forget::Nothing);
        true
    }
}
