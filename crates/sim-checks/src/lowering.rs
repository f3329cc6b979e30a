//! Lowering of an arm through a pose in which the holding torque of the shoulder is near its torque limit. A command
//! stops the arm in this pose (J-33). Tests and the tables of docs/safety.md use this module.
use jtc_core::{Config, ControllerState, JOINTS, Parameters, TrajectoryState};
use jtc_dynamics::{ArmModel, Dynamics, JointVec};
use jtc_wire::ExecCommand;

use jtc_sim::{ModelError, Operator, OperatorError, SimConfig, Support, host};

/// Joint that lowers the arm: the shoulder, which carries the largest load.
pub const LOADED: usize = 1;
/// Speed below which a joint counts as being at rest, rad/s.
const STANDS: f64 = 0.01;
/// Time at rest after which the observation ends, ms.
const STOOD_MS: u64 = 1_000;
/// Maximum duration of the observation, ms.
const LONGEST_MS: u64 = 10_000;

/// Returns a pose with the arm in front of the shoulder. The shoulder angle may be between upright and nearly horizontal.
fn pose(shoulder: f64) -> JointVec {
    [0.0, shoulder, 0.3, 0.0, 0.0, 0.0]
}

/// Returns the holding torque of the shoulder at an angle, N·m.
pub fn holding_torque(model: &ArmModel, shoulder: f64) -> f64 {
    let dynamics = Dynamics::new(model, Config::avena().gravity);
    dynamics.inverse(&pose(shoulder), &[0.0; JOINTS], &[0.0; JOINTS])[LOADED]
}

/// Returns the default arm with an additional mass of `mass` kg at the centre of its last link.
pub fn with_payload(mass: f64) -> ArmModel {
    let mut model = Parameters::avena().model;
    model.links[JOINTS].mass += mass;
    model
}

/// Returns the shoulder angle at which the holding torque of the shoulder is `torque` (N·m), rad.
pub fn angle_of(model: &ArmModel, torque: f64) -> f64 {
    let (mut high, mut low) = (0.0, -1.4);
    for _ in 0..60 {
        let middle = 0.5 * (high + low);
        if holding_torque(model, middle) < torque { high = middle } else { low = middle }
    }
    low
}

/// Motion that lowers the arm through the shoulder angle `shoulder`. The host sends its command at this angle.
#[derive(Clone, Debug)]
pub struct Lowering {
    /// Model of the simulated arm.
    pub model: ArmModel,
    /// Arm model that the controller receives.
    pub known: ArmModel,
    /// Torque limit of the shoulder, N·m.
    pub torque_max: f64,
    /// Angle of the shoulder at which the host sends the command, rad.
    pub shoulder: f64,
    /// Speed of the shoulder at the angle `shoulder`, rad/s.
    pub speed: f64,
    /// Command: Pause or Stop.
    pub command: ExecCommand,
    /// Deviation of the simulated arm from `model`.
    pub model_error: ModelError,
    /// Support that carries the arm when it has no torque.
    pub support: Support,
}

/// Result of a lowering.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// Maximum deviation of a joint from the start pose within half a second after all joints were enabled, rad.
    pub sag: f64,
    /// Time from the last byte of the command until the trajectory state leaves Execute, ms.
    pub commanded_ms: u64,
    /// Time from the last byte of the command until all joints are at rest, ms.
    pub standing_ms: u64,
    /// State of the controller at the end.
    pub state: ControllerState,
    /// Trajectory state at the end.
    pub trajectory: TrajectoryState,
    /// Error word of the controller at the end.
    pub errors: u16,
    /// Internal errors of all joints at the end.
    pub joints: u16,
    /// Maximum distance of a joint from its position at the time of the command, rad.
    pub way: f64,
    /// Maximum true speed of a joint after the command, rad/s.
    pub peak: f64,
    /// Maximum position error of all joints until the trajectory state leaves Execute, rad.
    pub error: f64,
}

