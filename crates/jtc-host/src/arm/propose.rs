//! Starting values for the numbers that are missing in a robot description. A documented rule computes each starting
//! value.
//!
//! The starting values are not measured. These values are sufficient to simulate the arm, and to commission it at low
//! speed. An arm file marks the starting values, and `jtc arm check` lists them until the operator has replaced them.

use jtc_core::settings::TOOL_SPEED;
use jtc_core::{JOINTS, PidGains};
use jtc_wire::{ACCELERATION_SCALE, Joint, SettingValue};

use super::gains::{PROPOSED_RANGE, all_stable, is_heavy_enough, is_light_enough, mass_matrices};
use super::source::JOINT_KEYS;
use super::statics::{Inertia, Ranges, inertia, worst_gravity};
use super::toml_form::TEACH_DAMPING_DEFAULT;
use super::{Arm, Change, Lacking, Source, Warning};

/// Rule that proposes a value for one key.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Rule {
    /// Key in an arm file whose value the rule proposes.
    pub name: &'static str,
    /// Text that describes the rule.
    pub rule: &'static str,
}

/// Rules for all starting values that can be proposed.
pub const RULES: [Rule; 11] = [
    Rule { name: "gravity_m_s2", rule: "9.81 m/s² downwards; z of the robot description points up" },
    Rule { name: "position_min_rad", rule: "the drives' working area" },
    Rule { name: "position_max_rad", rule: "the drives' working area" },
    Rule {
        name: "velocity_max_rad_s",
        rule: "the highest speed at which the drives do not trip; a number above 16 rad/s, which no arm reaches, is taken as degrees per \
               second if that is less",
    },
    Rule {
        name: "torque_max_nm",
        rule: "twice the gravity torque of the joint in its worst pose; at least a twentieth of the limit of the strongest joint, and enough \
               for an acceleration limit of 3 rad/s²",
    },
    Rule {
        name: "acceleration_max_rad_s2",
        rule: "a third of the torque that remains after gravity in the worst pose, divided by the greatest inertia (with three times the \
               proposed rotor inertia); at most 12.56, and at most the acceleration at which such a rotor lags by a fifth of \
               position_error_max_rad",
    },
    Rule { name: "position_error_max_rad", rule: "0.09 rad, 5°" },
    Rule {
        name: "rotor_inertia_kg_m2",
        rule: "torque_max_nm / (200 rad/s²), the middle of the range of known geared drives",
    },
    Rule {
        name: "teach_damping_nm_s_rad",
        rule: "torque_max_nm · 0.5 s/rad, at most 100/s times the least inertia over all poses (with a fifth of the proposed rotor inertia \
               and the other joints free)",
    },
    Rule {
        name: "pid",
        rule: "J is the least inertia over all poses (with a fifth of the proposed rotor inertia and the other joints free), and T is \
               delay_ticks plus 3 ms. Kd = 0.7·J/T, less if joints move each other; Kp = 20/s·Kd; Ki = 2/s·Kp, at most a third of Kp·Kd \
               divided by the greatest inertia (with three times the rotor inertia); the integral supplies half of the torque limit",
    },
    Rule {
        name: "friction_polynomial",
        rule: "0: no compensation is safe, too much compensation is not; with --friction, the friction and damping of the robot description",
    },
];

