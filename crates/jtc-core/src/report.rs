//! Reports of the controller: the telemetry of a tick, and the JtcStatus frame (section 2).
use jtc_wire::{GripperStatus, JointStatus, RawPoint, Response, Status};

use crate::JOINTS;
use crate::controller::Controller;
use crate::nodes::GRIPPER;
use crate::telemetry::{JointTelemetry, Observed, Telemetry};

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    pub(crate) fn observe(&mut self, torque: &[f64; JOINTS]) {
        self.observed = Observed { tick: self.observed.tick + 1, torque: *torque };
    }

    /// Returns the values that the last tick computed. The tick does not collect all these values, because a board needs only a few of
    /// them.
    #[inline]
    pub fn telemetry(&self) -> Telemetry {
        Telemetry {
            tick: self.observed.tick,
            state: self.state,
            trajectory: self.trajectory,
            point: self.point(),
            braking: self.braking_ms.is_some(),
            errors: self.errors.word(),
            records_lost: self.records.lost(),
            joints: core::array::from_fn(|j| self.joint_telemetry(j)),
        }
    }

    /// Returns the index of the present point of the trajectory, counted as if the points were 1 ms apart.
    fn point(&self) -> u32 {
        self.clock.time as u32
    }

    #[inline]
    fn joint_telemetry(&self, j: usize) -> JointTelemetry {
        let (set, parts, node) = (&self.motion.set.point, &self.motion.law.torque[j], self.nodes.node(j));
        JointTelemetry {
            set_position: set.position[j],
            set_velocity: set.velocity[j],
            set_acceleration: set.acceleration[j],
            due_position: self.motion.set.due(&self.config)[j],
            position: self.nodes.positions()[j],
            velocity: self.nodes.velocities()[j],
            fresh: node.fresh(),
            temperature: f64::from(node.report.temperature),
            torque_model: parts.model,
            torque_p: parts.pid.p,
            torque_i: parts.pid.i,
            torque_d: parts.pid.d,
            torque_friction: parts.friction,
            torque_other: parts.load + parts.brake + parts.blend,
            torque: self.observed.torque[j],
            state: node.state(),
            internal: self.errors.joint(j).0,
        }
    }

    /// Returns `true` if a JtcStatus is due. If a response record waits, a status is due at once. Without a waiting record, a status is due
    /// once per period (J-04).
    pub(crate) fn status_due(&mut self, free: bool) -> bool {
        self.since_status_ms = self.since_status_ms.saturating_add(1);
        // The function computes `wanted` also while the line is busy, because every tick must do the same work.
        let wanted = !self.records.is_empty() | (self.since_status_ms >= self.config.status_period_ms);
        let due = wanted && free;
        if due {
            self.since_status_ms = 0;
        }
        due
    }

    /// Returns the status that a JtcStatus would report now, without a response record.
    pub fn current_status(&self) -> Status {
        self.status(Response::NONE)
    }

    pub(crate) fn status(&self, response: Response) -> Status {
        let (can_current, can_occurred) = self.errors.can();
        let (q, v) = (self.nodes.positions(), self.nodes.velocities());
        let joints = core::array::from_fn(|j| {
            let (report, state) = (&self.nodes.node(j).report, self.nodes.node(j).state());
            let (internal, internal_occurred) = self.errors.joint(j);
            JointStatus {
                state,
                mc_current: report.mc_current,
                mc_occurred: report.mc_occurred,
                errors: report.errors,
                warnings: report.warnings,
                internal,
                internal_occurred,
                position: q[j] as f32,
                velocity: v[j] as f32,
                torque: (report.torque / self.config.joints[j].torque_gain) as f32,
                temperature: report.temperature,
            }
        });
        let gripper = &self.nodes.node(GRIPPER).report;
        Status {
            response,
            state: self.state.into(),
            errors: self.errors.word(),
            occurred: self.errors.occurred(),
            jtc_init: self.parameters.missing(),
            node_init: self.nodes.init_word(&self.config),
            trajectory: self.trajectory.into(),
            point: self.point(),
            friction_type: u8::from(self.parameters.friction_is_table),
            can_error: u8::from(self.errors.can_error()),
            can_current,
            can_occurred,
            joints,
            gripper: Some(GripperStatus {
                state: gripper.state,
                pump: u8::from(self.nodes.pump),
                pressure1: u8::from(self.nodes.pressure[0]),
                pressure2: u8::from(self.nodes.pressure[1]),
                errors: gripper.errors,
                warnings: gripper.warnings,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use jtc_bus::{Answer, JointReport, NodeState, Scale};

    use super::*;
    use crate::Config;
    use crate::io::Inputs;
    use crate::motion::{JointTorque, PidTorque};
    use crate::nodes::Nodes;

    #[test]
    fn j40_j41_j42_telemetry_tells_every_part_of_a_torque() {
        let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
        controller.motion.law.torque[2] = JointTorque {
            model: 1.0,
            pid: PidTorque { p: 2.0, i: 4.0, d: 8.0 },
            friction: 16.0,
            load: 32.0,
            brake: 64.0,
            blend: 128.0,
        };
        controller.observe(&[0.0, 0.0, 250.0, 0.0, 0.0, 0.0]);
        let joint = controller.telemetry().joints[2];
        assert_eq!((joint.torque_model, joint.torque_friction, joint.torque_other), (1.0, 16.0, 224.0));
        assert_eq!((joint.torque_p, joint.torque_i, joint.torque_d, joint.torque), (2.0, 4.0, 8.0, 250.0));
    }

    #[test]
    fn j20_the_current_status_reports_the_state_and_the_missing_parameters() {
        let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
        controller.tick(&Inputs::QUIET);
        let status = controller.current_status();
        assert_eq!((status.response, status.state), (Response::NONE, controller.state.into()));
        assert_eq!((status.jtc_init, status.node_init), (7, 0x7F), "nothing was received");
    }

    /// The drive reports 12 N·m. With a torque gain of 1.5, the torque of the joint is 12/1.5 N·m. The bus rounds to 0.011 N·m.
    #[test]
    fn j61_the_status_contains_the_torque_of_the_joint() {
        let mut controller = Controller::new(Config::avena(), [RawPoint::default(); 4]);
        controller.config.joints[2].torque_gain = 1.5;
        controller.nodes = Nodes::enabled_at([0.0; JOINTS], [0.0; JOINTS]);
        let report = JointReport { torque: 12.0, state: NodeState::READY, ..JointReport::default() };
        let scale = Scale { velocity: controller.config.velocity_full_scale };
        let bus = [Answer::Joint { node: 2, report }.emit(scale)];
        controller.tick(&Inputs { bus: &bus, ..Inputs::QUIET });
        let torque = controller.current_status().joints[2].torque;
        assert!((torque - 8.0).abs() < 0.02, "{torque}");
    }
}
