//! State of the seven nodes on the joint bus: reports, bring-up (J-20), errors (J-14, J-16), and the frame that each tick sends (J-12).
use jtc_bus::{Answer, JointReport, NodeState, Scale, warning};
use jtc_wire::{StopKind, can_flag};

use crate::commanded::Commanded;
use crate::config::Config;
use crate::io::Inputs;
use crate::{JOINTS, NODES};

mod bring_up;
mod measure;
mod node;
mod speed_check;
mod supervision;
#[cfg(test)]
mod tests;

use crate::bit_codec::bit_codec;
use measure::{Late, Outcome, Reading, Tick};
pub(crate) use node::{Goal, Node};
use speed_check::SpeedCheck;

/// Node number of the gripper.
pub(crate) const GRIPPER: usize = 6;
/// CAN flag of the gripper's receive timeout.
const GRIPPER_FLAG: u32 = can_flag::no_answer(GRIPPER);
/// Highest number of bus frames that the controller reads in one tick.
pub(crate) const FRAMES_MAX: usize = 32;

/// State of all nodes, and of the frames that the controller sends to the nodes.
#[derive(Clone, Debug)]
pub(crate) struct Nodes {
    nodes: [Node; NODES],
    /// Measured positions (rad) and velocities (rad/s) of the joints. All values are 0 until they are valid.
    position: [f64; JOINTS],
    velocity: [f64; JOINTS],
    gripper: bool,
    /// `true` if at least one joint is marked as absent (J-53).
    some_absent: bool,
    gripper_lost: bool,
    /// Number of ticks for which every joint has been slow enough to be enabled (J-16).
    still_ms: u16,
    /// Remaining number of ticks in which the drives must rest after the torque was switched off.
    rest_ms: u16,
    /// `true` if torque was requested in the last tick.
    powered: bool,
    /// Measured state of the gripper: its pump and its two pressure signals.
    pub pump: bool,
    pub pressure: [bool; 2],
    /// Number of frames that the controller has ignored (J-15).
    pub ignored: u32,
    /// Number of consecutive Moves without acknowledgement.
    unacknowledged: u8,
    sent_move: bool,
    /// Number of consecutive Moves since the controller has sent a frame other than Move.
    moves: u8,
    configured_last: bool,
    /// Check that compares the positions and speeds of the drives (J-35).
    speed_check: SpeedCheck,
    /// Mask of the joints whose encoders were found to disagree in this tick (J-35).
    misfits: u8,
}

bit_codec!(Nodes {
    nodes,
    position,
    velocity,
    gripper,
    some_absent,
    gripper_lost,
    still_ms,
    rest_ms,
    powered,
    pump,
    pressure,
    ignored,
    unacknowledged,
    sent_move,
    moves,
    configured_last,
    speed_check,
    misfits,
});

impl Nodes {
    /// Creates the nodes in their state at the start of the controller. The controller must reset each node once (J-20).
    pub(crate) fn new(config: &Config) -> Self {
        let mut node = Node::default();
        node.restart(config);
        node.reset = true;
        Self {
            nodes: [node; NODES],
            position: [0.0; JOINTS],
            velocity: [0.0; JOINTS],
            gripper: config.gripper,
            some_absent: config.absent.contains(&true),
            gripper_lost: false,
            still_ms: 0,
            rest_ms: 0,
            powered: false,
            pump: false,
            pressure: [false; 2],
            ignored: 0,
            unacknowledged: 0,
            sent_move: false,
            moves: 0,
            configured_last: false,
            speed_check: SpeedCheck::default(),
            misfits: 0,
        }
    }

    /// Sets the velocity that results from the answers of the last 5 ms, rad/s.
    #[cfg(test)]
    pub(crate) fn move_at(&mut self, joint: usize, velocity: f64) {
        self.nodes[joint].measured.move_at(velocity);
    }

    /// Returns nodes with every joint enabled at these positions (rad) and velocities (rad/s).
    #[cfg(test)]
    pub(crate) fn enabled_at(position: [f64; JOINTS], velocity: [f64; JOINTS]) -> Self {
        let mut nodes = Self::new(&Config::avena());
        for node in &mut nodes.nodes {
            *node = Node { seen: true, configured: true, valid: true, fresh: true, ..Node::default() };
            node.report.state = NodeState::ENABLED;
        }
        for (node, (position, velocity)) in nodes.nodes.iter_mut().zip(position.into_iter().zip(velocity)) {
            (node.report.position, node.report.velocity) = (position, velocity);
        }
        (nodes.position, nodes.velocity) = (position, velocity);
        nodes
    }

