//! Input of the checker.
use jtc_bus::Frame;
use jtc_core::{Config, Telemetry};

use crate::board::Worked;
use crate::plant::Truth;

/// A millisecond as the checker sees it.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// µs since the start.
    pub time_us: u64,
    /// The controller had its tick.
    pub ticked: bool,
    /// Telemetry of the tick.
    pub telemetry: &'a Telemetry,
    /// True state of the arm.
    pub truth: &'a Truth,
    /// The frame that it gave out.
    pub sent: Option<&'a Frame>,
    /// The host frames that it executed.
    pub worked: &'a [Worked],
    /// Level of its safety output.
    pub safety_output: bool,
    /// Settings of the controller: the limits.
    pub config: &'a Config,
}
