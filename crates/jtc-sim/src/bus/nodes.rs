//! Nodes of the joint bus, and their answers.

use jtc_bus::{Answer, Frame, JOINTS, NODES, NodeState, Scale};

use crate::drive::Drive;
use crate::gripper::Gripper;
use crate::request::NodeRequest;

/// Time from the end of a request until the first answer is ready, µs. The second number is the time from each
/// answer to the next answer.
pub(super) const ANSWER_US: (u32, u32) = (38, 6);
/// Length of the gripper's answer to Move, bytes.
const GRIPPER_ANSWER: usize = 20;

/// All seven nodes.
#[derive(Clone, Debug)]
pub struct Nodes {
    /// Drives from the base to the wrist.
    pub drives: [Drive; JOINTS],
    /// Gripper (node 6); `None` if it is not installed.
    pub gripper: Option<Gripper>,
}

impl Nodes {
    /// Returns `true` if at least one node acknowledges frames.
    pub fn any_on_bus(&self) -> bool {
        self.drives.iter().any(Drive::on_bus) || self.gripper.as_ref().is_some_and(Gripper::on_bus)
    }

    /// Returns the states of the nodes. Without a gripper, the state of node 6 is Fault.
    pub fn states(&self) -> [NodeState; NODES] {
        let gripper = self.gripper.as_ref().map_or(NodeState::FAULT, Gripper::state);
        core::array::from_fn(|n| self.drives.get(n).map_or(gripper, Drive::state))
    }

    /// Returns a node's answer to a request that ended at `now_us`. Also returns the time from the end of the
    /// request until the answer is ready, µs.
    pub fn answer(
        &mut self,
        node: usize,
        now_us: u64,
        request: &NodeRequest,
        scales: &[Scale; JOINTS],
    ) -> Option<(u32, Frame)> {
        let answer = self.receive(node, now_us, request)?;
        let mut frame = answer.emit(*scales.get(node).unwrap_or(&scales[0]));
        if matches!(answer, Answer::Gripper(_)) {
            // Real grippers send 20 bytes. The last of these bytes have no meaning.
            let mut data = [0; GRIPPER_ANSWER];
            let len = frame.data().len().min(GRIPPER_ANSWER);
            data[..len].copy_from_slice(&frame.data()[..len]);
            frame = Frame::new(frame.id, &data).unwrap_or(frame);
        }
        Some((ANSWER_US.0 + ANSWER_US.1 * node as u32, frame))
    }

    fn receive(&mut self, node: usize, now_us: u64, request: &NodeRequest) -> Option<Answer> {
        match self.drives.get_mut(node) {
            Some(drive) => drive.receive(now_us, request),
            None => self.gripper.as_mut()?.receive(now_us, request),
        }
    }
}
