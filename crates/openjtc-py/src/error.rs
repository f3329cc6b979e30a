//! Errors of the libraries as exceptions of Python, with all that they know.

use host_kit::{Diagnose, ErrorKind};
use jtc_host::error::Facts;
use jtc_host::held_stop::HeldStop;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// An error on its way to Python: what `openjtc.Error` has.
#[derive(Clone, Debug)]
pub struct Failure {
    /// What kind of failure it is, which selects the class.
    pub kind: ErrorKind,
    /// A short name for programs.
    pub code: String,
    /// What was asked for, where, value and limit.
    pub message: String,
    /// The next act that helps; empty when there is none.
    pub next: String,
    /// Where it is, and by how much.
    pub facts: Box<Facts>,
}

impl Failure {
    /// Of an error of the libraries, without facts beside its words.
    pub fn of(error: &impl Diagnose) -> Self {
        Self::with(error, Facts::default())
    }

    /// Of an error of the libraries.
    pub fn with(error: &impl Diagnose, facts: Facts) -> Self {
        let diagnosis = error.diagnosis();
        Self {
            kind: diagnosis.kind,
            code: diagnosis.code.to_owned(),
            message: error.to_string(),
            next: diagnosis.next,
            facts: Box::new(facts),
        }
    }

    /// An argument that is none.
    pub fn usage(message: impl Into<String>) -> Self {
        Self {
            kind: ErrorKind::Usage,
            code: "usage".into(),
            message: message.into(),
            next: String::new(),
            facts: Box::default(),
        }
    }

    /// What a check refuses; nothing was done.
    pub fn refused(code: &str, message: impl Into<String>, next: impl Into<String>) -> Self {
        let message = message.into();
        Self {
            kind: ErrorKind::Refused,
            code: code.into(),
            message,
            next: next.into(),
            facts: Box::default(),
        }
    }

    /// What went wrong on the way.
    pub fn fault(code: &str, message: impl Into<String>, next: impl Into<String>) -> Self {
        Self { kind: ErrorKind::Fault, ..Self::refused(code, message, next) }
    }

    /// The same with the act that helps.
    pub fn next(self, next: impl Into<String>) -> Self {
        Self { next: next.into(), ..self }
    }
}

/// Commands of `jtc`, and what does the same here: while a program has the port no command gets at it.
const COMMANDS: &[(&str, &str)] = &[
    ("jtc traj run FILE --approach", "robot.run(…, approach=True)"),
    ("jtc traj run FILE", "robot.run(…)"),
    ("jtc traj pause", "robot.pause()"),
    ("jtc traj resume", "robot.resume()"),
    ("jtc traj stop", "robot.stop()"),
    ("jtc clear", "robot.recover()"),
    ("jtc traj check", "robot.check(…)"),
    ("jtc status", "robot.status"),
    ("jtc doctor --baud RATE", "openjtc.connect(…, baud=…)"),
    ("jtc doctor", "robot.doctor()"),
    ("jtc recover --arm FILE", "robot.recover(arm=…)"),
    ("jtc recover --defaults", "robot.recover(defaults=True)"),
    ("jtc recover", "robot.recover()"),
    ("jtc arm push --store", "robot.push_arm(arm, store=True)"),
    ("jtc arm push FILE", "robot.push_arm(arm)"),
    ("jtc arm check FILE", "openjtc.Arm.load(…).findings()"),
    ("jtc payload show", "robot.payload"),
    ("jtc payload set", "robot.payload = …"),
    ("jtc payload clear", "robot.payload = None"),
    ("jtc teach off", "the end of the block `with robot.teach():`"),
    ("jtc params use-defaults", "robot.use_defaults()"),
    ("jtc disable", "robot.disable()"),
    ("jtc info", "robot.info"),
    ("jtc jog", "robot.jog(…)"),
    ("jtc log fetch", "robot.flight_log()"),
    ("--accept-device-limits", "accept_device_limits=True"),
    ("--baud", "baud="),
    ("--deg", "degrees=True"),
];

/// What helps, in terms of Python.
pub fn in_python(next: &str) -> String {
    COMMANDS.iter().fold(next.to_owned(), |text, (command, here)| {
        let here = if here.contains('`') { (*here).to_owned() } else { format!("`{here}`") };
        text.replace(&format!("`{command}`"), &here)
    })
}

impl From<jtc_host::Error> for Failure {
    fn from(error: jtc_host::Error) -> Self {
        Self::with(&error, error.facts())
    }
}

/// Errors that [`jtc_host::Error`] has a variant for.
macro_rules! through_error {
    ($($from:ty),+) => {
        $(impl From<$from> for Failure {
            fn from(error: $from) -> Self {
                jtc_host::Error::from(error).into()
            }
        })+
    };
}

through_error!(
    jtc_host::LinkError,
    jtc_host::StateError,
    jtc_host::UploadError,
    jtc_host::MotionError,
    jtc_host::ParametersError,
    jtc_host::CheckError,
    jtc_host::PortError,
    jtc_host::file::FileError
);

impl From<jtc_host::plan::PlanError> for Failure {
    fn from(error: jtc_host::plan::PlanError) -> Self {
        Self::with(&error, Facts::of_plan(&error))
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        Python::attach(|py| to_python(py, &failure).unwrap_or_else(|error| error))
    }
}

/// The exception of `openjtc.errors` for this failure.
fn to_python(py: Python<'_>, failure: &Failure) -> PyResult<PyErr> {
    let Failure { kind, code, message, next, facts } = failure;
    let kind = match kind {
        ErrorKind::Fault if code == "stopped" => "StoppedError",
        ErrorKind::Fault if code == "held-stop" => "HeldStopError",
        ErrorKind::Usage => "UsageError",
        ErrorKind::NoLink => "NoLinkError",
        ErrorKind::Refused => "RefusedError",
        ErrorKind::Device => "DeviceError",
        ErrorKind::Fault => "FaultError",
    };
    let class = py.import("openjtc.errors")?.getattr(kind)?;
    let joint = facts.joint.map(|joint| joint.number());
    let next = in_python(next);
    let arguments = (message, code, joint, facts.point, facts.value, facts.limit, facts.cause, next);
    let instance = match &facts.stop {
        Some(cause) if kind == "HeldStopError" => {
            let stop = HeldStop::new(cause, 0);
            let more = PyDict::new(py);
            more.set_item("kind", stop.kind)?;
            more.set_item("unit", stop.unit)?;
            more.set_item("text", stop.text)?;
            class.call(arguments, Some(&more))?
        }
        _ => class.call1(arguments)?,
    };
    if !instance.is_instance_of::<pyo3::exceptions::PyException>() {
        return Err(PyRuntimeError::new_err(message.clone()));
    }
    Ok(PyErr::from_value(instance))
}
