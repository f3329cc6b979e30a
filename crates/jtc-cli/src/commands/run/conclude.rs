//! Actions at the end of a run. The module writes the output files, prints the results and selects the exit code.

use std::collections::VecDeque;

use cli_kit::{ErrorKind, Failure, Output, table};
use jtc_host::port::Port;
use jtc_host::recording::Ending;
use jtc_host::report::{Digest, Facts, ReportInput, RunFailure, Summary};
use jtc_host::run::{Ended, Phase};
use jtc_host::session::Outcome;
use jtc_host::{Error, Session};
use serde_json::{Value, json};

use super::super::job::Job;
use super::super::run_report;
use super::terminal::{Reel, Taken};
use crate::link::LinkPort;

/// Largest number of motions whose results stay in memory, so that many runs do not fill the memory of a PC.
const KEPT: usize = 1000;

/// A motion that has ended.
pub(super) struct Done {
    pub phase: Phase,
    pub summary: Summary,
}

/// Number of motions that have ended, and the results of the last of these motions.
#[derive(Default)]
pub(super) struct Finished {
    kept: VecDeque<Done>,
    /// Number of finished runs, not including approaches.
    runs: usize,
    /// Number of runs and approaches whose results were dropped.
    left_out: usize,
}

impl Finished {
    pub(super) fn push(&mut self, done: Done) {
        self.runs += usize::from(done.phase != Phase::Approach);
        if self.kept.len() == KEPT {
            self.kept.pop_front();
            self.left_out += 1;
        }
        self.kept.push_back(done);
    }
}

/// Returns the outcome of a motion as one word.
fn word(outcome: &Result<Outcome, Error>) -> &'static str {
    match outcome {
        Ok(Outcome::Finished(_)) => "finished",
        Ok(Outcome::Stopped(_)) => "stopped",
        Err(_) => "fault",
    }
}

/// Writes the files of a run and prints its outcome.
pub(super) fn conclude(
    job: &Job,
    ended: Ended,
    taken: Taken,
    session: &Session<LinkPort>,
    out: &Output,
) -> Result<(), Failure> {
    let Ended { last, cut } = ended;
    let Taken { done, samples, reel, outputs } = taken;
    let Reel { mut info, tape, .. } = reel;
    let link = session.statistics();
    let facts = [Facts::of_link(&last.upload, &link, session.port().baud())];
    // After a failed run, the report shows the first failure.
    let broken = last.outcome.as_ref().err().map(|error| RunFailure::of(error, &info, &samples));
    let word = if cut { "stopped" } else { word(&last.outcome) };
    let digest = Digest::of(&samples);
    let summary = digest.summary(&info);
    let (phase, verdict) = (last.phase, last.checked.verdict());
    let (upload, outcome) = (last.upload, last.outcome);
    let where_ = if phase == Phase::Approach { " during the approach to the first point" } else { "" };
    let reason = match &outcome {
        Ok(_) if cut => format!("ended between two runs, after {} runs", done.runs + 1),
        Ok(_) => where_.trim_start().to_owned(),
        Err(e) if where_.is_empty() => e.to_string(),
        Err(e) => format!("{}: {e}", where_.trim_start()),
    };
    info.ending = Ending { outcome: word.into(), reason, ..Ending::default() };
    let input = ReportInput { facts: &facts, failure: broken.as_ref(), ..ReportInput::new(&info, &digest) };
    let (files, lost) = outputs.write(tape, &input);
    // All lost files are reported, even after a failed run. After a successful run, the first lost file becomes the
    // failure of the command, so it is not printed here.
    for failure in lost.iter().skip(usize::from(outcome.is_ok())) {
        out.note(format!("jtc: {}", failure.message));
    }
    let of_run = outcome
        .as_ref()
        .err()
        .map(|e| job.named(Failure { message: info.ending.reason.clone(), ..Failure::of(e) }));
    let failure = of_run.or(lost.into_iter().next());
    let error = failure.as_ref().map(cli_kit::error_object);
    let runs = runs(&done, (phase, word, &summary));
    let value = json!({
        "outcome": word,
        "phase": phase.name(),
        "recorded_s": summary.recorded_s,
        "executed_s": summary.executed_s,
        "samples": summary.samples,
        "joints": summary.joints,
        "runs": runs,
        "runs_finished": done.runs + usize::from(word == "finished" && phase == Phase::Motion || cut),
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
            out.note(format!("jtc: {}\n     {}", failure.message, failure.next));
            Err(Failure::shown(failure.kind))
        }
        (_, Some(failure)) => Err(failure),
        (Ok(Outcome::Stopped(_)), None) => Err(Failure::shown(ErrorKind::Fault)),
        (_, None) if cut => Err(Failure::shown(ErrorKind::Fault)),
        (_, None) => Ok(()),
    }
}

/// Returns the motions whose results are in memory as JSON, including approaches. `last` is the motion that ended the
/// run.
fn runs(done: &Finished, last: (Phase, &'static str, &Summary)) -> Vec<Value> {
    let before = done.kept.iter().map(|d| (d.phase, "finished", &d.summary));
    let mut number = done.runs - done.kept.iter().filter(|d| d.phase == Phase::Motion).count();
    let value = |(phase, outcome, summary): (Phase, &str, &Summary)| {
        number += usize::from(phase == Phase::Motion);
        json!({
            "run": (phase == Phase::Motion).then_some(number),
            "phase": phase.name(),
            "outcome": outcome,
            "executed_s": summary.executed_s,
            "joints": summary.joints,
        })
    };
    before.chain([last]).map(value).collect()
}

/// Returns a line for each motion whose results are in memory, with the values of the worst joint of the motion.
fn each_run(runs: &[Value], left_out: usize) -> String {
    let row = |run: &Value| {
        let worst = |key: &str, scale: f64, digits: usize| {
            let joints = run["joints"].as_array().into_iter().flatten();
            let most = joints.filter_map(|joint| joint[key].as_f64()).reduce(f64::max);
            most.map_or("-".into(), |v| cli_kit::figure(v * scale, digits))
        };
        let name = run["run"].as_u64().map_or("approach".into(), |n| format!("run {n}"));
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
    let before = if left_out > 0 { format!("{left_out} earlier motions finished\n") } else { String::new() };
    before + &table(&["worst joint", "", ">s", ">RMS mrad", ">max mrad", ">share %"], &rows)
}

#[cfg(test)]
mod tests {
    use jtc_host::Sample;
    use jtc_host::recording::RecordingInfo;

    use super::*;

    /// After 3001 motions (2001 runs and 1000 approaches), only the results of the last 1000 motions are in memory.
    /// The run numbers count all runs.
    #[test]
    fn figures_of_the_last_motions_are_kept() {
        let summary = Summary::of(&RecordingInfo::default(), &[Sample::default()]);
        let mut done = Finished::default();
        for n in 0..3_001 {
            let phase = if n % 3 == 2 { Phase::Approach } else { Phase::Motion };
            done.push(Done { phase, summary: summary.clone() });
        }
        assert_eq!((done.kept.len(), done.runs, done.left_out), (1000, 2001, 2001));
        let runs = runs(&done, (Phase::Motion, "stopped", &summary));
        assert_eq!(runs.len(), 1001);
        let number = |i: usize| runs[i]["run"].as_u64();
        assert_eq!((number(1000), number(999), number(998)), (Some(2002), Some(2001), None));
        assert_eq!(number(0), Some(1335));
        assert!(each_run(&runs, done.left_out).starts_with("2001 earlier motions finished\n"));
    }
}
