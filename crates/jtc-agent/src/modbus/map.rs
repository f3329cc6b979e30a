//! Register map of the Modbus server. The server and its documentation page use the same tables of registers.
use std::time::Duration;

use jtc_host::held_stop;
use jtc_host::labels;
use jtc_host::sample::is_measured;
use jtc_wire::{ControllerState, JOINTS, Status, StopCause, TrajectoryState};

use super::codes::{Outcome, error_number};
use super::pdu::Exception;
use crate::jobs::{Job, NUMBER_MAX, Stage};

/// Version of the register map. The version increases if the meaning of an address changes, but not if registers are
/// added at the end.
pub const VERSION: u16 = 1;
/// Register value that means "not known".
pub const UNKNOWN: u16 = u16::MAX;
const UNKNOWN_LONG: u32 = u32::MAX;
/// Age of the last status after which the controller is reported as disconnected.
pub const FRESH: Duration = Duration::from_secs(1);
/// Interval at which the heartbeat counter increases.
const HEARTBEAT: Duration = Duration::from_millis(100);

/// Lease holder from the point of view of one PLC connection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u16)]
pub enum Holder {
    /// No client holds the lease.
    #[default]
    Nobody = 0,
    /// The PLC of this connection holds the lease.
    Own = 1,
    /// Another client holds the lease.
    Other = 2,
}

/// Values that a PLC connection can read.
#[derive(Clone, Debug, Default)]
pub struct View {
    /// Present time by the agent's clock.
    pub now: Duration,
    /// `true` if the controller is simulated: no real arm moves.
    pub simulated: bool,
    /// `true` if the serial port was lost.
    pub lost: bool,
    /// Age of the last status, and the contents of this status.
    pub status: Option<(Duration, Status)>,
    /// Cause of the current held stop, and the age of this stop in ms.
    pub stop: Option<(StopCause, u32)>,
    /// Joints with an encoder jump, one bit per joint.
    pub jumped: u8,
    /// Speed override, %.
    pub speed: Option<u16>,
    /// Lease holder from the point of view of this PLC connection.
    pub holder: Holder,
    /// `true` if another client waits for the lease that the PLC holds.
    pub wanted: bool,
    /// Last job that a PLC began.
    pub job: Option<Job>,
    /// Sequence number of the last acknowledged command.
    pub acknowledged: u16,
    /// Outcome of the last acknowledged command.
    pub outcome: Outcome,
    /// Error number of the last acknowledged command.
    pub error: u16,
}

impl View {
    fn status<T>(&self, unknown: T, read: impl FnOnce(&Status) -> T) -> T {
        self.status.as_ref().map_or(unknown, |(_, status)| read(status))
    }

    fn joint(&self, n: usize, read: impl FnOnce(&jtc_wire::JointStatus) -> u32) -> u32 {
        self.status(u32::from(UNKNOWN), |status| status.joints.get(n).map_or(u32::from(UNKNOWN), read))
    }

    /// Returns the bits of a measured value of a joint; NaN if the value is not known.
    fn measured(&self, n: usize, read: impl FnOnce(&jtc_wire::JointStatus) -> f32) -> u32 {
        let known = |status: &Status| {
            let joint = status.joints.get(n).filter(|_| is_measured(status, n));
            joint.map_or(f32::NAN, read)
        };
        self.status(f32::NAN, known).to_bits()
    }

    /// Returns the number that `read` takes from the cause of the current held stop. Returns 0 if no held stop is
    /// active, or if its cause is not known.
    fn stop(&self, read: impl FnOnce(&StopCause) -> u32) -> u32 {
        self.stop.as_ref().map_or(0, |(cause, _)| read(cause))
    }

    /// Returns the bits of the value or limit that `read` selects from the cause of a held stop. Returns NaN if the
    /// cause is not known, or has no value or limit.
    fn figure(&self, read: impl FnOnce((Option<f32>, Option<f32>)) -> Option<f32>) -> u32 {
        let known = self.stop.as_ref().and_then(|(cause, _)| read(held_stop::figures(cause)));
        known.unwrap_or(f32::NAN).to_bits()
    }

    /// Returns the number that `read` takes from the last job; 0 before the first job.
    fn job(&self, read: impl FnOnce(&Job) -> u32) -> u32 {
        self.job.as_ref().map_or(0, read)
    }

    /// Returns `true` if the last status is recent.
    pub fn is_fresh(&self) -> bool {
        !self.lost && self.status.as_ref().is_some_and(|(age, _)| *age <= FRESH)
    }

    /// Returns `true` if the last status is recent and fulfils a condition.
    fn reports(&self, what: impl FnOnce(&Status) -> bool) -> bool {
        self.is_fresh() && self.status(false, what)
    }

