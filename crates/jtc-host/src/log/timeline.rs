//! Timeline of a log, with all events in order and the first error at the top.

use std::fmt::Write;

use jtc_core::Config;
use jtc_core::recorder::RecordedKind;
use jtc_wire::{Code, FrameType, Joint, TrajectoryState, UrgentCommand, can_flag, error, joint_error};
use serde::Serialize;

use super::replay::{Replayed, Tick, Worth};
use crate::labels;
use crate::recording::RecordingInfo;
use crate::report::RunFailure;
use crate::sample::{JointSample, Sample};

/// Event in a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Event {
    /// Number of ticks since the start of the device.
    pub tick: u64,
    /// Number of starts of the device up to this event.
    #[serde(skip)]
    pub boots: u32,
    /// Time from the start of the device to the event, s.
    pub time_s: f64,
    /// Text that describes the event.
    pub text: String,
    /// `true` if an error begins with this event.
    pub error: bool,
    /// Joints to which the event applies.
    pub joints: Vec<Joint>,
}

/// Events of a log in the order of time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Timeline {
    /// Events of the log, ordered by time.
    pub events: Vec<Event>,
    /// Index of the first error in `events`. `None` if the log contains no error.
    pub first: Option<usize>,
}

impl Event {
    /// Returns the time from `other` to this event, ms. Returns `None` if `other` is later. Also returns `None` if
    /// the device was restarted between the two events, because the time between two starts is unknown.
    fn ms_after(&self, other: &Self) -> Option<u64> {
        self.tick.checked_sub(other.tick).filter(|_| self.boots == other.boots)
    }
}

impl Timeline {
    /// Builds the timeline of a replayed log.
    pub fn of(log: &Replayed) -> Self {
        let mut events = Vec::new();
        let mut narrator =
            Narrator { config: log.config.as_deref(), events: &mut events, silent: [0; 6], sent: None };
        let mut last: Option<&Tick> = None;
        for tick in &log.ticks {
            if let Some(last) = last {
                narrator.between(last, tick);
            } else {
                narrator.begin(tick);
            }
            last = Some(tick);
        }
        for event in events.iter_mut().filter(|event| !event.joints.is_empty()) {
            event.text = format!("{}: {}", names(&event.joints), event.text);
        }
        let first = events.iter().position(|event| event.error);
        Self { events, first }
    }

    /// Returns the first error and all other errors in the same tick, in the form that a report shows.
    pub fn failure(&self, info: &RecordingInfo, samples: &[Sample]) -> Option<RunFailure> {
        let first = self.events.get(self.first?)?;
        let with = self.events.iter().filter(|event| event.error && event.ms_after(first) == Some(0));
        let causes = with.map(|event| event.text.clone()).collect();
        Some(RunFailure::in_log(info, samples, first.time_s, causes, first.joints.first().copied()))
    }

    /// Returns the lines of a printed timeline. The first line is the first error. The next lines are the events after this error, each
    /// with its delay after the error. The last lines are the events before the error. If the log contains no error, all events are listed
    /// in order.
    pub fn lines(&self) -> Vec<String> {
        let Some(first) = self.first else {
            return self
                .events
                .iter()
                .map(|event| format!("{:.3} s: {}", event.time_s, event.text))
                .collect();
        };
        let at = &self.events[first];
        let mut lines = vec![format!("first: {:.3} s: {}", at.time_s, at.text)];
        for event in &self.events[first + 1..] {
            let when = event
                .ms_after(at)
                .map_or_else(|| format!("{:.3} s after a later start", event.time_s), after);
            lines.push(format!("{when}: {}", event.text));
        }
        // The event nearest to the error is listed first, and the number of listed events is limited.
        let ago = self.events[..first].iter().rev().map_while(|event| Some((at.ms_after(event)?, event)));
        let before: Vec<(u64, &Event)> = ago.take_while(|(ms, _)| *ms <= BEFORE_MS).take(BEFORE).collect();
        if !before.is_empty() {
            lines.push("before this error, the latest event first:".to_owned());
        }
        for (ms, event) in before {
            lines.push(format!("{} before: {}", span(ms), event.text));
        }
        lines
    }
}

