//! Starts the control loop of a board in the order of the protocol: description, initial inputs, inputs, parameters, heartbeats, loop,
//! outputs.

use crate::master::engine::{Core, Life, Link};
use crate::master::error::{Error, MasterError, RunningError, SignalError};
use crate::master::io::{DescriptionKey, IoDescription, Kind};
use crate::master::load::LoadForecast;
use crate::master::procedures::control::{change_flags, start_from};
use crate::master::procedures::describe::{describe, read_initial_inputs};
use crate::master::procedures::exchange::{info, mca_start};
use crate::master::procedures::one_board::one_board_each;
use crate::master::procedures::stop::stop_board;
use crate::master::reports::{AdminChange, Outcome, RunBoard, RunOptions, RunReport, StopLevel};
use std::collections::BTreeMap;
use ucom::profile::OnLost;
use ucom::{Admin, BoardInfo, Dimensions, Status};

/// Starts the control loops of boards. At the end, either all boards run, or all boards are in their previous state (idle, started or
/// running). A board that was running before keeps its values, except for inputs and parameters that the user sets.
pub(crate) async fn run(link: Link, options: RunOptions) -> Result<Outcome, Error> {
    let mut begun = Vec::new();
    let result = link.or_cancel(start_all(&link, &options, &mut begun)).await;
    if let Err(error) = &result
        && !matches!(error, Error::Master(MasterError::Bus { .. }))
    {
        link.bear_shared_numbers(true);
        let undone = link.or_cancel(async {
            undo(&link, &begun).await;
            Ok(())
        });
        if undone.await.is_err() {
            link.note("not all boards that were started have stopped".into());
        }
    }
    result.map(Outcome::Running)
}

/// Board that a run has started, with the data that are needed to undo the start if the run fails.
struct Begun {
    board: u8,
    /// Stop level that returns the board to its previous state; `None` if the procedure does not need to undo anything.
    back: Option<StopLevel>,
    /// `true` if the control loop of the board was already running.
    ran: bool,
}

async fn undo(link: &Link, begun: &[Begun]) {
    for Begun { board, back, .. } in begun.iter().rev() {
        if let Some(level) = back
            && let Err(error) = stop_board(link, *board, *level).await
        {
            link.note(format!("the application of board {board} may still run: {error}"));
        }
    }
}

async fn start_all(link: &Link, options: &RunOptions, begun: &mut Vec<Begun>) -> Result<RunReport, Error> {
    for plan in &options.boards {
        link.board(plan.board)?;
    }
    link.become_master(options.force).await?;
    // The checks that can refuse the run (names, bus load) are made before a board is started, if the data for them
    // are already known.
    let mut found = Vec::new();
    let mut described = BTreeMap::new();
    for plan in &options.boards {
        let seen = info(link, plan.board).await?;
        if let Some(description) = known_description(link, &seen.info) {
            add(link, options, plan, description, &mut described)?;
        }
        found.push(seen);
    }
    one_board_each(link, &options.boards.iter().map(|plan| plan.board).collect::<Vec<_>>()).await?;
    for (plan, seen) in options.boards.iter().zip(found) {
        // If the procedure fails, it returns each board whose control loop did not run before to its previous state. A board whose control
        // loop was running is not stopped.
        let status = seen.info.status;
        let back = match (status.has(Status::MSTART), status.has(Status::MCARUN)) {
            (false, _) => Some(StopLevel::Application),
            (true, false) => Some(StopLevel::Loop),
            (true, true) => None,
        };
        begun.push(Begun { board: plan.board, back, ran: back.is_none() });
        let seen = start_from(link, seen).await?;
        let description = describe(link, plan.board, &seen.info).await?;
        // The user chose the values by the names in the known description. If the board has other names, the values
        // could go to the wrong signals.
        if described.get(&plan.board).is_some_and(|known| *known != description) {
            return Err(SignalError::StaleNames { board: plan.board }.into());
        }
        add(link, options, plan, description, &mut described)?;
    }
    let mut boards = Vec::new();
    for (plan, begun) in options.boards.iter().zip(begun) {
        let Some(description) = described.get(&plan.board) else { continue };
        nobody_lost(link, options)?;
        boards.push((plan.board, start_loop(link, options, plan, description, begun).await?));
    }
    nobody_lost(link, options)?;
    Ok(RunReport { boards, load: forecast(link, &described) })
}

/// Returns the description of a board's program, if it is already known.
fn known_description(link: &Link, info: &BoardInfo) -> Option<IoDescription> {
    let key = DescriptionKey::of(info);
    link.with(|core| core.descriptions.get(&key).filter(|_| info.has_application()).cloned())
}

