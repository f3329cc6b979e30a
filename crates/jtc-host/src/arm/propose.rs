//! Starting values for what a robot description lacks, each by a rule that can be read.
//!
//! They are there so that an arm can be simulated and brought up slowly; none of them is measured. An arm file marks them, and
//! `jtc arm check` names them until somebody has replaced them.

use jtc_core::{JOINTS, PidGains};
use jtc_wire::{ACCELERATION_SCALE, Joint};

use super::source::JOINT_KEYS;
use super::statics::{Ranges, inertia, worst_gravity};
use super::{Arm, Change, Source, Warning};

/// How a number is proposed.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Rule {
    /// Its key in an arm file.
    pub name: &'static str,
    /// The rule in words.
    pub rule: &'static str,
}

/// The rules of all numbers that are proposed.
pub const RULES: [Rule; 10] = [
    Rule { name: "gravity_m_s2", rule: "9.81 m/s² down, z of the robot description being up" },
    Rule { name: "position_min_rad", rule: "the drives' working area" },
    Rule { name: "position_max_rad", rule: "the drives' working area" },
    Rule { name: "velocity_max_rad_s", rule: "the fastest that the drives do before they trip" },
    Rule {
        name: "torque_max_nm",
        rule: "twice what gravity asks of the joint in its worst pose, a twentieth of the strongest joint's at least",
    },
    Rule {
        name: "acceleration_max_rad_s2",
        rule: "a third of the torque that gravity leaves in its worst pose, over the greatest inertia; 12.56 at most",
    },
    Rule { name: "position_error_max_rad", rule: "0.09 rad, 5°" },
    Rule {
        name: "rotor_inertia_kg_m2",
        rule: "torque_max_nm / (200 rad/s²), in the middle of geared drives that are known",
    },
    Rule {
        name: "pid",
        rule: "with J, the least inertia over all poses (rotor included, other joints free): Kp = J·(40/s)², Kd = 2·J·40/s, \
               Ki = 2/s·Kp; the integral holds half of the torque limit",
    },
    Rule {
        name: "friction_polynomial",
        rule: "friction and damping of the robot description, else 0: no compensation is safe, too much is not",
    },
];

/// Natural frequency of a joint under its gains, rad/s, with its least inertia.
const NATURAL: f64 = 40.0;
/// Ki over Kp, 1/s.
const INTEGRAL_RATE: f64 = 2.0;
/// Acceleration (rad/s²) that a drive without a load has with all its torque.
const ROTOR_ACCELERATION: f64 = 200.0;
/// Least acceleration limit that is proposed, rad/s²; gravity may leave nothing.
const LEAST_ACCELERATION: f64 = 0.5;

/// With so many significant digits: more would look measured. Downwards, so that no limit is passed.
fn rounded(value: f64, digits: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let places = digits - 1 - value.abs().log10().floor() as i32;
    // By text, which gives the nearest number to the decimal fraction.
    let scale = 10f64.powi(places);
    let down = (value * scale * (1.0 + 1e-12)).floor() / scale;
    format!("{down:.*}", places.max(0) as usize).parse().unwrap_or(down)
}

impl Arm {
    /// Lowest and highest position of each joint, at most a turn away from zero.
    pub(super) fn ranges(&self) -> Ranges {
        use std::f64::consts::TAU;
        self.joints.map(|j| (j.position_min.clamp(-TAU, TAU), j.position_max.clamp(-TAU, TAU)))
    }

    /// Fills in what the description lacks, and marks it. `gravity` in the base frame, m/s²; `friction`: Coulomb (N·m) and viscous
    /// (N·m·s/rad) of each joint, where the description has them.
    pub(super) fn propose(&mut self, gravity: [f64; 3], friction: &[[f64; 2]; JOINTS]) {
        if self.gravity.is_none() {
            self.gravity = Some(gravity);
            self.sources.propose((None, "gravity_m_s2"));
        }
        let ranges = self.ranges();
        let worst = worst_gravity(&self.model, gravity, &ranges).map(|w| w.torque);
        self.propose_torques(&worst);
        let bounds = self.config().parameter_bounds;
        for (j, to) in self.joints.iter_mut().enumerate() {
            if !self.rotors_given[j] {
                to.rotor_inertia = rounded(to.torque_max / ROTOR_ACCELERATION, 2);
                self.sources.fill_in((Joint::from_index(j), "rotor_inertia_kg_m2"));
            }
        }
        self.rotors_given = [true; JOINTS];
        let inertia = inertia(&self.model, &self.joints.map(|j| j.rotor_inertia), &ranges);
        for (joint, to) in Joint::ALL.into_iter().zip(&mut self.joints) {
            if self.sources.of((Some(joint), "acceleration_max_rad_s2")) == Source::Default {
                let j = joint.index();
                let left = (to.torque_max - worst[j]) / 3.0 / inertia[j].most;
                to.acceleration_max = rounded(left.clamp(LEAST_ACCELERATION, ACCELERATION_SCALE), 3);
            }
        }
        if self.pid.is_none() {
            self.pid = Some(std::array::from_fn(|j| {
                let least = inertia[j].least;
                let kp = rounded((least * NATURAL * NATURAL).min(bounds.kp_max), 3);
                let kd = rounded((2.0 * least * NATURAL).min(bounds.kd_max), 3);
                let ki = rounded((INTEGRAL_RATE * kp).min(bounds.ki_max), 3);
                let most = rounded((0.5 * self.joints[j].torque_max / ki).min(bounds.integral_max), 3);
                PidGains { kp, ki, kd, int_min: -most, int_max: most }
            }));
            Joint::ALL.into_iter().for_each(|joint| self.sources.fill_in((Some(joint), "pid")));
        }
        if self.friction().is_none() {
            self.propose_friction(friction);
        }
        for joint in Joint::ALL {
            for key in JOINT_KEYS {
                if self.sources.of((Some(joint), key)) == Source::Default {
                    self.sources.propose((Some(joint), key));
                }
            }
        }
    }

