//! Settings of the controller.
pub(crate) mod bounds;
pub(crate) mod defaults;
pub(crate) mod limits;

use jtc_bus::{TORQUE_FULL_SCALE, config};
use jtc_dynamics::Payload;

use crate::JOINTS;
use crate::config::bounds::ParameterBounds;
use crate::config::limits::JointConfig;

/// Half of the drives' working area, in rad from zero in each direction (J-43).
pub const WORKING_AREA: f64 = 2.9905;

/// Settings of the controller device. A host reads and changes the settings that the table in [`crate::settings`] lists (J-53).
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Settings of each joint, from base to wrist.
    pub joints: [JointConfig; JOINTS],
    /// Acceleration of gravity in the base frame, m/s².
    pub gravity: [f64; 3],
    /// `true` if a gripper is on the bus (J-20).
    pub gripper: bool,
    /// Behaviour of the gripper when the arm loses its torque, in Error and in Init. If `true`, the controller switches the pump off until
    /// the host switches it on again. The gripper then changes to ReadyToOperate, so it drops the workpiece. If `false`, an enabled gripper
    /// stays enabled and the pump command does not change, so the gripper keeps the workpiece.
    pub pump_off_on_error: bool,
    /// Full-scale value of the velocity of the drives, rad/s (J-11).
    pub velocity_full_scale: f64,
    /// Speed at which the drives report an error and stop if configuration bit 0x10 is set, rad/s (J-35).
    pub drive_speed_trip: f64,
    /// Time over which the drives average their speed, ms. The controller compares the change of the position with the reported speed over
    /// this time (J-35). With a time of 0, the controller does not make this comparison.
    pub drive_speed_window_ms: u8,
    /// Torque that twists a gear by 1 rad, N·m/rad. Because of this elastic twist, the position of the motor side of
    /// a gear can differ from the position of the joint side (J-35).
    pub gear_stiffness: f64,
    /// Resolution of the joint encoders, rad. The encoders of the known drives have 16 bits per revolution, which is
    /// much coarser than the resolution on the bus. While a joint is at rest with a position error within one encoder
    /// step, its integral does not change (J-41).
    pub encoder_step: f64,
    /// Delay from the measurement to the time when the resulting torque takes effect, in ticks (J-62). The highest allowed delay is 7. The
    /// drives have a control loop of 1 ms, in which they read the encoder and apply the torque. A drive can receive a Move frame between
    /// two of its loops. The drive answers with the encoder value of the first loop, and applies the torque in the second loop. The
    /// controller uses this answer in its next tick, and the Move frame of that tick takes effect in the third loop. The torque therefore
    /// takes effect two loops of the drive after the encoder was read, for any phase between these loops and the ticks of the controller.
    /// An arm with a slower bus, or with drives that filter their positions, has a longer delay. With a delay of 0, measurements are
    /// compared with the set values of the same tick.
    pub delay_ticks: u8,
    /// Configuration bits that the controller sends to every joint (J-11).
    pub joint_config_bits: u8,
    /// Configuration bits that the controller sends to the gripper (J-11).
    pub gripper_config_bits: u8,
    /// Ticks between two statuses that contain no response record (J-04).
    pub status_period_ms: u16,
    /// Number of consecutive Moves without an answer or an acknowledgement after which the controller raises an error
    /// (J-14). A joint that gives no usable answer to this number of consecutive Moves also causes an error (J-35).
    /// As long as fewer answers are missing, the controller predicts the motion of the joint (J-63).
    pub missed_moves_max: u8,
    /// Time for which a node may be silent after its reset without an error, ms.
    pub node_boot_ms: u32,
    /// Longest time that the drives may take to change from READY to ENABLE, ms (J-16). The controller measures this
    /// time while it requests the drives to enable.
    pub enable_timeout_ms: u32,
    /// Highest speed at which the controller enables the joints, rad/s (J-16). The joints are enabled only after
    /// every joint has been slower than this speed for `enable_still_ms`. Otherwise, enabling would stop a falling
    /// arm abruptly.
    pub enable_speed_max: f64,
    /// Time for which every joint must have been slower than `enable_speed_max`, ms.
    pub enable_still_ms: u16,
    /// Time after the torque was switched off in which the controller does not enable the joints, ms. The motor
    /// control of the drives pauses for this time after a stop. If the controller requested enabling earlier, the
    /// drives would enable only after this pause, and the arm might already be falling.
    pub enable_rest_ms: u16,
    /// Largest distance of each joint from the first point at which Execute is accepted, rad (J-34).
    pub start_tolerance_rad: f64,
    /// Duration of the ramp of path time for pause, stop and resume, ms (J-33). The ramp is longer if the acceleration or torque limits
    /// require it.
    pub ramp_ms: u16,
    /// Over-speed threshold as a multiple of the velocity limit of the joint (J-35). If the measured speed is above
    /// this threshold while the torque is on, the controller raises an error.
    pub overspeed_factor: f64,
    /// Time for which a joint may exceed the over-speed threshold before the controller raises an error, ms.
    pub overspeed_ms: u16,
    /// Longest duration of a pause or stop if the torque limits allow it, ms (J-33).
    pub stop_ms: u16,
    /// Time for which a pause or stop may brake with all available torque, ms. If the arm still moves after this
    /// time, the controller treats the moving joints as overloaded, and each of them lowers its load (J-33, J-70).
    pub braking_ms_max: u16,
    /// Torque of a yielding joint against a slow push, as a share of its torque limit (J-68). A feedback torque above
    /// this share counts as a push (J-66).
    pub yield_torque_share: f64,
    /// Time in which a computed torque may exceed its limit before the joint is overloaded, in ms within any 100 ms
    /// (J-43). During this time, the controller commands the torque limit, and the integral does not change. With a
    /// time of 0, the joint is overloaded in the first tick with a torque above its limit.
    ///
    /// For comparison: a single missing point in a recorded trajectory causes a torque peak of only a few
    /// milliseconds.
    pub torque_over_ms: u16,
    /// If `true`, an overloaded joint makes the controller switch the torque of the arm off, as the manual describes. If `false`, the
    /// controller reacts as described in J-66 (J-43).
    pub torque_release: bool,
    /// `true` if a held stop ends only when the host has cleared it (J-69).
    pub protective_stop_latches: bool,
    /// Longest time after a joint was enabled for which its torque may stay at the limit without an overload, ms
    /// (J-43). A joint that was just enabled can carry a load that the controller does not know. The joint then needs
    /// its full torque until this load has come to rest.
    pub catch_ms_max: u16,
    /// Time over which the controller blends out a torque step at a change of state, ms (J-25, J-44).
    pub blend_ms: u16,
    /// Highest torque that Teaching and the friction of a joint together oppose to a push at standstill, as a share
    /// of the torque limit (J-25).
    pub teach_stiction: f64,
    /// Share of the joints' Coulomb friction that Teaching compensates (J-25).
    pub teach_friction: f64,
    /// Highest speed of the flange in a jog, m/s (J-58). In Teaching, the damping increases above this speed, up to its full value at twice
    /// this speed (J-25). With a limit of 0, the controller does not limit the speed of the flange.
    pub tool_speed_max: f64,
    /// Time, ms, that a motion has for stopping after the safety input has become 0 (J-22). Then the controller
    /// switches the torque off. With a time of 0, the controller switches the torque off at once.
    pub safety_input_ramp_ms: u16,
    /// Range of speeds around zero in which the sign of the friction polynomial is smoothed, rad/s (J-42).
    pub friction_sign_width: f64,
    /// Time without a valid frame from any host after which a motion is paused and teaching ends, ms (J-59). With a time of 0, host
    /// supervision is off.
    pub host_timeout_ms: u16,
    /// Speed override (0.05 to 1), in seconds of path time per second (J-57). The speed override is not part of an arm file.
    pub speed: f64,
    /// Joints that the host has declared absent, for tests on a bench (J-53). The controller does not expect nodes for absent joints. While
    /// a joint is declared absent, the controller does not execute a trajectory. The list of absent joints is not part of an arm file, and
    /// no joint is declared absent at the start of the device.
    pub absent: [bool; JOINTS],
    /// Position of each absent joint in the model, rad.
    pub absent_position: [f64; JOINTS],
    /// Payload at the flange of the arm (J-60). The payload is not part of an arm file, and the device starts without a payload.
    pub payload: Payload,
    /// Bounds of gains, masses and friction that a host may send (J-06).
    pub parameter_bounds: ParameterBounds,
}

