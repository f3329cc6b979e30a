//! Torque of a motion, as the controller will command it.
use jtc_core::{Config, Friction, friction};
use jtc_dynamics::{ArmModel, Dynamics};

use crate::{JOINTS, JointVec, State};

/// Share of a joint's torque limit that holding it may take, friction not counted: 98 % have been seen to fall.
pub const HOLD_SHARE: f64 = 0.97;

/// What the torque of a motion is computed with: the arm with its payload, the inertia of its rotors, and the friction
/// compensation that the controller adds (J-40, J-42, J-60).
#[derive(Clone, Debug)]
pub struct ArmDynamics<'a> {
    dynamics: Dynamics,
    rotor: JointVec,
    friction: Option<&'a Friction>,
    temperature: f64,
    sign_width: f64,
}

impl<'a> ArmDynamics<'a> {
    /// The arm `model` with the payload, gravity and rotors of `config`, and `friction` where it is compensated for, at a bearing
    /// temperature of 30 °C.
    pub fn new(config: &Config, model: &ArmModel, friction: Option<&'a Friction>) -> Self {
        Self {
            dynamics: Dynamics::with_payload(model, config.gravity, &config.payload),
            rotor: config.joints.each_ref().map(|j| j.rotor_inertia),
            friction,
            temperature: 30.0,
            sign_width: config.friction_sign_width,
        }
    }

    /// The same at another bearing temperature, °C.
    pub fn at_temperature(self, temperature: f64) -> Self {
        Self { temperature, ..self }
    }

    /// Joint torques that the controller commands at `state` where the arm follows exactly, N·m.
    pub fn torque(&self, state: &State) -> JointVec {
        let mut torque = self.dynamics.inverse(&state.position, &state.velocity, &state.acceleration);
        for (j, torque) in torque.iter_mut().enumerate() {
            *torque += self.rotor[j] * state.acceleration[j] + self.friction(j, state.velocity[j]);
        }
        torque
    }

    /// Joint torques that hold the arm at rest, N·m.
    pub fn holding(&self, position: &JointVec) -> JointVec {
        self.dynamics.inverse(position, &[0.0; JOINTS], &[0.0; JOINTS])
    }

    /// Torque that compensates for the friction of the joint with index `j` at `velocity` (rad/s), N·m. Velocities that the table
    /// does not have count as its nearest.
    pub(crate) fn friction(&self, j: usize, velocity: f64) -> f64 {
        match self.friction {
            Some(Friction::Polynomial(c)) => {
                friction::polynomial(&c[j], velocity, self.temperature, self.sign_width)
            }
            Some(Friction::Table(tables)) => {
                let (low, high) = friction::velocities(&tables[j]);
                let velocity = velocity.max(low).min(high);
                friction::table(&tables[j], velocity, self.temperature).unwrap_or(0.0)
            }
            None => 0.0,
        }
    }

    /// Highest speed of the joint with index `j` that the friction table has either way, rad/s (J-36); infinite without a table.
    pub(crate) fn velocity_max(&self, j: usize) -> f64 {
        match self.friction {
            Some(Friction::Table(tables)) => {
                let (low, high) = friction::velocities(&tables[j]);
                high.min(-low).max(0.0)
            }
            _ => f64::INFINITY,
        }
    }

    /// Torque without friction at `position` with these velocities and accelerations, rotors included, N·m.
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
