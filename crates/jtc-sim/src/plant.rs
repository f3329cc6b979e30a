//! Devices on the joint bus (drives and gripper), and the arm that the drives move. The plant does not depend on a
//! particular controller. The plant works with the simulated controller of [`World`](crate::World), and with any
//! controller that sends frames.
use jtc_bus::{Frame, JOINTS, NODES, NodeState, Scale};
use jtc_core::BusState;
use jtc_dynamics::{ArmModel, JointVec, Payload};

use crate::arm::Arm;
use crate::bus::{Bus, Nodes};
use crate::config::{SimConfig, Support};
use crate::drive::{Drive, DriveFault};
use crate::faults::FaultKind;
use crate::gripper::Gripper;
use crate::request::NodeRequest;

/// Duration of a drive's tick and of a step of the arm, s.
const TICK: f64 = 1e-3;

/// Answer of a node: the time from the end of the request until the answer is ready (µs), and the frame.
pub type ReadyAnswer = (u32, Frame);

/// True state of the arm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Truth {
    /// Position of each joint, rad.
    pub q: JointVec,
    /// Velocity of each joint, rad/s.
    pub qd: JointVec,
    /// Position of the motors, converted to the joint side of the gears, rad. If the gears are rigid, the position is
    /// equal to `q`.
    pub motor: JointVec,
    /// Torque of each drive, N·m.
    pub torque: JointVec,
    /// Torque on each joint from pushes, a hand and walls, N·m.
    pub outside: JointVec,
    /// Bearing temperature of each joint, °C.
    pub temperature: JointVec,
}

/// Drives, gripper and arm.
///
/// ```
/// use jtc_bus::Request;
/// use jtc_sim::{Plant, SimConfig};
///
/// let mut plant = Plant::new(&SimConfig::default());
/// for _ in 0..300 {
///     plant.step(true); // the drives boot
/// }
/// let request = Request::Move { torque: [0.0; 6], pump: false }.emit();
/// let mut answers = Vec::new();
/// plant.receive(300_000, &request, &mut answers);
/// assert_eq!(answers.len(), 7);
/// ```
pub struct Plant {
    pub(crate) nodes: Nodes,
    pub(crate) arm: Arm,
    truth: Truth,
    /// Torque of pushes on each joint, N·m. The torque of a hand is in the next field.
    push: JointVec,
    pub(crate) hand: JointVec,
    model: ArmModel,
    scales: [Scale; JOINTS],
    support: Support,
    stand: bool,
    /// `true` for joints with a brake that stays closed because of a fault.
    stuck: [bool; JOINTS],
    safety_wired: bool,
}

impl Plant {
    /// Creates a plant that has just been switched on.
    pub fn new(config: &SimConfig) -> Self {
        let (parts, friction) = config.model_error.apply(&config.arm, config.seed);
        let ceiling = parts.torque_ceiling;
        let model = parts.model;
        let drives = core::array::from_fn(|j| {
            let mut drive = Drive::new(j as u8, config.drives[j], ceiling[j]);
            drive.absent = config.absent_drives & (1 << j) != 0;
            drive
        });
        let older = config.drives[0].one_message_per_interrupt;
        let mut plant = Self {
            nodes: Nodes { drives, gripper: config.gripper.then(|| Gripper::new(older)) },
            arm: Arm::new(parts, friction, config.start),
            truth: Truth::default(),
            push: [0.0; JOINTS],
            hand: [0.0; JOINTS],
            model,
            scales: config.drives.map(|d| Scale { velocity: d.velocity_full_scale }),
            support: config.support,
            stand: config.support == Support::Stand,
            stuck: [false; JOINTS],
            safety_wired: config.safety_wired,
        };
        plant.read_truth();
        plant
    }

    /// Passes a frame that ended on the bus at `now_us` to the nodes, and adds the answers of the nodes to `answers`.
    /// Ignores frames that are not requests, including answers of nodes.
    pub fn receive(&mut self, now_us: u64, frame: &Frame, answers: &mut Vec<ReadyAnswer>) {
        let Some(request) = NodeRequest::parse(frame) else { return };
        for node in 0..NODES {
            answers.extend(self.nodes.answer(node, now_us, &request, &self.scales));
        }
    }

    /// Simulates one millisecond of a bus with the nodes of the plant and one controller. Sends `out` to the nodes, and
    /// adds the answers that are complete at the end of the millisecond to `received`.
    pub fn exchange(
        &mut self,
        bus: &mut Bus,
        now_us: u64,
        out: Option<&Frame>,
        received: &mut Vec<Frame>,
    ) -> BusState {
        bus.tick(now_us, out, &mut self.nodes, received)
    }

    /// Returns `true` if at least one node is on the bus and acknowledges frames.
    pub fn acknowledges(&self) -> bool {
        self.nodes.any_on_bus()
    }

    /// Simulates one millisecond. Drives and gripper execute their tick, and the arm moves. `safety_output` is `true`
    /// if the controller's safety output has the level that means no error.
    pub fn step(&mut self, safety_output: bool) {
        self.step_nodes(safety_output);
        self.step_arm();
    }

    /// Simulates one millisecond of the arm without drives, for a controller without a joint bus. The torques (N·m) act
    /// on the joints, and are limited to the maximum torques of the drives. Brakes are open, and drives and gripper do
    /// nothing. NaN counts as zero torque.
    pub fn step_free(&mut self, torque: &JointVec) {
        let ceiling = self.arm.parts().torque_ceiling;
        self.truth.torque = core::array::from_fn(|j| {
            let torque = if torque[j].is_nan() { 0.0 } else { torque[j] };
            torque.max(-ceiling[j]).min(ceiling[j])
        });
        self.arm.braked = [false; JOINTS];
        self.move_arm();
    }

