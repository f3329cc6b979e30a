//! `ucom io`, `ci`, `par`, `dbc`: inputs, outputs and parameters by name.

use std::time::{Duration, Instant};

use cli_kit::{Output, table};
use serde_json::{Value, json};
use ucom::files::{DbcBoard, dbc as dbc_text};
use ucom::master::io::{IoDescription, ParValue, short};
use ucom::master::{Event, Outcome, Request, RunBoard, RunOptions, StopLevel};

use super::run::{named, settings};
use crate::args::{Assignment, CiArgs, DbcArgs, IoArgs, LinkArgs, ParArgs};
use crate::driver::{Driver, unexpected};
use crate::failure::Failure;

/// Names of everything, and initial inputs where the application runs.
pub fn io(args: &IoArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut driver = Driver::open(link, out)?;
    let mut boards = Vec::new();
    for board in driver.numbers(&args.boards)? {
        let description = args.cache.describe(&mut driver, board)?;
        // Without a started application there is nobody to ask for them.
        let initial = initial(&mut driver, board).ok();
        boards.push((board, description, initial));
    }
    let value = json!({ "boards": boards.iter().map(io_value).collect::<Vec<_>>() });
    out.result(&value, || boards.iter().map(io_text).collect::<Vec<_>>().join("\n"));
    Ok(())
}

type Described = (u8, IoDescription, Option<Vec<u16>>);

fn io_value((board, d, initial): &Described) -> Value {
    let initial = initial.as_ref().map(|words| words.iter().map(|w| *w as i16).collect::<Vec<_>>());
    json!({
        "board": board,
        "description": d.description,
        "ci": d.ci,
        "so": d.so,
        "par": d.par,
        "initial_ci": initial,
    })
}

fn io_text((board, d, initial): &Described) -> String {
    let mut rows = Vec::new();
    for (i, name) in d.ci.iter().enumerate() {
        let word = initial.as_ref().and_then(|words| words.get(i));
        let word = word.map_or_else(String::new, |w| format!("initially {}", *w as i16));
        rows.push(vec!["input".into(), i.to_string(), name.clone(), word]);
    }
    for (kind, names) in [("output", &d.so), ("parameter", &d.par)] {
        rows.extend(
            names
                .iter()
                .enumerate()
                .map(|(i, name)| vec![kind.into(), i.to_string(), name.clone(), String::new()]),
        );
    }
    format!("board {board}: {}\n{}", d.description, table(&["", ">#", "name", ""], &rows))
}

fn initial(driver: &mut Driver, board: u8) -> Result<Vec<u16>, Failure> {
    match driver.run(Request::InitialInputs { board })? {
        Outcome::InitialInputs { values, .. } => Ok(values),
        other => Err(unexpected(&other)),
    }
}

/// Shows initial inputs, or sets some; with `--for` the board moves under supervision.
pub fn ci(args: &CiArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut driver = Driver::open(link, out)?;
    let board = only(args.board, &args.values)?;
    if let Some(duration) = args.duration {
        return move_for(&mut driver, args, duration, out);
    }
    let description = args.cache.describe(&mut driver, board)?;
    if args.values.is_empty() {
        let words = initial(&mut driver, board)?;
        print_words("initial_ci", board, &description.ci, &words, out);
        return Ok(());
    }
    let running = become_master(&mut driver, board, args.force.force)?;
    let values = args
        .values
        .iter()
        .map(|a| Ok((a, ucom_index(&description, board, a)?)))
        .collect::<Result<Vec<_>, Failure>>()?;
    // Inputs go three at a time: what is beside the one that is set must not become 0.
    initial(&mut driver, board)?;
    for (assignment, _) in &values {
        let now = driver.now_us();
        driver.master.set_input(now, board, &assignment.name, assignment.value as u16)?;
    }
    drain(&mut driver)?;
    let set: Vec<Value> = values
        .iter()
        .map(|(a, i)| json!({ "name": description.ci.get(usize::from(*i)), "index": i, "value": a.value }))
        .collect();
    out.result(&json!({ "board": board, "set": set, "running": running }), || {
        let line = |(a, i): &(&Assignment, u16)| {
            format!(
                "board {board}: {} = {}\n",
                description.ci.get(usize::from(*i)).map_or("?", |n| n),
                a.value
            )
        };
        let end = if running {
            ""
        } else {
            "the control loop does not run: ucom run, or ucom ci … --for S, makes things move\n"
        };
        values.iter().map(line).collect::<String>() + end
    });
    Ok(())
}

fn ucom_index(d: &IoDescription, board: u8, a: &Assignment) -> Result<u16, Failure> {
    Ok(d.find(board, ucom::master::io::Kind::Ci, &a.name)?)
}

/// Listens for another PC before anything is sent (D-08), and reads whether the loop runs.
fn become_master(driver: &mut Driver, board: u8, force: bool) -> Result<bool, Failure> {
    let change = ucom::master::AdminChange::default();
    match driver.run(Request::Admin { board, change, force })? {
        Outcome::Admin { admin, .. } => Ok(admin.run),
        other => Err(unexpected(&other)),
    }
}

/// Lets what is queued leave.
fn drain(driver: &mut Driver) -> Result<(), Failure> {
    let end = Instant::now() + Duration::from_millis(30);
    while Instant::now() < end {
        driver.turn(Duration::from_millis(5))?;
    }
    Ok(())
}

