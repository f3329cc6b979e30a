//! The control law of the existing firmware in the version published in April 2022, for a comparison with our control
//! law.
//!
//! The control law is τ = 1.3·(inverse dynamics + PID + friction). The controller interpolates each channel of the trajectory linearly
//! between points. The inverse dynamics use rigid links at the measured position, with the commanded velocity and acceleration. The
//! error is the current set position minus the measured position, which is two milliseconds old. The derivative is computed from the
//! mean of five errors. The sign function in the friction polynomial is a step at zero. If the answer of a joint is lost, the controller
//! uses the last measured position of the joint.
use jtc_bus::{Answer, Frame, JOINTS, NodeState, Request, Scale, Target, config};
use jtc_core::{Config, Friction, Parameters, PidGains, SetPoint};
use jtc_dynamics::Dynamics;
use jtc_wire::RawPoint;

/// Gain factor of the commanded torque.
const GAIN: f64 = 1.3;
/// Duration of a tick, s.
const DT: f64 = 0.001;
/// Number of errors whose mean the controller uses for the derivative.
const WINDOW: usize = 5;
/// Number of ticks in position hold before the motion.
const SETTLE: u32 = 2_000;

/// PID controller of a joint. After a reset, the stored errors of the last ticks are zero.
#[derive(Clone, Copy, Debug, Default)]
struct Pid {
    errors: [f64; WINDOW],
    next: usize,
    mean: f64,
    integral: f64,
}

impl Pid {
    fn step(&mut self, gains: &PidGains, error: f64) -> f64 {
        self.errors[self.next] = error;
        self.next = (self.next + 1) % WINDOW;
        let mean = self.errors.iter().sum::<f64>() / WINDOW as f64;
        let rate = (mean - self.mean) / DT;
        self.mean = mean;
        self.integral = (self.integral + error * DT).clamp(gains.int_min, gains.int_max);
        gains.kp * error + gains.ki * self.integral + gains.kd * rate
    }
}

/// Phase of the existing controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Phase {
    /// The drives are being configured and enabled.
    BringUp,
    /// The arm is in position hold; the value is the number of ticks.
    Hold(u32),
    /// The arm follows the path; the value is the current millisecond of the path.
    Operate(u32),
    /// The arm has reached the end of the path.
    Finish,
}

/// The controller of the existing firmware.
pub(crate) struct Existing {
    dynamics: Dynamics,
    gains: [PidGains; JOINTS],
    friction: [[f64; 6]; JOINTS],
    scale: Scale,
    points: Vec<SetPoint>,
    step_ms: u32,
    pid: [Pid; JOINTS],
    states: [NodeState; JOINTS],
    temperature: [f64; JOINTS],
    ticks: u32,
    configured: bool,
    /// Current phase of the controller.
    pub phase: Phase,
    /// Commanded trajectory point of this tick.
    pub set: SetPoint,
    /// Measured joint positions, rad.
    pub measured: [f64; JOINTS],
}

impl Existing {
    /// Creates the controller for a path, with the parameters of the built-in arm. The existing firmware uses the same
    /// parameters.
    pub(crate) fn new(config: &Config, parameters: &Parameters, points: &[RawPoint], step_ms: u16) -> Self {
        let Friction::Polynomial(friction) = parameters.friction else { unreachable!("it has a polynomial") };
        Self {
            dynamics: Dynamics::new(&parameters.model, config.gravity),
            gains: parameters.pid,
            friction,
            scale: Scale { velocity: config.velocity_full_scale },
            points: points.iter().map(SetPoint::from).collect(),
            step_ms: step_ms.into(),
            pid: [Pid::default(); JOINTS],
            states: [NodeState::START; JOINTS],
            temperature: [0.0; JOINTS],
            ticks: 0,
            configured: false,
            phase: Phase::BringUp,
            set: SetPoint::default(),
            measured: [0.0; JOINTS],
        }
    }

