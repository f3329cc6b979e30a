//! Bumpless transfer: torque steps at a change of state, of the model or at enabling are blended out (J-25, J-44).
use super::torque::JointTorque;
use crate::JOINTS;
use crate::config::Config;
use crate::interpolation::smooth;
use crate::nodes::Nodes;
use crate::remembered::{BitSink, BitSource, Remembered, remembered};

/// Which part of the last torque the next one continues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Continued {
    /// All but the model.
    Correction,
    /// All of it.
    Everything,
}

impl Continued {
    fn of(self, torque: &JointTorque) -> f64 {
        match self {
            Self::Correction => torque.correction(),
            Self::Everything => torque.sum(),
        }
    }
}

/// The last torque where the next one has to continue it.
pub(super) type Before = Option<(Continued, [f64; JOINTS])>;

/// Steps that are being blended out.
#[derive(Clone, Debug, Default)]
pub(super) struct Transfer {
    /// Step to blend out, N·m, and how long that has gone on.
    step: [f64; JOINTS],
    step_ms: [u16; JOINTS],
    /// Time left until nothing is left of any of them, ms.
    left_ms: u16,
    /// Joints that were latched in this tick: their torque starts from that of the model.
    just_enabled: [bool; JOINTS],
    /// The next torque has to continue the last one.
    next: Option<Continued>,
}

remembered!(Transfer { step, step_ms, left_ms, just_enabled, next });

impl Remembered for Continued {
    fn write<S: BitSink>(&self, to: &mut S) {
        (*self == Self::Everything).write(to);
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        if bool::read(from) { Self::Everything } else { Self::Correction }
    }
}

impl Transfer {
    /// The control mode changes: no step but that of the model.
    pub fn change_mode(&mut self) {
        self.next = Some(Continued::Correction);
    }

    /// The model changes: no step at all.
    pub fn change_model(&mut self) {
        self.next = Some(Continued::Everything);
    }

    /// Nothing of the last torque is continued.
    pub fn let_go(&mut self) {
        (self.next, self.step) = (None, [0.0; JOINTS]);
    }

    /// Joints that were latched in this tick.
    pub fn set_just_enabled(&mut self, just_enabled: [bool; JOINTS]) {
        self.just_enabled = just_enabled;
    }

    /// Before the torque is computed anew: what of the last one it has to continue, if anything.
    pub fn begin(&mut self, last: &[JointTorque; JOINTS]) -> Before {
        self.next.take().map(|continued| (continued, core::array::from_fn(|j| continued.of(&last[j]))))
    }

    /// Adds what is left of the steps to `torque`, and clears that of joints that are not enabled.
    pub fn blend(
        &mut self,
        before: Before,
        torque: &mut [JointTorque; JOINTS],
        nodes: &Nodes,
        config: &Config,
    ) {
        if let Some((continued, before)) = before {
            for j in 0..JOINTS {
                self.begin_step(j, before[j] - continued.of(&torque[j]), config);
            }
        }
        if self.just_enabled.contains(&true) {
            for j in 0..JOINTS {
                if core::mem::take(&mut self.just_enabled[j]) {
                    self.begin_step(j, -torque[j].correction(), config);
                }
            }
        }
        if self.left_ms > 0 {
            self.left_ms -= 1;
            self.blend_steps(torque, config);
        }
        for (j, torque) in torque.iter_mut().enumerate() {
            if !nodes.node(j).enabled() {
                *torque = JointTorque::default();
                self.step[j] = 0.0;
            }
        }
    }

    /// A step of a joint is to be blended out from now on.
    fn begin_step(&mut self, j: usize, step: f64, config: &Config) {
        (self.step[j], self.step_ms[j]) = (step, 0);
        self.left_ms = config.blend_ms.max(1);
    }

    /// Adds what is left of the steps in this tick.
    fn blend_steps(&mut self, torque: &mut [JointTorque; JOINTS], config: &Config) {
        let per_tick = 1.0 / f64::from(config.blend_ms.max(1));
        for j in 0..JOINTS {
            let left = 1.0 - smooth(f64::from(self.step_ms[j]) * per_tick);
            self.step_ms[j] = self.step_ms[j].saturating_add(1);
            torque[j].blend = self.step[j] * left;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is blended out in a tick after a change of state in which the last torque was `last`.
    fn blended(transfer: &mut Transfer, last: f64) -> [f64; JOINTS] {
        let nodes = Nodes::enabled_at([0.0; JOINTS], [0.0; JOINTS]);
        let before = transfer.begin(&[JointTorque { friction: last, ..JointTorque::default() }; JOINTS]);
        let mut torque = [JointTorque::default(); JOINTS];
        transfer.blend(before, &mut torque, &nodes, &Config::avena());
        torque.map(|torque| torque.blend)
    }

    #[test]
    fn j44_j66_an_arm_that_gives_way_continues_nothing_of_its_torque() {
        for lets_go in [false, true] {
            let mut transfer = Transfer::default();
            transfer.change_mode();
            if lets_go {
                transfer.let_go();
            }
            assert_eq!(blended(&mut transfer, 5.0), [if lets_go { 0.0 } else { 5.0 }; JOINTS]);
            // Nor of a step that is being blended out.
            let mut transfer = Transfer::default();
            transfer.change_mode();
            assert_eq!(blended(&mut transfer, 5.0), [5.0; JOINTS]);
            if lets_go {
                transfer.let_go();
            }
            assert_eq!(blended(&mut transfer, 5.0) == [0.0; JOINTS], lets_go);
        }
    }
}
