//! Torque that the controller commands during a motion.
use jtc_core::{Config, Friction, friction};
use jtc_dynamics::{ArmModel, Dynamics};

use crate::{JOINTS, JointVec, Limits, State};

/// Maximum holding torque of a joint without friction, as a share of the torque limit. Joints with a holding torque
/// of 98 % of the limit were observed to fall.
pub const HOLD_SHARE: f64 = 0.97;

/// Share of the torque above the holding torque that a motion may always use, even with a large torque margin. The
/// next constant is the minimum of this torque, as a share of the torque limit.
const MOTION_SHARE: f64 = 0.25;
const MOTION_LEAST: f64 = 0.02;

/// Model for the torque of a motion (J-40, J-42, J-60). The model includes the arm with its payload, the inertia of the
/// rotors, and the friction compensation that the controller adds.
#[derive(Clone, Debug)]
pub struct ArmDynamics<'a> {
    dynamics: Dynamics,
    rotor: JointVec,
    friction: Option<&'a Friction>,
    /// Bearing temperatures, °C. The model uses the temperature with the higher torque.
    temperatures: [f64; 2],
    sign_width: f64,
    ranges: FrictionRanges,
}

/// Number of speed steps for which the range of a joint's friction is stored.
const STEPS: usize = 128;

/// Lowest and highest friction (N·m) of each joint over all speeds from 0 up to each step, backward and forward.
#[derive(Clone, Debug)]
struct FrictionRanges {
    /// Difference between two consecutive speed steps, rad/s.
    step: JointVec,
    ranges: Vec<[[(f64, f64); STEPS + 1]; 2]>,
}

impl<'a> ArmDynamics<'a> {
    /// Creates the model for a bearing temperature of 30 °C from the arm `model`, and from the payload, gravity and
    /// rotors of `config`. `friction` is `Some` if the controller compensates for friction.
    pub fn new(config: &Config, model: &ArmModel, friction: Option<&'a Friction>) -> Self {
        let step = config.joints.each_ref().map(|j| j.velocity_max / STEPS as f64);
        let arm = Self {
            dynamics: Dynamics::with_payload(model, config.gravity, &config.payload),
            rotor: config.joints.each_ref().map(|j| j.rotor_inertia),
            friction,
            temperatures: [30.0; 2],
            sign_width: config.friction_sign_width,
            ranges: FrictionRanges { step, ranges: Vec::new() },
        };
        arm.with_ranges()
    }

    /// Returns the model at another bearing temperature, °C.
    pub fn at_temperature(self, temperature: f64) -> Self {
        self.at_temperatures([temperature; 2])
    }

    /// Returns the model at two bearing temperatures, °C. In every state, the temperature with the higher torque is
    /// used. Cold bearings need more torque to accelerate, and warm bearings need more torque to decelerate.
    pub fn at_temperatures(self, temperatures: [f64; 2]) -> Self {
        Self { temperatures, ..self }.with_ranges()
    }

    /// Returns `true` if the controller compensates for friction.
    pub(crate) fn has_friction(&self) -> bool {
        self.friction.is_some()
    }

    /// Returns the speed at which the smoothed sign function of the friction polynomial reaches ±1, rad/s; `None` if
    /// the friction is not a polynomial.
    pub(crate) fn sign_width(&self) -> Option<f64> {
        matches!(self.friction, Some(Friction::Polynomial(_))).then_some(self.sign_width)
    }

    fn with_ranges(mut self) -> Self {
        let ranges = (0..JOINTS).map(|j| {
            [-1.0, 1.0].map(|sign| {
                let (mut low, mut high) = (0.0f64, 0.0f64);
                std::array::from_fn(|i| {
                    let friction = self.frictions(j, sign * i as f64 * self.ranges.step[j]);
                    (low, high) = (low.min(friction.0), high.max(friction.1));
                    (low, high)
                })
            })
        });
        self.ranges.ranges = ranges.collect();
        self
    }

    /// Returns the lowest and highest friction of the joint with index `j` at all speeds from 0 to `fastest` (rad/s, signed), N·m.
    pub(crate) fn friction_range(&self, j: usize, fastest: f64) -> (f64, f64) {
        if self.friction.is_none() {
            return (0.0, 0.0);
        }
        let step = (fastest.abs() / self.ranges.step[j]).ceil() as usize;
        let (low, high) = self.ranges.ranges[j][usize::from(fastest > 0.0)][step.min(STEPS)];
        if step <= STEPS {
            return (low, high);
        }
        // The requested speed is above the stored range of speeds, which ends at the highest speed of the arm. The
        // friction at this speed is therefore computed.
        let friction = self.frictions(j, fastest);
        (low.min(friction.0), high.max(friction.1))
    }

