//! `jtc teach`: moving the arm by hand, and recording it.

use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use cli_kit::{Output, Stop};
use jtc_host::trajectory::Loaded;
use jtc_host::words;
use jtc_wire::Status;
use serde_json::json;

use super::traj::typed;
use crate::args::{LinkArgs, TeachCommand};
use crate::failure::{FAULT, Failure};
use crate::operator::ended_at_once;
use crate::output_file::OutputFile;

/// Movement below this is standing still, rad.
const STILL: f64 = 0.002;

/// Does one of the family.
pub fn teach(command: &TeachCommand, out: &Output) -> Result<(), Failure> {
    match command {
        TeachCommand::On(link) => switch(link, true, out),
        TeachCommand::Off(link) => switch(link, false, out),
        TeachCommand::Record { file, force, link, duration } => {
            record(OutputFile::open(file, force.force, &[])?, link, *duration, out)
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

fn record(file: OutputFile, link: &LinkArgs, duration: Option<f64>, out: &Output) -> Result<(), Failure> {
    let (teaching, its_out) = (Arc::new(AtomicBool::new(false)), *out);
    let its_teaching = Arc::clone(&teaching);
    let stop = Stop::listen_with(move || {
        if its_teaching.load(Ordering::Relaxed) {
            let message = "ended at once, nothing was recorded; the controller stays in Teaching: the arm can be moved by hand";
            ended_at_once(its_out, message, "`jtc teach off` holds the arm")
        } else {
            ended_at_once(its_out, "ended at once, nothing was recorded", "")
        }
    })?;
    let mut session = link.session()?;
    let status = session.fresh_status()?;
    if stop.asked() {
        // Teaching would take the hold from an arm that nobody leads any more.
        let message = "cancelled before teaching was switched on".into();
        return Err(Failure { message, ..Failure::of(&jtc_host::Error::Cancelled) });
    }
    let was_on = status.fsm == 4;
    // Before it is asked for: a confirmation that does not come may be that of a request that was taken.
    teaching.store(true, Ordering::Relaxed);
    if !was_on {
        session.teach(true)?;
    }
    out.note("teaching: move the arm by hand; Ctrl-C ends the recording");
    let start = session.now();
    let mut poses: Vec<(f64, [f64; 6])> = Vec::new();
    let mut failed: Option<Failure> = None;
    while !stop.asked() && duration.is_none_or(|s| (session.now() - start).as_secs_f64() < s) {
        match session.next_status() {
            Ok(s) if s.fsm == 5 || s.errors != 0 => {
                failed = Some(
                    Failure {
                        exit: FAULT,
                        code: "run-fault".into(),
                        ..Failure::usage(words::errors_line(&s))
                    }
                    .hint(words::next_step(&s)),
                );
                break;
            }
            Ok(s) if s.fsm == 4 => poses.push(((session.now() - start).as_secs_f64(), pose(&s))),
            Ok(_) => {}
            Err(e) => {
                let failure = Failure::from(e);
                let message = format!(
                    "{}. The controller stays in teaching: the arm can be moved by hand",
                    failure.message
                );
                failed = Some(Failure { message, ..failure });
                break;
            }
        }
    }
    // What was recorded is written first, whatever becomes of the link.
    let written = write(file, &poses, out);
    if failed.is_none() && !was_on {
        session.teach(false)?;
        teaching.store(false, Ordering::Relaxed);
    }
    failed.map_or(written, Err)
}

fn write(file: OutputFile, poses: &[(f64, [f64; 6])], out: &Output) -> Result<(), Failure> {
    let poses = moving(poses);
    if poses.len() < 3 {
        return Err(Failure::usage("the arm was not moved: nothing was written"));
    }
    let loaded = Loaded::parse(&csv(poses), None)?;
    for note in &loaded.notes {
        out.note(format!("note: {note}"));
    }
    let (t, name) = (&loaded.trajectory, file.name());
    let typed = typed(Path::new(&name));
    file.write(&t.to_csv()).map_err(Failure::output_lost)?;
    let value = json!({ "file": name, "points": t.points.len(), "duration_s": t.duration_s() });
    out.result(&value, || {
        format!("{name}: {} points, {:.2} s\nnext: jtc traj check {typed}", t.points.len(), t.duration_s())
    });
    Ok(())
}

fn pose(s: &Status) -> [f64; 6] {
    s.joints.map(|j| f64::from(j.position))
}

/// Without the standing still before and after, but with the last resting pose of each.
fn moving(poses: &[(f64, [f64; 6])]) -> &[(f64, [f64; 6])] {
    let moved = |a: &[f64; 6], b: &[f64; 6]| a.iter().zip(b).any(|(x, y)| (x - y).abs() > STILL);
    let (Some(first), Some(last)) = (poses.first(), poses.last()) else { return poses };
    let begin = poses.iter().position(|p| moved(&p.1, &first.1)).unwrap_or(poses.len()).saturating_sub(1);
    let end = poses.iter().rposition(|p| moved(&p.1, &last.1)).map_or(0, |i| (i + 2).min(poses.len()));
    if begin < end { &poses[begin..end] } else { &[] }
}

/// On the controller's 40 ms grid: the host's clock only says which status was lost.
fn csv(poses: &[(f64, [f64; 6])]) -> String {
    let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
    let (start, mut last) = (poses[0].0, -1);
    for (time, q) in poses {
        let slot = ((time - start) / 0.04).round() as i64;
        if slot <= last {
            continue;
        }
        last = slot;
        let _ = write!(text, "{:.3}", slot as f64 * 0.04);
        for v in q {
            let _ = write!(text, ",{v:.6}");
        }
        text.push('\n');
    }
    text
}
