//! Command `ucom run`: starts boards, supervises their control loops, and stops the boards.

use std::time::{Duration, Instant};

use cli_kit::{ErrorKind, Failure, Lines, Output};
use serde_json::{Value, json};
use ucom_host::files::SignalTable;
use ucom_host::master::io::Kind;
use ucom_host::master::{AdminChange, Outcome, Request, RunOptions, RunReport, counted};
use ucom_host::session::{
    Cache, Driver, Followed, Notice, ParameterFile, Prepared, SessionError, nothing_shared, only, plans,
    remember, with_names,
};

use super::outputs::finish;
use super::typed::{obey, typed};
use crate::args::{Boards, LinkArgs, OnLost, RunArgs};

/// Interval between two reports of `ucom run`.
const REPORT_PERIOD: Duration = Duration::from_secs(1);

/// Starts boards and supervises them until Ctrl-C.
pub(super) fn run(args: &RunArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut profile = link.profile()?;
    if let Some(policy) = args.on_lost {
        profile.on_lost = match policy {
            OnLost::Report => ucom::profile::OnLost::Report,
            OnLost::StopBoard => ucom::profile::OnLost::StopBoard,
            OnLost::StopAll => ucom::profile::OnLost::StopAll,
        };
    }
    let mut driver = link.session_with(profile)?;
    let boards = driver.numbers(&args.boards)?;
    only(&boards, &args.ci, "run")?;
    only(&boards, &args.par, "run")?;
    let file = match &args.params {
        // If the user selects all boards, every board in the parameter file must be connected.
        Some(path) => Some(ParameterFile::read(path, &args.inventory, |n| {
            args.boards == Boards::All || boards.contains(&n)
        })?),
        None => None,
    };
    // The identities are read first, because this is possible without a started application.
    if let Some(file) = &file {
        file.identities(&mut driver)?;
    }
    let signals = link.signal_table()?;
    let mut stdout = Lines::stdout()?;
    let (report, prepared) = with_names(&args.cache.cache(), |cache| {
        let mut prepared = Prepared::default();
        let report = start(&mut driver, args, cache, &boards, &signals, file.as_ref(), &mut prepared);
        // A failed run undoes its own changes. After that, only the changes from before the run must be undone.
        let report = report.inspect_err(|_| prepared.undo(&mut driver))?;
        Ok((report, prepared))
    })?;
    print_running(&report, args.active, &stdout, out);
    let mut followed = Followed::new(prepared.known.keys().copied(), driver.now_us());
    let result = want_texts(&mut driver, args, &boards)
        .and_then(|()| supervise(&mut driver, args, &prepared, &mut followed, &stdout, out));
    followed.ask_no_more(&mut driver.master);
    let known = result.as_ref().err().map(|failure| failure.message.clone());
    let running = driver.halt(&boards, known);
    let list = running.iter().map(u8::to_string).collect::<Vec<_>>();
    let not_stopped = format!("not stopped for certain: {}", list.join(", "));
    let stopped = match running.is_empty() {
        true => json!({ "event": "stopped" }),
        false => json!({ "event": "stopped", "not_stopped": running }),
    };
    stdout.push_always(out.words(&stopped, || match running.is_empty() {
        true => "stopped".into(),
        false => not_stopped.clone(),
    }));
    finish(&mut stdout, &driver);
    result?;
    if !running.is_empty() {
        let next = format!(
            "without heartbeats these boards become safe by themselves; ucom stop {}",
            list.join(",")
        );
        return Err(Failure::new(ErrorKind::Fault, "not-stopped", not_stopped).next(next));
    }
    driver.nobody_lost(&boards)?;
    Ok(followed.nobody_left()?)
}

/// Prints that the boards run, with their flags and the load of the bus.
fn print_running(report: &RunReport, active: bool, stdout: &Lines, out: &Output) {
    let running = json!({
        "event": "running",
        "boards": report.boards.iter().map(|(n, a)| json!({ "board": n, "flags": a.to_string() })).collect::<Vec<_>>(),
        "load_percent": report.load.percent(),
    });
    stdout.push_always(out.words(&running, || {
        let outputs = if active { "outputs active" } else { "outputs safe; `active on` enables them" };
        let (run, them) = if report.boards.len() == 1 { ("runs", "it") } else { ("run", "them") };
        let boards = counted(report.boards.len(), "board");
        format!("{boards} {run}, {outputs}; {}\nCtrl-C stops {them}", report.load)
    }));
}

