//! Errors of the controller latch (J-21). This module stores the errors that have occurred, and the errors that keep the controller in
//! state Error.
use crate::bit_codec::bit_codec;
use crate::{JOINTS, error};

/// Latched and occurred errors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Errors {
    /// `true` if the safety input was low.
    emergency_input: bool,
    /// `true` if the controller device failed.
    device: bool,
    /// `true` if a joint reported an error, or misbehaved in another way (J-16, J-35, J-53).
    external_joints: bool,
    /// Internal error word of each joint.
    joints: [u16; JOINTS],
    joints_occurred: [u16; JOINTS],
    /// Causes of a held stop for each joint, until the host clears the stop (J-69).
    held: [u16; JOINTS],
    /// CAN flags that count as errors.
    can: u32,
    /// Present CAN flags that the status shows but that do not count as errors.
    can_shown: u32,
    can_occurred: u32,
    occurred: u16,
}

bit_codec!(Errors {
    emergency_input,
    device,
    external_joints,
    joints,
    joints_occurred,
    held,
    can,
    can_shown,
    can_occurred,
    occurred,
});

impl Errors {
    pub(crate) fn raise_emergency_input(&mut self) {
        self.emergency_input = true;
        self.occurred |= self.word();
    }

    pub(crate) fn raise_device(&mut self) {
        self.device = true;
        self.occurred |= self.word();
    }

    pub(crate) fn raise_external_joints(&mut self) {
        self.external_joints = true;
        self.occurred |= self.word();
    }

    /// Raises the internal errors of each joint. The error word of a joint without an error is 0.
    pub(crate) fn raise_joints(&mut self, bits: &[u16; JOINTS]) {
        if !any(bits) {
            return;
        }
        for j in 0..JOINTS {
            self.joints[j] |= bits[j];
            self.joints_occurred[j] |= bits[j];
        }
        self.occurred |= self.word();
    }

    /// Adds the causes of a held stop to the occurred errors (J-69). If the stop `latches`, the controller also shows the causes as current
    /// errors until the host clears them. During a held stop, the safety output stays 1.
    pub(crate) fn hold_joints(&mut self, causes: &[u16; JOINTS], latches: bool) {
        for j in 0..JOINTS {
            self.joints_occurred[j] |= causes[j];
            self.held[j] |= if latches { causes[j] } else { 0 };
        }
        self.occurred |= error::INTERNAL | error::INTERNAL_JOINTS;
    }

    /// Adds the errors that a refused trajectory would have caused in motion (J-36) to the occurred errors. The added errors are not
    /// latched.
    pub(crate) fn occur_joints(&mut self, bits: &[u16; JOINTS]) {
        self.hold_joints(bits, false);
    }

    /// Returns `true` if a held stop is latched. The arm does not move until the host clears this stop.
    pub(crate) fn held_stop(&self) -> bool {
        any(&self.held)
    }

    /// Ends a held stop when the torque is switched off, because the controller cannot hold an arm without torque.
    pub(crate) fn end_held_stop(&mut self) {
        self.held = [0; JOINTS];
    }

    pub(crate) fn raise_can(&mut self, flags: u32) {
        if flags == 0 {
            return;
        }
        self.can |= flags;
        self.can_occurred |= flags;
        self.occurred |= self.word();
    }

    /// Shows the CAN flags of this tick that do not count as errors, which are the flags of the gripper (J-14). The status shows such a
    /// flag only as long as its cause is present.
    pub(crate) fn show_can(&mut self, flags: u32) {
        self.can_shown = flags;
        self.can_occurred |= flags;
    }

    /// Clears the current errors (ClearCurrentErrors). Errors whose cause still persists are raised again in the same tick.
    pub(crate) fn clear_current(&mut self) {
        self.emergency_input = false;
        self.device = false;
        self.external_joints = false;
        self.joints = [0; JOINTS];
        self.held = [0; JOINTS];
        self.can = 0;
    }

    /// Clears current and occurred errors (ClearOccurredErrors).
    pub(crate) fn clear_occurred(&mut self) {
        *self = Self::default();
    }

    /// Returns `true` if an internal error is latched, which keeps the safety output at 0 (J-22).
    pub(crate) fn internal(&self) -> bool {
        self.device || self.can != 0 || any(&self.joints)
    }