    /// Returns `true` if a motion can begin: the arm is in position hold, without errors and without a motion.
    pub fn is_ready(&self) -> bool {
        self.reports(|s| {
            s.state == ControllerState::HoldPos && s.errors == 0 && labels::is_held(s) && !s.is_executing()
        })
    }

    /// Returns `true` if a motion is paused.
    pub fn is_paused(&self) -> bool {
        self.reports(|s| s.trajectory == TrajectoryState::Pause)
    }
}

/// Format of a value in Modbus registers. In a value of two registers, the first register contains the upper 16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Single register, unsigned.
    U16,
    /// Two registers, unsigned.
    U32,
    /// Two registers with a 32-bit number (IEEE 754).
    F32,
}

impl Form {
    /// Returns the number of registers of a value.
    pub fn words(self) -> u16 {
        if self == Self::U16 { 1 } else { 2 }
    }

    /// Returns the name of this format for the documentation.
    pub fn name(self) -> &'static str {
        match self {
            Self::U16 => "u16",
            Self::U32 => "u32",
            Self::F32 => "f32",
        }
    }
}

/// Group of input registers that have the same meaning.
pub struct Input {
    /// Address of the first register, from 0.
    pub at: u16,
    /// Number of values in the group: one, or one per joint.
    pub count: u16,
    /// Format of each value in the group.
    pub form: Form,
    /// Name of the values in the group.
    pub name: &'static str,
    /// Meaning of the values in the group.
    pub meaning: &'static str,
    /// Function that returns the n-th value of the group.
    pub value: fn(&View, usize) -> u32,
}

/// Read-only bit.
pub struct DiscreteInput {
    /// Name of the bit.
    pub name: &'static str,
    /// Meaning of the bit.
    pub meaning: &'static str,
    /// Function that returns the value of the bit.
    pub value: fn(&View) -> bool,
}

/// Holding register.
pub struct Holding {
    /// Name of the register.
    pub name: &'static str,
    /// Smallest and largest valid value of the register.
    pub range: (u16, u16),
    /// Value of the register before the first write.
    pub default: u16,
    /// Meaning of the register.
    pub meaning: &'static str,
}

const fn one(
    at: u16,
    form: Form,
    name: &'static str,
    meaning: &'static str,
    value: fn(&View, usize) -> u32,
) -> Input {
    Input { at, count: 1, form, name, meaning, value }
}

const fn joints(
    at: u16,
    form: Form,
    name: &'static str,
    meaning: &'static str,
    value: fn(&View, usize) -> u32,
) -> Input {
    Input { at, count: JOINTS as u16, form, name, meaning, value }
}

