//! Set values (commanded positions and velocities) of the last ticks. A measurement is compared with the set value of the same time (J-62).
//!
//! A measurement has a delay: the drive has read its encoder before it received the Move frame that it answered. The torque that the
//! controller computes from this measurement takes effect even later. The *due* position is the set position of the tick that is one
//! *delay* ([`Config::delay_ticks`](crate::Config)) ago. If a joint follows its set positions exactly, its measured position is equal to
//! the due position. The difference between the measured and the due position is therefore an error of the joint. The error of the joint
//! does not include the distance that the joint has moved during the delay.
use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::interpolation::SetPoint;
use crate::{DT, JOINTS};

/// Number of stored set values, which is a power of two so that an index needs no comparison.
const SLOTS: usize = 8;

/// Ring buffer of the last set values.
#[derive(Clone, Debug, Default)]
pub(crate) struct Commanded {
    /// Set positions of all joints in the last ticks, rad.
    position: [[f64; JOINTS]; SLOTS],
    /// Set velocities of all joints in the last ticks, rad/s.
    velocity: [[f64; JOINTS]; SLOTS],
    /// Slot of the present tick. The slot number is counted modulo 256.
    now: u8,
}

bit_codec!(Commanded { position, velocity, now });

impl Commanded {
    /// Age of the oldest stored set values, ticks.
    pub(crate) const OLDEST: u8 = SLOTS as u8 - 1;

    /// Begins the next tick, which has its own slot in the ring buffer.
    pub(crate) fn next_tick(&mut self) {
        self.now = self.now.wrapping_add(1);
    }

    /// Stores the set values of the present tick. Call this function again each time that the set values change
    /// within the tick.
    pub(crate) fn put(&mut self, point: &SetPoint) {
        let now = self.slot(0);
        (self.position[now], self.velocity[now]) = (point.position, point.velocity);
    }

    /// Returns the set positions (rad) of the tick that is `ticks` ago, at most [`Self::OLDEST`].
    pub(crate) fn position(&self, ticks: u8) -> &[f64; JOINTS] {
        &self.position[self.slot(ticks)]
    }

    /// Returns the set velocities (rad/s) of the tick that is `ticks` ago.
    pub(crate) fn velocity(&self, ticks: u8) -> &[f64; JOINTS] {
        &self.velocity[self.slot(ticks)]
    }

    /// Returns the set velocities (rad/s) that belong to the measurement of this tick. The set values of this tick are not known yet, so
    /// the function returns set values of the last tick or of an earlier tick.
    pub(crate) fn due_velocity(&self, config: &Config) -> &[f64; JOINTS] {
        self.velocity(config.delay_ticks.max(1))
    }

    /// Fills the stored set values of a joint as if it had moved at a constant `velocity` (rad/s) and had been at
    /// `position` (rad) `ticks` ago. If the configured delay is `ticks`, the due position of the joint is then
    /// `position`, and it changes at `velocity` in the next ticks.
    pub(crate) fn begin(&mut self, joint: usize, position: f64, velocity: f64, ticks: u8) {
        let (way, mut after) = (velocity * DT, f64::from(ticks));
        for ago in 0..SLOTS as u8 {
            let slot = self.slot(ago);
            let (positions, velocities) = (&mut self.position[slot], &mut self.velocity[slot]);
            if let (Some(p), Some(v)) = (positions.get_mut(joint), velocities.get_mut(joint)) {
                (*p, *v) = (position + way * after, velocity);
            }
            after -= 1.0;
        }
    }

    /// Replaces all stored set values by joints at rest at `position` (rad).
    pub(crate) fn rest(&mut self, position: &[f64; JOINTS]) {
        (self.position, self.velocity) = ([*position; SLOTS], [[0.0; JOINTS]; SLOTS]);
    }

    /// Shifts all stored set positions of a joint by `way` (rad), after the joint has sagged by this distance. A sag is not a motion, so
    /// the function also shifts the older set positions.
    pub(crate) fn shift(&mut self, joint: usize, way: f64) {
        for positions in &mut self.position {
            if let Some(position) = positions.get_mut(joint) {
                *position += way;
            }
        }
    }

    fn slot(&self, ago: u8) -> usize {
        usize::from(self.now.wrapping_sub(ago)) % SLOTS
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::settings;

    #[test]
    fn j62_as_many_set_values_are_kept_as_the_setting_may_ask_for() {
        let delay = settings::named("delay_ticks").expect("a setting");
        assert_eq!((delay.low, delay.high), (0.0, SLOTS as f64 - 1.0));
    }

    proptest! {
        /// The set values of earlier ticks can be read at any position of the ring buffer, even if a tick stores its
        /// values twice.
        #[test]
        fn j62_the_last_set_values_are_kept(start in any::<u8>(), values in prop::collection::vec(-3.0..3.0f64, 8..300)) {
            let mut commanded = Commanded { now: start, ..Commanded::default() };
            for (k, value) in values.iter().enumerate() {
                commanded.next_tick();
                for value in [-value, *value] {
                    commanded.put(&SetPoint { velocity: [2.0 * value; JOINTS], ..SetPoint::still([value; JOINTS]) });
                }
                for ago in 0..SLOTS.min(k + 1) {
                    prop_assert_eq!(commanded.position(ago as u8), &[values[k - ago]; JOINTS]);
                    prop_assert_eq!(commanded.velocity(ago as u8), &[2.0 * values[k - ago]; JOINTS]);
                }
            }
        }

        /// The stored set values of a joint are replaced. Its measured position is then equal to the due position,
        /// and stays equal in the next ticks if the joint keeps its velocity. The stored set values of the other
        /// joints do not change.
        #[test]
        fn j44_j62_a_joint_that_begins_anew_has_no_error(
            start in any::<u8>(),
            joint in 0..JOINTS,
            position in -3.0..3.0f64,
            velocity in -1.5..1.5f64,
            delay in 0..SLOTS as u8,
        ) {
            let mut commanded = Commanded { now: start, ..Commanded::default() };
            commanded.rest(&[7.0; JOINTS]);
            commanded.begin(joint, position, velocity, delay);
            prop_assert_eq!(commanded.position(delay)[joint], position);
            let ahead = position + velocity * DT * f64::from(delay);
            prop_assert!((commanded.position(0)[joint] - ahead).abs() < 1e-12);
            for k in 1..=delay {
                commanded.next_tick();
                let measured = position + velocity * DT * f64::from(k);
                prop_assert!((commanded.position(delay)[joint] - measured).abs() < 1e-12);
                prop_assert_eq!(commanded.velocity(delay)[joint], velocity);
                for other in (0..JOINTS).filter(|other| *other != joint) {
                    prop_assert_eq!(commanded.position(delay)[other], 7.0);
                }
                commanded.put(&SetPoint::still([7.0; JOINTS]));
            }
        }
    }

    /// When the set position of a joint sags, all its stored set positions shift by the distance of the sag. The
    /// stored position errors of its PID controller shift by the same distance.
    #[test]
    fn j43_j62_a_sag_is_no_motion() {
        let mut commanded = Commanded::default();
        for k in 0..SLOTS {
            commanded.next_tick();
            commanded.put(&SetPoint::still([k as f64; JOINTS]));
        }
        commanded.shift(2, 0.25);
        for ago in 0..SLOTS as u8 {
            let kept = 7.0 - f64::from(ago);
            let sagged = core::array::from_fn(|j| if j == 2 { kept + 0.25 } else { kept });
            assert_eq!(commanded.position(ago), &sagged);
        }
    }
}
