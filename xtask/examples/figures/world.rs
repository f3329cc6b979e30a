//! Sessions with a simulated controller for the measurements.
use std::time::Duration;

use jtc_host::Session;
use jtc_host::port::sim::SimPort;
use jtc_sim::{Operator, SimConfig, World, host};
use jtc_wire::{ExecCommand, RawPoint};

/// Result type of functions whose errors can have any type.
pub(crate) type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Returns a session with a controller in HoldPos that uses its default parameters.
pub(crate) fn holding(config: SimConfig) -> Result<Session<SimPort>> {
    let mut session = Session::new(SimPort::new(World::new(config)));
    session.use_defaults()?;
    session.wait_hold(Duration::from_secs(30))?;
    Ok(session)
}

/// Uploads `points` with the host of the simulator and starts the motion. Some measurements use points that the check
/// of the library's session would refuse, such as points without velocities.
pub(crate) fn executing(config: SimConfig, points: &[RawPoint], step_ms: u16) -> Result<Session<SimPort>> {
    let mut operator = Operator::new(config);
    operator.bring_up()?;
    operator.upload(points, step_ms)?;
    operator.ask(&host::exec(ExecCommand::Execute))?;
    Ok(Session::new(SimPort::new(operator.world)))
}