/// Input registers, in the order of their addresses.
#[rustfmt::skip]
pub const INPUTS: &[Input] = &[
    one(0, Form::U16, "map_version", "version of this map", |_, _| VERSION.into()),
    one(1, Form::U16, "heartbeat", "the agent increases this counter ten times a second; after 65535 it continues at 0",
        |v, _| (v.now.as_millis() / HEARTBEAT.as_millis()) as u32 & 0xFFFF),
    one(2, Form::U16, "simulated", "1: the controller is simulated, no real arm moves", |v, _| v.simulated.into()),
    one(3, Form::U16, "port_lost", "1: the agent has lost the port of the controller; no more commands reach the controller", |v, _| v.lost.into()),
    one(4, Form::U16, "status_age_ms", "ms since the last status of the controller; 65535: more, or no status yet. The values of the controller are as old as this status",
        |v, _| v.status.map_or(UNKNOWN.into(), |(age, _)| age.as_millis().min(UNKNOWN.into()) as u32)),
    one(5, Form::U16, "state", "state of the controller: 0 Start, 1 Init, 2 HoldPos, 3 Operate, 4 Teaching, 5 Error; 65535: no status yet",
        |v, _| v.status(UNKNOWN.into(), |s| s.state.byte().into())),
    one(6, Form::U16, "trajectory_state", "state of the trajectory: 0 none, 1 at its start, 2 paused, 3 executed, 4 finished; 65535: no status yet",
        |v, _| v.status(UNKNOWN.into(), |s| s.trajectory.byte().into())),
    one(7, Form::U16, "errors", "present errors of the controller (bits: table below)", |v, _| v.status(0, |s| s.errors.into())),
    one(8, Form::U16, "errors_occurred", "errors since the last clear (same bits)", |v, _| v.status(0, |s| s.occurred.into())),
    one(9, Form::U32, "point", "present point of the trajectory; one point per ms of trajectory time", |v, _| v.status(0, |s| s.point)),
    one(11, Form::U16, "speed_override", "present speed on the path, %; 65535: not known", |v, _| v.speed.unwrap_or(UNKNOWN).into()),
    one(12, Form::U16, "lease", "lease holder: 0 none, 1 this PLC, 2 another client", |v, _| v.holder as u32),
    one(13, Form::U16, "lease_wanted", "1: another client has requested the lease of this PLC", |v, _| v.wanted.into()),
    one(14, Form::U16, "acknowledged", "`sequence` of the last command that the agent answered", |v, _| v.acknowledged.into()),
    one(15, Form::U16, "result", "result of that command (table of results)", |v, _| v.outcome as u32),
    one(16, Form::U16, "command_error", "error of that command (table of errors); 0: none", |v, _| v.error.into()),
    one(17, Form::U32, "job", "number of the last job that a PLC began (a start, a recovery); 0: no job yet", |v, _| v.job(|j| j.number as u32)),
    one(19, Form::U16, "job_stage", "state of that job: 0 no job, 1 running, 2 finished, 3 stopped, 4 failed", |v, _| v.job(|j| match j.stage {
        Stage::Running => 1, Stage::Finished => 2, Stage::Stopped => 3, Stage::Failed => 4,
    })),
    one(20, Form::U16, "job_error", "error that stopped or failed the job (table of errors); 0: none",
        |v, _| v.job(|j| j.error.as_ref().map_or(0, |e| error_number(e.code).into()))),
    one(21, Form::U16, "job_error_joint", "joint of the error, 1 to 6 from the base; 0: none",
        |v, _| v.job(|j| j.error.as_ref().and_then(|e| e.facts.joint).unwrap_or(0).into())),
    one(22, Form::U32, "job_error_point", "point of that error, as in the text of the error; 4294967295: none",
        |v, _| v.job.as_ref().and_then(|j| j.error.as_ref()).and_then(|e| e.facts.point).unwrap_or(UNKNOWN_LONG)),
    one(24, Form::U16, "job_runs", "finished runs of the job, without approaches", |v, _| v.job(|j| j.done.runs.min(u32::from(u16::MAX)))),
    one(25, Form::U16, "pump", "pump of the gripper: 0 off, 1 on; 65535: not known",
        |v, _| v.status(UNKNOWN.into(), |s| s.gripper.map_or(UNKNOWN.into(), |g| g.pump.into()))),
    joints(26, Form::F32, "position", "positions in rad, from base to wrist; NaN: not known", |v, n| v.measured(n, |j| j.position)),
    joints(38, Form::F32, "velocity", "velocities in rad/s, from base to wrist; NaN: not known", |v, n| v.measured(n, |j| j.velocity)),
    joints(50, Form::F32, "torque", "torques in N·m, from base to wrist; NaN: not known", |v, n| v.measured(n, |j| j.torque)),
    joints(62, Form::U16, "temperature", "temperatures in °C; 65535: not known",
        |v, n| v.status(UNKNOWN.into(), |s| if is_measured(s, n) { s.joints.get(n).map_or(UNKNOWN.into(), |j| j.temperature.into()) } else { UNKNOWN.into() })),
    joints(68, Form::U16, "joint_errors", "present errors of the joint (bits: table below); 65535: not known", |v, n| v.joint(n, |j| j.internal.into())),
    joints(74, Form::U16, "joint_errors_occurred", "errors of the joint since the last clear (same bits); 65535: not known", |v, n| v.joint(n, |j| j.internal_occurred.into())),
    joints(80, Form::U16, "drive_state", "state of the drive: 3 enabled, 255 fault, other values: other states and transitions; 65535: not known", |v, n| v.joint(n, |j| j.state.code().into())),
    one(86, Form::U16, "held_stop_cause", "cause of the present held stop (table of causes); 0: no held stop, or the cause is not known",
        |v, _| v.stop(|cause| u32::from(cause.kind as u8))),
    one(87, Form::U16, "held_stop_joint", "joint at which the cause was detected first, 1 to 6 from the base; 0: none", |v, _| v.stop(|cause| cause.joint.into())),
    one(88, Form::F32, "held_stop_value", "value that caused the held stop, in the unit of the table of causes; NaN: none", |v, _| v.figure(|(value, _)| value)),
    one(90, Form::F32, "held_stop_limit", "limit of that value; NaN: none", |v, _| v.figure(|(_, limit)| limit)),
    one(92, Form::U16, "held_stop_since_s", "s since the held stop began, 65534 at most; 65535: no held stop, or the time is not known",
        |v, _| v.stop.map_or(UNKNOWN.into(), |(_, ms)| (ms / 1000).min(u32::from(UNKNOWN) - 1))),
    one(93, Form::U16, "encoder_jumped", "joints whose encoder had jumped at the last held stop; joint 1 is bit 0. No trajectory starts until the drives of these joints are reset",
        |v, _| v.jumped.into()),
];

