//! The frame of each tick: Move, or what brings a node up in its place (J-12, J-20).
use jtc_bus::{Frame, Request, Target, fsm};

use super::{Goal, Node, Nodes};
use crate::config::Config;
use crate::{JOINTS, NODES};

/// Ticks between two frames that take the place of Move (J-12: at most one tick of four).
const MOVES_BETWEEN: u8 = 3;

impl Nodes {
    /// The frame of this tick (J-12). `must_move`: the first frame after an error, or after power is taken away, is Move.
    pub fn frame(
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
        instead.unwrap_or(Request::Move { torque, pump }).emit()
    }

    fn instead_of_move(&mut self, config: &Config, goal: Goal) -> Option<Request> {
        let present = self.present();
        let to_reset = self.all().iter().filter(|node| node.reset).count();
        if to_reset == present {
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
        let mut target = [Target::NoChange; NODES];
        let mut change = false;
        for (node, target) in self.all().iter().zip(&mut target) {
            *target = node.request(goal);
            change |= *target != Target::NoChange;
        }
        let configure = goal == Goal::Ready && self.all().iter().any(Node::wants_configuration);
        // Nodes that are enabled refuse their configuration and should not be: they come first.
        let enabled = self.all().iter().any(|node| node.report.fsm == fsm::ENABLED);
        if configure && !(change && (self.configured_last || enabled)) {
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
}
