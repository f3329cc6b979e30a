//! Keys while an arm moves: read one by one from the terminal, which is put back as it was however the command ends.
//!
//! Ctrl-C stays a signal. Ctrl-Z is switched off meanwhile: a command that sleeps would leave the arm moving with nobody who
//! follows it.

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// Space: pause, or go on after a pause.
    PauseOrResume,
    /// `s`: stop on the path.
    Stop,
}

/// What the keys do, for the person at the terminal.
pub const HELP: &str = "keys: space pauses and resumes, s stops, Ctrl-C stops and ends";

/// The strongest wish of keys pressed since the last look.
fn strongest(bytes: &[u8]) -> Option<Key> {
    if bytes.iter().any(|b| matches!(b, b's' | b'S')) {
        Some(Key::Stop)
    } else {
        bytes.contains(&b' ').then_some(Key::PauseOrResume)
    }
}

#[cfg(unix)]
pub use terminal::{Keys, Terminal};

#[cfg(unix)]
mod terminal {
    use std::io::IsTerminal;
    use std::sync::{Arc, Mutex, PoisonError};

    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use rustix::process::getpgrp;
    use rustix::stdio::stdin;
    use rustix::termios::{
        LocalModes, OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcgetpgrp, tcsetattr,
    };

    use super::{Key, strongest};

    /// How the terminal was before; whoever ends the process can put it back.
    #[derive(Clone, Default)]
    pub struct Terminal(Arc<Mutex<Option<Termios>>>);

    impl Terminal {
        /// Puts the terminal back as it was. Does nothing the second time.
        pub fn restore(&self) {
            let before = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
            if let Some(before) = before {
                let _ = tcsetattr(stdin(), OptionalActions::Now, &before);
            }
        }
    }

    /// Keys from stdin, where it is a terminal of which this process has the foreground.
    pub struct Keys(Terminal);

    impl Keys {
        /// From now on keys come one by one and are not shown; none when there is no terminal to press them at.
        pub fn listen(terminal: &Terminal) -> Option<Self> {
            if !std::io::stdin().is_terminal() {
                return None;
            }
            // In the background, changing the terminal would put this process to sleep.
            if tcgetpgrp(stdin()).is_ok_and(|foreground| foreground != getpgrp()) {
                return None;
            }
            let before = tcgetattr(stdin()).ok()?;
            let mut single = before.clone();
            single.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO);
            single.special_codes[SpecialCodeIndex::VMIN] = 0;
            single.special_codes[SpecialCodeIndex::VTIME] = 0;
            single.special_codes[SpecialCodeIndex::VSUSP] = 0;
            *terminal.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(before);
            let keys = Self(terminal.clone());
            tcsetattr(stdin(), OptionalActions::Now, &single).ok()?;
            Some(keys)
        }

        /// The key pressed since the last look; of several the strongest.
        pub fn pressed(&mut self) -> Option<Key> {
            let input = stdin();
            let mut ready = [PollFd::new(&input, PollFlags::IN)];
            let waited = poll(&mut ready, Some(&Timespec { tv_sec: 0, tv_nsec: 0 }));
            if !matches!(waited, Ok(1..)) {
                return None;
            }
            let mut bytes = [0; 64];
            let n = rustix::io::read(input, &mut bytes).unwrap_or(0);
            strongest(&bytes[..n])
        }
    }

    impl Drop for Keys {
        fn drop(&mut self) {
            self.0.restore();
        }
    }
}

#[cfg(not(unix))]
pub use console::{Keys, Terminal};

#[cfg(not(unix))]
mod console {
    use std::io::IsTerminal;
    use std::time::Duration;

    use crossterm::event::{self, Event, KeyCode, KeyEventKind};

    use super::{Key, strongest};

    /// A console needs no other mode for single keys.
    #[derive(Clone, Default)]
    pub struct Terminal;

    impl Terminal {
        /// Nothing to put back.
        pub fn restore(&self) {}
    }

    /// Keys from the console.
    pub struct Keys;

    impl Keys {
        /// None when there is no console to press them at.
        pub fn listen(_: &Terminal) -> Option<Self> {
            std::io::stdin().is_terminal().then_some(Self)
        }

        /// The key pressed since the last look; of several the strongest.
        pub fn pressed(&mut self) -> Option<Key> {
            let mut bytes = Vec::new();
            while event::poll(Duration::ZERO).unwrap_or(false) {
                match event::read() {
                    Ok(Event::Key(key)) if key.kind == KeyEventKind::Press => match key.code {
                        KeyCode::Char(c) if c.is_ascii() => bytes.push(c as u8),
                        _ => {}
                    },
                    Ok(_) => {}
                    Err(_) => break,
                }
            }
            strongest(&bytes)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_is_stronger_than_a_pause() {
        assert_eq!(strongest(b"  s "), Some(Key::Stop));
        assert_eq!(strongest(b"x  "), Some(Key::PauseOrResume));
        assert_eq!(strongest(b"+-q"), None);
    }
}
