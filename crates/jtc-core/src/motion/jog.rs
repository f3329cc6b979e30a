//! Jogging moves joints at commanded velocities and is the only motion without a trajectory (J-58). Each joint
//! reaches its velocity with bounded acceleration and jerk, and slows down automatically before the end of its range.
//!
//! A jog has its own clock. When the jog ends, the rate of this clock falls to zero, like the rate of path time. All
//! joints therefore stop as quickly as on a path (J-33).
use jtc_dynamics::sqrt;

use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::config::limits::JointConfig;
use crate::interpolation::SetPoint;
use crate::trajectory::path::PathClock;
use crate::{DT, JOINTS};

/// Time without a new Jog after which the joints come to rest, ticks.
pub(crate) const LASTS_MS: u16 = 200;
/// Highest acceleration of a jogged joint, as a share of the acceleration limit of the joint.
const ACCELERATION: f64 = 0.2;
/// Time in which a jogged joint reaches its highest acceleration, s.
const RISE_S: f64 = 0.1;

/// Returns the highest acceleration of a jogged joint, rad/s², if the torque limits allow this acceleration.
pub(crate) fn hardest(limits: &JointConfig) -> f64 {
    ACCELERATION * limits.acceleration_max
}

/// State of the jog of one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct JointJog {
    /// Velocity that the host has commanded, rad/s.
    wanted: f64,
    /// Highest acceleration of the joint, rad/s².
    most: f64,
    /// Velocity and acceleration of the set values, rad/s and rad/s².
    velocity: f64,
    acceleration: f64,
}

/// Returns the jerk limit of a jogged joint, rad/s³.
pub(crate) fn jerk(limits: &JointConfig) -> f64 {
    hardest(limits) / RISE_S
}

/// State of a jog of all joints, from the first command until all joints are at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Jog {
    joints: [JointJog; JOINTS],
    /// Number of ticks since the last Jog.
    silent_ms: u16,
    /// Clock of the jog, which slows down like path time.
    clock: PathClock,
}

bit_codec!(JointJog { wanted, most, velocity, acceleration });
bit_codec!(Jog { joints, silent_ms, clock });

impl Jog {
    /// Creates a jog that begins at rest.
    pub(crate) fn begin() -> Self {
        Self { joints: Default::default(), silent_ms: 0, clock: PathClock::start(1.0) }
    }

    /// Sets the commanded velocities, rad/s, and the highest accelerations, rad/s², of all joints. If the joints are
    /// just coming to rest, the command takes effect when all joints are at rest.
    pub(crate) fn command(
        &mut self,
        wanted: &[f64; JOINTS],
        acceleration: &[f64; JOINTS],
        position: &[f64; JOINTS],
        config: &Config,
    ) {
        self.silent_ms = 0;
        for (j, joint) in self.joints.iter_mut().enumerate() {
            joint.wanted = wanted[j];
            // If a joint could not stop within its range with the new acceleration limit, its previous acceleration limit stays valid.
            let (softer, jerk) = (JointJog { most: acceleration[j], ..*joint }, jerk(&config.joints[j]));
            let (low, high) = config.position_range(j);
            let rest = position[j] + softer.stopping_way(jerk);
            if softer.most > joint.most || (low <= rest && rest <= high) {
                *joint = softer;
            }
        }
    }

    /// Brings the jogged joints to rest.
    pub(crate) fn end(&mut self) {
        self.silent_ms = 0;
        self.joints.iter_mut().for_each(|joint| joint.wanted = 0.0);
    }

    /// Begins a tick of the jog. Returns `true` in the tick in which the joints begin to come to rest.
    pub(crate) fn ends(&mut self) -> bool {
        self.silent_ms = self.silent_ms.saturating_add(1);
        if self.silent_ms > LASTS_MS {
            self.joints.iter_mut().for_each(|joint| joint.wanted = 0.0);
        }
        let ends = !self.is_wanted() && self.clock.is_going();
        if ends {
            self.clock.halt();
        }
        ends
    }

    /// Returns `true` until the joints begin to come to rest.
    pub(crate) fn goes_on(&self) -> bool {
        self.clock.is_going()
    }

    fn is_wanted(&self) -> bool {
        self.joints.iter().any(|joint| joint.wanted != 0.0)
    }

    /// Returns `true` if every joint is at rest and no velocity is commanded.
    pub(crate) fn rests(&self) -> bool {
        let rests = |joint: &JointJog| joint.velocity == 0.0 && joint.acceleration == 0.0;
        !self.is_wanted() && (self.clock.standing() || self.joints.iter().all(rests))
    }

