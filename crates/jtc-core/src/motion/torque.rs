//! Parts of the torque of one joint.
use crate::bit_codec::bit_codec;
use crate::motion::pid::PidTorque;

/// Parts of one joint's torque, N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct JointTorque {
    pub model: f64,
    pub pid: PidTorque,
    pub friction: f64,
    /// Torque for the load that Teaching holds.
    pub load: f64,
    /// Braking torque of Teaching.
    pub brake: f64,
    /// Remainder of a torque step that the controller is blending out.
    pub blend: f64,
}

bit_codec!(JointTorque { model, pid, friction, load, brake, blend });

impl JointTorque {
    /// Returns the sum of all parts of the torque except the model.
    pub(crate) fn correction(&self) -> f64 {
        // Two partial sums have a shorter latency in the processor than one long sum.
        (self.pid.sum() + self.friction) + (self.load + self.brake + self.blend)
    }

    pub(crate) fn sum(&self) -> f64 {
        self.model + self.correction()
    }
}
