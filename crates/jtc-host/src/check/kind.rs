//! What can be wrong with a trajectory, in the order of what it does to an arm.

use serde::Serialize;

/// Share of a joint's torque limit that holding it may take, friction not counted: 98 % have been seen to fall.
pub const HOLD_SHARE: f64 = 0.97;

/// What can be wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ProblemKind {
    /// No point.
    Empty,
    /// More points than the controller holds.
    TooManyPoints,
    /// More segments than a trajectory may have.
    TooManySegments,
    /// Points per segment outside 1..1500.
    SegmentPoints,
    /// Step time 0.
    StepTime,
    /// A position that no frame carries.
    PositionScale,
    /// A velocity that no frame carries.
    VelocityScale,
    /// An acceleration that no frame carries.
    AccelerationScale,
    /// Two points so far apart that the arm cannot get from one to the other in a step.
    Jump,
    /// Position over its limit.
    Position,
    /// Velocity over its limit.
    Velocity,
    /// Acceleration over its limit.
    Acceleration,
    /// Torque by the arm model over its limit.
    Torque,
    /// Holding the arm where the path stands takes nearly all of a joint's torque: it would fall later.
    HoldTorque,
    /// A velocity that the friction table does not have (J-36).
    FrictionVelocity,
    /// A place from which Pause or Stop cannot bring the arm to rest in time with the torque that there is (J-33).
    NoStop,
    /// Positions move faster than the velocity limit, whatever the given velocities are.
    PositionSpeed,
    /// Positions move at another speed than the given velocities; a warning at single places.
    VelocityMismatch,
    /// The first or last point is not at rest.
    NotAtRest,
    /// The arm is not at the first point (J-34).
    StartPose,
    /// Velocities change otherwise than by the given accelerations.
    AccelerationMismatch,
}

impl ProblemKind {
    /// All of them.
    pub const ALL: [Self; 21] = {
        use ProblemKind::*;
        [
            Empty,
            TooManyPoints,
            TooManySegments,
            SegmentPoints,
            StepTime,
            PositionScale,
            VelocityScale,
            AccelerationScale,
            Jump,
            Position,
            Velocity,
            Acceleration,
            Torque,
            HoldTorque,
            FrictionVelocity,
            NoStop,
            PositionSpeed,
            VelocityMismatch,
            NotAtRest,
            StartPose,
            AccelerationMismatch,
        ]
    };

    pub(super) fn scale(channel: &str) -> Self {
        match channel {
            "position" => ProblemKind::PositionScale,
            "velocity" => ProblemKind::VelocityScale,
            _ => ProblemKind::AccelerationScale,
        }
    }

    /// It ends the motion before anybody could stop it, or leaves no motion to stop.
    pub(super) fn stops_at_once(self) -> bool {
        use ProblemKind::*;
        !matches!(
            self,
            NotAtRest | StartPose | VelocityMismatch | AccelerationMismatch | FrictionVelocity | HoldTorque
        )
    }

    pub(super) fn unit(self) -> &'static str {
        use ProblemKind::*;
        match self {
            Jump | Position | StartPose | PositionScale => "rad",
            Velocity | FrictionVelocity | VelocityScale | PositionSpeed | VelocityMismatch | NotAtRest => {
                "rad/s"
            }
            Acceleration | AccelerationScale | AccelerationMismatch => "rad/s²",
            Torque | HoldTorque | NoStop => "N·m",
            _ => "",
        }
    }

    /// The kind in words, without the facts.
    pub fn words(self) -> &'static str {
        use ProblemKind::*;
        match self {
            Empty => "no points",
            TooManyPoints => "too many points",
            TooManySegments => "too many segments",
            SegmentPoints => "points per segment",
            StepTime => "step time of 0 ms",
            PositionScale => "position outside what a frame carries",
            VelocityScale => "velocity outside what a frame carries",
            AccelerationScale => "acceleration outside what a frame carries",
            Jump => "jump",
            Position => "position over its limit",
            Velocity => "velocity over its limit",
            Acceleration => "acceleration over its limit",
            Torque => "torque over its limit",
            HoldTorque => "nearly all torque to stand",
            FrictionVelocity => "velocity outside the friction table",
            NoStop => "no stop in time",
            PositionSpeed => "positions move faster than the velocity limit",
            VelocityMismatch => "positions and velocities disagree",
            NotAtRest => "not at rest at an end",
            StartPose => "the arm is not at the first point",
            AccelerationMismatch => "velocities and accelerations disagree",
        }
    }
}
