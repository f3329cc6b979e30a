//! Check of the gains for stability, and computation of the rotor inertias for which the gains stay stable.

use host_kit::{Finding, Severity};
use jtc_core::{JOINTS, PidGains};
use jtc_wire::Joint;
use serde::Serialize;

use super::{ArmFinding, numbers};
use crate::arm::gains::{PROPOSED_RANGE, StableInertia, all_stable, mass_matrices, rotor_margin};
use crate::arm::statics::{Inertia, inertia};
use crate::arm::{Arm, RotorMargin, Source};
use crate::error::ParametersError;

/// Ranges of the rotor inertias in which the gains are stable. The ranges are factors relative to the rotor inertias
/// in the file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RotorMargins {
    /// Allowed factors if all rotor inertias change by the same factor.
    pub all: RotorMargin,
    /// Allowed factors of each rotor if only the inertia of this rotor changes, base to wrist.
    pub joints: [RotorMargin; JOINTS],
}

impl Arm {
    /// Rejects an arm that lacks values or has impossible bodies, unstable gains, and gains that a controller refuses for this arm (J-71).
    /// The rules are the same as in [`Arm::check`]. An arm without gains is accepted.
    ///
    /// # Errors
    ///
    /// Returns [`ParametersError::Impossible`] with the first missing value or impossible body. Returns [`ParametersError::Unstable`] with the first finding about the gains that has the severity `Problem`.
    pub fn check_gains(&self) -> Result<(), ParametersError> {
        let worst = |findings: Vec<ArmFinding>| {
            let found = findings.into_iter().find(|found| found.finding.severity == Severity::Problem)?;
            let Finding { what, why, next, .. } = found.finding;
            Some((self.name.clone(), format!("{what}: {why}"), next))
        };
        let mut findings = Vec::new();
        self.find_lacking(&mut findings);
        self.find_bodies(&mut findings);
        if let Some((arm, problem, next)) = worst(findings) {
            return Err(ParametersError::Impossible { arm, problem, next });
        }
        let mut findings = Vec::new();
        if self.is_physical().is_ok() {
            self.find_gains(&mut findings);
            self.find_borne(&mut findings);
        }
        match worst(findings) {
            Some((arm, problem, next)) => Err(ParametersError::Unstable { arm, problem, next }),
            None => Ok(()),
        }
    }

    /// Finds unstable gains of single joints and of all joints together. If the gains are stable, returns the allowed factors of the rotor
    /// inertias. Returns `None` if gains are unstable, or if the file does not contain the gains and all rotor inertias.
    pub(super) fn find_gains(&self, findings: &mut Vec<ArmFinding>) -> Option<RotorMargins> {
        let pid = self.pid.as_ref().filter(|_| self.rotors_given == [true; JOINTS])?;
        let delay = self.config().delay_ticks;
        let rotor = self.joints.map(|j| j.rotor_inertia);
        let ranges = self.ranges();
        let moved = inertia(&self.model, &rotor, &ranges);
        let unstable: Vec<ArmFinding> = Joint::ALL
            .into_iter()
            .zip(pid.iter().zip(moved))
            .filter_map(|(joint, (gains, moved))| self.unstable_joint(joint, gains, moved, delay))
            .collect();
        if !unstable.is_empty() {
            findings.extend(unstable);
            return None;
        }
        let stable = all_stable(pid, delay)?;
        let matrices = mass_matrices(&self.model, &ranges);
        let margin = |of: [bool; JOINTS]| rotor_margin(&matrices, &rotor, &stable, of);
        let Some(all) = margin([true; JOINTS]) else {
            let what = "the gains of all joints together are not stable, but those of each joint alone are";
            findings.push(
                unstable_gains(what.to_owned())
                    .because("joints that move each other have less inertia than each joint alone")
                    .next("lower the gains of all joints by the same factor"),
            );
            return None;
        };
        let joints = std::array::from_fn(|j| margin(std::array::from_fn(|k| k == j)).unwrap_or(all));
        let margins = RotorMargins { all, joints };
        findings.push(self.proposed_rotors(margin).unwrap_or_else(|| stable_gains(&margins, &rotor)));
        Some(margins)
    }

