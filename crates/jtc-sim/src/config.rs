//! Settings of the simulation.
use jtc_core::{Config, JointConfig, Parameters};
use jtc_dynamics::{JOINTS, JointVec};

use crate::arm::SimArm;
use crate::drive::DriveConfig;
use crate::faults::FaultPlan;

/// Over-speed limit of a drive divided by the velocity limit of its joint. With 1.2, the drives of the default arm
/// have the over-speed limit of real drives.
const OVER_SPEED: f64 = 1.2;

/// Distance of the start position from the limit nearest to 0, rad, for a joint that cannot reach 0.
const END_DISTANCE: f64 = 0.2;

/// Deviation of the true arm from its model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelError {
    /// Random error of the mass and inertia of each link. The factor is drawn from the seed, between 1 − `mass` and 1 +
    /// `mass`.
    pub mass: f64,
    /// Random error of the friction of each joint. The factor is drawn from the seed, between 1 − `friction` and 1 +
    /// `friction`.
    pub friction: f64,
    /// Factors of the link masses, which replace the random factors.
    pub mass_factors: Option<[f64; 7]>,
    /// Factors of the joint frictions, which replace the random factors.
    pub friction_factors: Option<JointVec>,
}

impl ModelError {
    /// No deviation: the model in the controller is exact.
    pub const NONE: Self = Self { mass: 0.0, friction: 0.0, mass_factors: None, friction_factors: None };
}

impl Default for ModelError {
    fn default() -> Self {
        Self { mass: 0.10, friction: 0.20, mass_factors: None, friction_factors: None }
    }
}

impl ModelError {
    /// Returns the true arm, and the factor of each joint's friction.
    pub(crate) fn apply(&self, arm: &SimArm, seed: u64) -> (SimArm, JointVec) {
        let mut rng = fastrand::Rng::with_seed(seed ^ 0x6D6F_6465_6C00);
        let mut factor = |size: f64| 1.0 + size * (2.0 * rng.f64() - 1.0);
        let mass: [f64; 7] = core::array::from_fn(|_| factor(self.mass));
        let friction: JointVec = core::array::from_fn(|_| factor(self.friction));
        let mass = self.mass_factors.unwrap_or(mass);
        let mut arm = arm.clone();
        for (link, factor) in arm.model.links.iter_mut().zip(mass) {
            link.mass *= factor;
            link.inertia = link.inertia.map(|i| i * factor);
        }
        (arm, self.friction_factors.unwrap_or(friction))
    }
}

/// Support of the arm while its drives are not enabled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// The arm has no support, so a joint without torque falls.
    None,
    /// A stand supports the arm until all joints are enabled for the first time. After the first enable, the arm has no
    /// support.
    Stand,
    /// Each joint has a holding brake, which is open only while the drive of the joint is enabled. Real drives have no
    /// brakes. With brakes, the simulated arm is in a usable pose after an error.
    Brakes,
}

/// Configuration of a simulation.
#[derive(Clone, Debug)]
pub struct SimConfig {
    /// Arm model before model errors are applied.
    pub arm: SimArm,
    /// Settings of the controller.
    pub controller: Config,
    /// Image of the arm that the board has stored (J-54).
    pub stored_arm: Option<Vec<u8>>,
    /// Deviation of the true arm from `arm`.
    pub model_error: ModelError,
    /// Pose at the start, rad. By default each joint is at 0, or near its limit if the joint cannot reach 0.
    pub start: JointVec,
    /// Support of the arm while drives are not enabled.
    pub support: Support,
    /// Properties of the drives.
    pub drives: [DriveConfig; JOINTS],
    /// `true` if a gripper is on the bus.
    pub gripper: bool,
    /// Bit mask of joints (bit n = joint n) whose drive is not simulated, because the drive is on another bus (see
    /// [`BusTap`](crate::BusTap)).
    pub absent_drives: u8,
    /// `true` if another device on the joint bus, such as an analyser, acknowledges frames even if no node acknowledges
    /// them.
    pub bus_monitored: bool,
    /// Largest delay between the end of an answer on the bus and its arrival at the controller, ticks. For each
    /// millisecond, the simulation draws a delay from the seed. The delays do not change the order of the answers. If
    /// the value is 0, answers arrive in the next tick.
    pub answer_jitter_ms: u8,
    /// Bit rate of the serial line, bit/s. With `None`, transmission takes no time.
    pub baud: Option<u32>,
    /// Inter-byte timeout, µs. A frame ends after this time of silence on the serial line (J-03).
    pub inter_byte_timeout_us: u32,
    /// Number of missed ticks after which the controller's watchdog resets it (J-12).
    pub watchdog_ms: u32,
    /// `true` if the controller's safety output is connected to the drives' safety line.
    pub safety_wired: bool,
    /// Seed of all random values.
    pub seed: u64,
    /// Faults and the times at which they occur.
    pub faults: FaultPlan,
    /// Capacity of the event log. The log keeps only the newest entries and counts the removed entries.
    pub log_entries: usize,
}

impl Default for SimConfig {
    fn default() -> Self {
        Self::new(Config::avena(), &Parameters::avena())
    }
}

impl SimConfig {
    /// Returns the configuration with other largest torques of the drives, N·m.
    #[must_use]
    pub fn with_drive_torques(mut self, torque_max: JointVec) -> Self {
        self.arm.torque_ceiling = torque_max;
        self
    }

    /// Creates the configuration for a controller with these settings and an arm with these parameters.
    pub fn new(controller: Config, parameters: &Parameters) -> Self {
        let drives = core::array::from_fn(|j| DriveConfig {
            velocity_full_scale: controller.velocity_full_scale,
            over_speed: OVER_SPEED * controller.joints[j].velocity_max,
            ..DriveConfig::default()
        });
        Self {
            arm: SimArm::new(&controller, parameters),
            gripper: controller.gripper,
            start: core::array::from_fn(|j| near_zero(&controller.joints[j])),
            controller,
            stored_arm: None,
            model_error: ModelError::default(),
            support: Support::Brakes,
            drives,
            absent_drives: 0,
            bus_monitored: false,
            answer_jitter_ms: 0,
            baud: Some(115_200),
            inter_byte_timeout_us: 5_000,
            watchdog_ms: 10,
            safety_wired: false,
            seed: 1,
            faults: FaultPlan::default(),
            log_entries: 10_000,
        }
    }
}

/// Returns the start angle of a joint, rad: the angle nearest to 0 that is not too close to the limits of the joint.
/// Many arms have joints that cannot reach 0.
fn near_zero(joint: &JointConfig) -> f64 {
    let (low, high) = (joint.position_min, joint.position_max);
    let distance = END_DISTANCE.min(0.5 * (high - low));
    0.0_f64.max(low + distance).min(high - distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_joint_starts_within_its_limits_and_at_zero_where_it_can() {
        for (ends, start) in [
            ((-1.0, 1.0), 0.0),
            ((-0.2, 3.0), 0.0),
            ((0.8, 2.9), 1.0),
            ((0.0, 2.9), 0.2),
            ((-2.5, -0.5), -0.7),
            ((0.3, 0.4), 0.35),
        ] {
            let mut config = Config::avena();
            (config.joints[2].position_min, config.joints[2].position_max) = ends;
            let sim = SimConfig::new(config, &Parameters::avena());
            assert!((sim.start[2] - start).abs() < 1e-12, "{ends:?}: {}", sim.start[2]);
            assert_eq!(sim.start[1], 0.0);
        }
    }
}
