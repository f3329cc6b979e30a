//! Simulation of a controller that follows a path on the simulated plant, and the resulting position errors.
use jtc_bus::{JOINTS, Scale};
use jtc_core::{ControllerState, Parameters, TrajectoryState, joint_error};
use jtc_sim::{Bus, Fault, FaultKind, Operator, Plant, SimConfig, Trigger, host};
use jtc_wire::{ExecCommand, RawPoint};

use crate::existing::{Existing, Phase};

pub(crate) type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Results of a simulation, or the reason why the simulation ended early.
pub(crate) type Outcome = std::result::Result<Figures, String>;

/// Path of the comparison, as points and the time between two points.
pub struct Path {
    pub name: &'static str,
    pub points: Vec<RawPoint>,
    pub step_ms: u16,
}

/// RMS values of the errors over the path, for each joint.
#[derive(Clone, Copy, Debug, Default)]
pub struct Figures {
    /// Commanded minus true position at the time when the command takes effect, mrad.
    pub true_error: [f64; JOINTS],
    /// Position error that the controller calculates, mrad.
    pub own_error: [f64; JOINTS],
    /// Change of the joint torque between two consecutive milliseconds, N·m.
    pub roughness: [f64; JOINTS],
}

/// Sums over all milliseconds of a simulation.
#[derive(Default)]
struct Sums {
    true_error: [f64; JOINTS],
    own_error: [f64; JOINTS],
    roughness: [f64; JOINTS],
    last: Option<[f64; JOINTS]>,
    count: f64,
}

impl Sums {
    fn add(
        &mut self,
        set: &[f64; JOINTS],
        truth: &[f64; JOINTS],
        own: &[f64; JOINTS],
        torque: &[f64; JOINTS],
    ) {
        let last = self.last.replace(*torque).unwrap_or(*torque);
        self.count += 1.0;
        for j in 0..JOINTS {
            self.true_error[j] += (set[j] - truth[j]).powi(2);
            self.own_error[j] += own[j].powi(2);
            self.roughness[j] += (torque[j] - last[j]).powi(2);
        }
    }

    fn figures(&self) -> Figures {
        let rms = |sums: &[f64; JOINTS], scale: f64| sums.map(|sum| scale * (sum / self.count).sqrt());
        Figures {
            true_error: rms(&self.true_error, 1e3),
            own_error: rms(&self.own_error, 1e3),
            roughness: rms(&self.roughness, 1.0),
        }
    }
}

/// Runs our controller in the simulated world.
pub(crate) fn ours(config: SimConfig, lost: f64, path: &Path) -> Result<Outcome> {
    let mut operator = Operator::new(config);
    operator.bring_up()?;
    operator.run(1_000);
    operator.upload(&path.points, path.step_ms)?;
    if lost > 0.0 {
        let kind = FaultKind::FramesLost { probability: lost };
        operator.world.inject(Fault { kind, trigger: Trigger::At(0), duration_ms: None });
    }
    operator.ask(&host::exec(ExecCommand::Execute))?;
    let mut sums = Sums::default();
    for _ in 0..60_000 {
        let truth = operator.world.truth().q;
        operator.step();
        let t = operator.world.telemetry();
        if t.trajectory == TrajectoryState::Finish {
            return Ok(Ok(sums.figures()));
        }
        if t.trajectory != TrajectoryState::Execute || t.errors != 0 {
            let joint = t.joints.iter().fold(0, |all, joint| all | joint.internal);
            return Ok(Err(if joint & joint_error::TORQUE == 0 {
                format!("error 0x{:04X}, of joints 0x{joint:02X}", t.errors)
            } else {
                "torque at its limit for more than 10 ms within 100 ms".to_owned()
            }));
        }
        if t.state == ControllerState::Operate && t.point > 0 {
            let (set, own) = (t.joints.map(|j| j.set_position), t.joints.map(|j| j.position_error()));
            sums.add(&set, &truth, &own, &operator.world.truth().torque);
        }
    }
    Err(format!("{} takes longer than a minute", path.name).into())
}

/// Runs the existing control law on the simulated plant and bus.
pub(crate) fn existing(config: &SimConfig, lost: f64, path: &Path) -> Result<Outcome> {
    let mut plant = Plant::new(config);
    let mut bus = Bus::new(
        config.drives.map(|drive| Scale { velocity: drive.velocity_full_scale }),
        config.seed ^ 0x6275_7300,
    );
    bus.jitter.most_ms = config.answer_jitter_ms;
    let mut controller = Existing::new(&config.controller, &Parameters::avena(), &path.points, path.step_ms);
    let (mut received, mut sums) = (Vec::new(), Sums::default());
    for tick in 0..90_000u64 {
        let truth = plant.truth().q;
        let frame = controller.tick(&received);
        received.clear();
        bus.fault.lost = if matches!(controller.phase, Phase::Operate(_)) { lost } else { 0.0 };
        plant.exchange(&mut bus, 1_000 * tick, Some(&frame), &mut received);
        plant.step(true);
        match controller.phase {
            Phase::Operate(_) => {
                let set = controller.set.position;
                let own = core::array::from_fn(|j| set[j] - controller.measured[j]);
                sums.add(&set, &truth, &own, &plant.truth().torque);
            }
            Phase::Finish => return Ok(Ok(sums.figures())),
            Phase::BringUp | Phase::Hold(_) => {}
        }
    }
    Err(format!("{} takes longer than a minute", path.name).into())
}
