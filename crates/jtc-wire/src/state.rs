//! States of the controller and of its trajectory: one table with the code, name and meaning of each state.
use crate::code::{Known, codes};

/// Declares the list of codes for a state in a status. A received code can be unknown.
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
        /// Set-up is not complete.
        #[default]
        Start = 0;
        /// The controller brings the nodes to ReadyToOperate and waits for parameters. The torque is zero (J-20).
        Init = 1;
        /// Holds a position.
        HoldPos = 2;
        /// Follows the trajectory.
        Operate = 3;
        /// Compensates gravity and the load found, and damps the joints, so that the operator can guide the arm by hand.
        Teaching = 4;
        /// The torque is zero until the cause has ended and the host has cleared the error.
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
        /// No trajectory.
        #[default]
        Null = 0;
        /// The trajectory is complete, and the arm is at its start.
        Stop = 1;
        /// Paused on the path.
        Pause = 2;
        /// The arm executes the trajectory (until standstill).
        Execute = 3;
        /// The trajectory was executed to its last point.
        Finish = 4;
        /// The trajectory is being received. Only older controllers report this state.
        TransNullToStop = 5;
    }
}
