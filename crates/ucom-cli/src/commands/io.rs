//! Commands `ucom io`, `ucom ci` and `ucom dbc`: inputs, outputs and parameters by name.

use host_kit::visible_in_line;
use std::time::{Duration, Instant};

use cli_kit::output_file::OutputError;
use cli_kit::{ErrorKind, Failure, Output, table};
use serde_json::{Value, json};
use ucom_host::files::{DbcBoard, Signal, SignalTable, SignalType, dbc as dbc_text};
use ucom_host::master::io::{IoDescription, Kind};
use ucom_host::master::{Event, Outcome, Request, RunBoard, RunOptions, StopLevel, counted};
use ucom_host::session::{
    Driver, Followed, Known, Prepared, SessionError, Word, arrived, become_master, note_rounded,
    nothing_shared, only, with_names, words,
};

use super::params::{deliver, file_or_stdout, open_output};
use crate::args::{CiArgs, DbcArgs, IoArgs, LinkArgs};

/// Shows all signal names of boards, and the meanings of their words. If the application of a board is started, also shows its
/// initial inputs.
pub(super) fn io(args: &IoArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    note_force(args.force, out);
    let (signals, cache) = (link.signal_table()?, args.cache.cache());
    let file =
        args.template.as_deref().map(|file| file_or_stdout(file, args.overwrite.overwrite)).transpose();
    // The existing file is probably a signal table that a user has edited. Therefore the hint suggests to print the
    // template and to add it to the file by hand.
    let file = file.map_err(|e| match matches!(e, OutputError::Exists { .. }) {
        true => Failure::nothing_sent(e).next(
            "--template - prints the table, so that you can add it by hand; --overwrite writes over it",
        ),
        false => Failure::nothing_sent(e),
    })?;
    let mut driver = link.session()?;
    let mut boards = Vec::new();
    let numbers = driver.numbers(&args.boards)?;
    for known in cache.all(&mut driver, &signals, &numbers, |_| false)? {
        let board = known.board;
        // The initial inputs are requested only for a listing, and only a started application can report them.
        let initial = match args.template {
            None => initial(&mut driver, board).ok(),
            Some(_) => None,
        };
        // If the board has sent its initial inputs, its current signal names are also known.
        let known = match driver.master.description(board) {
            Some(names) if initial.is_some() => known.renamed(names, &signals, driver.master.profile()),
            _ => known,
        };
        boards.push((known, initial));
    }
    if let Some(file) = file {
        let mut programs: Vec<(u16, &IoDescription)> = Vec::new();
        for (known, _) in &boards {
            if programs.iter().all(|(id, _)| *id != known.info.program_id) {
                programs.push((known.info.program_id, &known.names));
            }
        }
        let ids: Vec<u16> = programs.iter().map(|(id, _)| *id).collect();
        let text = SignalTable::template(&programs);
        return deliver(file, &text, json!({ "programs": ids }), out, |file| {
            format!(
                "{file}: a table of {}; check types, scales and units (`ucom help edges`)",
                counted(ids.len(), "program")
            )
        });
    }
    let value = json!({ "boards": boards.iter().map(io_value).collect::<Vec<_>>() });
    out.result(&value, || boards.iter().map(io_text).collect::<Vec<_>>().join("\n"));
    Ok(())
}

type Described = (Known, Option<Vec<u16>>);

fn io_value((known, initial): &Described) -> Value {
    let inputs = known.signals.all(Kind::Ci);
    let initial =
        initial.as_ref().map(|words| words.iter().zip(inputs).map(|(w, e)| e.json(*w)).collect::<Vec<_>>());
    let d = &known.names;
    let signals = |kind| known.signals.all(kind).iter().map(signal_value).collect::<Vec<_>>();
    json!({
        "board": known.board,
        "description": d.description,
        "ci": d.ci,
        "so": d.so,
        "par": d.par,
        "initial_ci": initial,
        "units": known.units(Kind::Ci),
        "edges": { "ci": signals(Kind::Ci), "so": signals(Kind::So), "par": signals(Kind::Par) },
    })
}

/// Returns the known meaning of the words of a signal; null if the signal is not in a table.
fn signal_value(signal: &Signal) -> Value {
    if !signal.known {
        return Value::Null;
    }
    json!({
        "type": type_name(signal),
        "scale": signal.scale,
        "offset": signal.offset,
        "unit": signal.unit,
        "min": signal.min,
        "max": signal.max,
    })
}

