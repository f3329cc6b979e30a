//! One millisecond of the simulation, for programs that check each of them.
use jtc_bus::Frame;
use jtc_core::{Config, Telemetry};

use crate::board::Worked;
use crate::plant::Truth;

/// Millisecond of the simulation: what the controller did, and the true state of the arm.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// Time since the start, µs.
    pub time_us: u64,
    /// `true` if the controller had its tick.
    pub ticked: bool,
    /// Telemetry of the tick.
    pub telemetry: &'a Telemetry,
    /// True state of the arm.
    pub truth: &'a Truth,
    /// Frame that the controller sent.
    pub sent: Option<&'a Frame>,
    /// Host frames that it executed.
    pub worked: &'a [Worked],
    /// Level of its safety output.
    pub safety_output: bool,
    /// Settings of the controller, for the limits.
    pub config: &'a Config,
}
