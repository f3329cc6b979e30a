//! Completion of a frame on the bus, and its effect on the error counters.

use super::confinement::Counters;
use super::wire::SUSPENDED;
use super::{BusError, BusEvent, MemberId, TimedBus, Transfer, time};
use crate::{CanFrame, ErrorState};

impl TimedBus {
    pub(super) fn finish(&mut self, transfer: Transfer) {
        let Transfer { arbitration, mut error, .. } = transfer;
        if !arbitration.collision.is_empty() {
            self.stats.collisions += 1;
            self.report(BusError::Collision, arbitration.frame, &arbitration.collision);
        }
        for member in &arbitration.failed {
            self.send_failed(*member, BusError::Collision);
        }
        let frame = arbitration.frame;
        let mut senders = arbitration.senders;
        let destroyed = senders.is_empty();
        // A sender that has left the bus has not completed its frame, so it is removed from the senders.
        senders.retain(|member| !self.members[member.0].left);
        if senders.is_empty() && !destroyed && error.is_none() {
            error = Some(BusError::Disturbed);
        }
        if destroyed || error.is_some() {
            if let Some(error) = error {
                match error {
                    BusError::NotAcknowledged => self.stats.not_acknowledged += 1,
                    _ => self.stats.disturbed += 1,
                }
                self.report(error, frame, &senders);
                for member in &senders {
                    self.send_failed(*member, error);
                }
            }
            let involved = |number| arbitration.failed.contains(&number) || senders.contains(&number);
            for number in (0..self.members.len()).map(MemberId).filter(|number| !involved(*number)) {
                self.count(number, Counters::receive_error);
            }
            return;
        }
        self.stats.frames += 1;
        self.stats.shared += u64::from(senders.len() > 1);
        for member in &senders {
            self.members[member.0].queue.pop_front();
            self.members[member.0].last_try = false;
            self.events.push_back(BusEvent::Sent { member: *member, frame });
            self.count(*member, Counters::sent);
            self.suspend(*member);
        }
        let now = time(self.now);
        for number in (0..self.members.len()).map(MemberId) {
            if senders.contains(&number) || !self.members[number.0].on_bus() {
                continue;
            }
            // A member that lost the arbitration receives the winning frame, as on a real bus.
            self.count(number, Counters::received);
            match &mut self.members[number.0].lines {
                Some(lines) => lines.1.put(now, frame),
                None => self.events.push_back(BusEvent::Received { member: number, frame }),
            }
        }
    }

    fn report(&mut self, error: BusError, frame: CanFrame, senders: &[MemberId]) {
        self.events.push_back(BusEvent::Error { error, frame, senders: senders.to_vec() });
    }

    fn send_failed(&mut self, number: MemberId, error: BusError) {
        self.count(
            number,
            match error {
                BusError::NotAcknowledged => Counters::not_acknowledged,
                _ => Counters::send_failed,
            },
        );
        self.suspend(number);
        let member = &mut self.members[number.0];
        let give_up = match (member.counters.bus_off(), member.one_shot || member.last_try) {
            (true, _) => member.queue.len(),
            (false, true) => 1,
            (false, false) => 0,
        };
        member.last_try = false;
        for frame in member.queue.drain(..give_up.min(member.queue.len())) {
            self.events.push_back(BusEvent::Failed { member: number, frame });
        }
    }

    fn suspend(&mut self, number: MemberId) {
        let until = self.free_from + self.bits_ns(SUSPENDED);
        let member = &mut self.members[number.0];
        if member.counters.passive() {
            member.may_start = until;
        }
    }

    /// Changes a member's counters. If the error state of the member changes, adds an event.
    fn count(&mut self, number: MemberId, how: fn(&mut Counters)) {
        let member = &mut self.members[number.0];
        if !member.on_bus() {
            return;
        }
        let before = member.counters.state().errors;
        how(&mut member.counters);
        let state = member.counters.state();
        if state.errors != before {
            self.events.push_back(BusEvent::State { member: number, state });
            if self.recovers_by_itself && state.errors == ErrorState::BusOff {
                self.recover(number);
            }
        }
    }
}
