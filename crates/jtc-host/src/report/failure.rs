//! First error of a failed run, with the time, the joint, and the values before and after the error.

use std::fmt::Write;

use jtc_bus::GRIPPER;
use jtc_wire::{ControllerState, Joint, NodeState, Status, can_flag};
use serde::Serialize;

use crate::error::{Error, MotionError};
use crate::labels;
use crate::recording::{Ending, RecordingInfo};
use crate::sample::Sample;

/// Number of samples that are shown before and after the first sample with an error.
pub(super) const BEFORE: usize = 3;
const AFTER: usize = 2;
/// Factor for detecting a jump. A position step is a jump if it exceeds this factor times the largest step at the velocity limit. Noise and
/// time jitter cause smaller steps.
const STEP_SHARE: f64 = 1.2;

/// Values of a joint at one time near the failure. Unknown values are NaN.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Moment {
    /// Time since the start of the run, ms.
    pub time_ms: f64,
    /// Joint.
    pub joint: Joint,
    /// State of the controller.
    pub state: &'static str,
    /// Commanded position, rad.
    pub set_position_rad: f64,
    /// Measured position, rad.
    pub position_rad: f64,
    /// Measured velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Torque, N·m.
    pub torque_nm: f64,
    /// Torque limit, N·m.
    pub torque_limit_nm: f64,
    /// Error bits of this joint as text.
    pub errors: Vec<String>,
    /// `true` for the first sample that shows the failure.
    pub first: bool,
}

/// Failure of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunFailure {
    /// Problems that were found; the first error comes before its consequences.
    pub causes: Vec<String>,
    /// First joint that failed; `None` if no joint failed.
    pub joint: Option<Joint>,
    /// Time from the start of the run to the failure, ms. During a motion, the time is computed from the point index
    /// of the controller.
    pub at_ms: f64,
    /// Time of the first sample that shows the failure, s. The time is on the clock of the samples.
    pub time_s: f64,
    /// Time between the last sample without an error and the first sample with the failure, ms. The failure occurred
    /// during this time.
    pub within_ms: f64,
    /// Values before and after the failure.
    pub moments: Vec<Moment>,
    /// `true` if the failure comes from a flight recorder log. The times of a log are device times, in seconds since the start of the
    /// device.
    #[serde(skip)]
    pub in_log: bool,
}

impl RunFailure {
    /// Returns the first error since the start of the execution. If the samples contain no execution, searches all samples. Returns `None`
    /// if the samples do not show an error.
    pub fn find(info: &RecordingInfo, samples: &[Sample]) -> Option<Self> {
        let begin = begin(samples);
        let at = begin + samples.get(begin..)?.iter().position(is_bad)?;
        Some(Self::found(info, &Around::of(samples, at)))
    }

    /// Returns the failure of a recorded run. The failure is the first error in the samples. If the samples contain no error, the failure
    /// is the recorded reason for the end. If there is neither an error nor a reason, the failure is that the recording does not show the
    /// end of the run.
    pub fn of_recording(info: &RecordingInfo, samples: &[Sample], ending: &Ending) -> Option<Self> {
        if let Some(found) = Self::find(info, samples) {
            return Some(found);
        }
        let unseen = samples.last().is_some_and(Sample::is_operating);
        Some(Self::ended_by(info, samples, why_it_ended(ending, unseen)?))
    }

    /// Returns the failure in a log, with the given `causes` and `joint`. `time_s` is the time of the sample that shows
    /// the failure.
    pub fn in_log(
        info: &RecordingInfo,
        samples: &[Sample],
        time_s: f64,
        causes: Vec<String>,
        joint: Option<Joint>,
    ) -> Self {
        let at = samples.iter().position(|sample| sample.time_s >= time_s).unwrap_or(samples.len());
        let around = Around::of(samples, at.min(samples.len().saturating_sub(1)));
        Self { in_log: true, ..Self::at(info, &around, causes, joint) }
    }

    /// Returns the failure of a run whose samples do not contain an error. The time of the failure is the time of the
    /// last sample, and the cause is `reason`.
    pub fn ended_by(info: &RecordingInfo, samples: &[Sample], reason: String) -> Self {
        Self::at(info, &Around::of(samples, samples.len().saturating_sub(1)), vec![reason], None)
    }

