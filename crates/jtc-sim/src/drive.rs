//! A joint's drive with the habits of the real ones: slow first enable, coarse encoder, late speed, torques
//! that never time out.
use jtc_bus::{Answer, JointReport, Request, fsm, warning};

use crate::inbox::Inbox;
use crate::request::NodeRequest;

/// Full turns of the 16-bit absolute encoder.
const ENCODER_COUNTS: f64 = 65_536.0;
/// rad at 32768 encoder counts as the bus scales positions.
const HALF_TURN: f64 = jtc_wire::POSITION_SCALE;
/// Counts of the motor's incremental encoder behind the gear of 121.
const MOTOR_COUNTS_PER_RAD: f64 = 10_000.0 * 121.0 / core::f64::consts::TAU;
/// Encoder differences of 1 ms that the speed is the mean of.
const SPEED_WINDOW: usize = 10;

/// Configuration bits of ChangeMode.
mod config_bit {
    pub const WORKING_AREA: u8 = 0x01;
    pub const ENCODER: u8 = 0x02;
    pub const SAFETY_LINE: u8 = 0x04;
    pub const OVER_SPEED: u8 = 0x10;
}

/// Bits of the error byte.
mod error_bit {
    pub const MOTOR_CONTROL: u8 = 0x02;
    pub const OVER_SPEED: u8 = 0x04;
    pub const HARDWARE: u8 = 0x08;
}

/// States between the lasting ones.
mod transition {
    pub const START_TO_INIT: u8 = 10;
    pub const INIT_TO_READY: u8 = 11;
    pub const READY_TO_ENABLED: u8 = 12;
    pub const ENABLED_TO_READY: u8 = 13;
    pub const READY_TO_INIT: u8 = 14;
    pub const REACTION_TO_FAULT: u8 = 15;
    pub const FAULT_TO_INIT: u8 = 16;
}

/// What drives differ in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveConfig {
    /// Silence after power-up and reset, ms.
    pub boot_ms: u32,
    /// Motor alignment at the first enable after a reset, ms.
    pub first_enable_ms: u32,
    /// Later enables, ms.
    pub enable_ms: u32,
    /// Rest of the motor control after a stop, ms.
    pub rest_ms: u32,
    /// Speed at 32767, rad/s: 2.0, older drives 6.283185.
    pub velocity_full_scale: f64,
    /// Measured speed that trips, rad/s, either way. Known drives: 1.8 (older ones 1.5 or 1.0), which is 1.2 times the default
    /// arm's velocity limit; [`SimConfig::new`](crate::SimConfig::new) sets each joint's to 1.2 times its limit.
    pub over_speed: f64,
    /// Half of the working area, rad.
    pub working_area: f64,
    /// The drive takes one message per interrupt: requests back to back leave it one behind for good.
    pub one_message_per_interrupt: bool,
    /// ChangeFsm is executed in the interrupt and answered with the transition's code; else with the state
    /// before.
    pub answers_transition: bool,
    /// Answers to Move have 20 bytes; else 16.
    pub long_answers: bool,
}

impl Default for DriveConfig {
    fn default() -> Self {
        Self {
            boot_ms: 250,
            first_enable_ms: 4000,
            enable_ms: 20,
            rest_ms: 400,
            velocity_full_scale: 2.0,
            over_speed: 1.8,
            working_area: 2.9905,
            one_message_per_interrupt: false,
            answers_transition: false,
            long_answers: true,
        }
    }
}

impl DriveConfig {
    /// The firmware before the present one: other speed scale, short answers, one message per interrupt.
    pub fn older() -> Self {
        Self {
            velocity_full_scale: 6.283185,
            one_message_per_interrupt: true,
            answers_transition: true,
            long_answers: false,
            ..Self::default()
        }
    }
}