/// Keys of a joint for which the rules compute a value from the masses of the links.
const NEED_MASSES: [&str; 3] = ["torque_max_nm", "acceleration_max_rad_s2", "teach_damping_nm_s_rad"];
/// Upper limit of the proposed damping in Teaching, divided by the least inertia of the joint, 1/s (J-25). The
/// damping reduces a speed at this rate.
const TEACH_DAMPING_RATE: f64 = 100.0;
/// Tool speed limit of an imported arm, m/s. ISO 10218 requires this limit while a person near the robot sets up the
/// robot.
const TOOL_SPEED_MAX: f64 = 0.25;
/// Damping of the proposed gains, without a unit: Kd multiplied by the sum of the controller's delay and
/// [`DERIVATIVE_AGE`], divided by the least inertia (J-71).
const DAMPING: f64 = 0.7;
/// Age of the derivative, s: half of the time window of the derivative, plus half a tick. The half tick is the
/// average delay of a torque that stays constant for one tick.
const DERIVATIVE_AGE: f64 = 3e-3;
/// Kp divided by Kd, 1/s.
const STIFFNESS_RATE: f64 = 20.0;
/// Ki divided by Kp, 1/s.
const INTEGRAL_RATE: f64 = 2.0;
/// Share of the greatest Ki that is stable without friction. The proposed Ki is at most this share.
const INTEGRAL_PART: f64 = 1.0 / 3.0;
/// Safety factor for the proposed gains: the gains must also be stable if the range of rotor inertias is extended by
/// this factor at both ends.
const RESERVE: f64 = 1.5;
/// Maximum number of steps in the search for gains with the safety factor [`RESERVE`].
const REDUCTIONS: usize = 60;
/// Acceleration (rad/s²) that a joint must reach with its proposed torque limit.
const ENOUGH_ACCELERATION: f64 = 3.0;
/// Share of the available torque that the proposed acceleration uses. The available torque is the torque limit minus the gravity torque.
const ACCELERATION_PART: f64 = 1.0 / 3.0;
/// Maximum tracking error if the real rotor has the largest assumed inertia, as a share of the position error limit.
const ERROR_PART: f64 = 0.2;
/// Acceleration of a drive at full torque without an arm, rad/s². The proposed rotor inertia is computed from this
/// value.
const ROTOR_ACCELERATION: f64 = 200.0;
/// Smallest proposed acceleration limit, rad/s². This limit also applies if the gravity torque needs the whole torque
/// limit.
const LEAST_ACCELERATION: f64 = 0.5;

/// Rounds `value` down to `digits` significant digits. Rounding up could exceed a limit, and more digits would look
/// like a measured value.
fn rounded(value: f64, digits: i32) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let places = digits - 1 - value.abs().log10().floor() as i32;
    // The conversion to text and back returns the f64 that is nearest to the decimal number.
    let scale = 10f64.powi(places);
    let down = (value * scale * (1.0 + 1e-12)).floor() / scale;
    format!("{down:.*}", places.max(0) as usize).parse().unwrap_or(down)
}

impl Arm {
    /// Returns the lowest and highest position of each joint, at most one turn away from zero.
    pub(super) fn ranges(&self) -> Ranges {
        use std::f64::consts::TAU;
        self.joints.map(|j| (j.position_min.clamp(-TAU, TAU), j.position_max.clamp(-TAU, TAU)))
    }

    /// Fills in the numbers that are missing in the description, and marks them as proposed. `gravity` is in the base frame, m/s².
    /// `friction` is the Coulomb (N·m) and viscous (N·m·s/rad) friction of each joint, or 0 if the description does not contain it. The
    /// friction compensation uses it only if `use_friction` is `true`.
    pub(super) fn propose(&mut self, gravity: [f64; 3], friction: &[[f64; 2]; JOINTS], use_friction: bool) {
        if self.gravity.is_none() {
            self.gravity = Some(gravity);
            self.sources.propose((None, "gravity_m_s2"));
        }
        self.others.push(SettingValue { setting: TOOL_SPEED, joint: 0, value: TOOL_SPEED_MAX });
        if self.has_masses() {
            self.propose_from_masses(gravity);
        } else {
            self.leave_out_what_needs_masses();
        }
        if self.friction().is_none() {
            self.propose_friction(friction, use_friction);
        }
        for joint in Joint::ALL {
            for key in JOINT_KEYS {
                let open = self.sources.of((Some(joint), key)) == Source::Default;
                if open && !self.lacks(joint, key) {
                    self.sources.propose((Some(joint), key));
                }
            }
        }
    }