    /// Returns nodes like [`Self::enabled_at`], but the joint with this index is ready and not enabled.
    #[cfg(test)]
    pub(crate) fn with_torque_off(mut self, joint: usize) -> Self {
        self.nodes[joint].report.state = NodeState::READY;
        self
    }

    /// Returns the number of configured nodes, including the gripper if the arm has one.
    fn present(&self) -> usize {
        if self.gripper { NODES } else { JOINTS }
    }

    /// Returns the configured nodes.
    fn all(&self) -> &[Node] {
        if self.gripper { &self.nodes } else { &self.nodes[..JOINTS] }
    }

    fn joints(&self) -> &[Node] {
        &self.nodes[..JOINTS]
    }

    /// Returns the gripper, if the arm has one.
    fn gripper_node(&self) -> Option<&Node> {
        self.nodes.get(GRIPPER).filter(|_| self.gripper)
    }

    fn gripper_answers(&self, config: &Config) -> bool {
        self.gripper_node().is_some_and(|node| node.silent < config.missed_moves_max)
    }

    /// Returns `true` if the gripper is enabled and, according to the settings, keeps its workpiece when the arm loses its torque.
    pub(crate) fn gripper_keeps_part(&self, config: &Config) -> bool {
        !config.pump_off_on_error
            && self.gripper_node().is_some_and(|node| node.report.state == NodeState::ENABLED)
    }

    /// Returns `true` if the gripper left OperationEnable or lost its configuration in this tick. A pump that was commanded earlier does
    /// not start again without a new command (J-23).
    pub(crate) fn gripper_lost(&self) -> bool {
        self.gripper_lost
    }

    /// Returns the CAN flags of a gripper that does not answer. The status shows these flags, but the flags are not an error (J-14, J-23).
    pub(crate) fn gripper_flags(&self, config: &Config) -> u32 {
        if self.gripper && !self.gripper_answers(config) { GRIPPER_FLAG } else { 0 }
    }

    pub(crate) fn node(&self, n: usize) -> &Node {
        // The node index always comes from this crate and is valid. If the index were out of range, the function would return node 0 and
        // not panic.
        self.nodes.get(n).unwrap_or(&self.nodes[0])
    }

    /// Returns the measured positions, rad. While answers are missing, the positions are predicted (J-63). Positions that are not valid yet
    /// are 0.
    pub(crate) fn positions(&self) -> &[f64; JOINTS] {
        &self.position
    }

    /// Returns the positions if the positions of all joints are valid.
    pub(crate) fn known_positions(&self) -> Option<&[f64; JOINTS]> {
        (!self.fallen_back()).then_some(&self.position)
    }

    /// Returns a mask of the joints whose two encoders were found to disagree in this tick (J-35).
    pub(crate) fn misfits(&self) -> u8 {
        self.misfits
    }

    /// Returns the disagreement of the two encoders of a joint since its drive was configured (J-35). The second
    /// element is the size of an encoder jump (rad), or the ratio of the speed from the positions to the reported
    /// speed.
    pub(crate) fn misfit(&self, joint: usize) -> Option<(StopKind, f64)> {
        self.node(joint).measured.misfit()
    }

    /// Returns a mask of the joints whose two encoders disagree. A joint stays in this mask until its drive is configured again (J-35).
    pub(crate) fn untrusted(&self) -> u8 {
        (0..JOINTS).fold(0, |mask, j| mask | u8::from(self.misfit(j).is_some()) << j)
    }

    /// Returns the measured or predicted velocities, rad/s, like [`Self::positions`].
    pub(crate) fn velocities(&self) -> &[f64; JOINTS] {
        &self.velocity
    }

