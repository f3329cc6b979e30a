//! Vacuum gripper (node 6), with a pump, two vacuum switches and the properties of its firmware.
use jtc_bus::{Answer, GRIPPER, GripperReport, NodeState, Request, config};

use crate::inbox::Inbox;
use crate::request::NodeRequest;

/// Number of ticks until the measured pump current follows the command.
const PUMP_LAG: u32 = 100;
/// Number of ticks with the pump on until the first and the second vacuum level are reached.
const LEVELS: (u32, u32) = (300, 700);
/// Code that the gripper reports during the transition from Ready or Enabled to Init.
const TO_INIT: NodeState = NodeState::new(14);
const FAULT_TO_INIT: NodeState = NodeState::new(16);
/// Number of ticks after power-up in which the gripper does not answer.
const BOOT: u32 = 250;

/// The vacuum gripper.
#[derive(Clone, Debug)]
pub struct Gripper {
    state: NodeState,
    age: u32,
    booting: u32,
    command: bool,
    pin: bool,
    /// Speed of the pump motor, 0..PUMP_LAG.
    speed: u32,
    /// Number of ticks with vacuum. The count ends at the number for the second level.
    vacuum: u32,
    reacts_to_safety: bool,
    line_before: bool,
    inbox: Inbox,
    /// `true` if the node is disconnected from the bus.
    pub silent: bool,
    /// `true` if the safety line has the level that means danger.
    pub safety_line: bool,
    /// `true` if a part covers the cup, so that the vacuum can build up.
    pub part_present: bool,
}

impl Gripper {
    /// Creates a gripper that has just been switched on.
    pub fn new(one_message_per_interrupt: bool) -> Self {
        Self {
            state: NodeState::START,
            age: 0,
            booting: BOOT,
            command: false,
            pin: false,
            speed: 0,
            vacuum: 0,
            reacts_to_safety: false,
            line_before: false,
            inbox: Inbox::new(one_message_per_interrupt),
            silent: false,
            safety_line: false,
            part_present: true,
        }
    }

    /// Restarts the processor of the gripper.
    pub fn reset(&mut self) {
        self.state = NodeState::START;
        self.age = 0;
        self.booting = BOOT;
        self.command = false;
        self.pin = false;
        self.reacts_to_safety = false;
    }

    /// Returns the state byte of the gripper.
    pub fn state(&self) -> NodeState {
        self.state
    }

    /// Returns `true` if the gripper receives and acknowledges frames.
    pub fn on_bus(&self) -> bool {
        self.booting == 0 && !self.silent
    }

    /// Processes a request that arrives at `now_us`, and returns the answer if the gripper answers.
    pub fn receive(&mut self, now_us: u64, request: &NodeRequest) -> Option<Answer> {
        if !self.on_bus() {
            return None;
        }
        let node = GRIPPER as u8;
        let request = match self.inbox.take(now_us, request)? {
            NodeRequest::ChangeFsm(states) => {
                self.change(states[GRIPPER]);
                return Some(Answer::State { node, state: self.state });
            }
            NodeRequest::Other(request) => request,
        };
        match request {
            Request::Move { pump, .. } => {
                self.command = pump;
                Some(Answer::Gripper(self.report()))
            }
            // This case does not occur, because `NodeRequest` has a separate variant for ChangeFsm.
            Request::ChangeFsm { .. } => None,
            Request::ChangeMode { gripper, .. } => {
                let accepted = matches!(self.state, NodeState::INIT | NodeState::READY);
                if accepted {
                    self.reacts_to_safety = gripper & config::SAFETY_LINE != 0;
                }
                Some(Answer::Mode { node, accepted })
            }
            Request::ResetAll => {
                self.reset();
                None
            }
            Request::Reset(n) => {
                if n == node {
                    self.reset();
                }
                None
            }
        }
    }

    /// Executes a ChangeFsm request in the interrupt, so that the answer already contains the code of the
    /// transition.
    fn change(&mut self, request: NodeState) {
        self.state = match (request, self.state) {
            (NodeState::INIT, NodeState::START) => NodeState::START_TO_INIT,
            (NodeState::INIT, NodeState::READY | NodeState::ENABLED) => TO_INIT,
            (NodeState::INIT, NodeState::FAULT) => FAULT_TO_INIT,
            (NodeState::READY, NodeState::INIT) => NodeState::INIT_TO_READY,
            (NodeState::READY, NodeState::ENABLED) => NodeState::ENABLED_TO_READY,
            (NodeState::ENABLED, NodeState::READY) => NodeState::READY_TO_ENABLED,
            (NodeState::FAULT_REACTION, state) if state != NodeState::START => NodeState::FAULT,
            _ => return,
        };
        self.age = 0;
    }

