//! Sample of a run, in the form that recordings and reports store. A sample is made from the controller's telemetry or
//! from a status.

use jtc_core::{JOINTS, JointTelemetry, Telemetry};
use jtc_wire::{Code, ControllerState, NodeState, Status, TrajectoryState};

use crate::labels;
use crate::trajectory::Trajectory;

/// Values of a joint in a [`Sample`]. A value that the source does not supply is NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSample {
    /// Commanded position, rad.
    pub set_position: f64,
    /// Commanded velocity, rad/s.
    pub set_velocity: f64,
    /// Commanded acceleration, rad/s².
    pub set_acceleration: f64,
    /// Measured position, rad.
    pub position: f64,
    /// Position error, rad: the position commanded for the time of the measurement, minus the measured position (J-62).
    pub error: f64,
    /// Measured velocity, rad/s.
    pub velocity: f64,
    /// Model torque, N·m.
    pub torque_model: f64,
    /// Proportional part of the torque, N·m.
    pub torque_p: f64,
    /// Integral part of the torque, N·m.
    pub torque_i: f64,
    /// Derivative part of the torque, N·m.
    pub torque_d: f64,
    /// Friction compensation, N·m.
    pub torque_friction: f64,
    /// Torque commanded on the bus, N·m. In a sample from a status, the value is the torque that the drive reports.
    pub torque: f64,
    /// Bearing temperature, °C.
    pub temperature: f64,
    /// State of the drive.
    pub state: NodeState,
    /// Internal errors of the joint.
    pub internal: u16,
}

impl JointSample {
    /// Joint sample in which all values are unknown.
    pub const UNKNOWN: Self = Self {
        set_position: f64::NAN,
        set_velocity: f64::NAN,
        set_acceleration: f64::NAN,
        position: f64::NAN,
        error: f64::NAN,
        velocity: f64::NAN,
        torque_model: f64::NAN,
        torque_p: f64::NAN,
        torque_i: f64::NAN,
        torque_d: f64::NAN,
        torque_friction: f64::NAN,
        torque: f64::NAN,
        temperature: f64::NAN,
        state: NodeState::START,
        internal: 0,
    };

    /// Returns the sample of a joint that does not answer, with NaN instead of measured values. In a plot, NaN is a
    /// gap, while 0 would look like a joint at 0 rad.
    fn not_measured(self) -> Self {
        let nan = f64::NAN;
        Self { position: nan, error: nan, velocity: nan, torque: nan, temperature: nan, ..self }
    }

    /// Returns the position error, rad. If the sample contains no position error, returns the commanded minus the
    /// measured position of this sample. Returns NaN if one of these positions is unknown.
    pub fn position_error(&self) -> f64 {
        if self.error.is_finite() { self.error } else { self.set_position - self.position }
    }
}

impl Default for JointSample {
    fn default() -> Self {
        Self::UNKNOWN
    }
}

impl From<&JointTelemetry> for JointSample {
    fn from(t: &JointTelemetry) -> Self {
        Self {
            set_position: t.set_position,
            set_velocity: t.set_velocity,
            set_acceleration: t.set_acceleration,
            position: t.position,
            error: t.position_error(),
            velocity: t.velocity,
            torque_model: t.torque_model,
            torque_p: t.torque_p,
            torque_i: t.torque_i,
            torque_d: t.torque_d,
            torque_friction: t.torque_friction,
            torque: t.torque,
            temperature: t.temperature,
            state: t.state,
            internal: t.internal,
        }
    }
}

/// State of the arm and its controller at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Time of the sample, s. All samples of a run use the same clock.
    pub time_s: f64,
    /// State of the controller.
    pub state: Code<ControllerState>,
    /// Trajectory execution state.
    pub trajectory: Code<TrajectoryState>,
    /// Index of the current 1 ms point of the trajectory.
    pub point: u32,
    /// Current error word of the controller.
    pub errors: u16,
    /// Current CAN flags; 0 if the source does not supply the flags.
    pub can_current: u32,
    /// Joints, base to wrist.
    pub joints: [JointSample; JOINTS],
}

impl From<&Telemetry> for Sample {
    /// Converts telemetry. The time of the sample is the tick count of the controller.
    fn from(t: &Telemetry) -> Self {
        Self {
            time_s: t.tick as f64 * 1e-3,
            state: t.state.into(),
            trajectory: t.trajectory.into(),
            point: t.point,
            errors: t.errors,
            can_current: 0,
            joints: std::array::from_fn(|j| {
                let own = &t.joints[j];
                // In a state without torque, the position and velocity of a joint that does not answer are exactly 0.
                // Such a joint counts as not measured.
                let torque_off = matches!(
                    t.state,
                    ControllerState::Start | ControllerState::Init | ControllerState::Error
                );
                let lost = torque_off && own.position == 0.0 && own.velocity == 0.0;
                if lost { JointSample::from(own).not_measured() } else { JointSample::from(own) }
            }),
        }
    }
}