impl Lowering {
    /// Creates a lowering of the default arm. The torque limit of the shoulder is set so that the holding torque at
    /// the time of the command is `share` of the limit.
    pub fn at_share(share: f64, speed: f64) -> Self {
        let model = Parameters::avena().model;
        let shoulder = -0.9;
        Self { torque_max: holding_torque(&model, shoulder) / share, ..Self::new(model, shoulder, speed) }
    }

    /// Creates a lowering of an arm whose model the controller knows, with the default torque limit and the command Stop.
    pub fn new(model: ArmModel, shoulder: f64, speed: f64) -> Self {
        Self {
            known: model,
            model,
            torque_max: Config::avena().joints[LOADED].torque_max,
            shoulder,
            speed,
            command: ExecCommand::Stop,
            model_error: ModelError::NONE,
            support: Support::Brakes,
        }
    }

    /// Returns the operator of a simulation that was just switched on. A stand or the holding brakes support the arm
    /// in the pose `from`, which is above the pose in which the arm will be stopped.
    fn operator(&self, from: JointVec) -> Operator {
        let mut controller = Config::avena();
        controller.joints[LOADED].torque_max = self.torque_max;
        let parameters = Parameters { model: self.model, ..Parameters::avena() };
        Operator::new(SimConfig {
            start: from,
            baud: None,
            model_error: self.model_error,
            support: self.support,
            ..SimConfig::new(controller, &parameters)
        })
    }

    /// Lowers the arm and stops it.
    pub fn run(&self) -> Result<Outcome, OperatorError> {
        // In the middle of the quintic polynomial, the speed is 15/8 of the mean speed.
        let reach = 0.3;
        let seconds = 15.0 / 8.0 * 2.0 * reach / self.speed;
        let (from, to) = (pose(self.shoulder + reach), pose(self.shoulder - reach));
        let mut operator = self.operator(from);
        operator.world.host_write(&host::use_defaults());
        operator.world.host_write(&host::arm_model(&self.known));
        operator.wait_for_hold(12_000)?;
        let mut sag = 0.0f64;
        for _ in 0..500 {
            operator.step();
            let q = operator.world.truth().q;
            sag = q.iter().zip(from).fold(sag, |sag, (q, from)| sag.max((q - from).abs()));
        }
        operator.upload(&host::there_and_back(&from, &to, seconds, 1, 10), 10)?;
        operator.ask(&host::exec(ExecCommand::Execute))?;
        let middle = (seconds * 500.0) as u32;
        operator.wait("the place of the stop", 20_000, |w| w.telemetry().point >= middle)?;
        Ok(self.stop(&mut operator, sag))
    }

    fn stop(&self, operator: &mut Operator, sag: f64) -> Outcome {
        let before = operator.world.truth().q;
        operator.world.host_write(&host::exec(self.command));
        let (mut commanded_ms, mut standing_ms) = (0, 0);
        let (mut way, mut peak, mut error) = (0.0f64, 0.0f64, 0.0f64);
        for ms in 1..=LONGEST_MS {
            operator.step();
            let (truth, t) = (operator.world.truth(), operator.world.telemetry());
            if t.trajectory == TrajectoryState::Execute {
                commanded_ms = ms;
                error = t.joints.iter().fold(error, |e, j| e.max(j.position_error().abs()));
            }
            if truth.qd.iter().any(|v| v.abs() > STANDS) {
                standing_ms = ms;
            }
            for (q, (before, qd)) in truth.q.iter().zip(before.iter().zip(&truth.qd)) {
                way = way.max((q - before).abs());
                peak = peak.max(qd.abs());
            }
            if ms >= standing_ms.max(commanded_ms) + STOOD_MS {
                break;
            }
        }
        let t = operator.world.telemetry();
        let (state, trajectory, errors) = (t.state, t.trajectory, t.errors);
        let joints = t.joints.iter().fold(0, |word, joint| word | joint.internal);
        Outcome { sag, commanded_ms, standing_ms, state, trajectory, errors, joints, way, peak, error }
    }
}
