//! Check that the positions and the speed that a drive reports agree (J-35).
//!
//! Positions and speed come from two encoders, so each encoder reveals a fault of the other encoder. If the configured full scale is wrong,
//! all speeds are wrong by the same factor. The position of a slipping encoder changes while the motor is at rest. The position of an
//! encoder that has stopped is constant while the motor moves.
use super::measure::Ways;
use super::node::Node;
use crate::JOINTS;
use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::config::limits::JointConfig;

/// Number of ticks between two checks of the same joint. Each tick checks at most one joint.
const PERIOD: u8 = 10;
/// Number of consecutive checks of a joint that must show a difference in the same direction before the fault is reported.
const LOOKS: u8 = 5;
/// Lowest sum of the differences that counts as a fault, as a multiple of the largest gear twist. A twist of the gear
/// by a hand or a wall stays below this sum.
const TWISTS: f64 = 2.0;
/// Ratio of the two distances above which the encoder with the shorter distance is considered to be at rest.
const STANDS: f32 = 10.0;

/// Differences between the position and the speed of a joint in its last checks.
#[derive(Clone, Copy, Debug, Default)]
struct Differs {
    looks: u8,
    /// Sum of the position changes in the windows of the last checks, rad.
    measured: f32,
    /// Sum of the distances that correspond to the reported speeds, rad.
    reported: f32,
}

/// State of the check that compares the two encoders of each joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SpeedCheck {
    /// Index of the joint that is checked next.
    turn: u8,
    differs: [Differs; JOINTS],
    /// Reported torque at the last check, N·m.
    torque: [f32; JOINTS],
}

bit_codec!(Differs { looks, measured, reported });
bit_codec!(SpeedCheck { turn, differs, torque });

impl SpeedCheck {
    /// Executes one tick of the check. Returns a mask with the joint whose reported speed does not have the configured scale. If only one
    /// encoder of a joint moves, the node of the joint is marked as misbehaved.
    #[inline(always)]
    pub(super) fn step(&mut self, nodes: &mut [Node], config: &Config) -> u8 {
        let turn = self.turn;
        let j = usize::from(turn);
        self.turn = if turn + 1 < PERIOD { turn + 1 } else { 0 };
        if let (Some(differs), Some(torque)) = (self.differs.get_mut(j), self.torque.get_mut(j))
            && let (Some(node), Some(limits)) = (nodes.get_mut(j), config.joints.get(j))
        {
            let before = core::mem::replace(torque, node.report.torque as f32);
            if !node.enabled() {
                differs.looks = 0;
            } else if let Some(ways) = node.measured.ways(config) {
                if ways.unexplained().abs() <= ways.tolerance(config) {
                    differs.looks = 0;
                } else if differs.differ(&ways, node, before, limits, config) {
                    return 1 << j;
                }
            }
        }
        0
    }
}

impl Differs {
    /// Adds a difference between the two encoders of a joint. Returns `true` if the differences show that the reported speed does not have
    /// the configured scale. `before` is the torque at the last check, N·m.
    #[cold]
    fn differ(
        &mut self,
        ways: &Ways,
        node: &mut Node,
        before: f32,
        limits: &JointConfig,
        config: &Config,
    ) -> bool {
        // `twist` is the possible change of the gear's twist angle since the last check, because the torque has
        // changed.
        let twist = (node.report.torque - f64::from(before)).abs() / config.gear_stiffness;
        if ways.unexplained().abs() <= ways.tolerance(config) + twist {
            self.looks = 0;
            return false;
        }
        if self.looks == 0 || (ways.unexplained() > 0.0) != (self.measured > self.reported) {
            *self = Self::default();
        }
        self.looks = self.looks.saturating_add(1);
        self.measured += ways.measured as f32;
        self.reported += ways.reported as f32;
        let apart = f64::from((self.measured - self.reported).abs());
        if self.looks < LOOKS || apart <= TWISTS * limits.torque_max / config.gear_stiffness {
            return false;
        }
        self.looks = 0;
        let factor = self.measured / self.reported;
        if factor.abs() <= STANDS && factor.abs() >= 1.0 / STANDS {
            node.measured.find_factor(factor);
            return true;
        }
        node.misbehaved = true;
        false
    }
}

#[cfg(test)]
mod tests;