fn type_name(signal: &Signal) -> &'static str {
    match signal.kind {
        SignalType::Int16 => "int16",
        SignalType::Uint16 => "uint16",
        SignalType::Hex => "hex",
        SignalType::Bool => "bool",
    }
}

fn io_text((known, initial): &Described) -> String {
    let mut rows = Vec::new();
    for (kind, word) in [(Kind::Ci, "input"), (Kind::So, "output"), (Kind::Par, "parameter")] {
        for (i, (name, signal)) in known.names.names(kind).iter().zip(known.signals.all(kind)).enumerate() {
            let initial = initial.as_ref().filter(|_| kind == Kind::Ci).and_then(|words| words.get(i));
            let initial =
                initial.map_or_else(String::new, |w| format!("initially {}", signal.text_with_unit(*w)));
            let (low, high) = signal.limits();
            let means = match (signal.known, signal.kind) {
                (false, _) => String::new(),
                (true, SignalType::Bool | SignalType::Hex) => type_name(signal).into(),
                (true, _) => {
                    format!("{} {low}..{high} {}", type_name(signal), signal.unit).trim_end().to_owned()
                }
            };
            rows.push(vec![word.into(), i.to_string(), name.clone(), means, initial]);
        }
    }
    let table = table(&["", ">#", "name", "", ""], &rows);
    format!("board {}: {}\n{table}", known.board, visible_in_line(&known.names.description))
}

fn initial(driver: &mut Driver, board: u8) -> Result<Vec<u16>, Failure> {
    match driver.run(Request::InitialInputs { board })? {
        Outcome::InitialInputs { values, .. } => Ok(values),
        other => Err(SessionError::from(other).into()),
    }
}

/// Shows the initial inputs of a board, or sets some of its inputs. With `--for`, the command moves the board and supervises it.
pub(super) fn ci(args: &CiArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let signals = link.signal_table()?;
    let mut driver = link.session()?;
    let board = args.board;
    only(&[board], &args.values, "set")?;
    if let Some(duration) = args.duration {
        return move_for(&mut driver, args, duration, &signals, out);
    }
    let known = args.cache.cache().described(&mut driver, &signals, board)?;
    if args.values.is_empty() {
        let words = initial(&mut driver, board)?;
        print_words("initial_ci", &known, Kind::Ci, &words, out);
        return Ok(());
    }
    let words = words(&known, Kind::Ci, &args.values)?;
    note_rounded(&driver, board, Kind::Ci, &words);
    let running = become_master(&mut driver, board, args.force.force)?;
    for word in &words {
        let (now, setting) = (driver.now_us(), known.setting(Kind::Ci, word));
        driver.master.set_input(now, board, &setting.name, setting.value)?;
    }
    arrived(&mut driver, board)?;
    let value = |w: &Word| {
        let signal = known.signals.get(Kind::Ci, w.index.into());
        json!({ "name": w.name, "index": w.index, "value": signal.map(|e| e.json(w.word)) })
    };
    let set: Vec<Value> = words.iter().map(value).collect();
    out.result(&json!({ "board": board, "set": set, "running": running }), || {
        let line = |w: &Word| format!("board {board}: {} = {}\n", w.name, w.text);
        let end = if running {
            ""
        } else {
            "nothing moves, because the control loop does not run: use ucom run, or ucom ci … --for S\n"
        };
        words.iter().map(line).collect::<String>() + end
    });
    Ok(())
}

