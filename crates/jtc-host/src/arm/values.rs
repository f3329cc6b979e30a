//! List of all numbers of an arm, with the unit, range, default and source of each number.

use jtc_core::settings::{self, Setting};
use jtc_core::{Config, ParameterBounds, PidGains, WORKING_AREA};
use jtc_wire::Joint;
use serde::Serialize;

use super::toml_form::{ACCELERATION_DEFAULT, POSITION_ERROR_DEFAULT, VELOCITY_DEFAULT};
use super::{Arm, Lacking, Source};

/// Number of an arm, with its unit, range, default and source.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ArmValue {
    /// Key of the number in an arm file. If the value of the key is a table or a list, the element follows after a
    /// dot: `pid.kp`, `com_xyz_m.x`.
    pub name: &'static str,
    /// Joint to which the number belongs; `None` for a number of the flange, of a link or of the whole arm.
    pub joint: Option<Joint>,
    /// Index of the link to which the number belongs; 0 is the base. The origin of a joint has the index of the link
    /// that the joint moves. The flange has index 7.
    pub link: Option<usize>,
    /// Value of the number; `None` if the number is missing.
    pub value: Option<f64>,
    /// Unit of the number.
    pub unit: &'static str,
    /// Smallest value that a controller accepts; `None` if the number has no lower bound.
    pub min: Option<f64>,
    /// Largest value that a controller accepts; `None` if the number has no upper bound.
    pub max: Option<f64>,
    /// Value that is used if the number is missing in the file.
    pub default: Option<f64>,
    /// Source of the number.
    pub from: Source,
}

/// Properties of a number that do not depend on the arm.
pub(super) struct Kind {
    pub name: &'static str,
    pub unit: &'static str,
    min: Option<f64>,
    max: Option<f64>,
    default: Option<f64>,
}

const fn kind(name: &'static str, unit: &'static str, min: Option<f64>, max: Option<f64>) -> Kind {
    Kind { name, unit, min, max, default: None }
}

const XYZ: [&str; 3] = ["origin_xyz_m.x", "origin_xyz_m.y", "origin_xyz_m.z"];
const RPY: [&str; 3] = ["origin_rpy_rad.roll", "origin_rpy_rad.pitch", "origin_rpy_rad.yaw"];
const COM: [&str; 3] = ["com_xyz_m.x", "com_xyz_m.y", "com_xyz_m.z"];
const COM_RPY: [&str; 3] = ["com_rpy_rad.roll", "com_rpy_rad.pitch", "com_rpy_rad.yaw"];
const INERTIA: [&str; 6] = [
    "inertia_kg_m2.ixx",
    "inertia_kg_m2.ixy",
    "inertia_kg_m2.ixz",
    "inertia_kg_m2.iyy",
    "inertia_kg_m2.iyz",
    "inertia_kg_m2.izz",
];
const GRAVITY: [&str; 3] = ["gravity_m_s2.x", "gravity_m_s2.y", "gravity_m_s2.z"];
const FRICTION: [(&str, &str); 6] = [
    ("friction_polynomial.c0", "N·m"),
    ("friction_polynomial.c1", "N·m·s/rad"),
    ("friction_polynomial.c2", "N·m·s²/rad²"),
    ("friction_polynomial.c3", "N·m·s³/rad³"),
    ("friction_polynomial.c4", "1/K"),
    ("friction_polynomial.c5", "°C"),
];

/// List of all numbers in a value of the type `T`. Each entry consists of the properties of a number and a function
/// that reads the number from the value.
pub(super) type Numbers<T, const N: usize> = [(Kind, fn(&T) -> f64); N];