    /// Torque limits that the description does not give: those of another arm would be strangers' numbers.
    fn propose_torques(&mut self, worst: &[f64; JOINTS]) {
        let open = |joint: Joint| self.sources.of((Some(joint), "torque_max_nm")) == Source::Default;
        let open: Vec<usize> = Joint::ALL.into_iter().filter(|j| open(*j)).map(Joint::index).collect();
        let given = (0..JOINTS).filter(|j| !open.contains(j)).map(|j| self.joints[j].torque_max);
        let strongest = given.fold(2.0 * worst.iter().copied().fold(0.0, f64::max), f64::max);
        for j in open {
            let torque = (2.0 * worst[j]).max(strongest / 20.0).clamp(0.1, jtc_bus::TORQUE_FULL_SCALE);
            self.joints[j].torque_max = rounded(torque, 2);
            let place = format!("joint {}", self.joint_names[j]);
            let assumed = |w: &&mut Warning| w.place == place && w.problem.starts_with("effort limit");
            if let Some(warning) = self.warnings.iter_mut().find(assumed) {
                let given = warning.problem.split(':').next().unwrap_or_default();
                warning.problem = format!("{given}: {} N·m is used", self.joints[j].torque_max);
            }
        }
    }

    fn propose_friction(&mut self, friction: &[[f64; 2]; JOINTS]) {
        let bounds = self.config().parameter_bounds;
        let mut all = [[0.0; 6]; JOINTS];
        for (joint, to) in Joint::ALL.into_iter().zip(&mut all) {
            let j = joint.index();
            let [coulomb, viscous] = friction[j];
            self.sources.fill_in((Some(joint), "friction_polynomial"));
            if coulomb == 0.0 && viscous == 0.0 {
                continue;
            }
            let polynomial = [coulomb, viscous, 0.0, 0.0, 0.0, 0.0];
            let within = bounds.check_polynomial(&polynomial, &self.joints[j]).is_ok();
            let problem = if within {
                *to = polynomial;
                format!(
                    "friction {coulomb} N·m and damping {viscous} N·m·s/rad: such numbers are often made for a simulator's ease, \
                     and friction that is compensated too much drives the joint"
                )
            } else {
                format!(
                    "friction {coulomb} N·m and damping {viscous} N·m·s/rad are more than the controller takes: 0 is proposed"
                )
            };
            let change = if within { Change::Doubtful } else { Change::NotCarried };
            self.warnings.push(Warning::new(change, format!("joint {}", self.joint_names[j]), problem));
        }
        self.polynomial = Some(all);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn proposals_have_few_digits_and_pass_no_limit() {
        for (value, digits, expected) in
            [(12.56637, 3, 12.5), (0.001239, 2, 0.0012), (1234.9, 3, 1230.0), (0.15, 2, 0.15), (0.0, 3, 0.0)]
        {
            assert_eq!(rounded(value, digits), expected);
        }
    }

    /// The page about arms has them word by word.
    #[test]
    fn the_rules_are_those_of_the_page() {
        let page = include_str!("../../../../docs/arm.md");
        for Rule { name, rule } in RULES {
            assert!(
                page.contains(&format!("| `{name}` | {rule} |")),
                "docs/arm.md lacks: | `{name}` | {rule} |"
            );
        }
    }

    #[test]
    fn each_number_that_can_be_proposed_has_its_rule() {
        let names: Vec<_> = RULES.iter().map(|r| r.name).collect();
        assert_eq!(names.len(), JOINT_KEYS.len() + super::super::source::ARM_KEYS.len());
        assert!(JOINT_KEYS.iter().chain(&super::super::source::ARM_KEYS).all(|key| names.contains(key)));
    }
}