/// Runs the board for a limited time and shows its final position.
fn move_for(
    driver: &mut Driver,
    args: &CiArgs,
    duration: Duration,
    signals: &SignalTable,
    out: &Output,
) -> Result<(), Failure> {
    let (board, force) = (args.board, args.force.force);
    let prepared = with_names(&args.cache.cache(), |cache| {
        let mut prepared = Prepared::default();
        prepared.add(driver, cache, signals, board, force)?;
        let Some(known) = prepared.known.get(&board) else { return Ok(prepared) };
        let words = words(known, Kind::Ci, &args.values).inspect_err(|_| prepared.undo(driver))?;
        note_rounded(driver, board, Kind::Ci, &words);
        let ci = words.iter().map(|w| known.setting(Kind::Ci, w)).collect();
        let plan = RunBoard { board, ci, par: Vec::new() };
        let options = RunOptions { boards: vec![plan], active: true, force };
        driver.master.watch(board, None, true);
        // A failed run undoes its own changes. After that, only the changes from before the run must be undone.
        driver.run(Request::Run(options)).inspect_err(|_| prepared.undo(driver))?;
        Ok(prepared)
    })?;
    let Some(known) = prepared.known.get(&board) else { return Ok(()) };
    let mut last = None;
    let mut followed = Followed::new([board].into_iter(), driver.now_us());
    let end = Instant::now() + duration;
    while Instant::now() < end && !driver.stop_asked() {
        driver.turn(Duration::from_millis(10))?;
        while let Some(event) = driver.master.take_event() {
            followed.see(&event, driver.now_us());
            match event {
                Event::Snapshot { board: from, snapshot } if from == board => last = Some(snapshot),
                other => driver.note_event(&other, None),
            }
        }
        let now_us = driver.now_us();
        for notice in followed.look(&mut driver.master, now_us) {
            notice.text().into_iter().for_each(|text| driver.note(text));
        }
    }
    followed.ask_no_more(&mut driver.master);
    // This stop is sent outside of a procedure, because Ctrl-C cancels procedures. The user may have pressed Ctrl-C
    // to stop the board, so the stop must still be sent.
    driver.stop_at_once(Some(&[board]));
    driver.stop_board(board, StopLevel::Loop)?;
    driver.nothing_is_left();
    driver.nobody_lost(&[board])?;
    followed.nobody_left()?;
    nothing_shared(&driver.master).map_err(|e| Failure { kind: ErrorKind::Fault, ..e.into() })?;
    let words = last.map(|s| s.words).unwrap_or_default();
    if words.is_empty() {
        return Err(Failure::new(ErrorKind::NoLink, "no-outputs", format!("board {board} sent no outputs"))
            .next("find the cause with ucom doctor"));
    }
    print_words("so", known, Kind::So, &words, out);
    Ok(())
}

fn print_words(key: &str, known: &Known, kind: Kind, words: &[u16], out: &Output) {
    let (names, signals) = (known.names.names(kind), known.signals.all(kind));
    let value = json!({ "board": known.board, key: known.values(kind, words), "units": known.units(kind) });
    out.result(&value, || {
        let row = |(i, word): (usize, &u16)| {
            let name = names.get(i).cloned().unwrap_or_default();
            let signal = signals.get(i);
            let (text, unit) = signal.map_or_else(Default::default, |e| (e.text(*word), e.unit.clone()));
            vec![i.to_string(), name, text, unit]
        };
        let rows: Vec<Vec<String>> = words.iter().enumerate().map(row).collect();
        table(&[">#", "name", ">value", ""], &rows)
    });
}

/// Writes a DBC file with the signal names of the boards.
pub(super) fn dbc(args: &DbcArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    note_force(args.force, out);
    let file = args.out.as_deref().map(|file| open_output(file, args.overwrite.overwrite)).transpose()?;
    let (profile, signals) = (link.profile()?, link.signal_table()?);
    let mut boards = Vec::new();
    if args.boards != crate::args::Boards::None {
        let mut driver = link.session()?;
        let numbers = driver.numbers(&args.boards)?;
        let all = args.cache.cache().all(&mut driver, &signals, &numbers, |_| false)?;
        boards.extend(all.iter().map(|known| DbcBoard::new(known.board, &known.names, &known.signals)));
    }
    let text = dbc_text(&boards, profile.endian);
    match file {
        None if out.is_json() => out.result(&json!({ "text": text }), String::new),
        None => Output::bytes(&windows(&text)),
        Some(output) => {
            let file = output.name();
            output.write(windows(&text))?;
            let numbers: Vec<u8> = boards.iter().map(|b| b.number).collect();
            out.result(&json!({ "file": file, "boards": numbers }), || {
                format!(
                    "{file}: messages of the protocol, process data of {}",
                    counted(numbers.len(), "board")
                )
            });
        }
    }
    Ok(())
}

/// Prints a note that `--force` skips no check in this command. Older scripts use the option `--force` to overwrite a file.
fn note_force(force: bool, out: &Output) {
    if force {
        out.note(
            "--force has no effect, because this command does not check the bus; --overwrite replaces a file",
        );
    }
}

/// Encodes a text as Windows-1252, because readers of DBC files expect this encoding. The letters in units, such as ° and µ, have
/// the same codes in Windows-1252 and Latin-1.
fn windows(text: &str) -> Vec<u8> {
    let byte = |c: char| u8::try_from(u32::from(c)).ok().filter(|b| !(0x80..0xA0).contains(b));
    text.chars().map(|c| byte(c).unwrap_or(b'?')).collect()
}
