//! `jtc traj check`, `info`, `pause`, `resume`, `stop`: trajectories from files, and the one being executed.

use std::path::Path;

use cli_kit::{Output, figure, table};
use jtc_core::{Config, JOINTS};
use jtc_host::arm::Arm;
use jtc_host::check::{Checker, Suspicion, Verdict};
use jtc_host::port::SerialPort;
use jtc_host::session::UploadOptions;
use jtc_host::trajectory::{Form, Loaded, Trajectory, overshoot_words};
use jtc_host::{Error, Session, plan};
use jtc_wire::Joint;
use serde_json::json;

use super::run;
use crate::args::{CheckArgs, LinkArgs, TrajCommand};
use crate::failure::{Failure, REFUSED};
use crate::progress::Progress;

/// Speeds tried between one that passes and one that does not.
const TRIES: usize = 4;

/// Does one of the family.
pub fn traj(command: &TrajCommand, out: &Output) -> Result<(), Failure> {
    match command {
        TrajCommand::Check { file, check: args } => check(file, args, out),
        TrajCommand::Info { file, deg } => info(file, *deg, out),
        TrajCommand::Run(args) => run::run(args, out),
        TrajCommand::Replay(args) => {
            if Loaded::load(&args.file, None)?.form != Form::Recording {
                let message = format!("{} is no recording of a run", args.file.display());
                return Err(
                    Failure::usage(message).hint(format!("`jtc traj run {}` runs it", typed(&args.file)))
                );
            }
            run::run(args, out)
        }
        TrajCommand::Pause(link) => {
            send(link, Session::pause, "pause", "pausing on the path", out).map_err(may_be_moving)
        }
        TrajCommand::Resume(link) => send(link, Session::resume, "resume", "going on", out),
        TrajCommand::Stop(link) => {
            send(link, Session::stop, "stop", "stopping on the path", out).map_err(may_be_moving)
        }
    }
}

fn send(
    link: &LinkArgs,
    command: impl FnOnce(&mut Session<SerialPort>) -> Result<(), Error>,
    name: &str,
    words: &str,
    out: &Output,
) -> Result<(), Failure> {
    let progress = Progress::begin(out)?;
    let mut session = link.session()?;
    progress.watch(&mut session);
    command(&mut session)?;
    out.result(&json!({ "command": name, "accepted": true }), || words.to_owned());
    Ok(())
}

/// Whoever wants an arm to stand and has no port must know that nothing was sent.
fn may_be_moving(failure: Failure) -> Failure {
    if failure.code != "port" {
        return failure;
    }
    let hint = format!(
        "nothing was sent: if the arm is moving, press the emergency stop (where `jtc traj run` has the port, space pauses and s \
         stops there). {}",
        failure.hint
    );
    Failure { hint, ..failure }
}

