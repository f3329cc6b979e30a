//! Starts applications and control loops of boards with their initial values, and stops them.

use serde_json::{Value, json};
use ucom_host::master::{AdminChange, Outcome, Request, RunOptions, RunReport, StopLevel};
use ucom_host::session::{
    Assignment, Boards, Cache, ParameterFile, Prepared, Session, SessionError, Stopped, only, plans, remember,
};

use super::procedures::numbered;
use super::worker_state::WorkerState;
use crate::error::Failure;

/// Starts the applications of boards, without any movement.
pub(super) fn start(state: &mut WorkerState, boards: &Boards, force: bool) -> Result<Value, Failure> {
    let numbers = state.driver.numbers(boards)?;
    let all = state.starting(&numbers, |state| {
        state.driver.change_each(&numbers, |board| Request::Start { board, force })
    })?;
    // Reads the signal names of the boards into the cache. If this fails, the applications stay started.
    numbers.iter().for_each(|board| drop(state.known(*board)));
    Ok(numbered(state, &all))
}

/// Boards that are run, with their values and options.
pub(super) struct Run {
    pub boards: Boards,
    pub active: bool,
    pub inputs: Vec<Assignment>,
    pub parameters: Vec<Assignment>,
    pub file: Option<ParameterFile>,
    pub texts: bool,
    pub force: bool,
}

/// Starts applications and control loops of boards with their initial values.
pub(super) fn run(state: &mut WorkerState, mut run: Run) -> Result<Value, Failure> {
    let numbers = state.driver.numbers(&run.boards)?;
    only(&numbers, &run.inputs, "run").map_err(SessionError::from)?;
    only(&numbers, &run.parameters, "run").map_err(SessionError::from)?;
    // If `all` boards are selected, every board of the parameter file must be in the chain.
    let meant = |n: u8| run.boards == Boards::All || numbers.contains(&n);
    let file = run.file.take().map(|file| file.of_boards(meant));
    // The identities of the boards are checked first, because this check does not need started applications.
    if let Some(file) = &file {
        file.identities(&mut state.driver)?;
    }
    let begin = |session: &mut Session, cache: &Cache| {
        let mut prepared = Prepared::default();
        let started = begin(session, cache, &numbers, &run, file.as_ref(), &mut prepared);
        // The failed procedure has already undone its own steps. Here, only the preparation is undone.
        let report = started.inspect_err(|_| prepared.undo(&mut session.driver))?;
        Ok((report, prepared))
    };
    let (report, prepared) = state.starting(&numbers, |state| state.by_names(begin))?;
    for known in prepared.known.into_values() {
        state.knows(known);
    }
    state.runs(&numbers);
    for board in numbers.iter().filter(|_| run.texts) {
        let change = AdminChange { debug: Some(true), ..Default::default() };
        // The boards already run, perhaps with enabled outputs. If the function returned an error here, the caller
        // would assume that the boards are stopped.
        if let Err(error) = state.driver.run(Request::Admin { board: *board, change, force: true }) {
            state.driver.note(format!("board {board} possibly sends no texts: {error}"));
        }
    }
    state.first_outputs(&numbers)?;
    Ok(json!({
        "boards": numbers,
        "active": run.active,
        "load_percent": report.load.percent(),
        "load_limit_percent": report.load.limit,
    }))
}

/// Reads the signal names, plans the values, and starts all boards.
fn begin(
    session: &mut Session,
    cache: &Cache,
    numbers: &[u8],
    run: &Run,
    file: Option<&ParameterFile>,
    prepared: &mut Prepared,
) -> Result<RunReport, SessionError> {
    for board in numbers {
        prepared.add(&mut session.driver, cache, &session.signals, *board, run.force)?;
    }
    let plans = plans(&session.driver, prepared, file, &run.inputs, &run.parameters)?;
    let options = RunOptions { boards: plans.clone(), active: run.active, force: run.force };
    match session.driver.run(Request::Run(options))? {
        Outcome::Running(report) => {
            remember(cache, prepared, &plans);
            Ok(report)
        }
        other => Err(other.into()),
    }
}

/// Enables the outputs of running boards, or makes the outputs safe. The command that makes outputs safe is sent to
/// each board, even if another board fails.
pub(super) fn outputs(state: &mut WorkerState, boards: &Boards, active: bool) -> Result<(), Failure> {
    let numbers = match boards {
        Boards::All => state.held.borrow().running().iter().copied().collect(),
        boards => state.driver.numbers(boards)?,
    };
    if !active {
        let Stopped { failed, .. } = state.driver.outputs_safe(&numbers, false);
        return all_certain("outputs not safe for certain", failed);
    }
    let mut done = Vec::new();
    for board in numbers {
        let change = AdminChange { active: Some(true), ..AdminChange::default() };
        let request = Request::Admin { board, change, force: false };
        let enabled = state.starting(&[board], |state| state.driver.run(request));
        enabled.map_err(|failure| failure.after(done.iter().copied()))?;
        done.push(board);
    }
    Ok(())
}

/// Returns a failure that lists all boards whose result is uncertain.
fn all_certain(what: &str, failed: Vec<(u8, SessionError)>) -> Result<(), Failure> {
    let numbers: Vec<String> = failed.iter().map(|(board, _)| board.to_string()).collect();
    let Some((board, error)) = failed.into_iter().next() else { return Ok(()) };
    let mut own = Failure::from(error);
    own.facts.board = Some(board).filter(|_| numbers.len() == 1);
    own.message = format!("{what}: board {}: {}", numbers.join(", "), own.message);
    Err(own)
}

/// Stops each selected board. `all` selects the boards that answer, and the boards that this session has started.
pub(super) fn stop(state: &mut WorkerState, boards: &Boards, level: StopLevel) -> Result<Value, Failure> {
    let was_master = state.driver.master.is_master();
    let wanted = match boards {
        Boards::All => {
            let mut wanted = state.started();
            match state.driver.numbers_to_stop(&Boards::All) {
                Ok(found) => wanted.extend(found),
                // Boards without a number do not run, so only the boards that this session has started are stopped.
                Err(SessionError::NoBoards | SessionError::NoNumbers { .. }) if !wanted.is_empty() => {}
                Err(error) => return Err(error.into()),
            }
            wanted.sort_unstable();
            wanted.dedup();
            Boards::Some(wanted)
        }
        boards => boards.clone(),
    };
    let Stopped { boards: all, failed } = state.driver.stop_each(&wanted, level)?;
    for (board, _) in &all {
        match level {
            StopLevel::Application => state.runs_no_more(Some(*board)),
            StopLevel::Loop | StopLevel::Outputs => state.only_started(*board),
        }
    }
    if !was_master && state.started().is_empty() {
        // A stop must not make the session the master of the bus. If the session was not the master before, it gives
        // up this role.
        state.driver.master.end_session();
    }
    all_certain("not stopped for certain", failed)?;
    Ok(numbered(state, &all))
}