impl Config {
    /// Returns the lowest and highest position (rad) that may be commanded for the joint with index `joint`. These
    /// are the position limits of the joint. If the drives limit their motion to their working area, the range is
    /// reduced to this area (J-43). If `joint` is not a valid index, the range is empty.
    pub fn position_range(&self, joint: usize) -> (f64, f64) {
        let Some(limit) = self.joints.get(joint) else { return (f64::INFINITY, f64::NEG_INFINITY) };
        let (low, high) = (limit.position_min, limit.position_max);
        if self.keeps_to_working_area() {
            (low.max(-WORKING_AREA), high.min(WORKING_AREA))
        } else {
            (low, high)
        }
    }

    /// Returns `true` if the drives are configured to limit their motion to the working area.
    pub(crate) const fn keeps_to_working_area(&self) -> bool {
        self.joint_config_bits & config::WORKING_AREA != 0
    }
}

/// Reason why the controller refuses settings, for example because the drives do not support the limits.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ConfigError {
    /// A position limit of a joint is outside the working area of the drives (J-43).
    Position {
        /// Number of the joint, from 1.
        joint: usize,
        /// Position limit, rad.
        value: f64,
        /// Half of the working area, rad.
        limit: f64,
    },
    /// The lowest position of a joint is not below its highest position.
    Range {
        /// Number of the joint, from 1.
        joint: usize,
        /// Lowest position, rad.
        value: f64,
        /// Highest position, rad.
        limit: f64,
    },
    /// The time for braking is shorter than a pause or stop may take (J-33).
    Braking {
        /// Value of [`Config::braking_ms_max`], ms.
        value: u16,
        /// Twice the value of [`Config::stop_ms`], ms.
        limit: u32,
    },
    /// The torque limit times the torque gain (J-61) is above the full scale of the bus.
    TorqueScale {
        /// Number of the joint, from 1.
        joint: usize,
        /// Torque limit times torque gain, N·m.
        value: f64,
        /// Full scale of the bus, N·m.
        limit: f64,
    },
    /// The over-speed threshold (J-35) is above the highest speed that the drives can report.
    SpeedScale {
        /// Number of the joint, from 1.
        joint: usize,
        /// The velocity limit times [`Config::overspeed_factor`], rad/s.
        value: f64,
        /// Full-scale value of the velocity of the drives, rad/s.
        limit: f64,
    },
    /// The over-speed threshold (J-35) is above the speed at which the drives trip.
    SpeedTrip {
        /// Number of the joint, from 1.
        joint: usize,
        /// The velocity limit times [`Config::overspeed_factor`], rad/s.
        value: f64,
        /// Speed at which the drives trip, rad/s.
        limit: f64,
    },
}