/// What faults do to a drive at the moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveFault {
    /// The node is off the bus; its motor goes on.
    pub silent: bool,
    /// Motor-control fault bits.
    pub motor_control: u8,
    /// The gate driver reports a fault.
    pub hardware: bool,
    /// Added to what the encoder reads, rad.
    pub encoder_offset: f64,
    /// The position is reported as not accurate.
    pub not_accurate: bool,
    /// The safety line is at the level that means danger.
    pub safety_line: bool,
    /// Requests for another state are answered and have no effect.
    pub ignores_state: bool,
}

/// A drive.
#[derive(Clone, Debug)]
pub struct Drive {
    node: u8,
    config: DriveConfig,
    /// Torque that it reaches, N·m.
    ceiling: f64,
    state: u8,
    /// Ticks in `state`.
    age: u32,
    /// Ticks until it has booted.
    booting: u32,
    aligned: bool,
    /// Ticks until the motor control may start.
    rest: u32,
    pending: u8,
    /// A configuration was accepted since the last reset.
    configured: bool,
    mode: u8,
    bits: u8,
    goal: f64,
    errors: u8,
    mc_current: u8,
    mc_occurred: u8,
    /// Motor encoder of the last ticks, counts: a ring.
    history: [i64; SPEED_WINDOW],
    oldest: usize,
    /// Position and speed as the last tick read them, rad, rad/s.
    position: f64,
    velocity: f64,
    temperature: f64,
    torque: f64,
    inbox: Inbox,
    /// It is not there at all.
    pub absent: bool,
    /// What is wrong with it.
    pub fault: DriveFault,
}

impl Drive {
    /// Node `node` with power just switched on.
    pub fn new(node: u8, config: DriveConfig, ceiling: f64) -> Self {
        let mut drive = Self {
            node,
            config,
            ceiling,
            state: fsm::START,
            age: 0,
            booting: 0,
            aligned: false,
            rest: 0,
            pending: 0,
            configured: false,
            mode: 0,
            bits: 0,
            goal: 0.0,
            errors: 0,
            mc_current: 0,
            mc_occurred: 0,
            history: [0; SPEED_WINDOW],
            oldest: 0,
            position: 0.0,
            velocity: 0.0,
            temperature: 0.0,
            torque: 0.0,
            inbox: Inbox::new(config.one_message_per_interrupt),
            absent: false,
            fault: DriveFault::default(),
        };
        drive.reset();
        drive
    }

    /// The processor restarts: configuration and motor alignment are lost.
    pub fn reset(&mut self) {
        self.state = fsm::START;
        self.age = 0;
        self.booting = self.config.boot_ms;
        self.aligned = false;
        self.rest = 0;
        self.pending = 0;
        self.configured = false;
        self.mode = 1;
        // Over-speed trip is on by default.
        self.bits = config_bit::OVER_SPEED;
        self.goal = 0.0;
        self.errors = 0;
        self.mc_current = 0;
        self.mc_occurred = 0;
        self.torque = 0.0;
        self.inbox = Inbox::new(self.config.one_message_per_interrupt);
    }

    /// Go to the fault state with no error bit set, as a request of 254 makes it.
    pub fn force_fault(&mut self) {
        if self.state != fsm::START {
            self.enter(fsm::FAULT);
        }
    }

    /// State byte.
    pub fn state(&self) -> u8 {
        self.state
    }

    /// Torque on the joint, N·m.
    pub fn torque(&self) -> f64 {
        self.torque
    }

    /// It can hear and acknowledge frames.
    pub fn on_bus(&self) -> bool {
        self.booting == 0 && !self.fault.silent && !self.absent
    }

    /// A request arrives at `now_us`; the answer, if it gives one.
    pub fn receive(&mut self, now_us: u64, request: &NodeRequest) -> Option<Answer> {
        if !self.on_bus() {
            return None;
        }
        match self.inbox.take(now_us, request)? {
            NodeRequest::ChangeFsm(states) => Some(self.change(states[usize::from(self.node)])),
            NodeRequest::Other(request) => self.execute(&request),
        }
    }

