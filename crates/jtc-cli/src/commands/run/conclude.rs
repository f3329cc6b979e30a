//! How a run ended: its files, its figures, and the exit code.

use std::collections::VecDeque;

use cli_kit::{ErrorKind, Failure, Output, table};
use jtc_host::check::Verdict;
use jtc_host::port::Port;
use jtc_host::recording::{Ending, RecordingInfo};
use jtc_host::report::{Digest, Facts, ReportInput, RunFailure, Summary};
use jtc_host::session::Outcome;
use jtc_host::{Error, MotionError, Session};
use serde_json::{Value, json};

use super::super::job::Job;
use super::super::run_report;
use super::leg::{APPROACH, Leg, Reel};
use super::outputs::Outputs;
use crate::link::LinkPort;

/// Motions whose figures are kept: many runs must not fill the memory of a PC.
const KEPT: usize = 1000;

/// The motions of a run, in their order.
pub struct Legs {
    /// Those that were finished, with their figures.
    pub done: Finished,
    /// The one that ended the run.
    pub last: Leg,
    /// What the check found of it.
    pub verdict: Verdict,
    /// It was finished, and the person ended the run before the next one.
    pub cut: bool,
}

/// A motion that was finished.
pub struct Done {
    pub phase: &'static str,
    pub summary: Summary,
}

/// Motions that were finished: how many, and the figures of the last ones.
#[derive(Default)]
pub struct Finished {
    kept: VecDeque<Done>,
    /// Runs among all of them, without approaches.
    runs: usize,
    /// Runs and approaches that are not kept any more.
    left_out: usize,
}

impl Finished {
    pub fn push(&mut self, done: Done) {
        self.runs += usize::from(done.phase != APPROACH);
        if self.kept.len() == KEPT {
            self.kept.pop_front();
            self.left_out += 1;
        }
        self.kept.push_back(done);
    }
}

/// How a motion ended, in a word.
fn word(outcome: &Result<Outcome, Error>) -> &'static str {
    match outcome {
        Ok(Outcome::Finished(_)) => "finished",
        Ok(Outcome::Stopped(_)) => "stopped",
        Err(_) => "fault",
    }
}

/// A run that ended in a fault is what one wants to look at most: what broke first in it.
fn what_broke(info: &RecordingInfo, leg: &Leg) -> Option<RunFailure> {
    let error = leg.outcome.as_ref().err()?;
    let found = RunFailure::find(info, &leg.samples);
    let found = found.unwrap_or_else(|| RunFailure::ended_by(info, &leg.samples, error.to_string()));
    Some(match error {
        Error::Motion(MotionError::RunFault { status, .. }) => found.with_status(status),
        _ => found,
    })
}

/// Writes the files of a run and prints how it ended.
pub fn conclude(
    job: &Job,
    legs: Legs,
    reel: Reel,
    session: &Session<LinkPort>,
    outputs: Outputs,
    out: &Output,
) -> Result<(), Failure> {
    let Legs { done, last, verdict, cut } = legs;
    let Reel { mut info, tape, .. } = reel;
    let link = session.statistics();
    let facts = [Facts::of_link(&last.upload, &link, session.port().baud())];
    let broken = what_broke(&info, &last);
    let word = if cut { "stopped" } else { word(&last.outcome) };
    let digest = Digest::of(&last.samples);
    let summary = digest.summary(&info);
    let Leg { phase, upload, outcome, .. } = last;
    let where_ =
        if phase == APPROACH { format!(" on the {APPROACH} to the first point") } else { String::new() };
    let reason = match &outcome {
        Ok(_) if cut => format!("ended between two runs, {} were done", done.runs + 1),
        Ok(_) => where_.trim_start().to_owned(),
        Err(e) if where_.is_empty() => e.to_string(),
        Err(e) => format!("{}: {e}", where_.trim_start()),
    };
    info.ending = Ending { outcome: word.into(), reason, ..Ending::default() };
    let input = ReportInput { facts: &facts, failure: broken.as_ref(), ..ReportInput::new(&info, &digest) };
    let (files, lost) = outputs.write(tape, &input);
    // A file that is lost is reported even when the run failed, but the run comes first.
    for failure in lost.iter().skip(usize::from(outcome.is_ok())) {
        out.note(format!("jtc: {}", failure.message));
    }
    let of_run = outcome
        .as_ref()
        .err()
        .map(|e| job.named(Failure { message: info.ending.reason.clone(), ..Failure::of(e) }));
    let failure = of_run.or(lost.into_iter().next());
    let error = failure.as_ref().map(Failure::to_json);
    let runs = runs(&done, (phase, word, &summary));
    let value = json!({
        "outcome": word,
        "phase": phase,
        "recorded_s": summary.recorded_s,
        "executed_s": summary.executed_s,
        "samples": summary.samples,
        "joints": summary.joints,
        "runs": runs,
        "runs_finished": done.runs + usize::from(word == "finished" && phase != APPROACH || cut),
        "runs_left_out": done.left_out,
        "failure": broken,
        "verdict": verdict,
        "upload": upload,
        "link": link,
        "files": files,
        "error": error,
    });
    out.result(&value, || {
        let made: String = files.iter().map(|f| format!("\n{f}")).collect();
        let line = run_report::link_line(&upload, &link);
        let each =
            if runs.len() > 1 { format!("\n{}", each_run(&runs, done.left_out)) } else { String::new() };
        format!(
            "{each}\n{word}{where_}: {:.2} s\n{}\n{line}{made}",
            summary.executed_s,
            run_report::verdict(broken.as_ref(), &summary)
        )
    });
    match (outcome, failure) {
        (_, Some(failure)) if out.is_json() => {
            out.note(format!("jtc: {}\n     {}", failure.message, failure.hint));
            Err(Failure::printed(failure.kind))
        }
        (_, Some(failure)) => Err(failure),
        (Ok(Outcome::Stopped(_)), None) => Err(Failure::printed(ErrorKind::Fault)),
        (_, None) if cut => Err(Failure::printed(ErrorKind::Fault)),
        (_, None) => Ok(()),
    }
}

