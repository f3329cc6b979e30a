//! Settings that Python passes for a simulated arm.

use jtc_core::JOINTS;
use jtc_host::trajectory::Loaded;
use jtc_sim::{DriveConfig, FaultPlan, Gear, HandPath, ModelError, SimArm, SimConfig, SimFriction, Support};
use pyo3::prelude::*;

use crate::arm::Arm;
use crate::controller::of_arm;
use crate::dynamics::{PayloadNumbers, payload};
use crate::error::Failure;

/// Model errors as Python passes them: relative errors of masses and frictions, and factors that replace random
/// errors.
type ErrorNumbers = (f64, f64, Option<[f64; 7]>, Option<[f64; JOINTS]>);

/// Arguments of `openjtc.sim`. `model_error` contains the relative errors of mass and friction, and the factors of
/// the masses and frictions.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct SimulatedArm<'py> {
    arm: Option<Bound<'py, Arm>>,
    seed: u64,
    payload: Option<PayloadNumbers>,
    model_error: Option<ErrorNumbers>,
    start: Option<[f64; JOINTS]>,
    friction: bool,
    gear_stiffness: Option<[f64; JOINTS]>,
    over_speed: Option<[f64; JOINTS]>,
}

impl SimulatedArm<'_> {
    /// Makes the configuration of the simulation, including the controller settings and the stored arm.
    pub(crate) fn config(&self) -> Result<SimConfig, Failure> {
        let arm = self.arm.as_ref().map(|arm| &*arm.get().inner);
        let mut config = match arm {
            None => SimConfig::default(),
            Some(arm) => {
                SimConfig::new(arm.config(), &arm.parameters()).with_drive_torques(arm.drive_torque_max)
            }
        };
        (config.controller, config.stored_arm) = of_arm(arm)?;
        config.seed = self.seed;
        config.arm.payload = payload(self.payload)?;
        config.model_error = ModelError::NONE;
        if let Some((mass, friction, mass_factors, friction_factors)) = self.model_error {
            // If a relative error were above 1, random masses could be negative.
            if let Some(bad) = [mass, friction].iter().find(|share| !(0.0..=1.0).contains(*share)) {
                return Err(Failure::usage(format!(
                    "model_error: relative error {bad} is out of range (0 to 1)"
                )));
            }
            let mut factors = mass_factors.iter().flatten().chain(friction_factors.iter().flatten());
            if let Some(bad) = factors.find(|factor| !(0.0..=10.0).contains(*factor)) {
                return Err(Failure::usage(format!("model_error: factor {bad} is out of range (0 to 10)")));
            }
            config.model_error = ModelError { mass, friction, mass_factors, friction_factors };
        }
        if let Some(start) = self.start {
            for (joint, (q, (low, high))) in start.iter().zip(&config.arm.stops).enumerate() {
                if !(*low..=*high).contains(q) {
                    let joint = joint + 1;
                    let what = format!(
                        "start: joint {joint} at {q} rad is outside its end stops ({low} to {high} rad)"
                    );
                    return Err(Failure::usage(what));
                }
            }
            config.start = start;
        }
        if !self.friction {
            config.arm = SimArm { friction: [const { SimFriction::Frictionless }; JOINTS], ..config.arm };
        }
        if let Some(stiffness) = self.gear_stiffness {
            in_range("gear_stiffness", &stiffness, Gear::STIFFNESS, "N·m/rad")?;
            config.arm.gears = stiffness.map(Gear::new);
        }
        if let Some(speeds) = self.over_speed {
            in_range("over_speed", &speeds, DriveConfig::OVER_SPEED, "rad/s")?;
            config.drives.iter_mut().zip(speeds).for_each(|(drive, speed)| drive.over_speed = speed);
        }
        Ok(config)
    }
}

/// Returns an error for the first number that is out of range. The range error contains the number of the joint.
fn in_range(what: &str, numbers: &[f64; JOINTS], (low, high): (f64, f64), unit: &str) -> Result<(), Failure> {
    match (1..).zip(numbers).find(|(_, number)| !(low..=high).contains(*number)) {
        None => Ok(()),
        Some((joint, number)) => Err(Failure::usage(format!(
            "{what}: joint {joint}: {number} {unit} is out of range ({low}–{high} {unit})"
        ))),
    }
}

/// Simulated time between two checks for signals (Ctrl-C), ms.
const SLICE_MS: u64 = 1_000;

/// Advances the simulation by `ms` milliseconds without holding the GIL.
pub(crate) fn pass(py: Python<'_>, ms: u64, mut millisecond: impl FnMut() + Send) -> PyResult<()> {
    let mut left = ms;
    while left > 0 {
        let slice = left.min(SLICE_MS);
        py.detach(|| (0..slice).for_each(|_| millisecond()));
        left -= slice;
        py.check_signals()?;
    }
    Ok(())
}

/// Parses the kind of support of the arm while its drives are not enabled.
pub(crate) fn support(name: &str) -> Result<Support, Failure> {
    Ok(match name {
        "brakes" => Support::Brakes,
        "stand" => Support::Stand,
        "none" => Support::None,
        other => {
            let what = format!("support: {other:?} is not valid, expected \"brakes\", \"stand\" or \"none\"");
            return Err(Failure::usage(what));
        }
    })
}

/// Parses faults from the text of a fault file. Paths of hand files are relative to the working directory of the
/// Python program.
pub(crate) fn faults(text: &str) -> Result<FaultPlan, Failure> {
    let load = |file: &str| {
        let trajectory = Loaded::load(file.as_ref(), None).map_err(|error| error.to_string())?.trajectory;
        let points = trajectory.points.iter().map(|point| point.position).collect();
        hand(points, f64::from(trajectory.step_ms) * 1e-3).map_err(|failure| failure.message.clone())
    };
    FaultPlan::from_toml_with(text, load)
        .map_err(|error| Failure::usage(error.to_string()).next("`jtc help faults` lists kinds and keys"))
}

/// Makes the path along which a simulated hand guides the arm.
pub(crate) fn hand(points: Vec<[f64; JOINTS]>, step_s: f64) -> Result<HandPath, Failure> {
    HandPath::new(points, step_s).ok_or_else(|| {
        Failure::usage(format!(
            "hand: expected at least one point and a step above 0 s; the step is {step_s} s"
        ))
    })
}
