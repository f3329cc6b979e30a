//! A node without physics.
use jtc_bus::{JointReport, NodeState};

/// A node with its state machine, as seen on the bus.
#[derive(Clone, Copy, Debug, Default)]
pub struct Node {
    pub report: JointReport,
    /// Does not answer.
    pub silent: bool,
    /// Added to the position that it reports, rad.
    pub glitch: f64,
    /// Takes its configuration in Init only.
    pub refuses_when_ready: bool,
    /// Does not leave ReadyToOperate.
    pub stays_ready: bool,
    /// Does not leave OperationEnable.
    pub stays_enabled: bool,
    /// Refuses to be enabled: stays in the transition.
    pub slow_enable: bool,
    pub configured: bool,
    pub resets: u32,
    /// Ticks until it answers again after a reset.
    pub booting: u32,
}

impl Node {
    pub fn new() -> Self {
        Self { report: JointReport { temperature: 25, ..JointReport::default() }, ..Self::default() }
    }

    pub fn restart(&mut self) {
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

    pub fn fault(&mut self) {
        self.report.state = NodeState::FAULT;
        self.report.errors = 2;
        self.report.mc_current = 4;
        self.report.mc_occurred = 4;
    }
}
