//! `ucom monitor`: boards, bus load and foreign frames live. A full view on a terminal, one object a second elsewhere.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use cli_kit::view::Scroll;
use cli_kit::{Key, Lines, Output, Screen};
use serde_json::{Value, json};
use ucom::Profile;
use ucom_host::master::{Board, Event, Life, Request};
use ucom_host::session::{Driver, event_text, nothing_shared};

use super::doctor::controller;
use super::monitor_view::{self as view, CompetingMaster};
use crate::args::{LinkArgs, MonitorArgs};
use crate::failure::Failure;
use crate::session::shared_numbers;
use crate::shape::{bits, info_value, state};

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
    pub(super) fn new(url: String, listen_only: bool, profile: Profile) -> Self {
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
    fn turn(&mut self, driver: &mut Driver) -> Result<(), Failure> {
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
    fn stop(&mut self, driver: &mut Driver) {
        if self.listen_only {
            self.message = "--listen-only: nothing was sent; `ucom stop all` stops the boards".into();
            return;
        }
        driver.stop_at_once(None);
        self.message = "stop sent to all boards; `ucom stop all` also ends their applications".into();
    }

    /// Asks the boards again who they are, where that is allowed.
    fn ask_again(&mut self) {
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

/// Shows the bus until `q`, Ctrl-C, or so many views.
pub fn monitor(args: &MonitorArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut driver = link.session()?;
    let mut watch = Watch::new(link.url()?.to_owned(), args.listen_only, driver.master.profile());
    let left = args.count.unwrap_or(u64::MAX);
    let screen = if out.is_json() { None } else { Screen::take()? };
    match screen {
        Some(screen) => live(&mut driver, &mut watch, left, screen)?,
        None => lines(&mut driver, &mut watch, left, out)?,
    }
    Ok(nothing_shared(&driver.master)?)
}

fn lines(driver: &mut Driver, watch: &mut Watch, mut left: u64, out: &Output) -> Result<(), Failure> {
    let mut shown = Instant::now();
    // The first view waits for the scan.
    let first = Instant::now();
    let stdout = Lines::stdout()?;
    while left > 0 && !driver.stop_asked() && !stdout.gone() {
        watch.turn(driver)?;
        if shown.elapsed() < Duration::from_secs(1) || first.elapsed() < Duration::from_millis(2000) {
            continue;
        }
        shown = Instant::now();
        left -= 1;
        stdout.push(out.words(&value(driver, watch), || text(driver)));
        watch.log.clear();
    }
    Ok(())
}

fn value(driver: &Driver, watch: &Watch) -> Value {
    let (now, profile) = (driver.now_us(), driver.master.profile());
    let (boards, statistics) = (driver.master.boards(), driver.master.statistics());
    let board = |(number, b): (u8, &Board)| {
        let mut value =
            b.info.map_or_else(|| json!({ "number": number }), |i| info_value(number, &i, &profile));
        value["description"] = json!(b.description);
        value["state"] = json!(doing(b, now));
        value["life"] = json!(life(b));
        value["alive_age_s"] = json!(age_s(b, now));
        value["frames_per_s"] = json!(statistics.frames_per_s(number, now));
        value["errors"] = json!(b.error_count);
        value["last_error"] = json!(b.errors.last().map(|(_, code)| code.name()));
        value
    };
    json!({
        "time_s": now as f64 * 1e-6,
        "load_percent": statistics.load_percent(now),
        "received": statistics.received,
        "foreign_frames": statistics.foreign_count(),
        "foreign_master": watch.competing_master.is_some(),
        "shared_numbers": shared_numbers(&driver.master),
        "boards": boards.iter().map(board).collect::<Vec<_>>(),
        "events": watch.log.iter().map(|(time_s, text)| json!({ "time_s": time_s, "text": text })).collect::<Vec<_>>(),
    })
}

fn text(driver: &Driver) -> String {
    let now = driver.now_us();
    let (boards, statistics) = (driver.master.boards(), driver.master.statistics());
    let mut text = format!(
        "{:8.1} s  load {:.1} %, {} foreign frames\n",
        now as f64 * 1e-6,
        statistics.load_percent(now),
        statistics.foreign_count()
    );
    for (number, b) in boards.iter() {
        let status = b.status().filter(|_| is_known(b)).map(|s| bits(s).join(" ")).unwrap_or("?".into());
        text += &format!(
            "  board {number:<2} {:20} {:34} {:8} {:5} frames/s\n",
            b.description.as_deref().unwrap_or("?"),
            status,
            life(b),
            statistics.frames_per_s(number, now)
        );
    }
    for error in driver.master.shared_numbers() {
        text += &format!("  ! {error}\n");
    }
    text
}

/// What was last received of a board still holds: it is not lost, and has not begun anew.
pub fn is_known(board: &Board) -> bool {
    board.life != Life::Lost && !board.rebooted
}

/// What a board does, in one word: what comes by itself counts more than an old answer.
pub fn doing(board: &Board, now_us: u64) -> &'static str {
    if board.rebooted {
        return "rebooted";
    }
    if board.life == Life::Lost {
        return "lost";
    }
    if board.running(now_us) {
        return "running";
    }
    match (board.life, board.status()) {
        (Life::Alive, _) => "started",
        (_, Some(status)) => state(status),
        (_, None) => "?",
    }
}

/// Heartbeats in a word.
pub fn life(board: &Board) -> &'static str {
    match board.life {
        Life::Unarmed => "-",
        Life::Alive => "alive",
        Life::Late => "late",
        Life::Lost => "lost",
    }
}

/// Since the last heartbeat, s.
pub fn age_s(board: &Board, now_us: u64) -> Option<f64> {
    board.alive_at.map(|at| now_us.saturating_sub(at) as f64 * 1e-6)
}

/// A picture is drawn no more often than this.
const PICTURE: Duration = Duration::from_millis(100);

fn live(driver: &mut Driver, watch: &mut Watch, mut left: u64, mut screen: Screen) -> Result<(), Failure> {
    let (mut drawn, mut counted): (Option<Instant>, _) = (None, Instant::now());
    let mut scroll = Scroll::default();
    while left > 0 && !driver.stop_asked() && !screen.gone() {
        for key in screen.pressed() {
            match key {
                Key::Char('q') | Key::Escape => return Ok(()),
                Key::Char('s') => watch.stop(driver),
                Key::Char('r') => watch.ask_again(),
                key => {
                    watch.message.clear();
                    scroll.key(key);
                }
            }
        }
        watch.turn(driver)?;
        if counted.elapsed() >= Duration::from_secs(1) {
            counted = Instant::now();
            left -= 1;
        }
        if drawn.is_none_or(|at| at.elapsed() >= PICTURE) {
            drawn = Some(Instant::now());
            let controller = controller(driver);
            let shared: Vec<String> =
                driver.master.shared_numbers().iter().map(ToString::to_string).collect();
            let (boards, statistics, now) =
                (driver.master.boards(), driver.master.statistics(), driver.now_us());
            let picture = view::Picture {
                boards: &boards,
                statistics: &statistics,
                shared: &shared,
                controller,
                now,
                watch,
            };
            screen.draw(|frame| view::draw(frame, &picture, &mut scroll));
        }
    }
    Ok(())
}