    /// Records that the arm lacks the values that the rules compute from the masses. If the user adds the masses to
    /// the description and imports it again, the rules propose these values.
    fn leave_out_what_needs_masses(&mut self) {
        for joint in Joint::ALL {
            for key in NEED_MASSES {
                if self.sources.of((Some(joint), key)) == Source::Default {
                    self.lacking.push(Lacking::OfJoint(joint, key));
                }
            }
            if self.sources.of((Some(joint), "torque_max_nm")) == Source::Default {
                self.joints[joint.index()].torque_max = 0.0;
                self.correct_effort_warning(joint.index(), "the rule for torque_max_nm needs the masses");
            }
        }
    }

    /// Proposes the values that depend on the masses of the links.
    fn propose_from_masses(&mut self, gravity: [f64; 3]) {
        let ranges = self.ranges();
        let worst = worst_gravity(&self.model, gravity, &ranges).map(|w| w.torque);
        self.propose_torques(&worst, &ranges);
        for (j, to) in self.joints.iter_mut().enumerate() {
            if !self.rotors_given[j] {
                to.rotor_inertia = rounded(to.torque_max / ROTOR_ACCELERATION, 2);
                self.sources.fill_in((Joint::from_index(j), "rotor_inertia_kg_m2"));
            }
        }
        self.rotors_given = [true; JOINTS];
        let heavy = self.joints.map(|j| PROPOSED_RANGE.up * j.rotor_inertia);
        let most = inertia(&self.model, &heavy, &ranges).map(|of| of.most);
        if self.pid.is_none() {
            self.pid = Some(self.proposed_gains(&ranges));
            Joint::ALL.into_iter().for_each(|joint| self.sources.fill_in((Some(joint), "pid")));
        }
        let light = self.joints.map(|j| PROPOSED_RANGE.down * j.rotor_inertia);
        let least = inertia(&self.model, &light, &ranges).map(|of| of.least);
        for (joint, to) in Joint::ALL.into_iter().zip(&mut self.joints) {
            let bearable = TEACH_DAMPING_RATE * least[joint.index()];
            to.teach_damping = rounded((TEACH_DAMPING_DEFAULT * to.torque_max).min(bearable), 3);
            if self.sources.of((Some(joint), "acceleration_max_rad_s2")) == Source::Default {
                let j = joint.index();
                let left = (to.torque_max - worst[j]) * ACCELERATION_PART / most[j];
                // If the real rotor is heavier than the proposed rotor, the model torque is too low. The controller
                // supplies the missing torque only through a position error, so the acceleration is limited until
                // this error is small enough.
                let unknown = (PROPOSED_RANGE.up - 1.0) * to.rotor_inertia;
                let kp = self.pid.map_or(f64::INFINITY, |pid| pid[j].kp);
                let lag = ERROR_PART * to.position_error_max * kp / unknown;
                let most = left.min(lag).clamp(LEAST_ACCELERATION, ACCELERATION_SCALE);
                to.acceleration_max = rounded(most, 3);
            }
        }
    }

    /// Returns gains that are stable for the whole assumed range of rotor inertias, from the lightest to the heaviest rotor.
    fn proposed_gains(&self, ranges: &Ranges) -> [PidGains; JOINTS] {
        let (delay, bounds) = (self.config().delay_ticks, self.config().parameter_bounds);
        let rotor = |factor: f64| self.joints.map(|j| factor * j.rotor_inertia);
        let (light, heavy) = (rotor(PROPOSED_RANGE.down), rotor(PROPOSED_RANGE.up));
        let least = inertia(&self.model, &light, ranges).map(|of: Inertia| of.least);
        let most = inertia(&self.model, &heavy, ranges).map(|of: Inertia| of.most);
        let rate = DAMPING / (1e-3 * f64::from(delay) + DERIVATIVE_AGE);
        let of = |damping: f64, integral: f64| -> [PidGains; JOINTS] {
            std::array::from_fn(|j| {
                let kd = rounded((damping * rate * least[j]).min(bounds.kd_max), 3);
                let kp = rounded((STIFFNESS_RATE * kd).min(bounds.kp_max), 3);
                let stable = INTEGRAL_PART * kp * kd / most[j];
                let ki = rounded(integral * (INTEGRAL_RATE * kp).min(stable).min(bounds.ki_max), 3);
                let most = rounded((0.5 * self.joints[j].torque_max / ki).min(bounds.integral_max), 3);
                PidGains { kp, ki, kd, int_min: -most, int_max: most }
            })
        };
        let matrices = mass_matrices(&self.model, ranges);
        let (mut damping, mut integral) = (1.0, 1.0);
        for _ in 0..REDUCTIONS {
            let Some(stable) = all_stable(&of(damping, integral), delay) else { break };
            if !matrices.iter().all(|m| is_heavy_enough(m, &light, &stable, RESERVE)) {
                damping *= 0.95;
            } else if !matrices.iter().all(|m| is_light_enough(m, &heavy, &stable, RESERVE)) {
                integral *= 0.8;
            } else {
                break;
            }
        }
        of(damping, integral)
    }