fn only(board: u8, values: &[Assignment]) -> Result<u8, Failure> {
    match values.iter().find(|a| a.board.is_some_and(|b| b != board)) {
        Some(a) => Err(Failure::usage(format!("{} belongs to another board than {board}", a.name))),
        None => Ok(board),
    }
}

/// Runs the board for a while and shows where it got to.
fn move_for(driver: &mut Driver, args: &CiArgs, duration: Duration, out: &Output) -> Result<(), Failure> {
    let board = args.board;
    // The application must be up to be described; `run` starts it and keeps what is described.
    let plan = RunBoard { board, ci: settings(&args.values), par: Vec::new() };
    let options = RunOptions { boards: vec![plan], active: true, force: args.force.force };
    driver.master.watch(board, None, true);
    if let Err(failure) = driver.run(Request::Run(options)) {
        // It may have begun to move.
        if failure.exit != crate::failure::REFUSED
            && let Err(e) = driver.stop_board(board, StopLevel::Loop)
        {
            out.note(format!("board {board}: {}", e.message));
        }
        return Err(failure);
    }
    let mut last = None;
    let end = Instant::now() + duration;
    while Instant::now() < end && !driver.stop_asked() {
        driver.turn(Duration::from_millis(10))?;
        while let Some(event) = driver.master.take_event() {
            match event {
                Event::Snapshot { board: from, snapshot } if from == board => last = Some(snapshot),
                other => driver.tell(&other, None),
            }
        }
    }
    // Not as a procedure that Ctrl-C cancels: it is what Ctrl-C asks for.
    driver.stop_board(board, StopLevel::Loop)?;
    let names = driver.master.description(board).map(|d| d.so).unwrap_or_default();
    let words = last.map(|s| s.words).unwrap_or_default();
    if words.is_empty() {
        return Err(Failure::new(
            crate::failure::NO_LINK,
            "no-outputs",
            format!("board {board} sent no outputs"),
        )
        .hint("ucom doctor looks for the reason"));
    }
    print_words("so", board, &names, &words, out);
    Ok(())
}

fn print_words(key: &str, board: u8, names: &[String], words: &[u16], out: &Output) {
    out.result(&json!({ "board": board, key: named(names, words) }), || {
        let row = |(i, word): (usize, &u16)| {
            let name = names.get(i).cloned().unwrap_or_default();
            vec![i.to_string(), name, (*word as i16).to_string()]
        };
        let rows: Vec<Vec<String>> = words.iter().enumerate().map(row).collect();
        table(&[">#", "name", ">value"], &rows)
    });
}

/// Shows parameter names, or writes some.
pub fn par(args: &ParArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut driver = Driver::open(link, out)?;
    let board = only(args.board, &args.values)?;
    let description = args.cache.describe(&mut driver, board)?;
    if !args.values.is_empty() {
        become_master(&mut driver, board, args.force.force)?;
        for a in &args.values {
            description.find(board, ucom::master::io::Kind::Par, &a.name)?;
        }
        for a in &args.values {
            let now = driver.now_us();
            driver.master.set_parameter(now, board, &a.name, a.value as u16)?;
        }
        drain(&mut driver)?;
    }
    let assumed = driver.master.parameters(board);
    let word = |i: usize| match assumed.get(i) {
        Some(ParValue::Assumed(word)) => Some(*word as i16),
        _ => None,
    };
    let list: Vec<Value> = description
        .par
        .iter()
        .enumerate()
        .map(|(i, name)| json!({ "index": i, "name": name, "assumed": word(i) }))
        .collect();
    out.result(&json!({ "board": board, "par": list }), || {
        let row = |(i, name): (usize, &String)| {
            let value = word(i).map_or_else(|| "unknown".into(), |w| format!("{w} (assumed)"));
            vec![i.to_string(), name.clone(), value]
        };
        let rows: Vec<Vec<String>> = description.par.iter().enumerate().map(row).collect();
        table(&[">#", "name", "value"], &rows) + "the protocol has no way to read parameters back\n"
    });
    Ok(())
}

/// Writes a DBC file with the boards' names.
pub fn dbc(args: &DbcArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let profile = link.profile()?;
    let mut boards = Vec::new();
    if args.boards != crate::args::Boards::None {
        let mut driver = Driver::open(link, out)?;
        for number in driver.numbers(&args.boards)? {
            let d = args.cache.describe(&mut driver, number)?;
            let names = |list: &[String]| list.iter().map(|n| short(n).to_owned()).collect();
            boards.push(DbcBoard { number, ci: names(&d.ci), so: names(&d.so), par: names(&d.par) });
        }
    }
    let text = dbc_text(&boards, profile.endian);
    match &args.out {
        None if out.is_json() => out.result(&json!({ "text": text }), String::new),
        None => print!("{text}"),
        Some(path) => {
            std::fs::write(path, text).map_err(|e| Failure::usage(format!("{}: {e}", path.display())))?;
            let file = path.display().to_string();
            let numbers: Vec<u8> = boards.iter().map(|b| b.number).collect();
            out.result(&json!({ "file": file, "boards": numbers }), || {
                format!("{file}: messages of the protocol, process data of {} boards", numbers.len())
            });
        }
    }
    Ok(())
}