/// Reads the signal names, prepares the inputs and parameters, and starts all boards.
fn start(
    driver: &mut Driver,
    args: &RunArgs,
    cache: &Cache,
    boards: &[u8],
    signals: &SignalTable,
    file: Option<&ParameterFile>,
    prepared: &mut Prepared,
) -> Result<RunReport, SessionError> {
    for board in boards {
        prepared.add(driver, cache, signals, *board, args.force.force)?;
    }
    let plans = plans(driver, prepared, file, &args.ci, &args.par)?;
    let options = RunOptions { boards: plans.clone(), active: args.active, force: args.force.force };
    match driver.run(Request::Run(options))? {
        Outcome::Running(report) => {
            remember(cache, prepared, &plans);
            Ok(report)
        }
        other => Err(other.into()),
    }
}

/// Requests the debug texts of the boards if the user wants to see them.
fn want_texts(driver: &mut Driver, args: &RunArgs, boards: &[u8]) -> Result<(), Failure> {
    let on = |wanted: bool| wanted.then_some(true);
    for board in boards.iter().filter(|_| args.debug || args.global_debug) {
        let change =
            AdminChange { debug: on(args.debug), global_debug: on(args.global_debug), ..Default::default() };
        driver.run(Request::Admin { board: *board, change, force: true })?;
    }
    Ok(())
}

/// Supervises boards until Ctrl-C, until the user types `stop`, for the requested time, or until the last control
/// loop ends.
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
    let (start, mut reported) = (Instant::now(), Instant::now());
    let print = |driver: &Driver, notice: Notice| {
        if let Some(text) = notice.text() {
            driver.note(text);
        }
        if out.is_json() {
            stdout.push_always(notice_value(&notice).to_string());
        }
    };
    loop {
        driver.turn(Duration::from_millis(20))?;
        while let Some(event) = driver.master.take_event() {
            if let Some(notice) = followed.see(&event, driver.now_us()) {
                print(driver, notice);
            }
            driver.note_event(&event, None);
        }
        let now_us = driver.now_us();
        for notice in followed.look(&mut driver.master, now_us) {
            print(driver, notice);
        }
        // At this point the boards run, so this error is a fault and not a refusal.
        nothing_shared(&driver.master).map_err(|e| Failure { kind: ErrorKind::Fault, ..e.into() })?;
        while let Ok(line) = typed.try_recv() {
            if line.trim() == "stop" {
                return Ok(());
            }
            followed.ask_no_more(&mut driver.master);
            if let Err(e) = obey(driver, args, line.trim(), prepared) {
                driver.note(e.message);
            }
        }
        if followed.is_over(&driver.master, driver.now_us()) {
            driver.note("the run ends, because no board is in its control loop".into());
            return Ok(());
        }
        if driver.stop_asked() || args.duration.is_some_and(|d| start.elapsed() >= d) {
            return Ok(());
        }
        if reported.elapsed() >= REPORT_PERIOD && out.is_json() {
            reported = Instant::now();
            print_outputs(driver, prepared, followed, stdout, out);
        }
    }
}

/// Prints the last outputs of each board as events for `--json`.
fn print_outputs(driver: &Driver, prepared: &Prepared, followed: &Followed, stdout: &Lines, out: &Output) {
    for (board, snapshot, age_s, stale) in followed.outputs(&driver.master, driver.now_us()) {
        let Some(known) = prepared.known.get(&board) else { continue };
        let (so, units) = (known.values(Kind::So, &snapshot.words), known.units(Kind::So));
        let time_s = snapshot.time_us as f64 * 1e-6;
        let value = json!({
            "event": "so", "board": board, "time_s": time_s, "age_s": age_s, "stale": stale,
            "so": so, "units": units,
        });
        stdout.push(out.words(&value, String::new));
    }
}

/// Returns a notice as an event for `--json`.
fn notice_value(notice: &Notice) -> Value {
    let Notice { board, change, time_s, age_s } = *notice;
    match notice.is_of_loop() {
        true => json!({ "event": change.name(), "board": board, "time_s": time_s, "age_s": age_s }),
        false => json!({ "event": change.name(), "board": board, "time_s": time_s }),
    }
}
