//! Receive buffer of a node. An interrupt reads all frames from the buffer or, in older firmware, only one frame.
use std::collections::VecDeque;

use crate::request::NodeRequest;

/// Time between two requests below which both requests cause only one interrupt, µs.
const BACK_TO_BACK_US: u64 = 250;
/// Number of requests that the receive buffer can store.
const DEPTH: usize = 3;

/// Receive buffer of a node.
#[derive(Clone, Debug)]
pub(crate) struct Inbox {
    one_per_interrupt: bool,
    waiting: VecDeque<NodeRequest>,
    last_us: Option<u64>,
}

impl Inbox {
    /// Creates a buffer. With `one_per_interrupt`, if two requests arrive without a pause, the second request stays
    /// in the buffer until another request arrives.
    pub(crate) fn new(one_per_interrupt: bool) -> Self {
        Self { one_per_interrupt, waiting: VecDeque::new(), last_us: None }
    }

    /// Stores a request that arrives at `now_us`, and returns the request that the node reads at that time.
    pub(crate) fn take(&mut self, now_us: u64, request: &NodeRequest) -> Option<NodeRequest> {
        if !self.one_per_interrupt {
            return Some(*request);
        }
        let merged = self.last_us.is_some_and(|last| now_us < last + BACK_TO_BACK_US);
        self.last_us = Some(now_us);
        if self.waiting.len() < DEPTH {
            self.waiting.push_back(*request);
        }
        if merged { None } else { self.waiting.pop_front() }
    }
}

#[cfg(test)]
mod tests {
    use jtc_bus::Request;

    use super::*;

    #[test]
    fn j12_two_requests_back_to_back_leave_an_older_node_one_behind_for_good() {
        let mut inbox = Inbox::new(true);
        let request = |node| NodeRequest::from(Request::Reset(node));
        assert_eq!(inbox.take(0, &request(0)), Some(request(0)));
        assert_eq!(inbox.take(1000, &request(1)), Some(request(1)));
        assert_eq!(inbox.take(1100, &request(2)), None);
        for n in 3..6 {
            assert_eq!(inbox.take(1000 * u64::from(n), &request(n)), Some(request(n - 1)));
        }
    }
}
