//! Slows down path time while a motion overloads a joint (J-75).
//!
//! If the arm is heavier or has more friction than its model, a path at the torque limits needs more torque than is
//! available. A slower motion along the same path needs less torque, because the torque for inertia falls with the
//! square of the rate. Therefore the controller slows down path time as much as the overloaded joints require (time
//! scaling under torque limits, Dahl and Nielsen 1990). Path time returns to its normal rate after all joints have
//! left their torque limits.
use crate::JOINTS;
use crate::bit_codec::bit_codec;
use crate::trajectory::path::PathClock;

/// Time for which the controller uses the same computed inertia of the arm, ms.
const INERTIA_MS: u16 = 60;
/// Time from the moment when the last joint leaves its torque limit until the path returns to its normal rate, ms.
const QUIET_MS: u16 = 200;
/// Longest uninterrupted time in which joints may be at their torque limits, ms.
const PRESSED_MS: u16 = 250;
/// Longest total time for which the path may be slowed down during one run of the path, ms.
const RUN_MS: u16 = 5_000;
/// Rate of path time below which the arm counts as standing on the path. `STANDS_MS` is the longest time at such a
/// rate, ms. Then the controller stops the arm. Without this limit, an arm with just enough torque to hold itself
/// could stay at rest on the path without end.
const STANDS: f64 = 0.02;
const STANDS_MS: u16 = 1_000;

/// State of the function that slows down the path.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct HoldBack {
    active: bool,
    /// `true` while path time returns to its normal rate. `stands_ms` is the time for which the arm has stood on the
    /// path, ms.
    restores: bool,
    stands_ms: u16,
    /// Number of ticks since the inertia was computed.
    since_ms: u16,
    /// Consecutive ticks in which any joint has been at its torque limit.
    pressed_ms: u16,
    /// Number of ticks since any joint was at its torque limit.
    quiet_ms: u16,
    /// Number of ticks of this run of the path in which the path was held back.
    run_ms: u16,
    /// Mask of the joints that were at their torque limits since the controller last began to slow down the path.
    pressed: u8,
}

bit_codec!(HoldBack { active, restores, stands_ms, since_ms, pressed_ms, quiet_ms, run_ms, pressed });

/// Result of one tick of `step`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HoldBackStep {
    /// The path continues as before.
    Nothing,
    /// Path time returns to its normal rate.
    Restore,
    /// The arm stops, because a joint was at its torque limit for too long, or because the motion was slowed down or stood still for too
    /// long.
    Stop,
}

impl HoldBack {
    /// Returns `true` if the path is held back.
    pub(crate) fn is_active(&self) -> bool {
        self.active
    }

    /// Returns `true` if the controller must call `step` in each tick.
    pub(crate) fn is_watched(&self) -> bool {
        self.active | self.restores
    }

    /// Begins to slow down the path because a joint is overloaded. Returns `true` if the controller must compute the inertia of the arm.
    pub(crate) fn begin(&mut self) -> bool {
        if self.active && self.since_ms < INERTIA_MS {
            return false;
        }
        if !self.active {
            (self.pressed_ms, self.quiet_ms, self.pressed) = (0, 0, 0);
        }
        (self.active, self.restores, self.since_ms) = (true, false, 0);
        true
    }

    /// Ends the slow motion, because the arm stops or an approach has ended. The time of the slow motion is kept,
    /// because the total time in a run of the path is limited.
    pub(crate) fn end(&mut self) {
        (self.active, self.restores, self.stands_ms) = (false, false, 0);
    }

    /// Returns the time for which the path was held back in this run of the path, ms.
    pub(crate) fn run_ms(&self) -> u16 {
        self.run_ms
    }

    /// Returns `true` if the joint was at its torque limit since the controller last began to slow down the path.
    pub(crate) fn has_pressed(&self, joint: usize) -> bool {
        self.pressed & (1 << joint) != 0
    }

