//! Arms: kinematics, masses, limits, gains and friction of one arm, from the files that people have.

mod check;
mod collect;
mod csv;
mod device;
mod export;
mod gains;
mod image;
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
pub use parameters::{Beyond, ParameterError, ParameterSet};
pub use poses::{PoseError, Poses, is_pose_name, remove_pose, save_pose};
pub use propose::{RULES, Rule};
pub use source::{Key, Source, Sources};
pub use values::ArmValue;
pub use warning::{Change, Warning};

use crate::file::{FileError, Place, read_text};

#[cfg(not(feature = "urdf"))]
mod urdf {
    use super::{ArmChoice, Described, FileError};

    pub(super) fn read(_: &str, _: &ArmChoice) -> Result<Described, FileError> {
        Err(FileError::form("a robot description; built without URDF (feature `urdf` of jtc-host)"))
    }
}

/// The default arm's file, as delivered.
pub const AVENA_TOML: &str = include_str!("../../../../arms/avena.toml");

/// The part of a robot description that is the arm, where it holds more than one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ArmChoice {
    /// Names of the six joints that move, base to wrist; `None`: there are no others.
    pub joints: Option<Vec<String>>,
    /// The link that is the flange; only joints on the way to it are looked at. `None`: what is fixed to the last joint.
    pub tip: Option<String>,
}

/// The arm of a robot description, and what else it gives that an arm has no place for.
struct Described {
    arm: Arm,
    /// Acceleration of gravity in the base frame, m/s²: z of the description points upwards.
    gravity: [f64; 3],
    /// Coulomb (N·m) and viscous (N·m·s/rad) friction of each joint.
    friction: [[f64; 2]; JOINTS],
}

/// One arm.
#[derive(Clone, Debug, PartialEq)]
pub struct Arm {
    /// Its name.
    pub name: String,
    /// Names of the six joints, base to wrist.
    pub joint_names: [String; JOINTS],
    /// Names of the base and the six links.
    pub link_names: [String; JOINTS + 1],
    /// Name of the fixed joint that carries the flange.
    pub flange_name: String,
    /// Kinematics and masses.
    pub model: ArmModel,
    /// Limits and rotor inertia, base to wrist.
    pub joints: [JointConfig; JOINTS],
    /// Joints, base to wrist, whose rotor inertia the file gives. That of the others is 0 in `joints`: it is not known.
    pub rotors_given: [bool; JOINTS],
    /// Acceleration of gravity in the base frame, m/s²; `None`: the device's setting.
    pub gravity: Option<[f64; 3]>,
    /// Settings of the controller that the file gives in its `[settings]`.
    pub others: Vec<SettingValue>,
    /// Gains.
    pub pid: Option<[PidGains; JOINTS]>,
    /// Friction polynomial, c0..c5 ascending.
    pub polynomial: Option<[[f64; 6]; JOINTS]>,
    /// Friction tables.
    pub table: Option<Box<[TableOf<f32>; JOINTS]>>,
    /// Named joint positions, rad. No controller has them, and no hash counts them.
    pub poses: Poses,
    /// What was not carried over or filled in.
    pub warnings: Vec<Warning>,
    /// Where the numbers come from.
    pub sources: Sources,
}

impl Arm {
    /// The default arm.
    pub fn avena() -> Self {
        Self::from_toml(AVENA_TOML).expect("the delivered arm file is good: tests read it")
    }

