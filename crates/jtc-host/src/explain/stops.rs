//! Pages about the causes of a held stop (J-69), in which the drives hold the arm. The page with the number 0 is
//! about held stops in general.

use jtc_wire::StopKind;

use super::{Family, Page, page};

/// Declares the pages about the causes of a held stop. Each page has a kind, name, meaning, usual cause, remedy and next command. By
/// default, the next command is `jtc clear`.
macro_rules! stops {
    (@next) => { "jtc clear" };
    (@next $command:literal) => { $command };
    ($($kind:ident $name:literal: $meaning:literal, $cause:literal, $remedy:literal $(, $command:literal)?;)+) => {
        const KINDS: [Page; StopKind::ALL.len()] = [$(
            page(Family::Stop, StopKind::$kind as u32, $name, [$meaning, $cause, $remedy, stops!(@next $($command)?)]),
        )+];
    };
}

/// Page about held stops in general.
pub(super) const HELD_STOP: &[Page] = &[page(
    Family::Stop,
    0,
    "held-stop",
    [
        "The controller has brought the arm to rest and holds it. No motion is executed until the errors are \
         cleared.",
        "A push, an obstacle, a load that the arm model lacks, or another cause. `jtc status` shows the \
         cause, and `jtc explain stop:` lists all causes. With the number 0 the controller does not report \
         the cause.",
        "Remove the cause, wait until the arm is at rest, then clear the errors. You can then resume a \
         paused motion from the present position.",
        "jtc status",
    ],
)];

/// Pages about the causes of a held stop, in the order of the cause numbers.
pub(super) const CAUSES: &[Page] = &KINDS;

stops! {
    Overload "held-stop-overload":
        "A joint needed more torque than its limit for too long.",
        "A load that is heavier than the payload that was set, a motion that is too fast for the load, or an \
         arm model that does not match the arm.",
        "Set the payload if the arm carries one, and check that the arm model matches the arm.",
        "jtc payload set";
    Push "held-stop-push":
        "Something pushed a joint: the controller held it with a torque that the model does not explain.",
        "A person, an obstacle, a hose or cable that pulls, or a load that was not set as payload.",
        "Remove what pushes the joint, or set the payload if the arm carries one.";
    PositionError "held-stop-position-error":
        "A joint was too far from its commanded position.",
        "An obstacle, gains that are too low, wrong friction, or a drive without torque.",
        "Look for an obstacle, and compare gains and friction with those of the arm.";
    Position "held-stop-position":
        "A commanded position was beyond its limit.",
        "The trajectory goes beyond the limits of this arm.",
        "Keep the trajectory within the position limits.",
        "jtc traj check FILE";
    Velocity "held-stop-velocity":
        "A commanded velocity was beyond its limit.",
        "The trajectory is too fast at its points or between them.",
        "Run the trajectory slower, within the velocity limits.",
        "jtc traj check FILE";
    Acceleration "held-stop-acceleration":
        "A commanded acceleration was beyond its limit.",
        "The trajectory changes its speed too quickly.",
        "Run the trajectory slower or smooth it, within the acceleration limits.",
        "jtc traj check FILE";
    FrictionTable "held-stop-friction-table":
        "The friction table has no value for a commanded velocity at this temperature.",
        "The temperature of the bearing or the speed of the joint is outside the table.",
        "Use the friction polynomial, or a table with a wider range.",
        "jtc params use-defaults";
    Unstable "held-stop-unstable":
        "The oscillation of a joint grew, or its torque alternated between its limits: its gains make the \
         position controller unstable. The joint now has softer gains, without Ki.",
        "Gains that are too high for the inertia of this joint, or a rotor inertia that is wrong in the arm file.",
        "Lower the gains of this joint, or correct its rotor inertia.",
        "jtc arm check FILE";
    EncoderJump "encoder-jumped":
        "The position of a joint's encoder jumped. The controller continues with the correct position, and \
         executes no trajectory until the drive is reset.",
        "A loose or faulty encoder, a faulty encoder cable, or a strong disturbance near the encoder.",
        "Support the arm, disable it, compare the joint with its marks, reset its drive, then recover.",
        "jtc disable";
    SpeedScale "held-stop-speed-scale":
        "The speed that a drive reports and the change of its position differ by a factor.",
        "The setting `velocity_full_scale_rad_s` does not match the drives.",
        "Set `velocity_full_scale_rad_s` in the arm file to the full scale of the drives' velocity.",
        "jtc arm push FILE";
    Approach "held-stop-approach":
        "When the drives were enabled, the arm was too far from the path, or had too little torque left to \
         approach it. The controller cancelled the motion.",
        "The arm sank or was moved between the command and the enabling of its drives, or a load uses most of its torque.",
        "Bring the arm nearer to the start of the motion, or approach it more slowly.",
        "jtc traj run FILE --approach";
    Gains "held-stop-gains":
        "New gains failed their trial at a joint of the held arm, or the arm was released during the trial. \
         The previous gains are in use again.",
        "Gains that are too high, too low or not damped, a push within 2 s after they were sent, or a load \
         that the model lacks.",
        "Compare the gains with the arm before you send them again.",
        "jtc arm check FILE";
    Shove "held-stop-shove":
        "A joint moved away from its commanded position so fast that only a push explains the motion. Or a \
         person led a joint too fast in Teaching.",
        "A person, an obstacle that moves, a hose or cable that pulls, or a load that the arm picked up or dropped.",
        "Remove what moved the joint; set the payload if the arm has taken up a load.";
}
