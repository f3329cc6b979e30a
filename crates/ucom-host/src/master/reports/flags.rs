//! Changes to the flags of a board, and the levels of a stop.
use ucom::Admin;

/// Changes to the flags of a board (D-37). A flag stays unchanged if its value is `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AdminChange {
    /// `true` to run the control loop, `false` to end it.
    pub run: Option<bool>,
    /// `true` to enable the outputs, `false` to disable them.
    pub active: Option<bool>,
    /// `true` if the module must send its texts.
    pub debug: Option<bool>,
    /// `true` if the board must send all of its texts.
    pub global_debug: Option<bool>,
}

impl AdminChange {
    /// Returns the flags of the board after the change.
    pub fn apply(&self, old: Admin) -> Admin {
        let run = self.run.unwrap_or(old.run);
        Admin {
            run,
            // The outputs can be enabled only while the control loop runs.
            active: self.active.unwrap_or(old.active) && run,
            debug: self.debug.unwrap_or(old.debug),
            global_debug: self.global_debug.unwrap_or(old.global_debug),
        }
    }

    /// Returns `true` if the change only ends motion of the board. The master does not delay or refuse such a change.
    pub fn only_ends(&self) -> bool {
        let sets = [self.run, self.active, self.debug, self.global_debug].contains(&Some(true));
        !sets && (self.run == Some(false) || self.active == Some(false))
    }
}

/// Level to which a stop ends the activity of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopLevel {
    /// The outputs are switched off, and the control loop continues.
    Outputs,
    /// The control loop ends, and the application stays started.
    Loop,
    /// The application ends, and the board returns to its exloader.
    Application,
}