impl ConfigError {
    /// Returns the number of the joint with the error, counted from 1, or 0 for the whole arm.
    pub const fn joint(&self) -> usize {
        match *self {
            Self::Braking { .. } => 0,
            Self::Position { joint, .. }
            | Self::Range { joint, .. }
            | Self::TorqueScale { joint, .. }
            | Self::SpeedScale { joint, .. }
            | Self::SpeedTrip { joint, .. } => joint,
        }
    }
}

impl core::fmt::Display for ConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::Position { joint, value, limit } => {
                write!(
                    f,
                    "joint {joint}: position limit {value} rad is outside the drives' working area, ±{limit} rad"
                )
            }
            Self::Range { joint, value, limit } => {
                write!(
                    f,
                    "joint {joint}: lowest position {value} rad is not below the highest position, {limit} rad"
                )
            }
            Self::Braking { value, limit } => write!(
                f,
                "braking_ms_max {value} is below twice stop_ms, {limit}: a Stop would end in an error before the arm is at rest"
            ),
            Self::TorqueScale { joint, value, limit } => write!(
                f,
                "joint {joint}: torque limit times torque gain is {value} N·m, but the bus transmits {limit} N·m at most"
            ),
            Self::SpeedScale { joint, value, limit } => write!(
                f,
                "joint {joint}: over-speed is an error above {value:.3} rad/s (1.2 times the velocity limit, unless set \
                 otherwise), but the drives report {limit} rad/s at most"
            ),
            Self::SpeedTrip { joint, value, limit } => write!(
                f,
                "joint {joint}: over-speed is an error above {value:.3} rad/s (1.2 times the velocity limit, unless set \
                 otherwise), but the drives trip at {limit} rad/s"
            ),
        }
    }
}

