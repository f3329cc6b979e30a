//! The description that a recording carries: the arm, its limits, where the samples come from.

use std::sync::Arc;

use jtc_core::{JOINTS, PidGains};
use jtc_wire::Info;

use crate::{Arm, Trajectory};

/// One joint's name and limits.
#[derive(Clone, Debug, PartialEq)]
pub struct JointInfo {
    /// As in the arm file.
    pub name: String,
    /// Lowest position, rad.
    pub position_min_rad: f64,
    /// Highest position, rad.
    pub position_max_rad: f64,
    /// Highest speed, rad/s.
    pub velocity_max_rad_s: f64,
    /// Highest torque, N·m.
    pub torque_max_nm: f64,
    /// Largest tracking error, rad.
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

/// How the run ended that a recording is of; empty where nobody wrote it down.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ending {
    /// `finished`, `stopped` or `fault`.
    pub outcome: String,
    /// Why it did not come to its end, in words.
    pub reason: String,
    /// Samples that the disk did not take in time.
    pub lost_samples: u64,
}

impl Ending {
    /// The run failed.
    pub fn is_fault(&self) -> bool {
        self.outcome == "fault"
    }
}

/// The device that samples come from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DeviceIdentity {
    /// The board.
    pub board: String,
    /// Version of its firmware.
    pub firmware: String,
    /// Its git revision.
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

/// Where samples come from and what they belong to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingInfo {
    /// Name of the arm.
    pub arm: String,
    /// "simulator", or the serial port.
    pub source: String,
    /// Who commanded the motion, where several may; empty otherwise.
    pub commanded_by: String,
    /// Name of the trajectory.
    pub trajectory: String,
    /// Wall-clock time of sample time 0, ns since 1970; 0 when virtual time was recorded.
    pub start_unix_ns: u64,
    /// Base to wrist.
    pub joints: [JointInfo; 6],
    /// Origin of the flange in the last joint's frame, as in [`JointInfo::origin`].
    pub flange: [f64; 6],
    /// The arm as a robot description (URDF), in MCAP files: with it they hold where each link is, too.
    pub description: Option<Arc<str>>,
    /// Gains, base to wrist, in MCAP files.
    pub gains: Option<[PidGains; JOINTS]>,
    /// Hash of all that decides how the arm moves (J-52), in MCAP files.
    pub hash: Option<u64>,
    /// The controller, in MCAP files; `None` where it did not report what it is.
    pub device: Option<DeviceIdentity>,
    /// How the run ended.
    pub ending: Ending,
    /// The whole trajectory that the run is of, in MCAP files: what is needed to go on where it was broken off.
    pub commanded: Option<Arc<Trajectory>>,
    /// How often a motion was to be run, the first one included, in MCAP files; `None` where nobody wrote it down.
    pub runs: Option<u32>,
    /// What all but the first are runs of, where that is not `commanded`: the first one was the rest of a run.
    pub then: Option<Arc<Trajectory>>,
}

impl RecordingInfo {
    /// Names, limits, gains and frames of an arm; source, trajectory, start time and ending are left empty.
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
            // One that has no image has none.
            hash: arm.hash().ok().flatten(),
            ..Self::default()
        }
    }

    /// The name of joint `j`, `joint_1` and so on when it has none.
    pub fn joint_name(&self, j: usize) -> String {
        match self.joints.get(j) {
            Some(joint) if !joint.name.is_empty() => joint.name.clone(),
            _ => format!("joint_{}", j + 1),
        }
    }
}
