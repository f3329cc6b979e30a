//! Reactions of the arm to a push, a contact, an unknown load, and an error that is cleared while the arm falls.
use jtc_bus::Joint;
use jtc_core::{ControllerState, JOINTS, TrajectoryState};
use jtc_dynamics::Dynamics;

use super::standstill::state_then;
use super::{MatrixError, bring_to, config_for};
use jtc_sim::{Fault, FaultKind, ModelError, Operator, Side, Support, Trigger, host};

/// Observed time, ms. This time is longer than the remaining motion.
const WATCH_MS: u64 = 5_000;
/// Duration of a push, ms. `PUSH_SHARE` is its torque as a share of the largest push that a joint can hold.
const PUSH_MS: u64 = 500;
const PUSH_SHARE: f64 = 0.8;
/// Wall on the path of a joint: stiffness (N·m/rad), damping (N·m·s/rad) and distance (rad).
const WALL: (f64, f64, f64) = (3_000.0, 20.0, 0.1);
/// Plane across the path of the flange: stiffness (N/m), damping (N·s/m) and distance (m).
const PLANE: (f64, f64, f64) = (20_000.0, 100.0, 0.05);

/// External influence on the arm.
#[derive(Clone, Copy)]
enum Meets {
    /// Push on a joint.
    Push(Joint),
    /// Wall on the path of a joint.
    Wall(Joint),
    /// Plane across the path of the flange.
    Plane,
    /// Load of this mass, kg. The arm model of the controller does not contain it.
    Load(f64),
    /// Load of this mass, kg, which the arm drops after a second. The arm model of the controller does not contain
    /// it.
    Drops(f64),
    /// Friction of all joints, as a multiple of the friction in the model of the controller.
    Friction(f64),
    /// Masses of all links, as a multiple of the masses in the model of the controller.
    Masses(f64),
    /// Safety input that is low for 1 ms. The host clears the error this number of milliseconds later.
    Cleared(u64),
}

impl Meets {
    fn words(self) -> String {
        match self {
            Self::Push(joint) => format!("joint {} is pushed for {PUSH_MS} ms", joint.number()),
            Self::Wall(joint) => format!("joint {} meets a wall", joint.number()),
            Self::Plane => "the flange meets a wall".to_owned(),
            Self::Load(mass) => format!("an unknown load of {mass} kg is picked up"),
            Self::Drops(mass) => format!("an unknown load of {mass} kg is picked up, and dropped after 1 s"),
            Self::Friction(factor) => format!("friction times {factor} in all joints"),
            Self::Masses(factor) => format!("masses times {factor}"),
            Self::Cleared(ms) => format!("safety input low for 1 ms, cleared after {ms} ms"),
        }
    }

    /// Returns the index of the affected joint, if the influence affects one joint.
    fn joint(self) -> Option<usize> {
        match self {
            Self::Push(joint) | Self::Wall(joint) => Some(joint.index()),
            _ => None,
        }
    }

    /// Returns the deviation from the arm model that represents the influence. The deviation exists from the start of
    /// the simulation. A push, a contact or a load causes no deviation.
    fn model_error(self) -> ModelError {
        match self {
            Self::Friction(factor) => {
                ModelError { friction_factors: Some([factor; JOINTS]), ..ModelError::NONE }
            }
            Self::Masses(factor) => ModelError { mass_factors: Some([factor; 7]), ..ModelError::NONE },
            _ => ModelError::NONE,
        }
    }

