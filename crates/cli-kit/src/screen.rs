//! The whole terminal as a live view: entered, drawn, and left as it was however the command ends.

use std::io::{IsTerminal, Stdout, Write};
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, Ordering};

use crossterm::cursor::Show;
use crossterm::queue;
use crossterm::terminal::{EnterAlternateScreen, LeaveAlternateScreen};
use ratatui::backend::CrosstermBackend;
use ratatui::{Frame, Terminal};

use crate::keys::{Key, Keys};

/// A view is shown.
static SHOWN: AtomicBool = AtomicBool::new(false);

/// Puts the terminal back as it was, whatever changed it. Does nothing the second time; a terminal that has gone is no matter.
pub fn restore_terminal() {
    if SHOWN.swap(false, Ordering::Relaxed) {
        let mut stdout = std::io::stdout();
        let _ = queue!(stdout, LeaveAlternateScreen, Show).and_then(|()| stdout.flush());
    }
    crate::keys::restore();
}

/// The terminal of a view, with the keys of the person at it.
pub struct Screen {
    /// Never dropped: it would print, and panic where the terminal has gone.
    terminal: ManuallyDrop<Terminal<CrosstermBackend<Stdout>>>,
    keys: Keys,
    gone: bool,
}

impl Screen {
    /// Takes the terminal; `None` where stdin or stdout is none, or this process is in the background: lines are printed there.
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

    /// Keys pressed since the last look.
    pub fn pressed(&mut self) -> Vec<Key> {
        self.keys.pressed()
    }

    /// Draws a picture. One that cannot be drawn is the last.
    pub fn draw(&mut self, picture: impl FnOnce(&mut Frame<'_>)) {
        self.gone |= self.terminal.draw(picture).is_err();
    }

    /// Nobody sees the view any more.
    pub fn gone(&self) -> bool {
        self.gone || self.keys.gone()
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        restore_terminal();
    }
}
