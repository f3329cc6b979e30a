//! `ucom run` and `ucom so`: control loops under supervision, and what they send.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, ErrorKind};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use cli_kit::Output;
use serde_json::{Map, Value, json};
use ucom::files::{Edge, EdgeTable};
use ucom::master::io::{Kind, Snapshot, short};
use ucom::master::{
    AdminChange, Event, Outcome, Request, RunBoard, RunOptions, RunReport, Setting, StopLevel,
};

use super::followed::{Followed, Said};
use super::params::Applied;
use crate::args::{Assignment, Boards, CacheArgs, LinkArgs, OnLost, RunArgs, SoArgs};
use crate::cache::Known;
use crate::driver::{Driver, nothing_shared, unexpected};
use crate::failure::{FAULT, Failure, NO_LINK};
use crate::lines::Lines;
use crate::values::{Prepared, Word, for_board, only, tell_rounded, with_names, words};
use crate::written::History;

/// How often `run` says how things are.
const SAY: Duration = Duration::from_secs(1);

/// Keys for so many values: the short names; the whole text where another edge has the same one, with its place where
/// that does not help either.
fn keys(names: &[String], count: usize) -> Vec<String> {
    let once = |all: &mut dyn Iterator<Item = &str>, key: &str| all.filter(|name| *name == key).count() == 1;
    let key = |i: usize| match names.get(i) {
        None => format!("#{i}"),
        Some(name) if once(&mut names.iter().map(|n| short(n)), short(name)) => short(name).to_owned(),
        Some(name) if once(&mut names.iter().map(String::as_str), name) => name.clone(),
        Some(name) => format!("{name}#{i}"),
    };
    (0..count).map(key).collect()
}

/// Values by the names of their edges, in their units where an edge table knows them (D-11).
pub fn named(names: &[String], edges: &[Edge], words: &[u16]) -> Value {
    let value = |i: usize, word: u16| edges.get(i).map_or_else(|| json!(word as i16), |edge| edge.json(word));
    let values = words.iter().enumerate().map(|(i, word)| value(i, *word));
    Value::Object(keys(names, words.len()).into_iter().zip(values).collect::<Map<_, _>>())
}

/// The units of such values, by the same keys, as far as an edge table tells them.
pub fn units(names: &[String], edges: &[Edge]) -> Value {
    let pairs = keys(names, names.len()).into_iter().zip(edges);
    let told = pairs.filter(|(_, edge)| edge.known && !edge.unit.is_empty());
    Value::Object(told.map(|(key, edge)| (key, json!(edge.unit))).collect::<Map<_, _>>())
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
    only(&boards, &args.ci, "run")?;
    only(&boards, &args.par, "run")?;
    let file = match &args.params {
        // Of all boards none may be missing that the file has something for.
        Some(path) => {
            Some(Applied::read(path, &args.inventory, |n| args.boards == Boards::All || boards.contains(&n))?)
        }
        None => None,
    };
    // Who is there comes first: it needs no started application.
    if let Some(file) = &file {
        file.identities(&mut driver)?;
    }
    let edges = link.edges()?;
    let mut stdout = Lines::stdout()?;
    let (report, prepared) = with_names(&args.cache, |cache| {
        let mut prepared = Prepared::default();
        let report = start(&mut driver, args, cache, &boards, &edges, file.as_ref(), &mut prepared);
        // What the procedure began it has taken back itself.
        let report = report.inspect_err(|_| prepared.undo(&mut driver))?;
        Ok((report, prepared))
    })?;
    let running = json!({
        "event": "running",
        "boards": report.boards.iter().map(|(n, a)| json!({ "board": n, "flags": a.to_string() })).collect::<Vec<_>>(),
        "load_percent": report.load.percent(),
    });
    stdout.push_always(out.words(&running, || {
        let outputs = if args.active { "outputs active" } else { "outputs safe; `active on` enables them" };
        format!("{} boards run, {outputs}; {}\nCtrl-C stops them", report.boards.len(), report.load)
    }));
    let mut followed = Followed::new(prepared.known.keys().copied(), driver.now_us());
    let result = want_texts(&mut driver, args, &boards)
        .and_then(|()| supervise(&mut driver, args, &prepared, &mut followed, &stdout, out));
    followed.ask_no_more(&mut driver.master);
    let running = halt(&mut driver, &boards);
    let list = || running.iter().map(u8::to_string).collect::<Vec<_>>();
    let stopped = match running.is_empty() {
        true => json!({ "event": "stopped" }),
        false => json!({ "event": "stopped", "not_stopped": running }),
    };
    stdout.push_always(out.words(&stopped, || match running.is_empty() {
        true => "stopped".into(),
        false => format!("not stopped for certain: {}", list().join(", ")),
    }));
    finish(&mut stdout, &driver);
    result?;
    if !running.is_empty() {
        let what = format!("not stopped for certain: {}", list().join(", "));
        let next =
            format!("without life signs they become safe by themselves; ucom stop {}", list().join(","));
        return Err(Failure::new(FAULT, "not-stopped", what).hint(next));
    }
    driver.nobody_lost(&boards)?;
    followed.nobody_left()
}

