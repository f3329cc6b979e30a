//! Access to inputs, outputs and parameters of boards by name.

use std::collections::BTreeSet;

use host_kit::{ErrorKind, Facts};
use serde_json::{Value, json};
use ucom_host::files::params::{SavedBoard, SavedSignal, params_text};
use ucom_host::master::io::Kind as Buffer;
use ucom_host::master::{Error, Request, SignalError};
use ucom_host::session::{
    Assignment, Boards, History, ParameterFile, Parameters, SessionError, arrived, become_master, name_of,
    note_rounded, words, write,
};

use super::objects;
use super::worker_state::WorkerState;
use crate::error::Failure;

/// Age after which the last outputs of a board are outdated, µs.
const OLD_US: u64 = 500_000;

/// Returns the signals of boards.
pub(super) fn signals(state: &mut WorkerState, boards: &Boards) -> Result<Value, Failure> {
    let numbers = state.driver.numbers(boards)?;
    let mut all = Vec::new();
    for board in numbers {
        all.push(objects::signals(&*state.known(board)?));
    }
    Ok(all.into())
}

/// Sets an input. If no input has this name, or if `buffer` selects the parameters, sets a parameter. Returns the value that was
/// sent, in the unit of the signal.
pub(super) fn set(
    state: &mut WorkerState,
    board: u8,
    buffer: Option<Buffer>,
    (name, value): (&str, &str),
    force: bool,
) -> Result<Value, Failure> {
    let value = value.parse().map_err(|e| {
        Failure::usage(format!("{name}: {e}")).next("pass a number, \"15.5 deg\", \"0x05DC\" or a bool")
    })?;
    let known = state.known(board)?;
    let is_input = known.names.find(board, Buffer::Ci, name).is_ok();
    let is_parameter = known.names.find(board, Buffer::Par, name).is_ok();
    let buffer = buffer.unwrap_or(if is_parameter && !is_input { Buffer::Par } else { Buffer::Ci });
    let assignment = Assignment { board: Some(board), name: name.to_owned(), value };
    let Some(word) = words(&known, buffer, &[assignment])?.into_iter().next() else {
        return Err(SessionError::NoBoards.into());
    };
    note_rounded(&state.driver, board, buffer, std::slice::from_ref(&word));
    let now_us = state.driver.now_us();
    let boards = state.driver.master.boards();
    // The session repeats the inputs of a running board, so a lost frame has no effect. A board that sends no
    // outputs, for example because it has no power, does not run.
    let runs = state.driver.master.repeats_inputs(board)
        && boards.get(board).is_some_and(|board| board.sends_outputs(now_us));
    let quick = runs && buffer == Buffer::Ci;
    if !quick {
        become_master(&mut state.driver, board, force)?;
    }
    let (now, setting) = (state.driver.now_us(), known.setting(buffer, &word));
    let master = &mut state.driver.master;
    match buffer {
        Buffer::Par => master.set_parameter(now, board, &setting.name, setting.value),
        _ => master.set_input(now, board, &setting.name, setting.value),
    }
    .map_err(|e| SessionError::from(Error::from(e)))?;
    if !quick {
        arrived(&mut state.driver, board).map_err(SessionError::from)?;
    }
    if buffer == Buffer::Par {
        History::of(&state.cache, &known.info).wrote([(word.index, word.word)].into_iter());
    }
    let signal = known.signals.get(buffer, word.index.into());
    Ok(signal.map_or(Value::Null, |signal| signal.json(word.word)))
}

/// Returns the outputs with their age, the inputs and the parameters of boards. Queries signal names that are not known.
pub(super) fn values(state: &mut WorkerState, boards: &Boards) -> Result<Value, Failure> {
    let numbers = state.driver.numbers(boards)?;
    let numbers = with_names(state, &numbers, *boards == Boards::All)?;
    numbers.into_iter().map(|board| of_board(state, board)).collect()
}

/// Returns the boards whose signal names are known, and stores the names in the cache. If `all` boards are selected, the function
/// skips boards whose applications are not started. Returns an error if no board remains.
pub(super) fn with_names(
    state: &mut WorkerState,
    boards: &[u8],
    all: bool,
) -> Result<BTreeSet<u8>, SessionError> {
    let (mut named, mut idle) = (BTreeSet::new(), None);
    for board in boards {
        match state.known(*board) {
            Ok(_) => drop(named.insert(*board)),
            Err(error @ SessionError::Procedure(Error::Signal(SignalError::NoApplication { .. }))) if all => {
                idle = idle.or(Some(error));
            }
            Err(error) => return Err(error),
        }
    }
    match idle {
        Some(error) if named.is_empty() => Err(error),
        _ => Ok(named),
    }
}

/// Like [`values`], for running boards. Returns an error for outdated outputs.
pub(super) fn running(state: &mut WorkerState) -> Result<Value, Failure> {
    let numbers: Vec<u8> = state.held.borrow().running().iter().copied().collect();
    let all = values(state, &Boards::Some(numbers))?;
    for one in all.as_array().into_iter().flatten().filter(|one| one["stale"] == json!(true)) {
        let board = one["board"].as_u64().and_then(|board| u8::try_from(board).ok()).unwrap_or_default();
        let known = state.held.borrow().known.get(&board).cloned();
        if known.is_some_and(|known| known.names.dimensions().so == 0) {
            continue;
        }
        // If an alarm explains the missing outputs, the alarm is reported instead.
        state.shared.check()?;
        return Err(no_value(board, "outputs", one["age_s"].as_f64()));
    }
    Ok(all)
}

