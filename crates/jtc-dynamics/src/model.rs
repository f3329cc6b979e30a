//! The model of an arm (joint origins, link masses and inertias), and the check that an arm with these numbers can exist.

use core::fmt;

use crate::rotation::{Mat3, principal_moments};

/// Number of actuated joints, all revolute.
pub const JOINTS: usize = 6;

/// Values of the joints, base to wrist. The unit depends on the quantity.
pub type JointVec = [f64; JOINTS];

/// A frame relative to its parent frame, as in URDF. The frame results from a translation by `xyz` (m), followed by the rotation
/// Rz(yaw)·Ry(pitch)·Rx(roll) (rad).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Origin {
    /// Translation in the parent frame, m.
    pub xyz: [f64; 3],
    /// Roll, pitch, yaw, rad. In a joint origin, an angle within 2 µrad of a multiple of π/2 is replaced by that multiple.
    pub rpy: [f64; 3],
}

/// A rigid link: mass, centre of mass, and inertia about the centre of mass. The link frame is the frame of the joint that moves the link.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Link {
    /// Centre of mass (`xyz`, m) and orientation of the inertia frame (`rpy`, rad), both in the link frame.
    pub origin: Origin,
    /// Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the centre of mass in the frame of `origin`, kg·m².
    pub inertia: [f64; 6],
    /// Mass, kg.
    pub mass: f64,
}

/// The arm as rule J-40 and the ArmModel frame define it. Every joint rotates about the z axis of its frame.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct ArmModel {
    /// `joints[i]` is the frame of link i+1 in the frame of link i, at position 0 of the joint. `joints[6]` is the frame of the fixed
    /// flange in the frame of link 6.
    pub joints: [Origin; 7],
    /// `links[0]` is the base, which does not move.
    pub links: [Link; 7],
}

/// Numeric field of a joint or a link of an [`ArmModel`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Field {
    /// Component of the translation of a joint origin (m); index 0..3 for x, y, z.
    JointXyz(usize),
    /// Component of the rotation of a joint origin (rad); index 0..3 for roll, pitch, yaw.
    JointRpy(usize),
    /// Component of the centre of mass of a link (m); index 0..3 for x, y, z.
    LinkXyz(usize),
    /// Component of the orientation of a link's inertia frame (rad); index 0..3 for roll, pitch, yaw.
    LinkRpy(usize),
    /// Component of the inertia of a link (kg·m²); index 0..6 for Ixx, Ixy, Ixz, Iyy, Iyz, Izz.
    Inertia(usize),
    /// Mass of a link (kg).
    Mass,
}

/// Reason why an arm model is not physically possible (J-06).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ModelError {
    /// A number is NaN or infinite.
    NotFinite {
        /// Index of the joint or link that contains `field`, 0..7.
        index: usize,
        /// Number that is NaN or infinite.
        field: Field,
        /// Value of the number, in the unit of `field`.
        value: f64,
    },
    /// An angle is too large to be meaningful.
    AngleTooLarge {
        /// Index of the joint or link that contains `field`, 0..7.
        index: usize,
        /// Field that contains the angle.
        field: Field,
        /// Value of the angle, rad.
        value: f64,
        /// Largest magnitude, rad.
        limit: f64,
    },
    /// A mass is negative.
    MassNegative {
        /// Index of the link, 0..7.
        link: usize,
        /// Mass of the link, kg.
        mass: f64,
    },
    /// A link from 1 to 5 has no mass.
    MassZero {
        /// Link number, 1..=5.
        link: usize,
    },
    /// A link with mass has a negative principal moment of inertia.
    InertiaNegative {
        /// Index of the link, 0..7.
        link: usize,
        /// Smallest principal moment, kg·m²; at least 0 is required.
        moment: f64,
    },
    /// A principal moment of a link with mass is larger than the sum of the other two, which is impossible.
    InertiaTriangle {
        /// Index of the link, 0..7.
        link: usize,
        /// Largest principal moment, kg·m².
        moment: f64,
        /// Sum of the other two principal moments, kg·m²; this is the limit for `moment`.
        limit: f64,
    },
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let pick = |names: &[&'static str], i: usize| names.get(i).copied().unwrap_or("?");
        let xyz = ["x", "y", "z"];
        let rpy = ["roll", "pitch", "yaw"];
        match *self {
            Self::JointXyz(i) => write!(f, "origin {}", pick(&xyz, i)),
            Self::JointRpy(i) => write!(f, "origin {}", pick(&rpy, i)),
            Self::LinkXyz(i) => write!(f, "centre of mass {}", pick(&xyz, i)),
            Self::LinkRpy(i) => write!(f, "inertia frame {}", pick(&rpy, i)),
            Self::Inertia(i) => f.write_str(pick(&["ixx", "ixy", "ixz", "iyy", "iyz", "izz"], i)),
            Self::Mass => f.write_str("mass"),
        }
    }
}

impl Field {
    fn owner(&self) -> &'static str {
        match self {
            Self::JointXyz(_) | Self::JointRpy(_) => "joint",
            _ => "link",
        }
    }
}

