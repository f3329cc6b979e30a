//! Check of an arm. The check lists all values that are physically impossible, missing, or outside the range that the
//! controller accepts. The check also lists the joints whose drives cannot hold the weight of the arm.

mod bodies;
mod borne;
mod limits;
mod moving;
mod stability;

use host_kit::{Finding, Next, Severity};
use jtc_core::settings;
use jtc_core::{Config, ConfigError, Friction, JOINTS, OutOfBounds};
use jtc_dynamics::{ArmModel, Link, ModelError};
use jtc_wire::Joint;
use serde::Serialize;

pub use self::stability::RotorMargins;
use super::source::JOINT_KEYS;
use super::{Arm, Lacking, PoseError, Source};

/// Smallest difference between two torque commands on the joint bus, N·m.
const TORQUE_STEP: f64 = jtc_bus::TORQUE_FULL_SCALE / i16::MAX as f64;
/// Number of these steps in a torque limit, below which the check reports the resolution.
const FEW_STEPS: f64 = 100.0;

/// Finding from the check of an arm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ArmFinding {
    /// Subject of the finding: `limit`, `physical`, `body`, `drives`, `bounds`, `missing`, `default`, `holding`, `gains`, `too-light`, `damping`,
    /// `unit`, `resolution`, `pose` or `proposed`.
    pub code: &'static str,
    /// Severity, description, cause and advice. The controller refuses an arm with a finding of the severity `Problem`.
    #[serde(flatten)]
    pub finding: Finding,
    /// Joint of the finding; `None` if the finding is not about one joint.
    pub joint: Option<Joint>,
    /// Key in the arm file; `None` if the finding is not about one key.
    pub name: Option<&'static str>,
    /// Value that was checked, in `unit`.
    pub value: Option<f64>,
    /// Limit for the checked value, in `unit`.
    pub limit: Option<f64>,
    /// Unit of the value and of the limit.
    pub unit: Option<&'static str>,
    /// Pose to which the finding applies, rad.
    pub pose_rad: Option<[f64; JOINTS]>,
}

impl ArmFinding {
    fn new(severity: Severity, code: &'static str, what: impl Into<String>) -> Self {
        let finding = Finding { severity, what: what.into(), why: String::new(), next: Next::default() };
        let (joint, name, value, limit, unit, pose_rad) = (None, None, None, None, None, None);
        Self { code, finding, joint, name, value, limit, unit, pose_rad }
    }

    fn because(mut self, why: impl Into<String>) -> Self {
        self.finding.why = why.into();
        self
    }

    fn next(mut self, next: impl Into<Next>) -> Self {
        self.finding.next = next.into();
        self
    }

    fn of(mut self, joint: Joint, name: &'static str) -> Self {
        (self.joint, self.name) = (Some(joint), Some(name));
        self
    }

    fn measured(mut self, value: f64, limit: f64, unit: &'static str) -> Self {
        (self.value, self.limit, self.unit) = (Some(value), Some(limit), Some(unit));
        self
    }
}

/// Greatest gravity torque of a joint, with the pose in which this torque occurs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Holding {
    /// Joint that must hold this torque.
    pub joint: Joint,
    /// Greatest magnitude of the gravity torque over all positions, N·m.
    pub torque_nm: f64,
    /// Torque limit of the joint, N·m.
    pub limit_nm: f64,
    /// Pose in which the gravity torque is greatest, rad.
    pub pose_rad: [f64; JOINTS],
}

/// Result of the check of an arm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Checked {
    /// All findings, the most severe first.
    pub findings: Vec<ArmFinding>,
    /// Greatest gravity torque of each joint; empty if it cannot be computed because numbers of the arm are invalid.
    pub holding: Vec<Holding>,
    /// Permitted ratios of the rotor inertias to the values in the file; `None` if the gains are unstable or missing.
    pub rotor_margins: Option<RotorMargins>,
}

impl Checked {
    /// Returns `true` if at least one finding is a problem. A controller would then refuse this arm.
    pub fn is_refused(&self) -> bool {
        self.findings.iter().any(|f| f.finding.severity == Severity::Problem)
    }
}

