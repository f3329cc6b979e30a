//! Header of a recording, with the arm, the limits, and the source of the samples.

use std::sync::Arc;

use jtc_core::{JOINTS, PidGains};
use jtc_wire::Info;

use crate::{Arm, Trajectory};

/// Name and limits of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct JointInfo {
    /// Name of the joint as in the arm file.
    pub name: String,
    /// Minimum position, rad.
    pub position_min_rad: f64,
    /// Maximum position, rad.
    pub position_max_rad: f64,
    /// Maximum speed, rad/s.
    pub velocity_max_rad_s: f64,
    /// Maximum torque, N·m.
    pub torque_max_nm: f64,
    /// Maximum tracking error, rad.
    pub position_error_max_rad: f64,
    /// Origin of the joint in the parent frame: x, y, z in m, followed by roll, pitch, yaw in rad.
    pub origin: [f64; 6],
}

impl Default for JointInfo {
    fn default() -> Self {
        Self {
            name: String::new(),
            position_min_rad: f64::NAN,
            position_max_rad: f64::NAN,
            velocity_max_rad_s: f64::NAN,
            torque_max_nm: f64::NAN,
            position_error_max_rad: f64::NAN,
            origin: [0.0; 6],
        }
    }
}

/// Reason for the end of the recorded run. The fields are empty if the recording does not contain the reason.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ending {
    /// Result of the run: `finished`, `stopped` or `fault`.
    pub outcome: String,
    /// Text with the reason why the run did not reach its end.
    pub reason: String,
    /// Number of samples that were lost because the disk was too slow.
    pub lost_samples: u64,
}

impl Ending {
    /// Returns `true` if the run failed.
    pub fn is_fault(&self) -> bool {
        self.outcome == "fault"
    }
}

/// Identity of the device that sent the samples.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceIdentity {
    /// Board.
    pub board: String,
    /// Version of the firmware.
    pub firmware: String,
    /// Git revision of the firmware.
    pub revision: String,
}

impl From<&Info> for DeviceIdentity {
    fn from(info: &Info) -> Self {
        Self {
            board: info.board.to_string(),
            firmware: info.firmware().to_owned(),
            revision: info.revision().to_owned(),
        }
    }
}

/// Source of the samples, and data about the arm and the run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingInfo {
    /// Name of the arm.
    pub arm: String,
    /// Source of the samples: "simulator", or the name of the serial port.
    pub source: String,
    /// Name of the client that commanded the motion, if several clients share the line; otherwise empty.
    pub commanded_by: String,
    /// Name of the trajectory.
    pub trajectory: String,
    /// Wall-clock time of sample time 0, ns since 1970; 0 for a recording in virtual time.
    pub start_unix_ns: u64,
    /// Names and limits of the joints, base to wrist.
    pub joints: [JointInfo; 6],
    /// Origin of the flange in the frame of the last joint, as in [`JointInfo::origin`].
    pub flange: [f64; 6],
    /// Robot description (URDF) of the arm; only in MCAP files. If the file contains the description, it also contains the poses of the
    /// links.
    pub description: Option<Arc<str>>,
    /// Gains of the joints, base to wrist; only in MCAP files.
    pub gains: Option<[PidGains; JOINTS]>,
    /// Hash of all parameters that determine the arm's motion (J-52); only in MCAP files.
    pub hash: Option<u64>,
    /// Identity of the controller, only in MCAP files; `None` if the controller did not report its identity.
    pub device: Option<DeviceIdentity>,
    /// Reason for the end of the run.
    pub ending: Ending,
    /// Complete trajectory of the run; only in MCAP files. The trajectory is necessary to resume an interrupted run.
    pub commanded: Option<Arc<Trajectory>>,
    /// Number of runs that the user requested, including the first run; only in MCAP files. `None` if the number was not recorded.
    pub runs: Option<u32>,
    /// Trajectory of all runs after the first run, if it differs from `commanded`. In this case, the first run was
    /// the remainder of an interrupted run.
    pub then: Option<Arc<Trajectory>>,
}

impl RecordingInfo {
    /// Returns the header with the names, limits, gains and frames of an arm. The source, trajectory, start time and ending stay empty.
    pub fn of(arm: &Arm) -> Self {
        let origin = |i: usize| {
            let o = &arm.model.joints[i];
            [o.xyz[0], o.xyz[1], o.xyz[2], o.rpy[0], o.rpy[1], o.rpy[2]]
        };
        Self {
            arm: arm.name.clone(),
            joints: std::array::from_fn(|j| JointInfo {
                name: arm.joint_names[j].clone(),
                position_min_rad: arm.joints[j].position_min,
                position_max_rad: arm.joints[j].position_max,
                velocity_max_rad_s: arm.joints[j].velocity_max,
                torque_max_nm: arm.joints[j].torque_max,
                position_error_max_rad: arm.joints[j].position_error_max,
                origin: origin(j),
            }),
            flange: origin(6),
            description: Some(arm.to_urdf().into()),
            gains: arm.pid,
            // Without gains or friction, the arm has no binary image and no hash.
            hash: arm.hash().ok().flatten(),
            ..Self::default()
        }
    }

    /// Returns the name of joint `j`, or `joint_1` and so on if the joint does not have a name.
    pub fn joint_name(&self, j: usize) -> String {
        match self.joints.get(j) {
            Some(joint) if !joint.name.is_empty() => joint.name.clone(),
            _ => format!("joint_{}", j + 1),
        }
    }
}
