//! Arms for the simulation: the default arm, and arms that `jtc arm import` has created from arm descriptions.
use jtc_core::{Config, Friction, Parameters, PidGains};
use jtc_dynamics::{ArmModel, Dynamics, Link, Origin};
use jtc_wire::{DataStatus, FrameType};
use toml::{Table, Value};

use super::{LuGre, Random, highest, loaded, shares_of};
use crate::rig::{Rig, floats, model_body};

/// Arm with the data that its controller receives.
#[derive(Clone)]
pub(crate) struct ArmFile {
    pub name: &'static str,
    pub config: Config,
    pub model: ArmModel,
    pub pid: [PidGains; 6],
    pub polynomial: [[f64; 6]; 6],
}

/// Universal Robots' UR5, from its description in example-robot-data (BSD-3-Clause).
const UR5: &str = include_str!("ur5.toml");
/// Unitree's Z1, also from example-robot-data (BSD-3-Clause).
const Z1: &str = include_str!("z1.toml");

impl ArmFile {
    pub(crate) fn avena() -> Self {
        let Parameters { model, pid, friction } = Parameters::avena();
        let Friction::Polynomial(polynomial) = friction else { panic!("a polynomial") };
        Self { name: "avena", config: Config::avena(), model, pid, polynomial }
    }

    pub(crate) fn ur5() -> Self {
        Self::parse("ur5", UR5)
    }

    pub(crate) fn z1() -> Self {
        Self::parse("z1", Z1)
    }

    /// Returns the UR5 with friction in its joints, both in the simulation and in its arm file.
    pub(crate) fn rough_ur5() -> Self {
        let friction = [(8.0, 20.0), (8.0, 20.0), (6.0, 15.0), (2.0, 5.0), (2.0, 5.0), (2.0, 5.0)];
        Self {
            name: "rough ur5",
            polynomial: friction.map(|(c, v)| [c, v, 0.0, 0.0, 0.0, 0.0]),
            ..Self::ur5()
        }
    }

    /// Returns the arm without friction, both in the simulation and in its arm file.
    pub(crate) fn slick(self) -> Self {
        Self { polynomial: [[0.0; 6]; 6], ..self }
    }

    /// Returns the torques as shares of the torque limits of the arm.
    pub(crate) fn shares(&self, torque: &[f64; 6]) -> [f64; 6] {
        shares_of(torque, &self.config)
    }

    /// Returns a random pose (rad) inside the position ranges, and the shares of the torque limits that hold the arm
    /// in this pose with a payload of `mass` kg at the flange. Each share is less than `most`.
    pub(crate) fn pose(&self, random: &mut Random, mass: f64, most: f64) -> ([f64; 6], [f64; 6]) {
        let dynamics = Dynamics::new(&loaded(self.model, mass), self.config.gravity);
        loop {
            let pose = core::array::from_fn(|j| {
                let (low, high) = self.config.position_range(j);
                random.between(low + 0.05, high - 0.05)
            });
            let standing = self.shares(&dynamics.gravity_torque(&pose));
            if highest(&standing) < most {
                return (pose, standing);
            }
        }
    }

    /// Returns the friction of the joints at the temperature of the rig, multiplied by `factor`. Stiction is 20 % higher than Coulomb
    /// friction.
    pub(crate) fn friction(&self, factor: f64) -> [LuGre; 6] {
        self.polynomial.map(|c| {
            if c[0] == 0.0 && c[1] == 0.0 {
                return LuGre::NONE;
            }
            let factor = factor * (1.0 + c[4] * (25.0 - c[5])).clamp(0.2, 2.0);
            LuGre {
                coulomb: factor * c[0],
                stiction: 1.2 * factor * c[0],
                stribeck: 0.02,
                stiffness: 100_000.0,
                damping: 20.0,
                viscous: factor * c[1],
            }
        })
    }

    /// Sends the parameters of the arm to the controller of a rig.
    pub(crate) fn give(&self, rig: &mut Rig) {
        rig.send(FrameType::FrictionPolynomial, &floats(self.polynomial.iter().flatten().map(|c| *c as f32)));
        let gains = self.pid.iter().flat_map(|g| [g.kp, g.ki, g.kd, g.int_min, g.int_max]);
        rig.send(FrameType::PidParam, &floats(gains.map(|g| g as f32)));
        assert_eq!(rig.ask(FrameType::ArmModel, &model_body(&self.model)), DataStatus::NoError);
    }

    fn parse(name: &'static str, text: &str) -> Self {
        let file: Table = text.parse().unwrap();
        let (joints, links) = (file["joint"].as_array().unwrap(), file["link"].as_array().unwrap());
        let mut arm = Self { name, ..Self::avena() };
        arm.config.gravity = row(&file["gravity_m_s2"]);
        for (to, from) in arm.model.joints.iter_mut().zip(joints) {
            *to = Origin { xyz: row(&from["origin_xyz_m"]), rpy: row(&from["origin_rpy_rad"]) };
        }
        for (to, from) in arm.model.links.iter_mut().zip(links) {
            let origin = Origin { xyz: row(&from["com_xyz_m"]), rpy: row(&from["com_rpy_rad"]) };
            *to = Link { origin, inertia: row(&from["inertia_kg_m2"]), mass: number(&from["mass_kg"]) };
        }
        for (j, from) in joints[..6].iter().enumerate() {
            let to = &mut arm.config.joints[j];
            to.position_min = number(&from["position_min_rad"]);
            to.position_max = number(&from["position_max_rad"]);
            to.velocity_max = number(&from["velocity_max_rad_s"]);
            to.acceleration_max = number(&from["acceleration_max_rad_s2"]);
            to.torque_max = number(&from["torque_max_nm"]);
            to.position_error_max = number(&from["position_error_max_rad"]);
            to.rotor_inertia = number(&from["rotor_inertia_kg_m2"]);
            to.teach_damping = number(&from["teach_damping_nm_s_rad"]);
            let pid = &from["pid"];
            arm.pid[j] = PidGains {
                kp: number(&pid["kp"]),
                ki: number(&pid["ki"]),
                kd: number(&pid["kd"]),
                int_min: number(&pid["int_min_rad_s"]),
                int_max: number(&pid["int_max_rad_s"]),
            };
            arm.polynomial[j] = row(&from["friction_polynomial"]);
        }
        arm
    }
}

fn number(value: &Value) -> f64 {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64)).unwrap()
}

fn row<const N: usize>(value: &Value) -> [f64; N] {
    value.as_array().unwrap().iter().map(number).collect::<Vec<_>>().try_into().unwrap()
}
