//! Ctrl-C and similar signals as a flag, which loops of the command check.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Returns the signals that end a command: Ctrl-C, `kill`, and SIGHUP when its terminal closes. SIGHUP is not in the
/// list if the command was started with `nohup`.
fn signals() -> impl Iterator<Item = i32> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    #[cfg(unix)]
    let hangup = (!hangup_ignored()).then_some(signal_hook::consts::SIGHUP);
    #[cfg(not(unix))]
    let hangup = None;
    [SIGINT, SIGTERM].into_iter().chain(hangup)
}

/// Returns `true` if the operating system reports that this process was started with SIGHUP ignored.
#[cfg(unix)]
fn hangup_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|digits| u64::from_str_radix(digits.trim(), 16).ok()).is_some_and(|mask| mask & 1 != 0)
}

/// Interval at which the thread of [`Stop::listen_with`] checks for signals.
const LOOK: Duration = Duration::from_millis(10);
/// Time within which several signals count as one signal.
const ONE_PRESS: Duration = Duration::from_millis(100);

/// Flag that SIGINT, SIGTERM or SIGHUP sets.
#[derive(Clone, Debug)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Starts to handle signals. The first SIGINT, SIGTERM or SIGHUP sets the flag; the second signal ends the process.
    pub fn listen() -> std::io::Result<Self> {
        let flag = Arc::new(AtomicBool::new(false));
        for signal in signals() {
            // If the flag is already set, this handler ends the process; therefore the second Ctrl-C always ends the
            // process. The handler must be registered before the one that sets the flag. Otherwise the first Ctrl-C
            // would end the process.
            signal_hook::flag::register_conditional_shutdown(signal, 130, Arc::clone(&flag))?;
            signal_hook::flag::register(signal, Arc::clone(&flag))?;
        }
        Ok(Self(flag))
    }

    /// Starts to handle signals. The first SIGINT, SIGTERM or SIGHUP sets the flag. The second signal ends the process
    /// in every state, after the terminal is restored. The closure `last_words` returns the exit code, runs in
    /// a separate thread, and may print.
    ///
    /// Signals that follow each other within 0.1 s count as one signal, because a terminal and a wrapper program may
    /// both send a signal.
    pub fn listen_with(last_words: impl Fn() -> u8 + Send + 'static) -> std::io::Result<Self> {
        let came = Arc::new(AtomicBool::new(false));
        for signal in signals() {
            signal_hook::flag::register(signal, Arc::clone(&came))?;
        }
        let asked = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&asked);
        std::thread::Builder::new().name("signals".into()).spawn(move || {
            loop {
                std::thread::sleep(LOOK);
                if came.swap(false, Ordering::Relaxed) {
                    if flag.swap(true, Ordering::Relaxed) {
                        crate::restore_terminal();
                        std::process::exit(last_words().into());
                    }
                    std::thread::sleep(ONE_PRESS);
                    came.store(false, Ordering::Relaxed);
                }
            }
        })?;
        Ok(Self(asked))
    }

    /// Returns `true` if a signal has requested the end of the command.
    pub fn asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
