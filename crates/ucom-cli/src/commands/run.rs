//! `ucom run` and `ucom so`: control loops under supervision, and what they send.

use std::collections::BTreeMap;
use std::io::BufRead;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use cli_kit::Output;
use serde_json::{Map, Value, json};
use ucom::master::io::{IoDescription, Snapshot, short};
use ucom::master::{
    AdminChange, Event, Outcome, Request, RunBoard, RunOptions, Setting, StopLevel, Supervision,
};

use crate::args::{Assignment, LinkArgs, OnLost, RunArgs, SoArgs};
use crate::driver::{Driver, unexpected};
use crate::failure::{FAULT, Failure, NO_LINK};

/// How often `run` says how things are.
const SAY: Duration = Duration::from_secs(1);

/// Assignments as the library takes them.
pub fn settings(list: &[Assignment]) -> Vec<Setting> {
    list.iter().map(|a| Setting { name: a.name.clone(), value: a.value as u16 }).collect()
}

/// Words by the names of their edges, signed (D-11).
pub fn named(names: &[String], words: &[u16]) -> Value {
    let key = |i: usize| names.get(i).map_or_else(|| format!("#{i}"), |name| short(name).to_owned());
    let pairs = words.iter().enumerate().map(|(i, word)| (key(i), json!(*word as i16)));
    Value::Object(pairs.collect::<Map<_, _>>())
}

/// Starts boards and keeps them running until Ctrl-C.
pub fn run(args: &RunArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut profile = link.profile()?;
    if let Some(policy) = args.on_lost {
        profile.on_lost = match policy {
            OnLost::Report => ucom::profile::OnLost::Report,
            OnLost::StopBoard => ucom::profile::OnLost::StopBoard,
            OnLost::StopAll => ucom::profile::OnLost::StopAll,
        };
    }
    let mut driver = Driver::with_profile(link, profile, out)?;
    let boards = driver.numbers(&args.boards)?;
    let of = |list: &[Assignment], board: u8| {
        settings(&list.iter().filter(|a| a.board.is_none_or(|b| b == board)).cloned().collect::<Vec<_>>())
    };
    if let Some(stray) =
        args.ci.iter().chain(&args.par).find(|a| a.board.is_some_and(|b| !boards.contains(&b)))
    {
        let board = stray.board.unwrap_or_default();
        return Err(Failure::usage(format!(
            "{board}.{}: board {board} is not among those to run",
            stray.name
        )));
    }
    let plan = |board: &u8| RunBoard { board: *board, ci: of(&args.ci, *board), par: of(&args.par, *board) };
    let options = RunOptions {
        boards: boards.iter().map(plan).collect(),
        active: args.active,
        force: args.force.force,
    };
    let report = match driver.run(Request::Run(options)) {
        Ok(Outcome::Running(report)) => report,
        Ok(other) => return Err(unexpected(&other)),
        Err(failure) => {
            // What has been started is not left running without a PC.
            if failure.exit != crate::failure::REFUSED {
                halt(&mut driver, &boards, out);
            }
            return Err(failure);
        }
    };
    let running = json!({
        "event": "running",
        "boards": report.boards.iter().map(|(n, a)| json!({ "board": n, "flags": a.to_string() })).collect::<Vec<_>>(),
        "load_percent": report.load.percent(),
    });
    out.result(&running, || {
        let outputs = if args.active { "outputs active" } else { "outputs safe; `active on` enables them" };
        format!("{} boards run, {outputs}; {}\nCtrl-C stops them", report.boards.len(), report.load)
    });
    if args.debug {
        for board in &boards {
            let change = AdminChange { debug: Some(true), ..Default::default() };
            if let Err(failure) = driver.run(Request::Admin { board: *board, change, force: true }) {
                halt(&mut driver, &boards, out);
                return Err(failure);
            }
        }
    }
    let lost = supervise(&mut driver, args, &boards, out);
    halt(&mut driver, &boards, out);
    out.result(&json!({ "event": "stopped" }), || "stopped".into());
    match lost? {
        0 => Ok(()),
        n => Err(Failure::new(FAULT, "lost", format!("{n} times a board was lost"))
            .hint("ucom doctor looks at bus and boards")),
    }
}

/// Supervision until Ctrl-C, `stop`, or the end of the time. Returns how often a board was lost.
fn supervise(driver: &mut Driver, args: &RunArgs, boards: &[u8], out: &Output) -> Result<u32, Failure> {
    let words = words();
    boards.iter().for_each(|board| driver.master.watch(*board, None, true));
    let (start, mut said) = (Instant::now(), Instant::now());
    let mut lost = 0;
    let mut last: BTreeMap<u8, Snapshot> = BTreeMap::new();
    loop {
        driver.turn(Duration::from_millis(20))?;
        while let Some(event) = driver.master.take_event() {
            match event {
                Event::Snapshot { board, snapshot } => {
                    last.insert(board, snapshot);
                }
                Event::Supervision { board, change } => {
                    lost += u32::from(change == Supervision::Lost);
                    driver.tell(&Event::Supervision { board, change }, None);
                }
                other => driver.tell(&other, None),
            }
        }
        while let Ok(line) = words.try_recv() {
            if line.trim() == "stop" {
                return Ok(lost);
            }
            if let Err(e) = obey(driver, line.trim(), boards) {
                out.note(e.message);
            }
        }
        if driver.stop_asked() || args.duration.is_some_and(|d| start.elapsed() >= d) {
            return Ok(lost);
        }
        if said.elapsed() >= SAY && out.is_json() {
            said = Instant::now();
            for (board, snapshot) in &last {
                let names = driver.master.description(*board).map(|d| d.so).unwrap_or_default();
                let so = named(&names, &snapshot.words);
                let time_s = snapshot.time_us as f64 * 1e-6;
                out.result(
                    &json!({ "event": "so", "board": board, "time_s": time_s, "so": so }),
                    String::new,
                );
            }
        }
    }
}

