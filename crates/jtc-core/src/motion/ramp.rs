//! Bounds of a ramp of path time (J-33): the slopes of path time at which the arm stays within its acceleration and
//! torque limits.
use jtc_dynamics::Dynamics;

use super::law::ControlLaw;
use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::interpolation::SetPoint;
use crate::motion::deceleration::{STEEPEST_LED, moves};
use crate::nodes::Nodes;
use crate::trajectory::path::{Bounds, PathClock, SlopeBounds};
use crate::{DT, JOINTS};

/// Share of the acceleration limits that a pause, a stop or a resume uses at most. `RAMP_TORQUE` is the same share
/// for the torque limits. The rest of each limit is a reserve for changes within a tick and for the position
/// controller.
const RAMP_ACCELERATION: f64 = 0.98;
const RAMP_TORQUE: f64 = 0.95;
/// Share of the remaining torque that a stop uses at most after a hand has moved the arm. The rest is a reserve,
/// because the position controller produces the torque of this stop and overshoots.
const STOP_TORQUE: f64 = 0.5;
/// Least share of the torque limit that is available for a stop. This share applies even if the holding torque leaves
/// hardly any torque.
const LEAST_LEFT: f64 = 0.1;

/// Inertia of the arm at the start of a ramp.
#[derive(Clone, Debug, Default)]
pub(crate) struct PathRamp {
    /// Mass matrix of the arm, including the rotors.
    inertia: [[f64; JOINTS]; JOINTS],
}

bit_codec!(PathRamp { inertia });

impl PathRamp {
    /// Begins a ramp of path time. The bounds of the ramp depend on the inertia of the arm.
    pub(crate) fn begin(&mut self, nodes: &Nodes, config: &Config, dynamics: &Dynamics) {
        self.inertia = dynamics.mass_matrix(nodes.positions());
        for j in 0..JOINTS {
            self.inertia[j][j] += config.joints[j].rotor_inertia;
        }
    }

    /// Creates a ramp of path time. `inertia` is the mass matrix of the arm at the start of the ramp, kg·m².
    #[cfg(test)]
    pub(crate) fn with_inertia_for_test(inertia: [[f64; JOINTS]; JOINTS]) -> Self {
        Self { inertia }
    }

    /// Returns the inertia of each joint at the start of the ramp, for a motion of this joint alone, kg·m².
    pub(crate) fn inertia(&self) -> [f64; JOINTS] {
        core::array::from_fn(|j| self.inertia[j][j])
    }

    /// Returns the coupling inertia between joint `j` and an accelerating joint `k`, kg·m².
    pub(crate) fn coupling(&self, j: usize, k: usize) -> f64 {
        self.inertia[j][k]
    }

    /// Returns the shortest time of a smooth stop of all joints from these velocities (rad/s), ms. The stop uses the share [`STOP_TORQUE`]
    /// of the torque that remains within the limits after the last torques of the `law`.
    pub(crate) fn shortest_stop_ms(
        &self,
        law: &ControlLaw,
        velocity: &[f64; JOINTS],
        config: &Config,
    ) -> f64 {
        let mut longest = 0.0_f64;
        for j in 0..JOINTS {
            let momentum: f64 = (0..JOINTS).map(|k| self.inertia[j][k] * velocity[k]).sum();
            let (limit, held) = (config.joints[j].torque_max, law.torque[j].model + law.torque[j].load);
            // Depending on the direction of the motion, the holding torque helps to stop the joint, or reduces the
            // torque that is available for the stop.
            let left = (STOP_TORQUE * (limit + held * momentum.signum())).max(LEAST_LEFT * limit);
            longest = longest.max(STEEPEST_LED * momentum.abs() / (left * DT));
        }
        longest
    }