    /// Executes one tick of the jog, and moves the set values in `point`. While the rate of the jog's clock changes,
    /// `ramp` advances this clock.
    pub(crate) fn step(
        &mut self,
        point: &mut SetPoint,
        config: &Config,
        ramp: impl FnOnce(&SetPoint, &mut PathClock),
    ) {
        let values = |joints: &[JointJog; JOINTS]| {
            (joints.map(|joint| joint.velocity), joints.map(|joint| joint.acceleration))
        };
        if self.clock.standing() {
            // Clears the velocities that were commanded before the arm came to rest.
            for joint in &mut self.joints {
                (joint.velocity, joint.acceleration) = (0.0, 0.0);
            }
            self.clock = PathClock::start(1.0);
        }
        let (velocity, acceleration) = values(&self.joints);
        let before = self.clock.rate;
        ramp(&SetPoint { position: point.position, velocity, acceleration }, &mut self.clock);
        let (rate, slope) = (self.clock.rate, self.clock.slope);
        let (tick, goes) = (0.5 * (before + rate) * DT, self.clock.is_going());
        let joints = self.joints.iter_mut().zip(point.position.iter_mut()).zip(&config.joints);
        for (j, ((joint, position), limits)) in joints.enumerate() {
            joint.step(position, config.position_range(j), limits, tick, goes);
        }
        let (velocity, acceleration) = values(&self.joints);
        point.velocity = velocity.map(|velocity| velocity * rate);
        point.acceleration = core::array::from_fn(|j| acceleration[j] * rate * rate + velocity[j] * slope);
    }
}

impl JointJog {
    /// Executes one tick for this joint. The tick lasts `tick` seconds of the jog's clock. If `goes` is `true`, the jog continues, and the
    /// joint approaches its commanded velocity.
    fn step(
        &mut self,
        position: &mut f64,
        (low, high): (f64, f64),
        limits: &JointConfig,
        tick: f64,
        goes: bool,
    ) {
        let jerk = jerk(limits);
        let wanted = if goes { self.wanted } else { 0.0 };
        let wanted = wanted.max(-limits.velocity_max).min(limits.velocity_max);
        // If the joint can still stop inside its range after this tick, it approaches its commanded velocity in this
        // tick.
        let onward = self.toward(wanted, jerk, limits.velocity_max, tick);
        let way = self.way(&onward, tick) + onward.stopping_way(jerk);
        let room = if way < 0.0 { low - *position } else { high - *position };
        let onward_fits = way.abs() < room.abs() && way * room >= 0.0;
        let next = if onward_fits { onward } else { self.toward(0.0, jerk, limits.velocity_max, tick) };
        // The set position of the joint never leaves its range. A joint outside its range only moves back towards the range.
        let reached = *position + self.way(&next, tick);
        let within = reached.max(low.min(*position)).min(high.max(*position));
        *self = if within == reached { next } else { Self { velocity: 0.0, acceleration: 0.0, ..next } };
        *position = within;
    }

    /// Returns the distance, rad, that the joint moves in `tick` seconds while its state changes to `next`.
    fn way(&self, next: &Self, tick: f64) -> f64 {
        0.5 * (self.velocity + next.velocity) * tick
    }

    /// Returns the state after the joint has approached a velocity (rad/s) for `tick` seconds. The jerk is at most `jerk` (rad/s³), and the
    /// speed is at most `fastest` (rad/s).
    fn toward(&self, target: f64, jerk: f64, fastest: f64, tick: f64) -> Self {
        if tick <= 0.0 {
            return *self;
        }
        let round = jerk * tick;
        let left = target - self.velocity;
        // Highest acceleration at which the joint can still reach the target velocity without overshoot, because the
        // jerk limit suffices to reduce the acceleration to zero.
        let flat = round * (sqrt(0.25 + 2.0 * left.abs() / (round * tick)) - 0.5);
        let next =
            flat.min(self.most).copysign(left).max(self.acceleration - round).min(self.acceleration + round);
        let arrives = next.abs() <= 1.5 * round && left.abs() <= 1.5 * round * tick;
        if arrives {
            Self { velocity: target, acceleration: 0.0, ..*self }
        } else {
            // If a joint still accelerates when its jog ends, it becomes faster until its acceleration has fallen to
            // zero. The joint may then reach its earlier commanded velocity. Rounding to whole ticks can add a few
            // µrad/s, so the velocity is limited.
            let reached = self.velocity + next * tick;
            let velocity = reached.max(-fastest).min(fastest);
            let acceleration = if velocity == reached { next } else { (velocity - self.velocity) / tick };
            Self { velocity, acceleration, ..*self }
        }
    }

