//! Set values of the last ticks. A measurement is compared with the set value of the same time (J-62).
//!
//! A measurement is delayed: the drive read its encoder before it received the Move that it answered, and the command that follows from the
//! measurement acts even later. The *due* position is the position that was commanded this *delay* ([`Config::delay_ticks`](crate::Config))
//! ago; a joint that follows exactly would measure it now. The difference between the measured and the due position is therefore an error
//! of the joint. This difference does not contain the distance that the joint has moved meanwhile.
use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::interpolation::SetPoint;
use crate::{DT, JOINTS};

/// Number of stored set values: a power of two, so that an index needs no comparison.
const SLOTS: usize = 8;

/// The last set values, in a ring.
#[derive(Clone, Debug, Default)]
pub(crate) struct Commanded {
    /// Positions, rad.
    position: [[f64; JOINTS]; SLOTS],
    /// Velocities, rad/s.
    velocity: [[f64; JOINTS]; SLOTS],
    /// Slot of the present tick. The number wraps around.
    now: u8,
}

bit_codec!(Commanded { position, velocity, now });

impl Commanded {
    /// Age of the oldest stored set values, ticks.
    pub(crate) const OLDEST: u8 = SLOTS as u8 - 1;

    /// Begins the next tick.
    pub(crate) fn next_tick(&mut self) {
        self.now = self.now.wrapping_add(1);
    }

    /// Stores the set values of the present tick. Call this each time that the tick changes them.
    pub(crate) fn put(&mut self, point: &SetPoint) {
        let now = self.slot(0);
        (self.position[now], self.velocity[now]) = (point.position, point.velocity);
    }

    /// Returns the positions (rad) that were commanded `ticks` ago, at most [`Self::OLDEST`].
    pub(crate) fn position(&self, ticks: u8) -> &[f64; JOINTS] {
        &self.position[self.slot(ticks)]
    }

    /// Returns the velocities (rad/s) that were commanded `ticks` ago.
    pub(crate) fn velocity(&self, ticks: u8) -> &[f64; JOINTS] {
        &self.velocity[self.slot(ticks)]
    }

    /// Returns the velocities (rad/s) that are due in the measurement of this tick. The set values of this tick are not known yet, so the
    /// newest ones are those of the last tick.
    pub(crate) fn due_velocity(&self, config: &Config) -> &[f64; JOINTS] {
        self.velocity(config.delay_ticks.max(1))
    }

    /// Restarts a joint as if it had always been commanded to move at `velocity` (rad/s), and to be at `position` (rad) `ticks` ago. For a
    /// delay of `ticks`, a measurement of that position is then due, and so are the measurements of the ticks that follow.
    pub(crate) fn begin(&mut self, joint: usize, position: f64, velocity: f64, ticks: u8) {
        for ago in 0..SLOTS as u8 {
            let slot = self.slot(ago);
            let (positions, velocities) = (&mut self.position[slot], &mut self.velocity[slot]);
            if let (Some(p), Some(v)) = (positions.get_mut(joint), velocities.get_mut(joint)) {
                (*p, *v) = (position + velocity * DT * (f64::from(ticks) - f64::from(ago)), velocity);
            }
        }
    }

    /// Restarts all joints at rest.
    pub(crate) fn rest(&mut self, position: &[f64; JOINTS]) {
        (self.position, self.velocity) = ([*position; SLOTS], [[0.0; JOINTS]; SLOTS]);
    }

    /// Shifts all stored set positions of a joint that has sagged by `way` (rad). A sag is not a motion, so the older positions change as
    /// well.
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
        /// Set values of earlier ticks can be read again, wherever the ring starts, and even if a tick stores its values twice.
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

        /// The measured position of a joint is due now. If the joint keeps its velocity, its position is also due in the ticks that follow.
        /// Other joints do not change.
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

    /// A sag shifts all stored positions, like the position errors that the PID controller stores.
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