/// Adds a board with its description to the run. The function checks the names of the board's values, and the bus load.
fn add(
    link: &Link,
    options: &RunOptions,
    plan: &RunBoard,
    description: IoDescription,
    described: &mut BTreeMap<u8, IoDescription>,
) -> Result<(), Error> {
    for (kind, settings) in [(Kind::Ci, &plan.ci), (Kind::Par, &plan.par)] {
        for setting in settings {
            description.find(plan.board, kind, &setting.name)?;
        }
    }
    described.insert(plan.board, description);
    let load = forecast(link, described);
    if load.exceeds() && !options.force { Err(RunningError::Load(load).into()) } else { Ok(()) }
}

/// Sends inputs and parameters to a board, starts its control loop, and enables the outputs if the options require it.
async fn start_loop(
    link: &Link,
    options: &RunOptions,
    plan: &RunBoard,
    description: &IoDescription,
    begun: &mut Begun,
) -> Result<Admin, Error> {
    let board = plan.board;
    // If the control loop was already running, this PC knows only the inputs that it has sent itself. This PC
    // must not replace inputs of another PC by initial values, unless the user sets inputs.
    let given = link.with(|core| core.data.get(&board).filter(|d| d.repeat.is_some()).map(|d| d.ci.clone()));
    let give = !begun.ran || given.is_some() || !plan.ci.is_empty();
    let initial = read_initial_inputs(link, board, description.dimensions().ci).await?;
    let mut ci = given.filter(|_| begun.ran).unwrap_or(initial);
    for setting in &plan.ci {
        let index = description.find(board, Kind::Ci, &setting.name)?;
        if let Some(place) = ci.get_mut(usize::from(index)) {
            *place = setting.value;
        }
    }
    link.with(|core| {
        if let Some(data) = core.data.get_mut(&board) {
            data.know_inputs(ci);
        }
        if give {
            core.send_inputs(board);
        }
    });
    for setting in &plan.par {
        let index = description.find(board, Kind::Par, &setting.name)?;
        link.with(|core| core.send_parameter(board, index, setting.value));
    }
    // The control loop must not start before the board's inputs and parameters have been sent.
    link.flush().await;
    let flags = mca_start(link, board).await?;
    if begun.back.is_none() && !flags.active && options.active {
        begun.back = Some(StopLevel::Outputs);
    }
    if give {
        repeat_inputs(link, board);
    }
    let running = AdminChange { run: Some(true), ..Default::default() };
    let admin = change_flags(link, board, running).await?;
    if !options.active {
        return Ok(admin);
    }
    change_flags(link, board, AdminChange { active: Some(true), ..running }).await
}

/// Returns an error if a board was lost and `on_lost` stops all boards. In this case, the procedure starts no further board.
fn nobody_lost(link: &Link, options: &RunOptions) -> Result<(), Error> {
    let lost = |core: &mut Core, number: u8| {
        core.boards.get(number).is_some_and(|b| b.life == Life::Lost || b.rebooted)
    };
    let lost = link.with(|core| {
        let stops = core.profile.on_lost == OnLost::StopAll;
        options.boards.iter().map(|plan| plan.board).find(|board| stops && lost(core, *board))
    });
    lost.map_or(Ok(()), |board| Err(RunningError::Lost { board }.into()))
}

fn repeat_inputs(link: &Link, board: u8) {
    link.with(|core| {
        let next = core.now + core.times.ci;
        if let Some(data) = core.data.get_mut(&board) {
            data.repeat = Some(next);
        }
    });
}

/// Returns the load forecast, which includes boards that already run (P-19).
fn forecast(link: &Link, described: &BTreeMap<u8, IoDescription>) -> LoadForecast {
    link.with(|core| {
        let now = core.now;
        let mut all: BTreeMap<u8, Dimensions> =
            described.iter().map(|(board, description)| (*board, description.dimensions())).collect();
        for (number, board) in core.boards.iter().filter(|(_, b)| b.running(now)) {
            if let Some(data) = core.data.get(&number) {
                let so = data.so.dimension() as u16;
                let known = Dimensions { ci: data.ci.len() as u16, so, par: 0 };
                all.entry(number).or_insert(known);
            } else if board.so_at.is_some() {
                // The buffer dimensions of this board are not known. The forecast assumes one package in each direction for this board,
                // which is the minimum.
                all.entry(number).or_insert(Dimensions { ci: 1, so: 1, par: 0 });
            }
        }
        LoadForecast::new(all.values(), &core.profile)
    })
}
