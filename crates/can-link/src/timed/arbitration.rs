//! Arbitration (ISO 11898-1). If several members start a frame at the same time, selects the members that
//! continue to send.

use super::confinement::Counters;
use super::event::MemberId;
use super::wire::{DOMINANT, WireBits, arbitration};
use crate::CanFrame;

/// A member that starts a frame.
#[derive(Clone, Copy)]
pub(super) struct Starter {
    pub(super) member: MemberId,
    pub(super) frame: CanFrame,
    pub(super) counters: Counters,
}

/// Result of the arbitration at the start of a frame.
pub(super) struct Arbitration {
    /// Members that send the same bits until the end of the frame; empty if the frame is destroyed.
    pub(super) senders: Vec<MemberId>,
    /// Frame on the bus.
    pub(super) frame: CanFrame,
    /// Number of bits from the start of the frame to the end of the CRC, or to the error if the frame is destroyed.
    pub(super) bits: u32,
    /// All members that sent the winning identifier, if their frames differ after the identifier; otherwise empty.
    pub(super) collision: Vec<MemberId>,
    /// Members in a collision that failed to send.
    pub(super) failed: Vec<MemberId>,
}

impl Arbitration {
    /// Returns `true` if the member has sent bits after the arbitration.
    pub(super) fn involves(&self, member: MemberId) -> bool {
        self.senders.contains(&member) || self.failed.contains(&member)
    }

    /// Arbitrates between the starters. Returns `None` if no member starts.
    pub(super) fn of(starters: &[Starter]) -> Option<Self> {
        let best = starters.iter().map(|starter| arbitration(&starter.frame)).min()?;
        let mut sending: Vec<(Starter, WireBits)> = starters
            .iter()
            .filter(|starter| arbitration(&starter.frame) == best)
            .filter_map(|starter| Some((*starter, WireBits::of(&starter.frame)?)))
            .collect();
        let members =
            |sending: &[(Starter, WireBits)]| sending.iter().map(|(s, _)| s.member).collect::<Vec<_>>();
        let all = members(&sending);
        let mut failed = Vec::new();
        while let Some(at) = first_difference(&sending) {
            // A member that sends a recessive bit and reads a dominant bit has a bit error.
            let (lost, on): (Vec<_>, Vec<_>) =
                sending.iter().partition(|(_, wire)| wire.bits().get(at) != Some(&DOMINANT));
            if lost.iter().any(|(starter, _)| !starter.counters.passive()) {
                // An active error flag destroys the frame for all members.
                failed.extend(members(&sending));
                let frame = sending.first()?.0.frame;
                return Some(Self {
                    senders: Vec::new(),
                    frame,
                    bits: at as u32 + 1,
                    collision: all,
                    failed,
                });
            }
            // A passive error flag is recessive, so the other members do not detect it. Only the members that lost
            // have failed to send.
            failed.extend(members(&lost));
            sending = on;
        }
        let (first, wire) = sending.first()?;
        let (frame, bits) = (first.frame, wire.bits().len() as u32);
        let collision = if failed.is_empty() { Vec::new() } else { all };
        Some(Self { senders: members(&sending), frame, bits, collision, failed })
    }
}

/// Returns the first bit in which the frames differ.
fn first_difference(sending: &[(Starter, WireBits)]) -> Option<usize> {
    let (_, first) = sending.first()?;
    let differs =
        |(_, other): &(Starter, WireBits)| first.bits().iter().zip(other.bits()).position(|(a, b)| a != b);
    sending.iter().filter_map(differs).min()
}
