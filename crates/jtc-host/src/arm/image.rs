//! Binary image of an arm, as a controller with extensions stores it (J-54). The module also computes the hash of the
//! image (J-52) and its differences from an arm file (J-55).

use jtc_core::settings::{self, SettingError};
use jtc_core::{Config, Friction, JOINTS, PidGains, TableOf};
use jtc_dynamics::{ArmModel, Link, Origin};
use jtc_wire::field::{frame, image};
use jtc_wire::{ArmImage, EncodeError, FloatName, Floats, FrictionImage, Hash, Joint, Name, SettingValue};

use super::{Arm, Difference, values};
use crate::frame::model_rows;

/// Reason why bytes are not the image of an arm.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The bytes are not an image of a known version.
    #[error("not an arm image that this program can read")]
    Form,
    /// A setting is out of range, or two settings contradict each other.
    #[error("{0}")]
    Setting(SettingError),
}

impl Arm {
    /// Returns the values of all settings of a controller with this arm, in the order of the settings table. If the arm does not have a
    /// value, the value of the built-in arm is used.
    pub fn settings(&self) -> Vec<SettingValue> {
        settings::values(&self.config(), 0, true).collect()
    }

    /// Returns the binary image that a controller stores for this arm. Returns `None` if the gains or the friction
    /// are missing.
    ///
    /// # Errors
    ///
    /// Returns an error for a number that is out of range for its serial frame.
    pub fn image(&self) -> Result<Option<Vec<u8>>, EncodeError> {
        let (Some(pid), Some(friction)) = (&self.pid, self.friction()) else { return Ok(None) };
        let settings = self.settings();
        let mut bytes = image::MAGIC.to_vec();
        bytes.extend([image::VERSION, matches!(friction, Friction::Table(_)).into()]);
        bytes.extend((settings.len() as u16).to_be_bytes());
        let parts = [
            crate::frame::pid(pid)?,
            crate::frame::arm_model(&self.model)?,
            crate::frame::friction(&friction)?,
        ];
        for part in parts {
            bytes.extend(&part[frame::body(part.len())]);
        }
        settings.iter().for_each(|value| bytes.extend(value.emit()));
        bytes.extend(Name::cut(&self.name).as_bytes());
        Ok(Some(bytes))
    }

    /// Returns the hash that a controller reports for this arm. Returns `None` if the gains or the friction are missing.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`Arm::image`].
    pub fn hash(&self) -> Result<Option<u64>, EncodeError> {
        Ok(self.image()?.map(|image| Hash::of_image(&image)))
    }

    /// Creates the arm from the binary image that a controller stores.
    ///
    /// # Errors
    ///
    /// Returns an error if the bytes are not an image, or the settings do not belong to an arm.
    pub fn from_image(bytes: &[u8]) -> Result<Self, ImageError> {
        let image = ArmImage::parse(bytes).ok_or(ImageError::Form)?;
        let config =
            settings::with_values(&Config::avena(), image.settings.iter()).map_err(ImageError::Setting)?;
        let (polynomial, table) = match image.friction {
            FrictionImage::Polynomial(floats) => (Some(polynomials(&floats)), None),
            FrictionImage::Table(floats) => (None, Some(Box::new(tables(&floats)))),
        };
        Ok(Self {
            name: image.name.to_string(),
            joints: config.joints,
            rotors_given: [true; JOINTS],
            // A controller does not know the drives. Its arm was checked with the drives before it was sent.
            drive_torque_max: std::array::from_fn(|i| {
                jtc_bus::DRIVE_TORQUE_MAX[i].max(config.joints[i].torque_max * config.joints[i].torque_gain)
            }),
            gravity: Some(config.gravity),
            others: others(&config),
            pid: Some(gains(&image.pid)),
            model: model(&image.model),
            polynomial,
            table,
            ..Self::nameless()
        })
    }

    /// Compares each value of this arm with the arm of a controller and returns all differences. The comparison skips values that are
    /// missing in the arm file.
    pub fn differences(&self, device: &Self) -> Vec<Difference> {
        let mut all = Vec::new();
        let mut compare = |name: String, joint, file: f64, device: f64, unit| {
            // Gains, friction and model are sent as 32-bit floats, so the values are compared as 32-bit floats.
            if file as f32 != device as f32 {
                all.push(Difference { name, joint, file, device, unit });
            }
        };
        let device_config = device.config();
        for value in self.settings() {
            let joint = Joint::from_number(value.joint.into());
            let Some(row) = settings::setting(value.setting) else { continue };
            if let (true, Some(has)) = (self.gives(row, joint), row.get(&device_config, value.joint)) {
                compare(row.name.to_owned(), joint, value.value, has, row.unit);
            }
        }
        if let (Some(own), Some(has)) = (&self.pid, &device.pid) {
            for (joint, (own, has)) in Joint::ALL.into_iter().zip(own.iter().zip(has)) {
                for (kind, get) in values::gains(&device_config.parameter_bounds) {
                    compare(kind.name.to_owned(), Some(joint), get(own), get(has), kind.unit);
                }
            }
        }
        for (name, own, has) in model_numbers(&self.model, &device.model) {
            compare(name, None, own, has, "");
        }
        self.compare_friction(device, &mut compare);
        all
    }

