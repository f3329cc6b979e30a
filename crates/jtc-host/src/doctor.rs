//! Diagnosis of the serial link, the joint bus and the parameters. Each finding about a fault contains the next step.

use std::time::Duration;

use host_kit::{Action, Findings, next};
pub use host_kit::{Finding, Severity};
use jtc_bus::warning;
use jtc_wire::{ControllerState, Joint, NodeState, Reactions, Status, StopCause, StopKind, error};

use crate::held_stop::{self, HeldStop};
use crate::port::Port;
use crate::{Error, Session, labels};

/// Bit rates that the doctor tries if the received bytes do not contain a valid frame.
pub const RATES: [u32; 8] = [115_200, 921_600, 3_000_000, 230_400, 460_800, 1_000_000, 2_000_000, 57_600];

/// Interval at which an examination checks if the caller wants to end it.
const LOOK: Duration = Duration::from_millis(50);

/// Facts that were observed on the link.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Observation {
    /// Bit rate of the serial port, Bd.
    pub baud: Option<u32>,
    /// Duration of the examination, s.
    pub time_s: f64,
    /// Number of bytes received during the examination.
    pub bytes: u64,
    /// Number of received bytes that are not part of a status frame.
    pub bad_bytes: u64,
    /// Number of status frames received during the examination.
    pub statuses: u64,
    /// Last status that was received.
    pub status: Option<Status>,
    /// `true` if the controller confirmed a request; `None` if no request was sent.
    pub confirmed: Option<bool>,
    /// Another bit rate at which status frames were received.
    pub other_baud: Option<u32>,
    /// Joints that the user has marked as absent (J-53).
    pub absent: Vec<Joint>,
    /// Report of the controller about a held stop and about the encoders (J-69). In a held stop, the drives hold the
    /// arm. `None` if the report was not requested or is not supported.
    pub reactions: Option<Reactions>,
}

impl<P: Port> Session<P> {
    /// Receives from the port for the duration `time` and returns the observed facts. A port without received bytes is an observation, not
    /// an error.
    ///
    /// # Errors
    ///
    /// Returns an error if the port is lost.
    pub fn examine(&mut self, time: Duration) -> Result<Observation, Error> {
        self.examine_until(time, || false)
    }

    /// Like [`Session::examine`], but ends early when `ended` returns `true`.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`Session::examine`].
    pub fn examine_until(&mut self, time: Duration, ended: impl Fn() -> bool) -> Result<Observation, Error> {
        let (start, before) = (self.now(), self.statistics());
        let end = start + time;
        let mut status = None;
        loop {
            let now = self.now();
            if now >= end || ended() {
                break;
            }
            status = self.poll((end - now).min(LOOK))?.or(status);
        }
        let after = self.statistics();
        Ok(Observation {
            baud: self.port().baud(),
            time_s: (self.now() - start).as_secs_f64(),
            bytes: after.bytes_received - before.bytes_received,
            bad_bytes: after.bad_bytes - before.bad_bytes,
            statuses: after.statuses - before.statuses,
            status,
            confirmed: None,
            other_baud: None,
            absent: Vec::new(),
            reactions: None,
        })
    }
}

/// Returns the findings of a diagnosis, the worst first.
pub fn findings(seen: &Observation) -> Vec<Finding> {
    let mut all = Findings::default();
    link(seen, &mut all);
    if let Some(status) = &seen.status {
        absent(status, &seen.absent, &mut all);
        let cause = cause(status, seen.reactions.as_ref());
        held(status, cause, seen.reactions.as_ref(), &mut all);
        errors(status, cause.is_some(), &mut all);
        set_up(status, &mut all);
        temperatures(status, &mut all);
    }
    all.worst_first()
}

