//! Drive of a joint with the properties of real drives: a slow first enable, a coarse encoder, a delayed speed, and no
//! timeout of the torque.
use jtc_bus::{NodeState, config as config_bit, error as error_bit};

use crate::inbox::Inbox;

mod answers;
mod config;
mod encoders;
mod states;

pub use config::{DriveConfig, DriveFault, EncoderPlace};
use encoders::Encoders;
use states::States;

/// Drive of a joint.
#[derive(Clone, Debug)]
pub struct Drive {
    node: u8,
    config: DriveConfig,
    /// Largest torque of the drive, N·m.
    ceiling: f64,
    states: States,
    encoders: Encoders,
    /// Number of ticks until the drive has finished booting.
    booting: u32,
    /// `true` if the drive has accepted a configuration since its last reset.
    configured: bool,
    mode: u8,
    bits: u8,
    goal: f64,
    errors: u8,
    mc_current: u8,
    mc_occurred: u8,
    /// Position (rad) and speed (rad/s) that were measured in the last tick.
    position: f64,
    velocity: f64,
    temperature: f64,
    torque: f64,
    inbox: Inbox,
    /// `true` if the drive is not installed.
    pub absent: bool,
    /// Faults of the drive.
    pub fault: DriveFault,
}

impl Drive {
    /// Creates the drive of node `node`, which has just been switched on.
    pub fn new(node: u8, config: DriveConfig, ceiling: f64) -> Self {
        let mut drive = Self {
            node,
            config,
            ceiling,
            states: States::new(),
            encoders: Encoders::default(),
            booting: 0,
            configured: false,
            mode: 0,
            bits: 0,
            goal: 0.0,
            errors: 0,
            mc_current: 0,
            mc_occurred: 0,
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

    /// Restarts the processor of the drive. The configuration and the motor alignment are lost.
    pub fn reset(&mut self) {
        self.states = States::new();
        self.booting = self.config.boot_ms;
        self.configured = false;
        self.mode = 1;
        // The over-speed trip is enabled by default.
        self.bits = config_bit::OVER_SPEED_TRIP;
        self.goal = 0.0;
        self.errors = 0;
        self.mc_current = 0;
        self.mc_occurred = 0;
        self.torque = 0.0;
        self.inbox = Inbox::new(self.config.one_message_per_interrupt);
    }

    /// Enters the fault state without an error bit, as after a request for state 254.
    pub fn force_fault(&mut self) {
        if self.state() != NodeState::START {
            self.states.enter(NodeState::FAULT, &self.config);
        }
    }

    /// Returns the state byte of the drive.
    pub fn state(&self) -> NodeState {
        self.states.state()
    }

    /// Returns the torque that the drive applies to the joint, N·m.
    pub fn torque(&self) -> f64 {
        self.config.delivers * self.torque
    }

    /// Returns `true` if the drive receives and acknowledges frames.
    pub fn on_bus(&self) -> bool {
        self.booting == 0 && !self.fault.silent && !self.absent
    }

    fn safety_line(&self) -> bool {
        self.fault.safety_line && self.bits & config_bit::SAFETY_LINE != 0
    }

    fn outside(&self) -> bool {
        self.bits & config_bit::WORKING_AREA != 0 && self.position.abs() > self.config.working_area
    }

    /// Simulates one millisecond of the drive: reads the sensors, executes the checks, and processes a requested
    /// state. `motor` and `link` are the true positions of the two sides of the gear, converted to the joint side,
    /// rad.
    pub fn tick(&mut self, motor: f64, link: f64, temperature: f64) {
        self.read_encoders(motor, link);
        if self.booting > 0 {
            self.booting -= 1;
            self.velocity = 0.0;
            return;
        }
        self.temperature = temperature;
        self.states.begin_tick();
        self.check();
        if self.safety_line() && self.state() == NodeState::ENABLED {
            self.states.enter(NodeState::READY, &self.config);
        } else {
            self.states.accept(&self.config);
        }
        if self.states.proceed(&self.config) {
            self.errors = 0;
            self.mc_occurred = 0;
        }
        self.act();
    }

    fn read_encoders(&mut self, motor: f64, link: f64) {
        self.velocity = self.encoders.speed(motor);
        let q = match self.config.encoder {
            EncoderPlace::Motor => motor,
            EncoderPlace::Link => link,
        };
        let read = self.bits & config_bit::ABSOLUTE_ENCODER != 0;
        self.position = if read { self.encoders.position(q + self.fault.encoder_offset) } else { 0.0 };
    }

    fn check(&mut self) {
        self.mc_current = self.fault.motor_control;
        self.mc_occurred |= self.mc_current;
        if self.mc_current != 0 || self.mc_occurred != 0 {
            self.errors |= error_bit::MOTOR_CONTROL;
        } else {
            self.errors &= !error_bit::MOTOR_CONTROL;
        }
        if self.bits & config_bit::OVER_SPEED_TRIP != 0 && self.velocity.abs() > self.config.over_speed {
            self.errors |= error_bit::OVER_SPEED;
        }
        if self.fault.hardware {
            self.errors |= error_bit::HARDWARE;
        }
        if self.errors != 0 && !self.states.reacting() {
            // The drive executes the remaining steps of the fault reaction in the next ticks.
            self.states.enter(NodeState::FAULT_REACTION, &self.config);
        }
    }

    fn act(&mut self) {
        if matches!(self.state(), NodeState::READY | NodeState::READY_TO_ENABLED) {
            self.goal = 0.0;
        }
        let outward = self.outside() && self.goal * self.position > 0.0;
        self.torque = if self.state() == NodeState::ENABLED && !outward {
            self.goal.clamp(-self.ceiling, self.ceiling)
        } else {
            0.0
        };
    }
}

#[cfg(test)]
#[path = "drive_tests.rs"]
mod tests;