    fn unstable_joint(
        &self,
        joint: Joint,
        gains: &PidGains,
        Inertia { least, most }: Inertia,
        delay: u8,
    ) -> Option<ArmFinding> {
        let titled = self.titled(joint);
        let PidGains { kp, ki, kd, .. } = gains;
        let Some(stable) = StableInertia::of(gains, delay) else {
            let what = format!("{titled}: Kp {kp}, Ki {ki} and Kd {kd} are unstable with every inertia");
            let found = unstable_gains(what).because("the damping is too low or missing");
            return Some(found.next("raise Kd, or lower Kp and Ki").of(joint, "pid"));
        };
        let found = if least < stable.least {
            let kd_max = kd * least / stable.least;
            unstable_gains(format!(
                "{titled}: Kd {kd} N·m·s/rad is stable only from {:.3} kg·m², but the joint has {least:.3} kg·m²",
                stable.least
            ))
            .because("the derivative is about 5 ms late, so such a joint oscillates")
            .next(format!(
                "lower Kd below {kd_max:.3}, better to half of it, and Kp and Ki in proportion; or add the rotor inertia if it is missing"
            ))
            .measured(least, stable.least, "kg·m²")
        } else if most > stable.most {
            let ki_max = ki * stable.most / most;
            unstable_gains(format!(
                "{titled}: Ki {ki} N·m/(rad·s) is stable only up to {:.3} kg·m², but the joint has {most:.3} kg·m²",
                stable.most
            ))
            .because("the integral makes the joint oscillate, unless its friction damps it")
            .next(format!("lower Ki below {ki_max:.0}, better to a third of it, or raise Kd"))
            .measured(most, stable.most, "kg·m²")
        } else {
            return None;
        };
        Some(found.of(joint, "pid"))
    }

    /// Finds gains that may be unstable because a rotor inertia is only a proposal and was not measured. Such gains
    /// must be stable for the whole range of inertias that the real rotor may have.
    fn proposed_rotors(&self, margin: impl Fn([bool; JOINTS]) -> Option<RotorMargin>) -> Option<ArmFinding> {
        let name = "rotor_inertia_kg_m2";
        let is_proposed = |joint: &Joint| self.sources.of((Some(*joint), name)) == Source::Proposed;
        let proposed: Vec<Joint> = Joint::ALL.into_iter().filter(is_proposed).collect();
        let of = Joint::ALL.map(|joint| is_proposed(&joint));
        let RotorMargin { down, up } = margin(of)?;
        if proposed.is_empty() || down <= PROPOSED_RANGE.down && up >= PROPOSED_RANGE.up {
            return None;
        }
        let what = format!(
            "the gains are stable only with {} times the proposed rotor inertias of {}, expected {}",
            range(down, up),
            numbers(&proposed),
            range(PROPOSED_RANGE.down, PROPOSED_RANGE.up)
        );
        let found = unstable_gains(what)
            .because("a proposed rotor inertia may be wrong by this factor, and the arm then oscillates")
            .next(
                "enter the rotor inertia from the data sheet and remove it from `proposed`, or import the description again: `jtc arm import` \
                 proposes gains that tolerate this error",
            );
        Some(ArmFinding { name: Some(name), ..found })
    }
}

fn unstable_gains(what: String) -> ArmFinding {
    ArmFinding::new(Severity::Problem, "gains", what)
}

fn stable_gains(margins: &RotorMargins, rotor: &[f64; JOINTS]) -> ArmFinding {
    let what = if rotor.iter().all(|r| *r == 0.0) {
        "the gains are stable in every pose".to_owned()
    } else {
        let each = margins.joints.map(|RotorMargin { down, up }| range(down, up));
        let all = range(margins.all.down, margins.all.up);
        format!(
            "the gains are stable in every pose, and with {all} times the rotor inertias; each joint alone {}",
            each.join(", ")
        )
    };
    ArmFinding::new(Severity::Good, "gains", what)
}

/// Formats a range such as `0.08..12` with two significant digits. The lower limit is rounded up and the upper limit
/// is rounded down, so the text never shows a wider range.
fn range(down: f64, up: f64) -> String {
    // Tolerance for rounding errors. The tolerance prevents that a limit with exactly two digits is rounded to another
    // number.
    const ROUNDING: f64 = 1e-9;
    format!("{}..{}", digits(down * (1.0 - ROUNDING), f64::ceil), digits(up * (1.0 + ROUNDING), f64::floor))
}

fn digits(value: f64, round: fn(f64) -> f64) -> String {
    if value <= 0.0 {
        return "0".to_owned();
    }
    let digits = 1 - value.log10().floor() as i32;
    let (scale, places) = (10f64.powi(digits), digits.max(0) as usize);
    let text = format!("{:.places$}", round(value * scale) / scale);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}
