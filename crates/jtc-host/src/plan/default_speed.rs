//! Default speed of a motion, which is used if the user does not set the speed.

use jtc_wire::{Info, SIMULATOR};

use crate::error::LinkError;
use crate::port::Port;
use crate::session::Session;

/// Default speed on a simulator, % of the limits.
const SIMULATED_PCT: f64 = 25.0;
/// Default speed on every other controller, % of the limits.
const DEFAULT_PCT: f64 = 10.0;

/// Speed of a move or an approach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveSpeed {
    /// Speed, % of the limits.
    pub percent: f64,
    /// `true` if the user did not set the speed.
    pub is_default: bool,
}

impl MoveSpeed {
    /// Returns the speed that the user set. If the user did not set the speed, returns the default speed for the controller with this
    /// identity. The default speed for a simulator is 25 % of the limits. For every other controller, also for a controller that does not
    /// report its identity, the default speed is 10 % of the limits.
    pub fn of(named: Option<f64>, info: Option<&Info>) -> Self {
        let is_simulated = info.is_some_and(|info| info.board.as_str() == SIMULATOR);
        let default = if is_simulated { SIMULATED_PCT } else { DEFAULT_PCT };
        Self { percent: named.unwrap_or(default), is_default: named.is_none() }
    }

    /// Returns a note for the user about the default speed. Returns `None` if the user set the speed. `option` is the name of the option
    /// that sets the speed, or an empty string.
    pub fn note(&self, option: &str) -> Option<String> {
        let sets = if option.is_empty() { String::new() } else { format!("; {option} sets it") };
        self.is_default.then(|| format!("at {} % of the limits{sets}", self.percent))
    }
}

impl<P: Port> Session<P> {
    /// Returns the speed of a move or an approach on this controller: the speed that the user set, or the default speed.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::info`] if the user did not set the speed.
    pub fn move_speed(&mut self, named: Option<f64>) -> Result<MoveSpeed, LinkError> {
        let info = if named.is_none() { self.info()? } else { None };
        Ok(MoveSpeed::of(named, info.as_ref()))
    }
}

#[cfg(test)]
mod tests {
    use jtc_wire::Name;

    use super::*;

    /// A controller that does not report that it is a simulator is treated as a real controller.
    #[test]
    fn the_default_speed_is_low_unless_the_controller_is_known_to_be_a_simulator() {
        let boards = [
            ("simulator", 25.0),
            ("", 10.0),
            ("nucleo-h743zi2", 10.0),
            ("Simulator", 10.0),
            ("simulator 2", 10.0),
            ("simulator ", 10.0),
            ("not a simulator", 10.0),
            ("emulator", 10.0),
            ("sim", 10.0),
        ];
        let of = |board: &str, named| {
            let info = Info { board: Name::new(board).unwrap_or_default(), ..Info::default() };
            MoveSpeed::of(named, Some(&info))
        };
        for (board, percent) in boards {
            assert_eq!(of(board, None), MoveSpeed { percent, is_default: true }, "{board}");
            // If the user sets the speed, this speed is used for every controller.
            for named in [1.0, 5.0, 60.0, 100.0] {
                assert_eq!(of(board, Some(named)), MoveSpeed { percent: named, is_default: false });
            }
        }
        let silent = MoveSpeed::of(None, None);
        assert_eq!(silent.percent, 10.0);
        assert_eq!(silent.note("--speed").unwrap(), "at 10 % of the limits; --speed sets it");
        assert_eq!(silent.note("").unwrap(), "at 10 % of the limits");
        assert_eq!(MoveSpeed::of(Some(10.0), None).note("--speed"), None);
    }
}