    /// Returns the failure of a run that ended with `error`.
    pub fn of(error: &Error, info: &RecordingInfo, samples: &[Sample]) -> Self {
        let found = Self::find(info, samples);
        found.unwrap_or_else(|| Self::ended_by(info, samples, error.to_string())).with_error(error)
    }

    /// Adds the errors of the drives, which only `error` contains.
    pub fn with_error(self, error: &Error) -> Self {
        match error {
            Error::Motion(MotionError::RunFault { status, .. }) => self.with_status(status),
            _ => self,
        }
    }

    /// Adds the errors that the drives report in `status`.
    pub(super) fn with_status(self, status: &Status) -> Self {
        let (causes, joint) = causes(&Words::of_status(status));
        if causes.is_empty() { self } else { Self { causes, joint: joint.or(self.joint), ..self } }
    }

    /// Returns one line with the time and the first cause of the failure.
    pub fn headline(&self) -> String {
        let cause = self.causes.first().map_or("an unnamed error", String::as_str);
        if self.in_log {
            return format!("FIRST, {:.3} s after the start of the device: {cause}", self.time_s);
        }
        format!("FAILED {:.0} ms into the run: {cause}", self.at_ms)
    }

    /// Returns the failure that the samples show.
    pub(super) fn found(info: &RecordingInfo, around: &Around) -> Self {
        let words = around.samples.get(around.at).map(Words::of_sample);
        let (mut causes, mut joint) = words.map_or_else(Default::default, |words| causes(&words));
        if joint.is_none()
            && let Some((j, step)) = stepped(info, &around.samples, around.at)
        {
            joint = Some(j);
            causes.insert(0, step);
        }
        Self::at(info, around, causes, joint)
    }

    pub(super) fn at(
        info: &RecordingInfo,
        around: &Around,
        causes: Vec<String>,
        joint: Option<Joint>,
    ) -> Self {
        let Around { samples, at, start_s } = around;
        let (at, start_s) = (*at, *start_s);
        let time = |i: usize| samples.get(i).map_or(start_s, |s| s.time_s);
        let into_ms = |i: usize| (time(i) - start_s) * 1e3;
        let moment = |i: usize, joint: Joint| {
            let (sample, own) = (&samples[i], &samples[i].joints[joint.index()]);
            Moment {
                time_ms: into_ms(i),
                joint,
                state: sample.state.name(),
                set_position_rad: own.set_position,
                position_rad: own.position,
                velocity_rad_s: own.velocity,
                torque_nm: own.torque,
                torque_limit_nm: info.joints[joint.index()].torque_max_nm,
                errors: Words::of_sample(sample).joint(joint),
                first: i == at,
            }
        };
        // If a joint failed, the table shows this joint before and after the failure. If no joint failed, the table shows all joints up to
        // the failure.
        let moments = match joint {
            Some(joint) => (at.saturating_sub(BEFORE)..samples.len().min(at + AFTER + 1))
                .map(|i| moment(i, joint))
                .collect(),
            None if samples.is_empty() => Vec::new(),
            None => (at.saturating_sub(BEFORE)..=at)
                .flat_map(|i| Joint::ALL.into_iter().map(move |j| (i, j)))
                .map(|(i, j)| moment(i, j))
                .collect(),
        };
        let within_ms = (time(at) - time(at.saturating_sub(1))) * 1e3;
        Self { causes, joint, at_ms: into_ms(at), time_s: time(at), within_ms, moments, in_log: false }
    }

    /// Header of the table: columns with texts, followed by columns with numbers and their units.
    pub const HEAD: [&'static str; 9] = [
        "ms",
        "joint",
        "state",
        "commanded rad",
        "measured rad",
        "speed rad/s",
        "torque N·m",
        "limit N·m",
        "errors",
    ];