fn of_board(state: &mut WorkerState, board: u8) -> Result<Value, Failure> {
    let known = state.known(board)?;
    let (inputs, parameters) = objects::settings(&known, &state.driver.master);
    let now_us = state.driver.now_us();
    let held = state.held.borrow();
    let followed = held.followed.outputs(&state.driver.master, now_us);
    let followed =
        followed.iter().find(|(number, ..)| *number == board).map(|(_, last, _, stale)| (*last, *stale));
    // If this session does not run the board, another program may run it. In this case the last outputs on the bus
    // are used.
    let other =
        || held.snapshots.get(&board).map(|last| (last, now_us.saturating_sub(last.time_us) > OLD_US));
    let last = followed.or_else(other);
    Ok(json!({
        "board": board,
        "time_s": last.map(|(last, _)| last.time_us as f64 * 1e-6),
        "age_s": last.map(|(last, _)| now_us.saturating_sub(last.time_us) as f64 * 1e-6),
        "stale": last.is_none_or(|(_, stale)| stale),
        "outputs": last.map_or_else(|| json!([]), |(last, _)| objects::outputs(&known, &last.words)),
        "inputs": inputs,
        "parameters": parameters,
        "units": [known.units(Buffer::So), known.units(Buffer::Ci), known.units(Buffer::Par)],
    }))
}

/// Returns a value by its name. If the board sends outputs, an output with this name is returned, else an input, else a
/// parameter. Returns an error for an outdated output.
pub(super) fn value(state: &mut WorkerState, board: u8, name: &str) -> Result<Value, Failure> {
    let known = state.known(board)?;
    let of_buffer = [Buffer::So, Buffer::Ci, Buffer::Par]
        .into_iter()
        .find_map(|buffer| Some((buffer, known.names.find(board, buffer, name).ok()?)));
    let Some((buffer, index)) = of_buffer else {
        let none = known.names.find(board, Buffer::So, name).err();
        let error = none.unwrap_or(SignalError::StaleNames { board });
        return Err(SessionError::from(Error::from(error)).into());
    };
    let all = of_board(state, board)?;
    let list = &all[match buffer {
        Buffer::So => "outputs",
        Buffer::Ci => "inputs",
        Buffer::Par => "parameters",
    }];
    if buffer == Buffer::So && all["stale"] == json!(true) {
        // If an alarm explains the missing outputs, the alarm is reported instead.
        state.shared.check()?;
        return Err(no_value(board, name, all["age_s"].as_f64()));
    }
    Ok(list[usize::from(index)][1].clone())
}

/// Returns the failure for missing or outdated outputs of a board. `what` names one output, or all outputs.
fn no_value(board: u8, what: &str, age_s: Option<f64>) -> Failure {
    let (code, message) = match age_s {
        None => ("no-outputs", format!("board {board} has sent no outputs: no control loop runs")),
        Some(age_s) => ("stale", format!("board {board}: the last {what} is {age_s:.1} s old")),
    };
    Failure::new(ErrorKind::NoLink, code, message)
        .next("start the control loops with run(), or check bus and boards with doctor()")
        .with(Facts::default().at_board(board))
}

/// Returns the text of a parameter file. The parameter file contains the values that were written last, and the other names as
/// comments.
pub(super) fn parameters_text(state: &mut WorkerState, boards: &Boards) -> Result<String, Failure> {
    let mut saved = Vec::new();
    for board in state.driver.numbers(boards)? {
        let known = state.known(board)?;
        let history = History::of(&state.cache, &known.info);
        let par = known.signals.all(Buffer::Par).iter().enumerate().map(|(i, signal)| {
            let last = history.last(i);
            let remark = last.map_or_else(String::new, |w| format!("written {}", w.when()));
            SavedSignal { signal: signal.clone(), word: last.map(|w| w.word), remark }
        });
        let ci = known.signals.all(Buffer::Ci).iter();
        let blank = |signal: &ucom_host::files::Signal| SavedSignal {
            signal: signal.clone(),
            word: None,
            remark: String::new(),
        };
        saved.push(SavedBoard {
            number: board,
            flash_number: known.info.flash_number,
            name: name_of(state.inventory.as_ref(), known.info.flash_number).unwrap_or_default().into(),
            program_id: known.info.program_id,
            description: known.names.clone(),
            par: par.collect(),
            ci: ci.map(blank).collect(),
        });
    }
    Ok(params_text(&saved))
}

/// Checks a complete parameter file against the boards, then writes its parameters. Returns the number of parameters.
pub(super) fn apply_parameters(
    state: &mut WorkerState,
    file: &ParameterFile,
    dry_run: bool,
    force: bool,
) -> Result<usize, Failure> {
    file.identities(&mut state.driver)?;
    // Parameters can only be written to a board whose application is started. A dry run needs only the signal names.
    let session = &mut state.session;
    let known = session.cache.all(&mut session.driver, &session.signals, &file.numbers(), |_| !dry_run)?;
    let checked =
        file.words(|number| known.iter().find(|k| k.board == number)).map_err(SessionError::from)?;
    let mut all = Vec::new();
    for (known, (_, (_, words))) in known.into_iter().zip(checked) {
        note_rounded(&state.driver, known.board, Buffer::Par, &words);
        let history = History::of(&state.cache, &known.info);
        all.push(Parameters { known, words, history });
    }
    if !dry_run {
        write(&mut state.driver, &mut all, force)?;
    }
    Ok(all.iter().map(|p| p.words.len()).sum())
}

/// Reads the initial inputs of a board.
pub(super) fn initial_inputs(state: &mut WorkerState, board: u8) -> Result<Value, Failure> {
    let known = state.known(board)?;
    match state.driver.run(Request::InitialInputs { board })? {
        ucom_host::master::Outcome::InitialInputs { values, .. } => {
            let words: Vec<_> = values.into_iter().map(Some).collect();
            Ok(objects::named(&known, Buffer::Ci, &words))
        }
        other => Err(SessionError::from(other).into()),
    }
}
