//! Finds statuses in the bytes that come from the controller.

use jtc_wire::{FrameType, HEADER, Status};

/// Lengths of a status: without gripper, with a 16-bit point index, ours (J-08).
const LENGTHS: [usize; 3] = [165, 173, 175];

/// Statuses out of a stream, whatever its chunks and whatever lies between them.
#[derive(Default)]
pub struct Scanner {
    held: Vec<u8>,
    skipped: u64,
}

impl Scanner {
    /// Bytes as they come; `found` gets each status.
    pub fn push(&mut self, bytes: &[u8], mut found: impl FnMut(Status)) {
        self.held.extend_from_slice(bytes);
        let mut at = 0;
        while let Some(start) = self.held[at..].iter().position(|b| *b == HEADER) {
            self.skipped += start as u64;
            at += start;
            let rest = &self.held[at..];
            if rest.len() < 4 && plausible(rest) {
                break;
            }
            let n = if plausible(rest) { usize::from(rest[2]) << 8 | usize::from(rest[3]) } else { 0 };
            if n > rest.len() {
                break;
            }
            match Status::parse(&rest[..n]) {
                Some(status) => {
                    found(status);
                    at += n;
                }
                None => {
                    self.skipped += 1;
                    at += 1;
                }
            }
        }
        if !self.held[at..].contains(&HEADER) {
            self.skipped += (self.held.len() - at) as u64;
            at = self.held.len();
        }
        self.held.drain(..at);
    }

    /// Bytes that belong to no status.
    pub fn skipped(&self) -> u64 {
        self.skipped
    }
}

/// These bytes may be the beginning of a status.
fn plausible(bytes: &[u8]) -> bool {
    bytes.get(1).is_none_or(|t| *t == FrameType::JtcStatus as u8)
        && bytes.get(2).is_none_or(|hi| *hi == 0)
        && bytes.get(3).is_none_or(|lo| LENGTHS.contains(&usize::from(*lo)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn status(point: u32) -> Status {
        Status { point, fsm: 2, gripper: Some(Default::default()), ..Default::default() }
    }

    proptest! {
        /// J-03 seen from the host: statuses come out whole, in any chunking, with rubbish and false headers between them.
        #[test]
        fn j08_every_status_is_found_in_any_chunking(
            rubbish in prop::collection::vec(prop::collection::vec(prop_oneof![Just(0x9Bu8), Just(3), Just(0), any::<u8>()], 0..12), 1..6),
            chunk in 1usize..200,
        ) {
            let mut stream = Vec::new();
            for (i, r) in rubbish.iter().enumerate() {
                stream.extend(r);
                stream.extend(status(i as u32).emit());
            }
            // Two more, so that a false header cannot hold the last one back for ever.
            stream.extend(status(1000).emit());
            stream.extend(status(1001).emit());
            let (mut scanner, mut points) = (Scanner::default(), Vec::new());
            for piece in stream.chunks(chunk) {
                scanner.push(piece, |s| points.push(s.point));
            }
            for i in 0..rubbish.len() as u32 {
                prop_assert!(points.contains(&i), "status {i} is missing in {points:?}");
            }
        }
    }

    #[test]
    fn rubbish_is_counted() {
        let mut scanner = Scanner::default();
        scanner.push(&[1, 2, 3, 0x9B, 4], |_| panic!("no status here"));
        assert_eq!(scanner.skipped(), 5);
    }
}