    /// From a TOML or URDF file, recognised by its content.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, is of no known form, or whose numbers are no arm of these drives, with the place.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let text = read_text(path)?;
        Self::parse(&text).map_err(|e| e.in_file(path))
    }

    /// From the text of a TOML or URDF file.
    ///
    /// # Errors
    ///
    /// A text of no known form, or whose numbers are no arm of these drives, with the place.
    pub fn parse(text: &str) -> Result<Self, FileError> {
        let arm = if is_xml(text) { Self::from_urdf(text)? } else { Self::from_toml(text)? };
        arm.checked()
    }

    /// From the text of a URDF file in which nothing but the arm moves.
    ///
    /// # Errors
    ///
    /// A text that is no URDF, or does not have exactly one chain of six revolute joints.
    pub fn from_urdf(text: &str) -> Result<Self, FileError> {
        Self::from_urdf_with(text, &ArmChoice::default())
    }

    /// From the text of a URDF file, of which `choice` selects the arm.
    ///
    /// # Errors
    ///
    /// A text that is no URDF, or in which `choice` does not name six revolute joints in a row.
    pub fn from_urdf_with(text: &str, choice: &ArmChoice) -> Result<Self, FileError> {
        urdf::read(text, choice).map(|described| described.arm)
    }

    /// From a URDF file, of which `choice` selects the arm; what such a file lacks is proposed by [`RULES`] and marked.
    ///
    /// # Errors
    ///
    /// A file that cannot be read, is no URDF, leaves open which six joints are the arm, or is no arm of these drives.
    pub fn import(path: &Path, choice: &ArmChoice) -> Result<Self, FileError> {
        let text = read_text(path)?;
        Self::import_text(&text, choice).map_err(|e| e.in_file(path))
    }

    /// As [`import`](Self::import), from the text of the file.
    ///
    /// # Errors
    ///
    /// As there.
    pub fn import_text(text: &str, choice: &ArmChoice) -> Result<Self, FileError> {
        if !is_xml(text) {
            return Err(FileError::form("is no robot description: a URDF is XML and begins with <"));
        }
        let Described { arm, gravity, friction } = urdf::read(text, choice)?;
        let mut arm = arm.checked()?;
        arm.propose(gravity, &friction);
        Ok(arm)
    }

    /// From a TOML or URDF file whose numbers may be wrong: [`Arm::check`] finds those.
    ///
    /// # Errors
    ///
    /// A file that cannot be read or is of no known form, with the place.
    pub fn load_unchecked(path: &Path) -> Result<Self, FileError> {
        let text = read_text(path)?;
        let arm = if is_xml(&text) { Self::from_urdf(&text) } else { toml_form::read(&text) };
        arm.map_err(|e| e.in_file(path))
    }

    /// The arm, unless its numbers are no arm of these drives.
    fn checked(self) -> Result<Self, FileError> {
        self.is_physical()?;
        Ok(self)
    }

    /// Whether the numbers are those of an arm that these drives can move.
    ///
    /// # Errors
    ///
    /// The first number of the model or of the limits that is none.
    pub fn is_physical(&self) -> Result<(), FileError> {
        self.model.check().map_err(|e| FileError::at(Place::name(self.name_of_part(&e)), e.to_string()))?;
        // J-35, J-43: limits that the drives cannot keep, or would stop at by themselves.
        self.config().check().map_err(|e| {
            let name =
                e.joint().checked_sub(1).and_then(|j| self.joint_names.get(j)).map_or("", String::as_str);
            FileError::at(Place::name(format!("joint {name}")), e.to_string())
        })
    }

    /// What a fault of the model is in, by its name in the file.
    fn name_of_part(&self, error: &ModelError) -> String {
        let part = if error.is_of_joint() { &self.joint_names[..] } else { &self.link_names[..] };
        let kind = if error.is_of_joint() { "joint" } else { "link" };
        let name = part.get(error.index()).unwrap_or(&self.flange_name);
        format!("arm model, {kind} {name}")
    }

    /// Settings of a controller for this arm; what the file does not give is as for the default arm, but a rotor inertia that is
    /// not given is 0.
    pub fn config(&self) -> Config {
        let default = Config::avena();
        let mut config =
            Config { joints: self.joints, gravity: self.gravity.unwrap_or(default.gravity), ..default };
        for value in &self.others {
            // One that is out of range, which no file brings here, stays as it is by default.
            let _ = settings::apply(&mut config, *value);
        }
        config
    }

    /// Friction compensation: the polynomial, else the table.
    pub fn friction(&self) -> Option<Friction> {
        let polynomial = self.polynomial.map(Friction::Polynomial);
        polynomial.or_else(|| self.table.as_ref().map(|t| Friction::Table(**t)))
    }

    /// What can be sent to a controller; friction as polynomial, else as table.
    pub fn parameter_set(&self) -> ParameterSet {
        ParameterSet { friction: self.friction(), pid: self.pid, model: Some(self.model) }
    }

    /// Parameters of a controller for this arm; what the file does not give is as for the default arm.
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
    /// An arm of which nothing is given, with names like those that files have.
    fn nameless() -> Self {
        Self {
            name: String::new(),
            joint_names: std::array::from_fn(|i| format!("joint_{}", i + 1)),
            link_names: std::array::from_fn(|i| format!("link_{i}")),
            flange_name: "flange".into(),
            model: ArmModel::default(),
            joints: Config::avena().joints,
            rotors_given: [false; JOINTS],
            gravity: None,
            others: Vec::new(),
            pid: None,
            polynomial: None,
            table: None,
            poses: Poses::new(),
            warnings: Vec::new(),
            sources: Sources::default(),
        }
    }
}

/// A setting of the controller that has no key of its own in an arm file: it stands in `[settings]`.
fn has_no_key(setting: &Setting) -> bool {
    setting.of_arm() && !setting.of_joint() && !setting.name.starts_with("gravity_")
}

/// The text is XML, as a robot description is; a byte order mark may stand before it.
fn is_xml(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').trim_start().starts_with('<')
}