    /// Applies the influence before the step of millisecond `ms`, counted from 1.
    fn before(self, operator: &mut Operator, ms: u64) {
        let q = operator.world.truth().q;
        let fault = match self {
            Self::Push(joint) if ms == 1 => {
                let torque = push(operator, joint.index());
                Some((FaultKind::Push { joint, torque }, PUSH_MS))
            }
            Self::Wall(joint) if ms == 1 => {
                let (stiffness, damping, ahead) = WALL;
                let rad = q[joint.index()] + ahead;
                Some((FaultKind::JointWall { joint, rad, side: Side::Above, stiffness, damping }, WATCH_MS))
            }
            Self::Plane if ms == 1 => Some((plane(operator), WATCH_MS)),
            Self::Load(mass) if ms == 1 => Some((load(mass), WATCH_MS)),
            Self::Drops(mass) if ms == 1 => Some((load(mass), 1_000)),
            Self::Cleared(_) if ms == 1 => Some((FaultKind::SafetyInput, 1)),
            _ => None,
        };
        if let Some((kind, lasts)) = fault {
            let trigger = Trigger::At(operator.world.now_us() / 1000);
            operator.world.inject(Fault { kind, trigger, duration_ms: Some(lasts) });
        }
        if let Self::Cleared(after) = self
            && ms == after
        {
            operator.world.host_write(&host::clear_all());
        }
    }
}

fn load(mass: f64) -> FaultKind {
    FaultKind::Payload { mass, com: [0.0, 0.0, 0.05] }
}

/// Returns the torque of a push in the direction of gravity, N·m. This torque is 0.8 times the largest push that the
/// joint can hold: 95 % of its torque limit minus 1.1 times its load.
fn push(operator: &Operator, joint: usize) -> f64 {
    let config = operator.world.config();
    let q = operator.world.truth().q;
    let holds = Dynamics::new(&config.arm.model, config.arm.gravity).gravity_torque(&q)[joint];
    let left = 0.95 * config.controller.joints[joint].torque_max - 1.1 * holds.abs();
    -holds.signum() * PUSH_SHARE * left.max(0.0)
}

/// Returns a plane across the path of the flange, a short distance in front of the flange.
fn plane(operator: &Operator) -> FaultKind {
    let config = operator.world.config();
    let truth = operator.world.truth();
    let dynamics = Dynamics::new(&config.arm.model, config.arm.gravity);
    let place = |q: &[f64; JOINTS]| dynamics.forward_kinematics(q)[JOINTS].position;
    let here = place(&truth.q);
    let soon = place(&core::array::from_fn(|j| truth.q[j] + 1e-3 * truth.qd[j]));
    let way: [f64; 3] = core::array::from_fn(|i| soon[i] - here[i]);
    let length = way.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-9);
    let (stiffness, damping, ahead) = PLANE;
    let position = core::array::from_fn(|i| here[i] + ahead * way[i] / length);
    FaultKind::Wall { position, normal: way.map(|x| -x / length), stiffness, damping }
}

/// Result of observing an influence.
struct Outcome {
    then: String,
    /// Time of the first reaction, ms.
    found: Option<u64>,
    /// `true` if the motion was finished.
    ended: bool,
    /// Maximum distances of joints from their positions before the influence, rad. The first value is for the
    /// affected joint, or for all joints if the influence does not affect a single joint. The second value is for the
    /// other joints.
    way: [f64; 2],
    /// Maximum speed of a joint, rad/s.
    speed: f64,
    /// Maximum external torque on a joint, and the external torque at the end, N·m.
    torque: [f64; 2],
    /// Work of the arm against external forces, and work of external forces on the arm, J.
    work: [f64; 2],
}