/// Time window before an error, ms. `BEFORE` is the maximum number of events that are listed from this time window.
const BEFORE_MS: u64 = 3_000;
const BEFORE: usize = 20;

fn span(ms: u64) -> String {
    if ms < 1_000 { format!("{ms} ms") } else { format!("{:.3} s", ms as f64 * 1e-3) }
}

fn after(ms: u64) -> String {
    if ms == 0 { "in the same tick".to_owned() } else { format!("{} later", span(ms)) }
}

/// Formats joint names.
fn names(joints: &[Joint]) -> String {
    match joints {
        [joint] => joint.to_string(),
        all if all.len() == Joint::ALL.len() => "all joints".to_owned(),
        some => {
            let numbers: Vec<String> = some.iter().map(|joint| joint.number().to_string()).collect();
            format!("joints {}", numbers.join(", "))
        }
    }
}

/// Consecutive frames of the same type within this time (ms) are one event.
const SAME_MS: u64 = 50;
/// Number of ticks without an answer of a joint after which the timeline contains an event.
const SILENT: u32 = 3;

struct Narrator<'a> {
    config: Option<&'a Config>,
    events: &'a mut Vec<Event>,
    /// Number of consecutive ticks in which each joint has not answered.
    silent: [u32; 6],
    /// Type of the last frame from a host, and the tick of that frame.
    sent: Option<(FrameType, u64)>,
}

