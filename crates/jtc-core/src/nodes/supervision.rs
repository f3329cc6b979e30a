//! Detection of node errors: missing answers (J-14, J-35), and joints that leave OperationEnable or do not reach this state (J-16).
use jtc_bus::{NodeState, warning};
use jtc_wire::can_flag;

use super::{GRIPPER, Goal, Nodes};
use crate::JOINTS;
use crate::config::Config;
use crate::io::Inputs;

impl Nodes {
    /// Counts Moves without an answer, without a usable answer, and without an acknowledgement (J-14, J-35).
    pub(super) fn count_missing(&mut self, inputs: &Inputs<'_>, config: &Config, answered: u8, usable: u8) {
        let on_the_bus = inputs.bus_state.acknowledged && !inputs.bus_state.bus_off;
        // While all nodes are starting, no node acknowledges a frame.
        let any_booted = || self.all().iter().any(|node| node.boot_left == 0 && !node.absent);
        if on_the_bus {
            self.unacknowledged = 0;
        } else if self.sent_move && any_booted() {
            self.unacknowledged = self.unacknowledged.saturating_add(1);
        }
        for (n, node) in self.nodes.iter_mut().enumerate() {
            let (answered, usable) = (answered & (1 << n) != 0, usable & (1 << n) != 0);
            if answered && usable {
                (node.boot_left, node.silent, node.missed) = (0, 0, 0);
                continue;
            }
            node.boot_left = if answered { 0 } else { node.boot_left.saturating_sub(1) };
            let unanswered = self.sent_move && on_the_bus && node.boot_left == 0;
            // A frame without an acknowledgement cannot have an answer. Until the transmit timeout is raised, the
            // controller therefore predicts the motion of the joint (J-63).
            let predicted =
                self.sent_move && node.valid && (1..config.missed_moves_max).contains(&self.unacknowledged);
            let more = |count: u8| count.saturating_add(1).min(config.missed_moves_max);
            if answered {
                node.silent = 0;
            } else if unanswered {
                node.silent = more(node.silent);
            }
            if usable || self.unacknowledged >= config.missed_moves_max {
                // If too many frames were not acknowledged, the controller reports the transmit timeout instead of missing answers of the
                // joints.
                node.missed = 0;
            } else if answered || unanswered || predicted {
                node.missed = more(node.missed);
            }
            let enabled_gripper = n == GRIPPER && node.report.state == NodeState::ENABLED;
            if node.silent == config.missed_moves_max && !enabled_gripper {
                // A silent node in any state may have lost its supply and therefore its configuration. An enabled
                // gripper is an exception: when it answers again, its state shows whether it has lost its
                // configuration. If the gripper is still enabled, it holds its workpiece.
                node.lose_configuration();
            } else if node.missed == config.missed_moves_max && n < JOINTS {
                // J-35: the answers of the joint contain impossible positions, or missing acknowledgements hide
                // whether the joint answers. The controller must not predict the motion of a joint for more than
                // `missed_moves_max` ticks (J-63).
                node.misbehaved = true;
                node.missed = 0;
                node.measured.forget();
            }
        }
    }

    /// Detects joints that leave OperationEnable without a request, do not reach this state before the timeout (J-16), or lose their
    /// position.
    pub(super) fn watch(&mut self, config: &Config, goal: Goal) {
        let may_enable = self.may_enable(config);
        for node in self.nodes.iter_mut().take(JOINTS) {
            if goal != Goal::Enabled {
                (node.enabled, node.enable_wait) = (false, 0);
                continue;
            }
            if node.report.warnings & warning::POSITION_NOT_ACCURATE != 0 {
                node.misbehaved = true;
            }
            if node.report.state == NodeState::ENABLED {
                (node.enabled, node.enable_wait) = (true, 0);
                continue;
            }
            if node.enabled && !node.starting() {
                node.misbehaved = true;
            }
            node.enabled = false;
            // J-16: while the arm falls, the controller does not request OperationEnable. This time does not count as
            // waiting time.
            node.enable_wait = node.enable_wait.saturating_add(u32::from(may_enable));
            if node.enable_wait > config.enable_timeout_ms {
                (node.misbehaved, node.enable_wait) = (true, 0);
            }
        }
    }

    /// Returns the CAN flags of this tick that are errors. The CAN flags report a transmit timeout, bus-off, or a receive timeout of a
    /// joint.
    pub(crate) fn can_flags(&self, inputs: &Inputs<'_>, config: &Config) -> u32 {
        let transmit = inputs.bus_state.bus_off || self.unacknowledged >= config.missed_moves_max;
        let mut flags = can_flag::TRANSMIT_TIMEOUT * u32::from(transmit);
        for (n, node) in self.joints().iter().enumerate() {
            flags |= can_flag::no_answer(n) * u32::from(node.silent >= config.missed_moves_max);
        }
        flags
    }

    /// Returns `true` if a joint reports an error, or misbehaved in this tick. While the torque is off, the function ignores errors that
    /// are being cleared.
    pub(crate) fn external_error(&self, powered: bool) -> bool {
        self.joints().iter().any(|node| node.misbehaved || ((powered || !node.clear) && node.faulty()))
    }

    /// Returns `true` if a joint reports a fault that ends only when the controller clears it, and the host has not requested this. A
    /// safety-line warning does not count, because it ends without a clear.
    pub(crate) fn fault_stays(&self) -> bool {
        self.joints().iter().any(|node| !node.clear && node.in_fault())
    }

    /// Returns `true` if a joint is still being cleared, because the cause of its error persists.
    pub(crate) fn clearing(&self) -> bool {
        self.joints().iter().any(|node| node.clear)
    }
}