/// A path as it can be typed in a shell.
pub fn typed(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

/// A trajectory at the speed asked for, and the arm that it is checked against.
pub struct Job {
    /// What the file was, and what was derived from it.
    pub loaded: Loaded,
    /// At the speed asked for.
    pub trajectory: Trajectory,
    /// Masses, friction, names.
    pub arm: Arm,
    /// Limits and settings that count.
    pub config: Config,
    /// File and arm, as they are typed.
    words: String,
    /// Percent of the file's own speed.
    speed: f64,
}

impl Job {
    /// Reads the files; notes and warnings go to stderr.
    pub fn load(file: &Path, args: &CheckArgs, out: &Output) -> Result<Self, Failure> {
        let arm = args.arm.as_deref().map(Arm::load).transpose()?.unwrap_or_else(Arm::avena);
        for warning in &arm.warnings {
            out.note(format!("note: {warning}"));
        }
        let loaded = Loaded::load(file, Some(&arm.joint_names))?;
        let loaded = if args.deg { loaded.in_degrees().map_err(|e| e.in_file(file))? } else { loaded };
        let overshoot = overshoot_words(&loaded.overshoot);
        for note in loaded.notes.iter().chain(&overshoot) {
            out.note(format!("note: {note}"));
        }
        let trajectory = if args.speed == 100.0 {
            loaded.trajectory.clone()
        } else {
            plan::at_speed(&loaded.trajectory, args.speed).map_err(Failure::usage)?
        };
        let config = arm.config();
        let arm_words = args.arm.as_deref().map_or(String::new(), |path| format!(" --arm {}", typed(path)));
        let words = typed(file) + if args.deg { " --deg" } else { "" } + &arm_words;
        Ok(Self { loaded, trajectory, arm, config, words, speed: args.speed })
    }

    /// What helps after a verdict, with the names that the person typed and the [passing speed](Self::passing_speed).
    fn hint(&self, verdict: &Verdict, passing_speed: Option<f64>) -> String {
        if verdict.suspicion() == Suspicion::Degrees && self.passes_as_degrees() {
            let words = &self.words;
            let columns = match self.loaded.form {
                Form::Csv => "; for good, name its columns q1_deg..q6_deg",
                _ => "",
            };
            return format!(
                "the positions look like degrees, and as such they pass: `jtc traj check {words} --deg`{columns}"
            );
        }
        verdict.hint_with(&self.words, self.speed, passing_speed)
    }

    /// The file's numbers are degrees, and nothing else is wrong with them.
    fn passes_as_degrees(&self) -> bool {
        let degrees = self.loaded.clone().in_degrees().map(|loaded| loaded.trajectory);
        let at_speed = degrees.ok().and_then(|t| plan::at_speed(&t, self.speed).ok());
        at_speed.is_some_and(|t| self.verdict(&t, None, UploadOptions::default()).is_ok())
    }

    /// The highest whole percentage that is tried and passes; none where no speed does, or speed is not what is wrong.
    pub fn passing_speed(&self, verdict: &Verdict) -> Option<f64> {
        let passes = |percent: f64| {
            let slower = plan::at_speed(&self.loaded.trajectory, percent);
            slower.is_ok_and(|t| self.verdict(&t, None, UploadOptions::default()).is_ok())
        };
        // The estimate may be too bold where torque is what is short, or too timid.
        let mut good = verdict.slower(self.speed)?;
        let mut bad = self.speed;
        while !passes(good) {
            bad = good;
            good = (0.7 * good).floor();
            if good < 1.0 {
                return None;
            }
        }
        for _ in 0..TRIES {
            let middle = (0.5 * (good + bad)).floor();
            if middle <= good {
                break;
            }
            if passes(middle) { good = middle } else { bad = middle }
        }
        Some(good)
    }

    /// Prints a verdict that refuses, and ends with exit code 4.
    pub fn refuse(&self, verdict: &Verdict, out: &Output) -> Failure {
        let passing_speed = self.passing_speed(verdict);
        let hint = self.hint(verdict, passing_speed);
        let value = json!({
            "outcome": "refused",
            "suspicion": verdict.suspicion(),
            "passing_speed_percent": passing_speed,
            "verdict": verdict,
            "error": { "code": "check", "message": verdict.to_string(), "hint": hint, "exit": REFUSED },
        });
        if out.is_json() {
            out.result(&value, String::new);
        }
        out.note(format!("jtc: {verdict}\n     {hint}"));
        Failure::printed(REFUSED)
    }

    /// A failure of this job, with the file's name where its hint leaves it open.
    pub fn named(&self, failure: Failure) -> Failure {
        let hint = failure.hint.replace("traj run FILE", &format!("traj run {}", self.words));
        Failure { hint, ..failure }
    }

    /// Parts of the torque that the check leaves out because the arm file does not give them.
    fn left_out(&self) -> Vec<&'static str> {
        let arm = &self.arm;
        let rotors = (0..JOINTS).any(|j| !arm.rotors_given[j] && self.config.joints[j].rotor_inertia == 0.0);
        let parts = [(arm.friction().is_none(), "friction"), (rotors, "rotor inertia")];
        parts.into_iter().filter_map(|(lacks, name)| lacks.then_some(name)).collect()
    }

    /// What the torques leave out, and how to give it; none where nothing is left out.
    fn without(&self) -> Option<String> {
        let parts = self.left_out();
        (!parts.is_empty()).then(|| {
            format!(
                "torques are computed without {}, which the file of arm {} does not give: the arm needs more. A copy of \
                 arms/avena.toml with the numbers of this arm gives all, by --arm",
                parts.join(" and "),
                self.arm.name
            )
        })
    }

    /// Says what the torques leave out, as a note.
    pub fn say_what_is_left_out(&self, out: &Output) {
        if let Some(words) = self.without() {
            out.note(format!("note: {words}"));
        }
    }

    /// Limits of every point and between points, torque by the arm model; the start pose, where it is given.
    pub fn verdict(
        &self,
        trajectory: &Trajectory,
        start: Option<[f64; 6]>,
        upload: UploadOptions,
    ) -> Verdict {
        let friction = self.arm.friction();
        let checker = Checker {
            model: Some(&self.arm.model),
            friction: friction.as_ref(),
            start,
            upload,
            ..Checker::new(&self.config)
        };
        checker.check(trajectory)
    }
}

