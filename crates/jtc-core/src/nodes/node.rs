//! State of a node: the last report, the progress of the bring-up, and the state that the controller requests (J-16, J-20).
use jtc_bus::{JointReport, NodeState, Target, warning};

use super::measure::Measurement;
use crate::bit_codec::bit_codec;
use crate::config::Config;

/// Number of ticks after a reset in which late answers of the node are ignored.
const DEAF_AFTER_RESET: u8 = 20;

/// State that the controller requests from the nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Goal {
    /// The nodes are configured and ready to operate (Init).
    Ready,
    /// The operation of the nodes is enabled (HoldPos, Operate, Teaching).
    Enabled,
    /// The nodes are not enabled, but otherwise unchanged (Error).
    Down,
}

/// State of one node.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Node {
    pub report: JointReport,
    /// `true` if the node has answered a Move since its start or reset.
    pub(super) seen: bool,
    /// `true` if the node has accepted its configuration.
    pub(super) configured: bool,
    /// `true` if the node has answered a Move after it accepted its configuration, so that position and velocity are valid.
    pub(super) valid: bool,
    /// `true` if the node has refused its configuration in its present state.
    pub(super) refused: bool,
    /// Number of consecutive Moves that the node has not answered.
    pub(super) silent: u8,
    /// Number of consecutive Moves without a usable answer.
    pub(super) missed: u8,
    /// Measured position and velocity, as soon as both values are valid.
    pub(super) measured: Measurement,
    /// Remaining number of ticks in which a missing answer of the node is not an error yet.
    pub(super) boot_left: u32,
    pub(super) deaf_left: u8,
    /// `true` while the controller requests Init from the node to clear its errors (J-21).
    pub(super) clear: bool,
    /// `true` if the controller must send a reset frame to the node.
    pub(super) reset: bool,
    /// `true` if the node reported OperationEnable while the controller requested this state.
    pub(super) enabled: bool,
    pub(super) enable_wait: u32,
    /// `true` if a usable answer has arrived since the last tick, so that the measurement is not a prediction.
    pub(super) fresh: bool,
    /// `true` if the joint is marked as absent (J-53).
    pub(super) absent: bool,
    /// State that the drive of an absent joint reported, although the controller ignores its answers.
    pub(super) unasked: Option<NodeState>,
    /// Number of answers since the last tick. All answers except the last one were late.
    pub(super) answers: u8,
    /// `true` if the node misbehaved in this tick: it left OperationEnable, was not enabled before the timeout, or reported implausible
    /// positions.
    pub(super) misbehaved: bool,
}

bit_codec!(Node {
    report,
    seen,
    configured,
    valid,
    refused,
    silent,
    missed,
    measured,
    boot_left,
    deaf_left,
    clear,
    reset,
    enabled,
    enable_wait,
    fresh,
    absent,
    unasked,
    answers,
    misbehaved,
});

impl Node {
    /// Returns `true` if a usable answer has arrived since the last tick.
    pub(crate) fn fresh(&self) -> bool {
        self.fresh
    }

    /// Returns [`Measurement::young_velocity`], rad/s.
    pub(crate) fn young_velocity(&self, due: f64) -> f64 {
        self.measured.young_velocity(due)
    }

    /// Returns `true` if the joint is marked as absent (J-53).
    pub(crate) fn absent(&self) -> bool {
        self.absent
    }

    /// Returns the state that the node reports. For an absent joint, the state is Start, unless the drive of the joint still reports a
    /// state.
    pub(crate) fn state(&self) -> NodeState {
        if self.absent { self.unasked.unwrap_or(NodeState::START) } else { self.report.state }
    }

    pub(crate) fn enabled(&self) -> bool {
        self.valid && self.report.state == NodeState::ENABLED
    }

    pub(crate) fn starting(&self) -> bool {
        self.report.state.is_starting()
    }

    /// Returns `true` if the node has lost its configuration, or has changed back to Start or Init (J-20).
    pub(crate) fn fallen_back(&self) -> bool {
        !self.valid || self.starting()
    }

    /// Returns `true` if the node reports an error or a safety-line warning. Other warnings do not count.
    pub(crate) fn faulty(&self) -> bool {
        // Drives also set the safety-line warning before they are configured, at any level of the safety line.
        let safety_line = self.valid && self.report.warnings & warning::SAFETY_LINE != 0;
        self.in_fault() || (self.seen && safety_line)
    }

    /// Returns `true` if the node reports a fault of the node itself.
    pub(crate) fn in_fault(&self) -> bool {
        let r = &self.report;
        self.seen && (r.state.is_fault() || (r.errors | r.mc_current) != 0)
    }

    /// Restarts the node and discards all information about the node.
    pub(crate) fn restart(&mut self, config: &Config) {
        *self = Self { boot_left: config.node_boot_ms, deaf_left: DEAF_AFTER_RESET, ..Self::default() };
    }