fn link(seen: &Observation, all: &mut Findings) {
    use Severity::{Problem, Warning};
    let baud = seen.baud.map_or_else(|| "this rate".to_owned(), |b| format!("{b} Bd"));
    if seen.bytes == 0 {
        all.add(
            Problem,
            format!("no byte received in {:.1} s", seen.time_s),
            "the controller is off, the port is wrong, or the receive wire is open",
            "check power and cable, then run `jtc ports`",
        );
        return;
    }
    if seen.statuses == 0 {
        match seen.other_baud {
            Some(rate) => all.add(
                Problem,
                format!("{} bytes received at {baud}, but they contain no frame", seen.bytes),
                format!("the controller sends at {rate} Bd"),
                format!("use `--baud {rate}`"),
            ),
            None => all.add(
                Problem,
                format!("{} bytes received at {baud}, but they contain no frame", seen.bytes),
                "wrong rate, or another device at this port",
                next!("try {} with the rate of the controller (115200 Bd after a start)", DoctorAtRate),
            ),
        }
        return;
    }
    let bad = seen.bad_bytes as f64 / seen.bytes as f64;
    // The observation can begin in the middle of a status frame. Therefore the bytes of one incomplete status frame
    // (175 bytes) are not a fault.
    if seen.bad_bytes > 175 && bad > 0.001 {
        all.add(
            Warning,
            format!("{:.1} % of the received bytes are not part of a frame", bad * 100.0),
            "a bad cable, no common ground, or a rate that is slightly wrong",
            "use another cable or a lower rate",
        );
    }
    let rate = seen.statuses as f64 / seen.time_s.max(1e-3);
    if rate < 15.0 && seen.time_s >= 0.5 {
        all.add(
            Warning,
            format!("only {rate:.0} statuses per second, expected 25"),
            "the line loses bytes, or this computer is busy",
            next!("{} shows the link", Monitor),
        );
    } else {
        all.good(format!("link: {rate:.0} statuses per second at {baud}"));
    }
    if seen.confirmed == Some(false) {
        all.add(
            Problem,
            "the controller sends statuses, but does not answer requests",
            "the transmit wire to the controller is open, or another program sends at the same time",
            "check the transmit wire; `fuser -v PORT` lists the programs that use the port",
        );
    }
}

/// Finds drives that answer although the user has marked their joint as absent. The status frame does not have an error bit for this fault
/// (J-53).
fn absent(s: &Status, joints: &[Joint], all: &mut Findings) {
    for joint in joints {
        let state = s.joints[joint.index()].state;
        if state == NodeState::START {
            let what = format!("{joint} is marked as absent");
            all.add(
                Severity::Warning,
                what,
                "the controller refuses motions and teaching",
                next!("{} marks all joints as present; the torque must be off", BenchPresent),
            );
        } else {
            all.add(
                Severity::Problem,
                format!("{joint} is marked as absent, but its drive answers ({})", state.name()),
                "the joint is present, or another drive has its node number",
                next!("{}, then {}; or disconnect the drive from the bus", BenchPresent, Recover),
            );
        }
    }
}

/// Adds findings about a held stop and its cause, and about joints whose encoder position has jumped.
fn held(s: &Status, cause: Option<(&StopCause, u32)>, reactions: Option<&Reactions>, all: &mut Findings) {
    if let Some((cause, ago_ms)) = cause {
        all.add(
            Severity::Problem,
            format!("held stop: {}", HeldStop::new(cause, ago_ms).line()),
            held_stop::usual_cause(cause.kind),
            held_stop::next_step(s, Some(cause)),
        );
    }
    // The finding about the cause of the held stop already names the joint `said`. Therefore no second finding
    // reports the encoder jump of this joint.
    let said = cause.filter(|(cause, _)| cause.kind == StopKind::EncoderJump);
    let said = said.and_then(|(cause, _)| held_stop::joint(cause));
    let jumped = held_stop::joints(reactions.map_or(0, |reactions| reactions.jumped));
    for joint in jumped.into_iter().filter(|joint| Some(*joint) != said) {
        all.add(
            Severity::Problem,
            format!("{joint}: the encoder has jumped"),
            "the controller executes no trajectory until the drive is reset",
            held_stop::after_encoder_jump(),
        );
    }
}

/// Returns the cause of the current held stop and the age of this cause, ms.
fn cause<'a>(s: &Status, reactions: Option<&'a Reactions>) -> Option<(&'a StopCause, u32)> {
    let (cause, ago_ms) = reactions?.stop.as_ref()?;
    s.is_held_stop().then_some((cause, *ago_ms))
}