/// Returns the reactions to external influences as a Markdown table.
pub fn contact_table() -> Result<String, MatrixError> {
    let mut out = format!(
        "All rows use the default arm on drives without brakes. A push acts in the direction of gravity, with {} % of the torque that the joint\n\
         can hold in addition to its load. The wall of a joint has a stiffness of {} N·m/rad and is {} rad ahead of the joint on its path. The\n\
         wall of the flange has a stiffness of {} N/m and is {} m ahead of the flange. The distance counts from the position at the\n\
         beginning of the event. For a moving arm it includes the path until the arm stops. The torque is the highest external torque on a joint,\n\
         and the external torque that remains after {} s. The energy is the energy that the arm gives to a wall or a hand, and the energy that it\n\
         takes from them. A joint that is pushed for a long time yields (J-68). A falling arm is enabled again only when it is at rest: nothing\n\
         catches it before.\n\n\
         | event | in | state then | detected after | distance; other joints | speed | torque; remaining | energy given; taken |\n\
         |---|---|---|---|---|---|---|---|\n",
        100.0 * PUSH_SHARE,
        WALL.0,
        WALL.2,
        PLANE.0,
        PLANE.2,
        WATCH_MS / 1000
    );
    use ControllerState::{HoldPos, Operate};
    let pushes = Joint::ALL.into_iter().flat_map(|joint| [HoldPos, Operate].map(|s| (Meets::Push(joint), s)));
    let walls = Joint::ALL.into_iter().map(|joint| (Meets::Wall(joint), Operate));
    let loads = [Meets::Load(2.0), Meets::Load(4.0), Meets::Drops(2.0)];
    let loads = loads.into_iter().flat_map(|load| [HoldPos, Operate].map(|state| (load, state)));
    let models = [Meets::Friction(1.2), Meets::Friction(1.5), Meets::Masses(1.1), Meets::Masses(1.2)];
    let models = models.into_iter().map(|model| (model, Operate));
    let cleared = [20, 400, 3_000].map(|ms| (Meets::Cleared(ms), HoldPos));
    let rows = pushes.chain(walls).chain([(Meets::Plane, Operate)]).chain(loads).chain(models).chain(cleared);
    for (meets, state) in rows {
        let outcome = outcome(meets, state)?;
        if !matches!(meets, Meets::Cleared(_)) && outcome.then.starts_with("Error") {
            return Err(MatrixError::Released { state });
        }
        out += &outcome.row(&meets.words(), state);
    }
    Ok(out)
}

fn outcome(meets: Meets, state: ControllerState) -> Result<Outcome, MatrixError> {
    let config = jtc_sim::SimConfig { model_error: meets.model_error(), ..config_for(Support::Stand, 0) };
    let mut operator = bring_to(config, state)?;
    if state == ControllerState::HoldPos {
        // After 3 s, the controller has finished its estimate of the load.
        operator.run(3_000);
    }
    let from = operator.world.truth().q;
    let before = (operator.state(), operator.world.telemetry().errors);
    let (mut found, mut ended) = (None, false);
    let (mut way, mut speed, mut torque, mut work) = ([0.0f64; 2], 0.0f64, [0.0f64; 2], [0.0f64; 2]);
    for ms in 1..=WATCH_MS {
        meets.before(&mut operator, ms);
        operator.step();
        let truth = operator.world.truth();
        let strongest = truth.outside.iter().fold(0.0f64, |most, torque| most.max(torque.abs()));
        torque = [torque[0].max(strongest), strongest];
        for j in 0..JOINTS {
            let meant = meets.joint().is_none_or(|joint| joint == j);
            let way = &mut way[usize::from(!meant)];
            *way = way.max((truth.q[j] - from[j]).abs());
            speed = speed.max(truth.qd[j].abs());
            let power = truth.outside[j] * truth.qd[j];
            work[usize::from(power > 0.0)] += power.abs() * 1e-3;
        }
        let telemetry = operator.world.telemetry();
        ended |= telemetry.trajectory == TrajectoryState::Finish;
        let now = (telemetry.state, telemetry.errors);
        if found.is_none() && now != before && !ended {
            found = Some(ms);
        }
    }
    let t = operator.world.telemetry();
    let joints = t.joints.iter().fold(0, |word, joint| word | joint.internal);
    let then = state_then(t.state, t.trajectory, t.errors, joints);
    Ok(Outcome { then, found, ended, way, speed, torque, work })
}

impl Outcome {
    fn row(&self, what: &str, state: ControllerState) -> String {
        let Self { then, found, ended, way, speed, torque, work } = self;
        let found = found.map_or_else(|| "no reaction".to_owned(), |ms| format!("{ms} ms"));
        let (then, ways) = if *ended {
            ("the motion was completed".to_owned(), "its path".to_owned())
        } else {
            (then.clone(), format!("{:.3}; {:.3} rad", way[0], way[1]))
        };
        format!(
            "| {what} | {state:?} | {then} | {found} | {ways} | {speed:.2} rad/s | {:.0}; {:.0} N·m | {:.1}; {:.1} J |\n",
            torque[0], torque[1], work[0], work[1]
        )
    }
}
