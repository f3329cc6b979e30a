//! Bumpless transfer: blends out torque steps at a change of state, at a change of the model, and at enabling (J-25, J-44).
use super::torque::JointTorque;
use crate::JOINTS;
use crate::bit_codec::{BitCodec, BitSink, BitSource, bit_codec};
use crate::config::Config;
use crate::interpolation::smooth;
use crate::nodes::Nodes;

/// Time in which the torque of a joint that begins to yield falls to its new value, ms.
const FALL_MS: u16 = 10;

/// Parts of the last torque that the next torque must continue without a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Continued {
    /// All parts of the torque except the model torque, which changes at once.
    Correction,
    /// All parts of the torque, including the model torque.
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

/// Values of the last torque that the next torque must continue, if any.
pub(super) type Before = Option<(Continued, [f64; JOINTS])>;

/// Torque steps that are being blended out.
#[derive(Clone, Debug, Default)]
pub(super) struct Transfer {
    /// Torque step that is being blended out, N·m. `step_ms` is the time since its start, ms.
    step: [f64; JOINTS],
    step_ms: [u16; JOINTS],
    /// `true` if the step is blended out within [`FALL_MS`].
    falls: [bool; JOINTS],
    /// Time left until all steps are blended out, ms.
    left_ms: u16,
    /// `true` for each joint that yields from this tick on. The torque of these joints falls within [`FALL_MS`].
    yields: [bool; JOINTS],
    /// `true` for each joint that was latched in this tick. The torque of these joints begins at the torque of the model.
    just_enabled: [bool; JOINTS],
    /// Parts of the last torque that the next torque must continue.
    next: Option<Continued>,
}

bit_codec!(Transfer { step, step_ms, falls, left_ms, yields, just_enabled, next });

impl BitCodec for Continued {
    fn write<S: BitSink>(&self, to: &mut S) {
        (*self == Self::Everything).write(to);
    }

    fn read<S: BitSource>(from: &mut S) -> Self {
        if bool::read(from) { Self::Everything } else { Self::Correction }
    }
}

impl Transfer {
    /// Prepares a change of the control mode. Only the model torque changes at once.
    pub(super) fn change_mode(&mut self) {
        // A change of the model in the same tick has priority, because it requires that the whole torque continues
        // without a step.
        self.next.get_or_insert(Continued::Correction);
    }

    /// Prepares a change of the model. The whole torque continues without a step.
    pub(super) fn change_model(&mut self) {
        self.next = Some(Continued::Everything);
    }

    /// Prepares the yield of a joint from the next tick on. Only the model torque changes at once. If the new torque
    /// is lower, the torque falls to it within [`FALL_MS`] (J-68).
    #[inline(always)]
    pub(super) fn begin_yield(&mut self, joint: usize) {
        self.next.get_or_insert(Continued::Correction);
        self.yields[joint] = true;
    }

    /// Sets the joints that were latched in this tick.
    pub(super) fn set_just_enabled(&mut self, just_enabled: [bool; JOINTS]) {
        self.just_enabled = just_enabled;
    }

    /// Prepares the computation of the next torque. Returns the values of the last torque that the next torque must continue, if any.
    pub(super) fn begin(&mut self, last: &[JointTorque; JOINTS]) -> Before {
        self.next.take().map(|continued| (continued, core::array::from_fn(|j| continued.of(&last[j]))))
    }