impl Arm {
    /// Checks the arm and returns all findings. An operator must know these findings before the parameters are sent to a controller.
    pub fn check(&self) -> Checked {
        let mut findings = Vec::new();
        self.find_limits(&mut findings);
        self.find_model(&mut findings);
        let faulty: Vec<Joint> = findings.iter().filter_map(|f: &ArmFinding| f.joint).collect();
        let sound =
            self.lacking.is_empty() && findings.iter().all(|f| f.finding.severity != Severity::Problem);
        self.find_settings(&faulty, &mut findings);
        self.find_drives(&faulty, &mut findings);
        self.find_bounds(&faulty, &mut findings);
        self.find_missing(&mut findings);
        let holding = if sound { self.find_holding(&mut findings) } else { Vec::new() };
        let rotor_margins = if sound { self.find_gains(&mut findings) } else { None };
        if sound {
            self.find_borne(&mut findings);
        }
        self.find_poses(&mut findings);
        self.find_proposed(&mut findings);
        findings.sort_by_key(|f| f.finding.severity);
        Checked { findings, holding, rotor_margins }
    }

    /// Returns a text such as `joint 2 (shoulder)`. The text contains only the number if the name of the joint is its number.
    fn titled(&self, joint: Joint) -> String {
        let name = &self.joint_names[joint.index()];
        if name.replace('_', " ") == joint.to_string() {
            joint.to_string()
        } else {
            format!("{joint} ({name})")
        }
    }

    fn find_limits(&self, findings: &mut Vec<ArmFinding>) {
        for (joint, fault) in self.limit_faults() {
            let what = format!("{}, {}: {}", self.titled(joint), fault.key, fault.problem);
            let mut found = ArmFinding::new(Severity::Problem, "limit", what).of(joint, fault.key);
            found.value = Some(fault.value);
            findings.push(found.because("a wrong sign or a typing error").next("correct it in the file"));
        }
    }

    fn find_model(&self, findings: &mut Vec<ArmFinding>) {
        let lacking = |error: &ModelError| match error {
            ModelError::MassZero { link } => self.lacking.contains(&Lacking::Mass(*link)),
            _ => false,
        };
        let errors = self.model_errors().into_iter().filter(|error| !lacking(error));
        findings.extend(errors.map(|error| self.unphysical(&error)));
        self.find_bodies(findings);
        if self.lacking.is_empty() && !findings.iter().any(|f| ["physical", "body"].contains(&f.code)) {
            let mass: f64 = self.model.links[1..].iter().map(|l: &Link| l.mass).sum();
            let what = format!("masses and inertias are physically consistent; {mass:.3} kg move");
            findings.push(ArmFinding::new(Severity::Good, "physical", what));
        }
    }

    /// Returns the faults of all joint origins and links. The check of a model ends at the first fault, so each joint
    /// and each link is checked alone, in a model in which everything else is valid.
    pub(super) fn model_errors(&self) -> Vec<ModelError> {
        let good = Arm::avena().model;
        let of = |index: usize| {
            let mut joint = ArmModel { links: good.links, ..good };
            joint.joints[index] = self.model.joints[index];
            let mut link = ArmModel { joints: good.joints, ..good };
            link.links[index] = self.model.links[index];
            [joint.check(), link.check()]
        };
        (0..=JOINTS).flat_map(of).filter_map(Result::err).collect()
    }

    fn unphysical(&self, error: &ModelError) -> ArmFinding {
        let bodiless = "no physical body has such moments: the inertia is not about the centre of mass, in another unit, or invented";
        let (why, value, limit) = match *error {
            ModelError::MassZero { .. } => ("a frame without a body, or a missing mass", 0.0, None),
            ModelError::MassNegative { mass, .. } => ("a wrong sign", mass, Some(0.0)),
            ModelError::InertiaNegative { moment, .. } => (bodiless, moment, Some(0.0)),
            ModelError::InertiaTriangle { moment, limit, .. } => (bodiless, moment, Some(limit)),
            ModelError::AngleTooLarge { value, limit, .. } => {
                ("a typing error, or degrees", value, Some(limit))
            }
            ModelError::NotFinite { value, .. } => ("a typing error", value, None),
            _ => ("a typing error", f64::NAN, None),
        };
        let problem = without_number(error);
        let what = format!("{}: {problem}", self.name_of_part(error).trim_start_matches("arm model, "));
        let found = ArmFinding::new(Severity::Problem, "physical", what).because(why);
        let joint = error.is_of_joint().then(|| Joint::from_index(error.index())).flatten();
        ArmFinding { joint, value: Some(value), limit, ..found.next("correct it in the file") }
    }