/// Finds errors in the status. `told` is `true` if another finding already contains the cause of a held stop. This
/// cause is more precise than the error bits of the joints, so the function then ignores these bits.
fn errors(s: &Status, told: bool, all: &mut Findings) {
    use Severity::{Problem, Warning};
    if s.errors & error::EMERGENCY_INPUT != 0 {
        all.add(
            Problem,
            "the safety input is low",
            "the emergency stop is pressed, or its wire is broken (the input has a pull-down)",
            next!("make the cell safe, release the emergency stop, then {}", Recover),
        );
    }
    for flag in labels::can_flags(s.can_current) {
        all.add(
            Problem,
            format!("joint bus: {flag}"),
            "supply or cable of this node",
            next!("restore the connection, then {}", Recover),
        );
    }
    for (j, joint) in s.joints.iter().enumerate() {
        let who = labels::node(j);
        for word in labels::joint_errors(joint.internal) {
            let what = format!("{who}: {word}");
            if told {
                continue;
            }
            if s.is_held_stop() {
                let why = "held stop: the arm met an obstacle, or its model lacks a load";
                all.add(Problem, what, why, next!("remove the cause or set the payload, then {}", Clear));
            } else {
                all.add(Problem, what, "", next!("correct the trajectory or the model, then {}", Recover));
            }
        }
        for word in
            labels::node_errors(joint.errors).into_iter().chain(labels::motor_faults(joint.mc_current))
        {
            all.add(
                Problem,
                format!("{who}: {word}"),
                "reported by the drive",
                next!("{}, then {}", Explain, Recover),
            );
        }
        for word in labels::node_warnings(joint.warnings) {
            let severity = if joint.warnings & warning::SAFETY_LINE != 0 { Problem } else { Warning };
            all.add(severity, format!("{who}: {word}"), "reported by the drive", Action::Explain);
        }
        if joint.state.is_fault() {
            all.add(Problem, format!("{who}: drive in its fault state"), "", Action::Recover);
        }
    }
    if s.state == ControllerState::Error && !all.has_problem() {
        all.add(
            Problem,
            "an error is latched, but its cause has ended",
            labels::errors_line(s),
            Action::Recover,
        );
    }
}

fn set_up(s: &Status, all: &mut Findings) {
    use Severity::{Problem, Warning};
    let missing = labels::missing_parameters(s.jtc_init);
    if !missing.is_empty() {
        all.add(
            Problem,
            format!("parameters not given yet: {}", missing.join(", ")),
            "the controller waits for these parameters in Init",
            next!("{}, or {} for the arm that is built into the controller", ParamsPush, UseDefaults),
        );
    }
    for n in labels::nodes_in(s.node_init) {
        let (state, warnings) = match (s.joints.get(n), s.gripper) {
            (Some(j), _) => (j.state, j.warnings),
            (None, Some(g)) => (g.state, g.warnings),
            (None, None) => (NodeState::START, 0),
        };
        let why = match (state, warnings & warning::POSITION_NOT_ACCURATE != 0) {
            _ if labels::is_silent(s, n) => "the node does not answer",
            (NodeState::START, _) => "the node has not answered yet, or is starting",
            (_, true) => "the position of the node is not accurate yet",
            (NodeState::INIT, _) => "the node has not accepted its configuration yet",
            (state, _) if state.is_fault() => "the node is in its fault state",
            (state, _) if state.is_transition() => {
                "the node is changing its state (the first enable takes 4 s)"
            }
            _ => "the controller is bringing up the node",
        };
        let what = format!("{} is not ready ({})", labels::node(n), state.name());
        all.add(
            if s.is_coming_up() { Problem } else { Warning },
            what,
            why,
            next!("wait 10 s, then {}", Recover),
        );
    }
    if s.errors == 0 && s.jtc_init == 0 && s.node_init == 0 {
        let line = format!("controller: {}, trajectory {}", s.state.name(), s.trajectory.name());
        all.good(line);
    }
}

/// Bearing temperature above which a warning is added, °C. Higher temperatures change the friction and shorten the
/// service life.
const HOT: u8 = 70;

