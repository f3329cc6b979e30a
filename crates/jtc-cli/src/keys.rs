//! Requests that the user makes with keys while an arm moves.

use cli_kit::{Key, Keys};

/// Request of the user about the present motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wish {
    /// Request to stop on the path (key `s`).
    Stop,
    /// Request to pause, or to resume after a pause (space bar).
    PauseOrResume,
    /// Request to move faster (key `+`).
    Faster,
    /// Request to move slower (key `-`).
    Slower,
}

/// Key help that the terminal shows while the arm moves.
pub(crate) const HELP: &str = "keys: space pauses, s stops, Ctrl-C ends";

/// Like [`HELP`], for controllers that can change the speed of a motion.
pub(crate) const HELP_WITH_SPEED: &str = "keys: space pauses, s stops, + - speed, Ctrl-C ends";

/// Message if the controller cannot change the speed of a motion, with the next step.
pub(crate) const NO_SPEED: &str = "this controller cannot change the speed of a motion: press s to stop it, then \
    use `jtc traj run FILE --speed PCT`";

/// Returns the most urgent request among the keys that were pressed since the last call.
pub(crate) fn wish(keys: &mut Keys) -> Option<Wish> {
    strongest(&keys.pressed())
}

fn strongest(keys: &[Key]) -> Option<Wish> {
    let pressed = |wanted: &[char]| keys.iter().any(|key| matches!(key, Key::Char(c) if wanted.contains(c)));
    if pressed(&['s', 'S']) {
        Some(Wish::Stop)
    } else if pressed(&[' ']) {
        Some(Wish::PauseOrResume)
    } else {
        // On many keyboards, the user types `+` with Shift and the `=` key. Therefore `=` is accepted as `+`.
        let faster = pressed(&['+', '=']).then_some(Wish::Faster);
        faster.or_else(|| pressed(&['-', '_']).then_some(Wish::Slower))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_is_stronger_than_a_pause_and_that_than_a_speed() {
        let of = |text: &str| strongest(&text.chars().map(Key::Char).collect::<Vec<_>>());
        assert_eq!(of("  s+ "), Some(Wish::Stop));
        assert_eq!(of("x+  "), Some(Wish::PauseOrResume));
        assert_eq!((of("x-"), of("x=")), (Some(Wish::Slower), Some(Wish::Faster)));
        assert_eq!(of("xq"), None);
        assert_eq!(strongest(&[Key::Down]), None);
    }
}
