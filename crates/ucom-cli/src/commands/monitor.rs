//! `ucom monitor`: boards, bus load and foreign frames live. A full view on a terminal, one object a second elsewhere.

use std::collections::VecDeque;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

use cli_kit::Output;
use crossterm::event::{self, Event as Key, KeyCode, KeyModifiers};
use serde_json::{Value, json};
use ucom::master::{Board, Event, Life, Request};

use super::monitor_view as view;
use crate::args::{LinkArgs, MonitorArgs};
use crate::driver::{Driver, nothing_shared, shared_numbers, words};
use crate::failure::Failure;
use crate::lines::Lines;
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
    /// Another PC is master: nothing is asked.
    pub foreign_master: bool,
    /// Nothing may be sent.
    pub listen_only: bool,
    /// The boards are to be asked who they are.
    pub ask: bool,
    /// Rows of boards above the first one that is shown.
    pub scrolled: usize,
    loaded: Instant,
}

impl Watch {
    pub(super) fn new(url: String, listen_only: bool) -> Self {
        let (load, log) = (VecDeque::new(), VecDeque::new());
        let (foreign_master, ask, loaded) = (false, !listen_only, Instant::now());
        Self { url, load, log, foreign_master, listen_only, ask, scrolled: 0, loaded }
    }

    /// The row that is shown first, where so many of all have room.
    pub fn first(&self, room: usize, rows: usize) -> usize {
        self.scrolled.min(rows.saturating_sub(room))
    }

    /// Shows boards further down, or up.
    pub fn scroll(&mut self, by: isize, (room, rows): (usize, usize)) {
        self.scrolled = self.scrolled.saturating_add_signed(by);
        self.scrolled = self.first(room, rows);
    }

    /// Lets the bus go on for a moment.
    fn turn(&mut self, driver: &mut Driver) -> Result<(), Failure> {
        driver.turn(Duration::from_millis(25))?;
        let time_s = driver.now_us() as f64 * 1e-6;
        while let Some(event) = driver.master.take_event() {
            match &event {
                Event::ForeignMaster { .. } => {
                    if !self.foreign_master {
                        self.note(time_s, "another PC is master of the bus: this view only listens".into());
                    }
                    self.foreign_master = true;
                }
                Event::Note { .. } | Event::Done { .. } => {}
                other => {
                    if let Some(text) = words(other, None) {
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

    fn note(&mut self, time_s: f64, text: String) {
        self.log.push_back((time_s, text));
        if self.log.len() > LOG {
            self.log.pop_front();
        }
    }

    /// Asks once, or when the user wants it again. Asking all the time would look like a second master to others (D-08), and
    /// what changes is heard anyway.
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
    let mut driver = Driver::open(link, out)?;
    let mut watch = Watch::new(link.url()?.to_owned(), args.listen_only);
    let full = !out.is_json() && std::io::stdout().is_terminal() && std::io::stdin().is_terminal();
    let left = args.count.unwrap_or(u64::MAX);
    match full {
        true => live(&mut driver, &mut watch, left)?,
        false => lines(&mut driver, &mut watch, left, out)?,
    }
    nothing_shared(&driver.master)
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
        "foreign_master": watch.foreign_master,
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
        let status = b.status().map(|s| bits(s).join(" ")).unwrap_or_default();
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

/// What a board does, in one word: what is heard counts more than an old answer.
pub fn doing(board: &Board, now_us: u64) -> &'static str {
    if board.running(now_us) {
        return "running";
    }
    match (board.life, board.status()) {
        (Life::Alive, _) => "started",
        (_, Some(status)) => state(status),
        (_, None) => "?",
    }
}

/// Life signs in a word.
pub fn life(board: &Board) -> &'static str {
    match board.life {
        Life::Unarmed => "-",
        Life::Alive => "alive",
        Life::Late => "late",
        Life::Lost => "lost",
    }
}

/// Since the last life sign, s.
pub fn age_s(board: &Board, now_us: u64) -> Option<f64> {
    board.alive_at.map(|at| now_us.saturating_sub(at) as f64 * 1e-6)
}

fn live(driver: &mut Driver, watch: &mut Watch, mut left: u64) -> Result<(), Failure> {
    let mut terminal = ratatui::try_init()?;
    let mut run = || -> Result<(), Failure> {
        let mut drawn: Option<Instant> = None;
        let mut counted = Instant::now();
        let mut room = (0, 0);
        while left > 0 && !driver.stop_asked() {
            while event::poll(Duration::ZERO)? {
                if let Key::Key(key) = event::read()? {
                    let ctrl_c =
                        key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
                    if ctrl_c || matches!(key.code, KeyCode::Char('q') | KeyCode::Esc) {
                        return Ok(());
                    }
                    let page = room.0.max(1) as isize;
                    let by = match key.code {
                        KeyCode::Down | KeyCode::Char('j') => 1,
                        KeyCode::Up | KeyCode::Char('k') => -1,
                        KeyCode::PageDown | KeyCode::Char(' ') => page,
                        KeyCode::PageUp => -page,
                        KeyCode::Home => isize::MIN,
                        KeyCode::End => isize::MAX,
                        _ => 0,
                    };
                    watch.scroll(by, room);
                    watch.ask |= key.code == KeyCode::Char('r') && !watch.listen_only;
                }
            }
            watch.turn(driver)?;
            if counted.elapsed() >= Duration::from_secs(1) {
                counted = Instant::now();
                left -= 1;
            }
            if drawn.is_none_or(|at| at.elapsed() >= Duration::from_millis(100)) {
                drawn = Some(Instant::now());
                // Another size of the terminal, or a board that is gone, leaves nothing empty below the last one.
                watch.scroll(0, room);
                let (boards, statistics, now) =
                    (driver.master.boards(), driver.master.statistics(), driver.now_us());
                let picture = view::Picture { boards: &boards, statistics: &statistics, now, watch };
                terminal.draw(|frame| room = view::draw(frame, &picture))?;
            }
        }
        Ok(())
    };
    let done = run();
    ratatui::restore();
    done
}