    /// Processes the answers since the last call and returns the frame to send. The simulation calls this function once
    /// per millisecond.
    pub(crate) fn tick(&mut self, received: &[Frame]) -> Frame {
        for frame in received {
            if let Ok(Answer::Joint { node, report }) = Answer::parse(frame, self.scale) {
                let j = usize::from(node);
                self.measured[j] = report.position;
                (self.states[j], self.temperature[j]) = (report.state, f64::from(report.temperature));
            }
        }
        self.ticks += 1;
        match self.phase {
            Phase::BringUp => return self.bring_up(),
            Phase::Hold(SETTLE) => self.enter(Phase::Operate(0)),
            Phase::Hold(ticks) => self.phase = Phase::Hold(ticks + 1),
            Phase::Operate(_) | Phase::Finish => {}
        }
        if let Phase::Operate(k) = self.phase {
            self.follow(k + 1);
        }
        Request::Move { torque: self.torque(), pump: false }.emit()
    }

    /// Returns the next frame until all joints are enabled. In every fourth tick, the frame is a request; in all other
    /// ticks, the frame is a Move.
    fn bring_up(&mut self) -> Frame {
        const TORQUE_MODE: u8 = 1;
        let states = self.states;
        let all = |state: NodeState| states == [state; JOINTS];
        if all(NodeState::ENABLED) {
            self.set = SetPoint::still(self.measured);
            self.enter(Phase::Hold(0));
        }
        if self.ticks < 300 || !self.ticks.is_multiple_of(4) {
            return Request::zero_torque(false).emit();
        }
        let target = |target: Target| Request::ChangeFsm { target: [target; 7] };
        let request = if all(NodeState::START) {
            target(Target::Init)
        } else if all(NodeState::INIT) && !self.configured {
            self.configured = true;
            let bits = config::WORKING_AREA | config::ABSOLUTE_ENCODER;
            Request::ChangeMode { mode: [TORQUE_MODE; JOINTS], config: [bits; JOINTS], gripper: 0 }
        } else if all(NodeState::INIT) {
            target(Target::Ready)
        } else if all(NodeState::READY) {
            target(Target::Enable)
        } else {
            Request::zero_torque(false)
        };
        request.emit()
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.pid = [Pid::default(); JOINTS];
    }

    /// Sets the commanded trajectory point of this millisecond. The controller omits the points of the last two
    /// milliseconds.
    fn follow(&mut self, k: u32) {
        let end = (self.points.len() as u32 - 1) * self.step_ms;
        self.phase = Phase::Operate(k);
        if k >= end {
            self.set = SetPoint::still(self.measured);
            self.enter(Phase::Finish);
        } else if k + 1 < end {
            let (n, share) =
                ((k / self.step_ms) as usize, f64::from(k % self.step_ms) / f64::from(self.step_ms));
            let (a, b) = (&self.points[n], &self.points[n + 1]);
            let line =
                |a: &[f64; JOINTS], b: &[f64; JOINTS]| core::array::from_fn(|j| a[j] + share * (b[j] - a[j]));
            self.set = SetPoint {
                position: line(&a.position, &b.position),
                velocity: line(&a.velocity, &b.velocity),
                acceleration: line(&a.acceleration, &b.acceleration),
            };
        }
    }

    fn torque(&mut self) -> [f64; JOINTS] {
        let moves = matches!(self.phase, Phase::Operate(_));
        let zero = [0.0; JOINTS];
        let (qd, qdd) = if moves { (self.set.velocity, self.set.acceleration) } else { (zero, zero) };
        let model = self.dynamics.inverse(&self.measured, &qd, &qdd);
        core::array::from_fn(|j| {
            let pid = self.pid[j].step(&self.gains[j], self.set.position[j] - self.measured[j]);
            let friction = if moves { friction(&self.friction[j], qd[j], self.temperature[j]) } else { 0.0 };
            GAIN * (model[j] + pid + friction)
        })
    }
}

/// Returns the friction torque (1 + c4·(T − c5))·(c0·s + c1·v + c2·v²·s + c3·v³), N·m; s is the sign of v, and 0 at v
/// = 0.
fn friction([c0, c1, c2, c3, c4, c5]: &[f64; 6], v: f64, celsius: f64) -> f64 {
    let s = if v == 0.0 { 0.0 } else { v.signum() };
    (1.0 + c4 * (celsius - c5)) * (c0 * s + c1 * v + c2 * v * v * s + c3 * v * v * v)
}
