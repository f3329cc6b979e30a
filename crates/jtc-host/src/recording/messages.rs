//! Messages about an arm, with ROS 2 schemas and CDR encoding. Recordings contain these messages, and the live display sends them to
//! viewers.

use super::cdr::Encoder;
use super::frames::Frames;
use super::{RecordingInfo, schema};
use crate::Arm;
use crate::sample::{JointSample, Sample};

pub(super) const STATES_TOPIC: &str = "/joint_states";
pub(super) const COMMANDS_TOPIC: &str = "/joint_commands";
pub(super) const CONTROL_TOPIC: &str = "/jtc/control";
pub(super) const STATE_TOPIC: &str = "/jtc/state";
/// Topic of the arm's robot description.
pub(super) const DESCRIPTION_TOPIC: &str = "/robot_description";
/// Topic of the poses of the links.
pub(super) const TRANSFORMS_TOPIC: &str = "/tf";

/// Topic of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// Measured joint values: positions (rad), velocities (rad/s), torques (N·m).
    States,
    /// Commanded joint values.
    Commands,
    /// Torque parts of the control law.
    Control,
    /// Controller state, error words and point index of the trajectory.
    State,
    /// Robot description (URDF) of the arm. The description does not change during a run.
    Description,
    /// Poses of the arm's links.
    Transforms,
}

impl Topic {
    /// All topics.
    pub const ALL: [Self; 6] =
        [Self::States, Self::Commands, Self::Control, Self::State, Self::Description, Self::Transforms];

    /// Returns the name of the topic.
    pub fn name(self) -> &'static str {
        match self {
            Self::States => STATES_TOPIC,
            Self::Commands => COMMANDS_TOPIC,
            Self::Control => CONTROL_TOPIC,
            Self::State => STATE_TOPIC,
            Self::Description => DESCRIPTION_TOPIC,
            Self::Transforms => TRANSFORMS_TOPIC,
        }
    }

    /// Returns the name and text of the schema, a message definition of ROS 2 (`ros2msg`).
    pub fn schema(self) -> (&'static str, &'static str) {
        match self {
            Self::States | Self::Commands => (schema::JOINT_STATE, schema::JOINT_STATE_TEXT),
            Self::Control => (schema::CONTROL, schema::CONTROL_TEXT),
            Self::State => (schema::STATE, schema::STATE_TEXT),
            Self::Description => (schema::STRING, schema::STRING_TEXT),
            Self::Transforms => (schema::TRANSFORMS, schema::TRANSFORMS_TEXT),
        }
    }
}

/// Writes a `sensor_msgs/msg/JointState`.
pub(super) fn joints(
    cdr: &mut Encoder,
    stamp_ns: u64,
    names: &[String],
    [position, velocity, effort]: [[f64; 6]; 3],
) {
    cdr.start().header(stamp_ns, "").u32(names.len() as u32);
    for name in names {
        cdr.string(name);
    }
    cdr.f64s(position).f64s(velocity).f64s(effort);
}

/// Returns the measured positions, velocities and torques.
pub(super) fn measured(j: &[JointSample; 6]) -> [[f64; 6]; 3] {
    [j.map(|j| j.position), j.map(|j| j.velocity), j.map(|j| j.torque)]
}

/// Returns the commanded values. The effort contains only the torque of the arm model, and not the feedback torque
/// and the friction compensation that the controller adds.
pub(super) fn commanded(j: &[JointSample; 6]) -> [[f64; 6]; 3] {
    [j.map(|j| j.set_position), j.map(|j| j.set_velocity), j.map(|j| j.torque_model)]
}

/// Writes the torque parts of the control law.
pub(super) fn control(cdr: &mut Encoder, stamp_ns: u64, j: &[JointSample; 6]) {
    cdr.start()
        .header(stamp_ns, "")
        .array(j.map(|j| j.position_error()))
        .array(j.map(|j| j.set_acceleration))
        .array(j.map(|j| j.torque_model))
        .array(j.map(|j| j.torque_p))
        .array(j.map(|j| j.torque_i))
        .array(j.map(|j| j.torque_d))
        .array(j.map(|j| j.torque_friction))
        .array(j.map(|j| j.torque))
        .array(j.map(|j| j.temperature));
}

/// Writes the states, the error words and the point index.
pub(super) fn state(cdr: &mut Encoder, stamp_ns: u64, s: &Sample) {
    cdr.start()
        .header(stamp_ns, "")
        .u8(s.state.byte())
        .u8(s.trajectory.byte())
        .u32(s.point)
        .u16(s.errors)
        .u32(s.can_current);
    for joint in &s.joints {
        cdr.u8(joint.state.code());
    }
    for joint in &s.joints {
        cdr.u16(joint.internal);
    }
}

/// Writer of messages about an arm.
pub struct MessageWriter {
    names: Vec<String>,
    description: String,
    frames: Frames,
    cdr: Encoder,
}

impl MessageWriter {
    /// Creates a writer for this arm.
    pub fn new(arm: &Arm) -> Self {
        let info = RecordingInfo::of(arm);
        Self {
            names: (0..6).map(|j| info.joint_name(j)).collect(),
            description: arm.to_urdf(),
            frames: Frames::of(&info),
            cdr: Encoder::default(),
        }
    }

    /// Returns the message of `topic` for a sample at the time `stamp_ns` (ns since 1970). Returns `None` if the sample has no data for the
    /// topic, or if transforms were already written in the same interval of 20 ms.
    pub fn write(&mut self, topic: Topic, stamp_ns: u64, sample: &Sample) -> Option<&[u8]> {
        let (cdr, j) = (&mut self.cdr, &sample.joints);
        match topic {
            Topic::States => joints(cdr, stamp_ns, &self.names, measured(j)),
            Topic::Commands if j.iter().all(|j| j.set_position.is_nan()) => return None,
            Topic::Commands => joints(cdr, stamp_ns, &self.names, commanded(j)),
            Topic::Control => control(cdr, stamp_ns, j),
            Topic::State => state(cdr, stamp_ns, sample),
            Topic::Description => {
                cdr.start().string(&self.description);
            }
            Topic::Transforms => {
                self.frames.write(cdr, stamp_ns, sample)?;
            }
        }
        Some(self.cdr.bytes())
    }
}
