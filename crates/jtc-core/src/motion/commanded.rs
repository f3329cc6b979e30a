//! Set values of the last ticks, so that a measurement is compared with the one of its own time (J-62).
//!
//! A measurement is late: the drive had read its encoder before it received the Move that it answered, and what the controller
//! commands in answer to that acts later still. By this *delay* ([`Config::delay_ticks`](crate::Config)) the position that was
//! commanded is looked up that a joint which follows exactly would measure now: the *due* one. What is left between the two is an
//! error of the joint, and not the way that it has gone since.
use crate::config::Config;
use crate::interpolation::SetPoint;
use crate::remembered::remembered;
use crate::{DT, JOINTS};

/// Set values that are kept: a power of two, so that an index needs no comparison.
const SLOTS: usize = 8;

/// The last set values, in a ring.
#[derive(Clone, Debug, Default)]
pub(crate) struct Commanded {
    /// rad.
    position: [[f64; JOINTS]; SLOTS],
    /// rad/s.
    velocity: [[f64; JOINTS]; SLOTS],
    /// Slot of the present tick; it wraps around.
    now: u8,
}

remembered!(Commanded { position, velocity, now });

impl Commanded {
    /// The oldest set values that are kept, ticks ago.
    pub const OLDEST: u8 = SLOTS as u8 - 1;

    /// The next tick begins.
    pub fn next_tick(&mut self) {
        self.now = self.now.wrapping_add(1);
    }

    /// The set values of the present tick, as often as it changes them.
    pub fn put(&mut self, point: &SetPoint) {
        let now = self.slot(0);
        (self.position[now], self.velocity[now]) = (point.position, point.velocity);
    }

    /// Positions (rad) that were commanded so many ticks ago: as many as there are slots, less one, at most.
    pub fn position(&self, ticks: u8) -> &[f64; JOINTS] {
        &self.position[self.slot(ticks)]
    }

    /// Velocities (rad/s) alike.
    pub fn velocity(&self, ticks: u8) -> &[f64; JOINTS] {
        &self.velocity[self.slot(ticks)]
    }

    /// Velocities (rad/s) that are due in the measurement of this tick, before its set values are known: those of the last one at the
    /// latest.
    pub fn due_velocity(&self, config: &Config) -> &[f64; JOINTS] {
        self.velocity(config.delay_ticks.max(1))
    }

    /// A joint begins anew: as if it had been commanded to move at `velocity` (rad/s) for ever, so as to be at `position` (rad) so
    /// many ticks ago. What is measured there is where it is due then, whatever the delay, and in the ticks that follow.
    pub fn begin(&mut self, joint: usize, position: f64, velocity: f64, ticks: u8) {
        for ago in 0..SLOTS as u8 {
            let slot = self.slot(ago);
            let (positions, velocities) = (&mut self.position[slot], &mut self.velocity[slot]);
            if let (Some(p), Some(v)) = (positions.get_mut(joint), velocities.get_mut(joint)) {
                (*p, *v) = (position + velocity * DT * (f64::from(ticks) - f64::from(ago)), velocity);
            }
        }
    }

    /// All joints begin anew, at rest.
    pub fn rest(&mut self, position: &[f64; JOINTS]) {
        (self.position, self.velocity) = ([*position; SLOTS], [[0.0; JOINTS]; SLOTS]);
    }

    /// The set positions of a joint have sagged by `way` (rad): that is no motion, they have always been there.
    pub fn shift(&mut self, joint: usize, way: f64) {
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
        /// Those of so many ticks ago are found again, wherever the ring begins, also where a tick puts them twice.
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

        /// Where a joint is measured it is due, now and, if it goes on as it does, in the ticks that follow; other joints are as they were.
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

    /// What sags has been there all the time, as in the errors that the PID controller remembers.
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
