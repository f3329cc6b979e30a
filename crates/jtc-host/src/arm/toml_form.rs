//! The TOML form of an arm.

use jtc_core::settings::{self, Setting};
use jtc_core::{JOINTS, JointConfig, PidGains, TableOf};
use jtc_dynamics::{ArmModel, Link, Origin};
use serde::{Deserialize, Serialize};

use super::{Arm, Warning};
use crate::file::{FileError, Place, short};

/// Format of the arm files that are read. Files without it are older and mean the same.
pub(super) const FORMAT: i64 = 2;

/// The keys that decide how the rest is read.
#[derive(Deserialize)]
struct Head {
    format: Option<toml::Value>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ArmForm {
    format: Option<i64>,
    name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    gravity_m_s2: Option<[f64; 3]>,
    joint: Vec<JointForm>,
    link: Vec<LinkForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    friction_table: Vec<TableForm>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct JointForm {
    name: String,
    origin_xyz_m: [f64; 3],
    origin_rpy_rad: [f64; 3],
    position_min_rad: Option<f64>,
    position_max_rad: Option<f64>,
    velocity_max_rad_s: Option<f64>,
    acceleration_max_rad_s2: Option<f64>,
    torque_max_nm: Option<f64>,
    position_error_max_rad: Option<f64>,
    rotor_inertia_kg_m2: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    torque_gain: Option<f64>,
    pid: Option<PidForm>,
    friction_polynomial: Option<Vec<f64>>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PidForm {
    kp: f64,
    ki: f64,
    kd: f64,
    int_min_rad_s: f64,
    int_max_rad_s: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LinkForm {
    #[serde(default)]
    name: String,
    mass_kg: f64,
    com_xyz_m: [f64; 3],
    com_rpy_rad: [f64; 3],
    inertia_kg_m2: [f64; 6],
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TableForm {
    velocity_rad_s: Vec<f32>,
    temperature_c: Vec<f32>,
    torque_nm: Vec<Vec<f32>>,
}

impl Arm {
    /// From the TOML form; numbers that the controller would refuse are an error.
    ///
    /// # Errors
    ///
    /// The first key or number that is missing, unknown or of the wrong form, with its line.
    pub fn from_toml(text: &str) -> Result<Self, FileError> {
        let wrong = |e: toml::de::Error| {
            let line = e.span().map(|s| 1 + text.get(..s.start).unwrap_or("").matches('\n').count());
            FileError::at(Place { line, ..Place::default() }, e.message().to_owned())
        };
        let first = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
        if !text.lines().any(|line| line.contains('=') || line.starts_with('[')) {
            let problem = format!("neither TOML nor URDF: no arm file (it begins with \"{}\")", short(first));
            return Err(FileError::form(problem));
        }
        // Before the keys, which another format may have others of.
        if let Some(format) = toml::from_str::<Head>(text).map_err(wrong)?.format
            && format.as_integer() != Some(FORMAT)
        {
            let problem =
                format!("format = {format} is none that this program reads; it reads `format = {FORMAT}`");
            return Err(FileError::at(Place::name("format"), problem));
        }
        let form: ArmForm = toml::from_str(text).map_err(wrong)?;
        let (joints, flange) = match form.joint.split_last_chunk::<1>() {
            Some((joints, [flange])) if joints.len() == JOINTS => (joints, flange),
            _ => {
                let n = form.joint.len();
                return Err(FileError::form(format!(
                    "{n} [[joint]] entries, not 7 (six joints and the fixed flange)"
                )));
            }
        };
        if form.link.len() != 7 {
            return Err(FileError::form(format!(
                "{} [[link]] entries, not 7 (base and six links)",
                form.link.len()
            )));
        }
        if let Some(v) = form.gravity_m_s2.iter().flatten().find(|v| !v.is_finite()) {
            return Err(FileError::at(Place::name("gravity_m_s2"), format!("{v} is not finite")));
        }
        let mut warnings = Vec::new();
        let mut limits = [JointConfig {
            position_min: 0.0,
            position_max: 0.0,
            velocity_max: 0.0,
            acceleration_max: 0.0,
            torque_max: 0.0,
            position_error_max: 0.0,
            rotor_inertia: 0.0,
            torque_gain: 1.0,
        }; JOINTS];
        for (limit, joint) in limits.iter_mut().zip(joints) {
            *limit = joint.limits(&mut warnings)?;
        }
        let origin = |j: &JointForm| Origin { xyz: j.origin_xyz_m, rpy: j.origin_rpy_rad };
        let model = ArmModel {
            joints: std::array::from_fn(|i| if i < JOINTS { origin(&joints[i]) } else { origin(flange) }),
            links: std::array::from_fn(|i| form.link[i].link()),
        };
        Ok(Arm {
            joint_names: std::array::from_fn(|i| joints[i].name.clone()),
            pid: all_or_none(joints, "pid", |j| Ok(j.pid.map(PidForm::gains)))?,
            polynomial: all_or_none(joints, "friction_polynomial", JointForm::polynomial)?,
            table: tables(&form.friction_table)?,
            name: form.name,
            model,
            joints: limits,
            rotors_given: std::array::from_fn(|i| joints[i].rotor_inertia_kg_m2.is_some()),
            gravity: form.gravity_m_s2,
            warnings,
        })
    }
}

/// A part that all six joints have, or none.
fn all_or_none<T>(
    joints: &[JointForm],
    key: &str,
    get: impl Fn(&JointForm) -> Result<Option<T>, FileError>,
) -> Result<Option<[T; JOINTS]>, FileError> {
    let mut found = Vec::new();
    let mut lacking = None;
    for joint in joints {
        match get(joint)? {
            Some(v) => found.push(v),
            None => lacking = lacking.or(Some(&joint.name)),
        }
    }
    match (found.is_empty(), lacking) {
        (true, _) => Ok(None),
        (false, Some(name)) => Err(FileError::at(
            Place::name(format!("joint {name}")),
            format!("{key} is missing, other joints have it"),
        )),
        (false, None) => Ok(found.try_into().ok()),
    }
}

impl JointForm {
    fn limits(&self, warnings: &mut Vec<Warning>) -> Result<JointConfig, FileError> {
        let place = |key: &str| Place::name(format!("joint {}, {key}", self.name));
        let need = |key: &str, v: Option<f64>| v.ok_or_else(|| FileError::at(place(key), "missing"));
        let mut or = |key: &str, v: Option<f64>, default: f64| {
            v.unwrap_or_else(|| {
                let problem = format!("{key} not given: {default} is used");
                warnings.push(Warning { place: format!("joint {}", self.name), problem });
                default
            })
        };
        let config = JointConfig {
            position_min: need("position_min_rad", self.position_min_rad)?,
            position_max: need("position_max_rad", self.position_max_rad)?,
            velocity_max: or("velocity_max_rad_s", self.velocity_max_rad_s, 1.5),
            acceleration_max: or("acceleration_max_rad_s2", self.acceleration_max_rad_s2, 12.56637),
            torque_max: need("torque_max_nm", self.torque_max_nm)?,
            position_error_max: or("position_error_max_rad", self.position_error_max_rad, 0.09),
            rotor_inertia: self.rotor_inertia_kg_m2.unwrap_or(0.0),
            torque_gain: self.torque_gain.unwrap_or(1.0),
        };
        let positive = [
            ("velocity_max_rad_s", config.velocity_max),
            ("acceleration_max_rad_s2", config.acceleration_max),
            ("torque_max_nm", config.torque_max),
            ("position_error_max_rad", config.position_error_max),
        ];
        for (key, v) in positive {
            if !(v > 0.0 && v.is_finite()) {
                return Err(FileError::at(place(key), format!("{v} is not a positive number")));
            }
        }
        if !config.position_min.is_finite() || !config.position_max.is_finite() {
            let (min, max) = (config.position_min, config.position_max);
            return Err(FileError::at(place("position_min_rad"), format!("{min}..{max} is not finite")));
        }
        if config.position_min >= config.position_max {
            let (min, max) = (config.position_min, config.position_max);
            return Err(FileError::at(
                place("position_min_rad"),
                format!("{min} is not below position_max_rad {max}"),
            ));
        }
        if !(config.rotor_inertia >= 0.0 && config.rotor_inertia.is_finite()) {
            let v = config.rotor_inertia;
            return Err(FileError::at(
                place("rotor_inertia_kg_m2"),
                format!("{v} is negative or not finite"),
            ));
        }
        if let Some(Setting { low, high, .. }) = settings::named("torque_gain")
            && !(*low..=*high).contains(&config.torque_gain)
        {
            let problem = format!("{} is outside {low}..{high}", config.torque_gain);
            return Err(FileError::at(place("torque_gain"), problem));
        }
        Ok(config)
    }

    fn polynomial(&self) -> Result<Option<[f64; 6]>, FileError> {
        let Some(c) = &self.friction_polynomial else { return Ok(None) };
        match c.len() {
            4 => Ok(Some([c[0], c[1], c[2], c[3], 0.0, 0.0])),
            6 => Ok(Some([c[0], c[1], c[2], c[3], c[4], c[5]])),
            n => Err(FileError::at(
                Place::name(format!("joint {}, friction_polynomial", self.name)),
                format!("{n} coefficients, not 4 or 6"),
            )),
        }
    }
}

impl PidForm {
    fn gains(self) -> PidGains {
        PidGains {
            kp: self.kp,
            ki: self.ki,
            kd: self.kd,
            int_min: self.int_min_rad_s,
            int_max: self.int_max_rad_s,
        }
    }
}

impl LinkForm {
    fn link(&self) -> Link {
        Link {
            origin: Origin { xyz: self.com_xyz_m, rpy: self.com_rpy_rad },
            inertia: self.inertia_kg_m2,
            mass: self.mass_kg,
        }
    }
}

fn tables(forms: &[TableForm]) -> Result<Option<Box<[TableOf<f32>; JOINTS]>>, FileError> {
    let tables = forms.iter().enumerate().map(|(i, t)| t.table(i)).collect::<Result<Vec<_>, _>>()?;
    match tables.len() {
        0 => Ok(None),
        1 => Ok(Some(Box::new([tables[0]; JOINTS]))),
        JOINTS => Ok(Some(Box::new(std::array::from_fn(|i| tables[i])))),
        n => Err(FileError::form(format!("{n} [[friction_table]] entries, not 1 (for all joints) or 6"))),
    }
}

impl TableForm {
    fn table(&self, i: usize) -> Result<TableOf<f32>, FileError> {
        let wrong = |key: &str, n: usize| {
            FileError::at(
                Place::name(format!("friction_table {}, {key}", i + 1)),
                format!("{n} values, not 20"),
            )
        };
        let axis = |key: &str, v: &[f32]| <[f32; 20]>::try_from(v).map_err(|_| wrong(key, v.len()));
        let mut torque = [[0.0; 20]; 20];
        if self.torque_nm.len() != 20 {
            return Err(wrong("torque_nm (rows)", self.torque_nm.len()));
        }
        for (to, from) in torque.iter_mut().zip(&self.torque_nm) {
            *to = axis("torque_nm (columns)", from)?;
        }
        Ok(TableOf {
            velocity: axis("velocity_rad_s", &self.velocity_rad_s)?,
            temperature: axis("temperature_c", &self.temperature_c)?,
            torque,
        })
    }
}