impl core::error::Error for ConfigError {}

impl Config {
    /// Checks that the drives support the limits of the joints (J-35, J-43). Position limits must be inside the working area. The drives
    /// must be able to report the over-speed threshold, and must not trip below this threshold.
    ///
    /// # Errors
    /// Returns an error for the first joint whose limits the drives do not support. A limit that is NaN is also refused.
    #[allow(clippy::neg_cmp_op_on_partial_ord)]
    pub const fn check(&self) -> Result<(), ConfigError> {
        let (value, limit) = (self.braking_ms_max, 2 * self.stop_ms as u32);
        if (value as u32) < limit {
            return Err(ConfigError::Braking { value, limit });
        }
        let mut j = 0;
        while j < JOINTS {
            let limits = &self.joints[j];
            j += 1;
            let joint = j;
            // The comparisons also reject NaN.
            if self.keeps_to_working_area() {
                if !(limits.position_min >= -WORKING_AREA) {
                    return Err(ConfigError::Position {
                        joint,
                        value: limits.position_min,
                        limit: WORKING_AREA,
                    });
                }
                if !(limits.position_max <= WORKING_AREA) {
                    return Err(ConfigError::Position {
                        joint,
                        value: limits.position_max,
                        limit: WORKING_AREA,
                    });
                }
            }
            if !(limits.position_min < limits.position_max) {
                let (value, limit) = (limits.position_min, limits.position_max);
                return Err(ConfigError::Range { joint, value, limit });
            }
            let value = limits.torque_max * limits.torque_gain;
            if !(value <= TORQUE_FULL_SCALE) {
                return Err(ConfigError::TorqueScale { joint, value, limit: TORQUE_FULL_SCALE });
            }
            let value = self.overspeed_factor * limits.velocity_max;
            let (scale, trip) = (self.velocity_full_scale, self.drive_speed_trip);
            if !(value <= scale) {
                return Err(ConfigError::SpeedScale { joint, value, limit: scale });
            }
            if self.joint_config_bits & config::OVER_SPEED_TRIP != 0 && !(value <= trip) {
                return Err(ConfigError::SpeedTrip { joint, value, limit: trip });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j43_positions_stay_inside_the_working_area_while_the_drives_keep_to_it() {
        let mut config = Config::avena();
        config.joints[0].position_min = -3.05;
        config.joints[0].position_max = 1.2;
        assert_eq!(config.position_range(0), (-WORKING_AREA, 1.2));
        config.joint_config_bits &= !jtc_bus::config::WORKING_AREA;
        assert_eq!(config.position_range(0), (-3.05, 1.2));
        let (low, high) = config.position_range(JOINTS);
        assert!(low > high, "no such joint: no position");
    }
}