/// Returns the properties of a controller setting or joint setting. Its range is the range in the settings table,
/// reduced to the range of the drives.
fn setting(row: &Setting, drives: &Config) -> Kind {
    let fastest = drives.drive_speed_trip.min(drives.velocity_full_scale) / drives.overspeed_factor;
    let (low, high) = match row.name {
        "position_min_rad" | "position_max_rad" => (-WORKING_AREA, WORKING_AREA),
        "velocity_max_rad_s" => (row.low, fastest),
        _ => (row.low, row.high),
    };
    let default = match row.name {
        "velocity_max_rad_s" => Some(VELOCITY_DEFAULT),
        "acceleration_max_rad_s2" => Some(ACCELERATION_DEFAULT),
        "position_error_max_rad" => Some(POSITION_ERROR_DEFAULT),
        "rotor_inertia_kg_m2" => Some(0.0),
        "torque_gain" => Some(1.0),
        // The default is not a constant, because it depends on the torque limit of the joint.
        "teach_damping_nm_s_rad" => None,
        // The other numbers of a joint have no default, because an arm file must contain them.
        _ if row.of_joint() => None,
        _ => row.get(drives, 0),
    };
    Kind { default, ..kind(row.name, row.unit, Some(low), Some(high)) }
}

/// Returns the properties of the gains of a joint.
pub(super) fn gains(bounds: &ParameterBounds) -> Numbers<PidGains, 5> {
    let (none, least, most) = (Some(0.0), Some(-bounds.integral_max), Some(bounds.integral_max));
    [
        (kind("pid.kp", "N·m/rad", none, Some(bounds.kp_max)), |g| g.kp),
        (kind("pid.ki", "N·m/(rad·s)", none, Some(bounds.ki_max)), |g| g.ki),
        (kind("pid.kd", "N·m·s/rad", none, Some(bounds.kd_max)), |g| g.kd),
        (kind("pid.int_min_rad_s", "rad·s", least, most), |g| g.int_min),
        (kind("pid.int_max_rad_s", "rad·s", least, most), |g| g.int_max),
    ]
}

/// Creates a number that belongs neither to a joint nor to a link.
fn value(kind: Kind, value: Option<f64>, from: Source) -> ArmValue {
    let Kind { name, unit, min, max, default } = kind;
    ArmValue { name, joint: None, link: None, value, unit, min, max, default, from }
}