    fn find_drives(&self, faulty: &[Joint], findings: &mut Vec<ArmFinding>) {
        let good = Config::avena();
        for joint in Joint::ALL.into_iter().filter(|joint| !faulty.contains(joint)) {
            let mut config = good.clone();
            config.joints[joint.index()] = self.joints[joint.index()];
            let Err(error) = config.check() else {
                self.find_drive_torque(joint, findings);
                continue;
            };
            let (name, value, limit, unit) = match error {
                ConfigError::Position { value, limit, .. } => {
                    let key = if value < 0.0 { "position_min_rad" } else { "position_max_rad" };
                    (key, value, limit, "rad")
                }
                ConfigError::TorqueScale { value, limit, .. } => ("torque_max_nm", value, limit, "N·m"),
                ConfigError::SpeedScale { value, limit, .. }
                | ConfigError::SpeedTrip { value, limit, .. } => {
                    ("velocity_max_rad_s", value, limit, "rad/s")
                }
                _ => continue,
            };
            let most = match name {
                "velocity_max_rad_s" => {
                    config.drive_speed_trip.min(config.velocity_full_scale) / config.overspeed_factor
                }
                "torque_max_nm" => limit / self.joints[joint.index()].torque_gain,
                _ => limit,
            };
            let what = error.to_string().replacen(&joint.to_string(), &self.titled(joint), 1);
            findings.push(
                ArmFinding::new(Severity::Problem, "drives", what)
                    .of(joint, name)
                    .measured(value, limit, unit)
                    .because("the limits of the mechanism may exceed those of its drives")
                    .next(format!("lower {name} to {most} {unit} at most (absolute value)")),
            );
        }
    }

    /// Finds a torque limit that the drive does not reach, and a torque limit of few steps of the joint bus.
    fn find_drive_torque(&self, joint: Joint, findings: &mut Vec<ArmFinding>) {
        for (_, fault) in self.drive_faults().into_iter().filter(|(of, _)| *of == joint) {
            let what = format!("{}, {}: {}", self.titled(joint), fault.key, fault.problem);
            let most = self.drive_torque_max[joint.index()];
            findings.push(
                ArmFinding::new(Severity::Problem, "drives", what)
                    .of(joint, fault.key)
                    .measured(fault.value, most, "N·m")
                    .because("a drive limits a larger torque without a report, so the arm would lag behind its plan")
                    .next(format!("lower {} to {most} N·m at most, or correct drive_torque_max_nm", fault.key)),
            );
        }
        let (torque, step) = (self.joints[joint.index()].torque_max, TORQUE_STEP);
        if torque < FEW_STEPS * step && !self.lacks(joint, "torque_max_nm") {
            let what = format!(
                "{}, torque_max_nm: {torque} N·m are {:.0} steps of the joint bus, which has {step:.3} N·m",
                self.titled(joint),
                torque / step
            );
            findings.push(
                ArmFinding::new(Severity::Warning, "resolution", what)
                    .of(joint, "torque_max_nm")
                    .measured(torque, FEW_STEPS * step, "N·m")
                    .because("the torque of the joint moves in these steps, so the joint follows its set values coarsely")
                    .next("nothing, if the accuracy suffices; otherwise use a drive with a finer torque command"),
            );
        }
    }

    /// Finds joint limits outside the range that the controller accepts for its setting (J-53).
    fn find_settings(&self, faulty: &[Joint], findings: &mut Vec<ArmFinding>) {
        let config = self.config();
        for joint in Joint::ALL.into_iter().filter(|joint| !faulty.contains(joint)) {
            for setting in settings::TABLE.iter().filter(|setting| setting.of_joint() && setting.of_arm()) {
                let Some(value) = setting.get(&config, joint.number()) else { continue };
                let (low, high) = (setting.low, setting.high);
                if !(low..=high).contains(&value) && !self.lacks(joint, setting.name) {
                    let what =
                        format!("{}, {}: {value} is outside {low}..{high}", self.titled(joint), setting.name);
                    let limit = if value < low { low } else { high };
                    findings.push(
                        ArmFinding::new(Severity::Problem, "bounds", what)
                            .of(joint, setting.name)
                            .measured(value, limit, setting.unit)
                            .because("a typing error, or a number in another unit")
                            .next("correct it in the file"),
                    );
                }
            }
        }
    }

