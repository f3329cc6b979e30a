//! Arm model: kinematics, masses, limits, gains and friction of one arm. The values are read from TOML, URDF and CSV
//! files.

mod check;
mod collect;
mod csv;
mod device;
mod export;
mod gains;
mod image;
mod lacking;
mod parameters;
mod poses;
mod propose;
mod source;
mod statics;
#[cfg(test)]
mod tests;
mod toml_form;
#[cfg(feature = "urdf")]
mod urdf;
mod values;
mod warning;

use std::path::Path;

use jtc_core::settings::{self, Setting};
use jtc_core::{Config, Friction, JOINTS, JointConfig, Parameters, PidGains, TableOf};
use jtc_dynamics::{ArmModel, ModelError};
use jtc_wire::SettingValue;

pub use check::{ArmFinding, Checked, RotorMargins};
pub use collect::{FrictionChoice, ParameterFile};
pub use device::{Difference, NOT_CARRIED};
#[cfg(feature = "mcap")]
pub(crate) use export::frame_name;
pub use gains::RotorMargin;
pub use image::ImageError;
pub use lacking::Lacking;
pub use parameters::{Beyond, ParameterError, ParameterSet};
pub use poses::{PoseError, Poses, is_pose_name, remove_pose, save_pose};
pub use propose::{RULES, Rule};
pub use source::{Key, Source, Sources};
pub use values::ArmValue;
pub use warning::{Change, Warning};

use crate::file::{FileError, Place, read_xml_or_text};
use crate::trajectory::ArmNames;

#[cfg(not(feature = "urdf"))]
mod urdf {
    use super::{ArmChoice, Described, FileError};

    pub(super) fn read(_: &str, _: &ArmChoice) -> Result<Described, FileError> {
        Err(FileError::form("a robot description; built without URDF (feature `urdf` of jtc-host)"))
    }
}

/// Text of the arm file of the default arm, which is delivered with the program.
pub const AVENA_TOML: &str = include_str!("../../../arms/avena.toml");

/// Selection of the arm in a robot description with more than six joints.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ArmChoice {
    /// Names of the six moving joints, base to wrist. `None` if the description has exactly six moving joints.
    pub joints: Option<Vec<String>>,
    /// Name of the last link of the arm. Only joints between the base and this link can belong to the arm. With
    /// `None`, the arm ends at the flange that is fixed to the last joint.
    pub tip: Option<String>,
    /// `true` if the friction compensation is proposed from friction and damping of the description. By default it is 0, because these
    /// numbers are often made for a simulator, and too much compensation drives a joint.
    pub friction: bool,
}

/// Arm that was read from a robot description, with the gravity and the friction that the description contains.
struct Described {
    arm: Arm,
    /// Acceleration of gravity in the base frame, m/s². In the frame of the robot description, z points upwards.
    gravity: [f64; 3],
    /// Coulomb (N·m) and viscous (N·m·s/rad) friction of each joint.
    friction: [[f64; 2]; JOINTS],
}

/// Arm with all values of its arm file.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    /// Name of the arm.
    pub name: String,
    /// Names of the six joints, base to wrist.
    pub joint_names: [String; JOINTS],
    /// Names of the base and the six links.
    pub link_names: [String; JOINTS + 1],
    /// Name of the fixed joint that carries the flange.
    pub flange_name: String,
    /// Kinematics and masses of the arm.
    pub model: ArmModel,
    /// Limits and rotor inertia of each joint, base to wrist.
    pub joints: [JointConfig; JOINTS],
    /// For each joint, base to wrist: `true` if the file contains the rotor inertia of the joint. If the value is `false`, the rotor
    /// inertia in `joints` is 0.
    pub rotors_given: [bool; JOINTS],
    /// Largest torque that the drive of each joint supplies, base to wrist, N·m. A controller does not know this number. The torque limit
    /// of a joint must not exceed it, because a drive limits a larger torque without a report.
    pub drive_torque_max: [f64; JOINTS],
    /// Acceleration of gravity in the base frame, m/s². If the value is `None`, the controller's setting is used.
    pub gravity: Option<[f64; 3]>,
    /// Controller settings from the `[settings]` table of the arm file.
    pub others: Vec<SettingValue>,
    /// Gains of each joint.
    pub pid: Option<[PidGains; JOINTS]>,
    /// Friction polynomial of each joint, coefficients c0 to c5.
    pub polynomial: Option<[[f64; 6]; JOINTS]>,
    /// Friction table of each joint.
    pub table: Option<Box<[TableOf<f32>; JOINTS]>>,
    /// Named joint positions, rad. Poses are not sent to a controller and are not part of the hash of an arm.
    pub poses: Poses,
    /// Coulomb (N·m) and viscous (N·m·s/rad) friction of each joint in a robot description that is not used for the compensation; 0 if the
    /// arm has none. An arm file has these numbers only in comments.
    pub friction_unused: [[f64; 2]; JOINTS],
    /// Warnings about values of the file that the loader ignored, changed or completed with defaults.
    pub warnings: Vec<Warning>,
    /// Source of each number: the arm file, a proposal or a default.
    pub sources: Sources,
    /// Values that the arm needs and does not have. The arm contains 0 in their place.
    pub lacking: Vec<Lacking>,
}

