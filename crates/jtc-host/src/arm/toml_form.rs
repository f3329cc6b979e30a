//! TOML format of an arm file.

use std::collections::BTreeMap;

use jtc_core::settings;
use jtc_core::{Config, JOINTS, JointConfig, TableOf};
use jtc_dynamics::{ArmModel, Link, Origin};
use jtc_wire::{Joint, SettingValue};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

mod joint;

use joint::JointForm;
pub(super) use joint::{
    ACCELERATION_DEFAULT, POSITION_ERROR_DEFAULT, TEACH_DAMPING_DEFAULT, VELOCITY_DEFAULT,
};

use super::parameters::check_table;
use super::source::{ARM_KEYS, JOINT_KEYS};
use super::{Arm, Change, Lacking, Source, Sources, Warning};
use crate::file::{FileError, Place, short};

/// Format number of the arm files that this program reads. The program reads older files without a format number in the same way.
pub(super) const FORMAT: i64 = 2;

/// Keys that determine the format of the other keys of the file.
#[derive(Deserialize)]
struct Head {
    format: Option<toml::Value>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ArmForm {
    format: Option<i64>,
    name: String,
    #[serde(default, deserialize_with = "exactly_or_none", skip_serializing_if = "Option::is_none")]
    gravity_m_s2: Option<[f64; 3]>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    proposed: Vec<String>,
    joint: Vec<JointForm>,
    link: Vec<LinkForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    friction_table: Vec<TableForm>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    settings: BTreeMap<String, toml::Value>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    poses: BTreeMap<String, Vec<f64>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LinkForm {
    #[serde(default)]
    name: String,
    mass_kg: Option<f64>,
    #[serde(deserialize_with = "exactly")]
    com_xyz_m: [f64; 3],
    #[serde(deserialize_with = "exactly")]
    com_rpy_rad: [f64; 3],
    #[serde(default, deserialize_with = "exactly_or_none")]
    inertia_kg_m2: Option<[f64; 6]>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TableForm {
    velocity_rad_s: Vec<f32>,
    temperature_c: Vec<f32>,
    torque_nm: Vec<Vec<f32>>,
}

impl Arm {
    /// Reads an arm from the text of a TOML file. Returns an error for numbers that the controller would refuse.
    ///
    /// # Errors
    ///
    /// Returns an error with the line or name of the first key or number that is missing, unknown or not valid.
    pub fn from_toml(text: &str) -> Result<Self, FileError> {
        let arm = read(text)?;
        match arm.limit_faults().into_iter().next() {
            None => Ok(arm),
            Some((joint, fault)) => {
                let name = &arm.joint_names[joint.index()];
                Err(FileError::at(Place::name(format!("joint {name}, {}", fault.key)), fault.problem))
            }
        }
    }
}

/// Reads an arm from the text of a TOML file without a check of the numbers. Returns an error if a number is missing
/// that has no default.
pub(super) fn read(text: &str) -> Result<Arm, FileError> {
    let arm = read_incomplete(text)?;
    arm.is_complete()?;
    Ok(arm)
}

/// Like [`read`], but accepts a file without some numbers. [`Arm::lacking`] lists the missing numbers.
pub(super) fn read_incomplete(text: &str) -> Result<Arm, FileError> {
    let wrong = |e: toml::de::Error| {
        let line = e.span().map(|s| 1 + text.get(..s.start).unwrap_or("").matches('\n').count());
        FileError::at(Place { line, ..Place::default() }, e.message().to_owned())
    };
    let first = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
    if !text.lines().any(|line| line.contains('=') || line.starts_with('[')) {
        let problem =
            format!("not an arm file: neither TOML nor URDF (the file begins with \"{}\")", short(first));
        return Err(FileError::form(problem));
    }
    // The format number is checked before the keys, because another format may have other keys.
    if let Some(format) = toml::from_str::<Head>(text).map_err(wrong)?.format
        && format.as_integer() != Some(FORMAT)
    {
        let problem = format!("format = {format} is not supported, expected `format = {FORMAT}`");
        return Err(FileError::at(Place::name("format"), problem));
    }
    let form: ArmForm = toml::from_str(text).map_err(wrong)?;
    let (joints, flange) = match form.joint.split_last_chunk::<1>() {
        Some((joints, [flange])) if joints.len() == JOINTS => (joints, flange),
        _ => {
            let n = form.joint.len();
            return Err(FileError::form(format!(
                "{n} [[joint]] entries, expected 7 (six joints and the fixed flange)"
            )));
        }
    };
    if form.link.len() != 7 {
        return Err(FileError::form(format!(
            "{} [[link]] entries, expected 7 (base and six links)",
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
        teach_damping: 0.0,
    }; JOINTS];
    let mut sources = Sources::default();
    let mut lacking = Vec::new();
    mark(&mut sources, None, &form.proposed)?;
    for (number, (limit, joint)) in Joint::ALL.into_iter().zip(limits.iter_mut().zip(joints)) {
        *limit = joint.limits(number, &mut warnings, &mut sources, &mut lacking);
        mark(&mut sources, Some((number, joint)), &joint.proposed)?;
    }
    for (i, link) in form.link.iter().enumerate() {
        lacking.extend(link.mass_kg.is_none().then_some(Lacking::Mass(i)));
        lacking.extend(link.inertia_kg_m2.is_none().then_some(Lacking::Inertia(i)));
    }
    let proposed = sources.proposed().count();
    if proposed > 0 {
        let problem = format!(
            "{proposed} {} of this file are proposed starting values, not measured and not looked up; `jtc arm check` lists them",
            if proposed == 1 { "number" } else { "numbers" }
        );
        warnings.push(Warning::new(Change::Proposed, "proposed", problem));
    }
    let origin = |j: &JointForm| Origin { xyz: j.origin_xyz_m, rpy: j.origin_rpy_rad };
    let model = ArmModel {
        joints: std::array::from_fn(|i| if i < JOINTS { origin(&joints[i]) } else { origin(flange) }),
        links: std::array::from_fn(|i| form.link[i].link()),
    };
    Ok(Arm {
        joint_names: std::array::from_fn(|i| joints[i].name.clone()),
        pid: all_or_none(joints, "pid", |j| Ok(j.pid.map(joint::PidForm::gains)))?,
        polynomial: all_or_none(joints, "friction_polynomial", JointForm::polynomial)?,
        table: tables(&form.friction_table)?,
        poses: super::poses::read(&form.poses)?,
        link_names: std::array::from_fn(|i| {
            Some(&form.link[i].name).filter(|n| !n.is_empty()).cloned().unwrap_or_else(|| format!("link_{i}"))
        }),
        flange_name: flange.name.clone(),
        name: form.name,
        model,
        joints: limits,
        drive_torque_max: std::array::from_fn(|i| {
            joints[i].drive_torque_max_nm.unwrap_or(jtc_bus::DRIVE_TORQUE_MAX[i])
        }),
        rotors_given: std::array::from_fn(|i| joints[i].rotor_inertia_kg_m2.is_some()),
        gravity: form.gravity_m_s2,
        others: others(&form.settings)?,
        friction_unused: [[0.0; 2]; JOINTS],
        warnings,
        sources,
        lacking,
    })
}

/// Reads an array of exactly `N` numbers. The array type of serde would ignore additional numbers.
fn exactly<'de, D: Deserializer<'de>, const N: usize>(from: D) -> Result<[f64; N], D::Error> {
    let numbers = Vec::<f64>::deserialize(from)?;
    let count = numbers.len();
    numbers
        .try_into()
        .map_err(|_| D::Error::invalid_length(count, &format!("an array of length {N}").as_str()))
}

/// Like [`exactly`], for an optional key.
fn exactly_or_none<'de, D: Deserializer<'de>, const N: usize>(from: D) -> Result<Option<[f64; N]>, D::Error> {
    exactly(from).map(Some)
}

/// Reads the controller settings from the `[settings]` table of an arm file.
fn others(given: &BTreeMap<String, toml::Value>) -> Result<Vec<SettingValue>, FileError> {
    let mut all = Vec::new();
    for (name, value) in given {
        let wrong = |problem: String| FileError::at(Place::name(format!("settings, {name}")), problem);
        let Some(row) = settings::named(name).filter(|row| super::has_no_key(row)) else {
            let problem = match settings::named(name) {
                Some(row) if row.of_joint() && row.of_arm() => "belongs into [[joint]], for each joint",
                Some(row) if row.of_arm() => "belongs above this table, as gravity_m_s2",
                Some(_) => "does not belong to an arm file; a host sets it while the arm is in use",
                None => "is not a setting of a controller; docs/settings.md lists all settings",
            };
            return Err(wrong(problem.into()));
        };
        let number = match value {
            toml::Value::Boolean(on) => Some(f64::from(u8::from(*on))),
            toml::Value::Integer(i) => Some(*i as f64),
            toml::Value::Float(f) => Some(*f),
            _ => None,
        };
        let number = number.ok_or_else(|| wrong(format!("{value} is not a number")))?;
        let value = SettingValue { setting: row.number, joint: 0, value: number };
        settings::apply(&mut Config::avena(), value).map_err(|e| wrong(e.to_string()))?;
        all.push(value);
    }
    all.sort_by_key(|value| value.setting);
    Ok(all)
}

/// Returns a parameter of all six joints. Returns `None` if no joint has the parameter, or an error if only some joints have it.
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
            format!("{key} is missing, but other joints have it"),
        )),
        (false, None) => Ok(found.try_into().ok()),
    }
}

/// Stores the names of the proposed numbers of the whole arm or of a joint.
fn mark(sources: &mut Sources, of: Option<(Joint, &JointForm)>, names: &[String]) -> Result<(), FileError> {
    let number = of.map(|(number, _)| number);
    let keys: &[&'static str] = if of.is_some() { &JOINT_KEYS } else { &ARM_KEYS };
    for name in names {
        let place =
            Place::name(of.map_or("proposed".into(), |(_, joint)| format!("joint {}, proposed", joint.name)));
        let Some(key) = keys.iter().find(|key| *key == name) else {
            let problem = format!(
                "\"{}\" is not a key that can be proposed, expected one of {}",
                short(name),
                keys.join(", ")
            );
            return Err(FileError::at(place, problem));
        };
        let absent = of.is_some_and(|(_, joint)| !joint.has(key));
        if absent || sources.of((number, key)) == Source::Default {
            return Err(FileError::at(place, format!("{key} is listed as proposed, but has no value")));
        }
        sources.propose((number, key));
    }
    Ok(())
}

impl LinkForm {
    fn link(&self) -> Link {
        Link {
            origin: Origin { xyz: self.com_xyz_m, rpy: self.com_rpy_rad },
            inertia: self.inertia_kg_m2.unwrap_or_default(),
            mass: self.mass_kg.unwrap_or_default(),
        }
    }
}

fn tables(forms: &[TableForm]) -> Result<Option<Box<[TableOf<f32>; JOINTS]>>, FileError> {
    let tables = forms.iter().enumerate().map(|(i, t)| t.table(i)).collect::<Result<Vec<_>, _>>()?;
    let all: Box<[TableOf<f32>; JOINTS]> = match tables.len() {
        0 => return Ok(None),
        1 => Box::new([tables[0]; JOINTS]),
        JOINTS => Box::new(std::array::from_fn(|i| tables[i])),
        n => {
            return Err(FileError::form(format!(
                "{n} [[friction_table]] entries, expected 1 (for all joints) or 6"
            )));
        }
    };
    // The friction tables are checked even if the arm uses polynomials, because an operator may select the tables
    // later.
    for (joint, table) in Joint::ALL.into_iter().zip(all.iter()) {
        check_table(joint, table).map_err(|e| FileError::at(Place::name("friction_table"), e.to_string()))?;
    }
    Ok(Some(all))
}

impl TableForm {
    fn table(&self, i: usize) -> Result<TableOf<f32>, FileError> {
        let wrong = |key: &str, n: usize| {
            FileError::at(
                Place::name(format!("friction_table {}, {key}", i + 1)),
                format!("{n} values, expected 20"),
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
