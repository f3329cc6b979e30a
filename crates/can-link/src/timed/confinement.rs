//! Fault confinement: the error counters of a controller (ISO 11898-1).

use crate::{ControllerState, ErrorState};

/// Error counters of a member.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counters {
    tec: u16,
    rec: u16,
}

impl Counters {
    pub(crate) fn state(self) -> ControllerState {
        ControllerState::of_counters(self.tec, self.rec)
    }

    /// Returns `true` if the member is error passive. The error flags of such a member do not destroy frames.
    pub(crate) fn passive(self) -> bool {
        self.state().errors >= ErrorState::Passive
    }

    pub(crate) fn bus_off(self) -> bool {
        self.state().errors == ErrorState::BusOff
    }

    pub(crate) fn sent(&mut self) {
        self.tec = self.tec.saturating_sub(1);
    }

    pub(crate) fn send_failed(&mut self) {
        self.tec = self.tec.saturating_add(8);
    }

    /// Counts a missing acknowledgement. If the sender is error passive, the counter stays unchanged. A single member
    /// on a bus therefore never goes bus-off because of missing acknowledgements.
    pub(crate) fn not_acknowledged(&mut self) {
        if !self.passive() {
            self.send_failed();
        }
    }

    pub(crate) fn received(&mut self) {
        self.rec = if self.rec > 127 { 119 } else { self.rec.saturating_sub(1) };
    }

    pub(crate) fn receive_error(&mut self) {
        self.rec = (self.rec + 1).min(255);
    }
}

/// Recovery from bus-off: number of sequences of 11 recessive bits for which the member must still wait.
///
/// On an idle bus these sequences follow each other. On a busy bus, each frame ends with one such sequence: the
/// delimiter of its acknowledgement or of its error frame, the end of frame, and the intermission. On a busy bus, a
/// member therefore recovers after at least 128 frames.
pub(crate) struct Recovery {
    pub left: u32,
    /// Time since which the bus has been continuously recessive, ns; `None` while a frame is on the bus.
    pub recessive_from: Option<u64>,
}

impl Recovery {
    pub(crate) fn due(&self, sequence_ns: u64) -> Option<u64> {
        Some(self.recessive_from? + u64::from(self.left) * sequence_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_move_by_the_numbers_of_the_standard() {
        let mut counters = Counters::default();
        for failures in 1..=32 {
            counters.send_failed();
            assert_eq!(counters.state().tec, Some(8 * failures));
            assert_eq!((counters.passive(), counters.bus_off()), (failures >= 16, failures >= 32));
        }
        let mut alone = Counters::default();
        for _ in 0..1000 {
            alone.not_acknowledged();
        }
        assert_eq!(alone.state(), ControllerState::of_counters(128, 0));
        alone.sent();
        assert!(!alone.passive());
        let mut listener = Counters::default();
        for _ in 0..1000 {
            listener.receive_error();
        }
        assert!(listener.passive() && !listener.bus_off());
        listener.received();
        assert_eq!(listener.state().rec, Some(119));
    }
}
