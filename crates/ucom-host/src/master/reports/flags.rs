//! Changes to the flags of a board, and levels of a stop.
use ucom::Admin;

/// Changes to the flags of a board; `None` does not change a flag (D-37).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AdminChange {
    /// The control loop runs.
    pub run: Option<bool>,
    /// Outputs are enabled.
    pub active: Option<bool>,
    /// The module sends its texts.
    pub debug: Option<bool>,
    /// All texts of the board are sent.
    pub global_debug: Option<bool>,
}

impl AdminChange {
    /// Returns the flags after the change.
    pub fn apply(&self, old: Admin) -> Admin {
        let run = self.run.unwrap_or(old.run);
        Admin {
            run,
            // The outputs can only be enabled while the loop runs.
            active: self.active.unwrap_or(old.active) && run,
            debug: self.debug.unwrap_or(old.debug),
            global_debug: self.global_debug.unwrap_or(old.global_debug),
        }
    }

    /// Returns `true` if the change only ends motion. A change that only ends motion is not delayed or refused.
    pub fn only_ends(&self) -> bool {
        let sets = [self.run, self.active, self.debug, self.global_debug].contains(&Some(true));
        !sets && (self.run == Some(false) || self.active == Some(false))
    }
}

/// Level to which a board is stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopLevel {
    /// The outputs are switched off; the control loop continues.
    Outputs,
    /// The control loop ends; the application stays started.
    Loop,
    /// The board returns to its exloader.
    Application,
}
