//! Live view that uses the whole terminal. The terminal is restored when the command ends for any reason.

use std::io::{IsTerminal, Stdout, Write};
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, Ordering};

use crossterm::cursor::Show;
use crossterm::queue;
use crossterm::terminal::{EnterAlternateScreen, LeaveAlternateScreen};
use ratatui::backend::CrosstermBackend;
use ratatui::{Frame, Terminal};

use crate::keys::{Key, Keys};

/// `true` while a live view is shown.
static SHOWN: AtomicBool = AtomicBool::new(false);

/// Restores the terminal if a live view or key input has changed it. A second call has no effect, and errors of a lost
/// terminal are ignored.
pub fn restore_terminal() {
    if SHOWN.swap(false, Ordering::Relaxed) {
        let mut stdout = std::io::stdout();
        let _ = queue!(stdout, LeaveAlternateScreen, Show).and_then(|()| stdout.flush());
    }
    crate::keys::restore();
}

/// Terminal of a live view, with the key input.
pub struct Screen {
    /// The process never drops this value, because dropping it would print, and would panic if the terminal is lost.
    terminal: ManuallyDrop<Terminal<CrosstermBackend<Stdout>>>,
    keys: Keys,
    gone: bool,
}

impl Screen {
    /// Opens a live view on the terminal. Returns `None` if stdin or stdout is not a terminal, or if this process is in
    /// the background. The caller then prints lines instead.
    pub fn take() -> std::io::Result<Option<Self>> {
        if !std::io::stdout().is_terminal() {
            return Ok(None);
        }
        let Some(keys) = Keys::listen() else { return Ok(None) };
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            restore_terminal();
            before(info);
        }));
        let mut stdout = std::io::stdout();
        SHOWN.store(true, Ordering::Relaxed);
        let screen = queue!(stdout, EnterAlternateScreen)
            .and_then(|()| Terminal::new(CrosstermBackend::new(stdout)))
            .map(|terminal| Self { terminal: ManuallyDrop::new(terminal), keys, gone: false })
            .inspect_err(|_| restore_terminal())?;
        Ok(Some(screen))
    }

    /// Returns the keys pressed since the last call.
    pub fn pressed(&mut self) -> Vec<Key> {
        self.keys.pressed()
    }

    /// Draws the live view. After a failure, the view is not drawn again.
    pub fn draw(&mut self, picture: impl FnOnce(&mut Frame<'_>)) {
        self.gone |= self.terminal.draw(picture).is_err();
    }

    /// Returns `true` if the terminal of the live view was closed.
    pub fn gone(&self) -> bool {
        self.gone || self.keys.gone()
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        restore_terminal();
    }
}
