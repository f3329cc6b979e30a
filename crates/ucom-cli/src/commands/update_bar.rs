//! Progress bar of a firmware update on stderr. A separate thread draws the bar. A blocked terminal (Ctrl-S)
//! therefore does not delay the transfer of a block.

use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::time::Duration;

use cli_kit::{ErrorKind, Failure, Output, ProgressBar};
use ucom_host::master::Event;
use ucom_host::master::update::Progress;

/// Maximum number of steps that are queued for the progress bar; further steps are dropped.
const WAITING: usize = 4;
/// Maximum wait for a blocked terminal when the progress bar ends.
const PRINT_TIMEOUT: Duration = Duration::from_secs(1);

/// State of the progress bar that is drawn next.
struct Step {
    bar: ProgressBar,
    /// Number of the progress bar. A progress bar with a new number replaces the previous bar.
    serial: usize,
    bytes: u64,
    message: String,
}

/// Progress bar for the boards that are being updated.
pub(super) struct Bar<'a> {
    out: &'a Output,
    bar: Option<(Vec<u8>, ProgressBar)>,
    serial: usize,
    steps: SyncSender<Step>,
    /// Channel that closes when the drawing thread ends.
    ended: Receiver<()>,
}

impl<'a> Bar<'a> {
    /// Creates a progress bar that is hidden until the first progress event.
    pub(super) fn new(out: &'a Output) -> Result<Self, Failure> {
        let (steps, drawn) = sync_channel(WAITING);
        let (end, ended) = channel::<()>();
        let draw = move || {
            draw(&drawn);
            drop(end);
        };
        std::thread::Builder::new().name("progress".into()).spawn(draw).map_err(|e| {
            Failure::new(ErrorKind::Fault, "thread", format!("the progress bar cannot start: {e}"))
        })?;
        Ok(Self { out, bar: None, serial: 0, steps, ended })
    }

    /// Draws the progress that an event reports, if the terminal accepts output.
    pub(super) fn see(&mut self, event: &Event) {
        let Event::Progress { progress, .. } = event else { return };
        if self.bar.as_ref().is_none_or(|(boards, _)| *boards != progress.boards) {
            let list: Vec<String> = progress.boards.iter().map(u8::to_string).collect();
            let bar = self.out.bytes_bar(progress.total, &format!("board {}", list.join(", ")));
            self.serial += 1;
            self.bar = Some((progress.boards.clone(), bar));
        }
        if let Some((_, bar)) = &self.bar {
            let (bar, serial) = (bar.clone(), self.serial);
            let step = Step { bar, serial, bytes: progress.bytes, message: message(progress) };
            // If the queue of steps is full, the new step is dropped. The next step also contains the progress of
            // the dropped step.
            let _ = self.steps.try_send(step);
        }
    }

    /// Removes the progress bar; must be called before the command prints other output.
    pub(super) fn end(self) {
        let Self { steps, ended, .. } = self;
        drop(steps);
        // The drawing thread sends no message; the channel closes when this thread ends.
        let _ = ended.recv_timeout(PRINT_TIMEOUT);
    }
}

fn draw(steps: &Receiver<Step>) {
    let mut shown: Option<(usize, ProgressBar)> = None;
    for Step { bar, serial, bytes, message } in steps {
        if let Some((_, old)) = shown.take_if(|(old, _)| *old != serial) {
            old.finish_and_clear();
        }
        bar.set_position(bytes);
        bar.set_message(message);
        shown = Some((serial, bar));
    }
    if let Some((_, bar)) = shown {
        bar.finish_and_clear();
    }
}

fn message(p: &Progress) -> String {
    let cycle = if p.cycle == 1 { "checking" } else { "writing" };
    let attempt = if p.attempt > 1 { format!(", attempt {}", p.attempt) } else { String::new() };
    let (rate, left) = (p.rate as f64 / 1000.0, p.remaining_us as f64 * 1e-6);
    format!("{cycle}{attempt}, {rate:.1} kB/s, {left:.0} s left")
}