fn check(file: &Path, args: &CheckArgs, out: &Output) -> Result<(), Failure> {
    let job = Job::load(file, args, out)?;
    let differences = job.arm.device_differences();
    if !differences.is_empty() {
        out.note(format!(
            "note: {} settings of this arm are in no frame, and the controller has others built in; `jtc traj run` lists them",
            differences.len()
        ));
    }
    let verdict = job.verdict(&job.trajectory, None, UploadOptions::default());
    let passing_speed = job.passing_speed(&verdict);
    let hint = job.hint(&verdict, passing_speed);
    let value = json!({
        "ok": verdict.is_ok(),
        "form": job.loaded.form,
        "notes": job.loaded.notes,
        "overshoot": job.loaded.overshoot,
        "left_out": job.left_out(),
        "suspicion": verdict.suspicion(),
        "passing_speed_percent": passing_speed,
        "hint": hint,
        "verdict": verdict,
    });
    out.result(&value, || {
        let without = job.without().map_or(String::new(), |words| words + "\n");
        format!("{verdict}\n{}{without}next: {}", figures(&verdict), hint.replace('`', ""))
    });
    if verdict.is_ok() { Ok(()) } else { Err(Failure::printed(REFUSED)) }
}

fn figures(verdict: &Verdict) -> String {
    let rows: Vec<Vec<String>> = Joint::ALL
        .iter()
        .zip(&verdict.joints)
        .map(|(joint, f)| {
            vec![
                joint.to_string(),
                format!("{} .. {}", figure(f.position_min_rad, 3), figure(f.position_max_rad, 3)),
                figure(f.velocity_peak_rad_s, 3),
                figure(f.acceleration_peak_rad_s2, 3),
                f.torque_peak_nm.map_or("-".into(), |t| figure(t, 1)),
            ]
        })
        .collect();
    table(&["", ">position rad", ">peak rad/s", ">peak rad/s²", ">peak N·m"], &rows)
}

fn info(file: &Path, deg: bool, out: &Output) -> Result<(), Failure> {
    let args = CheckArgs { arm: None, speed: 100.0, deg };
    let job = Job::load(file, &args, out)?;
    let (t, upload) = (&job.trajectory, UploadOptions::default());
    let verdict = job.verdict(t, None, upload);
    let per_segment = upload.segment_points(t.points.len());
    let segments = t.points.len().div_ceil(per_segment);
    let ends = |p: Option<&jtc_host::Point>| p.map(|p| p.position);
    let value = json!({
        "form": job.loaded.form,
        "notes": job.loaded.notes,
        "overshoot": job.loaded.overshoot,
        "points": t.points.len(),
        "step_ms": t.step_ms,
        "duration_s": t.duration_s(),
        "segments": segments,
        "first_position_rad": ends(t.points.first()),
        "last_position_rad": ends(t.points.last()),
        "joints": verdict.joints,
    });
    out.result(&value, || {
        format!(
            "{:?}: {} points, step {} ms, {:.2} s, {segments} segments of {per_segment}\n{}next: jtc traj check {}",
            job.loaded.form,
            t.points.len(),
            t.step_ms,
            t.duration_s(),
            figures(&verdict),
            job.words,
        )
    });
    Ok(())
}