    /// Finds gains, friction and masses that are out of bounds. Skips the joints in `faulty`: their limits are
    /// invalid, so their friction cannot be compared with the limits.
    fn find_bounds(&self, faulty: &[Joint], findings: &mut Vec<ArmFinding>) {
        let (set, bounds) = (self.parameter_set(), self.config().parameter_bounds);
        let beyond = |joint: Option<Joint>, name, e: OutOfBounds| {
            let about = super::Beyond { joint, bounds: e }.to_string();
            let what = joint.map_or(about.clone(), |j| about.replacen(&j.to_string(), &self.titled(j), 1));
            let limit = if e.value < e.low { e.low } else { e.high };
            let mut found = ArmFinding::new(Severity::Problem, "bounds", what)
                .because("an arm with these drives cannot have this value")
                .next(format!("correct {name} in the file"));
            (found.joint, found.name) = (joint, Some(name));
            (found.value, found.limit) = (Some(e.value), Some(limit));
            found
        };
        let joints = Joint::ALL.into_iter().zip(&self.joints);
        for (joint, config) in joints.filter(|(joint, _)| !faulty.contains(joint)) {
            let j = joint.index();
            let gains = self.pid.map_or(Ok(()), |pid| bounds.check_gains(&pid[j], config));
            findings.extend(gains.err().map(|e| beyond(Some(joint), "pid", e)));
            let (key, friction) = match &set.friction {
                Some(Friction::Polynomial(c)) => {
                    ("friction_polynomial", bounds.check_polynomial(&c[j], config))
                }
                Some(Friction::Table(t)) => ("friction_table", bounds.check_table(&t[j], config)),
                None => ("friction_polynomial", Ok(())),
            };
            findings.extend(friction.err().map(|e| beyond(Some(joint), key, e)));
        }
        for (link, name) in self.model.links.iter().zip(&self.link_names) {
            let alone = ArmModel { links: [*link; JOINTS + 1], ..self.model };
            let found = alone.check().is_ok().then(|| bounds.check_masses(&alone).err()).flatten();
            findings.extend(found.map(|e| {
                let mut found = beyond(None, "link", e);
                found.finding.what = format!("link {name}: {}", found.finding.what);
                found
            }));
        }
        let only_numbers = super::ParameterSet { model: None, ..set };
        // If the gains already have a finding, the check does not report them again.
        if let Err(error) = only_numbers.check()
            && !findings.iter().any(|f| f.code == "bounds")
        {
            let found = ArmFinding::new(Severity::Problem, "bounds", error.to_string());
            findings.push(found.next("correct it in the file"));
        }
    }

    /// Finds values that the arm needs and does not have. Each finding lists all joints or links without the value.
    fn find_lacking(&self, findings: &mut Vec<ArmFinding>) {
        for (key, owners) in self.lacking_by_key() {
            let mut found = ArmFinding::new(
                Severity::Problem,
                "missing",
                format!("{key}: missing for {}", together(&owners)),
            );
            found.name = Some(key);
            let (why, next) = match key {
                "mass_kg" | "inertia_kg_m2" => (
                    "no rule can propose masses and inertias",
                    "take them from the data sheet or the CAD program, add them to <inertial> of these links in the robot description, and run jtc arm \
                     import again, which then proposes gains and limits; or enter them in this file",
                ),
                _ => (
                    "the rule for this value needs the masses of the links",
                    "add the masses and run jtc arm import again, or enter the value in this file",
                ),
            };
            findings.push(found.because(why).next(next));
        }
    }