/// Names, plans, and the start of all boards.
fn start(
    driver: &mut Driver,
    args: &RunArgs,
    cache: &CacheArgs,
    boards: &[u8],
    edges: &EdgeTable,
    file: Option<&Applied>,
    prepared: &mut Prepared,
) -> Result<RunReport, Failure> {
    for board in boards {
        prepared.add(driver, cache, edges, *board, args.force.force)?;
    }
    let plans = plans(driver, args, prepared, file)?;
    let options = RunOptions { boards: plans.clone(), active: args.active, force: args.force.force };
    match driver.run(Request::Run(options))? {
        Outcome::Running(report) => {
            remember(args, prepared, &plans);
            Ok(report)
        }
        other => Err(unexpected(&other)),
    }
}

/// Texts of the boards, if they are wanted.
fn want_texts(driver: &mut Driver, args: &RunArgs, boards: &[u8]) -> Result<(), Failure> {
    for board in boards.iter().filter(|_| args.debug) {
        let change = AdminChange { debug: Some(true), ..Default::default() };
        driver.run(Request::Admin { board: *board, change, force: true })?;
    }
    Ok(())
}

/// Waits for the reader of stdout as long as it reads.
fn finish(stdout: &mut Lines, driver: &Driver) {
    let unseen = stdout.finish();
    if unseen > 0 && !stdout.gone() {
        driver.note(format!("{unseen} lines were dropped: nobody read them in time"));
    }
}

/// What each board is to get: the file's values, then those of the command line.
fn plans(
    driver: &Driver,
    args: &RunArgs,
    prepared: &Prepared,
    file: Option<&Applied>,
) -> Result<Vec<RunBoard>, Failure> {
    let from_file = file.map(|f| f.words(|n| prepared.known.get(&n))).transpose()?.unwrap_or_default();
    let plan = |known: &Known| {
        let board = known.board;
        let of_file = from_file.iter().find(|(n, _)| *n == board).map(|(_, words)| words);
        let settings = |kind, first: Option<&Vec<Word>>, values: &[Assignment]| {
            let mut all: Vec<Word> = first.cloned().unwrap_or_default();
            for word in words(known, kind, &for_board(values, board))? {
                all.retain(|w| w.index != word.index);
                all.push(word);
            }
            tell_rounded(driver, board, kind, &all);
            Ok::<_, Failure>(all.iter().map(|w| w.setting(known, kind)).collect())
        };
        let ci = settings(Kind::Ci, of_file.map(|(ci, _)| ci), &args.ci)?;
        let par = settings(Kind::Par, of_file.map(|(_, par)| par), &args.par)?;
        Ok(RunBoard { board, ci, par })
    };
    prepared.known.values().map(plan).collect()
}

