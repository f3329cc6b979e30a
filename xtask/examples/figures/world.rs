//! Sessions with a simulated controller.
use std::time::Duration;

use jtc_host::Session;
use jtc_host::port::sim::SimPort;
use jtc_sim::{Operator, SimConfig, World, host};
use jtc_wire::{ExecCommand, RawPoint};

/// Result type for errors of any type.
pub(crate) type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Returns a session with a controller in HoldPos that uses its default parameters.
pub(crate) fn holding(config: SimConfig) -> Result<Session<SimPort>> {
    let mut session = Session::new(SimPort::new(World::new(config)));
    session.use_defaults()?;
    session.wait_hold(Duration::from_secs(30))?;
    Ok(session)
}

/// Uploads and starts `points` with the simulated host of the simulator. The library's session cannot be used for all measurements,
/// because it does not upload points without velocities, which fail its check.
pub(crate) fn executing(config: SimConfig, points: &[RawPoint], step_ms: u16) -> Result<Session<SimPort>> {
    let mut operator = Operator::new(config);
    operator.bring_up()?;
    operator.upload(points, step_ms)?;
    operator.ask(&host::exec(ExecCommand::Execute))?;
    Ok(Session::new(SimPort::new(operator.world)))
}
