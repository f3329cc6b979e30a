//! State of the simulation in one millisecond, for programs that check each millisecond.
use jtc_bus::Frame;
use jtc_core::{Config, Telemetry};

use crate::board::Worked;
use crate::plant::Truth;

/// Data of one millisecond: the actions of the controller and the true state of the arm.
#[derive(Clone, Copy, Debug)]
pub struct Moment<'a> {
    /// Time since the start of the simulation, µs.
    pub time_us: u64,
    /// `true` if the controller executed its tick.
    pub ticked: bool,
    /// Telemetry of the controller's tick.
    pub telemetry: &'a Telemetry,
    /// True state of the arm.
    pub truth: &'a Truth,
    /// Frame that the controller sent on the joint bus.
    pub sent: Option<&'a Frame>,
    /// Host frames that the controller processed, including invalid frames.
    pub worked: &'a [Worked],
    /// Level of the controller's safety output.
    pub safety_output: bool,
    /// Settings of the controller, which contain the limits.
    pub config: &'a Config,
}