    fn report(&self) -> GripperReport {
        GripperReport {
            pump: self.speed == PUMP_LAG,
            pressure1: self.vacuum >= LEVELS.0,
            pressure2: self.vacuum >= LEVELS.1,
            state: self.state,
            errors: 0,
            warnings: 0,
        }
    }

    /// Simulates one millisecond of the gripper.
    pub fn tick(&mut self) {
        if self.booting > 0 {
            self.booting -= 1;
            return;
        }
        self.age = self.age.saturating_add(1);
        // The gripper reacts only when the safety line changes to danger. If the gripper is enabled while the
        // safety line is already unsafe, it stays enabled.
        let edge = self.safety_line && !self.line_before;
        self.line_before = self.safety_line;
        if edge && self.reacts_to_safety && self.state == NodeState::ENABLED {
            self.state = NodeState::READY;
        }
        self.state = match self.state {
            NodeState::START => NodeState::START_TO_INIT,
            NodeState::START_TO_INIT | TO_INIT | FAULT_TO_INIT => NodeState::INIT,
            NodeState::INIT_TO_READY | NodeState::ENABLED_TO_READY => NodeState::READY,
            NodeState::READY_TO_ENABLED => NodeState::ENABLED,
            state => state,
        };
        match self.state {
            NodeState::ENABLED => self.pin = self.command,
            NodeState::READY => {
                self.command = false;
                self.pin = false;
            }
            // In other states, the output pin of the pump keeps its level.
            _ => {}
        }
        self.speed = if self.pin { (self.speed + 1).min(PUMP_LAG) } else { self.speed.saturating_sub(1) };
        let sucking = self.pin && self.part_present;
        self.vacuum = if sucking { (self.vacuum + 1).min(LEVELS.1) } else { self.vacuum.saturating_sub(3) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(gripper: &mut Gripper, ms: u32) {
        (0..ms).for_each(|_| gripper.tick());
    }

    fn request(gripper: &mut Gripper, target: NodeState) -> NodeState {
        match gripper.receive(0, &NodeRequest::ChangeFsm([target; 7])) {
            Some(Answer::State { state, .. }) => state,
            answer => panic!("{answer:?}"),
        }
    }

    fn pump(gripper: &mut Gripper, on: bool) -> GripperReport {
        match gripper.receive(0, &Request::Move { torque: [0.0; 6], pump: on }.into()) {
            Some(Answer::Gripper(report)) => report,
            answer => panic!("{answer:?}"),
        }
    }

    #[test]
    fn the_pump_follows_late_and_only_when_enabled() {
        let mut gripper = Gripper::new(false);
        assert!(!gripper.on_bus());
        run(&mut gripper, 260);
        assert_eq!(gripper.state(), NodeState::INIT);
        assert_eq!(request(&mut gripper, NodeState::READY), NodeState::INIT_TO_READY);
        run(&mut gripper, 1);
        pump(&mut gripper, true);
        run(&mut gripper, 200);
        assert!(!pump(&mut gripper, true).pump);
        assert_eq!(request(&mut gripper, NodeState::ENABLED), NodeState::READY_TO_ENABLED);
        run(&mut gripper, 1);
        pump(&mut gripper, true);
        run(&mut gripper, 50);
        assert!(!pump(&mut gripper, true).pump);
        run(&mut gripper, 60);
        assert!(pump(&mut gripper, true).pump);
        assert!(!pump(&mut gripper, true).pressure1);
        run(&mut gripper, 250);
        assert!(pump(&mut gripper, true).pressure1);
        // The gripper changes from ENABLED directly to INIT. The pump continues until READY.
        assert_eq!(request(&mut gripper, NodeState::INIT), TO_INIT);
        run(&mut gripper, 500);
        assert!(pump(&mut gripper, false).pressure2);
        request(&mut gripper, NodeState::READY);
        run(&mut gripper, 200);
        assert!(!pump(&mut gripper, false).pump);
    }
}
