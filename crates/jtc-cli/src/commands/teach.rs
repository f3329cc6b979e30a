//! `jtc teach`: records a motion for which the user guides the arm by hand.

mod taught_file;

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use cli_kit::{Failure, Output, OutputFile, Stop};
use jtc_host::trajectory::Loaded;
use jtc_host::{Error, StateError};
use jtc_wire::ControllerState;
use serde_json::json;

use super::job::typed;
use crate::args::{LinkArgs, TeachCommand};
use crate::operator::ended_at_once;
use crate::progress::Progress;
use taught_file::TaughtFile;

/// Default of the largest deviation between the waypoints and the motion, rad.
const TOLERANCE: f64 = 0.01;

/// Runs a `jtc teach` command.
pub(super) fn teach(command: &TeachCommand, out: &Output) -> Result<(), Failure> {
    if matches!(command, TeachCommand::Record { .. }) {
        // The event stream begins here, so that a file that cannot be opened is also reported as an event.
        out.stream()?;
    }
    match command {
        TeachCommand::On(link) => switch(link, true, out),
        TeachCommand::Off(link) => switch(link, false, out),
        TeachCommand::Record { file, overwrite, link, duration, waypoints, tolerance } => {
            let tolerance = tolerance.unwrap_or(TOLERANCE);
            if *waypoints && !(1e-6..=1.0).contains(&tolerance) {
                let message = format!(
                    "tolerance is out of range: {tolerance} rad, expected 0.000001 to 1 rad; nothing was sent"
                );
                return Err(Failure::usage(message)
                    .next("choose a tolerance in this range; 0.01 rad is about half a degree"));
            }
            if *waypoints && file.exists() && !file.is_file() {
                let message = format!(
                    "{} is not a regular file, but waypoints can be written only at the end; nothing was \
                     sent",
                    file.display()
                );
                return Err(Failure::usage(message).next("choose a regular file, or leave out --waypoints"));
            }
            let output = OutputFile::open(file, overwrite.overwrite, &[]).map_err(Failure::nothing_sent)?;
            record(output, link, *duration, waypoints.then_some(tolerance), out)
        }
    }
}

fn switch(link: &LinkArgs, on: bool, out: &Output) -> Result<(), Failure> {
    link.session()?.teach(on)?;
    out.result(&json!({ "teaching": on }), || {
        if on {
            "teaching on: the arm can be moved by hand".into()
        } else {
            "teaching off: the arm holds its pose".into()
        }
    });
    Ok(())
}

/// Records the motion until the user or the time limit ends the recording. If a tolerance (rad) is specified, the result is a file of
/// waypoints.
fn record(
    file: OutputFile,
    link: &LinkArgs,
    duration: Option<f64>,
    thin: Option<f64>,
    out: &Output,
) -> Result<(), Failure> {
    let progress = Progress::begin(out)?;
    let (teaching, begun) = (Arc::<AtomicBool>::default(), Arc::<AtomicBool>::default());
    let stop = stop_at_once_with(*out, Arc::clone(&teaching), Arc::clone(&begun))?;
    let mut session = link.session()?;
    progress.watch(&mut session);
    let status = session.fresh_status()?;
    if stop.asked() {
        // After Ctrl-C, the user does not guide the arm. The command must not switch on Teaching, because the arm
        // would then have no support.
        let message = "cancelled before teaching was switched on".into();
        return Err(Failure { message, ..Failure::of(&jtc_host::Error::Cancelled) });
    }
    let was_on = status.state == ControllerState::Teaching;
    // The command sets the flag before the request, because the controller may accept the request even if its
    // confirmation is lost.
    teaching.store(true, Ordering::Relaxed);
    if !was_on {
        session.teach(true)?;
    }
    progress.event("teaching", json!({}));
    out.note("teaching: move the arm by hand; Ctrl-C ends the recording");
    let mut taught = TaughtFile::new(file);
    let mut lost = None;
    let ended = |time: Duration| stop.asked() || duration.is_some_and(|s| time.as_secs_f64() >= s);
    let recorded = session.record_teaching(ended, |time, positions| {
        match taught.take(time.as_secs_f64(), positions) {
            Ok(()) => {
                begun.store(taught.is_begun(), Ordering::Relaxed);
                ControlFlow::Continue(())
            }
            // If the file cannot be written, the recording ends, so that the user does not guide the arm in vain. The
            // controller then holds the arm, as after Ctrl-C.
            Err(e) => {
                lost = Some(e);
                ControlFlow::Break(())
            }
        }
    });
    if let Err(Error::State(StateError::TeachingEnded { .. } | StateError::TeachingFault { .. })) = &recorded
    {
        // The controller has ended Teaching by itself, so the message after a second signal must not mention Teaching.
        teaching.store(false, Ordering::Relaxed);
    }
    // The file is completed first, even if the link is lost.
    let written = lost.map_or_else(|| finish(taught, thin, out), Err);
    recorded.map_err(still_teaching)?;
    if !was_on {
        session.teach(false).map_err(still_teaching)?;
        teaching.store(false, Ordering::Relaxed);
    }
    written
}

/// Handles Ctrl-C and other signals. The first signal requests the end of the command. The second signal ends the command at once and
/// prints the state at that moment.
fn stop_at_once_with(
    out: Output,
    teaching: Arc<AtomicBool>,
    begun: Arc<AtomicBool>,
) -> std::io::Result<Stop> {
    Stop::listen_with(move || {
        let (teaching, begun) = (teaching.load(Ordering::Relaxed), begun.load(Ordering::Relaxed));
        let message = match (teaching, begun) {
            (true, true) => {
                "ended at once; the file contains the motion up to this point. The controller stays in \
                 Teaching: the arm can be moved by hand"
            }
            (true, false) => {
                "ended at once, nothing was recorded; the controller stays in Teaching: the arm can be moved by hand"
            }
            (false, true) => "ended at once; the file contains the motion",
            (false, false) => "ended at once, nothing was recorded",
        };
        ended_at_once(out, message, if teaching { "`jtc teach off` holds the arm" } else { "" })
    })
}

/// Returns the failure of a recording. If the link was lost, the message says that the controller stays in Teaching.
fn still_teaching(error: Error) -> Failure {
    let lost = matches!(error, Error::Link(_));
    let failure = Failure::from(error);
    if !lost {
        return failure;
    }
    let message =
        format!("{}. The controller stays in teaching: the arm can be moved by hand", failure.message);
    Failure { message, ..failure }
}

fn finish(taught: TaughtFile, thin: Option<f64>, out: &Output) -> Result<(), Failure> {
    let name = taught.name().to_owned();
    let Some(text) = taught.finish(thin)? else {
        return Err(Failure::usage("the arm was not moved: nothing was written"));
    };
    if thin.is_some() {
        let count = text.lines().count().saturating_sub(1);
        out.result(&json!({ "file": name, "waypoints": count }), || {
            let typed = typed(Path::new(&name));
            format!("{name}: {count} waypoints\nnext: jtc plan {typed} -o motion.csv --blend 0.05")
        });
        return Ok(());
    }
    let loaded = Loaded::parse(&text, None)?;
    for note in &loaded.notes {
        out.note(format!("note: {note}"));
    }
    let (t, typed) = (&loaded.trajectory, typed(Path::new(&name)));
    let value = json!({ "file": name, "points": t.points.len(), "duration_s": t.duration_s() });
    out.result(&value, || {
        format!("{name}: {} points, {:.2} s\nnext: jtc traj check {typed}", t.points.len(), t.duration_s())
    });
    Ok(())
}
