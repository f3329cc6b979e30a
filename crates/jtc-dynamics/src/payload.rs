//! A body that is fixed to the flange, and the inertias of an arm with this body (J-60).

use core::fmt;

use crate::chain::BaseInertialParameters;
use crate::model::{JOINTS, principal_moments_of};

/// A rigid body fixed to the flange.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Payload {
    /// Mass, kg; 0 means no payload.
    pub mass: f64,
    /// Centre of mass in the flange frame, m.
    pub com: [f64; 3],
    /// Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the centre of mass, along the axes of the flange frame, kg·m². Zeros mean a point mass.
    pub inertia: [f64; 6],
}

/// Reason why a payload is not physically possible.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum PayloadError {
    /// A number of the payload is NaN or infinite.
    NotFinite,
    /// The mass of the payload is negative.
    MassNegative {
        /// Mass of the payload, kg.
        mass: f64,
    },
    /// The payload has an inertia but no mass.
    MassZero,
    /// The smallest principal moment of inertia of the payload is negative.
    InertiaNegative {
        /// The smallest principal moment, kg·m².
        moment: f64,
    },
    /// The largest principal moment of inertia of the payload is larger than the sum of the other two principal moments.
    InertiaTriangle {
        /// The largest principal moment, kg·m².
        moment: f64,
        /// Sum of the other two principal moments, kg·m²; this is the limit for `moment`.
        limit: f64,
    },
}

impl fmt::Display for PayloadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NotFinite => f.write_str("payload: a number is not finite"),
            Self::MassNegative { mass } => {
                write!(f, "payload: mass is {mass} kg, must not be negative; 0 is no payload")
            }
            Self::MassZero => f.write_str("payload: inertia without a mass; give the mass in kg"),
            Self::InertiaNegative { moment } => write!(
                f,
                "payload: smallest principal moment of inertia is {moment} kg m2, must not be negative; check the sign of the products of inertia"
            ),
            Self::InertiaTriangle { moment, limit } => write!(
                f,
                "payload: largest principal moment of inertia is {moment} kg m2, more than the sum of the others, {limit} kg m2; check the unit, \
                 and that the inertia is about the centre of mass"
            ),
        }
    }
}

impl core::error::Error for PayloadError {}

impl Payload {
    /// A payload without mass, which means that the arm has no payload.
    pub const NONE: Self = Self { mass: 0.0, com: [0.0; 3], inertia: [0.0; 6] };

    /// Checks that the payload is physically possible (J-60). The requirements are those of [`crate::ArmModel::check`] for a link.
    ///
    /// # Errors
    ///
    /// Returns an error with the first requirement that the payload does not meet.
    pub fn check(&self) -> Result<(), PayloadError> {
        let numbers = core::iter::once(&self.mass).chain(&self.com).chain(&self.inertia);
        if numbers.into_iter().any(|number| !number.is_finite()) {
            return Err(PayloadError::NotFinite);
        }
        if self.mass < 0.0 {
            return Err(PayloadError::MassNegative { mass: self.mass });
        }
        if self.mass == 0.0 {
            return if self.inertia == [0.0; 6] { Ok(()) } else { Err(PayloadError::MassZero) };
        }
        let ([small, middle, large], tolerance) = principal_moments_of(&self.inertia);
        if small < -tolerance {
            return Err(PayloadError::InertiaNegative { moment: small });
        }
        if large > small + middle + tolerance {
            return Err(PayloadError::InertiaTriangle { moment: large, limit: small + middle });
        }
        Ok(())
    }

    /// Returns true if the payload has a mass.
    pub fn is_there(&self) -> bool {
        self.mass > 0.0
    }
}

/// Base inertial parameters of the links of an arm (Gautier and Khalil 1990), including the payload. All values of the arm's dynamics that
/// depend on masses are in these parameters. The parameters are linear in the masses and in the first and second moments of the bodies. An
/// interpolation between two physical arms with the same joints is therefore also physical.
#[derive(Clone, Copy, Debug)]
pub struct LinkInertias(pub(crate) [BaseInertialParameters; JOINTS]);

impl LinkInertias {
    /// Returns the inertial parameters as plain numbers, so that they can be stored. [`from_numbers`](Self::from_numbers) restores the same
    /// inertias.
    pub fn numbers(&self) -> [[f64; 7]; JOINTS] {
        self.0.map(|BaseInertialParameters { hx, hy, xx, yy, xy, xz, yz }| [hx, hy, xx, yy, xy, xz, yz])
    }

    /// Restores the inertias from the result of [`numbers`](Self::numbers).
    pub fn from_numbers(numbers: &[[f64; 7]; JOINTS]) -> Self {
        Self(numbers.map(|[hx, hy, xx, yy, xy, xz, yz]| BaseInertialParameters {
            hx,
            hy,
            xx,
            yy,
            xy,
            xz,
            yz,
        }))
    }

    /// Interpolates linearly between `self` (`share` 0) and `other` (`share` 1).
    #[inline(always)]
    pub fn toward(&self, other: &Self, share: f64) -> Self {
        let mut between = *self;
        for (to, other) in between.0.iter_mut().zip(&other.0) {
            to.blend(other, share);
        }
        between
    }
}

impl BaseInertialParameters {
    #[inline(always)]
    fn blend(&mut self, other: &Self, share: f64) {
        let Self { hx, hy, xx, yy, xy, xz, yz } = self;
        for (mine, other) in [hx, hy, xx, yy, xy, xz, yz]
            .into_iter()
            .zip([other.hx, other.hy, other.xx, other.yy, other.xy, other.xz, other.yz])
        {
            *mine += share * (other - *mine);
        }
    }
}