impl Narrator<'_> {
    fn push(&mut self, tick: &Tick, error: bool, text: impl Into<String>) {
        let time_s = tick.tick as f64 * 1e-3;
        self.events.push(Event {
            tick: tick.tick,
            boots: tick.boots,
            time_s,
            text: text.into(),
            error,
            joints: Vec::new(),
        });
    }

    /// Adds an event of a joint. If several joints have the same event in one tick, the timeline contains one event for all these joints.
    fn push_joint(&mut self, tick: &Tick, error: bool, joint: Joint, text: impl Into<String>) {
        let text = text.into();
        let same =
            |event: &&mut Event| event.error == error && event.text == text && !event.joints.is_empty();
        let now = self
            .events
            .iter_mut()
            .rev()
            .take_while(|event| (event.boots, event.tick) == (tick.boots, tick.tick));
        if let Some(event) = now.into_iter().find(same) {
            event.joints.push(joint);
            return;
        }
        self.push(tick, error, text);
        if let Some(event) = self.events.last_mut() {
            event.joints.push(joint);
        }
    }

    /// Adds an event for a frame from a host. A long frame is executed over several ticks, and frames of the same type
    /// often follow each other, so such frames share one event.
    fn host_sends(&mut self, tick: &Tick, kind: FrameType) {
        let before = self.sent.replace((kind, tick.tick));
        let goes_on =
            before.is_some_and(|(last, at)| last == kind && tick.tick.saturating_sub(at) <= SAME_MS);
        if !goes_on {
            self.push(tick, false, format!("a host sends: {}", labels::request(kind)));
        }
    }

    fn begin(&mut self, tick: &Tick) {
        if tick.worth == Worth::Measured {
            return self.push(tick, false, "the log begins");
        }
        let s = &tick.sample;
        let mut text =
            format!("the log begins: state {}, trajectory {}", s.state.name(), s.trajectory.name());
        if s.errors != 0 {
            let _ = write!(text, "; {}", labels::errors_line(&tick.status));
        }
        self.push(tick, false, text);
    }

    fn between(&mut self, last: &Tick, tick: &Tick) {
        if tick.boots != last.boots {
            (self.silent, self.sent) = ([0; 6], None);
            self.push(tick, false, format!("start number {} of the device", tick.boots));
        } else if tick.tick > last.tick + 1 {
            let missing = tick.tick - last.tick - 1;
            self.push(tick, false, format!("{missing} ticks before this one are not in the log"));
        }
        self.inputs(tick);
        let known = |tick: &Tick| tick.worth != Worth::Measured;
        if known(tick) && known(last) {
            self.errors(last, tick);
            self.states(last, tick);
        }
    }

    /// Adds events for the inputs of a tick.
    fn inputs(&mut self, tick: &Tick) {
        let Some(inputs) = &tick.inputs else { return };
        let mut answered = [false; 6];
        for frame in inputs.bus() {
            if let Some(joint) = frame.id.checked_sub(jtc_bus::id::MOVE_ANSWER)
                && let Some(answered) = answered.get_mut(usize::from(joint))
            {
                *answered = true;
            }
        }
        for (joint, answered) in Joint::ALL.into_iter().zip(answered) {
            let silent = &mut self.silent[joint.index()];
            let before = std::mem::replace(silent, if answered { 0 } else { *silent + 1 });
            if answered && before >= SILENT {
                self.push_joint(tick, false, joint, format!("answers again, after {before} ticks"));
            } else if before + 1 == SILENT && !answered {
                self.push_joint(tick, false, joint, format!("no answer for {SILENT} ticks"));
            }
        }
        if inputs.missed_ticks > 0 {
            self.push(tick, false, format!("{} ticks late or missing before this one", inputs.missed_ticks));
        }
        for commands in &inputs.urgent {
            for (command, _) in commands.iter() {
                let name = if command == UrgentCommand::Stop { "stop" } else { "pause" };
                self.push(tick, false, format!("a host sends: {name}"));
            }
        }
        for event in inputs.host() {
            match (event.kind, FrameType::from_byte(event.frame_type)) {
                (RecordedKind::Bad(status), _) => {
                    self.push(
                        tick,
                        false,
                        format!("a bad frame of a host: {}", labels::frame_status(status)),
                    );
                }
                (RecordedKind::Noise(_), _) | (_, None) => {}
                // A request that only reads data from the controller is not an event.
                (_, Some(kind)) if kind.is_extension() && kind < FrameType::SetSettings => {}
                (_, Some(FrameType::GetArm | FrameType::GetLog | FrameType::GetPoints)) => {}
                (_, Some(kind)) => self.host_sends(tick, kind),
            }
        }
    }

    /// Adds events for errors that begin in this tick.
    fn errors(&mut self, last: &Tick, tick: &Tick) {
        for joint in Joint::ALL {
            let bits =
                tick.sample.joints[joint.index()].internal & !last.sample.joints[joint.index()].internal;
            for bit in (0..16).map(|n| 1 << n).filter(|bit| bits & bit != 0) {
                let text = self.joint_error(joint, bit, last, tick);
                self.push_joint(tick, true, joint, text);
            }
        }
        let flags = tick.status.can_current & !last.status.can_current;
        for joint in Joint::ALL.into_iter().filter(|joint| flags & can_flag::no_answer(joint.index()) != 0) {
            self.push_joint(tick, true, joint, "does not answer");
        }
        if flags & can_flag::no_answer(jtc_bus::GRIPPER) != 0 {
            self.push(tick, false, "the gripper does not answer");
        }
        if flags & can_flag::TRANSMIT_TIMEOUT != 0 {
            self.push(tick, true, "no acknowledge on the joint bus");
        }
        if tick.status.errors & !last.status.errors & error::EMERGENCY_INPUT != 0 {
            self.push(tick, true, "the safety input is low (emergency stop)");
        }
        for joint in Joint::ALL {
            let (before, now) = (&last.status.joints[joint.index()], &tick.status.joints[joint.index()]);
            let faults = labels::motor_faults(now.mc_current & !before.mc_current).into_iter();
            let drive = labels::node_errors(now.errors & !before.errors).into_iter();
            for word in faults.chain(drive) {
                self.push_joint(tick, true, joint, word);
            }
            if now.state.is_fault() && !before.state.is_fault() {
                self.push_joint(tick, true, joint, "drive in its fault state");
            }
            let line = jtc_bus::warning::SAFETY_LINE;
            if now.warnings & !before.warnings & line != 0 && !labels::is_awaited(&last.status, joint.index())
            {
                self.push_joint(tick, false, joint, "safety line active");
            }
        }
        // An error event for the error bits of the controller is added only if the tick has no other error event. The
        // error of a joint, the bus or an input is more specific.
        let begins = tick.sample.errors & !last.sample.errors;
        if begins != 0 && !self.events.iter().rev().any(|event| event.tick == tick.tick && event.error) {
            self.push(tick, true, labels::errors(begins).join(", "));
        }
        let occurred =
            labels::occurred_since(&last.status.joints.map(|joint| joint.internal_occurred), &tick.status);
        if !occurred.is_empty() && begins == 0 {
            self.push(tick, false, format!("handled without an error: {occurred}"));
        }
    }

    fn states(&mut self, last: &Tick, tick: &Tick) {
        if tick.sample.state != last.sample.state {
            self.push(
                tick,
                false,
                format!("state {} \u{2192} {}", last.sample.state.name(), tick.sample.state.name()),
            );
        }
        let silent = Code::from(TrajectoryState::Null);
        if tick.sample.trajectory != last.sample.trajectory && tick.sample.trajectory != silent {
            let point = tick.sample.point;
            let text = format!("trajectory {} at {point} ms", tick.sample.trajectory.name());
            self.push(tick, false, text);
        }
        for joint in Joint::ALL {
            let (before, now) =
                (last.status.joints[joint.index()].state, tick.status.joints[joint.index()].state);
            if before != now && !now.is_fault() {
                self.push_joint(tick, false, joint, format!("{before} \u{2192} {now}"));
            }
        }
    }

    /// Describes an error that the controller detected in a joint, with the value and its limit.
    fn joint_error(&self, joint: Joint, bit: u16, last: &Tick, tick: &Tick) -> String {
        let name = labels::joint_errors(bit).first().copied().unwrap_or("an unnamed error");
        let j = joint.index();
        // In the tick of the error, the controller switches off the torque and deletes the commanded value. Therefore
        // the function uses the larger of two values: in this tick and in the previous tick.
        let larger = |value: fn(&JointSample) -> f64| {
            let values = [value(&last.sample.joints[j]), value(&tick.sample.joints[j])];
            if values[1].abs() > values[0].abs() { values[1] } else { values[0] }
        };
        let state = last.sample.state.name();
        let Some(limits) = self.config.and_then(|config| config.joints.get(j)) else {
            return format!("{name}, in {state}");
        };
        let overspeed = self.config.map_or(1.0, |config| config.overspeed_factor);
        let (value, limit, unit) = match bit {
            joint_error::POSITION_ERROR => {
                (larger(|s| s.set_position - s.position), limits.position_error_max, "rad")
            }
            joint_error::POSITION => {
                let value = larger(|s| s.set_position);
                (value, if value < 0.0 { limits.position_min } else { limits.position_max }, "rad")
            }
            joint_error::VELOCITY => {
                let (set, measured) = (larger(|s| s.set_velocity), larger(|s| s.velocity));
                if set.abs() > limits.velocity_max {
                    (set, limits.velocity_max, "rad/s")
                } else {
                    (measured, overspeed * limits.velocity_max, "rad/s")
                }
            }
            joint_error::ACCELERATION => (larger(|s| s.set_acceleration), limits.acceleration_max, "rad/s²"),
            joint_error::TORQUE => (larger(computed), limits.torque_max, "N·m"),
            _ => return format!("{name}, in {state}"),
        };
        format!("{name}: {value:.4} {unit} (limit {limit}), in {state}")
    }
}

/// Returns the torque that the control law computed, before the torque limit is applied.
fn computed(s: &JointSample) -> f64 {
    s.torque_model + s.torque_p + s.torque_i + s.torque_d + s.torque_friction
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A damaged log can contain two starts of the device. The time between the two starts is unknown, so only events
    /// after the same start as the error get a delay.
    #[test]
    fn j56_events_of_two_starts_are_listed_without_a_delay_between_them() {
        let event = |boots, tick: u64, error| Event {
            tick,
            boots,
            time_s: tick as f64 * 1e-3,
            text: format!("{boots}/{tick}"),
            error,
            joints: Vec::new(),
        };
        let events = vec![
            event(1, 900, false),
            event(2, 10, false),
            event(2, 50, true),
            event(2, 60, false),
            event(3, 5, false),
        ];
        let lines = Timeline { events, first: Some(2) }.lines();
        let expected = [
            "first: 0.050 s: 2/50",
            "10 ms later: 2/60",
            "0.005 s after a later start: 3/5",
            "before this error, the latest event first:",
            "40 ms before: 2/10",
        ];
        assert_eq!(lines, expected);
    }
}