    /// Proposes the missing torque limits. The limits are computed from the values of this arm, because the limits of another arm would be
    /// wrong.
    fn propose_torques(&mut self, worst: &[f64; JOINTS], ranges: &Ranges) {
        let open = |joint: Joint| self.sources.of((Some(joint), "torque_max_nm")) == Source::Default;
        let open: Vec<usize> = Joint::ALL.into_iter().filter(|j| open(*j)).map(Joint::index).collect();
        let given = (0..JOINTS).filter(|j| !open.contains(j)).map(|j| self.joints[j].torque_max);
        let strongest = given.fold(2.0 * worst.iter().copied().fold(0.0, f64::max), f64::max);
        let links = inertia(&self.model, &[0.0; JOINTS], ranges);
        for j in open {
            let moving = ENOUGH_ACCELERATION / ACCELERATION_PART;
            let rotor = PROPOSED_RANGE.up / ROTOR_ACCELERATION;
            let enough = (worst[j] + moving * links[j].most) / (1.0 - moving * rotor);
            let drive = self.drive_torque_max[j].min(jtc_bus::TORQUE_FULL_SCALE);
            let torque = (2.0 * worst[j]).max(strongest / 20.0).max(enough).clamp(0.1, drive);
            let fine = rounded(1.01 * torque, 3).min(drive);
            let coarse = rounded(torque, 2);
            self.joints[j].torque_max = if coarse < enough { fine } else { coarse };
            self.correct_effort_warning(j, &format!("{} N·m is used", self.joints[j].torque_max));
        }
    }

    /// Corrects the warning about a missing effort of a joint, which was written before the rules were applied.
    fn correct_effort_warning(&mut self, joint: usize, what: &str) {
        let place = format!("joint {}", self.joint_names[joint]);
        let assumed = |w: &&mut Warning| w.place == place && w.problem.starts_with("effort limit");
        if let Some(warning) = self.warnings.iter_mut().find(assumed) {
            let given = warning.problem.split(':').next().unwrap_or_default();
            warning.problem = format!("{given}: {what}");
        }
    }

    fn propose_friction(&mut self, friction: &[[f64; 2]; JOINTS], use_friction: bool) {
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
            let used = within && use_friction;
            let problem = if used {
                *to = polynomial;
                format!(
                    "friction {coulomb} N·m and damping {viscous} N·m·s/rad: such numbers are often chosen only for a simulator, and too much \
                     friction compensation drives the joint"
                )
            } else if within {
                self.friction_unused[j] = friction[j];
                format!(
                    "friction {coulomb} N·m and damping {viscous} N·m·s/rad: 0 is proposed, because too much friction compensation drives the \
                     joint; `jtc arm import --friction` uses these numbers"
                )
            } else {
                self.friction_unused[j] = friction[j];
                format!(
                    "friction {coulomb} N·m and damping {viscous} N·m·s/rad are more than the controller accepts: 0 is proposed"
                )
            };
            let change = if used { Change::Doubtful } else { Change::NotCarried };
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

    /// The page docs/arm.md contains each rule with the same text.
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
