//! Measured over-speed of a joint under torque (J-35): what no check of the commanded values can see.
use crate::config::Config;
use crate::nodes::Nodes;
use crate::{JOINTS, joint_error};

/// How long each joint has been too fast.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct OverSpeed {
    /// Consecutive measurements above the threshold.
    ticks: [u16; JOINTS],
}

impl OverSpeed {
    /// Joint errors of this tick: joints whose measured speed has been above [`Config::overspeed_factor`] times their limit for
    /// [`Config::overspeed_ms`]. Only measurements that came in this tick count: an answer that is missing or was not
    /// accepted neither adds to the time nor ends it. Joints that are not enabled have no torque to be taken away.
    pub fn watch(&mut self, nodes: &Nodes, config: &Config) -> [u16; JOINTS] {
        let mut errors = [0; JOINTS];
        for j in 0..JOINTS {
            let node = nodes.node(j);
            let threshold = config.overspeed_factor * config.joints[j].velocity_max;
            // What the joint answered, not what is used in place of missing answers. Written so that NaN is too fast.
            let within = node.report.velocity.abs() <= threshold;
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
