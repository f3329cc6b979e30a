//! Jogging: commanded joint velocities, the only motion without a trajectory (J-58). Each joint follows its velocity along ramps of
//! bounded acceleration and jerk, and slows down before the end of its range by itself. Without a new command all come to rest.
use jtc_dynamics::sqrt;

use crate::config::Config;
use crate::limits::JointConfig;
use crate::remembered::remembered;
use crate::{DT, JOINTS};

/// Ticks without a new command after which the joints come to rest.
const LASTS_MS: u16 = 200;
/// Highest acceleration, as a share of the joint's limit.
const ACCELERATION: f64 = 0.2;
/// Time in which the acceleration gets there, s.
const RISE_S: f64 = 0.1;

/// One joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct JointJog {
    /// Commanded velocity, rad/s.
    wanted: f64,
    /// Of the set values, rad/s and rad/s².
    velocity: f64,
    acceleration: f64,
}

/// All joints, from the first command until they rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Jog {
    joints: [JointJog; JOINTS],
    /// Ticks since the last command.
    silent_ms: u16,
}

remembered!(JointJog { wanted, velocity, acceleration });
remembered!(Jog { joints, silent_ms });

impl Jog {
    /// New velocities, rad/s.
    pub fn command(&mut self, wanted: &[f64; JOINTS]) {
        self.silent_ms = 0;
        for (joint, wanted) in self.joints.iter_mut().zip(wanted) {
            joint.wanted = *wanted;
        }
    }

    /// The joints come to rest.
    pub fn end(&mut self) {
        self.command(&[0.0; JOINTS]);
    }

    /// Every joint rests, and is to.
    pub fn rests(&self) -> bool {
        let rests =
            |joint: &JointJog| joint.wanted == 0.0 && joint.velocity == 0.0 && joint.acceleration == 0.0;
        self.joints.iter().all(rests)
    }

    /// A tick: moves `position` (rad) on; returns velocities (rad/s) and accelerations (rad/s²).
    pub fn step(&mut self, position: &mut [f64; JOINTS], config: &Config) -> ([f64; JOINTS], [f64; JOINTS]) {
        self.silent_ms = self.silent_ms.saturating_add(1);
        if self.silent_ms > LASTS_MS {
            self.joints.iter_mut().for_each(|joint| joint.wanted = 0.0);
        }
        let joints = self.joints.iter_mut().zip(position.iter_mut()).zip(&config.joints);
        for (j, ((joint, position), limits)) in joints.enumerate() {
            joint.step(position, config.position_range(j), limits);
        }
        (self.joints.map(|joint| joint.velocity), self.joints.map(|joint| joint.acceleration))
    }
}

impl JointJog {
    fn step(&mut self, position: &mut f64, (low, high): (f64, f64), limits: &JointConfig) {
        let most = ACCELERATION * limits.acceleration_max;
        let wanted = self.wanted.max(-limits.velocity_max).min(limits.velocity_max);
        // As wanted, as long as the joint could still stop inside its range from there.
        let onward = self.toward(wanted, most, limits.velocity_max);
        let way = self.way(&onward) + onward.stopping_way(most);
        let room = if way < 0.0 { low - *position } else { high - *position };
        let onward_fits = way.abs() < room.abs() && way * room >= 0.0;
        let next = if onward_fits { onward } else { self.toward(0.0, most, limits.velocity_max) };
        // Never out of the range; from outside only back into it.
        let reached = *position + self.way(&next);
        let within = reached.max(low.min(*position)).min(high.max(*position));
        *self = if within == reached { next } else { Self { velocity: 0.0, acceleration: 0.0, ..next } };
        *position = within;
    }

    /// What it moves until it is in the state `next` of the next tick, rad.
    fn way(&self, next: &Self) -> f64 {
        0.5 * (self.velocity + next.velocity) * DT
    }

    /// A tick later, on the way to a velocity (rad/s), with at most `most` of acceleration (rad/s²), and never faster than
    /// `fastest` (rad/s).
    fn toward(&self, target: f64, most: f64, fastest: f64) -> Self {
        let round = most / RISE_S * DT;
        let left = target - self.velocity;
        // The acceleration from which the rest of the way to that velocity just suffices to take it back.
        let flat = round * (sqrt(0.25 + 2.0 * left.abs() / (round * DT)) - 0.5);
        let next =
            flat.min(most).copysign(left).max(self.acceleration - round).min(self.acceleration + round);
        let arrives = next.abs() <= 1.5 * round && left.abs() <= (1.5 * round * DT).max(next.abs() * DT);
        if arrives {
            Self { velocity: target, acceleration: 0.0, ..*self }
        } else {
            // A joint that accelerates when its jog ends gets faster until its acceleration is back at zero. It arrives at the
            // velocity that was commanded before; whole ticks can add a few µrad/s, which the limit does not allow.
            let reached = self.velocity + next * DT;
            let velocity = reached.max(-fastest).min(fastest);
            let acceleration = if velocity == reached { next } else { (velocity - self.velocity) / DT };
            Self { velocity, acceleration, ..*self }
        }
    }