/// Lines on stdin, read beside the bus.
fn words() -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    receiver
}

/// `ci 1 set_position=1500`, `par 1 kp=80`, `active on`, `active off`.
fn obey(driver: &mut Driver, line: &str, boards: &[u8]) -> Result<(), Failure> {
    let form = || {
        Failure::usage(format!(
            "\"{line}\": known are ci N NAME=VALUE, par N NAME=VALUE, active on|off, stop"
        ))
    };
    let mut parts = line.split_whitespace();
    match parts.next() {
        None => Ok(()),
        Some("active") => {
            let on = match parts.next() {
                Some("on") => true,
                Some("off") => false,
                _ => return Err(form()),
            };
            for board in boards {
                let change = AdminChange { active: Some(on), ..Default::default() };
                driver.run(Request::Admin { board: *board, change, force: true })?;
            }
            Ok(())
        }
        Some(kind @ ("ci" | "par")) => {
            let board = parts.next().and_then(|n| n.parse().ok()).ok_or_else(form)?;
            for word in parts {
                let a: Assignment = word.parse().map_err(Failure::usage)?;
                let now = driver.now_us();
                match kind {
                    "ci" => driver.master.set_input(now, board, &a.name, a.value as u16)?,
                    _ => driver.master.set_parameter(now, board, &a.name, a.value as u16)?,
                };
            }
            Ok(())
        }
        Some(_) => Err(form()),
    }
}

/// Control loops and applications end; what fails is said, and the others are stopped all the same.
fn halt(driver: &mut Driver, boards: &[u8], out: &Output) {
    for level in [StopLevel::Loop, StopLevel::Application] {
        for board in boards.iter().rev() {
            if let Err(e) = driver.stop_board(*board, level) {
                out.note(format!("board {board}: {}", e.message));
            }
        }
    }
    driver.master.end_session();
}

/// Outputs of boards as they come; only listens once their names are known.
pub fn so(args: &SoArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut driver = Driver::open(link, out)?;
    let boards = driver.numbers(&args.boards)?;
    let mut descriptions = BTreeMap::new();
    for board in boards {
        let description = args.cache.describe(&mut driver, board)?;
        driver.master.watch(board, Some(description.dimensions().so), true);
        descriptions.insert(board, description);
    }
    if args.csv {
        head(&descriptions)?;
    }
    let mut left = args.count.unwrap_or(u64::MAX);
    let (start, mut heard) = (driver.now_us(), Instant::now());
    let mut patient = true;
    while left > 0 && !driver.stop_asked() {
        driver.turn(Duration::from_millis(20))?;
        while let Some(event) = driver.master.take_event() {
            match event {
                // Another PC runs the boards: that is why there is something to see.
                Event::ForeignMaster { .. } => {}
                Event::Snapshot { board, snapshot } if left > 0 => {
                    left -= 1;
                    heard = Instant::now();
                    show(args, &descriptions, board, &snapshot, start, out);
                }
                other => driver.tell(&other, None),
            }
        }
        if heard.elapsed() > Duration::from_secs(3) && patient {
            if args.count.is_some() {
                return Err(Failure::new(
                    NO_LINK,
                    "no-outputs",
                    "no board sends outputs: no control loop runs",
                )
                .hint("ucom run, in another terminal"));
            }
            out.note("no board sends outputs: no control loop runs (ucom run, in another terminal)");
            patient = false;
        }
    }
    Ok(())
}

fn head(descriptions: &BTreeMap<u8, IoDescription>) -> Result<(), Failure> {
    let mut names = descriptions.values().map(|d| &d.so);
    let first = names.next().cloned().unwrap_or_default();
    if names.any(|other| *other != first) {
        return Err(Failure::usage("boards with different outputs do not fit into one table")
            .hint("one board at a time, or --json"));
    }
    let columns: Vec<&str> = first.iter().map(|n| short(n)).collect();
    println!("time_s,board,{}", columns.join(","));
    Ok(())
}

fn show(
    args: &SoArgs,
    descriptions: &BTreeMap<u8, IoDescription>,
    board: u8,
    snapshot: &Snapshot,
    start_us: u64,
    out: &Output,
) {
    let time_s = snapshot.time_us.saturating_sub(start_us) as f64 * 1e-6;
    let names = descriptions.get(&board).map(|d| d.so.as_slice()).unwrap_or_default();
    let list: Vec<String> = snapshot.words.iter().map(|w| (*w as i16).to_string()).collect();
    if args.csv {
        println!("{time_s:.6},{board},{}", list.join(","));
        return;
    }
    let value = json!({ "time_s": time_s, "board": board, "so": named(names, &snapshot.words) });
    out.result(&value, || {
        let pair =
            |(i, w): (usize, &u16)| format!("{} {:>6}", names.get(i).map_or("?", |n| short(n)), *w as i16);
        let pairs: Vec<String> = snapshot.words.iter().enumerate().map(pair).collect();
        format!("{time_s:9.3} s  board {board}  {}", pairs.join("  "))
    });
}
