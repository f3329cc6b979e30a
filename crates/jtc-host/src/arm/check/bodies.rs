//! Comparison of the links with the size of the arm. A body can be physically consistent and still be impossible as a
//! link of this arm: a placeholder for its inertia, or a length in mm.

use host_kit::Severity;
use jtc_core::JOINTS;
use jtc_dynamics::Link;

use super::ArmFinding;
use crate::arm::Arm;

/// Largest reach of an arm with the known drives, m. Larger lengths are in mm.
const REACH_MAX: f64 = 5.0;
/// Largest distance of a body from its joint and largest radius of gyration: [`OWN_SIZE`] times the size of the link
/// plus [`REACH_SHARE`] of the reach of the arm.
const OWN_SIZE: f64 = 2.0;
const REACH_SHARE: f64 = 0.25;
/// Reach that is assumed for an arm whose joints all have the same position, m.
const REACH_MIN: f64 = 0.1;

fn length(v: &[f64; 3]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Rounds a number to three significant digits.
fn short(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

impl Arm {
    /// Returns the longest distance of the flange from the first joint, m: the sum of the distances between the joints.
    fn reach(&self) -> f64 {
        self.model.joints[1..].iter().map(|joint| length(&joint.xyz)).sum()
    }

    /// Finds an arm that is too large, and links whose bodies are too large for the arm.
    pub(super) fn find_bodies(&self, findings: &mut Vec<ArmFinding>) {
        let reach = self.reach();
        if !reach.is_finite() {
            return;
        }
        if reach > REACH_MAX {
            findings.push(self.too_long(reach));
            return;
        }
        let reach = reach.max(REACH_MIN);
        for (i, link) in self.model.links.iter().enumerate().skip(1) {
            if link.mass > 0.0 && self.name_is_sound(i) {
                findings.extend(self.far_away(i, link, reach).or_else(|| self.too_wide(i, link, reach)));
            }
        }
    }

    /// Returns `true` if the numbers of a link are finite and its inertia is that of a body.
    fn name_is_sound(&self, link: usize) -> bool {
        !self.model_errors().iter().any(|error| !error.is_of_joint() && error.index() == link)
    }

    /// Returns the limit for the distance of a body from its joint, and for its radius of gyration, m.
    fn largest(&self, i: usize, size: f64, reach: f64) -> f64 {
        let next = self.model.joints.get(i).map_or(0.0, |joint| length(&joint.xyz));
        (OWN_SIZE * next.max(size) + REACH_SHARE * reach).min(reach)
    }

    fn too_long(&self, reach: f64) -> ArmFinding {
        let longest = (1..=JOINTS)
            .max_by(|a, b| length(&self.model.joints[*a].xyz).total_cmp(&length(&self.model.joints[*b].xyz)));
        let at = longest.unwrap_or(1);
        let name = self.joint_names.get(at).unwrap_or(&self.flange_name);
        let far = short(length(&self.model.joints[at].xyz));
        let what = format!(
            "the arm reaches {} m, expected {REACH_MAX} m at most: the origin of joint {name} is {far} m from the joint before it",
            short(reach)
        );
        ArmFinding::new(Severity::Problem, "body", what)
            .because("lengths in mm instead of m")
            .next(format!("correct the origins in the file: {far} mm are {} m", short(far / 1000.0)))
            .sized(reach, REACH_MAX)
    }

    fn far_away(&self, i: usize, link: &Link, reach: f64) -> Option<ArmFinding> {
        let (far, limit) = (length(&link.origin.xyz), self.largest(i, 0.0, reach));
        (far > limit).then(|| {
            let what = format!(
                "link {}: its centre of mass is {} m from its joint, expected {} m at most in an arm that reaches {} m",
                self.link_names[i],
                short(far),
                short(limit),
                short(reach)
            );
            ArmFinding::new(severity(far, reach), "body", what)
                .because("a length in mm instead of m, or in the frame of another link")
                .next(format!("correct the centre of mass in the file: {} mm are {} m", short(far), short(far / 1000.0)))
                .sized(far, limit)
        })
    }

    fn too_wide(&self, i: usize, link: &Link, reach: f64) -> Option<ArmFinding> {
        let [xx, _, _, yy, _, zz] = link.inertia;
        let moment = xx.max(yy).max(zz);
        let (radius, limit) = ((moment / link.mass).sqrt(), self.largest(i, length(&link.origin.xyz), reach));
        (radius > limit).then(|| {
            let what = format!(
                "link {}: {} kg with an inertia of {} kg·m² have a radius of gyration of {} m, expected {} m at most in an arm that reaches {} m",
                self.link_names[i],
                short(link.mass),
                short(moment),
                short(radius),
                short(limit),
                short(reach)
            );
            ArmFinding::new(severity(radius, reach), "body", what)
                .because("a placeholder, an inertia in another unit, or not about the centre of mass")
                .next(format!(
                    "correct the inertia in the file: a body of this size has at most {} kg·m²",
                    short(link.mass * limit * limit)
                ))
                .sized(radius, limit)
        })
    }
}

/// Returns `Problem` for a length beyond the reach of the arm, which is impossible, and otherwise `Warning`.
fn severity(length: f64, reach: f64) -> Severity {
    if length > reach { Severity::Problem } else { Severity::Warning }
}

impl ArmFinding {
    fn sized(mut self, value: f64, limit: f64) -> Self {
        (self.value, self.limit, self.unit) = (Some(value), Some(limit), Some("m"));
        self
    }
}
