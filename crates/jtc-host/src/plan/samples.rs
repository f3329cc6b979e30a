//! Samples of a planned trajectory. A sample contains the values of a recorded sample that are known before the execution.

use jtc_core::JOINTS;
use jtc_dynamics::Dynamics;
use jtc_wire::{ControllerState, TrajectoryState};

use super::Planner;
use crate::check::Checker;
use crate::sample::{JointSample, Sample};
use crate::trajectory::{Point, Trajectory};

impl Planner<'_> {
    /// Returns the commanded values at each point of a trajectory, with the torques of the model and the friction at the temperature of the
    /// planner. The samples do not contain measured values.
    pub fn samples(&self, trajectory: &Trajectory) -> Vec<Sample> {
        let dynamics =
            self.model.map(|model| Dynamics::with_payload(model, self.config.gravity, &self.config.payload));
        let h = f64::from(trajectory.step_ms) * 1e-3;
        let at = |(i, p): (usize, &Point)| self.sample(i as f64 * h, p, dynamics.as_ref());
        trajectory.points.iter().enumerate().map(at).collect()
    }

    fn sample(&self, time_s: f64, p: &Point, dynamics: Option<&Dynamics>) -> Sample {
        let checker = Checker { temperature: self.temperature, ..self.checker(None) };
        let model = dynamics.map(|dynamics| dynamics.inverse(&p.position, &p.velocity, &p.acceleration));
        let joint = |j: usize| {
            let commanded = JointSample {
                set_position: p.position[j],
                set_velocity: p.velocity[j],
                set_acceleration: p.acceleration[j],
                ..JointSample::UNKNOWN
            };
            let Some(model) = model else { return commanded };
            let torque_model = model[j] + self.config.joints[j].rotor_inertia * p.acceleration[j];
            let torque_friction = checker.friction_torque(j, p.velocity[j]);
            JointSample { torque_model, torque_friction, torque: torque_model + torque_friction, ..commanded }
        };
        Sample {
            time_s,
            state: ControllerState::Operate.into(),
            trajectory: TrajectoryState::Execute.into(),
            point: (time_s * 1e3).round() as u32,
            joints: std::array::from_fn::<_, JOINTS, _>(joint),
            ..Sample::default()
        }
    }
}
