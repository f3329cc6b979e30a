//! Pages about the problems that the check of a trajectory finds, and about parameters that a controller has not received.

use super::{Family, Page, page};
use crate::check::ProblemKind;

const fn missing(bit: u32, name: &'static str, meaning: &'static str) -> Page {
    let texts = [
        meaning,
        "The controller was switched on or reset after the parameters were sent, or this parameter was not \
         sent.",
        "Send the parameters of the arm. For the built-in arm use `jtc params use-defaults`.",
        "jtc params push FILE",
    ];
    page(Family::Missing, bit, name, texts)
}

pub(super) const MISSING: &[Page] = &[
    missing(0, "missing-friction", "The controller has no friction of the joints, and waits in Init."),
    missing(1, "missing-pid", "The controller has no gains of the joints, and waits in Init."),
    missing(2, "missing-arm-model", "The controller has no masses and frames of the arm, and waits in Init."),
];

/// Declares the pages about problems of a trajectory. Each page has a kind, name, meaning, usual cause, remedy and next command. By
/// default, the next command is `jtc traj check FILE`.
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
        "The file is empty, or has only a header.",
        "Check the program that wrote the file.";
    TooManyPoints "check-too-many-points":
        "The trajectory has more points than the controller can hold.",
        "The motion is long, and its steps are short.",
        "Use a longer step, or run the motion in parts.";
    TooManySegments "check-too-many-segments":
        "The trajectory needs more segments than the controller accepts.",
        "The value of --points-per-segment is too small.",
        "Leave out --points-per-segment.";
    SegmentPoints "check-segment-points":
        "A segment would have a number of points that no frame can carry.",
        "The value of --points-per-segment is wrong.",
        "Leave out --points-per-segment.";
    StepTime "check-step-time":
        "The step between points is 0 ms.",
        "Points in the file have equal times.",
        "Give each point a later time than the point before it.";
    PositionScale "check-position-scale":
        "A position is outside the range that a frame can carry.",
        "Most often the positions are in degrees instead of radians.",
        "Write the positions in radians, or name the columns q1_deg to q6_deg.";
    VelocityScale "check-velocity-scale":
        "A velocity is outside the range that a frame can carry.",
        "The values are in degrees instead of radians, or the motion is far too fast.",
        "Write the velocities in rad/s, or slow the motion down with --speed.";
    AccelerationScale "check-acceleration-scale":
        "An acceleration is outside the range that a frame can carry.",
        "The values are in degrees instead of radians, or the velocities have a jump.",
        "Write the accelerations in rad/s², or slow the motion down with --speed.";
    Jump "check-jump":
        "Two points are so far apart that the arm cannot move from one to the other in one step.",
        "The trajectory was joined from parts, points are missing, or the values are in degrees instead of \
         radians.",
        "Look at the named points, and add points or time between them.";
    Position "check-position":
        "A position is over its limit.",
        "The path leaves the range of the joint.",
        "Change the path at the named point.";
    Velocity "check-velocity":
        "A velocity is over its limit.",
        "The motion is too fast for this joint.",
        "Slow the motion down with --speed PCT.";
    Acceleration "check-acceleration":
        "An acceleration is over its limit.",
        "The motion changes its speed too quickly.",
        "Slow the motion down with --speed PCT.";
    Torque "check-torque":
        "According to the arm model, the motion needs more torque than the limit.",
        "The motion is too fast, the load is too heavy, or the masses do not match the arm.",
        "Slow the motion down with --speed PCT, or name the right arm with --arm FILE.";
    HoldTorque "check-hold-torque":
        "At a point of this path, a joint needs nearly all of its torque to hold the arm at rest.",
        "The arm is stretched and carries a heavy load.",
        "Change the named pose, or use a lighter load.";
    FrictionVelocity "check-friction-velocity":
        "A velocity is outside the friction table.",
        "The table was measured at lower velocities.",
        "Slow the motion down with --speed PCT, or use the friction polynomial.";
    NoStop "check-no-stop":
        "At a point of the path, the available torque is too small to bring the arm to rest in time after a \
         Pause or Stop.",
        "The arm moves down fast, or carries a heavy load.",
        "Slow the motion down with --speed PCT.";
    PositionSpeed "check-position-speed":
        "The positions change faster than the velocity limit, even if the velocities in the file do not \
         exceed it.",
        "The times are too short, or the positions are in degrees instead of radians.",
        "Slow the motion down with --speed PCT.";
    VelocityMismatch "check-velocity-mismatch":
        "The speed at which the positions change differs from the velocities in the file.",
        "The trajectory was joined from parts, or the velocities are in another unit.",
        "Leave out the velocities: the check derives them from the positions.";
    NotAtRest "check-not-at-rest":
        "The arm is not at rest at the first or the last point.",
        "The trajectory was cut from a longer motion.",
        "Begin and end the trajectory with velocity 0.";
    StartPose "check-start-pose":
        "The arm is not at the first point of the trajectory.",
        "The arm was moved, or the last motion ended at another position.",
        "Check that the path is free, then move the arm to the first point.",
        "jtc traj run FILE --approach";
    AccelerationMismatch "check-acceleration-mismatch":
        "The velocities do not change as the accelerations in the file require.",
        "The trajectory was joined from parts, or the accelerations are in another unit.",
        "Leave out the accelerations: the check derives them from the velocities.";
}