impl fmt::Display for ModelError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NotFinite { index, field, value } => {
                write!(f, "{} {index}: {field} is {value}, not a finite number", field.owner())
            }
            Self::AngleTooLarge { index, field, value, limit } => {
                write!(
                    f,
                    "{} {index}: {field} is {value} rad, limit {limit} rad; the value may be in degrees",
                    field.owner()
                )
            }
            Self::MassNegative { link, mass } => {
                write!(f, "link {link}: mass is {mass} kg, must not be negative")
            }
            Self::MassZero { link } => {
                write!(f, "link {link}: mass is 0, only links 0 and 6 may have no mass")
            }
            Self::InertiaNegative { link, moment } => write!(
                f,
                "link {link}: smallest principal moment of inertia is {moment} kg m2, must not be negative; check the sign of the products of \
                 inertia"
            ),
            Self::InertiaTriangle { link, moment, limit } => write!(
                f,
                "link {link}: largest principal moment of inertia is {moment} kg m2, more than the sum of the others, {limit} kg m2; check the unit \
                 and the order of ixx ixy ixz iyy iyz izz"
            ),
        }
    }
}

impl core::error::Error for ModelError {}

impl ModelError {
    /// Returns the index of the joint origin or link with the error, 0..7.
    pub const fn index(&self) -> usize {
        match *self {
            Self::NotFinite { index, .. } | Self::AngleTooLarge { index, .. } => index,
            Self::MassNegative { link, .. }
            | Self::MassZero { link }
            | Self::InertiaNegative { link, .. }
            | Self::InertiaTriangle { link, .. } => link,
        }
    }

    /// Returns true if the error is in a joint origin, false if it is in a link.
    pub const fn is_of_joint(&self) -> bool {
        match self {
            Self::NotFinite { field, .. } | Self::AngleTooLarge { field, .. } => {
                matches!(field, Field::JointXyz(_) | Field::JointRpy(_))
            }
            _ => false,
        }
    }
}

/// Largest angle in a model, rad. This limit is far above meaningful angles and below [`crate::SIN_COS_MAX`].
const ANGLE_MAX: f64 = 1.0e6;
/// Tolerance of the inertia limits, relative to the largest moment, because models are rounded to f32.
const INERTIA_TOLERANCE: f64 = 1.0e-6;

impl ArmModel {
    /// Checks that the arm model is physically possible (J-06). All numbers must be finite, no mass may be negative, and links 1 to 5 must
    /// have a mass. The inertia of every link with mass must be physically possible, except for f32 rounding errors.
    ///
    /// # Errors
    ///
    /// Returns an error with the first invalid number; joints are checked before links. See [`ModelError`].
    pub fn check(&self) -> Result<(), ModelError> {
        for (index, joint) in self.joints.iter().enumerate() {
            finite(index, &joint.xyz, Field::JointXyz)?;
            angles(index, &joint.rpy, Field::JointRpy)?;
        }
        for (index, link) in self.links.iter().enumerate() {
            finite(index, &link.origin.xyz, Field::LinkXyz)?;
            angles(index, &link.origin.rpy, Field::LinkRpy)?;
            finite(index, &link.inertia, Field::Inertia)?;
            finite(index, &[link.mass], |_| Field::Mass)?;
            link.check_mass(index)?;
        }
        Ok(())
    }
}

impl Link {
    fn check_mass(&self, link: usize) -> Result<(), ModelError> {
        if self.mass < 0.0 {
            return Err(ModelError::MassNegative { link, mass: self.mass });
        }
        if self.mass == 0.0 {
            return if (1..=5).contains(&link) { Err(ModelError::MassZero { link }) } else { Ok(()) };
        }
        let ([small, middle, large], tolerance) = principal_moments_of(&self.inertia);
        if small < -tolerance {
            return Err(ModelError::InertiaNegative { link, moment: small });
        }
        if large > small + middle + tolerance {
            return Err(ModelError::InertiaTriangle { link, moment: large, limit: small + middle });
        }
        Ok(())
    }
}

/// Returns the principal moments of an inertia (Ixx, Ixy, Ixz, Iyy, Iyz, Izz) in ascending order, and the tolerance for the check of these
/// moments.
pub(crate) fn principal_moments_of(inertia: &[f64; 6]) -> ([f64; 3], f64) {
    let moments = principal_moments(&symmetric(inertia));
    (moments, INERTIA_TOLERANCE * moments[2].abs().max(moments[0].abs()))
}

/// Returns the symmetric matrix with the elements Ixx, Ixy, Ixz, Iyy, Iyz, Izz.
pub(crate) fn symmetric(&[xx, xy, xz, yy, yz, zz]: &[f64; 6]) -> Mat3 {
    [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
}

fn finite(index: usize, values: &[f64], field: fn(usize) -> Field) -> Result<(), ModelError> {
    match values.iter().enumerate().find(|(_, v)| !v.is_finite()) {
        Some((i, &value)) => Err(ModelError::NotFinite { index, field: field(i), value }),
        None => Ok(()),
    }
}

fn angles(index: usize, values: &[f64; 3], field: fn(usize) -> Field) -> Result<(), ModelError> {
    finite(index, values, field)?;
    match values.iter().enumerate().find(|(_, v)| v.abs() > ANGLE_MAX) {
        Some((i, &value)) => {
            Err(ModelError::AngleTooLarge { index, field: field(i), value, limit: ANGLE_MAX })
        }
        None => Ok(()),
    }
}
