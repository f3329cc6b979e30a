//! Answers of a drive to requests.
use jtc_bus::{Answer, JointReport, NodeState, Request, warning};

use super::Drive;
use super::encoders::floor;
use crate::request::NodeRequest;

impl Drive {
    /// Processes a request that arrives at `now_us`, and returns the answer if the drive answers.
    pub fn receive(&mut self, now_us: u64, request: &NodeRequest) -> Option<Answer> {
        if !self.on_bus() {
            return None;
        }
        match self.inbox.take(now_us, request)? {
            NodeRequest::ChangeFsm(states) => Some(self.change(states[usize::from(self.node)])),
            NodeRequest::Other(request) => self.execute(&request),
        }
    }

    /// Processes a ChangeFsm request with any state byte. The function `tick` interprets the byte.
    fn change(&mut self, state: NodeState) -> Answer {
        let before = self.states.state();
        if !self.fault.ignores_state {
            self.states.request(state);
        }
        if self.config.answers_transition {
            self.states.accept(&self.config);
            return Answer::State { node: self.node, state: self.states.state() };
        }
        Answer::State { node: self.node, state: before }
    }

    fn execute(&mut self, request: &Request) -> Option<Answer> {
        let n = usize::from(self.node);
        match *request {
            Request::Move { torque, .. } => {
                self.goal = if self.mode == 1 { torque.get(n).copied().unwrap_or(0.0) } else { 0.0 };
                Some(Answer::Joint { node: self.node, report: self.report() })
            }
            // This case does not occur, because `NodeRequest` has a separate variant for ChangeFsm.
            Request::ChangeFsm { .. } => None,
            Request::ChangeMode { mode, config, .. } => {
                let accepted = matches!(self.states.state(), NodeState::INIT | NodeState::READY);
                if accepted {
                    self.configured = true;
                    self.mode = mode[n];
                    self.bits = config[n];
                }
                Some(Answer::Mode { node: self.node, accepted })
            }
            Request::ResetAll => {
                self.reset();
                None
            }
            Request::Reset(node) => {
                if node == self.node {
                    self.reset();
                }
                None
            }
        }
    }

    fn report(&self) -> JointReport {
        let mut warnings = 0;
        if self.fault.not_accurate {
            warnings |= warning::POSITION_NOT_ACCURATE;
        }
        if self.outside() {
            warnings |= warning::OUTSIDE_WORKING_AREA;
        }
        // Before the first configuration, the drive sets this warning at any level of the safety line.
        if self.safety_line() || !self.configured {
            warnings |= warning::SAFETY_LINE;
        }
        JointReport {
            position: self.position,
            velocity: self.velocity,
            // The drive reports the magnitude of its torque with the sign of the last command. The reported
            // value is not a measurement.
            torque: if self.goal < 0.0 { -self.torque.abs() } else { self.torque.abs() },
            temperature: byte(self.temperature),
            state: self.states.state(),
            mc_current: self.mc_current,
            mc_occurred: self.mc_occurred,
            errors: self.errors,
            warnings,
            motor_temperature: self.config.long_answers.then(|| byte(self.temperature + 6.0)),
        }
    }
}

/// Converts a temperature in °C to the value on the bus. Negative values wrap around.
fn byte(celsius: f64) -> u8 {
    floor(celsius) as u8
}