/// The parameters that were written, for `ucom par`.
fn remember(args: &RunArgs, prepared: &Prepared, plans: &[RunBoard]) {
    for plan in plans.iter().filter(|plan| !plan.par.is_empty()) {
        let Some(known) = prepared.known.get(&plan.board) else { continue };
        let index = |s: &Setting| known.names.find(plan.board, Kind::Par, &s.name).ok();
        let words = plan.par.iter().filter_map(|s| Some((index(s)?, s.value)));
        History::of(&args.cache, &known.info).wrote(words);
    }
}

/// Supervision until Ctrl-C, `stop`, or the end of the time.
fn supervise(
    driver: &mut Driver,
    args: &RunArgs,
    prepared: &Prepared,
    followed: &mut Followed,
    stdout: &Lines,
    out: &Output,
) -> Result<(), Failure> {
    let typed = typed();
    prepared.known.keys().for_each(|board| driver.master.watch(*board, None, true));
    let (start, mut said) = (Instant::now(), Instant::now());
    let say = |driver: &Driver, said: Said| {
        if !said.text.is_empty() {
            driver.note(said.text);
        }
        if out.is_json() {
            stdout.push_always(said.value.to_string());
        }
    };
    loop {
        driver.turn(Duration::from_millis(20))?;
        while let Some(event) = driver.master.take_event() {
            if let Some(said) = followed.see(&event, driver.now_us()) {
                say(driver, said);
            }
            driver.tell(&event, None);
        }
        let now_us = driver.now_us();
        for said in followed.look(&mut driver.master, now_us) {
            say(driver, said);
        }
        // What was found while it runs: a fault, not a refusal.
        nothing_shared(&driver.master).map_err(|failure| Failure { exit: FAULT, ..failure })?;
        while let Ok(line) = typed.try_recv() {
            if line.trim() == "stop" {
                return Ok(());
            }
            followed.ask_no_more(&mut driver.master);
            if let Err(e) = obey(driver, args, line.trim(), prepared) {
                driver.note(e.message);
            }
        }
        if driver.stop_asked() || args.duration.is_some_and(|d| start.elapsed() >= d) {
            return Ok(());
        }
        if said.elapsed() >= SAY && out.is_json() {
            said = Instant::now();
            for (board, snapshot, age_s, stale) in followed.outputs(&driver.master, driver.now_us()) {
                let Some(known) = prepared.known.get(&board) else { continue };
                let so = named(&known.names.so, known.edges.all(Kind::So), &snapshot.words);
                let units = units(&known.names.so, known.edges.all(Kind::So));
                let time_s = snapshot.time_us as f64 * 1e-6;
                let value = json!({
                    "event": "so", "board": board, "time_s": time_s, "age_s": age_s, "stale": stale,
                    "so": so, "units": units,
                });
                stdout.push(out.words(&value, String::new));
            }
        }
    }
}

/// Lines on stdin, read beside the bus.
fn typed() -> Receiver<String> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || each_line(std::io::stdin().lock(), |line| sender.send(line).is_ok()));
    receiver
}

/// Hands over every line until the end, or until `take` wants no more. A byte that is no text makes a line that nothing
/// obeys, and that is said; it does not keep a later `stop` from being read.
fn each_line(mut from: impl BufRead, mut take: impl FnMut(String) -> bool) {
    let mut line = Vec::new();
    loop {
        line.clear();
        match from.read_until(b'\n', &mut line) {
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            Ok(0) | Err(_) => return,
            Ok(_) => {
                if !take(String::from_utf8_lossy(&line).into_owned()) {
                    return;
                }
            }
        }
    }
}