    /// Executes one tick of a clock that changes to another rate, along a ramp that the arm can follow. `at` and `law` are the arguments of
    /// `slope_bounds`.
    pub(crate) fn step(&self, at: &SetPoint, law: &ControlLaw, clock: &mut PathClock, config: &Config) {
        if !clock.ramping() {
            clock.slope = 0.0;
            return;
        }
        let bounds = self.slope_bounds(at, law, clock.rate, clock.slope, config);
        let ramp_ms = f64::from(config.ramp_ms);
        if clock.halting() {
            clock.slow_down(ramp_ms, f64::from(config.stop_ms), &bounds);
        } else {
            clock.change_pace(ramp_ms, bounds.easy);
        }
    }

    /// Executes one tick of a clock that is held back because joints are at their torque limits (J-75).
    pub(crate) fn hold_back(&self, at: &SetPoint, law: &ControlLaw, clock: &mut PathClock, config: &Config) {
        clock.hold_back(self.slope_bounds(at, law, clock.rate, clock.slope, config).full);
    }

    /// Returns the slopes of path time that the arm can follow at `at`, at the present `rate` and `slope` (1/s). The
    /// remaining torque of each joint is its limit minus the last torque of the `law`, so a joint that already lags
    /// has less remaining torque. Joints that yield do not move along the path, so they do not bound the slope.
    fn slope_bounds(
        &self,
        at: &SetPoint,
        law: &ControlLaw,
        rate: f64,
        slope: f64,
        config: &Config,
    ) -> SlopeBounds {
        const FREE: Bounds = (f64::NEG_INFINITY, f64::INFINITY);
        let (mut easy, mut full) = (FREE, FREE);
        let along: [f64; JOINTS] = core::array::from_fn(|j| if law.yields(j) { 0.0 } else { at.velocity[j] });
        for j in 0..JOINTS {
            if law.yields(j) {
                continue;
            }
            let limit = &config.joints[j];
            let acceleration = at.acceleration[j] * rate * rate;
            narrow(
                &mut easy,
                within(acceleration, at.velocity[j], RAMP_ACCELERATION * limit.acceleration_max),
            );
            let push: f64 = self.inertia[j].iter().zip(&along).map(|(inertia, along)| inertia * along).sum();
            let torque = law.torque[j].sum() - push * slope;
            narrow(&mut easy, within(torque, push, RAMP_TORQUE * limit.torque_max));
            let (low, high) = within(torque, push, limit.torque_max);
            // A joint that does not move along the path may be above its limit for another reason. Its bounds always
            // permit a slope of 0, so that it does not force a change of path time.
            narrow(
                &mut full,
                if moves(at.velocity[j]) { (low, high) } else { (low.min(0.0), high.max(0.0)) },
            );
        }
        SlopeBounds { easy, full }
    }
}

/// Returns the range of slopes with |`offset` + `factor`·slope| ≤ `limit`.
fn within(offset: f64, factor: f64, limit: f64) -> Bounds {
    if factor.abs() <= 1e-9 {
        return (f64::NEG_INFINITY, f64::INFINITY);
    }
    let (a, b) = ((-limit - offset) / factor, (limit - offset) / factor);
    (a.min(b), a.max(b))
}