impl Arm {
    /// Returns the default arm.
    pub fn avena() -> Self {
        Self::from_toml(AVENA_TOML).expect("the delivered arm file is good: tests read it")
    }

    /// Returns the names of the arm and of its joints, for files that name the joints.
    pub fn names(&self) -> ArmNames<'_> {
        ArmNames { arm: &self.name, joints: &self.joint_names }
    }

    /// Loads an arm from a TOML or URDF file. The content of the file determines the format.
    ///
    /// # Errors
    ///
    /// Returns an error with the position in the file if the file cannot be read, or if its format is unknown. Also returns an error if the
    /// arm is physically impossible or its drives cannot move it.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let text = read_xml_or_text(path)?;
        Self::parse(&text).map_err(|e| e.in_file(path))
    }

    /// Reads an arm from the text of a TOML or URDF file.
    ///
    /// # Errors
    ///
    /// Returns an error with the position in the text if the format is unknown, if the arm is physically impossible, or if its drives
    /// cannot move it.
    pub fn parse(text: &str) -> Result<Self, FileError> {
        let arm = if is_xml(text) { Self::from_urdf(text)? } else { Self::from_toml(text)? };
        arm.checked()
    }

    /// Reads an arm from the text of a URDF file. In this file, only the six joints of the arm may move.
    ///
    /// # Errors
    ///
    /// Returns an error if the text is not a valid URDF, or does not have exactly one chain of six revolute joints.
    pub fn from_urdf(text: &str) -> Result<Self, FileError> {
        Self::from_urdf_with(text, &ArmChoice::default())
    }

    /// Reads an arm from the text of a URDF file. `choice` selects the joints of the arm.
    ///
    /// # Errors
    ///
    /// Returns an error if the text is not a valid URDF, or if `choice` does not select a chain of six revolute
    /// joints.
    pub fn from_urdf_with(text: &str, choice: &ArmChoice) -> Result<Self, FileError> {
        urdf::read(text, choice).map(|described| described.arm)
    }

    /// Imports an arm from a URDF file. `choice` selects the joints of the arm. For numbers that are missing in the
    /// file, the [`RULES`] propose values. The arm contains a mark for each proposed value. No rule can propose masses
    /// and inertias: [`Arm::lacking`] lists them, and the arm has no proposals that depend on them.
    ///
    /// # Errors
    ///
    /// Returns an error if the file cannot be read, is not a valid URDF, or does not determine the six joints. Also
    /// returns an error if a value of the arm is physically impossible or its drives cannot move it.
    pub fn import(path: &Path, choice: &ArmChoice) -> Result<Self, FileError> {
        let text = read_xml_or_text(path)?;
        Self::import_text(&text, choice).map_err(|e| e.in_file(path))
    }

    /// Like [`import`](Self::import), but reads the text of a URDF file.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`import`](Self::import).
    pub fn import_text(text: &str, choice: &ArmChoice) -> Result<Self, FileError> {
        if !is_xml(text) {
            return Err(FileError::form("is not a robot description: a URDF is XML and begins with <"));
        }
        let Described { arm, gravity, friction } = urdf::read(text, choice)?;
        let mut arm = arm;
        arm.is_importable()?;
        arm.propose(gravity, &friction, choice.friction);
        Ok(arm)
    }

    /// Loads an arm from a TOML or URDF file without a check of the numbers. [`Arm::check`] reports invalid numbers.
    ///
    /// # Errors
    ///
    /// Returns an error with the position in the file if the file cannot be read or its format is unknown.
    pub fn load_unchecked(path: &Path) -> Result<Self, FileError> {
        let text = read_xml_or_text(path)?;
        let arm = if is_xml(&text) { Self::from_urdf(&text) } else { toml_form::read_incomplete(&text) };
        arm.map_err(|e| e.in_file(path))
    }

    /// Returns the arm, or an error if the arm is physically impossible or its drives cannot move it.
    fn checked(self) -> Result<Self, FileError> {
        self.is_physical()?;
        self.is_complete()?;
        Ok(self)
    }

    /// Checks that the arm is physically possible and that the drives can move the arm.
    ///
    /// # Errors
    ///
    /// Returns an error with the first invalid number of the model or of the limits.
    pub fn is_physical(&self) -> Result<(), FileError> {
        self.model.check().map_err(|e| FileError::at(Place::name(self.name_of_part(&e)), e.to_string()))?;
        self.limits_are_valid()
    }

    /// Checks that the drives support the limits of the joints (J-35, J-43).
    fn limits_are_valid(&self) -> Result<(), FileError> {
        self.config().check().map_err(|e| {
            let name =
                e.joint().checked_sub(1).and_then(|j| self.joint_names.get(j)).map_or("", String::as_str);
            FileError::at(Place::name(format!("joint {name}")), e.to_string())
        })?;
        match self.drive_faults().into_iter().next() {
            None => Ok(()),
            Some((joint, fault)) => {
                let name = &self.joint_names[joint.index()];
                Err(FileError::at(Place::name(format!("joint {name}, {}", fault.key)), fault.problem))
            }
        }
    }

    /// Returns the name of the joint or link that has the model error. The name is the name in the file.
    fn name_of_part(&self, error: &ModelError) -> String {
        let part = if error.is_of_joint() { &self.joint_names[..] } else { &self.link_names[..] };
        let kind = if error.is_of_joint() { "joint" } else { "link" };
        let name = part.get(error.index()).unwrap_or(&self.flange_name);
        format!("arm model, {kind} {name}")
    }

    /// Returns the controller settings for this arm. A setting that the arm does not contain has the value of the
    /// default arm. Exception: an unknown rotor inertia is 0.
    pub fn config(&self) -> Config {
        let default = Config::avena();
        let mut config =
            Config { joints: self.joints, gravity: self.gravity.unwrap_or(default.gravity), ..default };
        for value in &self.others {
            // The result is ignored: `apply` skips an out-of-range value, but the file readers have already rejected
            // such values.
            let _ = settings::apply(&mut config, *value);
        }
        config
    }

    /// Returns the friction compensation: the friction polynomial if the arm has one, otherwise the friction table.
    pub fn friction(&self) -> Option<Friction> {
        let polynomial = self.polynomial.map(Friction::Polynomial);
        polynomial.or_else(|| self.table.as_ref().map(|t| Friction::Table(**t)))
    }

    /// Returns the parameters for a controller. [`friction`](Self::friction) selects the friction compensation.
    pub fn parameter_set(&self) -> ParameterSet {
        ParameterSet { friction: self.friction(), pid: self.pid, model: Some(self.model) }
    }

    /// Returns the controller parameters for this arm. If the arm does not have a value, the value of the default arm is used.
    pub fn parameters(&self) -> Parameters {
        let default = Parameters::avena();
        Parameters {
            model: self.model,
            pid: self.pid.unwrap_or(default.pid),
            friction: self.friction().unwrap_or(default.friction),
        }
    }
}

impl Arm {
    /// Creates an arm with default values and with names in the style of arm files.
    fn nameless() -> Self {
        Self {
            name: String::new(),
            joint_names: std::array::from_fn(|i| format!("joint_{}", i + 1)),
            link_names: std::array::from_fn(|i| format!("link_{i}")),
            flange_name: "flange".into(),
            model: ArmModel::default(),
            joints: Config::avena().joints,
            rotors_given: [false; JOINTS],
            drive_torque_max: jtc_bus::DRIVE_TORQUE_MAX,
            gravity: None,
            others: Vec::new(),
            pid: None,
            polynomial: None,
            table: None,
            poses: Poses::new(),
            friction_unused: [[0.0; 2]; JOINTS],
            warnings: Vec::new(),
            sources: Sources::default(),
            lacking: Vec::new(),
        }
    }
}

/// Returns `true` for a controller setting that has no key of its own in an arm file. Such a setting is stored in the
/// `[settings]` table of the file.
fn has_no_key(setting: &Setting) -> bool {
    setting.of_arm() && !setting.of_joint() && !setting.name.starts_with("gravity_")
}

/// Returns `true` if the text is XML, like a robot description. A byte order mark may precede the XML.
fn is_xml(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').trim_start().starts_with('<')
}
