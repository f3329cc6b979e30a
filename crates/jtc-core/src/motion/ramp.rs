//! Bounds of a ramp of path time (J-33): the slopes at which the arm stays within its acceleration and torque limits.
use jtc_dynamics::Dynamics;

use super::law::ControlLaw;
use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::interpolation::SetPoint;
use crate::motion::deceleration::{STEEPEST_LED, moves};
use crate::nodes::Nodes;
use crate::trajectory::path::{Bounds, PathClock, SlopeBounds};
use crate::{DT, JOINTS};

/// Shares of the acceleration and torque limits that a pause, a stop or a resume may use. The remainder of each limit is for changes within
/// a tick and for the position controller.
const RAMP_ACCELERATION: f64 = 0.98;
const RAMP_TORQUE: f64 = 0.95;
/// Share of the remaining torque that a stop may use after a hand has moved the arm. The position controller must produce this torque, and
/// its torque overshoots.
const STOP_TORQUE: f64 = 0.5;
/// Least share of the torque limit that a stop may use, even if the holding torque leaves hardly any torque.
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

    /// Creates a ramp that begins with this mass matrix of the arm, kg·m².
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
            // The holding torque either helps to stop the joint, or reduces the torque that is available for the stop.
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

    /// Returns the slopes of path time that the arm can follow at `at`, at the present `rate` and `slope` (1/s). The remaining torque of
    /// each joint is computed from the last torque of the `law` with all its parts. A joint that already lags therefore has less remaining
    /// torque. Joints that yield do not move along the path, so the rate of path time does not change their torque.
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
            // If a joint does not move along the path, a change of path time does not reduce its torque.
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
        /// A slope within the bounds keeps the acceleration and torque limits. A slope outside the bounds violates a limit. A joint at rest
        /// that exceeds a limit does not prevent path time from keeping its present rate.
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
}