    /// Processes the frames that the bus has received since the last tick. `commanded` contains the set values of the last ticks.
    pub(crate) fn take(&mut self, inputs: &Inputs<'_>, config: &Config, goal: Goal, commanded: &Commanded) {
        // `answered` and `configured_before` are masks of nodes. If a node accepts its configuration in this tick, its
        // Move answer in this tick does not count. Its answer to the next Move comes in a later tick.
        let (mut answered, mut configured_before) = (0u8, 0u8);
        if self.some_absent {
            self.nodes.iter_mut().for_each(|node| node.unasked = None);
        }
        let gripper = &self.nodes[GRIPPER];
        let (gripper_state, gripper_configured) = (gripper.report.state, gripper.configured);
        for (n, node) in self.nodes.iter_mut().enumerate() {
            (node.misbehaved, node.answers) = (false, 0);
            node.deaf_left = node.deaf_left.saturating_sub(1);
            configured_before |= u8::from(node.configured) << n;
        }
        let scale = Scale { velocity: config.velocity_full_scale };
        for frame in inputs.bus.iter().take(FRAMES_MAX) {
            match Answer::parse(frame, scale) {
                Ok(Answer::Joint { node, report }) => {
                    self.report(node.into(), &report, configured_before, &mut answered)
                }
                Ok(Answer::Gripper(g)) => {
                    (self.pump, self.pressure) = (g.pump, [g.pressure1, g.pressure2]);
                    let report = JointReport {
                        state: g.state,
                        errors: g.errors,
                        warnings: g.warnings,
                        ..JointReport::default()
                    };
                    self.report(GRIPPER, &report, configured_before, &mut answered);
                }
                Ok(Answer::Mode { node, accepted }) => {
                    if let Some(node) =
                        self.nodes.get_mut(usize::from(node)).filter(|node| node.deaf_left == 0)
                    {
                        node.configured |= accepted;
                        node.refused = !accepted;
                    }
                }
                // Depending on the drive, the state in this answer is the state before or after the change. Therefore the controller takes
                // the state of a node only from Move answers.
                Ok(Answer::State { .. }) => {}
                Err(_) => self.ignored = self.ignored.saturating_add(1),
            }
        }
        let torque_taken = core::mem::replace(&mut self.powered, goal == Goal::Enabled) && !self.powered;
        self.rest_ms = if torque_taken { config.enable_rest_ms } else { self.rest_ms.saturating_sub(1) };
        let usable = self.measure(inputs, answered, commanded, config);
        self.count_missing(inputs, config, answered, usable);
        let gripper = &self.nodes[GRIPPER];
        self.gripper_lost = (gripper_state == NodeState::ENABLED
            && gripper.report.state != NodeState::ENABLED)
            || (gripper_configured && !gripper.configured);
        self.watch(config, goal);
        if self.some_absent {
            self.stand_in(config);
        }
    }

    /// Replaces the state of absent joints by a fixed state, and detects drives of absent joints that still answer (J-53).
    #[inline(never)]
    fn stand_in(&mut self, config: &Config) {
        for (j, node) in self.nodes.iter_mut().take(JOINTS).enumerate() {
            if config.absent[j] {
                node.stand_in();
                (self.position[j], self.velocity[j]) = (config.absent_position[j], 0.0);
            }
        }
    }

    fn report(&mut self, n: usize, report: &JointReport, configured_before: u8, answered: &mut u8) {
        let Some(node) = self.nodes.get_mut(n) else { return };
        if node.deaf_left > 0 {
            node.unasked = Some(report.state);
            return;
        }
        node.answers = node.answers.wrapping_add(1);
        *answered |= 1 << n;
        let before = node.report.state;
        if node.report.warnings & warning::POSITION_NOT_ACCURATE != 0 {
            // A position that becomes accurate can jump by any distance, so the earlier measurements are discarded.
            node.measured.forget();
        }
        node.report = *report;
        node.seen = true;
        if node.starting() {
            if !before.is_starting() || report.state == NodeState::START {
                // The node has changed back to Start or Init, so it has lost its configuration and must accept a configuration again.
                node.lose_configuration();
            }
            if report.state != NodeState::START_TO_INIT {
                node.clear = false;
            }
        }
        if node.configured && configured_before & (1 << n) != 0 {
            node.valid = true;
        }
    }

    /// Sets the `commanded` velocities (rad/s) as the reference for predictions of the joints in `found`. The set
    /// values of these joints were restarted. Such a restart is not a motion of the joint, so it must not affect the
    /// predictions (J-63).
    pub(crate) fn go_on_moving(&mut self, found: &[bool; JOINTS], commanded: &[f64; JOINTS]) {
        for ((node, found), commanded) in self.nodes.iter_mut().zip(found).zip(commanded) {
            if *found {
                node.measured.go_on_moving(*commanded);
            }
        }
    }

    /// Updates positions and velocities from the nodes that `answered`. Returns the nodes whose answers are usable.
    fn measure(&mut self, inputs: &Inputs<'_>, answered: u8, commanded: &Commanded, config: &Config) -> u8 {
        let elapsed_ms = 1 + u32::from(inputs.missed_ticks);
        let asked = self.sent_move && inputs.bus_state.acknowledged;
        let velocity = commanded.due_velocity(config);
        let (mut usable, mut still) = (answered, true);
        self.misfits = 0;
        for (j, node) in self.nodes.iter_mut().take(JOINTS).enumerate() {
            let position = node.report.position - node.measured.taken_off();
            let reading = Reading { position, velocity: node.report.velocity };
            let tick = Tick {
                answer: (answered & (1 << j) != 0).then_some(reading),
                expected: self.sent_move,
                answers: node.answers,
                asked,
                commanded: velocity[j],
                elapsed_ms,
                velocity_max: config.joints[j].velocity_max,
                enabled: node.report.state == NodeState::ENABLED,
                joint: j,
            };
            let past = |ticks| Late::new(ticks, j, commanded, config);
            if node.valid {
                match node.measured.step(&tick, past, config) {
                    Outcome::Used => {}
                    Outcome::Predicted => usable &= !(1 << j),
                    Outcome::Jumped => self.misfits |= 1 << j,
                }
            }
            node.fresh = usable & (1 << j) != 0;
            let Reading { position, velocity } = node.measured.used();
            (self.position[j], self.velocity[j]) = (position, velocity);
            still &= node.valid && node.measured.speed() < config.enable_speed_max;
        }
        self.misfits |= self.speed_check.step(&mut self.nodes, config);
        self.still_ms = if still { self.still_ms.saturating_add(1) } else { 0 };
        usable
    }

