//! Sessions with a simulated controller.
use std::time::Duration;

use jtc_host::Session;
use jtc_host::port::sim::SimPort;
use jtc_host::session::{Flow, UploadOptions};
use jtc_sim::{SimConfig, World};
use jtc_wire::RawPoint;

/// Everything of a session may fail.
pub type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// A controller in HoldPos with its default parameters.
pub fn holding(config: SimConfig) -> Result<Session<SimPort>> {
    let mut session = Session::new(SimPort::new(World::new(config)));
    session.use_defaults()?;
    session.wait_hold(Duration::from_secs(30))?;
    Ok(session)
}

/// `points` uploaded and started.
pub fn executing(config: SimConfig, points: &[RawPoint], step_ms: u16) -> Result<Session<SimPort>> {
    let mut session = holding(config)?;
    session.upload(points, step_ms, &UploadOptions::default(), |_| Flow::Continue)?;
    session.execute()?;
    Ok(session)
}
