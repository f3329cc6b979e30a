//! Values that a tick has computed, for recordings and for tests.
use jtc_bus::NodeState;

use crate::bit_codec::bit_codec;
use crate::{ControllerState, JOINTS, TrajectoryState};

/// Telemetry of one joint in one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointTelemetry {
    /// Commanded position of the joint, rad.
    pub set_position: f64,
    /// Commanded velocity of the joint, rad/s.
    pub set_velocity: f64,
    /// Commanded acceleration of the joint, rad/s².
    pub set_acceleration: f64,
    /// Position that was commanded for the time of the measurement, rad. The control law compares the measurement with this position
    /// (J-62).
    pub due_position: f64,
    /// Measured position of the joint, rad.
    pub position: f64,
    /// Measured velocity of the joint, rad/s.
    pub velocity: f64,
    /// `true` if position and velocity were measured for this tick. If `false`, position and velocity are predicted (J-63).
    pub fresh: bool,
    /// Bearing temperature, °C.
    pub temperature: f64,
    /// Model torque (inverse dynamics and rotor), N·m.
    pub torque_model: f64,
    /// Proportional part of the torque, N·m.
    pub torque_p: f64,
    /// Integral part of the torque, N·m.
    pub torque_i: f64,
    /// Derivative part of the torque, N·m.
    pub torque_d: f64,
    /// Torque of the friction compensation, N·m.
    pub torque_friction: f64,
    /// Torque that blends out a step at a change of state, plus the load torque and the braking torque of Teaching, N·m.
    pub torque_other: f64,
    /// Commanded torque at the joint, N·m. The Move frame contains this torque multiplied by the torque gain (J-61).
    pub torque: f64,
    /// State of the drive.
    pub state: NodeState,
    /// Internal error word of the joint.
    pub internal: u16,
}

impl JointTelemetry {
    /// Returns the position error, rad. The position error is the position that was commanded for the time of the measurement, minus the
    /// measured position.
    pub fn position_error(&self) -> f64 {
        self.due_position - self.position
    }
}

/// Telemetry of one tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Telemetry {
    /// Number of ticks since the start of the device.
    pub tick: u64,
    /// Controller state in this tick.
    pub state: ControllerState,
    /// Execution state of the trajectory.
    pub trajectory: TrajectoryState,
    /// Index of the present point of the trajectory, counted as if the points were 1 ms apart.
    pub point: u32,
    /// `true` if a pause or stop brakes with all available torque (J-33).
    pub braking: bool,
    /// Current error word of the controller.
    pub errors: u16,
    /// Number of response records that were lost since the start because too many records were waiting (J-04).
    pub records_lost: u32,
    /// Telemetry of each joint.
    pub joints: [JointTelemetry; JOINTS],
}

/// Values that a tick stores only for the telemetry.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Observed {
    /// Number of ticks since the start of the device.
    pub tick: u64,
    /// Commanded torques at the joints, N·m.
    pub torque: [f64; JOINTS],
}

bit_codec!(Observed { tick, torque });

#[cfg(test)]
mod tests {
    use super::*;

    /// If the joint lags an upward motion, the position error is positive, like the proportional part of the torque.
    #[test]
    fn j41_the_position_error_is_commanded_minus_measured() {
        let joint = JointTelemetry { due_position: 0.5, position: 0.25, ..JointTelemetry::default() };
        assert_eq!(joint.position_error(), 0.25);
    }
}
