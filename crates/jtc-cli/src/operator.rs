//! Interaction with the user while an arm moves: keys, Ctrl-C, and a message if the command ends at once.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use cli_kit::view::LEAST;
use cli_kit::{ErrorKind, Failure, Keys, Output, Stop, draws_bars, exit::FAULT};
use jtc_host::session::Flow;
use jtc_wire::{Code, Status, TrajectoryState};

use crate::keys::{HELP, HELP_WITH_SPEED, NO_SPEED, Wish, wish};
use crate::progress::Progress;
use cli_kit::output_file;

/// Longest time for printing the last message, so that a blocked output does not block the end of the command.
const LAST_WORDS: Duration = Duration::from_millis(300);

/// Handles the second signal. The function removes empty output files, reports why the command ended, and returns the
/// exit code.
pub(crate) fn ended_at_once(out: Output, message: &'static str, hint: &'static str) -> u8 {
    output_file::abandon();
    let (done, written) = mpsc::channel();
    std::thread::spawn(move || {
        out.failure(&Failure::new(ErrorKind::Fault, "ended-at-once", message).next(hint));
        Output::finish();
        let _ = done.send(());
    });
    let _ = written.recv_timeout(LAST_WORDS);
    FAULT
}

/// Values of the speed override that the user can select with keys, in percent.
const SPEEDS: [u8; 10] = [5, 10, 20, 30, 40, 50, 60, 70, 85, 100];

/// Reader of the requests of the user. The command reads the requests at each status.
pub(crate) struct Operator<'a> {
    /// Output to which messages for the user are printed.
    pub out: &'a Output,
    /// Writer of JSON events.
    pub progress: Progress,
    stop: Stop,
    /// Keyboard input of the user. The command reads keys only while the arm moves; at other times, the terminal mode
    /// is unchanged.
    keys: Option<Keys>,
    moving: Arc<AtomicBool>,
    stopping: bool,
    /// Trajectory state that the command announced last.
    announced: Option<Code<TrajectoryState>>,
    /// Speed override in percent; `None` if the controller does not support the override.
    pub speed: Option<u8>,
}

impl<'a> Operator<'a> {
    /// Starts to handle signals. The first SIGINT, SIGTERM or SIGHUP requests the end of the command. The second signal restores the
    /// terminal, prints a message about the arm, and ends the process at once.
    pub(crate) fn listen(out: &'a Output, progress: &Progress) -> Result<Self, Failure> {
        let moving = Arc::new(AtomicBool::new(false));
        let (its_moving, its_out) = (Arc::clone(&moving), *out);
        let stop = Stop::listen_with(move || {
            let (message, hint) = if its_moving.load(Ordering::Relaxed) {
                (
                    "ended at once: THE ARM MAY BE MOVING",
                    "`jtc traj stop` stops the arm on its path; the emergency stop always stops it",
                )
            } else {
                ("ended at once; this command moves nothing more", "")
            };
            ended_at_once(its_out, message, hint)
        })?;
        Ok(Self {
            out,
            progress: progress.clone(),
            stop,
            keys: None,
            moving,
            stopping: false,
            announced: None,
            speed: None,
        })
    }

    /// Returns `true` if the command must end. A Stop of the user ends the command even if the motion had already
    /// ended, so that the command does not start another motion.
    pub(crate) fn wants_the_end(&self) -> bool {
        self.stop.asked() || self.stopping
    }

    /// Starts to read keys from the terminal.
    pub(crate) fn motion_begins(&mut self) {
        self.moving.store(true, Ordering::Relaxed);
        self.announced = None;
        self.keys = Keys::listen();
        if self.keys.is_none() {
            return;
        }
        match draws_bars() {
            // No message is needed, because the key help is shown below the progress bar.
            Ok(()) if !self.out.is_json() => {}
            Err(Some((columns, rows))) => self.out.note(format_args!(
                "{}: the progress bar needs {} columns and {} rows, but the terminal has {columns} and \
                 {rows}",
                self.keys(),
                LEAST.0,
                LEAST.1
            )),
            _ => self.out.note(self.keys()),
        }
    }

    /// Returns the key help below a progress bar. Returns an empty text if the command does not read keys.
    pub(crate) fn keys(&self) -> &'static str {
        match (&self.keys, self.speed) {
            (None, _) => "",
            (_, None) => HELP,
            (_, Some(_)) => HELP_WITH_SPEED,
        }
    }

    /// Stops reading keys from the terminal.
    pub(crate) fn motion_ended(&mut self) {
        self.moving.store(false, Ordering::Relaxed);
        self.keys = None;
    }

    /// Returns the request of the user about the motion, from the keys and signals since the last status.
    pub(crate) fn wish(&mut self, status: &Status) -> Flow {
        if status.trajectory.is_in(&[TrajectoryState::Pause, TrajectoryState::Execute])
            && self.announced != Some(status.trajectory)
            // A held stop ends the run. The command reports the held stop with a separate message.
            && !status.is_held_stop()
        {
            let before = self.announced.replace(status.trajectory);
            match (status.trajectory == TrajectoryState::Pause, &self.keys) {
                (true, Some(_)) => self.out.note("paused; press space to resume"),
                (false, Some(_)) => self.out.note("moving"),
                // This is the first status of the motion, so no change is reported.
                (_, None) if before.is_none() => {}
                // Another program has paused the motion, or the controller has paused it after a timeout without
                // frames of this program (J-59).
                (true, None) => {
                    self.out.note("paused; `jtc traj resume` resumes the motion, `jtc traj stop` ends it");
                }
                (false, None) => self.out.note("moving"),
            }
        }
        let wish = self.keys.as_mut().and_then(wish);
        if self.stop.asked() || wish == Some(Wish::Stop) {
            if !std::mem::replace(&mut self.stopping, true) {
                self.out.note("stopping on the path");
            }
            return Flow::Stop;
        }
        match (wish, status.trajectory.known()) {
            (Some(Wish::PauseOrResume), Some(TrajectoryState::Execute)) => Flow::Pause,
            (Some(Wish::PauseOrResume), Some(TrajectoryState::Pause)) => Flow::Resume,
            (Some(wish @ (Wish::Faster | Wish::Slower)), _) => self.another_speed(wish),
            _ => Flow::Continue,
        }
    }

    /// Requests the next higher or next lower speed.
    fn another_speed(&mut self, wish: Wish) -> Flow {
        let Some(speed) = &mut self.speed else {
            self.out.note(NO_SPEED.replace('`', ""));
            return Flow::Continue;
        };
        let next = SPEEDS.iter().copied();
        let next = match wish {
            Wish::Faster => next.clone().find(|next| *next > *speed),
            _ => next.rev().find(|next| *next < *speed),
        };
        let Some(next) = next else { return Flow::Continue };
        *speed = next;
        self.out.note(format_args!("speed {next} %"));
        Flow::Speed(next)
    }
}
