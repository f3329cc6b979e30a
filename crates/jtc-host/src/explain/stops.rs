//! Pages about the causes of a held stop (J-69). Number 0 is the page about the held stop itself.

use jtc_wire::StopKind;

use super::{Family, Page, page};

/// Declares the pages of the causes: kind and name, then meaning, usual cause, remedy, and the next command. The default
/// command is `jtc clear`.
macro_rules! stops {
    (@next) => { "jtc clear" };
    (@next $command:literal) => { $command };
    ($($kind:ident $name:literal: $meaning:literal, $cause:literal, $remedy:literal $(, $command:literal)?;)+) => {
        const KINDS: [Page; StopKind::ALL.len()] = [$(
            page(Family::Stop, StopKind::$kind as u32, $name, [$meaning, $cause, $remedy, stops!(@next $($command)?)]),
        )+];
    };
}

/// Page about the held stop itself.
pub(super) const HELD_STOP: &[Page] = &[page(
    Family::Stop,
    0,
    "held-stop",
    [
        "The controller has brought the arm to rest and holds it. Nothing is executed until the errors are cleared.",
        "A push, an obstacle, a load that the arm model lacks, or another of the causes that `jtc explain stop:` lists; `jtc status` shows \
         it. With the number 0 the controller does not tell it.",
        "Remove the cause, wait until the arm stands, then clear the errors. A paused motion can go on from where it stands.",
        "jtc status",
    ],
)];

/// Pages about the causes, in the order of their numbers.
pub(super) const CAUSES: &[Page] = &KINDS;

stops! {
    Overload "held-stop-overload":
        "A joint needed more torque than its limit for too long.",
        "A load that is heavier than the payload that was given, a motion that is too fast for it, or an arm model that is not this arm.",
        "Give the payload if the arm carries one, and check that the arm model is that of this arm.",
        "jtc payload set";
    Push "held-stop-push":
        "Something pushed a joint: the controller held a torque against it that the model does not explain.",
        "A person, an obstacle, a hose or cable that pulls, or a load that was not given as payload.",
        "Remove what pushes the joint, or give the payload if the arm carries one.";
    PositionError "held-stop-position-error":
        "A joint was too far from where it was commanded to be.",
        "An obstacle, gains that are too low, wrong friction, or a drive that gives no torque.",
        "Look for an obstacle, and compare gains and friction with those of the arm.";
    Position "held-stop-position":
        "A commanded position was beyond its limit.",
        "The trajectory goes beyond the limits of this arm.",
        "Keep the trajectory within the position limits.",
        "jtc traj check FILE";
    Velocity "held-stop-velocity":
        "A commanded velocity was beyond its limit.",
        "The trajectory is too fast, also between its points.",
        "Run the trajectory slower, within the velocity limits.",
        "jtc traj check FILE";
    Acceleration "held-stop-acceleration":
        "A commanded acceleration was beyond its limit.",
        "The trajectory changes its speed too quickly.",
        "Run the trajectory slower or smooth it, within the acceleration limits.",
        "jtc traj check FILE";
    FrictionTable "held-stop-friction-table":
        "The friction table has no value for a commanded velocity at this temperature.",
        "The bearing is colder or warmer, or the joint faster, than the table reaches.",
        "Use the friction polynomial, or a table with wider axes.",
        "jtc params use-defaults";
    Unstable "held-stop-unstable":
        "A joint swung more and more, or its torque went from limit to limit: its gains make the position controller unstable. This \
         joint has softer gains now, without Ki.",
        "Gains that are too high for the inertia of this joint, or a rotor inertia that is wrong in the arm file.",
        "Lower the gains of this joint, or correct its rotor inertia.",
        "jtc arm check FILE";
    EncoderJump "encoder-jumped":
        "The position of a joint's encoder jumped. The controller goes on with the right position, and executes no trajectory until the drive \
         was reset.",
        "A loose or faulty encoder, its cable, or a strong disturbance beside it.",
        "Support the arm, disable it, compare the joint with its marks, reset its drive, then recover.",
        "jtc disable";
    SpeedScale "held-stop-speed-scale":
        "The position and the speed that a drive reports differ by a factor.",
        "The setting `velocity_full_scale_rad_s` is not that of the drives.",
        "Set `velocity_full_scale_rad_s` in the arm file to the full scale of the drives' velocity.",
        "jtc arm push FILE";
    Approach "held-stop-approach":
        "When the drives were enabled, the arm was too far from the path, or had too little torque left to approach it; the motion was given up.",
        "The arm sank or was moved between the command and the enabling of its drives, or a load uses most of its torque.",
        "Bring the arm nearer to the start of the motion, or approach it more slowly.",
        "jtc traj run FILE --approach";
    Gains "held-stop-gains":
        "A joint did not bear gains that were given while the arm was held, or the arm was released while they were on trial. The gains before are \
         in use again.",
        "Gains that are too high, too low or not damped, a push within 2 s of giving them, or a load that the model lacks.",
        "Compare the gains with the arm before they are given again.",
        "jtc arm check FILE";
    Shove "held-stop-shove":
        "Something pushed a joint: it moved away from where it was commanded to be, faster than anything but a push explains; or it was led too fast \
         in Teaching, where nothing is commanded.",
        "A person, an obstacle that moves, a hose or cable that pulls, or a load that was taken up or dropped.",
        "Remove what moved the joint; give the payload if the arm has taken one up.";
}
