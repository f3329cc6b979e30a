//! Header of a recording: the arm, its limits, and the source of the samples.

use std::sync::Arc;

use jtc_core::{JOINTS, PidGains};
use jtc_wire::Info;

use crate::{Arm, Trajectory};

/// Name and limits of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct JointInfo {
    /// Name as in the arm file.
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
    /// Origin of the joint in its parent's frame: x, y, z in m, then roll, pitch, yaw in rad.
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

/// How the recorded run ended. Empty if the recording does not contain it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ending {
    /// `finished`, `stopped` or `fault`.
    pub outcome: String,
    /// Reason why the run did not reach its end, as text.
    pub reason: String,
    /// Number of samples lost because the disk was too slow.
    pub lost_samples: u64,
}

impl Ending {
    /// Returns `true` if the run failed.
    pub fn is_fault(&self) -> bool {
        self.outcome == "fault"
    }
}

/// Identity of the device that the samples come from.
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

/// Source and context of the samples.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingInfo {
    /// Name of the arm.
    pub arm: String,
    /// "simulator", or the serial port.
    pub source: String,
    /// Client that commanded the motion, if several clients share the line. Otherwise empty.
    pub commanded_by: String,
    /// Name of the trajectory.
    pub trajectory: String,
    /// Wall-clock time of sample time 0, ns since 1970; 0 for a recording in virtual time.
    pub start_unix_ns: u64,
    /// Joints, base to wrist.
    pub joints: [JointInfo; 6],
    /// Origin of the flange in the last joint's frame, as in [`JointInfo::origin`].
    pub flange: [f64; 6],
    /// Robot description (URDF) of the arm, in MCAP files. If it is present, the file also contains the poses of the links.
    pub description: Option<Arc<str>>,
    /// Gains, base to wrist, in MCAP files.
    pub gains: Option<[PidGains; JOINTS]>,
    /// Hash of all parameters that determine the arm's motion (J-52), in MCAP files.
    pub hash: Option<u64>,
    /// Controller, in MCAP files; `None` if it did not report its identity.
    pub device: Option<DeviceIdentity>,
    /// End of the run.
    pub ending: Ending,
    /// Complete trajectory of the run, in MCAP files. The trajectory is needed to resume an interrupted run.
    pub commanded: Option<Arc<Trajectory>>,
    /// Number of runs that the user requested, including the first, in MCAP files. `None` if not recorded.
    pub runs: Option<u32>,
    /// Trajectory of all runs except the first, if it differs from `commanded`. The first run was then the remainder of a
    /// run.
    pub then: Option<Arc<Trajectory>>,
}

impl RecordingInfo {
    /// Returns names, limits, gains and frames of an arm. Source, trajectory, start time and ending are empty.
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
            // Without an image of the arm, the hash is unknown.
            hash: arm.hash().ok().flatten(),
            ..Self::default()
        }
    }

    /// Returns the name of joint `j`, or `joint_1` and so on if it has none.
    pub fn joint_name(&self, j: usize) -> String {
        match self.joints.get(j) {
            Some(joint) if !joint.name.is_empty() => joint.name.clone(),
            _ => format!("joint_{}", j + 1),
        }
    }
}