/// Every motion of the run as JSON, approaches among them; the last one ended it.
fn runs(done: &Finished, last: (&'static str, &'static str, &Summary)) -> Vec<Value> {
    let before = done.kept.iter().map(|d| (d.phase, "finished", &d.summary));
    let mut number = done.runs - done.kept.iter().filter(|d| d.phase != APPROACH).count();
    let value = |(phase, outcome, summary): (&str, &str, &Summary)| {
        number += usize::from(phase != APPROACH);
        json!({
            "run": (phase != APPROACH).then_some(number),
            "phase": phase,
            "outcome": outcome,
            "executed_s": summary.executed_s,
            "joints": summary.joints,
        })
    };
    before.chain([last]).map(value).collect()
}

/// A line for each motion whose figures are kept: the worst of its joints.
fn each_run(runs: &[Value], left_out: usize) -> String {
    let row = |run: &Value| {
        let worst = |key: &str, scale: f64, digits: usize| {
            let joints = run["joints"].as_array().into_iter().flatten();
            let most = joints.filter_map(|joint| joint[key].as_f64()).reduce(f64::max);
            most.map_or("-".into(), |v| cli_kit::figure(v * scale, digits))
        };
        let name = run["run"].as_u64().map_or(APPROACH.into(), |n| format!("run {n}"));
        vec![
            name,
            run["outcome"].as_str().unwrap_or_default().into(),
            run["executed_s"].as_f64().map_or("-".into(), |s| format!("{s:.2}")),
            worst("rms_error_mrad", 1.0, 3),
            worst("max_error_mrad", 1.0, 3),
            worst("torque_share", 100.0, 0),
        ]
    };
    let rows: Vec<Vec<String>> = runs.iter().map(row).collect();
    let before =
        if left_out > 0 { format!("{left_out} motions were finished before these\n") } else { String::new() };
    before + &table(&["worst joint", "", ">s", ">RMS mrad", ">max mrad", ">share %"], &rows)
}

#[cfg(test)]
mod tests {
    use jtc_host::Sample;
    use jtc_host::recording::RecordingInfo;

    use super::*;

    /// The memory of 100,000 runs is that of the last thousand, which have their numbers.
    #[test]
    fn figures_of_the_last_motions_are_kept() {
        let summary = Summary::of(&RecordingInfo::default(), &[Sample::default()]);
        let mut done = Finished::default();
        for n in 0..3_001 {
            let phase = if n % 3 == 2 { APPROACH } else { "motion" };
            done.push(Done { phase, summary: summary.clone() });
        }
        assert_eq!((done.kept.len(), done.runs, done.left_out), (1000, 2001, 2001));
        let runs = runs(&done, ("motion", "stopped", &summary));
        assert_eq!(runs.len(), 1001);
        let number = |i: usize| runs[i]["run"].as_u64();
        assert_eq!((number(1000), number(999), number(998)), (Some(2002), Some(2001), None));
        assert_eq!(number(0), Some(1335));
        assert!(each_run(&runs, done.left_out).starts_with("2001 motions were finished before these\n"));
    }
}