    /// The way until it stands, rad, when it stops at once: the acceleration falls to `-most` as steadily as it may, stays there, and
    /// rises to zero as steadily. A little more, for what the ticks make of it.
    fn stopping_way(&self, most: f64) -> f64 {
        let jerk = most / RISE_S;
        let sign = if self.velocity == 0.0 { self.acceleration } else { self.velocity };
        let (v, a) = if sign < 0.0 {
            (-self.velocity, -self.acceleration)
        } else {
            (self.velocity, self.acceleration)
        };
        // From where its acceleration is zero: still to come while it gets faster, behind it while it brakes.
        let (peak, past) = (v + 0.5 * a * a / jerk, a * v / jerk + a * a * a / (3.0 * jerk * jerk));
        let rest = if peak >= most * RISE_S {
            0.5 * peak * (peak / most + RISE_S)
        } else {
            peak * sqrt(peak / jerk)
        };
        (1.01 * (rest + past).max(0.0) + 4.0 * v * DT + 1e-6).copysign(sign)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::check_set;
    use proptest::prelude::*;

    fn config() -> Config {
        Config::avena()
    }

    proptest! {
        /// Whatever is commanded and when: within the range, the velocity and acceleration limits and the jerk, and at rest soon
        /// after the last command.
        #[test]
        fn j58_a_jog_keeps_to_every_limit_and_ends_by_itself(
            start in prop::array::uniform6(-1.0..1.0f64),
            commands in prop::collection::vec((prop::array::uniform6(-1.0..1.0f64), 1u32..400), 1..20),
        ) {
            let config = config();
            let (mut jog, mut position) = (Jog::default(), [0.0; JOINTS]);
            for j in 0..JOINTS {
                let (low, high) = config.position_range(j);
                position[j] = 0.5 * (low + high) + 0.5 * start[j] * (high - low);
            }
            let mut last = ([0.0; JOINTS], [0.0; JOINTS]);
            let mut check = |jog: &mut Jog| {
                let before = position;
                let (v, a) = jog.step(&mut position, &config);
                for j in 0..JOINTS {
                    let (limits, (low, high)) = (&config.joints[j], config.position_range(j));
                    let most = ACCELERATION * limits.acceleration_max;
                    assert!((low..=high).contains(&position[j]), "joint {}: {}", j + 1, position[j]);
                    assert!(v[j].abs() <= limits.velocity_max && a[j].abs() <= most + 1e-9);
                    let at_end = position[j] == low || position[j] == high;
                    // What is left of a velocity at the very end of the range is next to nothing.
                    let step = (v[j] - last.0[j]).abs();
                    assert!(step <= most * DT + 1e-9 || (at_end && step < 0.005), "{} {}", v[j], last.0[j]);
                    assert!((a[j] - last.1[j]).abs() <= 2.0 * most / RISE_S * DT + 1e-9 || v[j] == 0.0 || a[j] == 0.0);
                    assert!((position[j] - before[j] - 0.5 * (v[j] + last.0[j]) * DT).abs() < 1e-12 || at_end);
                }
                last = (v, a);
            };
            for (share, ticks) in commands {
                jog.command(&core::array::from_fn(|j| share[j] * config.joints[j].velocity_max));
                for _ in 0..ticks {
                    check(&mut jog);
                }
            }
            for _ in 0..LASTS_MS {
                check(&mut jog);
            }
            let mut ticks = 0;
            while !jog.rests() {
                check(&mut jog);
                ticks += 1;
                assert!(ticks < 1_200, "{jog:?}");
            }
        }
    }

    /// Limits as they are imported from UR5 and Z1, in wide ranges.
    fn arms() -> [Config; 3] {
        let avena = config();
        let with = |velocity: [f64; JOINTS], acceleration: f64| {
            let mut config = config();
            for (joint, velocity_max) in config.joints.iter_mut().zip(velocity) {
                *joint = JointConfig {
                    velocity_max,
                    acceleration_max: acceleration,
                    position_min: -2.9,
                    position_max: 2.9,
                    ..*joint
                };
            }
            config
        };
        [avena, with([3.15, 3.15, 3.15, 3.2, 3.2, 3.2], 20.0), with([3.1415; JOINTS], 15.0)]
    }

    /// What ends a jog, or changes it.
    #[derive(Clone, Copy, Debug)]
    enum End {
        /// No further Jog comes.
        Silence,
        /// A Stop or a Pause.
        Stop,
        /// A Jog of another rate, as a share of the velocity limit.
        Rate(f64),
    }

    /// Ticks after the end of a jog: silence counts from [`LASTS_MS`] on, and then the acceleration takes [`RISE_S`] to get to zero.
    const AFTER: u16 = LASTS_MS + 120;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// A joint that is jogged at its velocity limit, or up to a thousandth below it, and still accelerates when that ends: the set
        /// velocity keeps to the limit, and no limit of J-43 is found, whichever tick it ends in.
        #[test]
        fn j58_the_set_velocity_never_exceeds_its_limit_whenever_a_jog_ends(
            arm in 0..3usize,
            joint in 0..JOINTS,
            below in prop_oneof![Just(0.0), 0.0..1e-3f64],
            up in any::<bool>(),
            before in prop_oneof![Just(0.0), -0.5..0.5f64],
            end in prop_oneof![
                Just(End::Silence),
                Just(End::Stop),
                Just(End::Rate(1.0)),
                Just(End::Rate(-1.0)),
                (-1.0..1.0f64).prop_map(End::Rate),
            ],
        ) {
            let config = arms()[arm].clone();
            let limits = config.joints[joint];
            let (low, high) = config.position_range(joint);
            let fastest = limits.velocity_max.copysign(if up { 1.0 } else { -1.0 });
            let at = |share: f64| {
                let mut wanted = [0.0; JOINTS];
                wanted[joint] = share * fastest;
                wanted
            };
            let step = |jog: &mut Jog, position: &mut [f64; JOINTS]| {
                let (v, a) = jog.step(position, &config);
                let inside = v[joint].abs() <= limits.velocity_max;
                let found = check_set((position[joint], v[joint], a[joint]), 0.0, &limits, true);
                if inside && found == 0 { Ok(()) } else { Err((v[joint], a[joint], found)) }
            };
            let (mut jog, mut position) = (Jog::default(), [0.0; JOINTS]);
            position[joint] = if up { 0.9 * low + 0.1 * high } else { 0.1 * low + 0.9 * high };
            jog.command(&at(before));
            for tick in 0..60 {
                prop_assert_eq!(step(&mut jog, &mut position), Ok(()), "{} ms before", 60 - tick);
            }
            for ends_ms in 1..1_300 {
                jog.command(&at(1.0 - below));
                prop_assert_eq!(step(&mut jog, &mut position), Ok(()), "{} ms", ends_ms);
                let (mut ended, mut there) = (jog, position);
                match end {
                    End::Silence => {}
                    End::Stop => ended.end(),
                    End::Rate(share) => ended.command(&at(share)),
                }
                for tick in 0..AFTER {
                    prop_assert_eq!(step(&mut ended, &mut there), Ok(()), "{} ms after {} ms", tick, ends_ms);
                }
            }
        }
    }