fn narrow(bounds: &mut Bounds, to: Bounds) {
    *bounds = (bounds.0.max(to.0), bounds.1.min(to.1));
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Parameters;
    use crate::motion::JointTorque;

    /// Velocities of joints at rest, of joints that are slow enough to be considered at rest, and of moving joints.
    fn velocities() -> impl Strategy<Value = [f64; JOINTS]> {
        prop::array::uniform6(prop_oneof![Just(0.0), Just(0.02), Just(-0.02), -1.5..1.5f64])
    }

    fn inside(s: f64, (low, high): Bounds) -> bool {
        low <= s && s <= high
    }

    proptest! {
        /// With a slope within the bounds, the arm stays within its acceleration and torque limits. With a slope
        /// outside the bounds, it exceeds a limit. If a joint at rest already exceeds a limit, path time can at least
        /// keep its present rate.
        #[test]
        fn j33_the_bounds_of_a_slope_are_where_the_arm_reaches_its_limits(
            velocity in velocities(),
            acceleration in prop::array::uniform6(-13.0..13.0f64),
            share in prop::array::uniform6(prop_oneof![4 => -0.9..0.9f64, 1 => -1.2..1.2f64]),
            (rate, slope) in (0.0..1.0f64, -8.0..8.0f64),
            slopes in prop::collection::vec(-40.0..40.0f64, 20),
        ) {
            let config = Config::avena();
            let (nodes, dynamics) = (Nodes::new(&config), Dynamics::new(&Parameters::avena().model, config.gravity));
            let mut ramp = PathRamp::default();
            ramp.begin(&nodes, &config, &dynamics);
            let mut law = ControlLaw::default();
            law.torque = core::array::from_fn(|j| JointTorque {
                model: share[j] * config.joints[j].torque_max,
                ..JointTorque::default()
            });
            let at = SetPoint { position: [0.0; JOINTS], velocity, acceleration };
            let SlopeBounds { easy, full } = ramp.slope_bounds(&at, &law, rate, slope, &config);

            // Torque that the arm needs per unit of slope.
            let zero = [0.0; JOINTS];
            let (moved, held) = (dynamics.inverse(&zero, &zero, &velocity), dynamics.inverse(&zero, &zero, &zero));
            let push = |j: usize| moved[j] - held[j] + config.joints[j].rotor_inertia * velocity[j];
            let acceleration_fits = |j: usize, s: f64| {
                let used = acceleration[j] * rate * rate + velocity[j] * s;
                velocity[j] == 0.0 || used.abs() <= RAMP_ACCELERATION * config.joints[j].acceleration_max
            };
            let torque_fits = |j: usize, s: f64, most: f64| {
                let limit = config.joints[j].torque_max;
                push(j).abs() < 1e-8 || (share[j] * limit + push(j) * (s - slope)).abs() <= most * limit
            };
            let near = |s: f64, (low, high): Bounds| (s - low).abs() < 1e-6 || (s - high).abs() < 1e-6;
            for s in slopes.into_iter().chain([0.0]) {
                let fits = (0..JOINTS).all(|j| acceleration_fits(j, s) && torque_fits(j, s, RAMP_TORQUE));
                prop_assert!(near(s, easy) || inside(s, easy) == fits, "{s} in {easy:?}: {fits}");
                let moving = (0..JOINTS).filter(|&j| moves(velocity[j])).all(|j| torque_fits(j, s, 1.0));
                let all = (0..JOINTS).all(|j| torque_fits(j, s, 1.0));
                prop_assert!(near(s, full) || moving || !inside(s, full), "{s} in {full:?}");
                prop_assert!(near(s, full) || !all || inside(s, full), "{s} outside {full:?}");
                prop_assert!(near(s, full) || s != 0.0 || !moving || inside(s, full), "{s} outside {full:?}");
            }
        }
    }

    #[test]
    fn j33_a_joint_that_hardly_moves_along_the_path_does_not_bound_its_slope() {
        for (factor, bounds) in [(1e-9, (f64::NEG_INFINITY, f64::INFINITY)), (2e-9, (-1.0e9, 1.0e9))] {
            for factor in [factor, -factor] {
                let (low, high) = within(0.0, factor, 2.0);
                assert!(low == bounds.0 || (low / bounds.0 - 1.0).abs() < 1e-9, "{factor}: {low}");
                assert!(high == bounds.1 || (high / bounds.1 - 1.0).abs() < 1e-9, "{factor}: {high}");
            }
        }
    }

    /// Returns a ramp with this inertia of joints 1 and 2. The other joints have no inertia.
    fn ramp([first, second]: [[f64; 2]; 2]) -> PathRamp {
        let mut ramp = PathRamp::default();
        (ramp.inertia[0][0], ramp.inertia[0][1]) = (first[0], first[1]);
        (ramp.inertia[1][0], ramp.inertia[1][1]) = (second[0], second[1]);
        ramp
    }

    /// Returns settings in which every joint has this torque limit, N·m, and a very high acceleration limit.
    fn limited(torque_max: f64) -> Config {
        let mut config = Config::avena();
        for limits in &mut config.joints {
            (limits.torque_max, limits.acceleration_max) = (torque_max, 1e6);
        }
        config
    }

    fn close(found: f64, expected: f64) -> bool {
        found == expected || (found - expected).abs() <= 1e-9 * expected.abs()
    }

    #[test]
    fn j34_the_inertia_of_a_joint_is_on_the_diagonal_and_its_coupling_beside_it() {
        let ramp = ramp([[2.0, 0.5], [0.25, 4.0]]);
        assert_eq!(ramp.inertia(), [2.0, 4.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!((ramp.coupling(0, 1), ramp.coupling(1, 0), ramp.coupling(1, 1)), (0.5, 0.25, 4.0));
    }

    /// The peak torque of a stop is twice the momentum divided by the duration. The torque limit is 64 N·m. A stop
    /// may use half of the torque that remains above the holding torque, and at least a tenth of the limit.
    #[test]
    fn j25_a_stop_after_teaching_takes_the_time_that_its_slowest_joint_needs() {
        let config = limited(64.0);
        let torque = |model: f64, load: f64| JointTorque { model, load, ..JointTorque::default() };
        // Joint 1 has the momentum 2·0.25 + 1·0.5 = 1 kg·m²/s. Joint 2 has no momentum.
        let coupled = [[2.0, 1.0], [0.0, 0.0]];
        for (inertia, velocity, torques, ms) in [
            // The holding torque of 16 N·m helps to stop joint 1. Half of 64 + 16 N·m is 40 N·m, so the stop takes
            // 2·1 / 40 s = 50 ms.
            (coupled, [0.25, 0.5], [torque(12.0, 4.0), torque(0.0, 0.0)], 50.0),
            // In the other direction, the holding torque reduces the available torque. Half of 64 − 16 N·m is 24 N·m,
            // so the stop takes 2·1 / 24 s.
            (coupled, [-0.25, -0.5], [torque(12.0, 4.0), torque(0.0, 0.0)], 2_000.0 / 24.0),
            (coupled, [0.25, 0.5], [torque(-12.0, -4.0), torque(0.0, 0.0)], 2_000.0 / 24.0),
            // The holding torque needs the whole limit. A tenth of 64 N·m is used, so the stop takes 2·1 / 6.4 s =
            // 312.5 ms.
            (coupled, [-0.25, -0.5], [torque(60.0, 4.0), torque(0.0, 0.0)], 312.5),
            (coupled, [-0.25, -0.5], [torque(100.0, 4.0), torque(0.0, 0.0)], 312.5),
            // Without a holding torque, half of 64 N·m is available. The first joint has a momentum of 4 kg·m²/s, so
            // the stop takes 2·4 / 32 s = 250 ms. The other joint needs less time.
            ([[2.0, 0.0], [0.0, 4.0]], [0.5, -1.0], [torque(0.0, 0.0), torque(0.0, 0.0)], 250.0),
            ([[8.0, 0.0], [0.0, 1.0]], [0.5, -1.0], [torque(0.0, 0.0), torque(0.0, 0.0)], 250.0),
            // The motion of joint 2 causes a momentum of joint 1 that cancels the own momentum of joint 1.
            (coupled, [0.25, -0.5], [torque(12.0, 4.0), torque(0.0, 0.0)], 0.0),
            (coupled, [0.0, 0.0], [torque(12.0, 4.0), torque(0.0, 0.0)], 0.0),
        ] {
            let mut law = ControlLaw::default();
            (law.torque[0], law.torque[1]) = (torques[0], torques[1]);
            let velocity = [velocity[0], velocity[1], 0.0, 0.0, 0.0, 0.0];
            let found = ramp(inertia).shortest_stop_ms(&law, &velocity, &config);
            assert!(close(found, ms), "{velocity:?} {torques:?}: {found} ms, expected {ms} ms");
        }
    }

    #[test]
    fn j33_path_time_at_its_target_rate_has_no_slope() {
        let (ramp, config) = (PathRamp::default(), Config::avena());
        let mut clock = PathClock::start(0.5);
        clock.slope = 5.0;
        ramp.step(&SetPoint::default(), &ControlLaw::default(), &mut clock, &config);
        assert_eq!((clock.rate, clock.slope), (0.5, 0.0));
    }

    /// A ramp takes one second here, but a stop may take at most 250 ms. The stop is therefore finished after 250 ms.
    /// A change of the rate that is not a stop takes the whole second.
    #[test]
    fn j33_a_stop_is_faster_than_a_ramp_that_takes_longer_than_a_stop_may() {
        let config = Config { ramp_ms: 1_000, stop_ms: 250, ..Config::avena() };
        let after_250_ms = |mut clock: PathClock| {
            for _ in 0..250 {
                let law = ControlLaw::default();
                PathRamp::default().step(&SetPoint::default(), &law, &mut clock, &config);
            }
            clock
        };
        let mut halts = PathClock::start(1.0);
        halts.halt();
        assert!(after_250_ms(halts).standing());
        let mut slows = PathClock::start(1.0);
        slows.set_pace(0.125);
        assert!(after_250_ms(slows).rate > 0.5);
    }

    /// Joint 1 needs 60 N·m, 10 N·m above its limit of 50 N·m. Joint 1 has 2 kg·m² and moves at 1 rad/s, so a slope of
    /// −5 1/s removes these 10 N·m. In one tick, the slope of path time changes by a tenth of the difference to −5 1/s.
    #[test]
    fn j75_path_time_that_is_held_back_follows_the_slope_at_the_torque_limit() {
        let config = limited(50.0);
        let mut law = ControlLaw::default();
        law.torque[0].model = 60.0;
        let at = SetPoint { velocity: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], ..SetPoint::default() };
        let mut clock = PathClock::start(1.0);
        ramp([[2.0, 0.0], [0.0, 2.0]]).hold_back(&at, &law, &mut clock, &config);
        assert!(close(clock.slope, -0.5) && close(clock.rate, 1.0 - 0.0005), "{clock:?}");
    }

    /// Joint 1 has a torque of 40 N·m and an inertia of 2 kg·m². Joint 2 yields, so it does not move along the path.
    /// Therefore its coupling inertia does not load joint 1, and its own limits do not bound the slope of path time.
    #[test]
    fn j68_a_joint_that_yields_does_not_bound_the_slope_of_path_time() {
        let config = limited(50.0);
        let at = SetPoint { velocity: [1.0, 1.0, 0.0, 0.0, 0.0, 0.0], ..SetPoint::default() };
        for (yields, full, easy) in [
            // Joint 1 alone bounds the slope. With the full limit of 50 N·m, the bounds are (−50 − 40) / 2 and (50 −
            // 40) / 2. With 0.95 of the limit, they are (−47.5 − 40) / 2 and (47.5 − 40) / 2.
            (true, (-45.0, 5.0), (-43.75, 3.75)),
            // Both joints bound the slope. A slope of 1 1/s needs 2 + 4 = 6 N·m at joint 1, and 4 + 8 = 12 N·m at
            // joint 2, whose torque is 0. With the full limit, the bounds are max(−90 / 6, −50 / 12) and min(10 / 6,
            // 50 / 12). With 0.95 of the limit, they are max(−87.5 / 6, −47.5 / 12) and 7.5 / 6.
            (false, (-50.0 / 12.0, 10.0 / 6.0), (-47.5 / 12.0, 7.5 / 6.0)),
        ] {
            let mut law = ControlLaw::default();
            law.torque[0].model = 40.0;
            if yields {
                law.begin_yield(1, (false, false), 0.0, 8.0, &config.joints[1]);
            }
            let bounds = ramp([[2.0, 4.0], [4.0, 8.0]]).slope_bounds(&at, &law, 1.0, 0.0, &config);
            for (found, expected) in [(bounds.full, full), (bounds.easy, easy)] {
                assert!(
                    close(found.0, expected.0) && close(found.1, expected.1),
                    "{yields}: {found:?}, expected {expected:?}"
                );
            }
        }
    }
}
