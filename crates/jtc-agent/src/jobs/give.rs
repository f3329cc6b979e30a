//! The whole arm for a controller, as a job.
use jtc_host::session::PushReport;
use jtc_host::{Arm, Session};

use super::{Done, Happening, Task};
use crate::api::ErrorObject;
use crate::owner::ClientPort;

/// What a controller was given of an arm.
#[derive(Clone, Debug, Default)]
pub struct Given {
    /// Friction, gains and model, as far as they were confirmed.
    pub parts: Vec<PushReport>,
    /// Hash of the arm, where all of it was read back and does not differ.
    pub hash: Option<u64>,
    /// Its number in the memory that lasts.
    pub stored: Option<u32>,
}

/// Gives the controller the whole arm, reads it back and compares; `store`: has it kept over a loss of power.
pub fn give(
    task: &Task<'_>,
    session: &mut Session<ClientPort>,
    arm: &Arm,
    store: bool,
) -> (Done, Option<ErrorObject>) {
    for warning in &arm.warnings {
        task.note(warning.to_string());
    }
    let mut given = Given::default();
    let each = |report: &PushReport| {
        let PushReport { parameter, bytes, time_s, .. } = *report;
        let parameter = parameter.name().to_owned();
        task.journal.write(Happening::Given { job: task.job, parameter, bytes, time_s });
        given.parts.push(*report);
    };
    let done = if store {
        session.push_and_store_arm(arm, each).map(|(_, number)| Some(number))
    } else {
        session.push_arm(arm, each).map(|_| None)
    };
    let error = match done {
        Ok(stored) => {
            (given.stored, given.hash) = (stored, arm.hash().ok().flatten());
            None
        }
        Err(error) => Some(ErrorObject::of(&error)),
    };
    (Done { finished: error.is_none(), given: Some(given), ..Done::default() }, error)
}