    #[test]
    fn j58_a_joint_gets_to_its_velocity_and_to_the_end_of_its_range() {
        let (config, mut jog, mut position) = (config(), Jog::default(), [0.0; JOINTS]);
        let wanted = [0.5, -0.25, 1.5, -1.5, 0.01, 0.0];
        for _ in 0..800 {
            jog.command(&wanted);
            jog.step(&mut position, &config);
        }
        assert_eq!(jog.joints.map(|joint| joint.velocity), wanted);
        assert_eq!(position[5], 0.0);
        for _ in 0..30_000 {
            jog.command(&[1.0, -1.0, 1.5, -0.1, 0.5, 1.5]);
            jog.step(&mut position, &config);
        }
        for (j, up) in [true, false, true, false, true, true].into_iter().enumerate() {
            let (low, high) = config.position_range(j);
            let end = if up { high } else { low };
            assert!((position[j] - end).abs() < 1e-3, "joint {}: {} of {end}", j + 1, position[j]);
        }
    }

    #[test]
    fn j58_a_joint_outside_its_range_moves_back_only() {
        let config = config();
        let (_, high) = config.position_range(0);
        for (wanted, moves) in [(0.5, false), (-0.5, true)] {
            let (mut jog, mut position) = (Jog::default(), [high + 0.1, 0.0, 0.0, 0.0, 0.0, 0.0]);
            for _ in 0..100 {
                jog.command(&[wanted, 0.0, 0.0, 0.0, 0.0, 0.0]);
                jog.step(&mut position, &config);
            }
            assert_eq!(position[0] < high + 0.1, moves);
            assert!(position[0] <= high + 0.1);
        }
    }
}