fn temperatures(s: &Status, all: &mut Findings) {
    for (j, joint) in s.joints.iter().enumerate() {
        // A temperature byte of 200 or more is a negative temperature.
        if (HOT..200).contains(&joint.temperature) {
            let what = format!("{}: bearing at {} °C", labels::node(j), joint.temperature);
            all.add(
                Severity::Warning,
                what,
                "long motion at high torque",
                next!("let the joint cool; {} shows its temperature", Monitor),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use jtc_wire::TrajectoryState;

    use super::*;

    fn seen(status: Status) -> Observation {
        let confirmed = Some(true);
        Observation {
            baud: Some(115_200),
            time_s: 1.0,
            bytes: 4375,
            statuses: 25,
            status: Some(status),
            confirmed,
            ..Default::default()
        }
    }

    fn text(o: &Observation) -> String {
        findings(o).iter().map(|f| format!("{:?} {f}\n", f.severity)).collect()
    }

    #[test]
    fn silence_and_a_wrong_rate_are_told_apart() {
        let silent = Observation { time_s: 2.0, ..Default::default() };
        assert!(text(&silent).contains("no byte received"));
        let noise = Observation { bytes: 500, bad_bytes: 500, baud: Some(9_600), ..silent };
        assert!(text(&noise).contains("wrong rate"));
        let found = Observation { other_baud: Some(921_600), ..noise };
        assert!(text(&found).contains("--baud 921600"));
    }

    #[test]
    fn what_is_missing_is_named() {
        let mut status = Status {
            state: ControllerState::Init.into(),
            jtc_init: 0b101,
            node_init: 0b10,
            ..Default::default()
        };
        status.joints[1].state = NodeState::READY_TO_ENABLED;
        let t = text(&seen(status));
        assert!(
            t.contains("friction, arm model") && t.contains("joint 2 is not ready") && t.contains("4 s"),
            "{t}"
        );
    }

    /// Each kind of held stop has its own advice.
    #[test]
    fn j69_a_held_stop_is_found_with_its_cause_and_what_to_do() {
        let mut status = Status {
            state: ControllerState::HoldPos.into(),
            errors: error::INTERNAL_JOINTS,
            ..Default::default()
        };
        status.joints[1].internal = jtc_wire::joint_error::TORQUE;
        let find = |kind, jumped| {
            let stop = Some((StopCause { kind, joint: 2, value: 61.5, limit: 54.0 }, 12_000));
            let reactions = Some(Reactions { stop, jumped, ..Reactions::default() });
            text(&Observation { reactions, ..seen(status) })
        };
        for (kind, helps) in [
            (StopKind::Push, "remove what pushes"),
            (StopKind::Overload, "set the payload"),
            (StopKind::Unstable, "gains"),
            (StopKind::EncoderJump, "`jtc reset --joints JOINT`"),
            (StopKind::SpeedScale, "velocity_full_scale_rad_s"),
            (StopKind::Approach, "nearer"),
        ] {
            let t = find(kind, 0);
            assert!(t.contains("held stop: ") && t.contains("12 s ago") && t.contains(helps), "{t}");
            assert!(!t.contains("torque over limit"), "the cause says more: {t}");
        }
        assert!(find(StopKind::EncoderJump, 0b100).contains("joint 3: the encoder has jumped"));
        let untold = text(&seen(status));
        assert!(untold.contains("joint 2: torque over limit") && untold.contains("`jtc clear`"), "{untold}");
    }

    #[test]
    fn problems_come_first_and_a_good_controller_has_none() {
        let good = seen(Status {
            state: ControllerState::HoldPos.into(),
            trajectory: TrajectoryState::Stop.into(),
            ..Default::default()
        });
        assert!(findings(&good).iter().all(|f| f.severity == Severity::Good), "{}", text(&good));
        let mut status = Status {
            state: ControllerState::Error.into(),
            errors: 0x29,
            can_current: 1 << 12,
            ..Default::default()
        };
        status.joints[3].temperature = 80;
        let all = findings(&seen(status));
        assert!(all.is_sorted_by_key(|f| f.severity));
        let t = text(&seen(status));
        assert!(
            t.contains("safety input") && t.contains("joint 5 does not answer") && t.contains("80 °C"),
            "{t}"
        );
    }
}