    /// Returns the stopping distance of a joint that begins to stop now, rad. The acceleration changes with this `jerk` (rad/s³) to its
    /// limit against the motion, stays at the limit, and returns to zero. The result includes a small margin for the effect of whole ticks.
    fn stopping_way(&self, jerk: f64) -> f64 {
        let sign = if self.velocity == 0.0 { self.acceleration } else { self.velocity };
        let (v, a) = if sign < 0.0 {
            (-self.velocity, -self.acceleration)
        } else {
            (self.velocity, self.acceleration)
        };
        // The stopping distance is first computed from the point at which the acceleration is zero. Then the distance
        // to or from this point is added or subtracted: an accelerating joint has not reached it yet, and a braking
        // joint has already passed it.
        let (peak, past) = (v + 0.5 * a * a / jerk, a * v / jerk + a * a * a / (3.0 * jerk * jerk));
        let rise = self.most / jerk;
        let rest = if peak >= self.most * rise {
            0.5 * peak * (peak / self.most + rise)
        } else {
            peak * sqrt(peak / jerk)
        };
        (1.01 * (rest + past).max(0.0) + 4.0 * v * DT + 1e-6).copysign(sign)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    mod joint;
    mod whole;

    use super::*;
    use crate::config::limits::check_set;
    use crate::motion::Ramp;
    use proptest::prelude::*;

    fn config() -> Config {
        Config::avena()
    }

    /// Commands velocities that the torque limits do not restrict.
    fn command(jog: &mut Jog, wanted: &[f64; JOINTS], position: &[f64; JOINTS], config: &Config) {
        let acceleration = core::array::from_fn(|j| hardest(&config.joints[j]));
        jog.command(wanted, &acceleration, position, config);
    }

    /// Executes a tick that moves `position`, for joints that follow their set positions exactly. Returns the set velocities and the set
    /// accelerations of the joints.
    fn tick(jog: &mut Jog, position: &mut [f64; JOINTS], config: &Config) -> ([f64; JOINTS], [f64; JOINTS]) {
        let mut point = SetPoint::still(*position);
        jog.ends();
        let no_torque = Default::default();
        jog.step(&mut point, config, |at, clock| Ramp::default().step(at, &no_torque, clock, config));
        *position = point.position;
        (point.velocity, point.acceleration)
    }

    proptest! {
        /// For any Jogs at any time, the joints stay within their position range and within the limits of velocity, acceleration and jerk.
        /// The joints are at rest soon after the last Jog.
        #[test]
        fn j58_a_jog_keeps_to_every_limit_and_ends_by_itself(
            start in prop::array::uniform6(-1.0..1.0f64),
            commands in prop::collection::vec(
                (
                    prop_oneof![4 => prop::array::uniform6(-1.0..1.0f64), 1 => Just([0.0; JOINTS])],
                    prop_oneof![Just(1.0), 0.02..1.0f64],
                    1u32..400,
                ),
                1..20,
            ),
        ) {
            let config = config();
            let (mut jog, mut position) = (Jog::begin(), [0.0; JOINTS]);
            for j in 0..JOINTS {
                let (low, high) = config.position_range(j);
                position[j] = 0.5 * (low + high) + 0.5 * start[j] * (high - low);
            }
            let mut last = ([0.0; JOINTS], [0.0; JOINTS]);
            let mut check = |jog: &mut Jog, position: &mut [f64; JOINTS]| {
                let (before, was_ramping) = (*position, jog.clock.ramping());
                let (v, a) = tick(jog, position, &config);
                let ramps = was_ramping || jog.clock.ramping();
                for j in 0..JOINTS {
                    let (limits, (low, high)) = (&config.joints[j], config.position_range(j));
                    // While a jog comes to rest, the joints are allowed to decelerate as fast as on a trajectory
                    // path.
                    let most = if ramps { limits.acceleration_max } else { ACCELERATION * limits.acceleration_max };
                    assert!((low..=high).contains(&position[j]), "joint {}: {}", j + 1, position[j]);
                    assert!(v[j].abs() <= limits.velocity_max && a[j].abs() <= most + 1e-9);
                    let at_end = position[j] == low || position[j] == high;
                    // A joint reaches the end of its range with a velocity of almost zero, so the jump to standstill
                    // is small.
                    let step = (v[j] - last.0[j]).abs();
                    assert!(step <= most * DT + 1e-9 || (at_end && step < 0.005), "{} {}", v[j], last.0[j]);
                    let jerk = (a[j] - last.1[j]).abs();
                    assert!(ramps || jerk <= 2.0 * most / RISE_S * DT + 1e-9 || v[j] == 0.0 || a[j] == 0.0);
                    let way = 0.5 * (v[j] + last.0[j]) * DT;
                    // While the rate of the clock changes, the check assumes a constant rate within each tick, so it
                    // needs a wider tolerance.
                    let precise = if ramps { 1e-7 } else { 1e-12 };
                    assert!((position[j] - before[j] - way).abs() < precise || at_end, "{way}");
                }
                last = (v, a);
            };
            for (share, soft, ticks) in commands {
                let wanted = core::array::from_fn(|j| share[j] * config.joints[j].velocity_max);
                let acceleration = core::array::from_fn(|j| soft * hardest(&config.joints[j]));
                jog.command(&wanted, &acceleration, &position, &config);
                for _ in 0..ticks {
                    check(&mut jog, &mut position);
                }
            }
            for _ in 0..LASTS_MS {
                check(&mut jog, &mut position);
            }
            let mut ticks = 0;
            while !jog.rests() {
                check(&mut jog, &mut position);
                ticks += 1;
                assert!(ticks <= 520, "{jog:?}");
            }
        }
    }

    /// Returns configurations with the joint limits of the imported UR5 and Z1 models, and with wide position ranges.
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

    /// Event that ends or changes a jog.
    #[derive(Clone, Copy, Debug)]
    enum End {
        /// No further Jog arrives.
        Silence,
        /// A Stop or a Pause arrives.
        Stop,
        /// A Jog with another velocity arrives, as a share of the velocity limit.
        Rate(f64),
    }

    /// Number of ticks that the test runs after the end of a jog. The controller detects missing Jogs after
    /// [`LASTS_MS`]. The acceleration then needs [`RISE_S`] to reach zero.
    const AFTER: u16 = LASTS_MS + 120;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// A joint is jogged at its velocity limit, or at most a thousandth below it, and still accelerates when the
        /// jog ends. In whichever tick the jog ends, the set velocity stays within its limit, and no limit of J-43 is
        /// violated.
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
                let (v, a) = tick(jog, position, &config);
                let inside = v[joint].abs() <= limits.velocity_max;
                let found = check_set((position[joint], v[joint], a[joint]), 0.0, &limits, true);
                if inside && found == 0 { Ok(()) } else { Err((v[joint], a[joint], found)) }
            };
            let (mut jog, mut position) = (Jog::begin(), [0.0; JOINTS]);
            position[joint] = if up { 0.9 * low + 0.1 * high } else { 0.1 * low + 0.9 * high };
            command(&mut jog, &at(before), &position, &config);
            for ms in 0..60 {
                prop_assert_eq!(step(&mut jog, &mut position), Ok(()), "{} ms before", 60 - ms);
            }
            for ends_ms in 1..1_300 {
                command(&mut jog, &at(1.0 - below), &position, &config);
                prop_assert_eq!(step(&mut jog, &mut position), Ok(()), "{} ms", ends_ms);
                let (mut ended, mut there) = (jog, position);
                match end {
                    End::Silence => {}
                    End::Stop => ended.end(),
                    End::Rate(share) => command(&mut ended, &at(share), &there, &config),
                }
                for ms in 0..AFTER {
                    prop_assert_eq!(step(&mut ended, &mut there), Ok(()), "{} ms after {} ms", ms, ends_ms);
                }
            }
        }
    }

    #[test]
    fn j58_a_joint_gets_to_its_velocity_and_to_the_end_of_its_range() {
        let (config, mut jog, mut position) = (config(), Jog::begin(), [0.0; JOINTS]);
        let wanted = [0.5, -0.25, 1.5, -1.5, 0.01, 0.0];
        for _ in 0..800 {
            command(&mut jog, &wanted, &position, &config);
            tick(&mut jog, &mut position, &config);
        }
        assert_eq!(jog.joints.map(|joint| joint.velocity), wanted);
        assert_eq!(position[5], 0.0);
        for _ in 0..30_000 {
            command(&mut jog, &[1.0, -1.0, 1.5, -0.1, 0.5, 1.5], &position, &config);
            tick(&mut jog, &mut position, &config);
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
            let (mut jog, mut position) = (Jog::begin(), [high + 0.1, 0.0, 0.0, 0.0, 0.0, 0.0]);
            for _ in 0..100 {
                command(&mut jog, &[wanted, 0.0, 0.0, 0.0, 0.0, 0.0], &position, &config);
                tick(&mut jog, &mut position, &config);
            }
            assert_eq!(position[0] < high + 0.1, moves);
            assert!(position[0] <= high + 0.1);
        }
    }

    /// Returns the number of ticks from the end of a jog until all joints are at rest, and the distance of joint 1 in this time (rad).
    fn stop(mut jog: Jog, mut position: [f64; JOINTS], config: &Config, end: End) -> (u16, f64) {
        let begin = position[0];
        match end {
            End::Silence => {}
            End::Stop => jog.end(),
            End::Rate(share) => {
                let wanted = [share * config.joints[0].velocity_max; JOINTS];
                command(&mut jog, &wanted, &position, config);
            }
        }
        let mut ticks = 0;
        while !jog.rests() && ticks < 2_000 {
            tick(&mut jog, &mut position, config);
            ticks += 1;
        }
        (ticks, (position[0] - begin).abs())
    }

    #[test]
    fn j33_j58_a_jog_stops_as_a_path_does_whatever_ends_it() {
        for config in arms() {
            let fastest = config.joints[0].velocity_max;
            for share in [0.02, 0.3, 0.7, 1.0] {
                let (mut jog, mut position) = (Jog::begin(), [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
                for _ in 0..1_500 {
                    command(&mut jog, &[share * fastest, 0.0, 0.0, 0.0, 0.0, 0.0], &position, &config);
                    tick(&mut jog, &mut position, &config);
                    position[0] = position[0].min(0.0);
                }
                // Like a motion on a path, a jog stops within the time of the ramp. Its stopping distance is about half
                // of the distance that it would travel in this time at constant speed. A fast joint takes longer,
                // because its acceleration limit applies.
                let hard = config.joints[0].acceleration_max;
                let longest = 20 + config.ramp_ms.max((1_600.0 * share * fastest / hard) as u16);
                for (end, wait) in [(End::Stop, 0), (End::Rate(0.0), 0), (End::Silence, LASTS_MS)] {
                    let (ticks, way) = stop(jog, position, &config, end);
                    assert!(ticks <= wait + longest && ticks <= wait + 520, "{end:?} {share}: {ticks} ms");
                    let most = share * fastest * 1e-3 * (f64::from(wait) + 0.55 * f64::from(longest));
                    assert!(way <= most, "{end:?} {share}: {way} rad of {most}");
                }
            }
        }
    }

    /// While the arm comes to rest after a jog, the operator presses the same jog key, the opposite key or another
    /// key. The arm comes to rest first, and meanwhile no joint becomes faster. The new jog then begins with the
    /// acceleration of a normal jog.
    #[test]
    fn j58_a_jog_that_is_commanded_on_the_way_to_rest_begins_when_the_arm_stands() {
        let then = [[1.0, 0.0], [-0.4, 0.0], [0.0, 1.0]];
        for (acceleration_max, then, ends_ms) in [12.57, 2.0, 3.0]
            .into_iter()
            .flat_map(|most| then.map(|then| (most, then)))
            .flat_map(|(most, then)| [1, 40, 100, 150, 199, 250].map(|ends_ms| (most, then, ends_ms)))
        {
            let mut config = config();
            for joint in &mut config.joints {
                (joint.acceleration_max, joint.position_min, joint.position_max) =
                    (acceleration_max, -2.9, 2.9);
            }
            let what = std::format!("{acceleration_max} rad/s², {then:?} after {ends_ms} ms");
            let (mut jog, mut position) = (Jog::begin(), [-2.5, 0.0, 0.0, 0.0, 0.0, 0.0]);
            let six = |[a, b]: [f64; 2]| [a, b, 0.0, 0.0, 0.0, 0.0];
            let slow = acceleration_max < 10.0;
            for _ in 0..if slow { 3_500 } else { 1_000 } {
                command(&mut jog, &six([1.0, 0.0]), &position, &config);
                tick(&mut jog, &mut position, &config);
            }
            let (mut last, mut stands) = (f64::INFINITY, false);
            for ms in 0..2_500 {
                command(&mut jog, &six(if ms < ends_ms { [0.0; 2] } else { then }), &position, &config);
                let (v, a) = tick(&mut jog, &mut position, &config);
                stands |= v == [0.0; JOINTS];
                if !stands {
                    assert!(v[0] <= last && v[1] == 0.0, "{what}: {last} {v:?} at {ms} ms");
                    last = v[0];
                } else {
                    let most = ACCELERATION * acceleration_max + 1e-9;
                    assert!(a.iter().all(|a| a.abs() <= most), "{what}: {a:?} at {ms} ms");
                }
                assert!(stands || ms <= 520, "{what}");
                if jog.rests() {
                    jog = Jog::begin();
                }
            }
            let speeds = tick(&mut jog, &mut position, &config).0;
            assert!((0..2).all(|j| slow || (speeds[j] - then[j]).abs() < 1e-9), "{what}: {speeds:?}");
        }
    }
}
