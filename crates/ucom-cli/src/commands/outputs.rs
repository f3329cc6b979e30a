//! Command `ucom so`: shows the outputs of running boards by name and in their units.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use cli_kit::{ErrorKind, Failure, Lines, Output};
use serde_json::json;
use ucom_host::files::Signal;
use ucom_host::master::Event;
use ucom_host::master::io::{Kind, Snapshot, short};
use ucom_host::session::{Driver, Known, nothing_shared};

use crate::args::{LinkArgs, SoArgs};

/// Prints the remaining lines, as long as the reader of stdout reads them. Reports the number of lines that were
/// dropped because the reader was too slow.
pub(super) fn finish(stdout: &mut Lines, driver: &Driver) {
    let unseen = stdout.finish();
    if unseen > 0 && !stdout.gone() {
        driver.note(format!("{unseen} lines were dropped, because the reader was too slow"));
    }
}

/// Shows the outputs of boards when the outputs arrive. After the signal names are known, the command sends
/// no more frames.
pub(super) fn so(args: &SoArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut driver = link.session()?;
    let boards = driver.numbers(&args.boards)?;
    let signals = link.signal_table()?;
    let mut all = BTreeMap::new();
    for known in args.cache.cache().all(&mut driver, &signals, &boards, |_| false)? {
        driver.master.watch(known.board, Some(known.names.dimensions().so), true);
        all.insert(known.board, known);
    }
    let mut stdout = Lines::stdout()?;
    if args.csv {
        stdout.push_always(head(&all)?);
    }
    let mut left = args.count.unwrap_or(u64::MAX);
    let (start, mut received) = (driver.now_us(), Instant::now());
    let mut patient = true;
    while left > 0 && !driver.stop_asked() && !stdout.gone() {
        driver.turn(Duration::from_millis(20))?;
        while let Some(event) = driver.master.take_event() {
            match event {
                // Another PC normally runs the boards, because this command starts no control loop. Therefore the
                // command does not report another PC on the bus.
                Event::CompetingMaster { .. } => {}
                Event::Snapshot { board, snapshot } if left > 0 => {
                    left -= 1;
                    received = Instant::now();
                    stdout.push(row(args, &all, board, &snapshot, start, out));
                }
                other => driver.note_event(&other, None),
            }
        }
        nothing_shared(&driver.master)?;
        if received.elapsed() > Duration::from_secs(3) && patient {
            if args.count.is_some() {
                return Err(Failure::new(
                    ErrorKind::NoLink,
                    "no-outputs",
                    "no board sends outputs, because no control loop runs",
                )
                .next("ucom run, in another terminal"));
            }
            driver.note(
                "no board sends outputs, because no control loop runs (ucom run, in another terminal)".into(),
            );
            patient = false;
        }
    }
    finish(&mut stdout, &driver);
    Ok(())
}

fn head(all: &BTreeMap<u8, Known>) -> Result<String, Failure> {
    let column = |(name, signal): (&String, &Signal)| match (signal.known, signal.unit.as_str()) {
        (true, unit) if !unit.is_empty() => quoted(&format!("{} [{unit}]", short(name))),
        _ => quoted(short(name)),
    };
    let columns = |known: &Known| {
        known.names.so.iter().zip(known.signals.all(Kind::So)).map(column).collect::<Vec<_>>().join(",")
    };
    let mut heads = all.values().map(columns);
    let first = heads.next().unwrap_or_default();
    if heads.any(|other| other != first) {
        return Err(Failure::usage("boards with different outputs cannot share one table")
            .next("select one board, or use --json"));
    }
    Ok(format!("time_s,board,{first}"))
}

/// Returns a field of a CSV table (RFC 4180).
fn quoted(text: &str) -> String {
    let plain = !text.contains([',', '"', '\n', '\r']);
    if plain { text.into() } else { format!("\"{}\"", text.replace('"', "\"\"")) }
}

/// Returns the outputs of a board as a line of text.
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
    let (names, signals) = (&known.names.so, known.signals.all(Kind::So));
    if args.csv {
        let list: Vec<String> = snapshot.words.iter().zip(signals).map(|(w, e)| e.text(*w)).collect();
        return format!("{time_s:.6},{board},{}", list.join(","));
    }
    let (so, units) = (known.values(Kind::So, &snapshot.words), known.units(Kind::So));
    let value = json!({ "time_s": time_s, "board": board, "so": so, "units": units });
    out.words(&value, || {
        let pairs = names.iter().zip(signals).zip(&snapshot.words);
        let pairs: Vec<String> =
            pairs.map(|((n, e), w)| format!("{} {:>6}", short(n), e.text_with_unit(*w))).collect();
        format!("{time_s:9.3} s  board {board}  {}", pairs.join("  "))
    })
}
