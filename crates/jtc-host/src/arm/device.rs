//! Differences between an arm file and the settings of a controller. A host can send the friction, the gains and the
//! arm model to a controller. The limits, the gravity and the rotor inertias are settings of the controller.
//!
//! The limits and the gravity of the controller may differ from the arm file. A motion check with this file is then
//! not valid for the real arm (J-55). A controller without extensions is assumed to use the settings of the built-in
//! arm, [`Config::avena`].

use jtc_core::settings::{Setting, TABLE};
use jtc_core::{Config, JointConfig};
use jtc_wire::Joint;

use super::Arm;

/// Relative difference up to which two values count as equal. The tolerance is needed because the same number can be written in two
/// notations.
const SAME: f64 = 1e-9;

/// Value in the arm file that differs from the value in the controller.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Difference {
    /// Key of the value in an arm file.
    pub name: String,
    /// Joint to which the value belongs; `None` if the value belongs to the whole arm.
    pub joint: Option<Joint>,
    /// Value in the arm file.
    pub file: f64,
    /// Value in the controller.
    pub device: f64,
    /// Unit of `file` and `device`.
    pub unit: &'static str,
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(joint) = self.joint {
            write!(f, "{joint}, ")?;
        }
        let Self { name, file, device, unit, .. } = self;
        write!(f, "{name}: {file} {unit} in the file, {device} {unit} in the controller")
    }
}

const GRAVITY_SETTINGS: [&str; 3] = ["gravity_m_s2, x", "gravity_m_s2, y", "gravity_m_s2, z"];

/// Text for messages: names of the settings that the host does not send together with the friction, the gains and the
/// arm model.
pub const NOT_CARRIED: &str =
    "gravity, the limits of position, velocity, acceleration, torque and position error, rotor inertia";

impl Arm {
    /// Returns `true` if the arm has its own value for a setting. A URDF file cannot contain gravity and rotor inertia.
    pub(super) fn gives(&self, setting: &Setting, joint: Option<Joint>) -> bool {
        match setting.name {
            name if joint.is_some_and(|joint| self.lacks(joint, name)) => false,
            "rotor_inertia_kg_m2" => joint.is_none_or(|joint| self.rotors_given[joint.index()]),
            name if name.starts_with("gravity_") => self.gravity.is_some(),
            _ => true,
        }
    }

    /// Returns `true` if the setting belongs to a joint of an arm, and this arm has its own value for the setting.
    pub(super) fn gives_joint(&self, setting: &Setting, joint: Joint) -> bool {
        setting.of_joint() && setting.of_arm() && self.gives(setting, Some(joint))
    }

    /// Returns the settings in which this arm differs from the controller settings `device`. The list begins with gravity, then lists the
    /// settings of each joint. The list is empty if all settings are equal.
    pub fn device_differences(&self, device: &Config) -> Vec<Difference> {
        let own = self.config();
        let mut all = Vec::new();
        let mut compare = |name: &str, joint, file: f64, device: f64, unit| {
            if (file - device).abs() > SAME * file.abs().max(device.abs()) {
                all.push(Difference { name: String::from(name), joint, file, device, unit });
            }
        };
        for (name, (file, device)) in
            GRAVITY_SETTINGS.into_iter().zip(own.gravity.into_iter().zip(device.gravity))
        {
            if self.gravity.is_some() {
                compare(name, None, file, device, "m/s²");
            }
        }
        for joint in Joint::ALL {
            for row in TABLE.iter().filter(|row| self.gives_joint(row, joint)) {
                let value = |config| row.get(config, joint.number());
                if let (Some(file), Some(device)) = (value(&own), value(device)) {
                    compare(row.name, Some(joint), file, device, row.unit);
                }
            }
        }
        all
    }

