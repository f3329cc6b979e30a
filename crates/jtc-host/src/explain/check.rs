//! Pages about the problems that a check of a trajectory finds, and about parameters that a controller still needs.

use super::{Family, Page, page};
use crate::check::ProblemKind;

const fn missing(bit: u32, name: &'static str, meaning: &'static str) -> Page {
    let texts = [
        meaning,
        "It was switched on or reset since, or this parameter was not among those that were sent.",
        "Send the arm's own, or name those of the built-in arm.",
        "jtc params push FILE",
    ];
    page(Family::Missing, bit, name, texts)
}

pub(super) const MISSING: &[Page] = &[
    missing(
        0,
        "missing-friction",
        "The controller has not been given the friction of the joints; it waits in Init.",
    ),
    missing(1, "missing-pid", "The controller has not been given the gains of the joints; it waits in Init."),
    missing(
        2,
        "missing-arm-model",
        "The controller has not been given masses and frames of the arm; it waits in Init.",
    ),
];

/// Declares the pages of the check: kind and name, then meaning, usual cause, remedy, and the next command. The default
/// command is another check.
macro_rules! found {
    (@next) => { "jtc traj check FILE" };
    (@next $command:literal) => { $command };
    ($($kind:ident $name:literal: $meaning:literal, $cause:literal, $remedy:literal $(, $command:literal)?;)+) => {
        pub(super) const FOUND: &[Page] = &[$(
            page(Family::Check, ProblemKind::$kind as u32, $name, [$meaning, $cause, $remedy, found!(@next $($command)?)]),
        )+];
    };
}

found! {
    Empty "check-empty":
        "The file has no point.",
        "An empty file, or only a head.",
        "Look at what wrote it.";
    TooManyPoints "check-too-many-points":
        "The trajectory has more points than the controller holds.",
        "A long motion in short steps.",
        "Take a longer step, or run it in parts.";
    TooManySegments "check-too-many-segments":
        "The trajectory would be sent in more segments than there may be.",
        "A small --points-per-segment.",
        "Leave --points-per-segment out.";
    SegmentPoints "check-segment-points":
        "A segment would have a number of points that no frame carries.",
        "A wrong --points-per-segment.",
        "Leave --points-per-segment out.";
    StepTime "check-step-time":
        "The step between points is 0 ms.",
        "Equal times in the file.",
        "Give each point a later time than the one before.";
    PositionScale "check-position-scale":
        "A position is outside what a frame carries.",
        "Degrees instead of radians, most often.",
        "Write radians, or use a header with q1_deg.";
    VelocityScale "check-velocity-scale":
        "A velocity is outside what a frame carries.",
        "Degrees instead of radians, or far too fast.",
        "Write rad/s; slow it down with --speed.";
    AccelerationScale "check-acceleration-scale":
        "An acceleration is outside what a frame carries.",
        "Degrees instead of radians, or a jump in the velocities.",
        "Write rad/s²; slow it down with --speed.";
    Jump "check-jump":
        "Two points are so far apart that the arm cannot get from one to the other in a step.",
        "Pieces put together, missing points, or degrees instead of radians.",
        "Look at the points that are named; give more points there, or more time.";
    Position "check-position":
        "A position is over its limit.",
        "The path leaves the range of the joint.",
        "Change the path at the point that is named.";
    Velocity "check-velocity":
        "A velocity is over its limit.",
        "The motion is too fast for this joint.",
        "Slow it down: --speed PCT.";
    Acceleration "check-acceleration":
        "An acceleration is over its limit.",
        "The motion changes its speed too quickly.",
        "Slow it down: --speed PCT.";
    Torque "check-torque":
        "By the arm model the motion needs more torque than the limit.",
        "Too fast, too heavy a load, or masses that are not the arm's.",
        "Slow it down with --speed PCT, or name the right arm with --arm FILE.";
    HoldTorque "check-hold-torque":
        "Standing still on this path takes nearly all of a joint's torque.",
        "A stretched pose with a heavy load.",
        "Change the pose that is named, or take a lighter load.";
    FrictionVelocity "check-friction-velocity":
        "A velocity is outside the friction table.",
        "The table was measured for slower motions.",
        "Slow it down with --speed PCT, or use the friction polynomial.";
    NoStop "check-no-stop":
        "From a place of the path Pause and Stop cannot bring the arm to rest in time with the torque that there is.",
        "A fast motion downwards, or a heavy load.",
        "Slow it down: --speed PCT.";
    PositionSpeed "check-position-speed":
        "Positions move faster than the velocity limit, whatever the given velocities are.",
        "Times that are too short, or degrees instead of radians.",
        "Slow it down: --speed PCT.";
    VelocityMismatch "check-velocity-mismatch":
        "Positions move at another speed than the given velocities.",
        "Pieces put together, or velocities in another unit.",
        "Leave the velocities out: they are derived from the positions.";
    NotAtRest "check-not-at-rest":
        "The first or the last point is not at rest.",
        "A part was cut out of a longer motion.",
        "Begin and end with velocity 0.";
    StartPose "check-start-pose":
        "The arm is not at the first point of the trajectory.",
        "It was moved, or the last motion ended elsewhere.",
        "Look whether the way is free, then let it move to the first point.",
        "jtc traj run FILE --approach";
    AccelerationMismatch "check-acceleration-mismatch":
        "Velocities change otherwise than by the given accelerations.",
        "Pieces put together, or accelerations in another unit.",
        "Leave the accelerations out: they are derived from the velocities.";
}
