//! `jtc log`: reads and replays the flight recorder.

use std::path::Path;

use cli_kit::{ErrorKind, Failure, Output, OutputFile};
use jtc_host::arm::Arm;
use jtc_host::log::{Account, FlightLog, Tick};
use jtc_host::recording::Format;
use jtc_host::report::{Digest, Facts, ReportInput, html};
use jtc_wire::{Hash, LogState};
use serde_json::{Value, json};

use super::info::hash;
use crate::args::{LinkArgs, LogCommand};
use crate::failure::output_lost;

/// Runs a `jtc log` command.
pub(super) fn log(command: &LogCommand, out: &Output) -> Result<(), Failure> {
    match command {
        LogCommand::Fetch { out: file, report, arm, overwrite, link } => {
            let files = Files::open(file.as_deref(), report.as_deref(), arm.as_deref(), overwrite.overwrite)?;
            fetch(files, arm.as_deref(), link, out)
        }
        LogCommand::Clear { link } => clear(link, out),
        LogCommand::Replay { file, arm } => replay(file, arm.as_deref(), out),
    }
}

/// Output files of the command. The command opens these files before any other step.
struct Files {
    recording: Option<OutputFile>,
    report: Option<OutputFile>,
}

impl Files {
    fn open(
        file: Option<&Path>,
        report: Option<&Path>,
        arm: Option<&Path>,
        overwrite: bool,
    ) -> Result<Self, Failure> {
        if let Some(file) = file
            && Format::of(file)? != Format::Mcap
        {
            let message = format!("{}: not a valid name for a log, expected an .mcap file", file.display());
            return Err(Failure::usage(message));
        }
        let inputs: Vec<&Path> = arm.into_iter().collect();
        let recording = file.map(|file| OutputFile::open(file, overwrite, &inputs)).transpose()?;
        let others: Vec<&Path> = inputs.into_iter().chain(file).collect();
        let report = report.map(|page| OutputFile::open(page, overwrite, &others)).transpose()?;
        Ok(Self { recording, report })
    }
}

/// Log of the flight recorder, with the report about its contents.
struct Read(Account);

impl Read {
    fn new(log: FlightLog, arm: Option<&Path>, source: &str) -> Result<Self, Failure> {
        let other = match arm.map(Arm::load).transpose()? {
            None => None,
            Some(arm) => {
                let image = arm.image().map_err(Failure::usage)?.ok_or_else(|| {
                    Failure::usage(format!(
                        "{}: gains or friction are missing; give a complete arm file",
                        arm.name
                    ))
                })?;
                Some((arm, image))
            }
        };
        Ok(Self(Account::of(log, other, source)))
    }

    fn as_json(&self) -> Value {
        let Account { log, replayed, story, info, .. } = &self.0;
        let time = |tick: Option<&Tick>| tick.map(|tick| tick.sample.time_s);
        json!({
            "state": log.state.name(),
            "device": log.device,
            "arm": info.arm,
            "hash": hash(Hash::of_image(&log.arm)),
            "ticks": replayed.ticks.len(),
            "from_s": time(replayed.ticks.first()),
            "to_s": time(replayed.ticks.last()),
            "replayed": replayed.same,
            "unsure": replayed.unsure,
            "other_arm": replayed.other_arm,
            "other_trajectory": replayed.other_points,
            "difference": replayed.difference,
            "gaps": replayed.gaps,
            "first": story.first.map(|first| &story.events[first]),
            "events": story.events,
        })
    }

    /// Describes the replayed part of the log in one line. Adds a line for each reason why a part of the log is
    /// missing.
    fn extent(&self) -> Vec<String> {
        let replayed = &self.0.replayed;
        let verdict = match &replayed.difference {
            None => "no difference".to_owned(),
            Some(difference) => format!(
                "the first difference is at tick {} ({:.3} s), state {}: the replay gives {}",
                difference.tick,
                difference.tick as f64 * 1e-3,
                difference.state,
                difference.replayed
            ),
        };
        let mut lines =
            vec![format!("{} ticks, {} replayed, {verdict}", replayed.ticks.len(), replayed.same)];
        if replayed.difference.is_some() {
            lines.push(format!(
                "a replay is exact only with the same version: this is jtc {}, the log is from {}",
                env!("CARGO_PKG_VERSION"),
                self.0.log.device
            ));
        }
        if replayed.broken {
            lines.push(
                "the log contains a state that no controller can reach; the replay ends there".to_owned(),
            );
        }
        if replayed.unsure > 0 {
            lines.push(format!(
                "{} ticks follow a frame that is not in the log (too long, or parameters): their replay may \
                 differ from reality",
                replayed.unsure
            ));
        }
        if replayed.other_arm > 0 {
            let arms: Vec<String> = replayed.arms.iter().map(|arm| hash(*arm)).collect();
            lines.push(format!(
                "{} ticks are from an arm with hash {}, but the present arm has hash {}: only the measured \
                 values of these ticks are known\n\
                 next: give the file of that arm with --arm FILE",
                replayed.other_arm,
                arms.join(", "),
                hash(Hash::of_image(&self.0.log.arm)),
            ));
        }
        if replayed.other_points > 0 {
            lines.push(format!(
                "{} ticks are on a trajectory that the controller no longer has: only the measured values of \
                 these ticks are known",
                replayed.other_points
            ));
        }
        lines
    }