    /// ChangeFsm: any byte is taken; what it means is decided by the tick.
    fn change(&mut self, state: u8) -> Answer {
        let before = self.state;
        if !self.fault.ignores_state {
            self.pending = state;
        }
        if self.config.answers_transition {
            self.accept_request();
            return Answer::Fsm { node: self.node, fsm: self.state };
        }
        Answer::Fsm { node: self.node, fsm: before }
    }

    fn execute(&mut self, request: &Request) -> Option<Answer> {
        let n = usize::from(self.node);
        match *request {
            Request::Move { torque, .. } => {
                self.goal = if self.mode == 1 { torque.get(n).copied().unwrap_or(0.0) } else { 0.0 };
                Some(Answer::Joint { node: self.node, report: self.report() })
            }
            // A `NodeRequest` carries it apart.
            Request::ChangeFsm { .. } => None,
            Request::ChangeMode { mode, config, .. } => {
                let accepted = matches!(self.state, fsm::INIT | fsm::READY);
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
        // Also before the first configuration, whatever the line is.
        if self.safety_line() || !self.configured {
            warnings |= warning::SAFETY_LINE;
        }
        JointReport {
            position: self.position,
            velocity: self.velocity,
            // A magnitude with the sign of the last command: no measurement.
            torque: if self.goal < 0.0 { -self.torque.abs() } else { self.torque.abs() },
            temperature: byte(self.temperature),
            fsm: self.state,
            mc_current: self.mc_current,
            mc_occurred: self.mc_occurred,
            errors: self.errors,
            warnings,
            motor_temperature: self.config.long_answers.then(|| byte(self.temperature + 6.0)),
        }
    }

    fn safety_line(&self) -> bool {
        self.fault.safety_line && self.bits & config_bit::SAFETY_LINE != 0
    }

    fn outside(&self) -> bool {
        self.bits & config_bit::WORKING_AREA != 0 && self.position.abs() > self.config.working_area
    }

    /// One millisecond of the drive: read sensors, check, accept a request, act. `q`: true position, rad.
    pub fn tick(&mut self, q: f64, temperature: f64) {
        if self.booting > 0 {
            self.booting -= 1;
            self.read_encoder(q);
            self.velocity = 0.0;
            return;
        }
        self.temperature = temperature;
        self.age = self.age.saturating_add(1);
        self.read_encoder(q);
        self.check();
        if self.safety_line() && self.state == fsm::ENABLED {
            self.enter(fsm::READY);
        } else {
            self.accept_request();
        }
        self.proceed();
        self.act();
    }

    fn read_encoder(&mut self, q: f64) {
        // The speed comes from the motor's own encoder, which is much finer than the joint's.
        let motor = floor(q * MOTOR_COUNTS_PER_RAD);
        let oldest = core::mem::replace(&mut self.history[self.oldest], motor);
        self.oldest = (self.oldest + 1) % SPEED_WINDOW;
        self.velocity = (motor - oldest) as f64 / (MOTOR_COUNTS_PER_RAD * SPEED_WINDOW as f64 * 0.001);
        if self.bits & config_bit::ENCODER == 0 {
            self.position = 0.0;
            return;
        }
        // Whole turns are lost: the encoder is absolute within one.
        let turns = (q + self.fault.encoder_offset) / core::f64::consts::TAU;
        let count = floor(turns * ENCODER_COUNTS + 0.5) as i16;
        self.position = f64::from(count) * (HALF_TURN / 32_768.0);
    }

    fn check(&mut self) {
        self.mc_current = self.fault.motor_control;
        self.mc_occurred |= self.mc_current;
        if self.mc_current != 0 || self.mc_occurred != 0 {
            self.errors |= error_bit::MOTOR_CONTROL;
        } else {
            self.errors &= !error_bit::MOTOR_CONTROL;
        }
        if self.bits & config_bit::OVER_SPEED != 0 && self.velocity.abs() > self.config.over_speed {
            self.errors |= error_bit::OVER_SPEED;
        }
        if self.fault.hardware {
            self.errors |= error_bit::HARDWARE;
        }
        let reacting = matches!(
            self.state,
            fsm::FAULT_REACTION
                | fsm::FAULT
                | transition::REACTION_TO_FAULT
                | transition::FAULT_TO_INIT
                | fsm::START
        );
        if self.errors != 0 && !reacting {
            self.enter(fsm::FAULT_REACTION);
            // The rest of the reaction takes the following ticks.
            self.age = 0;
        }
    }

    fn accept_request(&mut self) {
        use transition::*;
        let next = match (self.pending, self.state) {
            (fsm::INIT, fsm::START) => START_TO_INIT,
            (fsm::INIT, fsm::READY) => READY_TO_INIT,
            (fsm::INIT, fsm::FAULT) => FAULT_TO_INIT,
            (fsm::READY, fsm::INIT) => INIT_TO_READY,
            (fsm::READY, fsm::ENABLED) => ENABLED_TO_READY,
            // Some drives take an echoed fault byte as a command to move: this one does.
            (fsm::ENABLED | fsm::FAULT, fsm::READY) => READY_TO_ENABLED,
            // Its error byte stays 0.
            (fsm::FAULT_REACTION, state) if state != fsm::START => {
                self.pending = 0;
                fsm::FAULT
            }
            // Anything else stays pending until a transition erases it.
            _ => return,
        };
        self.enter(next);
    }

    fn enter(&mut self, state: u8) {
        if self.state == fsm::ENABLED && state != fsm::ENABLED {
            self.rest = self.config.rest_ms;
        }
        self.state = state;
        self.age = 0;
    }

    /// Let a transition go on; when it is complete, a pending request is forgotten.
    fn proceed(&mut self) {
        use transition::*;
        self.rest = self.rest.saturating_sub(1);
        let start_time = if self.aligned { self.config.enable_ms } else { self.config.first_enable_ms };
        let next = match self.state {
            fsm::START => START_TO_INIT,
            START_TO_INIT | READY_TO_INIT if self.age > 0 => fsm::INIT,
            FAULT_TO_INIT if self.age > 0 => {
                self.errors = 0;
                self.mc_occurred = 0;
                fsm::INIT
            }
            INIT_TO_READY | ENABLED_TO_READY if self.age > 0 => fsm::READY,
            READY_TO_ENABLED if self.rest == 0 && self.age >= start_time => {
                self.aligned = true;
                fsm::ENABLED
            }
            // Any stop on the way interrupts it.
            fsm::FAULT_REACTION if self.age > 0 => REACTION_TO_FAULT,
            REACTION_TO_FAULT if self.age > 0 => fsm::FAULT,
            _ => return,
        };
        self.enter(next);
        if matches!(next, fsm::INIT | fsm::READY | fsm::ENABLED | fsm::FAULT) {
            self.pending = 0;
        }
    }

    fn act(&mut self) {
        if self.state == fsm::READY || self.state == transition::READY_TO_ENABLED {
            self.goal = 0.0;
        }
        let outward = self.outside() && self.goal * self.position > 0.0;
        self.torque = if self.state == fsm::ENABLED && !outward {
            self.goal.clamp(-self.ceiling, self.ceiling)
        } else {
            0.0
        };
    }
}

/// °C as the bus carries them: negative values wrap.
fn byte(celsius: f64) -> u8 {
    floor(celsius) as u8
}

/// The next whole number below; `f64::floor` is a call where the processor's own instruction may not be used.
fn floor(x: f64) -> i64 {
    let near = x as i64;
    near - i64::from(near as f64 > x)
}

#[cfg(test)]
#[path = "drive_tests.rs"]
mod tests;
