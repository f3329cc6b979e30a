//! Progress bars on stderr. Other output is printed above the progress bar, and a finished progress bar is removed.

use std::io::{IsTerminal, Write};
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle, WeakProgressBar};

use crate::view::LEAST;

/// Progress bar that was created last.
static LAST: Mutex<Option<WeakProgressBar>> = Mutex::new(None);

/// Hides the progress bar, calls `print`, and draws the progress bar again.
pub(crate) fn suspended<T>(print: impl FnOnce() -> T) -> T {
    let bar = LAST.lock().unwrap_or_else(PoisonError::into_inner).as_ref().and_then(WeakProgressBar::upgrade);
    match bar.filter(|bar| !bar.is_finished()) {
        Some(bar) => bar.suspend(print),
        None => print(),
    }
}

/// Writer to stderr for whole lines. While a progress bar is shown, the lines appear above the bar.
#[derive(Debug)]
pub struct Stderr;

impl Write for Stderr {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        suspended(|| std::io::stderr().write(bytes))
    }

    fn flush(&mut self) -> std::io::Result<()> {
        std::io::stderr().flush()
    }
}

/// Returns the number of columns of the terminal on stderr; `None` if stderr is not a terminal.
pub(crate) fn stderr_width() -> Option<u16> {
    std::io::stderr()
        .is_terminal()
        .then(|| crossterm::terminal::size().ok())
        .flatten()
        .map(|(columns, _)| columns)
}

/// Returns `Ok` if stderr is a terminal that is large enough for progress bars. If the terminal is too small, the
/// error contains its size. If stderr is not a terminal, the error is `None`.
pub fn draws_bars() -> Result<(), Option<(u16, u16)>> {
    if !std::io::stderr().is_terminal() {
        return Err(None);
    }
    match crossterm::terminal::size() {
        Ok((columns, rows)) if columns < LEAST.0 || rows < LEAST.1 => Err(Some((columns, rows))),
        _ => Ok(()),
    }
}

fn made(total: u64, template: &str) -> ProgressBar {
    let target =
        if draws_bars().is_ok() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(Some(total), target);
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style.progress_chars("━╸─"));
    *LAST.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.downgrade());
    bar
}

/// Creates a progress bar that shows a number of steps.
pub(crate) fn of_steps(total: u64, what: &str) -> ProgressBar {
    let bar = made(total, "{msg:8} {wide_bar:.cyan/dim} {pos:>5}/{len} {elapsed:>5}");
    bar.set_message(what.to_owned());
    bar
}

/// Creates a progress bar that shows a number of bytes. The text that the caller sets is below the progress bar, so
/// that the bar fits on narrow terminals.
pub(crate) fn of_bytes(total: u64, what: &str) -> ProgressBar {
    let bar = made(total, "{prefix:9} {wide_bar:.cyan/dim} {bytes:>9} of {total_bytes}\n  {msg}");
    bar.set_prefix(what.to_owned());
    bar
}

/// Creates a progress bar that shows the milliseconds of a motion.
pub(crate) fn of_motion(total_ms: u64, what: &str, keys: &str) -> ProgressBar {
    let below = if keys.is_empty() { "" } else { "\n{prefix}" };
    let of = total_ms as f64 * 1e-3;
    let template = format!("{what:8} {{wide_bar:.cyan/dim}} {{percent:>3}} % of {of:.1} s\n{{msg}}{below}");
    let bar = made(total_ms, &template);
    bar.set_prefix(keys.to_owned());
    bar
}
