//! Input of single keys from the terminal. The terminal is restored when the command ends for any reason.
//!
//! While keys are read, Ctrl-C still sends a signal. Ctrl-Z is disabled while keys are read, because a suspended
//! command would leave a moving machine without supervision. Ctrl-S is disabled because it would block the command at
//! its next output, and the command could not read the stop key.

/// A key of the keyboard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// Letter or other character.
    Char(char),
    /// Arrow key up.
    Up,
    /// Arrow key down.
    Down,
    /// Arrow key left.
    Left,
    /// Arrow key right.
    Right,
    /// Key that scrolls back by one page.
    PageUp,
    /// Key that scrolls forward by one page.
    PageDown,
    /// Key that scrolls to the first row.
    Home,
    /// Key that scrolls to the last row.
    End,
    /// Escape key.
    Escape,
}

/// Converts bytes of a terminal to keys, and returns the remaining bytes. The remaining bytes are the possible start
/// of a key whose other bytes have not arrived yet.
#[cfg_attr(not(unix), allow(dead_code))]
fn parse(bytes: &[u8]) -> (Vec<Key>, &[u8]) {
    let (mut keys, mut rest) = (Vec::new(), bytes);
    while let [first, more @ ..] = rest {
        if *first != 0x1B {
            // This function ignores characters beyond ASCII, because each byte of such a character would produce a
            // wrong key.
            if first.is_ascii() {
                keys.push(Key::Char(char::from(*first)));
            }
            rest = more;
            continue;
        }
        let [b'[' | b'O', code @ ..] = more else {
            if more.is_empty() {
                break;
            }
            keys.push(Key::Escape);
            rest = more;
            continue;
        };
        let Some(end) = code.iter().position(|b| b.is_ascii_alphabetic() || *b == b'~') else { break };
        let key = match &code[..=end] {
            b"A" => Some(Key::Up),
            b"B" => Some(Key::Down),
            b"C" => Some(Key::Right),
            b"D" => Some(Key::Left),
            b"H" | b"1~" | b"7~" => Some(Key::Home),
            b"F" | b"4~" | b"8~" => Some(Key::End),
            b"5~" => Some(Key::PageUp),
            b"6~" => Some(Key::PageDown),
            _ => None,
        };
        keys.extend(key);
        rest = &code[end + 1..];
    }
    (keys, rest)
}

#[cfg(unix)]
pub use terminal::Keys;
#[cfg(unix)]
pub(crate) use terminal::restore;

#[cfg(unix)]
mod terminal {
    use std::io::IsTerminal;
    use std::sync::{Mutex, PoisonError};

    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use rustix::process::getpgrp;
    use rustix::stdio::stdin;
    use rustix::termios::{
        InputModes, LocalModes, OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcgetpgrp, tcsetattr,
    };

    use super::{Key, parse};

    /// State of the terminal before keys were read.
    static BEFORE: Mutex<Option<Termios>> = Mutex::new(None);

    /// Restores the terminal. A second call has no effect.
    pub(crate) fn restore() {
        if let Some(before) = BEFORE.lock().unwrap_or_else(PoisonError::into_inner).take() {
            let _ = tcsetattr(stdin(), OptionalActions::Now, &before);
        }
    }

    /// Key input from stdin, if stdin is a terminal and this process is in the foreground.
    pub struct Keys {
        /// Bytes of a key whose remaining bytes have not arrived yet.
        begun: Vec<u8>,
        gone: bool,
    }

    impl Keys {
        /// Starts to read single keys without echo. Returns `None` if stdin is not a terminal, or if this process is in
        /// the background.
        pub fn listen() -> Option<Self> {
            if !std::io::stdin().is_terminal() {
                return None;
            }
            // Only a foreground process is allowed to change the terminal mode. If a background process changed it,
            // the system would suspend the process.
            if tcgetpgrp(stdin()).is_ok_and(|foreground| foreground != getpgrp()) {
                return None;
            }
            let before = tcgetattr(stdin()).ok()?;
            let mut single = before.clone();
            single.local_modes.remove(LocalModes::ICANON | LocalModes::ECHO);
            single.input_modes.remove(InputModes::IXON);
            single.special_codes[SpecialCodeIndex::VMIN] = 0;
            single.special_codes[SpecialCodeIndex::VTIME] = 0;
            single.special_codes[SpecialCodeIndex::VSUSP] = 0;
            *BEFORE.lock().unwrap_or_else(PoisonError::into_inner) = Some(before);
            let keys = Self { begun: Vec::new(), gone: false };
            tcsetattr(stdin(), OptionalActions::Now, &single).ok()?;
            Some(keys)
        }

