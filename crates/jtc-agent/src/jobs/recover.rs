//! The way back to a held arm, as a job.
use jtc_host::session::ParameterSource;
use jtc_host::{Error, Session};

use super::{Done, Task};
use crate::api::ErrorObject;
use crate::owner::ClientPort;

/// Leads the controller back to a held arm, whatever its state is. `defaults`: where it has not been given its arm it may use its own.
pub fn recover(
    task: &Task<'_>,
    session: &mut Session<ClientPort>,
    defaults: bool,
) -> (Done, Option<ErrorObject>) {
    let source = if defaults { ParameterSource::ControllerDefaults } else { ParameterSource::None };
    let recovered = session.recover_until(source, || task.is_halted(), |step| task.note(step.to_string()));
    let error = match recovered {
        Ok(_) => None,
        Err(Error::Cancelled) => Some(task.stopped()),
        Err(error) => Some(ErrorObject::of(&error)),
    };
    (Done { finished: error.is_none(), ..Done::default() }, error)
}