    pub(crate) fn any(&self) -> bool {
        self.internal() || self.emergency_input || self.external_joints
    }

    /// Returns the current error word.
    pub(crate) fn word(&self) -> u16 {
        let bit = |on: bool, bit: u16| if on { bit } else { 0 };
        bit(self.emergency_input, error::EMERGENCY_INPUT)
            | bit(self.internal(), error::EMERGENCY_OUTPUT | error::INTERNAL)
            | bit(self.emergency_input || self.external_joints, error::EXTERNAL)
            | bit(any(&self.joints) || any(&self.held), error::INTERNAL_JOINTS)
            | bit(self.can != 0, error::INTERNAL_CAN)
            | bit(self.external_joints, error::EXTERNAL_JOINTS)
    }

    pub(crate) fn occurred(&self) -> u16 {
        self.occurred
    }

    /// Returns the words of the current and occurred errors of a joint.
    pub(crate) fn joint(&self, joint: usize) -> (u16, u16) {
        let of = |words: &[u16; JOINTS]| words.get(joint).copied().unwrap_or(0);
        (of(&self.joints) | of(&self.held), of(&self.joints_occurred))
    }

    /// Returns the current and the occurred CAN flags.
    pub(crate) fn can(&self) -> (u32, u32) {
        (self.can | self.can_shown, self.can_occurred)
    }

    /// Returns `true` if a CAN flag that counts as an error is set.
    pub(crate) fn can_error(&self) -> bool {
        self.can != 0
    }
}

/// Returns `true` if a joint has an error.
fn any(joints: &[u16; JOINTS]) -> bool {
    joints.iter().fold(0, |all, bits| all | bits) != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERNAL: u16 = error::EMERGENCY_OUTPUT | error::INTERNAL;

    /// When an error is raised, the words of current and occurred errors show it in the same tick. The word of
    /// occurred errors keeps the error until the host clears this word as well.
    #[test]
    fn j21_what_is_raised_has_occurred_until_that_is_cleared() {
        for (raise, word) in [
            (Errors::raise_emergency_input as fn(&mut Errors), error::EMERGENCY_INPUT | error::EXTERNAL),
            (Errors::raise_device, INTERNAL),
            (Errors::raise_external_joints, error::EXTERNAL_JOINTS | error::EXTERNAL),
            (|errors| errors.raise_joints(&[0, 0, 4, 0, 0, 0]), INTERNAL | error::INTERNAL_JOINTS),
            (|errors| errors.raise_can(1), INTERNAL | error::INTERNAL_CAN),
            (|errors| errors.raise_joints(&[0; JOINTS]), 0),
            (|errors| errors.raise_can(0), 0),
        ] {
            let mut errors = Errors::default();
            raise(&mut errors);
            assert_eq!((errors.word(), errors.occurred(), errors.any()), (word, word, word != 0));
            errors.clear_current();
            assert_eq!((errors.word(), errors.occurred(), errors.any()), (0, word, false));
            errors.clear_occurred();
            assert_eq!(errors.occurred(), 0);
        }
    }

    /// The cause of a held stop is shown as an occurred error, and also as a current error if the stop latches. The cause of a held stop is
    /// not an error, so the safety output stays 1.
    #[test]
    fn j66_j69_the_cause_of_a_held_stop_is_shown_and_is_no_error() {
        for latches in [false, true] {
            let mut errors = Errors::default();
            errors.hold_joints(&[0, 2, 0, 0, 0, 0], latches);
            let word = if latches { error::INTERNAL_JOINTS } else { 0 };
            assert_eq!((errors.word(), errors.occurred()), (word, error::INTERNAL | error::INTERNAL_JOINTS));
            assert_eq!((errors.joint(0), errors.joint(1)), ((0, 0), (if latches { 2 } else { 0 }, 2)));
            assert_eq!((errors.held_stop(), errors.any(), errors.internal()), (latches, false, false));
            let mut released = errors;
            released.end_held_stop();
            errors.clear_current();
            for errors in [errors, released] {
                assert_eq!((errors.held_stop(), errors.word(), errors.joint(1)), (false, 0, (0, 2)));
            }
        }
    }
}
