//! Job that returns the controller to position hold.
use agent_kit::api::Problem;
use jtc_host::session::RecoverParameters;
use jtc_host::{Error, Session};

use super::{Done, Task};
use crate::owner::ClientPort;

/// Returns the controller from any state to position hold.
pub fn recover(
    task: &Task<'_>,
    session: &mut Session<ClientPort>,
    parameters: &RecoverParameters,
) -> (Done, Option<Problem>) {
    let recovered = session.recover_with(parameters, || task.is_halted(), |step| task.note(step.to_string()));
    let error = recovered.err().map(|error| match error {
        Error::Cancelled => task.stopped(),
        error => Problem::of(&error),
    });
    (Done { finished: error.is_none(), ..Done::default() }, error)
}