    /// Returns the rows of the table. For an unknown value, the cell contains a dash.
    pub fn rows(&self) -> Vec<[String; 9]> {
        let figure = |v: f64, digits: usize| {
            if v.is_finite() { format!("{v:.digits$}").replace('-', "−") } else { "–".to_owned() }
        };
        let row = |m: &Moment| {
            [
                figure(m.time_ms, 0),
                m.joint.number().to_string(),
                m.state.to_owned(),
                figure(m.set_position_rad, 4),
                figure(m.position_rad, 4),
                figure(m.velocity_rad_s, 3),
                figure(m.torque_nm, 1),
                figure(m.torque_limit_nm, 0),
                m.errors.join(", "),
            ]
        };
        self.moments.iter().map(row).collect()
    }

    /// Returns the HTML of the failure for the top of the page.
    pub(super) fn html(&self) -> String {
        let mut out = format!(
            "<section class=\"failure\" role=\"alert\">\n<h1>{}</h1>\n",
            super::escape(&self.headline())
        );
        if self.causes.len() > 1 {
            let others: Vec<String> = self.causes[1..].iter().map(|c| super::escape(c)).collect();
            let _ = writeln!(out, "<p>other errors at this time: {}</p>", others.join(", "));
        }
        let (whose, before) = match self.joint {
            Some(joint) => (format!("Joint {} around this error", joint.number()), "the marked line"),
            None => ("All joints until this error".to_owned(), "the last of these moments"),
        };
        let _ = writeln!(
            out,
            "<p>{whose}; the error occurred in the {:.0} ms before {before}.</p>",
            self.within_ms
        );
        out.push_str("<div class=\"scroll\"><table><tr>");
        for head in Self::HEAD {
            let _ = write!(out, "<th>{head}</th>");
        }
        out.push_str("</tr>\n");
        for (row, moment) in self.rows().iter().zip(&self.moments) {
            out.push_str(if moment.first && self.joint.is_some() { "<tr class=\"first\">" } else { "<tr>" });
            for cell in row {
                let _ = write!(out, "<td>{}</td>", super::escape(cell));
            }
            out.push_str("</tr>\n");
        }
        out.push_str("</table></div>\n</section>\n");
        out
    }
}

/// Returns `true` if the sample shows an error.
pub(super) fn is_bad(sample: &Sample) -> bool {
    sample.errors != 0 || sample.state == ControllerState::Error
}

/// Returns the reason why a run failed although its samples show no error. `unseen` is `true` if the arm was still
/// moving at the last sample. Returns `None` if the run did not fail.
pub(super) fn why_it_ended(ending: &Ending, unseen: bool) -> Option<String> {
    match (ending.is_fault(), ending.reason.as_str()) {
        (true, "") => Some("the run ended in a fault, but the recording does not name the fault".to_owned()),
        (true, reason) => Some(reason.to_owned()),
        (false, _) if unseen && ending.outcome.is_empty() => Some(
            "the end of the motion was not recorded: the last sample is in the middle of the motion"
                .to_owned(),
        ),
        (false, _) => None,
    }
}

/// Sample at the time of a failure, with the samples before and after this sample that the report shows.
#[derive(Clone, Debug, Default)]
pub(super) struct Around {
    pub(super) samples: Vec<Sample>,
    /// Index of the failure's sample in `samples`.
    pub(super) at: usize,
    /// Start time of the run, s.
    pub(super) start_s: f64,
}

impl Around {
    fn of(samples: &[Sample], at: usize) -> Self {
        let from = at.saturating_sub(BEFORE);
        let piece = samples.get(from..samples.len().min(at + AFTER + 1)).unwrap_or_default();
        Self { samples: piece.to_vec(), at: at - from, start_s: start_s(samples, at) }
    }

    /// Adds a later sample if it is close enough to the time of the failure.
    pub(super) fn follow(&mut self, sample: &Sample) {
        if self.samples.len() <= self.at + AFTER {
            self.samples.push(*sample);
        }
    }
}