/// The assignments of a line: a word without `=` is the unit of the value before it, `current_max=1500 mA`.
fn assignments<'a>(words: impl Iterator<Item = &'a str>) -> Result<Vec<Assignment>, Failure> {
    let mut values: Vec<String> = Vec::new();
    for word in words {
        match values.last_mut() {
            Some(last) if !word.contains('=') => *last += &format!(" {word}"),
            _ => values.push(word.to_owned()),
        }
    }
    values.iter().map(|word| word.parse().map_err(Failure::usage)).collect()
}

/// `ci 1 set_position=1500`, `par 1 kp=80`, `active on`, `active off`.
fn obey(driver: &mut Driver, args: &RunArgs, line: &str, prepared: &Prepared) -> Result<(), Failure> {
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
            for board in prepared.known.keys() {
                let change = AdminChange { active: Some(on), ..Default::default() };
                driver.run(Request::Admin { board: *board, change, force: true })?;
            }
            Ok(())
        }
        Some(kind @ ("ci" | "par")) => {
            let board: u8 = parts.next().and_then(|n| n.parse().ok()).ok_or_else(form)?;
            let not_run = || Failure::usage(format!("board {board} is not among those that run"));
            let known = prepared.known.get(&board).ok_or_else(not_run)?;
            let values = assignments(parts)?;
            only(&[board], &values, "set")?;
            let kind = if kind == "ci" { Kind::Ci } else { Kind::Par };
            let words = words(known, kind, &values)?;
            tell_rounded(driver, board, kind, &words);
            for word in &words {
                let (now, Setting { name, value }) = (driver.now_us(), word.setting(known, kind));
                match kind {
                    Kind::Ci => driver.master.set_input(now, board, &name, value)?,
                    _ => driver.master.set_parameter(now, board, &name, value)?,
                };
            }
            if kind == Kind::Par {
                let words = words.iter().map(|w| (w.index, w.word));
                History::of(&args.cache, &known.info).wrote(words);
            }
            Ok(())
        }
        Some(_) => Err(form()),
    }
}

/// Control loops and applications end: all loops at once, then each board in turn. Returns those whose end is not certain;
/// why is said.
fn halt(driver: &mut Driver, boards: &[u8]) -> Vec<u8> {
    driver.stop_at_once(Some(boards));
    let mut running = BTreeSet::new();
    for level in [StopLevel::Loop, StopLevel::Application] {
        for board in boards.iter().rev() {
            if let Err(e) = driver.stop_board(*board, level) {
                driver.note(format!("board {board}: {}", e.message));
                running.insert(*board);
            } else if level == StopLevel::Application {
                running.remove(board);
            }
        }
    }
    driver.master.end_session();
    if running.is_empty() {
        driver.nothing_is_left();
    }
    running.into_iter().collect()
}

/// Outputs of boards as they come; only listens once their names are known.
pub fn so(args: &SoArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut driver = Driver::open(link, out)?;
    let boards = driver.numbers(&args.boards)?;
    let edges = link.edges()?;
    let mut all = BTreeMap::new();
    for board in boards {
        let known = args.cache.known(&mut driver, &edges, board)?;
        driver.master.watch(board, Some(known.names.dimensions().so), true);
        all.insert(board, known);
    }
    let mut stdout = Lines::stdout()?;
    if args.csv {
        stdout.push_always(head(&all)?);
    }
    let mut left = args.count.unwrap_or(u64::MAX);
    let (start, mut heard) = (driver.now_us(), Instant::now());
    let mut patient = true;
    while left > 0 && !driver.stop_asked() && !stdout.gone() {
        driver.turn(Duration::from_millis(20))?;
        while let Some(event) = driver.master.take_event() {
            match event {
                // Another PC runs the boards: that is why there is something to see.
                Event::ForeignMaster { .. } => {}
                Event::Snapshot { board, snapshot } if left > 0 => {
                    left -= 1;
                    heard = Instant::now();
                    stdout.push(row(args, &all, board, &snapshot, start, out));
                }
                other => driver.tell(&other, None),
            }
        }
        nothing_shared(&driver.master)?;
        if heard.elapsed() > Duration::from_secs(3) && patient {
            if args.count.is_some() {
                return Err(Failure::new(
                    NO_LINK,
                    "no-outputs",
                    "no board sends outputs: no control loop runs",
                )
                .hint("ucom run, in another terminal"));
            }
            driver
                .note("no board sends outputs: no control loop runs (ucom run, in another terminal)".into());
            patient = false;
        }
    }
    finish(&mut stdout, &driver);
    Ok(())
}