/// Returns `true` if the values of joint `j` (from 0) in a status are measured. For a joint that is silent or not ready,
/// the controller reports zeros.
pub fn is_measured(status: &Status, j: usize) -> bool {
    let unknown = labels::is_silent(status, j) || labels::is_awaited(status, j);
    !unknown || status.joints.get(j).is_some_and(|s| s.position != 0.0 || s.velocity != 0.0)
}

impl Sample {
    /// Returns the values of a status received at `time_s`. In this sample, the commanded values and the parts of the torque are unknown.
    pub fn from_status(time_s: f64, status: &Status) -> Self {
        Self {
            time_s,
            state: status.state,
            trajectory: status.trajectory,
            point: status.point,
            errors: status.errors,
            can_current: status.can_current,
            joints: std::array::from_fn(|j| {
                let s = &status.joints[j];
                let sample = JointSample {
                    position: f64::from(s.position),
                    velocity: f64::from(s.velocity),
                    torque: f64::from(s.torque),
                    temperature: f64::from(s.temperature),
                    state: s.state,
                    internal: s.internal,
                    ..JointSample::UNKNOWN
                };
                if is_measured(status, j) { sample } else { sample.not_measured() }
            }),
        }
    }

    /// Returns `true` if the controller moves the arm along the trajectory (state Operate, trajectory Execute).
    /// [`jtc_wire::Status::is_executing`] checks only the trajectory state.
    pub fn is_operating(&self) -> bool {
        self.state == ControllerState::Operate && self.trajectory == TrajectoryState::Execute
    }

    /// Returns the values of a status while `trajectory` is executed. The commanded values are computed for the reported point, as the
    /// controller does. The position error is computed for measurements that are `delay_ticks` old (J-62).
    pub fn following(time_s: f64, status: &Status, trajectory: &Trajectory, delay_ticks: u8) -> Self {
        let mut sample = Self::from_status(time_s, status);
        if status.state == ControllerState::Operate
            && let Some(set) = trajectory.at_ms(status.point)
        {
            for (j, joint) in sample.joints.iter_mut().enumerate() {
                joint.set_position = set.position[j];
                joint.set_velocity = set.velocity[j];
                joint.set_acceleration = set.acceleration[j];
            }
            if let Some(due) = trajectory.at_ms(status.point.saturating_sub(delay_ticks.into())) {
                for (joint, due) in sample.joints.iter_mut().zip(due.position) {
                    joint.error = due - joint.position;
                }
            }
        }
        sample
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Point;

    #[test]
    fn a_joint_that_does_not_answer_has_no_position() {
        let mut status =
            Status { state: ControllerState::Error.into(), can_current: 1 << 10, ..Status::default() };
        status.joints[1].position = 0.5;
        let sample = Sample::from_status(0.0, &status);
        assert!(sample.joints[2].position.is_nan() && sample.joints[2].torque.is_nan());
        assert_eq!((sample.joints[0].position, sample.joints[1].position), (0.0, 0.5));
        // The joint answers again, but its error is still latched. Its position must count as measured.
        status.joints[2].position = 0.3;
        assert!(Sample::from_status(0.0, &status).joints[2].position > 0.29);
    }

    /// The position error compares a measurement with the position that was commanded for the time of this
    /// measurement. If the commanded position for that time is unknown, the present commanded position is used.
    #[test]
    fn j62_the_error_of_a_sample_is_that_of_the_time_of_the_measurement() {
        let now = JointTelemetry {
            set_position: 0.5,
            due_position: 0.4,
            position: 0.3,
            ..JointTelemetry::default()
        };
        let sample = JointSample::from(&now);
        assert_eq!(sample.position_error(), now.position_error());
        assert!((sample.position_error() - 0.1).abs() < 1e-12);
        let old = JointSample { error: f64::NAN, ..sample };
        assert!((old.position_error() - 0.2).abs() < 1e-12);
        assert!(sample.not_measured().position_error().is_nan());
        // For a status, the commanded position is taken from the path.
        let point =
            |q: f64, v: f64| Point { position: [q; JOINTS], velocity: [v; JOINTS], ..Point::default() };
        let points = (0..=10).map(|k| point(0.05 * f64::from(k), 0.5)).collect();
        let path = Trajectory { points, step_ms: 100 };
        let mut status = Status { state: ControllerState::Operate.into(), point: 400, ..Status::default() };
        status.joints[2].position = 0.2;
        for delay in [0, 2, 7] {
            let due = path.at_ms(400 - u32::from(delay)).expect("on the path").position[2];
            let error = Sample::following(0.0, &status, &path, delay).joints[2].position_error();
            assert!((error - (due - f64::from(0.2f32))).abs() < 1e-12, "{delay}: {error}");
        }
        let first =
            Sample::following(0.0, &Status { point: 1, ..status }, &path, 7).joints[2].position_error();
        assert!(first.is_finite(), "before the path it stands at its first point");
    }
}
