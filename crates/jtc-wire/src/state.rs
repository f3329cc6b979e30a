//! States of the controller and of its trajectory. A table contains the code, name and meaning of each state.
use crate::code::{Known, codes};

/// Declares the list of codes for a state in JtcStatus. A received code may be unknown.
macro_rules! states {
    ($(#[$doc:meta])* $list:ident, $unknown:literal $rows:tt) => {
        codes! {
            $(#[$doc])*
            #[derive(Default)]
            $list $rows
        }

        impl Known for $list {
            const ALL: &'static [Self] = &Self::ALL;
            const UNKNOWN: &'static str = $unknown;

            fn code(self) -> u8 {
                self as u8
            }

            fn name(self) -> &'static str {
                self.name()
            }
        }
    };
}

states! {
    /// State of the controller.
    ControllerState, "unknown state" {
        /// The set-up of the controller is not complete.
        #[default]
        Start = 0;
        /// The controller brings the nodes to ReadyToOperate and waits for parameters. The torque is zero (J-20).
        Init = 1;
        /// The controller holds the arm at a position.
        HoldPos = 2;
        /// The controller moves the arm along the trajectory.
        Operate = 3;
        /// The controller compensates gravity and the estimated load, and damps the joints, so that the operator can
        /// guide the arm by hand.
        Teaching = 4;
        /// The torque is zero until the cause of the error has ended and the host has cleared the error.
        Error = 5;
    }
}

impl ControllerState {
    /// Returns true if the controller commands torque. If the controller does not command torque, the arm falls.
    pub fn has_torque(self) -> bool {
        matches!(self, Self::HoldPos | Self::Operate | Self::Teaching)
    }
}

states! {
    /// State of the trajectory; "trajectory execution state" (TES) in manuals.
    TrajectoryState, "unknown" {
        /// The controller has no trajectory.
        #[default]
        Null = 0;
        /// The trajectory is complete, and the arm is at the start of the trajectory.
        Stop = 1;
        /// The arm is paused on the path.
        Pause = 2;
        /// The arm executes the trajectory, or decelerates on it until standstill.
        Execute = 3;
        /// The trajectory was executed to its last point.
        Finish = 4;
        /// The controller receives the trajectory. Only older controllers report this state.
        TransNullToStop = 5;
    }
}