/// Discrete inputs, from address 0.
#[rustfmt::skip]
pub const DISCRETE_INPUTS: &[DiscreteInput] = &[
    DiscreteInput { name: "controller_there", meaning: "the controller has reported within the last second", value: View::is_fresh },
    DiscreteInput { name: "simulated", meaning: "the controller is simulated, no real arm moves", value: |v| v.simulated },
    DiscreteInput { name: "port_lost", meaning: "the agent has lost the port of the controller", value: |v| v.lost },
    DiscreteInput { name: "error", meaning: "the controller reports an error", value: |v| v.reports(|s| s.errors != 0 || s.state == ControllerState::Error) },
    DiscreteInput { name: "ready", meaning: "the arm is held without errors, and no motion runs", value: View::is_ready },
    DiscreteInput { name: "executing", meaning: "a trajectory is executed", value: |v| v.reports(Status::is_executing) },
    DiscreteInput { name: "paused", meaning: "a motion is paused", value: View::is_paused },
    DiscreteInput { name: "teaching", meaning: "the arm is led by hand", value: |v| v.reports(|s| s.state == ControllerState::Teaching) },
    DiscreteInput { name: "lease_own", meaning: "this PLC holds the lease", value: |v| v.holder == Holder::Own },
    DiscreteInput { name: "lease_other", meaning: "another client holds the lease", value: |v| v.holder == Holder::Other },
    DiscreteInput { name: "job_running", meaning: "the last job of a PLC is running", value: |v| v.job.as_ref().is_some_and(|j| j.stage == Stage::Running) },
    DiscreteInput { name: "job_finished", meaning: "the last job of a PLC has finished", value: |v| v.job.as_ref().is_some_and(|j| j.stage == Stage::Finished) },
    DiscreteInput { name: "pump", meaning: "the pump of the gripper is on", value: |v| v.reports(|s| s.gripper.is_some_and(|g| g.pump == 1)) },
    DiscreteInput { name: "held_stop", meaning: "the arm is in a held stop. No motion is executed until `command` 9 has cleared the held stop", value: |v| v.reports(Status::is_held_stop) },
];

/// Addresses of the holding registers, from 0.
pub mod holding {
    /// Watchdog time, ms: after this time without a request, the policy applies.
    pub const WATCHDOG: usize = 0;
    /// Policy that applies to a motion after the watchdog time.
    pub const POLICY: usize = 1;
    /// Number of the trajectory to run.
    pub const TRAJECTORY: usize = 2;
    /// Speed of a motion, %.
    pub const SPEED: usize = 3;
    /// Number of runs of the trajectory.
    pub const REPEAT: usize = 4;
    /// Selects whether the arm first moves to the first point of the trajectory.
    pub const APPROACH: usize = 5;
    /// Command of the PLC.
    pub const COMMAND: usize = 6;
    /// Sequence number of the command. Writing the sequence number triggers the command.
    pub const SEQUENCE: usize = 7;
    /// Number of holding registers.
    pub const COUNT: usize = 8;
}

/// Shortest watchdog time, ms.
pub const WATCHDOG_MIN: u16 = 100;

/// Holding registers, from address 0.
#[rustfmt::skip]
pub const HOLDINGS: [Holding; holding::COUNT] = [
    Holding { name: "watchdog_ms", range: (0, 60_000), default: 1000,
        meaning: "time without a request after which the policy applies, ms, 100 or more; 0: off (not possible while the PLC holds the lease)" },
    Holding { name: "policy", range: (0, 2), default: 1, meaning: "reaction of a motion after that time: 0 continue, 1 pause, 2 stop" },
    Holding { name: "trajectory", range: (0, NUMBER_MAX), default: 0, meaning: "number of the trajectory to start; 0: none" },
    Holding { name: "speed", range: (1, 1000), default: 100,
        meaning: "%. For a start: percentage of the trajectory's own speed. For its approach: percentage of the limits, at most 50. The value 100 is an exception: an approach then runs at 10 % of the limits, in a simulator at 25 %. For `set speed`: percentage of the speed on the path, 5 to 100" },
    Holding { name: "repeat", range: (1, u16::MAX), default: 1, meaning: "number of runs" },
    Holding { name: "approach", range: (0, 1), default: 0, meaning: "1: if the arm is elsewhere, first move it to the first point" },
    Holding { name: "command", range: (0, super::codes::COMMAND_MAX), default: 0, meaning: "command (table of commands)" },
    Holding { name: "sequence", range: (0, u16::MAX), default: 0, meaning: "sequence number. Write `acknowledged` plus one to execute the command" },
];

