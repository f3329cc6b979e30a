//! Simulated board that accepts program data and answers by a table of frames.

use ucom::Frame;

use super::bench::{Bench, MS, Member};

/// Simulated board that answers by a table of frames. The board accepts every block; the last rule of the table defines the end of the
/// update.
pub(super) struct Loader {
    /// Program ID and date in `DSP_INFO` before and after the update.
    pub info: [&'static str; 2],
    /// Function that returns the flash number that the board sends. The arguments of the function are the number of resets so far, and
    /// `true` if the transfer was cancelled after the last reset.
    pub flash: fn(usize, bool) -> &'static str,
    /// Status of the board after it has received all blocks.
    pub done_status: u8,
    pub blocks: usize,
    pub cancelled: bool,
    /// Number of PC_PROG frames that the board received in this attempt.
    pub frames: usize,
    pub resets: usize,
    /// Delay of DSP_READY for each block, in milliseconds.
    pub delay: fn(usize) -> u64,
    /// Answer to a block instead of DSP_READY; an empty text means no answer.
    pub special: fn(usize, usize) -> Option<&'static str>,
    /// Number of frames after which the board sends an error at once and accepts no further frames.
    pub refuses_at: Option<usize>,
    pub out: Vec<(u64, Frame)>,
    pub waiting: bool,
    pub status: u8,
}

impl Loader {
    pub(super) fn new(blocks: usize) -> Self {
        Self {
            info: ["34126E38", "3F4BC13A"],
            flash: |_, _| "2100",
            done_status: 0x1B,
            blocks,
            cancelled: false,
            frames: 0,
            resets: 0,
            delay: |_| 1,
            special: |_, _| None,
            refuses_at: None,
            out: Vec::new(),
            waiting: false,
            status: 0x1B,
        }
    }

    fn answer(&mut self, at: u64, text: &str) {
        self.out.push((at, super::bench::frame(text)));
        self.out.sort_by_key(|(at, _)| *at);
    }
}

impl Member for Loader {
    fn poll(&mut self, now: u64) -> Option<Frame> {
        let due = self.out.first().filter(|(at, _)| *at <= now && !self.waiting)?.1;
        self.waiting = true;
        Some(due)
    }
    fn sent(&mut self, _: u64, _: &Frame) {
        self.waiting = false;
        self.out.remove(0);
    }
    fn deadline(&self) -> u64 {
        self.out.first().map_or(u64::MAX, |(at, _)| *at)
    }
    fn receive(&mut self, now: u64, frame: &Frame) {
        let text = frame.to_string();
        match text.as_str() {
            "041#" => {
                (self.frames, self.status, self.cancelled) = (0, 0x1F, false);
                self.resets += 1;
            }
            "1C1#0400" => (self.status, self.cancelled) = (0x1B, true),
            "1C1#0404" => self.status = 0x1F,
            "201#" | "200#" => {
                let done = self.frames >= 8 * self.blocks;
                let program = self.info[usize::from(done)];
                let flash = (self.flash)(self.resets, self.cancelled);
                self.answer(now + 300, &format!("141#{flash}01{:02X}{program}", self.status));
                self.answer(now + 301, "141#0000");
            }
            _ if text.starts_with("2C1#") => {
                self.frames += 1;
                if self.refuses_at == Some(self.frames) {
                    self.answer(now + 10, "081#02");
                }
                if self.refuses_at.is_some_and(|at| self.frames >= at) {
                    return;
                }
                if self.frames.is_multiple_of(8) {
                    let block = self.frames / 8 - 1;
                    let usual = if block + 1 == self.blocks { "101#" } else { "181#" };
                    if block + 1 == self.blocks {
                        self.status = self.done_status;
                    }
                    let answer = (self.special)(self.resets, block).unwrap_or(usual);
                    if !answer.is_empty() {
                        self.answer(now + (self.delay)(block) * MS, answer);
                    }
                }
            }
            _ => {}
        }
    }
}

pub(super) fn loader(loader: Loader) -> Bench {
    Bench::new(Default::default(), vec![Box::new(loader)])
}
