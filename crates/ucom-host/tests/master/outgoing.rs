//! The frames that a member made for one test has still to send.

use ucom::Frame;

/// Frames and when they are due, µs, in the order in which they were added.
#[derive(Default)]
pub struct Outgoing(Vec<(u64, Frame)>);

impl Outgoing {
    pub fn add(&mut self, at: u64, text: &str) {
        self.0.push((at, crate::bench::frame(text)));
    }

    /// The first frame, when it is due.
    pub fn due(&self, now: u64) -> Option<Frame> {
        self.0.first().filter(|(at, _)| *at <= now).map(|(_, frame)| *frame)
    }

    /// The first frame was on the bus.
    pub fn sent(&mut self) {
        self.0.remove(0);
    }

    pub fn deadline(&self) -> u64 {
        self.0.first().map_or(u64::MAX, |(at, _)| *at)
    }
}