        /// Returns the keys pressed since the last call.
        pub fn pressed(&mut self) -> Vec<Key> {
            let input = stdin();
            let mut ready = [PollFd::new(&input, PollFlags::IN)];
            let waited = poll(&mut ready, Some(&Timespec { tv_sec: 0, tv_nsec: 0 }));
            let revents = ready[0].revents();
            if revents.intersects(PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL) {
                self.gone = true;
                return Vec::new();
            }
            if !matches!(waited, Ok(1..)) {
                // All bytes of a key arrive together. Therefore an Escape byte that no other byte follows is the
                // Escape key, not the start of another key.
                return if std::mem::take(&mut self.begun).is_empty() {
                    Vec::new()
                } else {
                    vec![Key::Escape]
                };
            }
            let mut bytes = [0; 64];
            let n = rustix::io::read(input, &mut bytes).unwrap_or(0);
            self.begun.extend_from_slice(&bytes[..n]);
            let (keys, rest) = parse(&self.begun);
            self.begun = rest.to_vec();
            keys
        }

        /// Returns `true` if the terminal was closed (hang-up), so that no further key will arrive.
        pub fn gone(&self) -> bool {
            self.gone
        }
    }

    impl Drop for Keys {
        fn drop(&mut self) {
            restore();
        }
    }
}

#[cfg(not(unix))]
pub use console::Keys;
#[cfg(not(unix))]
pub(crate) use console::restore;

#[cfg(not(unix))]
mod console {
    use std::io::IsTerminal;
    use std::time::Duration;

    use crossterm::event::{self, Event, KeyCode, KeyEventKind};

    use super::Key;

    /// Does nothing, because a console does not need another mode for single keys.
    pub(crate) fn restore() {}

    /// Key input from the console.
    pub struct Keys(());

    impl Keys {
        /// Returns `None` without a console.
        pub fn listen() -> Option<Self> {
            std::io::stdin().is_terminal().then_some(Self(()))
        }

        /// Returns the keys pressed since the last call.
        pub fn pressed(&mut self) -> Vec<Key> {
            let mut keys = Vec::new();
            while event::poll(Duration::ZERO).unwrap_or(false) {
                let Ok(event) = event::read() else { break };
                let Event::Key(key) = event else { continue };
                if key.kind != KeyEventKind::Press {
                    continue;
                }
                keys.extend(match key.code {
                    KeyCode::Char(c) => Some(Key::Char(c)),
                    KeyCode::Up => Some(Key::Up),
                    KeyCode::Down => Some(Key::Down),
                    KeyCode::PageUp => Some(Key::PageUp),
                    KeyCode::PageDown => Some(Key::PageDown),
                    KeyCode::Home => Some(Key::Home),
                    KeyCode::End => Some(Key::End),
                    KeyCode::Esc => Some(Key::Escape),
                    _ => None,
                });
            }
            keys
        }

        /// Returns `false`, because a console does not close before its processes end.
        pub fn gone(&self) -> bool {
            false
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_distinguished_and_a_begun_one_waits() {
        let keys = |bytes: &'static [u8]| parse(bytes);
        assert_eq!(
            keys(b"s \x1B[Bq"),
            (vec![Key::Char('s'), Key::Char(' '), Key::Down, Key::Char('q')], &b""[..])
        );
        assert_eq!(keys(b"\x1BOA\x1B[6~\x1B[1~"), (vec![Key::Up, Key::PageDown, Key::Home], &b""[..]));
        assert_eq!(keys(b"x\x1B[5"), (vec![Key::Char('x')], &b"\x1B[5"[..]));
        assert_eq!(keys(b"\x1B"), (vec![], &b"\x1B"[..]));
        // The parser ignores an unknown key (F5) and a letter that is not ASCII (é).
        assert_eq!(keys("\x1B[15~\u{e9}s".as_bytes()), (vec![Key::Char('s')], &b""[..]));
    }
}
