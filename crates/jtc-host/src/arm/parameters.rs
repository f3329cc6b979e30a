//! Parameters for a controller, and the checks of these parameters before they are sent.

use host_kit::{Diagnose, Diagnosis, ErrorKind};
use jtc_core::{Config, Friction, JOINTS, OutOfBounds, PidGains, TableOf};
use jtc_dynamics::ArmModel;
use jtc_wire::Joint;

/// Set of parameters for a controller. A parameter that is `None` is not sent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterSet {
    /// Friction compensation.
    pub friction: Option<Friction>,
    /// Gains of each joint.
    pub pid: Option<[PidGains; JOINTS]>,
    /// Kinematics and masses of the arm.
    pub model: Option<ArmModel>,
}

/// Reason why parameters cannot be sent to a controller.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParameterError {
    /// A number cannot be represented in its serial frame.
    #[error("{what} of {joint}: {value} does not fit into a 32-bit float")]
    NotFinite {
        /// Name of the number.
        what: &'static str,
        /// Joint to which the number belongs.
        joint: Joint,
        /// Value of the number.
        value: f64,
    },
    /// The lower bound of the integral is above the upper bound.
    #[error("integral of {joint}: lower bound {min} is above upper bound {max}")]
    IntegralBounds {
        /// Joint to which the bounds belong.
        joint: Joint,
        /// Lower bound of the integral, rad·s.
        min: f64,
        /// Upper bound of the integral, rad·s.
        max: f64,
    },
    /// The values of a table axis do not increase.
    #[error("friction table of {joint}: {axis} {after} at place {place} is not greater than {before}")]
    Axis {
        /// Joint to which the table belongs.
        joint: Joint,
        /// Name of the axis: "velocity" or "temperature".
        axis: &'static str,
        /// Position on the axis, counted from 1. The value at this position is not larger than the previous value.
        place: usize,
        /// Value before position `place`.
        before: f32,
        /// Value at position `place`.
        after: f32,
    },
    /// The arm model is not physically possible.
    #[error("arm model: {0}")]
    Model(jtc_dynamics::ModelError),
}

/// Parameter that is out of the bounds of a controller (J-06).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// Joint of the parameter; `None` for a parameter of the arm model.
    pub joint: Option<Joint>,
    /// Name, value and bounds of the parameter.
    pub bounds: OutOfBounds,
}

impl std::fmt::Display for Beyond {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let OutOfBounds { what, velocity, value, low, high } = self.bounds;
        if let Some(joint) = self.joint {
            write!(f, "{joint}: ")?;
        }
        write!(f, "{what} ")?;
        if let Some(velocity) = velocity {
            write!(f, "at {velocity:.3} rad/s ")?;
        }
        let short = |v: f64| (v * 1e6).round() / 1e6;
        write!(f, "{} is outside {}..{}", short(value), short(low), short(high))
    }
}

impl Diagnose for ParameterError {
    fn diagnosis(&self) -> Diagnosis {
        Diagnosis::new(ErrorKind::Usage, "parameter", "correct the file; nothing was sent")
    }
}

impl ParameterSet {
    /// Returns `true` if the set contains no parameter.
    pub fn is_empty(&self) -> bool {
        self.friction.is_none() && self.pid.is_none() && self.model.is_none()
    }

    /// Returns the names of the missing parameters. A controller enables an arm only after it has received all
    /// parameters.
    pub fn missing(&self) -> Vec<&'static str> {
        let parts = [
            (self.friction.is_none(), "friction"),
            (self.pid.is_none(), "PID gains"),
            (self.model.is_none(), "arm model"),
        ];
        parts.into_iter().filter_map(|(lacks, name)| lacks.then_some(name)).collect()
    }

    /// Returns the first parameter that is out of the bounds of a controller with these settings (J-06). After a
    /// controller has refused the parameters, this parameter is named in the error message.
    pub fn beyond(&self, config: &Config) -> Option<Beyond> {
        let bounds = &config.parameter_bounds;
        let joints = Joint::ALL.into_iter().zip(&config.joints);
        let of_joint = |joint: Joint, checked: Result<(), OutOfBounds>| {
            checked.err().map(|bounds| Beyond { joint: Some(joint), bounds })
        };
        let friction = joints.clone().find_map(|(j, joint)| match &self.friction {
            Some(Friction::Polynomial(c)) => of_joint(j, bounds.check_polynomial(&c[j.index()], joint)),
            Some(Friction::Table(t)) => of_joint(j, bounds.check_table(&t[j.index()], joint)),
            None => None,
        });
        let gains = || {
            joints
                .clone()
                .find_map(|(j, joint)| of_joint(j, bounds.check_gains(&self.pid?[j.index()], joint)))
        };
        let masses = || {
            let bounds = bounds.check_masses(self.model.as_ref()?).err()?;
            Some(Beyond { joint: None, bounds })
        };
        friction.or_else(gains).or_else(masses)
    }

    /// Checks the parameters before they are sent. The check finds many of the values that the controller would refuse with "incorrect
    /// value" (J-06).
    ///
    /// # Errors
    ///
    /// Returns an error with the first number that is out of range for its serial frame, contradicts another number, or is not physically
    /// possible.
    pub fn check(&self) -> Result<(), ParameterError> {
        match &self.friction {
            Some(Friction::Polynomial(c)) => {
                for (j, c) in Joint::ALL.into_iter().zip(c) {
                    c.iter().try_for_each(|v| finite("friction coefficient", j, *v))?;
                }
            }
            Some(Friction::Table(tables)) => {
                Joint::ALL.into_iter().zip(tables.iter()).try_for_each(|(j, t)| check_table(j, t))?;
            }
            None => {}
        }
        for (j, g) in Joint::ALL.into_iter().zip(self.pid.iter().flatten()) {
            [g.kp, g.ki, g.kd, g.int_min, g.int_max].into_iter().try_for_each(|v| finite("gain", j, v))?;
            if g.int_min > g.int_max {
                return Err(ParameterError::IntegralBounds { joint: j, min: g.int_min, max: g.int_max });
            }
        }
        if let Some(model) = &self.model {
            model.check().map_err(ParameterError::Model)?;
        }
        Ok(())
    }
}

fn finite(what: &'static str, joint: Joint, value: f64) -> Result<(), ParameterError> {
    if (value as f32).is_finite() { Ok(()) } else { Err(ParameterError::NotFinite { what, joint, value }) }
}

/// Checks that the values of both table axes increase and that all numbers fit into their serial frames.
pub(super) fn check_table(j: Joint, t: &TableOf<f32>) -> Result<(), ParameterError> {
    for (axis, values) in [("velocity", &t.velocity), ("temperature", &t.temperature)] {
        values.iter().try_for_each(|v| finite("friction table axis", j, f64::from(*v)))?;
        for (i, w) in values.windows(2).enumerate() {
            if w[1] <= w[0] {
                return Err(ParameterError::Axis { joint: j, axis, place: i + 2, before: w[0], after: w[1] });
            }
        }
    }
    t.torque.iter().flatten().try_for_each(|v| finite("friction torque", j, f64::from(*v)))
}
