//! Trajectory from a file at the requested speed, with its arm and the result of the trajectory check.

use std::path::Path;

use cli_kit::{ErrorKind, Failure, Output, exit::REFUSED};
use host_kit::{Action, Next};
use jtc_core::{Config, Friction, JOINTS};
use jtc_host::arm::Arm;
use jtc_host::check::{Checker, ProblemKind, Suspicion, Verdict};
use jtc_host::plan::{self, Planner};
use jtc_host::recording::DeviceIdentity;
use jtc_host::session::UploadOptions;
use jtc_host::trajectory::{Form, Loaded, Trajectory, overshoot_words};
use serde_json::json;

use super::named_arm;
use crate::args::CheckArgs;

/// Number of speeds that are tested between a speed that passes and a speed that fails the trajectory check.
const TRIES: usize = 4;

/// Formats a path in the form in which the user can type it in a shell.
pub(super) fn typed(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+=:,@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        text
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

/// Returns the name of a file without directory and extension.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Returns the arm that the user has specified, or the built-in arm. Prints the warnings about the arm on stderr.
fn arm_of(args: &CheckArgs, out: &Output) -> Result<Arm, Failure> {
    let arm = named_arm::load(args.arm.as_deref())?;
    named_arm::note_warnings(&arm, out);
    Ok(arm)
}

/// A trajectory at the requested speed, and the arm for the trajectory check.
pub(super) struct Job {
    /// Loaded trajectory file and the data derived from the file.
    pub loaded: Loaded,
    /// Trajectory at the requested speed.
    pub trajectory: Trajectory,
    /// Arm with masses, friction and joint names.
    pub arm: Arm,
    /// Limits and settings that the command uses.
    pub config: Config,
    /// Configuration of the controller, if the command has read it.
    pub device: Config,
    /// Identity of the controller and hash of its arm. `None` if the controller does not report these values, or if the
    /// command has not read them.
    pub identity: Option<(DeviceIdentity, u64)>,
    /// Command-line words for the file and the arm, as the user typed them.
    pub words: String,
    /// Trajectory that runs after the trajectory of this job, and the number of its runs.
    pub later: Option<(Trajectory, u32)>,
    /// Speed in percent of the speed in the file.
    speed: f64,
    /// `true` if the command did not read a file. The command then plans the motion when it knows the position of the
    /// arm.
    made: bool,
}

impl Job {
    /// Reads the trajectory file and the arm file. Prints notes and warnings on stderr.
    pub(super) fn load(file: &Path, args: &CheckArgs, out: &Output) -> Result<Self, Failure> {
        let arm = arm_of(args, out)?;
        let loaded = Loaded::load(file, args.names_of(&arm))?;
        Self::with(arm, loaded, file, args, out)
    }

    /// Like [`Self::load`], with a trajectory that the command has already read.
    pub(super) fn of(loaded: Loaded, file: &Path, args: &CheckArgs, out: &Output) -> Result<Self, Failure> {
        Self::with(arm_of(args, out)?, loaded, file, args, out)
    }

    fn with(arm: Arm, loaded: Loaded, file: &Path, args: &CheckArgs, out: &Output) -> Result<Self, Failure> {
        let loaded = if args.deg { loaded.in_degrees().map_err(|e| e.in_file(file))? } else { loaded };
        let overshoot = overshoot_words(&loaded.overshoot);
        for note in loaded.notes.iter().chain(&overshoot) {
            out.note(format!("note: {note}"));
        }
        let trajectory = if args.speed() == 100.0 {
            loaded.trajectory.clone()
        } else {
            plan::at_speed(&loaded.trajectory, args.speed())?
        };
        let config = arm.config();
        let arm_words = named_arm::typed_option(args.arm.as_deref());
        let by_number = if args.joints_by_number { " --joints-by-number" } else { "" };
        let words = typed(file) + if args.deg { " --deg" } else { "" } + by_number + &arm_words;
        let device = Config::avena();
        Ok(Self {
            loaded,
            trajectory,
            arm,
            config,
            device,
            identity: None,
            words,
            later: None,
            speed: args.speed(),
            made: false,
        })
    }

    /// Creates a job without a trajectory file. [`Job::take`] later sets the motion of this job. `words` is the command as the
    /// user typed it.
    pub(super) fn made(arm: Arm, words: String, out: &Output) -> Self {
        named_arm::note_warnings(&arm, out);
        let loaded = Loaded {
            trajectory: Trajectory::default(),
            form: Form::Csv,
            notes: Vec::new(),
            overshoot: Vec::new(),
            units_named: true,
        };
        let (trajectory, config, device) = (Trajectory::default(), arm.config(), Config::avena());
        let identity = None;
        Self {
            loaded,
            trajectory,
            arm,
            config,
            device,
            identity,
            words,
            later: None,
            speed: 100.0,
            made: true,
        }
    }

    /// Sets the motion of this job.
    pub(super) fn take(&mut self, trajectory: Trajectory) {
        self.loaded.trajectory = trajectory.clone();
        self.trajectory = trajectory;
    }

    /// If a measured motion violates the limits with its measured times, plans its path again within the limits. The
    /// trajectory check reports the errors that remain.
    pub(super) fn plan_anew(&mut self, out: &Output) {
        let verdict = self.verdict(&self.trajectory, None, UploadOptions::default());
        let Some(why) = verdict.refusals().next() else { return };
        let friction = self.arm.friction();
        let Ok(planned) = self.planner(friction.as_ref()).anew(&self.loaded.trajectory) else { return };
        let Ok(at_speed) = plan::at_speed(&planned.trajectory, self.speed) else { return };
        out.note(format!(
            "note: the measured motion violates the limits ({why}), so its path was planned again: at most \
            {} rad away, in {:.2} s instead of {:.2} s",
            Planner::ASIDE,
            planned.trajectory.duration_s(),
            self.loaded.trajectory.duration_s()
        ));
        self.loaded.trajectory = planned.trajectory;
        self.trajectory = at_speed;
    }

    /// Returns the hint for the verdict of a trajectory check. The hint contains the names that the user typed and the [passing
    /// speed](Self::passing_speed).
    pub(super) fn hint(&self, verdict: &Verdict, passing_speed: Option<f64>) -> Next {
        if self.made {
            return format!(
                "check the position of the arm with `jtc status`; `jtc {}` plans again from there",
                self.words
            )
            .into();
        }
        if verdict.suspicion() == Suspicion::Degrees && self.passes_as_degrees() {
            let words = &self.words;
            let columns = match self.loaded.form {
                Form::Csv => "; or rename the columns of the file to q1_deg..q6_deg",
                _ => "",
            };
            return format!(
                "the positions look like degrees, and pass the check in degrees: `jtc traj check {words} \
                --deg`{columns}"
            )
            .into();
        }
        let ends_in_motion = verdict.refusals().any(|p| p.kind == ProblemKind::NotAtRest);
        if self.loaded.form == Form::Recording && ends_in_motion {
            let words = &self.words;
            return format!(
                "the recording is incomplete: `jtc traj continue {words} --trajectory FILE` runs the \
                remainder of that file, `jtc traj replay {words} --measured` runs the measured part, from \
                rest to rest"
            )
            .into();
        }
        verdict.hint_with(&self.words, self.speed, passing_speed)
    }

    /// Returns `true` if the trajectory passes the check when its values are read as degrees.
    fn passes_as_degrees(&self) -> bool {
        let degrees = self.loaded.clone().in_degrees().map(|loaded| loaded.trajectory);
        let at_speed = degrees.ok().and_then(|t| plan::at_speed(&t, self.speed).ok());
        at_speed.is_some_and(|t| self.verdict(&t, None, UploadOptions::default()).is_ok())
    }

    /// Returns the highest speed in whole percent that passes the check. Returns `None` if no speed passes, or if the problem does not
    /// depend on the speed.
    pub(super) fn passing_speed(&self, verdict: &Verdict) -> Option<f64> {
        let passes = |percent: f64| {
            let slower = plan::at_speed(&self.loaded.trajectory, percent);
            slower.is_ok_and(|t| self.verdict(&t, None, UploadOptions::default()).is_ok())
        };
        // The estimated speed can be too low. If a torque limit is exceeded, the estimate can also be too high.
        // Therefore the command tests other speeds.
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

    /// Prints the verdict of a failed trajectory check, and returns the failure with exit code 4.
    pub(super) fn refuse(&self, verdict: &Verdict, out: &Output) -> Failure {
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
        Failure::shown(ErrorKind::Refused)
    }

    /// Completes the commands in the hint of a failure with the words that the user typed, such as the name of the
    /// trajectory file.
    pub(super) fn named(&self, failure: Failure) -> Failure {
        let again =
            if self.made { format!("jtc {}", self.words) } else { format!("jtc traj run {}", self.words) };
        let next = failure.next.with_command(Action::TrajRun, &again);
        let next = next.with_command(Action::TrajRunWithApproach, &format!("{again} --approach"));
        Failure { next, ..failure }
    }

    /// Returns the parts of the torque that are missing in the check, because the arm file does not contain the parameters
    /// of these parts.
    pub(super) fn left_out(&self) -> Vec<&'static str> {
        let arm = &self.arm;
        let rotors = (0..JOINTS).any(|j| !arm.rotors_given[j] && self.config.joints[j].rotor_inertia == 0.0);
        let parts = [(arm.friction().is_none(), "friction"), (rotors, "rotor inertia")];
        parts.into_iter().filter_map(|(lacks, name)| lacks.then_some(name)).collect()
    }

    /// Describes the missing parts of the torque, and how the user can add these parts. Returns `None` if no part is missing.
    pub(super) fn without(&self) -> Option<String> {
        let parts = self.left_out();
        (!parts.is_empty()).then(|| {
            format!(
                "torques are computed without {}: the file of arm {} does not give these values, so the arm \
                needs more torque. Copy arms/avena.toml, enter the values of this arm, and pass the copy with --arm",
                parts.join(" and "),
                self.arm.name
            )
        })
    }

    /// Prints a note about the missing parts of the torque.
    pub(super) fn note_what_is_left_out(&self, out: &Output) {
        if let Some(words) = self.without() {
            out.note(format!("note: {words}"));
        }
    }

    /// Returns a planner for the arm of this job, with the limits of this job. `friction` is the friction of this arm.
    pub(super) fn planner<'a>(&'a self, friction: Option<&'a Friction>) -> Planner<'a> {
        Planner { model: Some(&self.arm.model), friction, ..Planner::new(&self.config) }
    }

    /// Checks the limits at and between the points, the torque from the arm model, and the start pose if the caller
    /// specifies one.
    pub(super) fn verdict(
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
