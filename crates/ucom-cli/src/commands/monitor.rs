//! Command `ucom monitor`: live view of boards, bus load and foreign frames. On a terminal, the command shows a
//! full-screen view; on other outputs, it prints one object per second.

use host_kit::visible_in_line;
use std::time::{Duration, Instant};

use cli_kit::view::Scroll;
use cli_kit::{Failure, Key, Lines, Output, Screen};
use serde_json::{Value, json};
use ucom_host::master::Board;
use ucom_host::session::{Driver, Picture, Watch, nothing_shared};

use super::monitor_view as view;
use crate::args::{LinkArgs, MonitorArgs};
use crate::session::shared_numbers;
use crate::shape::{bits, info_value};

/// Shows the bus until the user presses `q` or Ctrl-C, or until the requested number of views was shown.
pub(super) fn monitor(args: &MonitorArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
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
    // The first view is printed about two seconds after the start, so that the first scan can end before.
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
        value["state"] = json!(b.state_name(now));
        value["life"] = json!(b.life.name());
        value["alive_age_s"] = json!(b.alive_age_s(now));
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
        let status = b.status().filter(|_| b.is_known()).map(|s| bits(s).join(" ")).unwrap_or("?".into());
        text += &format!(
            "  board {number:<2} {:20} {:34} {:8} {:5} frames/s\n",
            visible_in_line(b.description.as_deref().unwrap_or("?")),
            status,
            b.life.name(),
            statistics.frames_per_s(number, now)
        );
    }
    for error in driver.master.shared_numbers() {
        text += &format!("  ! {error}\n");
    }
    text
}

/// Minimum time between two updates of the view.
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
            let controller = driver.controller();
            let shared: Vec<String> =
                driver.master.shared_numbers().iter().map(ToString::to_string).collect();
            let (boards, statistics, now) =
                (driver.master.boards(), driver.master.statistics(), driver.now_us());
            let picture =
                Picture { boards: &boards, statistics: &statistics, shared: &shared, controller, now, watch };
            screen.draw(|frame| view::draw(frame, &picture, &mut scroll));
        }
    }
    Ok(())
}
