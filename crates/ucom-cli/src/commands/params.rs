//! Command `ucom par`: reads and writes parameters by name, and processes parameter files.

use host_kit::visible_in_line;
use std::path::Path;

use cli_kit::output_file::OutputError;
use cli_kit::{Failure, Output, OutputFile, table};
use serde_json::{Value, json};
use ucom_host::files::params::{SavedBoard, SavedSignal, params_text};
use ucom_host::master::counted;
use ucom_host::master::io::{Kind, ParValue};
use ucom_host::session::{
    Driver, History, ParameterFile, Parameters, Word, for_board, inventory, name_of, note_rounded, only,
    words, write,
};

use crate::args::{Boards, LinkArgs, ParArgs};

/// Shows the parameters of boards, writes some parameters, or saves or applies a parameter file.
pub(super) fn par(args: &ParArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    if let Some(file) = &args.apply {
        return apply(args, file, link, out);
    }
    if args.dry_run {
        return Err(Failure::usage("--dry-run needs --apply FILE"));
    }
    let signals = link.signal_table()?;
    let file = args.save.as_deref().map(|file| file_or_stdout(file, args.overwrite.overwrite)).transpose();
    let file = file.map_err(Failure::nothing_sent)?;
    let mut driver = link.session()?;
    let boards = driver.numbers(&args.boards)?;
    only(&boards, &args.values, "set")?;
    let mut all = Vec::new();
    let cache = args.cache.cache();
    let written = |board: u8| !for_board(&args.values, board).is_empty();
    for known in cache.all(&mut driver, &signals, &boards, written)? {
        let words = words(&known, Kind::Par, &for_board(&args.values, known.board))?;
        note_rounded(&driver, known.board, Kind::Par, &words);
        let history = History::of(&cache, &known.info);
        all.push(Parameters { known, words, history });
    }
    write(&mut driver, &mut all, args.force.force)?;
    if let Some(file) = file {
        return save(args, file, &all, out);
    }
    print(&driver, &all, matches!(args.boards, Boards::Some(ref n) if n.len() == 1), out);
    Ok(())
}

/// Opens the output file before any frame is sent. Overwrites an existing file only if the user requests it.
pub(super) fn open_output(file: &Path, overwrite: bool) -> Result<OutputFile, Failure> {
    OutputFile::open(file, overwrite, &[]).map_err(Failure::nothing_sent)
}

/// Opens an output file; returns `None` for `-`, which means stdout.
pub(super) fn file_or_stdout(file: &Path, overwrite: bool) -> Result<Option<OutputFile>, OutputError> {
    match file.as_os_str() == "-" {
        true => Ok(None),
        false => OutputFile::open(file, overwrite, &[]).map(Some),
    }
}

fn print(driver: &Driver, all: &[Parameters], one: bool, out: &Output) {
    let value = |p: &Parameters| {
        let list = rows(driver, p).map(|(i, name, assumed)| {
            let signal = p.known.signals.get(Kind::Par, i);
            let json = |word: u16| signal.map(|e| e.json(word));
            let last = p.history.last(i).map(|w| json!({ "value": json(w.word), "at": w.when() }));
            let unit = signal.map(|e| &e.unit).filter(|u| !u.is_empty());
            json!({ "index": i, "name": name, "assumed": assumed.and_then(json), "last_written": last, "unit": unit })
        });
        json!({ "board": p.known.board, "par": list.collect::<Vec<_>>() })
    };
    let values: Vec<Value> = all.iter().map(value).collect();
    let whole = match (one, values.first()) {
        (true, Some(first)) => first.clone(),
        _ => json!({ "boards": values }),
    };
    out.result(&whole, || {
        let mut text = String::new();
        for p in all {
            let row = |(i, name, assumed): (usize, &String, Option<u16>)| {
                let shown = |word: u16| {
                    p.known.signals.get(Kind::Par, i).map_or_else(String::new, |e| e.text_with_unit(word))
                };
                let value = assumed.map_or_else(|| "unknown".into(), |w| format!("{} (assumed)", shown(w)));
                let last = p.history.last(i).map(|w| format!("{} on {}", shown(w.word), w.when()));
                vec![i.to_string(), name.clone(), value, last.unwrap_or_else(|| "-".into())]
            };
            let rows: Vec<Vec<String>> = rows(driver, p).map(row).collect();
            if !one {
                text +=
                    &format!("board {}: {}\n", p.known.board, visible_in_line(&p.known.names.description));
            }
            text += &table(&[">#", "name", "value", "last written by this tool"], &rows);
        }
        text + "the protocol cannot read parameters back, and a restart of the application resets them\n"
    });
}

/// Returns the index and the name of each parameter, and the value that this process wrote last.
fn rows<'a>(driver: &Driver, p: &'a Parameters) -> impl Iterator<Item = (usize, &'a String, Option<u16>)> {
    let assumed = driver.master.parameters(p.known.board);
    p.known.names.par.iter().enumerate().map(move |(i, name)| match assumed.get(i) {
        Some(ParValue::Assumed(word)) => (i, name, Some(*word)),
        _ => (i, name, None),
    })
}

