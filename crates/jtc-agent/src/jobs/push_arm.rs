//! Job that sends a complete arm to the controller.
use agent_kit::api::Problem;
use jtc_host::session::{ArmPart, PushReport};
use jtc_host::{Arm, Error, LinkError, Session};

use super::task::STOPPED;
use super::{ArmEvent, Done, Task};
use crate::owner::ClientPort;

/// Arm parameters that the agent has sent to the controller.
#[derive(Clone, Debug, Default)]
pub struct Given {
    /// Number of controller settings that have changed.
    pub settings: usize,
    /// `true` if the controller has confirmed the name of the arm.
    pub named: bool,
    /// Reports of the parameters (friction, gains, model) that the controller has confirmed.
    pub parts: Vec<PushReport>,
    /// Hash of the arm; `None` if not all parameters were read back without a difference.
    pub hash: Option<u64>,
    /// Number of the arm in the controller's non-volatile memory.
    pub stored: Option<u32>,
}

impl Given {
    /// Returns a text about an arm that was sent incompletely. The text lists the parts of the arm that the
    /// controller already uses.
    fn in_use(&self) -> Option<String> {
        let mut parts = Vec::new();
        match self.settings {
            0 => {}
            1 => parts.push("one setting".to_owned()),
            n => parts.push(format!("{n} settings")),
        }
        if self.named {
            parts.push("its name".to_owned());
        }
        parts.extend(self.parts.iter().map(|part| part.parameter.name().to_owned()));
        (!parts.is_empty()).then(|| parts.join(", "))
    }
}

/// Sends the complete arm to the controller, then reads the arm back and compares it. If `store` is `true`, the
/// controller also stores the arm in non-volatile memory. The job ends if a client stops or pauses the arm, because a
/// controller with a complete arm enables torque.
pub fn give(
    task: &Task<'_>,
    session: &mut Session<ClientPort>,
    arm: &Arm,
    store: bool,
) -> (Done, Option<Problem>) {
    for warning in &arm.warnings {
        task.note(warning.to_string());
    }
    let mut given = Given::default();
    let each = |part: ArmPart<'_>| match part {
        ArmPart::Settings(count) => given.settings = count,
        ArmPart::Name => given.named = true,
        ArmPart::Parameter(report) => {
            let PushReport { parameter, bytes, time_s, .. } = *report;
            let parameter = parameter.name().to_owned();
            task.journal.write(ArmEvent::Given { job: task.job, parameter, bytes, time_s });
            given.parts.push(*report);
        }
    };
    let halted = || task.is_halted();
    let done = if store {
        session.push_and_store_arm_until(arm, halted, each).map(|(_, number)| Some(number))
    } else {
        session.push_arm_until(arm, halted, each).map(|_| None)
    };
    let error = match done {
        Ok(stored) => {
            (given.stored, given.hash) = (stored, arm.hash().ok().flatten());
            None
        }
        Err(error) => Some(not_given(task, &error, &given)),
    };
    (Done { finished: error.is_none(), given: Some(given), ..Done::default() }, error)
}

/// Returns the reason why the controller does not have the complete arm. The reason includes the parts of the arm
/// that the controller already uses.
fn not_given(task: &Task<'_>, error: &Error, given: &Given) -> Problem {
    let halted = match error {
        Error::Cancelled => true,
        Error::Link(LinkError::Denied { .. }) => task.is_halted(),
        _ => false,
    };
    let object = if halted {
        let by = task.halted_by();
        let message =
            format!("{by} stopped or paused the arm before the controller had the complete arm data");
        Problem::new(STOPPED, message, "send the arm data again when the arm may have torque")
    } else {
        Problem::of(error)
    };
    match given.in_use() {
        Some(parts) => {
            let message = format!("{}; the controller already uses: {parts}", object.message);
            object.message(message).next("send the complete arm data again, or the previous arm")
        }
        None => object,
    }
}
