//! The cause of a held stop, and the reactions of the controller that are in progress (J-69).
use core::fmt;

use crate::bits::joint_error;
use crate::code::codes;

codes! {
    /// Kind of the cause of a held stop or of an aborted motion.
    #[derive(Default)]
    StopKind {
        /// The torque of a joint was at its limit for too long (J-43).
        #[default]
        Overload = 1, "overload";
        /// The controller detected a push on a joint by the torque against the push (J-66).
        Push = 2, "push";
        /// The position error of a joint was too large (J-43).
        PositionError = 3, "position error";
        /// A commanded position exceeded its limit.
        Position = 4, "position over limit";
        /// A commanded velocity exceeded its limit.
        Velocity = 5, "velocity over limit";
        /// A commanded acceleration exceeded its limit.
        Acceleration = 6, "acceleration over limit";
        /// The friction table contains no value for a commanded velocity (J-42).
        FrictionTable = 7, "friction table value missing";
        /// The position controller of a joint is unstable (J-66).
        Unstable = 8, "unstable";
        /// The measured position of a joint jumped (J-35).
        EncoderJump = 9, "encoder jump";
        /// The position and the speed that a drive reports do not match: they differ by a factor (J-35).
        SpeedScale = 10, "speed scale";
        /// After the wait for the drives, the arm was too far from the path, or the torque limits left too little torque for the approach
        /// (J-34).
        Approach = 11, "approach";
        /// The controller received new gains while the joints had torque, and could not hold a joint with these gains. The controller uses
        /// the earlier gains again (J-71).
        Gains = 12, "gains";
        /// The controller detected a push on a joint by the joint speed before it detected the push by the torque (J-66).
        Shove = 13, "shove";
    }
}

/// Cause of a held stop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StopCause {
    /// Kind of the cause.
    pub kind: StopKind,
    /// Number of the first affected joint, from 1; 0 if the cause does not belong to a joint.
    pub joint: u8,
    /// Measured or commanded value that caused the stop. The unit of the value depends on the kind of the stop: N·m, rad, rad/s or rad/s².
    /// For [`StopKind::SpeedScale`] the value is a factor.
    pub value: f32,
    /// Limit of the value; 0 if the value has no limit.
    pub limit: f32,
}

impl StopKind {
    /// Returns the unit of the value and the limit; empty if the value has no unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Overload | Self::Push | Self::Unstable => "N·m",
            Self::PositionError | Self::Position | Self::EncoderJump => "rad",
            Self::Velocity | Self::FrictionTable | Self::Shove => "rad/s",
            Self::Acceleration => "rad/s²",
            Self::SpeedScale | Self::Approach | Self::Gains => "",
        }
    }

    /// Returns the kind for joint errors that show a violated limit of the path. If several limits are violated, the
    /// order is position, velocity, acceleration, friction table. The caller determines the kind for position errors
    /// and torque errors.
    pub const fn of_limit(joint_error: u16) -> Self {
        if joint_error & joint_error::POSITION != 0 {
            Self::Position
        } else if joint_error & joint_error::VELOCITY != 0 {
            Self::Velocity
        } else if joint_error & joint_error::ACCELERATION != 0 {
            Self::Acceleration
        } else {
            Self::FrictionTable
        }
    }
}

impl fmt::Display for StopCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, joint, value, limit } = *self;
        let unit = kind.unit();
        match kind {
            StopKind::Overload => write!(f, "joint {joint} needed {:.1} {unit}, limit {limit:.1} {unit}", value.abs()),
            StopKind::Shove => write!(
                f,
                "joint {joint} was pushed: it moved {:.2} {unit} faster than commanded, limit {limit:.2} {unit}",
                value.abs()
            ),
            StopKind::Push => write!(
                f,
                "joint {joint} was pushed: the controller held {:.1} {unit} against the push, limit {limit:.1} {unit}",
                value.abs()
            ),
            StopKind::PositionError => write!(
                f,
                "joint {joint} was {:.3} {unit} from its commanded position, limit {limit:.3} {unit}",
                value.abs()
            ),
            StopKind::Position | StopKind::Velocity | StopKind::Acceleration => {
                write!(f, "joint {joint}: {kind}, {value:.3} {unit}, limit {limit:.3} {unit}")
            }
            StopKind::FrictionTable => write!(f, "joint {joint}: {kind} at {value:.3} {unit}"),
            StopKind::Unstable => write!(
                f,
                "joint {joint} oscillates more and more: its gains make the position controller unstable; softer gains hold the joint now"
            ),
            StopKind::EncoderJump => write!(f, "the encoder of joint {joint} jumped by {value:.4} {unit}"),
            StopKind::SpeedScale => write!(
                f,
                "the drive of joint {joint} reports positions that change {value:.2} times as fast as the speed that it reports"
            ),
            StopKind::Gains if joint == 0 => f.write_str(
                "the arm was released during the trial of its new gains; the previous gains are in use again",
            ),
            StopKind::Gains => {
                write!(f, "joint {joint} failed the trial of its new gains; the previous gains are in use again")
            }
            StopKind::Approach => f.write_str(
                "when the drives were enabled, the arm was too far from the path, or had too little torque left to approach it",
            ),
        }
    }
}

/// Reactions of the controller that are in progress, and the cause of its last held stop (J-69).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reactions {
    /// Cause of the last held stop, and the time since the start of that stop, ms. `None` if no held stop has occurred since the start of
    /// the controller or the last ClearOccurredErrors.
    pub stop: Option<(StopCause, u32)>,
    /// Joints that yield to a push, or slowly lower a load that their torque limit cannot hold, one bit for each
    /// joint.
    pub yields: u8,
    /// Joints whose encoder has jumped since their drives were configured, one bit for each joint (J-35).
    pub jumped: u8,
    /// Rate of path time, in seconds of path time per second.
    pub rate: f32,
    /// Time for which the controller has slowed the path down during this execution, ms (J-75).
    pub held_back_ms: u32,
}

/// Length of [`Reactions`] in the wire format, bytes.
pub(super) const REACTIONS_LEN: usize = 24;

impl Reactions {
    /// Returns the bytes of the reactions in the wire format.
    pub(super) fn emit(&self) -> [u8; REACTIONS_LEN] {
        let (cause, ms) = self.stop.unwrap_or_default();
        let kind = if self.stop.is_some() { cause.kind as u8 } else { 0 };
        let mut b = [0; REACTIONS_LEN];
        b[..4].copy_from_slice(&[kind, cause.joint, self.yields, self.jumped]);
        b[4..8].copy_from_slice(&cause.value.to_be_bytes());
        b[8..12].copy_from_slice(&cause.limit.to_be_bytes());
        b[12..16].copy_from_slice(&ms.to_be_bytes());
        b[16..20].copy_from_slice(&self.rate.to_be_bytes());
        b[20..].copy_from_slice(&self.held_back_ms.to_be_bytes());
        b
    }

    /// Parses the reactions from the wire format. If this version does not know the kind of the stop, `stop` is `None`.
    pub(super) fn parse(b: &[u8; REACTIONS_LEN]) -> Self {
        let word = |at: usize| {
            let bytes = b.get(at..).and_then(|bytes| bytes.first_chunk());
            u32::from_be_bytes(bytes.copied().unwrap_or_default())
        };
        let number = |at: usize| f32::from_bits(word(at));
        let stop = StopKind::from_byte(b[0])
            .map(|kind| (StopCause { kind, joint: b[1], value: number(4), limit: number(8) }, word(12)));
        Self { stop, yields: b[2], jumped: b[3], rate: number(16), held_back_ms: word(20) }
    }
}