/// Writes a parameter file. The file contains the last written values, and the names of the other parameters as
/// comments.
fn save(args: &ParArgs, file: Option<OutputFile>, all: &[Parameters], out: &Output) -> Result<(), Failure> {
    let names = inventory(&args.inventory).map_err(Failure::usage)?;
    let board = |p: &Parameters| {
        let par = p.known.signals.all(Kind::Par).iter().enumerate().map(|(i, signal)| {
            let last = p.history.last(i);
            let remark = last.map_or_else(String::new, |w| format!("written {}", w.when()));
            SavedSignal { signal: signal.clone(), word: last.map(|w| w.word), remark }
        });
        let ci = p.known.signals.all(Kind::Ci).iter();
        SavedBoard {
            number: p.known.board,
            flash_number: p.known.info.flash_number,
            name: name_of(names.as_ref(), p.known.info.flash_number).unwrap_or_default().into(),
            program_id: p.known.info.program_id,
            description: p.known.names.clone(),
            par: par.collect(),
            ci: ci
                .map(|signal| SavedSignal { signal: signal.clone(), word: None, remark: String::new() })
                .collect(),
        }
    };
    let saved: Vec<SavedBoard> = all.iter().map(board).collect();
    let values: usize = saved.iter().flat_map(|b| &b.par).filter(|e| e.word.is_some()).count();
    let whole: usize = saved.iter().map(|b| b.par.len()).sum();
    let numbers: Vec<u8> = saved.iter().map(|b| b.number).collect();
    let result = json!({ "boards": numbers, "values": values, "parameters": whole });
    deliver(file, &params_text(&saved), result, out, |file| {
        format!(
            "{file}: {values} of {whole} parameters of {} with the last value that this tool wrote; the \
             others are comments",
            counted(numbers.len(), "board")
        )
    })
}

/// Writes a text to the file that the user has selected, or to stdout for `-`.
pub(super) fn deliver(
    file: Option<OutputFile>,
    text: &str,
    mut result: Value,
    out: &Output,
    words: impl FnOnce(&str) -> String,
) -> Result<(), Failure> {
    let Some(file) = file else {
        result["text"] = json!(text);
        out.result(&result, || text.into());
        return Ok(());
    };
    // The file is replaced atomically, because a user may have edited its old content.
    ucom_host::files::write_text(file.path(), text).map_err(Failure::usage)?;
    let name = file.name();
    file.is_written();
    result["file"] = json!(name);
    out.result(&result, || words(&name));
    Ok(())
}

/// Checks the complete parameter file, and then writes its parameters to the boards.
fn apply(args: &ParArgs, path: &Path, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let signals = link.signal_table()?;
    let meant = |n: u8| match &args.boards {
        Boards::All => true,
        Boards::None => false,
        Boards::Some(numbers) => numbers.contains(&n),
    };
    let file = ParameterFile::read(path, &args.inventory, meant)?;
    if let Boards::Some(numbers) = &args.boards
        && let Some(missing) = numbers.iter().find(|n| !file.numbers().contains(n))
    {
        return Err(Failure::usage(format!("{}: the file has no entry for board {missing}", path.display())));
    }
    let mut driver = link.session()?;
    file.identities(&mut driver)?;
    // Writing parameters requires a started application. For a check of the file, the cache of signal names is
    // sufficient.
    let cache = args.cache.cache();
    let known = cache.all(&mut driver, &signals, &file.numbers(), |_| !args.dry_run)?;
    let checked = file.words(|number| known.iter().find(|k| k.board == number))?;
    let mut all = Vec::new();
    let mut inputs = 0;
    for (known, (_, (ci, words))) in known.into_iter().zip(checked) {
        inputs += ci.len();
        note_rounded(&driver, known.board, Kind::Par, &words);
        let history = History::of(&cache, &known.info);
        all.push(Parameters { known, words, history });
    }
    if !args.dry_run {
        write(&mut driver, &mut all, args.force.force)?;
    }
    report(&all, inputs, args.dry_run, out);
    Ok(())
}

fn report(all: &[Parameters], inputs: usize, dry_run: bool, out: &Output) {
    let value = |p: &Parameters| {
        let par = p.words.iter().map(|w| {
            let signal = p.known.signals.get(Kind::Par, w.index.into());
            json!({ "index": w.index, "name": w.name, "value": signal.map(|e| e.json(w.word)), "word": w.word })
        });
        json!({ "board": p.known.board, "par": par.collect::<Vec<_>>() })
    };
    let boards: Vec<Value> = all.iter().map(value).collect();
    out.result(&json!({ "written": !dry_run, "boards": boards, "ci_left_out": inputs }), || {
        let row = |(p, w): (&Parameters, &Word)| {
            vec![p.known.board.to_string(), w.index.to_string(), w.name.clone(), w.text.clone()]
        };
        let pairs = all.iter().flat_map(|p| p.words.iter().map(move |w| (p, w)));
        let rows: Vec<Vec<String>> = pairs.map(row).collect();
        let count = rows.len();
        let mut text = table(&[">board", ">#", "parameter", "value"], &rows);
        text += &match dry_run {
            true if count == 1 => "1 parameter fits; nothing was written\n".into(),
            true => format!("{count} parameters fit; nothing was written\n"),
            false => {
                let count = counted(count, "parameter");
                format!("{count} written; boards do not confirm them, and a restart resets them\n")
            }
        };
        if inputs > 0 {
            let (inputs, were) = (counted(inputs, "initial input"), if inputs == 1 { "was" } else { "were" });
            text += &format!("{inputs} {were} not written; use: ucom run --params FILE\n");
        }
        text
    });
}
