//! Live view of a bus: load, events, problems with the next command, and the message about the last request.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use ucom::{Function, Profile};

use super::driver::{Driver, event_text};
use super::error::SessionError;
use crate::master::doctor::{Controller, Observation, Severity, findings};
use crate::master::{Boards, Event, Request, Statistics};

/// Function of another PC's frame, and the number that the frame was sent to.
pub type CompetingMaster = (Function, u8);

/// Length of the bus load curve in seconds.
pub const HISTORY: usize = 120;
/// Largest number of lines in the log of events.
pub const LOG: usize = 200;

/// Content of the live view without the boards.
pub struct Watch {
    /// URL of the bus.
    pub url: String,
    /// Bus load in percent, one value per second.
    pub load: VecDeque<f64>,
    /// Log of events, each as time in s and text, oldest first.
    pub log: VecDeque<(f64, String)>,
    /// Last frame of another PC that is a master. If this field is set, the view sends no query.
    pub competing_master: Option<CompetingMaster>,
    /// `true` if the view must not send any frame.
    pub listen_only: bool,
    /// `true` to send queries for the identity of the boards.
    pub ask: bool,
    /// Profile of the boards.
    pub profile: Profile,
    /// Message about the last request; the message is kept until the next request.
    pub message: String,
    loaded: Instant,
}

/// Time in µs that boards have for an answer before the view reports silence.
const QUIET_US: u64 = 2_000_000;

impl Watch {
    /// Creates the live view of a bus. With `listen_only`, the view never sends a frame.
    pub fn new(url: String, listen_only: bool, profile: Profile) -> Self {
        Self {
            url,
            load: VecDeque::new(),
            log: VecDeque::new(),
            competing_master: None,
            listen_only,
            ask: !listen_only,
            profile,
            message: String::new(),
            loaded: Instant::now(),
        }
    }

    /// Returns `true` if the boards have had enough time to answer.
    pub fn quiet_long(&self, now_us: u64) -> bool {
        now_us >= QUIET_US
    }

    /// Handles the frames of the bus for a short time.
    pub fn turn(&mut self, driver: &mut Driver) -> Result<(), SessionError> {
        driver.turn(Duration::from_millis(25))?;
        let time_s = driver.now_us() as f64 * 1e-6;
        while let Some(event) = driver.master.take_event() {
            match &event {
                Event::CompetingMaster { function, to } => {
                    if self.competing_master.is_none() {
                        self.note(
                            time_s,
                            "another PC is master of the bus: this view sends no requests".into(),
                        );
                    }
                    self.competing_master = Some((*function, *to));
                }
                Event::Note { .. } | Event::Done { .. } => {}
                other => {
                    if let Some(text) = event_text(other, None) {
                        self.note(time_s, text);
                    }
                }
            }
        }
        if self.loaded.elapsed() >= Duration::from_secs(1) {
            self.loaded = Instant::now();
            self.load.push_back(driver.master.statistics().load_percent(driver.now_us()));
            if self.load.len() > HISTORY {
                self.load.pop_front();
            }
        }
        self.question(driver);
        Ok(())
    }

    /// Stops the control loops of all boards. For this stop, the PC does not need to be the master.
    pub fn stop(&mut self, driver: &mut Driver) {
        if self.listen_only {
            self.message =
                "nothing was sent because of --listen-only; `ucom stop all` stops the boards".into();
            return;
        }
        driver.stop_at_once(None);
        self.message = "Stop sent to all boards; `ucom stop all` also ends their applications".into();
    }

    /// Sends queries for the identity of the boards again, if queries are allowed.
    pub fn ask_again(&mut self) {
        self.ask = !self.listen_only;
        self.message = if self.listen_only {
            "no request was sent because of --listen-only"
        } else {
            "the boards are asked again"
        }
        .into();
    }

    fn note(&mut self, time_s: f64, text: String) {
        self.log.push_back((time_s, text));
        if self.log.len() > LOG {
            self.log.pop_front();
        }
    }

    /// Sends queries to the boards once, and again if the user requests it. Permanent queries are not necessary,
    /// because the view receives changes of boards without queries. To other PCs, they would look like a second
    /// master (D-08).
    fn question(&mut self, driver: &mut Driver) {
        if self.ask && !driver.master.is_busy() {
            self.ask = false;
            // No other procedure runs, so the start of the scan cannot fail because of a conflict.
            let _ = driver.master.start(driver.now_us(), Request::Scan);
        }
    }
}

/// Content of the live view at one time.
pub struct Picture<'a> {
    /// Last known states of the boards.
    pub boards: &'a Boards,
    /// Counters of the frames on the bus.
    pub statistics: &'a Statistics,
    /// Numbers that two boards share, as text.
    pub shared: &'a [String],
    /// State of the CAN adapter, if the adapter reports it.
    pub controller: Option<Controller>,
    /// Time to which the content belongs, µs.
    pub now: u64,
    /// Content of the live view without the boards.
    pub watch: &'a Watch,
}

/// Problems on the bus, with the next command.
#[derive(Clone, Debug, Default)]
pub struct Problems {
    /// Problems that prevent the operation of boards.
    pub causes: Vec<String>,
    /// Problems that do not prevent the operation of boards.
    pub warnings: Vec<String>,
    /// Next command for the most serious problem; empty if no command is needed.
    pub next: String,
}

impl Picture<'_> {
    /// Returns the problems that the received frames show, and the numbers that two boards share.
    pub fn problems(&self) -> Problems {
        let Picture { boards, statistics, now, watch, .. } = self;
        let seen = Observation {
            listened_us: *now,
            now_us: *now,
            statistics: (*statistics).clone(),
            boards: (*boards).clone(),
            controller: self.controller,
            competing_master: watch.competing_master,
            profile: watch.profile,
            ..Default::default()
        };
        let mut problems = Problems { causes: self.shared.to_vec(), ..Problems::default() };
        let mut next: Vec<String> = Vec::new();
        if !problems.causes.is_empty() {
            next.push("ucom doctor".into());
        }
        let all = findings(&seen).into_iter();
        // The finding about a silent bus is skipped. The view reports silence below, with a text that depends on
        // whether it has sent queries.
        for finding in all.filter(|f| f.severity != Severity::Good && !f.what.starts_with("no frame")) {
            let why = if finding.why.is_empty() { String::new() } else { format!(": {}", finding.why) };
            let text = format!("{}{why}", finding.what);
            let list = if finding.severity == Severity::Problem {
                &mut problems.causes
            } else {
                &mut problems.warnings
            };
            list.push(text);
            // If the hint is missing, or recommends `ucom monitor`, which is this view, another command is shown.
            let helps = finding.next.to_string();
            let own = helps.is_empty() || helps.contains("ucom monitor");
            next.push(if own { "ucom doctor".into() } else { helps });
        }
        for (number, _) in boards.iter().filter(|(_, b)| b.info.is_some_and(|i| !i.has_application())) {
            problems.warnings.push(format!("board {number} has no valid application"));
            next.push(format!("ucom update {number} IMAGE"));
        }
        if boards.iter().next().is_none() && watch.quiet_long(*now) {
            problems.warnings.push(nobody(watch).into());
            next.push(
                if watch.listen_only { "ucom monitor" } else { "ucom doctor; ucom init numbers the chain" }
                    .into(),
            );
        }
        problems.next = next.into_iter().next().unwrap_or_default();
        problems
    }
}

fn nobody(watch: &Watch) -> &'static str {
    match watch.listen_only {
        true => "no board sends frames; without --listen-only, ucom asks the boards for their identity",
        false => "no board answers",
    }
}
