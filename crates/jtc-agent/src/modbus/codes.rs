//! Numbers of a PLC's commands, their outcomes and errors.

macro_rules! numbered {
    ($(#[$doc:meta])* $name:ident { $($(#[$meaning:meta])* $variant:ident = $code:literal, $text:literal;)+ }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[repr(u16)]
        pub enum $name {
            $($(#[$meaning])* $variant = $code,)+
        }

        impl $name {
            /// All values.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// Returns the description.
            pub const fn text(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }

            /// Returns the value with this number.
            pub fn from_number(number: u16) -> Option<Self> {
                Self::ALL.iter().copied().find(|one| *one as u16 == number)
            }
        }
    };
}

numbered! {
    /// Command of a PLC.
    Command {
        /// No command.
        #[default]
        None = 0, "nothing: the number is acknowledged, no more";
        /// Start of a stored trajectory.
        Start = 1, "start the trajectory: a job, checked, uploaded, executed. `result` 1: it has begun";
        /// Pause.
        Pause = 2, "pause";
        /// Resume.
        Resume = 3, "go on after a pause";
        /// Stop.
        Stop = 4, "stop";
        /// Teaching on.
        TeachOn = 5, "teaching: the arm is led by hand";
        /// Teaching off.
        TeachOff = 6, "end of teaching";
        /// Pump on.
        GripperOn = 7, "gripper: pump on";
        /// Pump off.
        GripperOff = 8, "gripper: pump off";
        /// Clear.
        Clear = 9, "clear the errors of the controller and of all drives";
        /// Recover.
        Recover = 10, "recover: lead the controller back to a held arm, a job";
        /// Recover, with the controller's defaults.
        RecoverWithDefaults = 11, "the same where the controller has not been given its arm: it uses its defaults, the stored arm where there is one";
        /// Speed.
        SetSpeed = 12, "set speed: the motion that goes on, and later ones, at `speed` % of their own";
        /// Release of the lease.
        Release = 13, "let the lease go";
    }
}

/// Largest number of a command.
pub const COMMAND_MAX: u16 = Command::Release as u16;

numbered! {
    /// Outcome of a command.
    Outcome {
        /// No command yet.
        #[default]
        None = 0, "there was no command yet";
        /// Done.
        Done = 1, "done; of a job: begun";
        /// Wrong sequence number.
        Sequence = 2, "`sequence` is neither `acknowledged` nor one more: nothing was done";
        /// Impossible value.
        Value = 3, "a value is not possible for this command, or the watchdog is off: nothing was done";
        /// Unknown trajectory.
        NoTrajectory = 4, "no trajectory has this number: nothing was done";
        /// Busy.
        Busy = 5, "a job or another command of this PLC goes on: nothing was done";
        /// Another client holds the lease.
        Held = 6, "somebody else commands: nothing was done";
        /// Another client stopped or paused the arm.
        Stopped = 7, "somebody else stopped or paused the arm less than three seconds ago: nothing was done";
        /// A coil of a connection is 1.
        Coil = 8, "the coil `stop` or `pause` of a connection is 1: nothing was done";
        /// Wrong state of the arm.
        NotReady = 9, "the arm is not in a state for this (`state`, `errors`, `ready`, `paused`): nothing was done";
        /// No answer of the controller.
        NoController = 10, "the controller is not there or did not answer: the arm may be moving";
        /// Refused or failed.
        Failed = 11, "it was refused or failed: `command_error` has why";
    }
}

/// Number for an error code that is not in [`ERRORS`].
pub const OTHER_ERROR: u16 = 255;

/// Errors by number: their codes in the API, and descriptions. Numbers are never reused.
#[rustfmt::skip]
pub const ERRORS: &[(u16, &str, &str)] = &[
    (1, "stopped", "somebody stopped or paused the arm before this moved it"),
    (2, "check", "the check refused the trajectory: joint and point are where it is worst"),
    (3, "approach", "the way to the first point was refused"),
    (4, "open-path", "it does not end where it begins, and cannot be repeated without `approach`"),
    (5, "not-ready", "the controller does not hold the arm"),
    (6, "state-timeout", "the controller did not come to the state that was waited for"),
    (7, "device-error", "the controller is in Error"),
    (8, "absent-joints", "joints are set absent"),
    (9, "run-fault", "the controller ended the motion with an error"),
    (10, "held-stop", "the controller stopped the motion because of an error, and holds the arm"),
    (11, "refused", "the controller refused it"),
    (12, "segment-refused", "the controller refused a part of the trajectory"),
    (13, "upload-failed", "the trajectory did not reach the controller whole"),
    (14, "not-uploaded", "the controller holds another trajectory"),
    (15, "not-paused", "nothing is paused"),
    (16, "rest-refused", "what remains of the motion does not pass the check any more"),
    (17, "link-lost", "the controller fell silent in a motion: the arm may be moving"),
    (18, "no-link", "the controller is silent"),
    (19, "not-confirmed", "the controller did not confirm it"),
    (20, "not-sent", "the agent did not send it: somebody else commands, or has stopped the arm"),
    (21, "no-extension", "this controller cannot do that"),
    (22, "device-limits", "the controller's limits are not known to be those of the arm"),
    (23, "no-parameters", "the controller has not been given its arm: recover with its defaults"),
    (24, "incomplete-arm", "the arm lacks something"),
    (25, "other-arm", "the controller has another arm"),
    (26, "arm-changed", "the arm of the controller changed meanwhile"),
    (27, "cancelled", "it was broken off"),
    (28, "denied", "somebody else commands, or has stopped the arm"),
    (29, "busy", "something else goes on"),
    (30, "gone", "the line is gone"),
    (31, "fault", "the agent has a fault"),
    (32, "motion-ended", "the motion had ended before this was done"),
    (33, "encoder-jumped", "an encoder has jumped (`encoder_jumped`): its drive is to be reset first"),
];

/// Returns the number of an error.
pub fn error_number(code: &str) -> u16 {
    ERRORS.iter().find(|(_, name, _)| *name == code).map_or(OTHER_ERROR, |(number, ..)| *number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_given_once() {
        for (n, (number, code, _)) in ERRORS.iter().enumerate() {
            assert_eq!(usize::from(*number), n + 1, "{code}");
            assert_eq!(error_number(code), *number);
        }
        assert_eq!(error_number("something-new"), OTHER_ERROR);
        for (n, command) in Command::ALL.iter().enumerate() {
            assert_eq!((*command as usize, Command::from_number(n as u16)), (n, Some(*command)));
        }
        assert_eq!(Command::from_number(COMMAND_MAX + 1), None);
    }
}
