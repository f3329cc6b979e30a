//! What can be wrong with a trajectory, in the order of what it does to an arm.

use serde::Serialize;

/// Share of a joint's torque limit that holding it may take, friction not counted: 98 % have been seen to fall.
pub const HOLD_SHARE: f64 = 0.97;

/// Declares the kinds: meaning, name, words, and the unit of the numbers where they have one.
macro_rules! kinds {
    ($($(#[$meaning:meta])* $name:ident, $words:literal $(in $unit:literal)?;)+) => {
        /// What can be wrong.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
        #[serde(rename_all = "snake_case")]
        pub enum ProblemKind {
            $($(#[$meaning])* $name,)+
        }

        impl ProblemKind {
            /// All of them.
            pub const ALL: [Self; [$($words),+].len()] = [$(Self::$name),+];

            /// The kind in words, without the facts.
            pub fn words(self) -> &'static str {
                match self {
                    $(Self::$name => $words,)+
                }
            }

            /// Unit of the value and its limit; empty for a count.
            pub(super) fn unit(self) -> &'static str {
                match self {
                    $(Self::$name => concat!($($unit)?),)+
                }
            }
        }
    };
}

kinds! {
    /// No point.
    Empty, "no points";
    /// More points than the controller holds.
    TooManyPoints, "too many points";
    /// More segments than a trajectory may have.
    TooManySegments, "too many segments";
    /// Points per segment outside 1..1500.
    SegmentPoints, "points per segment";
    /// Step time 0.
    StepTime, "step time of 0 ms";
    /// A position that no frame carries.
    PositionScale, "position outside what a frame carries" in "rad";
    /// A velocity that no frame carries.
    VelocityScale, "velocity outside what a frame carries" in "rad/s";
    /// An acceleration that no frame carries.
    AccelerationScale, "acceleration outside what a frame carries" in "rad/s²";
    /// Two points so far apart that the arm cannot get from one to the other in a step.
    Jump, "jump" in "rad";
    /// Position over its limit.
    Position, "position over its limit" in "rad";
    /// Velocity over its limit.
    Velocity, "velocity over its limit" in "rad/s";
    /// Acceleration over its limit.
    Acceleration, "acceleration over its limit" in "rad/s²";
    /// Torque by the arm model over its limit.
    Torque, "torque over its limit" in "N·m";
    /// Holding the arm where the path stands takes nearly all of a joint's torque: it would fall later.
    HoldTorque, "nearly all torque to stand" in "N·m";
    /// A velocity that the friction table does not have (J-36).
    FrictionVelocity, "velocity outside the friction table" in "rad/s";
    /// A place from which Pause or Stop cannot bring the arm to rest in time with the torque that there is (J-33).
    NoStop, "no stop in time" in "N·m";
    /// Positions move faster than the velocity limit, whatever the given velocities are.
    PositionSpeed, "positions move faster than the velocity limit" in "rad/s";
    /// Positions move at another speed than the given velocities; a warning at single places.
    VelocityMismatch, "positions and velocities disagree" in "rad/s";
    /// The first or last point is not at rest.
    NotAtRest, "not at rest at an end" in "rad/s";
    /// The arm is not at the first point (J-34).
    StartPose, "the arm is not at the first point" in "rad";
    /// Velocities change otherwise than by the given accelerations.
    AccelerationMismatch, "velocities and accelerations disagree" in "rad/s²";
}

impl ProblemKind {
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
}