    fn step_nodes(&mut self, safety_output: bool) {
        let wired = self.safety_wired && !safety_output;
        for (j, drive) in self.nodes.drives.iter_mut().enumerate() {
            let own = drive.fault.safety_line;
            drive.fault.safety_line |= wired;
            drive.tick(self.arm.motor[j], self.arm.q[j], self.arm.temperature[j]);
            drive.fault.safety_line = own;
        }
        if let Some(gripper) = &mut self.nodes.gripper {
            let own = gripper.safety_line;
            gripper.safety_line |= wired;
            gripper.tick();
            gripper.safety_line = own;
        }
    }

    fn step_arm(&mut self) {
        let enabled = |drive: &Drive| drive.state() == jtc_bus::NodeState::ENABLED;
        if self.stand && self.nodes.drives.iter().all(enabled) {
            self.stand = false;
        }
        for (j, drive) in self.nodes.drives.iter().enumerate() {
            self.truth.torque[j] = drive.torque();
            let supported = match self.support {
                Support::None => false,
                Support::Stand => self.stand,
                Support::Brakes => !enabled(drive),
            };
            self.arm.braked[j] = supported || self.stuck[j];
        }
        self.move_arm();
    }

    fn move_arm(&mut self) {
        self.truth.outside = core::array::from_fn(|j| self.push[j] + self.hand[j]);
        self.arm.step_pushed(&self.truth.torque, &self.truth.outside, TICK);
        self.read_truth();
        for (outside, wall) in self.truth.outside.iter_mut().zip(self.arm.wall_torque()) {
            *outside += wall;
        }
    }

    fn read_truth(&mut self) {
        self.truth.q = self.arm.q;
        self.truth.qd = self.arm.qd;
        self.truth.motor = self.arm.motor;
        self.truth.temperature = self.arm.temperature;
    }

    /// Applies the immediate effect of a node's fault when the fault begins. Ignores faults that have no immediate
    /// effect.
    pub fn begin(&mut self, kind: FaultKind) {
        match kind {
            FaultKind::NodeReboot { node } => match self.nodes.drives.get_mut(usize::from(node)) {
                Some(drive) => drive.reset(),
                None => {
                    if let Some(gripper) = &mut self.nodes.gripper {
                        gripper.reset();
                    }
                }
            },
            FaultKind::FaultState { joint } => self.nodes.drives[joint.index()].force_fault(),
            _ => {}
        }
    }

    /// Sets the current faults of the nodes and of the arm to the faults in `kinds`. Ignores faults of other devices.
    pub fn set_faults(&mut self, kinds: impl Iterator<Item = FaultKind>) {
        let mut drives = [DriveFault::default(); JOINTS];
        let (mut gripper_silent, mut gripper_line) = (false, false);
        let mut friction = [1.0; JOINTS];
        self.push = [0.0; JOINTS];
        self.stuck = [false; JOINTS];
        let (mut walls, mut carried) = (Vec::new(), Vec::new());
        for kind in kinds {
            walls.extend(kind.wall());
            match kind {
                FaultKind::NodeSilent { node } => match drives.get_mut(usize::from(node)) {
                    Some(drive) => drive.silent = true,
                    None => gripper_silent = true,
                },
                FaultKind::SafetyLine { node } => match drives.get_mut(usize::from(node)) {
                    Some(drive) => drive.safety_line = true,
                    None => gripper_line = true,
                },
                FaultKind::MotorFault { joint, bits } => drives[joint.index()].motor_control |= bits,
                FaultKind::HardwareFault { joint } => drives[joint.index()].hardware = true,
                FaultKind::EncoderJump { joint, rad } => drives[joint.index()].encoder_offset += rad,
                FaultKind::Push { joint, torque } => self.push[joint.index()] += torque,
                FaultKind::Payload { mass, com } => carried.push(Payload { mass, com, ..Payload::NONE }),
                FaultKind::BrakeClosed { joint } => self.stuck[joint.index()] = true,
                FaultKind::IgnoresState { joint } => drives[joint.index()].ignores_state = true,
                FaultKind::NotAccurate { joint } => drives[joint.index()].not_accurate = true,
                FaultKind::Friction { joint, factor } => friction[joint.index()] *= factor,
                FaultKind::Temperature { joint, celsius } => {
                    self.arm.temperature[joint.index()] = celsius;
                }
                _ => {}
            }
        }
        for (drive, fault) in self.nodes.drives.iter_mut().zip(drives) {
            drive.fault = fault;
        }
        if let Some(gripper) = &mut self.nodes.gripper {
            gripper.silent = gripper_silent;
            gripper.safety_line = gripper_line;
        }
        self.arm.set_walls(&walls);
        self.arm.set_carried(&carried);
        if self.arm.friction_fault != friction {
            self.arm.friction_fault = friction;
            self.arm.friction_changed();
        }
    }

    /// Returns the true state of the arm.
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    /// Returns the model of the true arm, which includes the model errors.
    pub fn true_model(&self) -> &ArmModel {
        &self.model
    }

    /// Returns the state bytes of the joints and the gripper (255 without a gripper).
    pub fn node_states(&self) -> [NodeState; NODES] {
        self.nodes.states()
    }

    /// Places a part under the gripper, or removes the part. At the start, a part is under the gripper.
    pub fn set_part_present(&mut self, present: bool) {
        if let Some(gripper) = &mut self.nodes.gripper {
            gripper.part_present = present;
        }
    }
}