/// Finds a joint whose measured position changed too fast between two samples near sample `at`: by more than
/// `STEP_SHARE` times the largest change at the velocity limit. Returns the joint and a description of the change.
/// The result is used if the status does not show which joint failed.
fn stepped(info: &RecordingInfo, samples: &[Sample], at: usize) -> Option<(Joint, String)> {
    let mut worst: Option<(f64, Joint, String)> = None;
    for i in at.max(1)..samples.len().min(at + 2) {
        let since = |i: usize| samples[i].time_s - samples[i.saturating_sub(1)].time_s;
        // After a failure, the sample times are arrival times, so samples that arrive together seem to have no time
        // between them. Therefore the function uses the longest of the last three intervals.
        let span_s = (1..=i).rev().take(3).map(since).fold(0.0, f64::max);
        for (joint, limits) in Joint::ALL.into_iter().zip(&info.joints) {
            let position = |i: usize| samples[i].joints[joint.index()].position;
            let step = (position(i) - position(i - 1)).abs();
            let allowed = limits.velocity_max_rad_s * span_s;
            let share = step / allowed;
            if allowed > 0.0 && share > STEP_SHARE && worst.as_ref().is_none_or(|w| share > w.0) {
                let words = format!(
                    "{joint}: the measured position changed by {step:.3} rad in {:.0} ms, its velocity limit allows {allowed:.3} rad",
                    span_s * 1e3
                );
                worst = Some((share, joint, words));
            }
        }
    }
    worst.map(|(_, joint, words)| (joint, words))
}

/// Returns the index of the first sample in an execution. Without an execution, returns the index of the first sample.
fn begin(samples: &[Sample]) -> usize {
    samples.iter().position(Sample::is_operating).unwrap_or(0)
}

/// Returns the start time of the run, s. The time is computed from the point index of the last sample in motion, which
/// gives the most precise result.
fn start_s(samples: &[Sample], at: usize) -> f64 {
    let known = &samples[..samples.len().min(at + 1)];
    match known.iter().rfind(|s| s.state == ControllerState::Operate) {
        Some(s) => began_s(s),
        None => samples.get(begin(samples)).map_or(0.0, |s| s.time_s),
    }
}

/// Computes the start time of the run from one sample, s.
pub(super) fn began_s(sample: &Sample) -> f64 {
    sample.time_s - f64::from(sample.point) * 1e-3
}

/// Error words at one time, from a sample or a status.
struct Words {
    errors: u16,
    can: u32,
    joints: [JointWords; 6],
}

/// Error words of a joint.
#[derive(Clone, Copy, Default)]
struct JointWords {
    internal: u16,
    node: u8,
    motor: u8,
    state: NodeState,
}

impl Words {
    fn of_sample(s: &Sample) -> Self {
        let joints =
            s.joints.map(|j| JointWords { internal: j.internal, state: j.state, ..JointWords::default() });
        Self { errors: s.errors, can: s.can_current, joints }
    }

    fn of_status(s: &Status) -> Self {
        let joints = s.joints.map(|j| JointWords {
            internal: j.internal,
            node: j.errors,
            motor: j.mc_current,
            state: j.state,
        });
        Self { errors: s.errors, can: s.can_current, joints }
    }

    /// Returns the problems of a joint.
    fn joint(&self, joint: Joint) -> Vec<String> {
        let own = &self.joints[joint.index()];
        let silent = (self.can & can_flag::no_answer(joint.index()) != 0).then_some("does not answer");
        let all = silent
            .into_iter()
            .chain(labels::motor_faults(own.motor))
            .chain(labels::node_errors(own.node))
            .chain(labels::joint_errors(own.internal))
            .chain(own.state.is_fault().then_some("drive in its fault state"));
        all.map(String::from).collect()
    }
}

/// Returns the problems and the first failed joint. The problems of the joints are first in the list, because the errors of the controller
/// are consequences of joint errors.
fn causes(words: &Words) -> (Vec<String>, Option<Joint>) {
    let mut all = Vec::new();
    let mut first = None;
    for joint in Joint::ALL {
        for problem in words.joint(joint) {
            first = first.or(Some(joint));
            all.push(format!("{joint}: {problem}"));
        }
    }
    if words.can & can_flag::TRANSMIT_TIMEOUT != 0 {
        all.push("no acknowledge on the joint bus".into());
    }
    if words.can & can_flag::no_answer(GRIPPER) != 0 {
        all.push("the gripper does not answer".into());
    }
    let own = crate::labels::errors(words.errors).into_iter().map(|word| format!("controller: {word}"));
    all.extend(own);
    (all, first)
}