    /// Adds the remainder of the torque steps to `torque`, and clears the torque of joints that are not enabled.
    #[inline(always)]
    pub(super) fn blend(
        &mut self,
        before: Before,
        torque: &mut [JointTorque; JOINTS],
        nodes: &Nodes,
        config: &Config,
    ) {
        if let Some((continued, before)) = before {
            for j in 0..JOINTS {
                let step = before[j] - continued.of(&torque[j]);
                // A torque that already falls continues to fall when another joint begins to yield.
                let falling = self.falls[j] && self.step_ms[j] < FALL_MS;
                let yields = core::mem::take(&mut self.yields[j]) || falling;
                let falls = yields && step * before[j] > 0.0;
                self.begin_step(j, step, falls, config);
            }
        }
        if self.just_enabled.contains(&true) {
            for j in 0..JOINTS {
                if core::mem::take(&mut self.just_enabled[j]) {
                    self.begin_step(j, -torque[j].correction(), false, config);
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

    /// Begins to blend out a torque step of a joint.
    fn begin_step(&mut self, j: usize, step: f64, falls: bool, config: &Config) {
        (self.step[j], self.step_ms[j], self.falls[j]) = (step, 0, falls);
        self.left_ms = config.blend_ms.max(FALL_MS);
    }

    /// Adds the remainder of the torque steps in this tick.
    fn blend_steps(&mut self, torque: &mut [JointTorque; JOINTS], config: &Config) {
        for j in 0..JOINTS {
            let length_ms = if self.falls[j] { FALL_MS } else { config.blend_ms };
            let left = 1.0 - smooth(f64::from(self.step_ms[j]) / f64::from(length_ms.max(1)));
            self.step_ms[j] = self.step_ms[j].saturating_add(1);
            torque[j].blend = self.step[j] * left;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Executes one tick in which the next torque is zero, and returns the remaining torque steps of the joints. `last`
    /// is the torque of the tick before. This torque matters only in the first tick after a change of state.
    fn blended(transfer: &mut Transfer, last: f64) -> [f64; JOINTS] {
        let nodes = Nodes::enabled_at([0.0; JOINTS], [0.0; JOINTS]);
        let before = transfer.begin(&[JointTorque { friction: last, ..JointTorque::default() }; JOINTS]);
        let mut torque = [JointTorque::default(); JOINTS];
        transfer.blend(before, &mut torque, &nodes, &Config::avena());
        torque.map(|torque| torque.blend)
    }

    /// If the model and the control mode change in the same tick, no torque has a step, in either order of the changes.
    #[test]
    fn j44_a_change_of_the_mode_does_not_cancel_a_change_of_the_model() {
        let changes: [fn(&mut Transfer); 2] = [Transfer::change_model, Transfer::change_mode];
        for order in [[0, 1], [1, 0]] {
            let mut transfer = Transfer::default();
            order.iter().for_each(|&i| changes[i](&mut transfer));
            let last = [JointTorque { model: 5.0, ..JointTorque::default() }; JOINTS];
            let before = transfer.begin(&last);
            let mut torque = [JointTorque::default(); JOINTS];
            let nodes = Nodes::enabled_at([0.0; JOINTS], [0.0; JOINTS]);
            transfer.blend(before, &mut torque, &nodes, &Config::avena());
            assert_eq!(torque.map(|torque| torque.blend), [5.0; JOINTS], "{order:?}");
        }
    }

    /// The torque of a joint that begins to yield must fall. The part above the new torque fades to zero within 10
    /// ms. The torque of the other joints is blended out as at any other change of state. No joint has a torque step.
    #[test]
    fn j44_j68_the_torque_of_a_joint_that_begins_to_yield_falls_within_10_ms() {
        let mut transfer = Transfer::default();
        transfer.begin_yield(2);
        let mut last = blended(&mut transfer, 5.0);
        assert_eq!(last, [5.0; JOINTS]);
        for ms in 1..=10 {
            let now = blended(&mut transfer, 0.0);
            assert!((0..JOINTS).all(|j| now[j] <= last[j]) && now[2] < last[2], "{ms}: {now:?}");
            last = now;
        }
        assert!(last[2] == 0.0 && last[0] > 4.5, "{last:?}");
    }

    /// Returns the blended torque of a tick in which the correction of every joint changes from `last` to `now`, N·m.
    fn changed(transfer: &mut Transfer, last: f64, now: f64) -> [f64; JOINTS] {
        let nodes = Nodes::enabled_at([0.0; JOINTS], [0.0; JOINTS]);
        let before = transfer.begin(&[JointTorque { friction: last, ..JointTorque::default() }; JOINTS]);
        let mut torque = [JointTorque { friction: now, ..JointTorque::default() }; JOINTS];
        transfer.blend(before, &mut torque, &nodes, &Config::avena());
        torque.map(|torque| torque.blend)
    }

    /// Executes 10 more ticks. Returns the blended torque of the last tick.
    fn after_10_ms(transfer: &mut Transfer) -> [f64; JOINTS] {
        (0..10).map(|_| blended(transfer, 0.0)).last().unwrap_or_default()
    }

    /// The torques change again `ms` after joint 3 has begun to yield. If the torque of joint 3 is still falling at
    /// this time, it reaches its new value within the next 10 ms. If this torque does not fall any more, it is blended
    /// out like that of the other joints. After 10 of 100 ms, 1 - 3 · 0.1² + 2 · 0.1³ = 0.972 of the step is left.
    #[test]
    fn j44_j68_a_torque_that_falls_goes_on_falling_when_another_joint_yields() {
        for (ms, falls) in [(1, true), (5, true), (9, true), (10, false), (15, false)] {
            let mut transfer = Transfer::default();
            transfer.begin_yield(2);
            (0..ms).for_each(|k| {
                blended(&mut transfer, if k == 0 { 5.0 } else { 0.0 });
            });
            transfer.begin_yield(4);
            assert_eq!(blended(&mut transfer, 4.0), [4.0; JOINTS], "{ms} ms");
            let left = after_10_ms(&mut transfer);
            for j in 0..JOINTS {
                let expected = if j == 4 || (j == 2 && falls) { 0.0 } else { 4.0 * 0.972 };
                assert!((left[j] - expected).abs() < 1e-9, "{ms} ms, joint {}: {}", j + 1, left[j]);
            }
        }
    }

    /// Only an excess torque falls within 10 ms. If the torque of a yielding joint rises, or begins at zero, it is blended as usual.
    #[test]
    fn j44_j68_only_an_excess_torque_falls_fast() {
        for (last, now, step, falls) in [
            (5.0, 2.0, 3.0, true),
            (-5.0, -2.0, -3.0, true),
            (5.0, -2.0, 7.0, true),
            (2.0, 5.0, -3.0, false),
            (-2.0, -5.0, 3.0, false),
            (0.0, -5.0, 5.0, false),
            (0.0, 5.0, -5.0, false),
        ] {
            let mut transfer = Transfer::default();
            transfer.begin_yield(2);
            assert_eq!(changed(&mut transfer, last, now), [step; JOINTS], "{last} {now}");
            let left = after_10_ms(&mut transfer)[2];
            let expected = if falls { 0.0 } else { 0.972 * step };
            assert!((left - expected).abs() < 1e-9, "{last} {now}: {left}");
        }
    }

    /// The torque of a joint that was just enabled begins at the torque of the model, and its other torques of 5 N·m
    /// are blended in. The torques of the other joints are not affected.
    #[test]
    fn j16_j44_only_the_joint_that_was_just_enabled_begins_at_the_torque_of_the_model() {
        let mut transfer = Transfer::default();
        transfer.set_just_enabled(core::array::from_fn(|j| j == 3));
        for ms in 0..100 {
            let blend = changed(&mut transfer, 5.0, 5.0);
            let u = f64::from(ms) / 100.0;
            let expected = -5.0 * (1.0 - u * u * (3.0 - 2.0 * u));
            for j in 0..JOINTS {
                let expected = if j == 3 { expected } else { 0.0 };
                assert!((blend[j] - expected).abs() < 1e-9, "{ms} ms, joint {}: {}", j + 1, blend[j]);
            }
        }
        assert_eq!(transfer.left_ms, 0, "after `blend_ms`, no step is left");
    }
}