fn head(all: &BTreeMap<u8, Known>) -> Result<String, Failure> {
    let column = |(name, edge): (&String, &Edge)| match (edge.known, edge.unit.as_str()) {
        (true, unit) if !unit.is_empty() => quoted(&format!("{} [{unit}]", short(name))),
        _ => quoted(short(name)),
    };
    let columns = |known: &Known| {
        known.names.so.iter().zip(known.edges.all(Kind::So)).map(column).collect::<Vec<_>>().join(",")
    };
    let mut heads = all.values().map(columns);
    let first = heads.next().unwrap_or_default();
    if heads.any(|other| other != first) {
        return Err(Failure::usage("boards with different outputs do not fit into one table")
            .hint("one board at a time, or --json"));
    }
    Ok(format!("time_s,board,{first}"))
}

/// A field of a CSV table (RFC 4180).
fn quoted(text: &str) -> String {
    let plain = !text.contains([',', '"', '\n', '\r']);
    if plain { text.into() } else { format!("\"{}\"", text.replace('"', "\"\"")) }
}

/// A snapshot as a line.
fn row(
    args: &SoArgs,
    all: &BTreeMap<u8, Known>,
    board: u8,
    snapshot: &Snapshot,
    start_us: u64,
    out: &Output,
) -> String {
    let time_s = snapshot.time_us.saturating_sub(start_us) as f64 * 1e-6;
    let Some(known) = all.get(&board) else { return String::new() };
    let (names, edges) = (&known.names.so, known.edges.all(Kind::So));
    if args.csv {
        let list: Vec<String> = snapshot.words.iter().zip(edges).map(|(w, e)| e.text(*w)).collect();
        return format!("{time_s:.6},{board},{}", list.join(","));
    }
    let so = named(names, edges, &snapshot.words);
    let value = json!({ "time_s": time_s, "board": board, "so": so, "units": units(names, edges) });
    out.words(&value, || {
        let pairs = names.iter().zip(edges).zip(&snapshot.words);
        let pairs: Vec<String> =
            pairs.map(|((n, e), w)| format!("{} {:>6}", short(n), e.text_with_unit(*w))).collect();
        format!("{time_s:9.3} s  board {board}  {}", pairs.join("  "))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_no_text_does_not_end_the_input() {
        let mut heard = Vec::new();
        each_line(&b"ci 1 \xFF=3\nstop\nlast"[..], |line| {
            heard.push(line.trim().to_owned());
            true
        });
        assert_eq!(heard, ["ci 1 \u{FFFD}=3", "stop", "last"]);
    }

    #[test]
    fn units_may_stand_apart_from_their_values() {
        let typed = |line: &str| assignments(line.split_whitespace()).unwrap();
        assert_eq!(typed("current_max=1500 mA kp=3"), typed("current_max=1500mA kp=3"));
        assert!(assignments("mA".split_whitespace()).is_err());
    }

    #[test]
    fn values_of_equal_names_are_all_there() {
        let names = ["pos [deg]", "pos [rad]", "x", "x", "current [mA]"].map(String::from);
        let all = named(&names, &[], &[1, 2, 3, 4, 5, 6]);
        let keys = json!({ "pos [deg]": 1, "pos [rad]": 2, "x#2": 3, "x#3": 4, "current": 5, "#5": 6 });
        assert_eq!(all, keys);
    }
}