    /// Returns `true` if joints may be enabled, because the arm is slow enough and the drives have rested (J-16).
    fn may_enable(&self, config: &Config) -> bool {
        self.still_ms >= config.enable_still_ms && self.rest_ms == 0
    }

    /// Returns the node init word of the status. Bit n is set while node n is not initialised. The bit of the gripper is also set if the
    /// gripper does not answer.
    pub(crate) fn init_word(&self, config: &Config) -> u8 {
        let mut word = 0;
        for (n, node) in self.all().iter().enumerate() {
            let accurate = n == GRIPPER || node.report.warnings & warning::POSITION_NOT_ACCURATE == 0;
            let answers = n != GRIPPER || self.gripper_answers(config);
            if node.fallen_back() || !accurate || !answers {
                word |= 1 << n;
            }
        }
        word
    }

    /// Returns `true` if a joint has lost its configuration or changed back to Start or Init (J-20).
    pub(crate) fn fallen_back(&self) -> bool {
        self.joints().iter().any(Node::fallen_back)
    }

    /// Returns `true` when Init is completed: every node is initialised and reports ReadyToOperate. A gripper that keeps its workpiece
    /// stays enabled instead.
    pub(crate) fn all_ready(&self, config: &Config) -> bool {
        let ready = |node: &Node| node.report.state == NodeState::READY;
        self.init_word(config) == 0
            && self.joints().iter().all(ready)
            && (self.gripper_keeps_part(config) || self.gripper_node().is_none_or(ready))
    }

    /// Executes ClearCurrentErrors for the nodes in `mask`. The controller requests Init from each node with an error
    /// until this node reports Init. Returns `true` if any node has an error to clear.
    ///
    /// The request for Init switches the torque off. Therefore errors that exist only in the word of occurred errors
    /// are cleared only while the torque is off.
    pub(crate) fn clear(&mut self, mask: u8, torque_off: bool) -> bool {
        let present = self.present();
        let mut any = false;
        for (n, node) in self.nodes.iter_mut().enumerate().take(present) {
            let joint = n < JOINTS;
            let to_clear = node.faulty() || (torque_off && joint && node.report.mc_occurred != 0);
            let ordered = mask & (1 << n) != 0 && to_clear;
            node.clear |= ordered;
            any |= ordered;
        }
        any
    }

    /// Executes ResetCanDevices for the nodes in `mask` (J-23).
    pub(crate) fn reset(&mut self, mask: u8) {
        let present = self.present();
        for (n, node) in self.nodes.iter_mut().enumerate().take(present) {
            node.reset |= mask & (1 << n) != 0 && !node.absent;
        }
    }
}

impl Nodes {
    /// Applies new settings, in a state without torque. Returns `true` if the changed settings must be sent to the nodes. The controller
    /// then configures these nodes again.
    pub(crate) fn use_settings(&mut self, config: &Config, before: &Config) -> bool {
        self.gripper = config.gripper;
        self.some_absent = config.absent.contains(&true);
        for (j, node) in self.nodes.iter_mut().take(JOINTS).enumerate() {
            if config.absent[j] {
                if !before.absent[j] {
                    *node = Node::default();
                }
                node.stand_in();
                (self.position[j], self.velocity[j]) = (config.absent_position[j], 0.0);
            } else if before.absent[j] {
                // A joint that was absent before is brought up like any other joint.
                node.restart(config);
            }
        }
        // A new velocity scale can end a disagreement between the positions and the reported speeds. The nodes are
        // therefore configured again, which clears the record of a disagreement.
        let bits = |config: &Config| {
            let Config { joint_config_bits, gripper_config_bits, gripper, velocity_full_scale, .. } = *config;
            (joint_config_bits, gripper_config_bits, gripper, velocity_full_scale)
        };
        let changed = bits(config) != bits(before);
        if changed {
            for node in &mut self.nodes {
                node.lose_configuration();
            }
        }
        changed
    }
}
