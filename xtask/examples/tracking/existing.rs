//! The control law of the existing firmware, as it was published in April 2022, for comparison.
//!
//! τ = 1.3·(inverse dynamics + PID + friction). Points are joined by straight lines in each channel; the inverse dynamics are those of
//! the rigid links at the measured position, with the commanded velocity and acceleration; the measured position, two
//! milliseconds old, is compared with the present set position; the derivative is that of the mean of five errors; the sign of the
//! friction polynomial steps at zero. A joint whose answer is lost is where it was last seen.
use jtc_bus::{Answer, Frame, JOINTS, NodeState, Request, Scale, Target, config};
use jtc_core::{Config, Friction, Parameters, PidGains, SetPoint};
use jtc_dynamics::Dynamics;
use jtc_wire::RawPoint;

/// What its torque is multiplied by.
const GAIN: f64 = 1.3;
/// Seconds in a tick.
const DT: f64 = 0.001;
/// Errors whose mean the derivative is taken of.
const WINDOW: usize = 5;
/// Ticks for which the arm is held before it moves.
const SETTLE: u32 = 2_000;

/// A PID controller: the errors of the last ticks are zeros after a reset.
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

/// What it does at the moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Phase {
    /// Drives are configured and enabled.
    BringUp,
    /// The arm is held, for so many ticks so far.
    Hold(u32),
    /// The path is followed, at this millisecond.
    Operate(u32),
    /// The end was reached.
    Finish,
}

/// The existing controller.
pub struct Existing {
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
    /// What it does.
    pub phase: Phase,
    /// Commanded in this tick.
    pub set: SetPoint,
    /// Measured, rad.
    pub measured: [f64; JOINTS],
}

impl Existing {
    /// With the parameters of the built-in arm, which are its own, and a path.
    pub fn new(config: &Config, parameters: &Parameters, points: &[RawPoint], step_ms: u16) -> Self {
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

    /// One millisecond: the answers since the last one, and the frame to send.
    pub fn tick(&mut self, received: &[Frame]) -> Frame {
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

    /// Its Move and another request take turns while joints are not enabled.
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

    /// The point of this millisecond; the last two are left out.
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

/// (1 + c4·(T − c5))·(c0·s + c1·v + c2·v²·s + c3·v³), N·m; s is the sign of v, 0 at 0.
fn friction([c0, c1, c2, c3, c4, c5]: &[f64; 6], v: f64, celsius: f64) -> f64 {
    let s = if v == 0.0 { 0.0 } else { v.signum() };
    (1.0 + c4 * (celsius - c5)) * (c0 * s + c1 * v + c2 * v * v * s + c3 * v * v * v)
}