    fn text(&self) -> String {
        let mut lines = self.0.story.lines();
        lines.push(String::new());
        lines.extend(self.extent());
        lines.join("\n")
    }

    /// Returns the events of the log as a table for the report page.
    fn facts(&self) -> Vec<Facts> {
        let rows =
            self.0.story.events.iter().map(|event| (format!("{:.3} s", event.time_s), event.text.clone()));
        let about = [
            ("device".to_owned(), self.0.log.device.clone()),
            ("flight recorder".to_owned(), self.0.log.state.to_string()),
            ("replay".to_owned(), self.extent().join("; ")),
        ];
        vec![
            Facts { title: "Events".into(), rows: rows.collect() },
            Facts { title: "Log".into(), rows: about.to_vec() },
        ]
    }

    fn write(&self, files: Files) -> Result<Vec<String>, Failure> {
        let mut names = Vec::new();
        if let Some(mut file) = files.recording {
            let open = file.begin().map_err(output_lost)?;
            self.0.write(open, file.path()).map_err(output_lost)?;
            names.push(file.name());
            file.is_written();
        }
        if let Some(page) = files.report {
            names.push(page.name());
            let facts = self.facts();
            let digest = Digest::of(&self.0.replayed.samples());
            let input = ReportInput {
                facts: &facts,
                failure: self.0.failure.as_ref(),
                ..ReportInput::new(&self.0.info, &digest)
            };
            page.write(html(&input)).map_err(output_lost)?;
        }
        Ok(names)
    }
}

fn fetch(files: Files, arm: Option<&Path>, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut session = link.session()?;
    let mut bar = None;
    let log = session.fetch_log(|here, all| {
        let bar = bar.get_or_insert_with(|| out.bytes_bar(all as u64, "flight recorder"));
        bar.set_length(all as u64);
        bar.set_position(here as u64);
    })?;
    if let Some(bar) = bar {
        bar.finish();
    }
    let read = Read::new(log, arm, &link.name()?)?;
    if read.0.replayed.ticks.is_empty() {
        let message =
            "the flight recorder is still empty: it was cleared, or the controller has just started";
        let failure = Failure::new(ErrorKind::Device, "empty-log", message);
        return Err(failure.next("repeat `jtc log fetch` after 1 s"));
    }
    let names = read.write(files)?;
    let mut value = read.as_json();
    value["files"] = json!(names);
    out.result(&value, || {
        let mut text = read.text();
        for name in &names {
            text += &format!("\n{name}");
        }
        match read.0.log.state {
            LogState::Error | LogState::Reset => {
                text + "\nthe recorder has stopped and keeps this log; next: jtc log clear, then jtc recover"
            }
            _ => text + "\nthe recorder continues to record",
        }
    });
    Ok(())
}

fn clear(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut session = link.session()?;
    let before = session.log_status()?.state;
    session.clear_log()?;
    out.result(&json!({ "cleared": true, "before": before.name() }), || {
        "the log is cleared; the flight recorder records again".to_owned()
    });
    Ok(())
}

fn replay(file: &Path, arm: Option<&Path>, out: &Output) -> Result<(), Failure> {
    let log = FlightLog::load(file)?;
    let read = Read::new(log, arm, &file.display().to_string())?;
    let fails = read.0.replayed.difference.is_some() || read.0.replayed.broken || read.0.replayed.same == 0;
    out.result(&read.as_json(), || {
        let mut lines = read.extent();
        lines.push(String::new());
        lines.extend(read.0.story.lines());
        lines.join("\n")
    });
    if fails { Err(Failure::shown(ErrorKind::Refused)) } else { Ok(()) }
}