/// Creates one number for each element of a list in the arm file.
fn listed(
    names: &[&'static str],
    unit: &'static str,
    values: &[f64],
    link: usize,
    bound: Option<f64>,
) -> Vec<ArmValue> {
    let one = |(name, v): (&&'static str, &f64)| ArmValue {
        link: Some(link),
        ..value(kind(name, unit, bound.map(|b| -b), bound), Some(*v), Source::File)
    };
    names.iter().zip(values).map(one).collect()
}

impl Arm {
    /// Returns all numbers of the arm except the friction tables: gravity, the numbers of the joints, frames and links, and the settings of
    /// the controller.
    pub fn values(&self) -> Vec<ArmValue> {
        let (drives, config) = (Config::avena(), self.config());
        let gravity = self.gravity.map_or(Source::Default, |_| self.sources.of((None, "gravity_m_s2")));
        let mut all: Vec<ArmValue> = (0..3)
            .map(|i| {
                let default = Some(drives.gravity[i]);
                let kind = Kind { default, ..kind(GRAVITY[i], "m/s²", None, None) };
                value(kind, self.gravity.map(|g| g[i]).or(default), gravity)
            })
            .collect();
        for joint in Joint::ALL {
            let j = joint.index();
            let mut add = |v: ArmValue| all.push(ArmValue { joint: Some(joint), ..v });
            for row in settings::TABLE.iter().filter(|row| row.of_joint() && row.of_arm()) {
                let given = self.gives(row, Some(joint));
                if self.lacks(joint, row.name) {
                    add(value(setting(row, &drives), None, Source::Missing));
                    continue;
                }
                let from = if given { self.sources.of((Some(joint), row.name)) } else { Source::Default };
                add(value(setting(row, &drives), row.get(&config, joint.number()), from));
            }
            let drive = Kind {
                default: Some(jtc_bus::DRIVE_TORQUE_MAX[j]),
                ..kind("drive_torque_max_nm", "N·m", Some(0.0), None)
            };
            let from = match self.sources.of((Some(joint), "drive_torque_max_nm")) {
                Source::File if self.drive_torque_max[j] == jtc_bus::DRIVE_TORQUE_MAX[j] => Source::Default,
                other => other,
            };
            add(value(drive, Some(self.drive_torque_max[j]), from));
            let source =
                |key, lacks: bool| if lacks { Source::Missing } else { self.sources.of((Some(joint), key)) };
            for (kind, get) in gains(&drives.parameter_bounds) {
                let gains = self.pid.map(|pid| get(&pid[j]));
                add(value(kind, gains, source("pid", gains.is_none())));
            }
            for (i, (name, unit)) in FRICTION.into_iter().enumerate() {
                let c = self.polynomial.map(|c| c[j][i]);
                add(value(kind(name, unit, None, None), c, source("friction_polynomial", c.is_none())));
            }
        }
        for (i, origin) in self.model.joints.iter().enumerate() {
            let numbers =
                [listed(&XYZ, "m", &origin.xyz, i + 1, None), listed(&RPY, "rad", &origin.rpy, i + 1, None)];
            all.extend(numbers.concat().into_iter().map(|v| ArmValue { joint: Joint::from_index(i), ..v }));
        }
        let bounds = drives.parameter_bounds;
        for (i, link) in self.model.links.iter().enumerate() {
            let mass = kind("mass_kg", "kg", Some(0.0), Some(bounds.link_mass_max));
            let (known, from) = match self.lacking.contains(&Lacking::Mass(i)) {
                true => (None, Source::Missing),
                false => (Some(link.mass), Source::File),
            };
            all.push(ArmValue { link: Some(i), ..value(mass, known, from) });
            all.extend(listed(&COM, "m", &link.origin.xyz, i, None));
            all.extend(listed(&COM_RPY, "rad", &link.origin.rpy, i, None));
            let inertia = listed(&INERTIA, "kg·m²", &link.inertia, i, Some(bounds.link_inertia_max));
            all.extend(inertia.into_iter().map(|v| match self.lacking.contains(&Lacking::Inertia(i)) {
                true => ArmValue { value: None, from: Source::Missing, ..v },
                false => v,
            }));
        }
        // The list already contains gravity, so gravity is left out of the controller settings here.
        let of_controller =
            |row: &&Setting| !row.of_joint() && row.of_arm() && !row.name.starts_with("gravity");
        for row in settings::TABLE.iter().filter(of_controller) {
            let given = self.others.iter().any(|other| other.setting == row.number);
            let from = if given { Source::File } else { Source::Default };
            all.push(value(setting(row, &drives), row.get(&config, 0), from));
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::AVENA_TOML;

    #[test]
    fn each_number_knows_its_unit_range_default_and_source() {
        let text = AVENA_TOML.replacen("velocity_max_rad_s = 1.5\n", "", 1).replacen(
            "torque_max_nm = 80.0\n",
            "torque_max_nm = 80.0\nproposed = [\"torque_max_nm\", \"pid\"]\n",
            1,
        );
        let arm = Arm::parse(&text).unwrap();
        let all = arm.values();
        let of = |name: &str, joint: usize| {
            all.iter().find(|v| v.name == name && v.joint == Joint::from_number(joint)).unwrap().clone()
        };
        let v = of("velocity_max_rad_s", 1);
        assert_eq!((v.value, v.default, v.from, v.unit), (Some(1.5), Some(1.5), Source::Default, "rad/s"));
        assert_eq!((v.min, v.max.map(|m| (m * 1e9).round() / 1e9)), (Some(0.01), Some(1.5)));
        assert_eq!(of("velocity_max_rad_s", 2).from, Source::File);
        assert_eq!(
            (of("torque_max_nm", 1).from, of("torque_max_nm", 2).from),
            (Source::Proposed, Source::File)
        );
        assert_eq!((of("pid.kd", 1).from, of("pid.kd", 1).value), (Source::Proposed, Some(80.0)));
        assert_eq!(of("friction_polynomial.c0", 3).value, arm.polynomial.map(|c| c[2][0]));
        // Expected number of values: 3 for gravity, 20 for each of 6 joints, 6 for each of 7 frames and 13 for each
        // of 7 links. `own` is the number of controller settings that do not belong to these groups.
        let own = settings::count(true) - 6 * 8 - 3;
        assert_eq!(all.len(), 3 + 6 * 20 + 7 * 6 + 7 * 13 + own);
        let missing = Arm { pid: None, ..arm }.values();
        let kp = missing.iter().find(|v| v.name == "pid.kp").unwrap();
        assert_eq!((kp.value, kp.from), (None, Source::Missing));
    }
}
