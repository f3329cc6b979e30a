//! Simulated node without physics.
use jtc_bus::{JointReport, NodeState};

/// Simulated node with the state machine that is visible on the bus.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Node {
    pub report: JointReport,
    /// `true` if the node does not answer.
    pub silent: bool,
    /// Error of the reported position, rad.
    pub glitch: f64,
    /// `true` if the node accepts its configuration only in Init.
    pub refuses_when_ready: bool,
    /// `true` if the node does not leave ReadyToOperate.
    pub stays_ready: bool,
    /// `true` if the node does not leave OperationEnable.
    pub stays_enabled: bool,
    /// `true` if the node does not become enabled, because it stays in the transition.
    pub slow_enable: bool,
    pub configured: bool,
    pub resets: u32,
    /// Ticks until the node answers again after a reset.
    pub booting: u32,
}

impl Node {
    pub(crate) fn new() -> Self {
        Self { report: JointReport { temperature: 25, ..JointReport::default() }, ..Self::default() }
    }

    pub(crate) fn restart(&mut self) {
        self.resets += 1;
        self.booting = 50;
        self.configured = false;
        self.report = JointReport {
            state: NodeState::INIT,
            temperature: 25,
            position: self.report.position,
            ..JointReport::default()
        };
    }

    pub(crate) fn fault(&mut self) {
        self.report.state = NodeState::FAULT;
        self.report.errors = 2;
        self.report.mc_current = 4;
        self.report.mc_occurred = 4;
    }
}
