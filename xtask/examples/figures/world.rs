//! Sessions with a simulated controller.
use std::time::Duration;

use jtc_host::Session;
use jtc_host::port::sim::SimPort;
use jtc_sim::{Operator, SimConfig, World, host};
use jtc_wire::{ExecCommand, RawPoint};

/// Everything of a session may fail.
pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// A controller in HoldPos with its default parameters.
pub fn holding(config: SimConfig) -> Result<Session<SimPort>> {
    let mut session = Session::new(SimPort::new(World::new(config)));
    session.use_defaults()?;
    session.wait_hold(Duration::from_secs(30))?;
    Ok(session)
}

/// `points` uploaded and started, by the simulator's own operator: a library session takes only what passes its check, and a path
/// whose points have no velocities is here to be measured.
pub fn executing(config: SimConfig, points: &[RawPoint], step_ms: u16) -> Result<Session<SimPort>> {
    let mut operator = Operator::new(config);
    operator.bring_up()?;
    operator.upload(points, step_ms)?;
    operator.ask(&host::exec(ExecCommand::Execute))?;
    Ok(Session::new(SimPort::new(operator.world)))
}
