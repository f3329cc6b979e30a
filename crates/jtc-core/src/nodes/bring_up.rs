//! Selection of the frame of each tick: a Move, or a frame for the bring-up of a node (J-12, J-20).
use jtc_bus::{Frame, NodeState, Request, Target};

use super::{GRIPPER, Goal, Node, Nodes};
use crate::config::Config;
use crate::{JOINTS, NODES};

/// Number of Moves between two frames that the controller sends instead of a Move (J-12: at most one tick of four).
const MOVES_BETWEEN: u8 = 3;
/// Like [`MOVES_BETWEEN`], while the torque is on and no node except the gripper needs such a frame.
const MOVES_ASIDE: u8 = 19;

impl Nodes {
    /// Creates the frame of this tick (J-12). `must_move` is `true` if this frame must be a Move, because it is the first frame after an
    /// error or after the torque was switched off.
    pub(crate) fn frame(
        &mut self,
        config: &Config,
        goal: Goal,
        torque: [f64; JOINTS],
        pump: bool,
        must_move: bool,
    ) -> Frame {
        let instead =
            if must_move || self.moves < MOVES_BETWEEN { None } else { self.instead_of_move(config, goal) };
        self.sent_move = instead.is_none();
        self.moves = if self.sent_move { self.moves.saturating_add(1) } else { 0 };
        match instead {
            Some(request) => request.emit(),
            None => Request::Move { torque, pump }.emit(),
        }
    }

    fn instead_of_move(&mut self, config: &Config, goal: Goal) -> Option<Request> {
        if goal == Goal::Enabled && self.all().iter().all(Node::wants_nothing_enabled) {
            // Almost every tick with torque ends here, because no node needs another frame than Move.
            return None;
        }
        let present = self.present();
        if self.all().iter().all(|node| node.reset) {
            for node in &mut self.nodes {
                node.restart(config);
            }
            return Some(Request::ResetAll);
        }
        if let Some((n, node)) = self.nodes.iter_mut().enumerate().take(present).find(|(_, node)| node.reset)
        {
            node.restart(config);
            return Some(Request::Reset(n as u8));
        }
        let target = self.targets(goal, config);
        let change = target.iter().any(|&t| t != Target::NoChange);
        let joints_wait = goal == Goal::Ready && self.joints().iter().any(Node::wants_configuration);
        let gripper_waits = goal != Goal::Down
            && self.gripper_answers(config)
            && self.gripper_node().is_some_and(Node::wants_configuration);
        if goal == Goal::Enabled && self.moves < MOVES_ASIDE && all_unchanged(&target[..JOINTS]) {
            // Nearly every tick must send the torque of the arm, so a frame that only the gripper needs must wait
            // (J-23).
            return None;
        }
        // Enabled nodes refuse a configuration. Therefore the controller first disables enabled nodes.
        let to_disable = self
            .nodes
            .iter()
            .zip(&target)
            .any(|(node, &target)| target == Target::Ready && node.report.state == NodeState::ENABLED);
        if (joints_wait || gripper_waits) && !(change && (self.configured_last || to_disable)) {
            self.configured_last = true;
            return Some(Request::ChangeMode {
                mode: [1; JOINTS],
                config: [config.joint_config_bits; JOINTS],
                gripper: config.gripper_config_bits,
            });
        }
        self.configured_last = false;
        change.then_some(Request::ChangeFsm { target })
    }

    /// Returns the state that the controller requests from each node.
    fn targets(&self, goal: Goal, config: &Config) -> [Target; NODES] {
        let mut target = [Target::NoChange; NODES];
        for (node, target) in self.joints().iter().zip(&mut target) {
            // J-16: the controller does not enable a falling arm, because enabling would stop the arm with a jolt.
            let request = node.request(goal);
            let held_back = request == Target::Enable && !self.may_enable(config);
            *target = if held_back { Target::NoChange } else { request };
        }
        target[GRIPPER] = self.gripper_target(goal, config);
        target
    }

    /// Returns the state that the controller requests from the gripper. In states with torque, the controller also brings up the gripper
    /// (J-23).
    fn gripper_target(&self, goal: Goal, config: &Config) -> Target {
        let Some(node) = self.gripper_node().filter(|_| self.gripper_answers(config)) else {
            return Target::NoChange;
        };
        if goal != Goal::Enabled && self.gripper_keeps_part(config) && !node.clear {
            return Target::NoChange;
        }
        let brought_up = node.configured && !node.starting();
        node.request(if goal == Goal::Enabled && !brought_up { Goal::Ready } else { goal })
    }
}

fn all_unchanged(target: &[Target]) -> bool {
    target.iter().all(|&t| t == Target::NoChange)
}