    /// Returns the lowest and highest friction up to a speed, and the slopes of these two frictions with respect to the
    /// speed. The values are interpolated linearly between two steps, so that they are continuous.
    pub(crate) fn friction_line(&self, j: usize, fastest: f64) -> (f64, f64, f64, f64) {
        if self.friction.is_none() {
            return (0.0, 0.0, 0.0, 0.0);
        }
        let steps = fastest.abs() / self.ranges.step[j];
        let ranges = &self.ranges.ranges[j][usize::from(fastest > 0.0)];
        let at = steps as usize + 1;
        let by = self.ranges.step[j].recip().copysign(fastest);
        let (u, (low, high), (low_after, high_after)) = if at < STEPS {
            (steps + 1.0 - at as f64, ranges[at], ranges[at + 1])
        } else {
            // The requested speed is above the stored range of speeds, which ends at the highest speed of the arm.
            let (u, step) = (steps.fract(), self.ranges.step[j].copysign(fastest));
            let with = |speed: f64| {
                let (friction, (low, high)) = (self.frictions(j, speed), ranges[STEPS]);
                (low.min(friction.0), high.max(friction.1))
            };
            (u, with(fastest + (1.0 - u) * step), with(fastest + (2.0 - u) * step))
        };
        let (low_by, high_by) = (low_after - low, high_after - high);
        (low + u * low_by, high + u * high_by, low_by * by, high_by * by)
    }

    /// Returns the joint torques that the controller commands at `state` if the arm follows the motion exactly, N·m.
    pub fn torque(&self, state: &State) -> JointVec {
        let mut torque = self.rigid(&state.position, &state.velocity, &state.acceleration);
        for (j, torque) in torque.iter_mut().enumerate() {
            *torque += self.friction(j, state.velocity[j], *torque);
        }
        torque
    }

    /// Returns the torque (N·m) of the joint with index `j` that a motion may use if the holding torque is `hold`.
    /// The usable torque is the limit minus the margin.
    ///
    /// The result is never below the sum of holding torque, breakaway friction and a reserve. The reserve is a
    /// quarter of the remaining torque, or 2 % of the limit if this is more. Therefore the arm can always move to and
    /// from a pose that it can hold.
    pub fn usable_torque(&self, limits: &Limits, j: usize, hold: f64) -> f64 {
        let (whole, margin) = (limits.torque[j], limits.margin[j]);
        if margin == 0.0 {
            return whole;
        }
        let stands = hold.abs() + self.breakaway(j);
        let needed = stands + (MOTION_SHARE * (whole - stands)).max(MOTION_LEAST * whole);
        ((1.0 - margin) * whole).max(needed).min(whole)
    }

    /// Returns the breakaway friction of the joint with index `j`, N·m. The breakaway friction is the highest
    /// friction up to the speed at which the smoothed sign function of the friction polynomial reaches ±1.
    pub(crate) fn breakaway(&self, j: usize) -> f64 {
        let of = |speed: f64| {
            let (low, high) = self.friction_range(j, speed);
            high.max(-low)
        };
        of(self.sign_width).max(of(-self.sign_width))
    }

    /// Returns the joint torques that hold the arm at rest, N·m.
    pub fn holding(&self, position: &JointVec) -> JointVec {
        self.dynamics.inverse(position, &[0.0; JOINTS], &[0.0; JOINTS])
    }

    /// Returns the torque (N·m) that compensates for the friction of the joint with index `j` at `velocity` (rad/s).
    /// The function uses the bearing temperature with the larger sum of friction and `rigid`. For a velocity outside
    /// the friction table, the nearest value in the table is used.
    pub(crate) fn friction(&self, j: usize, velocity: f64, rigid: f64) -> f64 {
        let (low, high) = self.frictions(j, velocity);
        if (rigid + high).abs() >= (rigid + low).abs() { high } else { low }
    }

    /// Returns the friction at both temperatures, the lower value first.
    fn frictions(&self, j: usize, velocity: f64) -> (f64, f64) {
        let [first, second] = self.temperatures;
        let friction = self.friction_at(j, velocity, first);
        if first == second {
            return (friction, friction);
        }
        let other = self.friction_at(j, velocity, second);
        (friction.min(other), friction.max(other))
    }

    fn friction_at(&self, j: usize, velocity: f64, temperature: f64) -> f64 {
        match self.friction {
            Some(Friction::Polynomial(c)) => {
                friction::polynomial(&c[j], velocity, temperature, self.sign_width)
            }
            Some(Friction::Table(tables)) => {
                let (low, high) = friction::velocities(&tables[j]);
                let velocity = velocity.max(low).min(high);
                friction::table(&tables[j], velocity, temperature).unwrap_or(0.0)
            }
            None => 0.0,
        }
    }

    /// Returns the highest speed that the friction table covers for the joint with index `j` in both directions, rad/s
    /// (J-36). Without a friction table, the result is infinite.
    pub(crate) fn velocity_max(&self, j: usize) -> f64 {
        match self.friction {
            Some(Friction::Table(tables)) => {
                let (low, high) = friction::velocities(&tables[j]);
                high.min(-low).max(0.0)
            }
            _ => f64::INFINITY,
        }
    }

    /// Returns the torque without friction at `position` with these velocities and accelerations, including rotors, N·m.
    pub(crate) fn rigid(
        &self,
        position: &JointVec,
        velocity: &JointVec,
        acceleration: &JointVec,
    ) -> JointVec {
        let mut torque = self.dynamics.inverse(position, velocity, acceleration);
        for (j, torque) in torque.iter_mut().enumerate() {
            *torque += self.rotor[j] * acceleration[j];
        }
        torque
    }
}
