//! Detection of over-speed in the measured speed of a joint with torque (J-35). Checks of commanded values cannot detect this over-speed.
use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::nodes::Nodes;
use crate::{JOINTS, joint_error};

/// Time for which the speed of each joint has been above its over-speed threshold.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct OverSpeed {
    /// Number of consecutive measurements above the threshold for each joint.
    ticks: [u16; JOINTS],
}

bit_codec!(OverSpeed { ticks });

impl OverSpeed {
    /// Returns the joint errors of this tick. A joint has an error if its measured speed has been above [`Config::overspeed_factor`] times
    /// its velocity limit for [`Config::overspeed_ms`]. The function uses only measurements that arrived in this tick, so a missing or
    /// unusable answer does not change the time. The function ignores joints that are not enabled, because these joints have no torque that
    /// could be switched off.
    pub(crate) fn watch(&mut self, nodes: &Nodes, config: &Config) -> [u16; JOINTS] {
        // The function uses the velocity in the answer of the joint, not a predicted velocity. A velocity of NaN counts as above the
        // threshold.
        let within = |j: usize| {
            let threshold = config.overspeed_factor * config.joints[j].velocity_max;
            nodes.node(j).report.velocity.abs() <= threshold
        };
        let mut errors = [0; JOINTS];
        if (0..JOINTS).fold(true, |all, j| all & within(j) & (self.ticks[j] == 0)) {
            return errors;
        }
        for j in 0..JOINTS {
            let (node, within) = (nodes.node(j), within(j));
            let ticks = self.ticks[j];
            self.ticks[j] = if !node.enabled() {
                0
            } else if !node.fresh() {
                ticks
            } else if within {
                0
            } else {
                ticks.saturating_add(1)
            };
            let too_long = self.ticks[j] > 0 && self.ticks[j] >= config.overspeed_ms;
            errors[j] = if too_long { joint_error::VELOCITY } else { 0 };
        }
        errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns `true` if every joint has an error after this number of measurements at `times` times its threshold.
    fn found(measurements: u16, times: f64, config: &Config) -> bool {
        let threshold = config.joints.map(|joint| config.overspeed_factor * joint.velocity_max);
        let nodes = Nodes::enabled_at([0.0; JOINTS], threshold.map(|threshold| times * threshold));
        let mut over_speed = OverSpeed::default();
        let mut errors = [0; JOINTS];
        (0..measurements).for_each(|_| errors = over_speed.watch(&nodes, config));
        assert!(
            errors.iter().all(|&error| error == errors[0]) && [0, joint_error::VELOCITY].contains(&errors[0])
        );
        errors[0] != 0
    }

    #[test]
    fn j35_a_speed_at_the_threshold_is_not_above_it() {
        let config = Config::avena();
        for (measurements, times, too_fast) in [
            (100, 1.0, false),
            (100, -1.0, false),
            (4, 1.001, false),
            (5, 1.001, true),
            (5, -1.001, true),
            (5, f64::NAN, true),
        ] {
            assert_eq!(found(measurements, times, &config), too_fast, "{measurements} of {times}");
        }
    }

    /// If the allowed time is zero, a joint above the threshold has an error in the first tick. A slow joint has no
    /// error.
    #[test]
    fn j35_no_time_at_all_is_a_setting_too() {
        let config = Config { overspeed_ms: 0, ..Config::avena() };
        for (times, too_fast) in [(0.0, false), (1.0, false), (1.001, true)] {
            assert_eq!(found(1, times, &config), too_fast, "{times}");
        }
    }

    /// Four measurements above the threshold, one below it and four above it do not cause an error, because five
    /// consecutive measurements are needed. This applies to a single fast joint, and to an arm whose joints are all
    /// fast.
    #[test]
    fn j35_a_measurement_within_the_threshold_restarts_the_time() {
        let config = Config::avena();
        for fast in [[false, true, false, false, false, false], [true; JOINTS]] {
            let speeds = |times: f64| {
                core::array::from_fn(|j| {
                    let threshold = config.overspeed_factor * config.joints[j].velocity_max;
                    if fast[j] { times * threshold } else { 0.0 }
                })
            };
            let mut over_speed = OverSpeed::default();
            for (tick, above) in
                [true, true, true, true, false, true, true, true, true, true].into_iter().enumerate()
            {
                let nodes = Nodes::enabled_at([0.0; JOINTS], speeds(if above { 1.001 } else { 0.5 }));
                let errors = over_speed.watch(&nodes, &config);
                let expected = fast.map(|fast| if fast && tick == 9 { joint_error::VELOCITY } else { 0 });
                assert_eq!(errors, expected, "tick {tick}");
            }
        }
    }

    /// With an allowed time of zero, a slow joint has no error while another joint is too fast.
    #[test]
    fn j35_only_the_joint_that_is_too_fast_has_an_error() {
        let config = Config { overspeed_ms: 0, ..Config::avena() };
        let mut speeds = [0.0; JOINTS];
        speeds[4] = -1.001 * config.overspeed_factor * config.joints[4].velocity_max;
        let errors = OverSpeed::default().watch(&Nodes::enabled_at([0.0; JOINTS], speeds), &config);
        assert_eq!(errors, [0, 0, 0, 0, joint_error::VELOCITY, 0]);
    }
}
