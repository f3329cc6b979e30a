//! What `ucom monitor` knows beside the boards: load, events, and what became of the last key.

use cli_kit::Failure;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

use ucom::{Function, Profile};
use ucom_host::master::{Event, Request};
use ucom_host::session::{Driver, event_text};

/// Function and addressee of another PC's frame.
pub type CompetingMaster = (Function, u8);

/// Seconds of bus load that the curve shows.
pub const HISTORY: usize = 120;
/// Lines of the log that are kept.
pub const LOG: usize = 200;

/// What the view shows beside the boards.
pub struct Watch {
    /// The bus.
    pub url: String,
    /// Percent, one value a second.
    pub load: VecDeque<f64>,
    /// What happened, oldest first: time in s and words.
    pub log: VecDeque<(f64, String)>,
    /// Another PC is master, by what it sent last: nothing is asked.
    pub competing_master: Option<CompetingMaster>,
    /// Nothing may be sent.
    pub listen_only: bool,
    /// The boards are to be asked who they are.
    pub ask: bool,
    /// How the boards read the protocol.
    pub profile: Profile,
    /// What became of the last key, until the next one.
    pub message: String,
    loaded: Instant,
}

/// So long boards have for their answer before silence is reported, µs.
const QUIET_US: u64 = 2_000_000;

impl Watch {
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

    /// Who is there has had the time to answer.
    pub fn quiet_long(&self, now_us: u64) -> bool {
        now_us >= QUIET_US
    }

    /// Lets the bus go on for a moment.
    pub fn turn(&mut self, driver: &mut Driver) -> Result<(), Failure> {
        driver.turn(Duration::from_millis(25))?;
        let time_s = driver.now_us() as f64 * 1e-6;
        while let Some(event) = driver.master.take_event() {
            match &event {
                Event::CompetingMaster { function, to } => {
                    if self.competing_master.is_none() {
                        self.note(time_s, "another PC is master of the bus: this view only listens".into());
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

    /// Stops the control loops of all boards; who is master does not matter for that.
    pub fn stop(&mut self, driver: &mut Driver) {
        if self.listen_only {
            self.message = "--listen-only: nothing was sent; `ucom stop all` stops the boards".into();
            return;
        }
        driver.stop_at_once(None);
        self.message = "stop sent to all boards; `ucom stop all` also ends their applications".into();
    }

    /// Asks the boards again who they are, where that is allowed.
    pub fn ask_again(&mut self) {
        self.ask = !self.listen_only;
        self.message =
            if self.listen_only { "--listen-only: nothing is asked" } else { "asked again" }.into();
    }

    fn note(&mut self, time_s: f64, text: String) {
        self.log.push_back((time_s, text));
        if self.log.len() > LOG {
            self.log.pop_front();
        }
    }

    /// Asks once, or when the user wants it again. Asking all the time would look like a second master to others (D-08), and
    /// what changes is received anyway.
    fn question(&mut self, driver: &mut Driver) {
        if self.ask && !driver.master.is_busy() {
            self.ask = false;
            // Nothing else is under way that it could meet.
            let _ = driver.master.start(driver.now_us(), Request::Scan);
        }
    }
}