    /// Sets the node of an absent joint to configured, ready and silent in every tick (J-53). The controller then does not request a state
    /// from the node, and does not wait for the node. A drive of an absent joint that answers is an error, because either the drive or the
    /// setting is wrong.
    pub(crate) fn stand_in(&mut self) {
        let unasked = self.unasked;
        *self = Self {
            absent: true,
            configured: true,
            valid: true,
            deaf_left: DEAF_AFTER_RESET,
            unasked,
            misbehaved: unasked.is_some(),
            ..Self::default()
        };
        self.report.state = NodeState::READY;
    }

    /// Discards the configuration, so that the node must accept a configuration again. Until the node has accepted a configuration, its
    /// position and velocity are not valid.
    pub(crate) fn lose_configuration(&mut self) {
        (self.configured, self.valid, self.refused) = (false, false, false);
        self.measured = Measurement::default();
    }

    /// Returns the state that the controller requests from the node (J-16).
    pub(crate) fn request(&self, goal: Goal) -> Target {
        let state = self.report.state;
        if !self.seen {
            // J-53: an absent joint has no torque, even if its drive is connected.
            let powered = self.absent && self.unasked == Some(NodeState::ENABLED);
            return if powered { Target::Ready } else { Target::NoChange };
        }
        if self.clear {
            // A drive ignores a request for Init while it is enabled.
            return if state == NodeState::ENABLED { Target::Ready } else { Target::Init };
        }
        let moving = state.is_transition();
        match goal {
            Goal::Down
                if state == NodeState::ENABLED || moving || (state == NodeState::INIT && self.configured) =>
            {
                Target::Ready
            }
            Goal::Ready if state == NodeState::START => Target::Init,
            Goal::Ready if state == NodeState::READY && !self.configured && self.refused => Target::Init,
            Goal::Ready
                if state == NodeState::ENABLED
                    || ((state == NodeState::INIT || moving) && self.configured) =>
            {
                Target::Ready
            }
            Goal::Enabled if state == NodeState::READY || moving => Target::Enable,
            _ => Target::NoChange,
        }
    }

    /// Returns `true` if the node is configured and enabled, and no clear and no reset is requested. For [`Goal::Enabled`], the controller
    /// then does not request a change from the node.
    pub(crate) fn wants_nothing_enabled(&self) -> bool {
        self.seen & self.configured & !self.reset & !self.clear & (self.report.state == NodeState::ENABLED)
    }

    pub(crate) fn wants_configuration(&self) -> bool {
        self.seen
            && !self.configured
            && !self.clear
            && matches!(self.report.state, NodeState::INIT | NodeState::READY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For an enabled node, the quick check may return `true` only if the complete checks also request nothing from
    /// the node.
    #[test]
    fn j12_j16_an_enabled_node_wants_nothing() {
        for bits in 0..16u8 {
            let flag = |bit: u8| bits & 1 << bit != 0;
            for state in (0..=20).map(NodeState::new) {
                let (seen, configured, reset, clear) = (flag(0), flag(1), flag(2), flag(3));
                let mut node = Node { seen, configured, reset, clear, ..Node::default() };
                node.report.state = state;
                if node.wants_nothing_enabled() {
                    assert!(!node.reset && node.request(Goal::Enabled) == Target::NoChange, "{node:?}");
                    assert!(!node.wants_configuration());
                }
                let enabled = state == NodeState::ENABLED && bits == 3;
                assert_eq!(node.wants_nothing_enabled(), enabled, "{node:?}");
            }
        }
    }

    /// A node counts as enabled only if it reports OperationEnable and its configuration is known. A drive that was
    /// enabled before the controller started does not count, because its configuration is not known.
    #[test]
    fn j16_a_node_is_enabled_when_it_says_so_and_its_configuration_is_known() {
        for (valid, state, enabled) in [
            (true, NodeState::ENABLED, true),
            (false, NodeState::ENABLED, false),
            (true, NodeState::READY, false),
            (false, NodeState::READY, false),
        ] {
            let mut node = Node { valid, ..Node::default() };
            node.report.state = state;
            assert_eq!(node.enabled(), enabled, "{valid} {state}");
        }
    }

    /// An absent joint counts as configured and ready. Its reported state is Start, unless its drive still reports a state.
    #[test]
    fn j53_an_absent_joint_is_ready_and_shown_in_start() {
        let mut node = Node::default();
        node.report.state = NodeState::ENABLED;
        assert_eq!(node.state(), NodeState::ENABLED);
        node.stand_in();
        assert_eq!((node.state(), node.report.state), (NodeState::START, NodeState::READY));
        assert!(node.absent() && node.configured && node.valid && !node.seen && !node.misbehaved);
        assert!(!node.fallen_back() && !node.faulty() && !node.wants_configuration());
        node.unasked = Some(NodeState::INIT);
        node.stand_in();
        assert_eq!((node.state(), node.misbehaved), (NodeState::INIT, true));
    }
}