    fn compare_friction(
        &self,
        device: &Self,
        compare: &mut impl FnMut(String, Option<Joint>, f64, f64, &'static str),
    ) {
        let has = device.friction();
        // An arm file may contain both a friction table and a friction polynomial. The one that the controller uses
        // is compared.
        let own = match has {
            Some(Friction::Table(_)) => self.table.as_ref().map(|t| Friction::Table(**t)).or(self.friction()),
            _ => self.friction(),
        };
        match (own, has) {
            (Some(Friction::Polynomial(own)), Some(Friction::Polynomial(has))) => {
                for (joint, (own, has)) in Joint::ALL.into_iter().zip(own.iter().zip(&has)) {
                    for (i, (own, has)) in own.iter().zip(has).enumerate() {
                        compare(format!("friction_polynomial.c{i}"), Some(joint), *own, *has, "");
                    }
                }
            }
            (Some(Friction::Table(own)), Some(Friction::Table(has))) => {
                for (joint, (own, has)) in Joint::ALL.into_iter().zip(own.iter().zip(&has)) {
                    let numbers = |t: &TableOf<f32>| {
                        let torque = t.torque.into_iter().flatten();
                        t.velocity.into_iter().chain(t.temperature).chain(torque).collect::<Vec<_>>()
                    };
                    // Two friction tables can differ in up to 440 numbers, so the list contains only the first
                    // difference and the number of differences.
                    let pairs = numbers(own).into_iter().zip(numbers(has));
                    if let Some((own, has)) = pairs.clone().find(|(own, has)| own != has) {
                        let count = pairs.filter(|(own, has)| own != has).count();
                        let name = format!("friction_table ({count} numbers, the first)");
                        compare(name, Some(joint), own.into(), has.into(), "");
                    }
                }
            }
            // Only one of the two has a friction table. The other has a friction polynomial.
            (Some(own), Some(has)) => {
                let kind = |friction: &Friction| f64::from(u8::from(matches!(friction, Friction::Table(_))));
                compare("friction (0 polynomial, 1 table)".into(), None, kind(&own), kind(&has), "");
            }
            _ => {}
        }
    }
}

/// Returns the settings that differ from the built-in arm and do not have their own key in an arm file.
fn others(config: &Config) -> Vec<SettingValue> {
    let built_in = Config::avena();
    let built_in = settings::values(&built_in, 0, true);
    settings::values(config, 0, true)
        .zip(built_in)
        .filter(|(own, built_in)| {
            own != built_in && settings::setting(own.setting).is_some_and(super::has_no_key)
        })
        .map(|(own, _)| own)
        .collect()
}

fn at(floats: &Floats<'_>, i: usize) -> f64 {
    floats.get(i).unwrap_or(f32::NAN).into()
}

fn gains(floats: &Floats<'_>) -> [PidGains; JOINTS] {
    std::array::from_fn(|j| {
        let at = |i| at(floats, 5 * j + i);
        PidGains { kp: at(0), ki: at(1), kd: at(2), int_min: at(3), int_max: at(4) }
    })
}

fn model(floats: &Floats<'_>) -> ArmModel {
    let take = |from: usize| std::array::from_fn(|i| at(floats, from + i));
    let origin = |from: usize| Origin { xyz: take(from), rpy: take(from + 3) };
    ArmModel {
        joints: std::array::from_fn(|i| origin(6 * i)),
        links: std::array::from_fn(|i| {
            let from = 42 + 13 * i;
            let inertia = std::array::from_fn(|i| at(floats, from + 6 + i));
            Link { origin: origin(from), inertia, mass: at(floats, from + 12) }
        }),
    }
}

fn polynomials(floats: &Floats<'_>) -> [[f64; 6]; JOINTS] {
    std::array::from_fn(|j| std::array::from_fn(|i| at(floats, 6 * j + 5 - i)))
}

fn tables(floats: &Floats<'_>) -> [TableOf<f32>; JOINTS] {
    let at = |i: usize| floats.get(i).unwrap_or(f32::NAN);
    std::array::from_fn(|j| {
        let from = 440 * j;
        TableOf {
            velocity: std::array::from_fn(|i| at(from + i)),
            temperature: std::array::from_fn(|i| at(from + 20 + i)),
            torque: std::array::from_fn(|v| std::array::from_fn(|t| at(from + 40 + 20 * v + t))),
        }
    })
}

/// Returns each number of two arm models, as the name of the number, its value in `own` and its value in `has`.
fn model_numbers(own: &ArmModel, has: &ArmModel) -> Vec<(String, f64, f64)> {
    let (own, has) = (model_rows(own), model_rows(has));
    let mut all = Vec::new();
    for (i, (own, has)) in own.0.iter().zip(&has.0).enumerate() {
        let part =
            if i < JOINTS { format!("origin of joint {}", i + 1) } else { "origin of the flange".into() };
        for ((name, own), has) in FloatName::LINK.iter().zip(own).zip(has) {
            all.push((format!("{part}, {name}"), *own, *has));
        }
    }
    for (i, (own, has)) in own.1.iter().zip(&has.1).enumerate() {
        for ((name, own), has) in FloatName::LINK.iter().zip(own).zip(has) {
            all.push((format!("link {i}, {name}"), *own, *has));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn j54_an_arm_comes_back_from_its_image() {
        let mut arm = Arm::avena();
        arm.joints[3].torque_gain = 1.3;
        let image = arm.image().unwrap().expect("it is complete");
        let again = Arm::from_image(&image).unwrap();
        assert!(arm.differences(&again).is_empty(), "{:?}", arm.differences(&again));
        assert_eq!(again.image().unwrap().as_deref(), Some(&image[..]));
        assert_eq!(again.name, "avena");
        // The image stays the same after the arm is written to a file and read again.
        let file = Arm::from_toml(&again.to_toml()).unwrap();
        assert_eq!(file.image().unwrap().as_deref(), Some(&image[..]));
        let table = Arm { polynomial: None, ..arm.clone() };
        let image = table.image().unwrap().expect("it is complete");
        assert_eq!(Arm::from_image(&image).unwrap().image().unwrap(), Some(image));
        assert_eq!(Arm { pid: None, ..arm }.image(), Ok(None));
    }

    /// Controller settings without a key of their own are written to the `[settings]` table of the arm file and read
    /// from it again.
    #[test]
    fn j53_settings_of_the_controller_travel_with_the_file() {
        let text =
            Arm::avena().to_toml() + "\n[settings]\nramp_ms = 300\ngripper = false\nkp_max = 60000.0\n";
        let arm = Arm::from_toml(&text).unwrap();
        let config = arm.config();
        assert_eq!((config.ramp_ms, config.gripper, config.parameter_bounds.kp_max), (300, false, 60_000.0));
        let image = arm.image().unwrap().expect("it is complete");
        let again = Arm::from_image(&image).unwrap();
        assert_eq!(again.config(), config);
        assert_eq!(Arm::from_toml(&again.to_toml()).unwrap().config(), config);
        assert_eq!(Arm::avena().differences(&again).len(), 3);
        for (wrong, named) in [
            ("ramp_ms = 3", "20 to 5000"),
            ("ramp = 300", "ramp"),
            ("gripper = 0.5", "gripper"),
            ("speed = 0.5", "speed"),
            ("torque_max_nm = 5.0", "torque_max_nm"),
            ("ramp_ms = \"long\"", "ramp_ms"),
        ] {
            let text = format!("{}\n[settings]\n{wrong}\n", Arm::avena().to_toml());
            let error = Arm::from_toml(&text).unwrap_err().to_string();
            assert!(error.contains(named), "{wrong}: {error}");
        }
    }

    #[test]
    fn j55_every_number_that_differs_is_named() {
        let arm = Arm::avena();
        let mut other = arm.clone();
        other.gravity = Some([0.0, 0.1, -9.81]);
        other.joints[2].velocity_max = 1.0;
        other.model.links[4].mass += 0.5;
        other.model.joints[6].xyz[1] += 0.01;
        other.pid.as_mut().unwrap()[5].kd += 1.0;
        other.polynomial.as_mut().unwrap()[1][2] += 1.0;
        let names: Vec<_> =
            arm.differences(&other).iter().map(|d| (d.name.clone(), d.joint.map(Joint::number))).collect();
        let expected = [
            ("velocity_max_rad_s", Some(3)),
            ("gravity_y_m_s2", None),
            ("pid.kd", Some(6)),
            ("origin of the flange, y", None),
            ("link 4, mass", None),
            ("friction_polynomial.c2", Some(2)),
        ];
        assert_eq!(names, expected.map(|(name, joint)| (name.to_owned(), joint)));
        // If a value is missing in a file, no difference is reported for this value.
        let open = Arm { gravity: None, pid: None, polynomial: None, table: None, ..arm.clone() };
        other.joints[2] = arm.joints[2];
        other.model = arm.model;
        assert!(open.differences(&other).is_empty());
    }
}
