//! Values of the present parameters in the order of the frames, so that a host can read the parameters back (J-54).
use jtc_dynamics::Origin;

use super::{HostParameters, TABLE_FLOATS};
use crate::parameters::PidGains;

impl HostParameters {
    /// Returns value `i` of the gains, in the order of the wire format.
    pub(crate) fn pid_float(&self, i: usize) -> f64 {
        let PidGains { kp, ki, kd, int_min, int_max } = self.pid.get(i / 5).copied().unwrap_or_default();
        [kp, ki, kd, int_min, int_max].get(i % 5).copied().unwrap_or(0.0)
    }

    /// Returns value `i` of the model, in the order of the wire format.
    pub(crate) fn model_float(&self, i: usize) -> f64 {
        let of = |origin: &Origin, i: usize| origin.xyz.iter().chain(&origin.rpy).nth(i).copied();
        let number = match i.checked_sub(6 * self.model.joints.len()) {
            None => self.model.joints.get(i / 6).and_then(|origin| of(origin, i % 6)),
            Some(i) => self.model.links.get(i / 13).and_then(|link| match i % 13 {
                i @ 0..6 => of(&link.origin, i),
                12 => Some(link.mass),
                i => link.inertia.get(i - 6).copied(),
            }),
        };
        number.unwrap_or(0.0)
    }

    /// Returns value `i` of the friction parameters in use, in the order of the wire format.
    pub(crate) fn friction_float(&self, i: usize) -> f32 {
        if !self.friction_is_table {
            let coefficient = self.polynomial.get(i / 6).and_then(|joint| joint.iter().rev().nth(i % 6));
            return coefficient.map_or(0.0, |c| *c as f32);
        }
        let (joint, i) = (i / TABLE_FLOATS, i % TABLE_FLOATS);
        let number = self.tables.get(joint).and_then(|table| match i {
            0..20 => table.velocity.get(i),
            20..40 => table.temperature.get(i - 20),
            _ => table.torque.get((i - 40) / 20).and_then(|row| row.get((i - 40) % 20)),
        });
        number.copied().unwrap_or(0.0)
    }
}
