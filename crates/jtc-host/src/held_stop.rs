//! Description of a held stop (J-69), in which the drives hold the arm. All front ends show this description: cause,
//! value, limit and remedy.

use host_kit::{Next, next};
use jtc_wire::{ControllerState, Info, Joint, Reactions, Status, StopCause, StopKind};
use serde::Serialize;

use crate::explain::{self, Page};
use crate::labels;

/// Returns the next step after an encoder has jumped (J-35).
pub fn after_encoder_jump() -> Next {
    next!(
        "support the arm, {}, compare the joint with its marks, {}, then {}; if the fault returns, check the encoder, its cable and the setting \
         `velocity_full_scale_rad_s`",
        Disable,
        ResetJoint,
        RecoverWithArm
    )
}

/// Last held stop of a controller.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldStop {
    /// Name of this kind of cause, with hyphens between words.
    pub kind: String,
    /// Number that the protocol uses for this kind of cause.
    pub number: u8,
    /// Name of the explain page about this cause, for `jtc explain CODE`.
    pub code: &'static str,
    /// Number, from 1, of the first joint in which the cause occurred; `None` if the cause does not concern a joint.
    pub joint: Option<u8>,
    /// Measured value that caused the held stop; `None` if this kind of cause has no value.
    pub value: Option<f32>,
    /// Limit for the value; `None` if this kind of cause has no limit.
    pub limit: Option<f32>,
    /// Unit of the value and of the limit; empty if they have no unit.
    pub unit: &'static str,
    /// Description of the cause as a sentence without a full stop.
    pub text: String,
    /// Remedy for the cause, without commands.
    pub remedy: String,
    /// Time since the held stop began, s.
    pub ago_s: f64,
}

impl HeldStop {
    /// Creates the held stop from a cause that the controller detected `ago_ms` ago.
    pub fn new(cause: &StopCause, ago_ms: u32) -> Self {
        let (value, limit) = figures(cause);
        Self {
            kind: cause.kind.name().replace(' ', "-"),
            number: cause.kind as u8,
            code: page(cause.kind).map_or("", |page| page.name),
            joint: joint(cause).map(Joint::number),
            value,
            limit,
            unit: cause.kind.unit(),
            text: cause.to_string(),
            remedy: remedy(cause.kind),
            ago_s: f64::from(ago_ms) * 1e-3,
        }
    }

    /// Returns the last held stop that a controller reports.
    pub fn last(reactions: &Reactions) -> Option<Self> {
        reactions.stop.as_ref().map(|(cause, ago_ms)| Self::new(cause, *ago_ms))
    }

    /// Returns the cause and its age in one line, for example `joint 2 was pushed: …; 12 s ago`.
    pub fn line(&self) -> String {
        format!("{}; {} ago", self.text, age(self.ago_s))
    }
}

/// Reactions of a controller to faults.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Reacting {
    /// Last held stop; `None` if no held stop has occurred since the start of the controller, or since its occurred
    /// errors were last cleared (ClearOccurredErrors).
    pub last_held_stop: Option<HeldStop>,
    /// Numbers, from 1, of the joints that yield to a push, or that slowly lower a load because they cannot hold it
    /// (J-70).
    pub yields: Vec<u8>,
    /// Numbers, from 1, of the joints whose encoder has jumped since their drives were last configured.
    pub encoder_jumped: Vec<u8>,
    /// Rate of the path time (seconds of path time per second); 0 if no trajectory is executed.
    pub path_rate: f32,
    /// Time for which the controller slowed down the current motion because a torque was at its limit, s.
    pub held_back_s: f64,
}

impl From<&Reactions> for Reacting {
    fn from(reactions: &Reactions) -> Self {
        let numbers = |mask| joints(mask).into_iter().map(Joint::number).collect();
        Self {
            last_held_stop: HeldStop::last(reactions),
            yields: numbers(reactions.yields),
            encoder_jumped: numbers(reactions.jumped),
            path_rate: reactions.rate,
            held_back_s: f64::from(reactions.held_back_ms) * 1e-3,
        }
    }
}

impl Reacting {
    /// Returns the reactions that a controller reports; `None` if the controller does not report them.
    pub fn of(info: &Info) -> Option<Self> {
        info.reactions.as_ref().map(Self::from)
    }
}

/// Returns the joints whose bits are set in `mask`. The mask has one bit for each joint.
pub fn joints(mask: u8) -> Vec<Joint> {
    Joint::ALL.into_iter().filter(|joint| mask & 1 << joint.index() != 0).collect()
}

/// Returns the first joint in which the cause of a held stop occurred.
pub fn joint(cause: &StopCause) -> Option<Joint> {
    Joint::from_number(cause.joint.into())
}