    /// Returns the names of settings that are missing in the arm file: `gravity`, `rotor inertia`, or none. The controller uses its own
    /// value of a missing setting.
    pub fn settings_not_given(&self) -> Vec<&'static str> {
        let rotors = self.rotors_given.contains(&false);
        let parts = [(self.gravity.is_none(), "gravity"), (rotors, "rotor inertia")];
        parts.into_iter().filter_map(|(lacks, name)| lacks.then_some(name)).collect()
    }

    /// Returns the settings for the check of a motion on a controller with the settings `device`. Each limit is the
    /// stricter of two limits: the limit of the arm and the limit of the controller. Gravity, payload and rotor
    /// inertias are those of the controller.
    pub fn config_on_device(&self, device: &Config) -> Config {
        let mut config = self.config();
        config.gravity = device.gravity;
        config.payload = device.payload;
        for (own, device) in config.joints.iter_mut().zip(&device.joints) {
            *own = JointConfig {
                position_min: own.position_min.max(device.position_min),
                position_max: own.position_max.min(device.position_max),
                velocity_max: own.velocity_max.min(device.velocity_max),
                acceleration_max: own.acceleration_max.min(device.acceleration_max),
                torque_max: own.torque_max.min(device.torque_max),
                position_error_max: own.position_error_max.min(device.position_error_max),
                rotor_inertia: device.rotor_inertia,
                torque_gain: device.torque_gain,
                teach_damping: device.teach_damping,
            };
        }
        config
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j55_each_value_that_the_controller_does_not_use_is_listed() {
        let mut arm = Arm::avena();
        assert!(arm.device_differences(&Config::avena()).is_empty());
        arm.gravity = Some([0.0, 0.0, 9.81]);
        arm.joints[1].velocity_max = 3.15;
        arm.joints[4].rotor_inertia = 0.0;
        let all = arm.device_differences(&Config::avena());
        let seen: Vec<_> = all
            .iter()
            .map(|d| (d.name.as_str(), d.joint.map(Joint::number), d.file, d.device, d.unit))
            .collect();
        assert_eq!(
            seen,
            [
                ("gravity_m_s2, z", None, 9.81, -9.81, "m/s²"),
                ("velocity_max_rad_s", Some(2), 3.15, 1.5, "rad/s"),
                ("rotor_inertia_kg_m2", Some(5), 0.0, Config::avena().joints[4].rotor_inertia, "kg·m²"),
            ]
        );
        assert_eq!(
            all[1].to_string(),
            "joint 2, velocity_max_rad_s: 3.15 rad/s in the file, 1.5 rad/s in the controller"
        );
    }

    /// If an arm file contains no gravity, the controller uses its own gravity, and no difference is reported.
    #[test]
    fn j55_what_the_file_leaves_open_is_no_difference() {
        let arm = Arm { gravity: None, ..Arm::avena() };
        assert!(arm.device_differences(&Config::avena()).is_empty());
        let on_a_wall = Config { gravity: [0.0, 9.81, 0.0], ..Config::avena() };
        assert!(arm.device_differences(&on_a_wall).is_empty());
    }

    /// A URDF file cannot contain a rotor inertia. For a URDF arm it is unknown, and not 0, so no difference from the
    /// controller is reported.
    #[test]
    fn j55_a_rotor_inertia_that_no_file_gives_is_no_difference() {
        let urdf = Arm::parse(&Arm::avena().to_urdf()).unwrap();
        let names: Vec<_> =
            urdf.device_differences(&Config::avena()).iter().map(|d| d.name.clone()).collect();
        assert!(!names.contains(&"rotor_inertia_kg_m2".to_owned()), "{names:?}");
        assert_eq!(urdf.settings_not_given(), ["gravity", "rotor inertia"]);
        // For the check of a motion, the rotor inertias are always those of the controller.
        assert_eq!(
            urdf.config_on_device(&Config::avena()).joints[3].rotor_inertia,
            Config::avena().joints[3].rotor_inertia
        );
        // An arm file that is written from the URDF arm contains no rotor inertia. If an arm file contains a rotor
        // inertia of 0, the 0 is a known value.
        let text = urdf.to_toml();
        assert!(!text.contains("rotor_inertia"), "{text}");
        assert_eq!(Arm::parse(&text).unwrap().settings_not_given(), ["gravity", "rotor inertia"]);
        let given =
            Arm::avena().to_toml().replacen("rotor_inertia_kg_m2 = 0.7", "rotor_inertia_kg_m2 = 0.0", 1);
        assert_eq!(Arm::parse(&given).unwrap().device_differences(&Config::avena()).len(), 1);
    }

    #[test]
    fn j55_a_motion_is_checked_against_the_tighter_of_both_limits() {
        let mut arm = Arm::avena();
        arm.joints[0].velocity_max = 3.0;
        arm.joints[1].velocity_max = 0.5;
        arm.joints[2].position_min = -1.0;
        let config = arm.config_on_device(&Config::avena());
        assert_eq!(config.joints[0].velocity_max, 1.5);
        assert_eq!(config.joints[1].velocity_max, 0.5);
        assert_eq!(config.joints[2].position_min, -1.0);
        assert!(config.joints.iter().all(|j| j.position_min < j.position_max));
    }
}