    /// Runs one tick on the path. `joints` is `true` for each joint at its torque limit. `clock` is the clock of the motion.
    pub(crate) fn step(&mut self, joints: &[bool; JOINTS], clock: &PathClock) -> HoldBackStep {
        for (j, at_limit) in joints.iter().enumerate() {
            self.pressed |= u8::from(*at_limit) << j;
        }
        let stands = clock.rate < STANDS && clock.ramping();
        self.stands_ms = if stands { self.stands_ms.saturating_add(1) } else { 0 };
        if self.stands_ms > STANDS_MS {
            return HoldBackStep::Stop;
        }
        if !self.active {
            self.restores &= clock.ramping();
            return HoldBackStep::Nothing;
        }
        let pressed = joints.contains(&true);
        self.since_ms = self.since_ms.saturating_add(1);
        self.run_ms = self.run_ms.saturating_add(1);
        if pressed {
            (self.pressed_ms, self.quiet_ms) = (self.pressed_ms.saturating_add(1), 0);
        } else {
            (self.pressed_ms, self.quiet_ms) = (0, self.quiet_ms.saturating_add(1));
        }
        if self.pressed_ms > PRESSED_MS || self.run_ms > RUN_MS {
            HoldBackStep::Stop
        } else if self.quiet_ms >= QUIET_MS {
            (self.active, self.restores) = (false, true);
            HoldBackStep::Restore
        } else {
            HoldBackStep::Nothing
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRESSED: [bool; JOINTS] = [false, false, true, false, false, false];

    /// Returns a clock with this rate, which is on a ramp to its normal rate of 1.
    fn at(rate: f64) -> PathClock {
        let mut clock = PathClock::start(1.0);
        clock.rate = rate;
        clock
    }

    fn going() -> PathClock {
        at(0.5)
    }

    #[test]
    fn j75_the_inertia_is_computed_anew_from_time_to_time() {
        let mut hold_back = HoldBack::default();
        assert!(hold_back.begin());
        for ms in 1..=2 * INERTIA_MS {
            hold_back.step(&PRESSED, &going());
            assert_eq!(hold_back.begin(), ms % INERTIA_MS == 0, "{ms} ms");
        }
    }

    #[test]
    fn j75_the_pace_comes_back_when_no_joint_is_at_its_limit_any_more() {
        let mut hold_back = HoldBack::default();
        hold_back.begin();
        for pressed in [true, false, true] {
            assert_eq!(
                hold_back.step(&[false, false, pressed, false, false, false], &going()),
                HoldBackStep::Nothing
            );
        }
        (1..QUIET_MS)
            .for_each(|_| assert_eq!(hold_back.step(&[false; JOINTS], &going()), HoldBackStep::Nothing));
        assert_eq!(hold_back.step(&[false; JOINTS], &going()), HoldBackStep::Restore);
        assert!(!hold_back.is_active());
    }

    #[test]
    fn j75_what_lasts_too_long_in_one_go_or_in_a_run_is_a_stop() {
        let mut hold_back = HoldBack::default();
        hold_back.begin();
        let after = (1..1_000).find(|_| hold_back.step(&PRESSED, &going()) == HoldBackStep::Stop);
        assert_eq!(after, Some(251));
        let mut hold_back = HoldBack::default();
        let mut ms = 0;
        let next = loop {
            hold_back.begin();
            ms += 1;
            match hold_back.step(&[ms % 100 < 50; JOINTS], &going()) {
                HoldBackStep::Nothing => {}
                next => break next,
            }
        };
        assert_eq!((next, ms), (HoldBackStep::Stop, 5_001));
    }

    #[test]
    fn j75_a_path_that_stands_on_the_way_back_to_its_pace_is_a_stop() {
        for (rate, stops) in [(0.0, true), (0.03, false)] {
            let mut hold_back = HoldBack::default();
            hold_back.begin();
            let next = (0..5_000).find(|_| hold_back.step(&[false; JOINTS], &at(rate)) == HoldBackStep::Stop);
            assert_eq!(next, stops.then_some(1_000), "{rate}");
        }
        let mut hold_back = HoldBack::default();
        hold_back.begin();
        (0..QUIET_MS)
            .for_each(|_| assert_ne!(hold_back.step(&[false; JOINTS], &going()), HoldBackStep::Stop));
        assert!(hold_back.is_watched());
        hold_back.step(&[false; JOINTS], &PathClock::start(1.0));
        assert!(!hold_back.is_watched(), "it has its pace again");
    }

    /// Returns the state of the joints if only this joint is at its torque limit.
    fn only(joint: usize) -> [bool; JOINTS] {
        core::array::from_fn(|j| j == joint)
    }

    /// Executes the ticks with the same inputs. Returns the first result that is not `Nothing`, with the number of its tick.
    fn first(
        hold_back: &mut HoldBack,
        ticks: u16,
        joints: &[bool; JOINTS],
        clock: &PathClock,
    ) -> Option<(u16, HoldBackStep)> {
        (1..=ticks)
            .map(|ms| (ms, hold_back.step(joints, clock)))
            .find(|(_, next)| *next != HoldBackStep::Nothing)
    }

    /// The cause of a held stop names each joint that was at its limit.
    #[test]
    fn j75_each_joint_that_was_at_its_limit_is_known() {
        for joint in 0..JOINTS {
            let mut hold_back = HoldBack::default();
            hold_back.begin();
            hold_back.step(&only(joint), &going());
            hold_back.step(&[false; JOINTS], &going());
            for other in 0..JOINTS {
                assert_eq!(hold_back.has_pressed(other), other == joint, "joint {other} of joint {joint}");
            }
            let next = (joint + 1) % JOINTS;
            hold_back.step(&only(next), &going());
            for other in 0..JOINTS {
                assert_eq!(hold_back.has_pressed(other), other == joint || other == next, "joint {other}");
            }
        }
    }

    /// If another overload occurs while the path is held back, the record of the joints and times at the torque
    /// limits is kept.
    #[test]
    fn j75_a_further_overload_keeps_the_record_of_the_joints() {
        let mut hold_back = HoldBack::default();
        hold_back.begin();
        hold_back.step(&only(4), &going());
        for _ in 0..INERTIA_MS {
            hold_back.step(&only(1), &going());
        }
        assert!(hold_back.begin() && hold_back.has_pressed(4) && hold_back.has_pressed(1));
        let mut hold_back = HoldBack::default();
        let after = (1..1_000).find(|_| {
            hold_back.begin();
            hold_back.step(&PRESSED, &going()) == HoldBackStep::Stop
        });
        assert_eq!(after, Some(251), "the limit is 250 ms without interruption");
    }

    /// The path is held back a second time, after the first time has ended. The record of the joints and times at the
    /// torque limits then begins empty.
    #[test]
    fn j75_holding_back_begins_without_the_joints_and_times_of_the_earlier_overload() {
        let mut hold_back = HoldBack::default();
        hold_back.begin();
        assert_eq!(first(&mut hold_back, 250, &PRESSED, &going()), None);
        hold_back.end();
        hold_back.begin();
        assert!((0..JOINTS).all(|joint| !hold_back.has_pressed(joint)));
        assert_eq!(first(&mut hold_back, 1_000, &PRESSED, &going()), Some((251, HoldBackStep::Stop)));
        let mut hold_back = HoldBack::default();
        hold_back.begin();
        assert_eq!(first(&mut hold_back, 199, &[false; JOINTS], &going()), None);
        hold_back.end();
        hold_back.begin();
        assert_eq!(
            first(&mut hold_back, 1_000, &[false; JOINTS], &going()),
            Some((200, HoldBackStep::Restore))
        );
    }

    /// After `end`, the path is not held back, and `step` need not be called. The time of standing begins at zero
    /// again. The time in which the path was held back during this run is kept.
    #[test]
    fn j75_the_end_of_holding_back_keeps_only_the_time_of_the_run() {
        let mut hold_back = HoldBack::default();
        hold_back.begin();
        for ms in 1..=3 {
            hold_back.step(&PRESSED, &going());
            assert_eq!(hold_back.run_ms(), ms);
        }
        hold_back.end();
        assert!(!hold_back.is_active() && !hold_back.is_watched());
        assert_eq!(hold_back.run_ms(), 3);
        hold_back.begin();
        hold_back.step(&PRESSED, &going());
        assert_eq!(hold_back.run_ms(), 4);
        // After the path was held back, `step` must still be called until path time has returned to its normal rate.
        let mut hold_back = HoldBack::default();
        hold_back.begin();
        first(&mut hold_back, 200, &[false; JOINTS], &going());
        assert!(!hold_back.is_active() && hold_back.is_watched());
        hold_back.end();
        assert!(!hold_back.is_watched());
        // The arm is allowed to be at rest on the path (rate below 0.02) for 1,000 ms, and after a call of `end` for
        // another 1,000 ms.
        let mut hold_back = HoldBack::default();
        for _ in 0..2 {
            hold_back.begin();
            for _ in 0..1_000 {
                assert_ne!(hold_back.step(&[false; JOINTS], &at(0.0)), HoldBackStep::Stop);
            }
            hold_back.end();
        }
    }

    /// A rate of exactly 0.02 does not count as standing. A lower rate does not count as standing either if it is the
    /// target rate of the clock.
    #[test]
    fn j75_a_path_at_a_rate_of_a_fiftieth_or_at_its_normal_rate_is_not_at_rest() {
        for clock in [at(0.02), PathClock::start(0.0)] {
            let mut hold_back = HoldBack::default();
            hold_back.begin();
            assert!((0..2_000).all(|_| hold_back.step(&[false; JOINTS], &clock) != HoldBackStep::Stop));
        }
    }
}