/// Returns the value and the limit of a cause. The value or the limit is `None` if this kind of cause does not have one.
pub fn figures(cause: &StopCause) -> (Option<f32>, Option<f32>) {
    let known = match cause.kind {
        StopKind::Approach | StopKind::Gains => (false, false),
        StopKind::SpeedScale | StopKind::EncoderJump => (true, false),
        StopKind::Overload
        | StopKind::Push
        | StopKind::Shove
        | StopKind::PositionError
        | StopKind::Position
        | StopKind::Velocity
        | StopKind::Acceleration
        | StopKind::FrictionTable
        | StopKind::Unstable => (true, true),
    };
    (known.0.then_some(cause.value), (known.1 && cause.limit != 0.0).then_some(cause.limit))
}

/// Returns the page of `jtc explain` about a kind of cause.
pub fn page(kind: StopKind) -> Option<&'static Page> {
    explain::pages().find(|page| page.family == explain::Family::Stop && page.code == u32::from(kind as u8))
}

/// Returns the remedy for a cause as a part of a sentence, without commands and without a full stop.
pub fn remedy(kind: StopKind) -> String {
    page(kind).map_or_else(String::new, |page| clause(page.remedy))
}

/// Returns the usual reason for this kind of held stop as a part of a sentence, without a full stop.
pub fn usual_cause(kind: StopKind) -> String {
    page(kind).map_or_else(String::new, |page| clause(page.cause))
}

/// Changes a sentence into a clause that can be part of another sentence.
fn clause(sentence: &str) -> String {
    let mut letters = sentence.trim_end_matches('.').chars();
    letters.next().map_or_else(String::new, |first| first.to_lowercase().chain(letters).collect())
}

/// Returns the next step after a held stop.
pub fn next_step(status: &Status, cause: Option<&StopCause>) -> Next {
    match cause.map(|cause| cause.kind) {
        Some(StopKind::EncoderJump) => after_encoder_jump(),
        Some(kind) if status.is_held_stop() && status.state != ControllerState::Teaching => {
            labels::after_removing(&remedy(kind))
        }
        _ => labels::next_step(status),
    }
}

/// Formats a time (s) in a suitable unit.
pub fn age(s: f64) -> String {
    match s.max(0.0) as u64 {
        s @ 0..120 => format!("{s} s"),
        s @ 120..7_200 => format!("{} min", s / 60),
        s @ 7_200..172_800 => format!("{} h", s / 3600),
        s => format!("{} days", s / 86_400),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PUSH: StopCause = StopCause { kind: StopKind::Push, joint: 2, value: -61.5, limit: 54.0 };

    #[test]
    fn j69_a_held_stop_has_joint_value_limit_and_age() {
        let stop = HeldStop::new(&PUSH, 12_400);
        assert_eq!((stop.kind.as_str(), stop.number, stop.joint), ("push", 2, Some(2)));
        assert_eq!((stop.value, stop.limit, stop.unit), (Some(-61.5), Some(54.0), "N·m"));
        assert!(
            stop.line().starts_with("joint 2 was pushed: the controller held 61.5 N·m"),
            "{}",
            stop.line()
        );
        assert!(stop.line().ends_with("; 12 s ago"), "{}", stop.line());
        let approach = StopCause { kind: StopKind::Approach, joint: 0, value: 0.0, limit: 0.0 };
        let stop = HeldStop::new(&approach, 0);
        assert_eq!((stop.joint, stop.value, stop.limit), (None, None, None));
        let scale = StopCause { kind: StopKind::SpeedScale, joint: 3, value: 2.0, limit: 0.0 };
        assert_eq!(figures(&scale), (Some(2.0), None));
    }

    /// Each kind of cause has its own remedy and its own page of `jtc explain`.
    #[test]
    fn j69_each_kind_has_its_own_remedy() {
        let remedies = StopKind::ALL.map(remedy);
        for (kind, text) in StopKind::ALL.into_iter().zip(&remedies) {
            assert!(!text.is_empty() && !text.ends_with('.') && page(kind).is_some(), "{kind}: {text}");
            assert_eq!(remedies.iter().filter(|other| *other == text).count(), 1, "{kind}: {text}");
        }
    }

    #[test]
    fn j69_the_next_step_is_that_of_the_kind() {
        let held = Status {
            state: ControllerState::HoldPos.into(),
            errors: jtc_wire::error::INTERNAL_JOINTS,
            ..Status::default()
        };
        let next = next_step(&held, Some(&PUSH));
        assert!(
            next.to_string().starts_with(&remedy(StopKind::Push)) && next.to_string().contains("`jtc clear`"),
            "{next}"
        );
        assert_eq!(next_step(&held, None), labels::next_step(&held));
        let jump = StopCause { kind: StopKind::EncoderJump, ..PUSH };
        assert!(next_step(&held, Some(&jump)).to_string().contains("`jtc disable`"));
        let taught = Status { state: ControllerState::Teaching.into(), ..held };
        assert!(next_step(&taught, Some(&PUSH)).to_string().starts_with("`jtc teach off`"));
    }

    #[test]
    fn a_time_is_written_in_its_unit() {
        let times = [0.0, 119.9, 120.0, 7_199.0, 7_200.0, 172_799.0, 172_800.0].map(age);
        assert_eq!(times, ["0 s", "119 s", "2 min", "119 min", "2 h", "47 h", "2 days"]);
    }
}