    fn find_missing(&self, findings: &mut Vec<ArmFinding>) {
        self.find_lacking(findings);
        for part in self.parameter_set().missing() {
            findings.push(
                ArmFinding::new(Severity::Problem, "missing", format!("{part}: not in the file"))
                    .because("a controller does not leave Init without this part")
                    .next("jtc arm import proposes values for a robot description; otherwise add the values to the file"),
            );
        }
        let not_given =
            [(self.gravity.is_none(), "gravity_m_s2", "the controller uses its own gravity, straight down")];
        for (_, name, why) in not_given.into_iter().filter(|(lacks, ..)| *lacks) {
            let mut found = ArmFinding::new(Severity::Warning, "missing", format!("{name}: not in the file"));
            found.name = Some(name);
            findings.push(
                found.because(why).next("add gravity for the mounting of the arm, in the frame of its base"),
            );
        }
        let rotors: Vec<Joint> = Joint::ALL.into_iter().filter(|j| !self.rotors_given[j.index()]).collect();
        if !rotors.is_empty() {
            let name = "rotor_inertia_kg_m2";
            let what = format!("{name}: not in the file for {}", numbers(&rotors));
            let mut found = ArmFinding::new(Severity::Warning, "missing", what);
            found.name = Some(name);
            let next = "add the motor's rotor inertia times the gear ratio squared";
            findings
                .push(found.because("the controller uses 0, but the inertia of a geared rotor is usually larger than that of its link").next(next));
        }
        self.find_keys(findings, Source::Default, |name, joints| {
            let what = format!("{name}: not in the file for {joints}; a default is used");
            ArmFinding::new(Severity::Warning, "default", what)
                .next("jtc arm show shows the default; add the value to the file")
        });
    }

    /// Adds a finding for each joint key whose value comes from `source`.
    fn find_keys(
        &self,
        findings: &mut Vec<ArmFinding>,
        source: Source,
        found: impl Fn(&'static str, String) -> ArmFinding,
    ) {
        for name in JOINT_KEYS {
            let of = |joint: &Joint| self.sources.of((Some(*joint), name)) == source;
            let joints: Vec<Joint> = Joint::ALL.into_iter().filter(of).collect();
            if !joints.is_empty() {
                findings.push(ArmFinding { name: Some(name), ..found(name, numbers(&joints)) });
            }
        }
    }

    /// Finds poses outside the position limits.
    fn find_poses(&self, findings: &mut Vec<ArmFinding>) {
        for name in self.poses.keys() {
            let Err(PoseError::Outside { joint, value, min, max, .. }) = self.pose(name) else { continue };
            let what =
                format!("pose {name}, {}: {value} rad is outside {min}..{max} rad", self.titled(joint));
            let mut found = ArmFinding::new(Severity::Warning, "pose", what)
                .because("no motion can reach this pose")
                .measured(value, if value < min { min } else { max }, "rad")
                .next(
                    "jtc pose save replaces it with the present pose of the arm, jtc pose remove deletes it",
                );
            found.joint = Some(joint);
            findings.push(found);
        }
    }

    fn find_proposed(&self, findings: &mut Vec<ArmFinding>) {
        let next = "measure the value or look it up, then remove its name from `proposed`";
        if self.sources.of((None, "gravity_m_s2")) == Source::Proposed {
            let what = "gravity_m_s2: proposed; the mounting of the arm is not confirmed";
            let found = ArmFinding::new(Severity::Warning, "proposed", what).next(next);
            findings.push(ArmFinding { name: Some("gravity_m_s2"), ..found });
        }
        self.find_keys(findings, Source::Proposed, |name, joints| {
            let what = format!("{name}: proposed for {joints}; not measured and not looked up");
            ArmFinding::new(Severity::Warning, "proposed", what).next(next)
        });
    }
}

/// Returns the text of a model error without the number of the joint or link at its beginning. The caller writes the
/// name of the joint or link instead.
pub(super) fn without_number(error: &ModelError) -> String {
    let text = error.to_string();
    text.split_once(": ").map_or(text.as_str(), |(_, problem)| problem).to_owned()
}

/// Joins names such as `link a` and `link b` to `links a, b`.
fn together(owners: &[String]) -> String {
    let names: Vec<&str> = owners.iter().map(|o| o.split_once(' ').map_or("", |(_, name)| name)).collect();
    match owners {
        [one] => one.clone(),
        [first, ..] => {
            format!("{}s {}", first.split_once(' ').map_or("", |(kind, _)| kind), names.join(", "))
        }
        [] => String::new(),
    }
}

/// Formats joint numbers: `joint 3`, `joints 1, 2, 4`, `all joints`.
fn numbers(joints: &[Joint]) -> String {
    let each: Vec<String> = joints.iter().map(|j| j.number().to_string()).collect();
    match joints {
        [one] => one.to_string(),
        _ if joints.len() == JOINTS => "all joints".to_owned(),
        _ => format!("joints {}", each.join(", ")),
    }
}

#[cfg(test)]
mod tests;