/// Address of the coil that stops the arm.
pub const STOP: usize = 0;
/// Address of the coil that pauses the arm.
pub const PAUSE: usize = 1;
/// Coils from address 0, with their names and meanings.
pub const COILS: [(&str, &str); 2] = [
    ("stop", "a change from 0 to 1 stops the motion on its path, at once"),
    ("pause", "a change from 0 to 1 pauses the motion on its path, at once"),
];

/// Returns the values of all input registers.
pub fn inputs(view: &View) -> Vec<u16> {
    let mut all = Vec::new();
    for row in INPUTS {
        for n in 0..usize::from(row.count) {
            let value = (row.value)(view, n);
            if row.form != Form::U16 {
                all.push((value >> 16) as u16);
            }
            all.push(value as u16);
        }
    }
    all
}

/// Returns `count` entries of a table from address `at`.
///
/// # Errors
///
/// [`Exception::Address`] if one of the entries does not exist.
pub fn span<T: Clone>(all: &[T], at: u16, count: usize) -> Result<Vec<T>, Exception> {
    let at = usize::from(at);
    all.get(at..at + count).map(<[T]>::to_vec).ok_or(Exception::Address)
}

#[cfg(test)]
mod tests {
    use jtc_wire::StopKind;

    use super::*;

    #[test]
    fn registers_lie_one_behind_the_other() {
        let mut next = 0;
        for row in INPUTS {
            assert_eq!(row.at, next, "{}", row.name);
            next += row.count * row.form.words();
        }
        assert_eq!(inputs(&View::default()).len(), usize::from(next));
        let mut names: Vec<_> = INPUTS.iter().map(|row| row.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), INPUTS.len(), "each has a name of its own");
        for row in &HOLDINGS {
            assert!((row.range.0..=row.range.1).contains(&row.default), "{}", row.name);
        }
    }

    /// The two registers of a 32-bit value have the order that the documentation page describes. The expected words
    /// were computed by hand: 1.5 is 3FC00000, 70000 is 00011170.
    #[test]
    fn two_registers_have_the_upper_half_first() {
        let mut status = Status { point: 70_000, ..Status::default() };
        status.joints[1].position = 1.5;
        let image = inputs(&View { status: Some((Duration::from_millis(7), status)), ..View::default() });
        assert_eq!(image[9..11], [0x0001, 0x1170]);
        assert_eq!(image[26 + 2..26 + 4], [0x3FC0, 0x0000]);
        assert_eq!(image[4], 7);
    }

    #[test]
    fn j69_a_held_stop_has_its_cause_in_registers() {
        let cause = StopCause { kind: StopKind::Push, joint: 2, value: 61.5, limit: 54.0 };
        let status = Status {
            state: ControllerState::HoldPos.into(),
            errors: jtc_wire::error::INTERNAL_JOINTS,
            ..Status::default()
        };
        let view = View {
            status: Some((Duration::ZERO, status)),
            stop: Some((cause, 12_300)),
            jumped: 0b100,
            ..View::default()
        };
        // The value 61.5 and its limit 54 are 0x42760000 and 0x42580000 as 32-bit floats, and 12,300 ms are 12 s.
        assert_eq!(inputs(&view)[86..94], [2, 2, 0x4276, 0, 0x4258, 0, 12, 0b100]);
        let bit = |view: &View| (DISCRETE_INPUTS[13].value)(view);
        assert!(bit(&view) && !view.is_ready());
        let none = View::default();
        assert_eq!(inputs(&none)[86..94], [0, 0, 0x7FC0, 0, 0x7FC0, 0, UNKNOWN, 0]);
        assert!(!bit(&none));
        let approach = StopCause { kind: StopKind::Approach, ..StopCause::default() };
        let view = View { stop: Some((approach, 0)), ..view };
        assert_eq!(inputs(&view)[86..93], [11, 0, 0x7FC0, 0, 0x7FC0, 0, 0]);
    }

    #[test]
    fn what_is_not_known_is_no_number() {
        let image = inputs(&View::default());
        assert_eq!(
            (image[4], image[5], image[6], image[11], image[62]),
            (UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN)
        );
        for joint in 0..3 * JOINTS {
            let at = 26 + 2 * joint;
            let bits = u32::from(image[at]) << 16 | u32::from(image[at + 1]);
            assert!(f32::from_bits(bits).is_nan(), "{at}");
        }
    }
}
