//! Numbers of the commands of a PLC, and of the outcomes and errors of these commands.

macro_rules! numbered {
    ($(#[$doc:meta])* $name:ident { $($(#[$meaning:meta])* $variant:ident = $code:literal, $text:literal;)+ }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[repr(u16)]
        pub enum $name {
            $($(#[$meaning])* $variant = $code,)+
        }

        impl $name {
            /// All values of the type.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// Returns the description of the value.
            pub const fn text(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }

            /// Returns the value with the number `number`.
            pub fn from_number(number: u16) -> Option<Self> {
                Self::ALL.iter().copied().find(|one| *one as u16 == number)
            }
        }
    };
}

numbered! {
    /// Command of a PLC.
    Command {
        /// No command: the agent only acknowledges the sequence number.
        #[default]
        None = 0, "no command: the agent only acknowledges the number";
        /// Start of a stored trajectory.
        Start = 1, "start a job that checks, uploads and executes the trajectory. `result` 1: the job has begun";
        /// Pause of the motion.
        Pause = 2, "pause";
        /// Resumption of a paused motion.
        Resume = 3, "resume after a Pause";
        /// Stop of the motion.
        Stop = 4, "stop";
        /// Start of Teaching.
        TeachOn = 5, "begin Teaching: a person can lead the arm by hand";
        /// End of Teaching.
        TeachOff = 6, "end Teaching";
        /// Switching on the gripper's pump.
        GripperOn = 7, "switch the pump of the gripper on";
        /// Switching off the gripper's pump.
        GripperOff = 8, "switch the pump of the gripper off";
        /// Clearing of all errors.
        Clear = 9, "clear the errors of the controller and of all drives";
        /// Recovery to position hold.
        Recover = 10, "recover: start a job that brings the controller back to a held arm";
        /// Recovery with the arm that the controller has stored. If the controller has stored no arm,
        /// it recovers with its defaults.
        RecoverWithDefaults = 11, "recover a controller that has not received its arm: it uses the stored arm, or its defaults if it has none";
        /// Speed of the present motion and of later motions.
        SetSpeed = 12, "set speed: run the present motion and later ones at `speed` % of their own speed";
        /// Release of the lease.
        Release = 13, "release the lease";
    }
}

/// Largest command number.
pub const COMMAND_MAX: u16 = Command::Release as u16;

numbered! {
    /// Outcome of a command.
    Outcome {
        /// The PLC has sent no command yet.
        #[default]
        None = 0, "no command yet";
        /// The agent executed the command, or has begun its job.
        Done = 1, "done; a job has begun";
        /// The sequence number of the command is wrong.
        Sequence = 2, "`sequence` is neither `acknowledged` nor `acknowledged` + 1: nothing was done";
        /// A value of the command is invalid.
        Value = 3, "a value is invalid for this command, or the watchdog is off: nothing was done";
        /// No trajectory has the number in the command.
        NoTrajectory = 4, "no trajectory has this number: nothing was done";
        /// A job or another command of the PLC is running.
        Busy = 5, "a job or another command of this PLC is running: nothing was done";
        /// Another client holds the lease.
        Held = 6, "another client holds the lease: nothing was done";
        /// Another client stopped or paused the arm.
        Stopped = 7, "another client stopped or paused the arm less than three seconds ago: nothing was done";
        /// The Stop or Pause coil of a connection is 1.
        Coil = 8, "the coil `stop` or `pause` of a connection is 1: nothing was done";
        /// The arm is in a state that does not permit the command.
        NotReady = 9, "the state of the arm does not permit this command (see `state`, `errors`, `ready`, `paused`): nothing was done";
        /// The controller did not answer.
        NoController = 10, "the controller is silent or did not answer the command: the arm may be moving";
        /// The command was refused or failed.
        Failed = 11, "the command was refused or failed: `command_error` has the reason";
    }
}

/// Error number for each error code that is not in [`ERRORS`].
pub const OTHER_ERROR: u16 = 255;

/// Error numbers, with the error codes of the API and their descriptions. An error number is never
/// used for another error code.
#[rustfmt::skip]
pub const ERRORS: &[(u16, &str, &str)] = &[
    (1, "stopped", "a client stopped or paused the arm before this command moved it"),
    (2, "check", "the check refused the trajectory; `job_error_joint` and `job_error_point` name the place of the worst violation"),
    (3, "approach", "the approach to the first point was refused"),
    (4, "open-path", "the trajectory does not end at its first point, so it cannot be repeated without `approach`"),
    (5, "not-ready", "the controller does not hold the arm"),
    (6, "state-timeout", "the controller did not reach the expected state in time"),
    (7, "device-error", "the controller is in Error"),
    (8, "absent-joints", "joints are set absent"),
    (9, "run-fault", "the controller ended the motion with an error"),
    (10, "held-stop", "the controller stopped the motion because of an error, and holds the arm"),
    (11, "refused", "the controller refused the command"),
    (12, "segment-refused", "the controller refused a part of the trajectory"),
    (13, "upload-failed", "the controller did not receive the whole trajectory"),
    (14, "not-uploaded", "the controller holds another trajectory"),
    (15, "not-paused", "no motion is paused"),
    (16, "rest-refused", "the remainder of the motion no longer passes the check"),
    (17, "link-lost", "the controller fell silent during a motion: the arm may be moving"),
    (18, "no-link", "the controller is silent"),
    (19, "not-confirmed", "the controller did not confirm the command"),
    (20, "not-sent", "the agent did not send the command: another client holds the lease, or has stopped the arm"),
    (21, "no-extension", "this controller does not support the command"),
    (22, "device-limits", "the agent does not know whether the controller's limits are those of the arm"),
    (23, "no-parameters", "the controller has not received its arm: recover with its defaults (command 11)"),
    (24, "incomplete-arm", "the arm lacks parameters"),
    (25, "other-arm", "the controller has another arm"),
    (26, "arm-changed", "the arm of the controller has changed in the meantime"),
    (27, "cancelled", "the job was cancelled"),
    (28, "denied", "another client holds the lease, or has stopped the arm"),
    (29, "busy", "another job or command is running"),
    (30, "gone", "the line to the controller is lost"),
    (31, "fault", "internal fault of the agent"),
    (32, "motion-ended", "the motion ended before the command was executed"),
    (33, "encoder-jumped", "an encoder has jumped (`encoder_jumped`): first reset its drive"),
];

/// Returns the number of an error code.
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
