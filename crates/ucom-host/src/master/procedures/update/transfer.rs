//! An attempt to transfer both cycles to the boards, block by block. The boards must answer each block before the PC sends the next block
//! (U-5).
use crate::master::engine::{Event, Link, MS};
use crate::master::reports::update::{Progress, UpdatePlan};
use ucom::{BLOCK_LEN, ErrorCode, FromBoard, Function, Sequence, ToBoard};

/// Reasons why the attempt to update a board ended early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Broken {
    Device {
        code: ErrorCode,
        cycle: u32,
        block: usize,
    },
    Timeout {
        cycle: u32,
        block: usize,
        waited_ms: u64,
    },
    /// The board did not answer the very last block. The answer to PC_INFO must then show the result (U-9).
    NoFinish {
        waited_ms: u64,
    },
}

impl Broken {
    /// Returns `true` if the board discards the following program data (D-43), because it has reported a programming
    /// error. After any other error, and after silence, the board possibly still accepts program data.
    pub(super) fn ended_transfer(self) -> bool {
        use ErrorCode::{CanReceive, Checksum, Data, ExloadCycle, Flash, MemProtected, Overrun};
        let Self::Device { code, .. } = self else { return false };
        matches!(code, Checksum | MemProtected | Flash | Overrun | Data | CanReceive | ExloadCycle)
    }
}

/// State of one attempt and of the boards that take part in it.
pub(super) struct Attempt<'a> {
    pub link: &'a Link,
    pub plan: &'a UpdatePlan,
    /// Number to which the PC sends the blocks.
    pub to: Sequence,
    pub boards: Vec<u8>,
    pub number: u32,
    pub gap_us: u64,
    /// Time at which the transfer began, µs.
    pub since: u64,
}

/// Results of an attempt, for each board.
#[derive(Debug, Default)]
pub(super) struct Transferred {
    pub finished: Vec<u8>,
    pub broken: Vec<(u8, Broken)>,
}

impl Attempt<'_> {
    /// Sends the blocks of both cycles. Before the first frame of a cycle that can erase memory, the function calls
    /// `erasing` with two lists: the boards that still take part in the attempt, and the boards that have left it.
    pub(super) async fn run(mut self, mut erasing: impl FnMut(&[u8], &[(u8, Broken)])) -> Transferred {
        let mut out = Transferred::default();
        let mask = self.boards.iter().fold(0, |mask, b| mask | 1 << b);
        self.link.listen(mask, &[Function::DspReady, Function::ProgFinished]);
        let mut done = 0;
        for (index, cycle) in self.plan.cycles.iter().enumerate() {
            let number = index as u32 + 1;
            let blocks = cycle.blocks();
            let may_erase = number >= self.plan.erases_from;
            for block in 0..blocks {
                let Some(bytes) = cycle.block(block) else { break };
                if block == 0 && may_erase {
                    erasing(&self.boards, &out.broken);
                }
                self.send(&bytes).await;
                let last = number == 2 && block + 1 == blocks;
                let slow = (block == 0 && may_erase) || block + 1 == blocks;
                self.wait(number, block, slow, last, &mut out).await;
                if self.boards.is_empty() {
                    return out;
                }
                done += BLOCK_LEN as u64;
                self.progress(number, done);
            }
        }
        out.finished = self.boards;
        out
    }

    /// Sends the eight frames of a block of program data. Only an error can be an answer to the block before the last
    /// of these frames has left the queue; other frames that were received before are discarded.
    async fn send(&self, block: &[u8; BLOCK_LEN]) {
        let (frames, _) = block.as_chunks::<8>();
        let mut next = 0;
        for data in frames {
            self.link.sleep_until(next).await;
            // The gap is measured from the start of one frame to the start of the next.
            next = self.link.feed(self.to, ToBoard::Prog(*data)).await + self.gap_us;
        }
    }

    /// Waits until all boards have answered the block. A board that reports an error or stays silent is removed from
    /// the attempt.
    async fn wait(&mut self, cycle: u32, block: usize, slow: bool, last: bool, out: &mut Transferred) {
        let times = self.link.times();
        let timeout = if slow { times.erase } else { times.ready };
        let since = self.link.now();
        let until = since + timeout;
        let mut waiting: Vec<u8> = self.boards.clone();
        while !waiting.is_empty() {
            let Some(received) = self.link.next(until).await else { break };
            if !self.boards.contains(&received.from) {
                continue;
            }
            match received.message {
                // A DSP_READY after the last block of the update is ignored, because DSP_PROGFINISHED must follow.
                FromBoard::Ready if !last => waiting.retain(|b| *b != received.from),
                FromBoard::ProgFinished if last => waiting.retain(|b| *b != received.from),
                FromBoard::Error(code) => {
                    waiting.retain(|b| *b != received.from);
                    self.leave(received.from, Broken::Device { code, cycle, block }, out);
                }
                _ => {}
            }
        }
        let waited_ms = self.link.now().saturating_sub(since) / MS;
        for board in waiting {
            let why = if last {
                Broken::NoFinish { waited_ms }
            } else {
                Broken::Timeout { cycle, block, waited_ms }
            };
            self.leave(board, why, out);
        }
    }

    fn leave(&mut self, board: u8, why: Broken, out: &mut Transferred) {
        self.boards.retain(|b| *b != board);
        out.broken.push((board, why));
    }

    fn progress(&self, cycle: u32, bytes: u64) {
        let total = self.plan.total_bytes();
        let us = self.link.now().saturating_sub(self.since).max(1);
        let rate = bytes * 1_000_000 / us;
        let remaining_us = total.saturating_sub(bytes) * us / bytes.max(1);
        let boards = self.boards.clone();
        let progress = Progress { boards, attempt: self.number, cycle, bytes, total, rate, remaining_us };
        self.link.with(|core| core.event(Event::Progress { id: self.link.id, progress }));
    }
}
