//! The way back to a held arm, as a job.
use agent_kit::api::Problem;
use jtc_host::session::ParameterSource;
use jtc_host::{Arm, Error, Session};

use super::{Done, Task};
use crate::owner::ClientPort;

/// Whose friction, gains and model a controller is given that misses some.
pub enum Numbers {
    /// Nobody's.
    None,
    /// Its own defaults.
    Defaults,
    /// Those of an arm, which is whole; true: where the controller uses other limits these are safe for it.
    Arm(Box<Arm>, bool),
}

/// Leads the controller back to a held arm, whatever its state is.
pub fn recover(
    task: &Task<'_>,
    session: &mut Session<ClientPort>,
    numbers: &Numbers,
) -> (Done, Option<Problem>) {
    let error = go(task, session, numbers).err();
    (Done { finished: error.is_none(), ..Done::default() }, error)
}

fn go(task: &Task<'_>, session: &mut Session<ClientPort>, numbers: &Numbers) -> Result<(), Problem> {
    let set = match numbers {
        Numbers::Arm(arm, accepted) => {
            accept(task, session, arm, *accepted)?;
            Some(arm.parameter_set())
        }
        Numbers::None | Numbers::Defaults => None,
    };
    let source = match (numbers, &set) {
        (Numbers::Arm(arm, _), Some(set)) => ParameterSource::Arm { name: &arm.name, set },
        (Numbers::Defaults, _) => ParameterSource::ControllerDefaults,
        _ => ParameterSource::None,
    };
    let recovered = session.recover_until(source, || task.is_halted(), |step| task.note(step.to_string()));
    match recovered {
        Ok(_) => Ok(()),
        Err(Error::Cancelled) => Err(task.stopped()),
        Err(error) => Err(Problem::of(&error)),
    }
}

/// What of the arm no frame carries, and the controller uses otherwise, has to be accepted.
fn accept(
    task: &Task<'_>,
    session: &mut Session<ClientPort>,
    arm: &Arm,
    accepted: bool,
) -> Result<(), Problem> {
    let device = session.device_config().map_err(|error| Problem::of(&error))?;
    let differences = arm.device_differences(&device);
    let Some(first) = differences.first() else { return Ok(()) };
    if accepted {
        differences.iter().for_each(|difference| task.note(format!("warning: {difference}")));
        return Ok(());
    }
    let message = format!(
        "{}: {} values of this arm cannot be given to the controller, which uses its own, as {first}; nothing was sent",
        arm.name,
        differences.len()
    );
    let next = "PUT /api/arm gives the whole arm; where the controller's values are safe for it, ask with accept_device_limits: true";
    Err(Problem::new("device-limits", message, next))
}
