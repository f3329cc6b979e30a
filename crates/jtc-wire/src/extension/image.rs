//! The arm image (J-54): all parameters of an arm in one block of bytes. Programs store this block, read it back and compute its hash.
use super::{NAME_LEN, Name, Values};
use crate::floats::Floats;
use crate::layout::VALUE_LEN;

/// Positions of the parts of the image.
pub mod field {
    use core::ops::Range;

    /// Magic number: the first bytes of an image.
    pub const MAGIC: [u8; 4] = *b"JTCA";
    /// Version of the image layout.
    pub const VERSION: u8 = 1;
    /// Position of the version byte.
    pub const VERSION_AT: usize = 4;
    /// Position of the byte that selects the kind of friction: 0 polynomial, 1 table.
    pub const FRICTION_AT: usize = 5;
    /// Number of settings, as a u16.
    pub const SETTINGS: Range<usize> = 6..8;
    /// Position of the gains, in the format of the body of a PidParam frame.
    pub const PID: Range<usize> = 8..128;
    /// Position of the arm model, in the format of the body of an ArmModel frame.
    pub const MODEL: Range<usize> = 128..660;
    /// Position of the friction: the body of a FrictionPolynomial frame with six coefficients per joint, or the body of a FrictionTable
    /// frame. The settings follow the friction, each in the format of a SetSettings frame. The name of the arm is at the end of the
    /// image.
    pub const FRICTION: usize = 660;
    /// Length of the friction polynomials, bytes.
    pub const POLYNOMIAL_LEN: usize = 144;
    /// Length of the friction tables, bytes.
    pub const TABLE_LEN: usize = 10_560;
}

/// Length of the longest arm image, bytes. Each slot in the flash of the board has space for an image of this length.
pub const IMAGE_MAX: usize = 12 * 1024;

/// Friction parameters in an arm image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrictionImage<'a> {
    /// Friction polynomials: 6 × 6 coefficients, highest index first.
    Polynomial(Floats<'a>),
    /// Friction tables: for each of the 6 joints 20 velocities, 20 temperatures and 400 torques.
    Table(Floats<'a>),
}

/// The parts of an arm image. The lengths are valid; the values are not checked yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArmImage<'a> {
    /// Gains, in the format of PidParam.
    pub pid: Floats<'a>,
    /// Kinematics and masses, in the format of ArmModel.
    pub model: Floats<'a>,
    /// Friction polynomials or friction tables.
    pub friction: FrictionImage<'a>,
    /// Values of the settings.
    pub settings: Values<'a>,
    /// Name of the arm.
    pub name: Name,
}

impl<'a> ArmImage<'a> {
    /// Parses an arm image. Returns `None` if the bytes are not an image of this version, or if their length is wrong.
    pub fn parse(bytes: &'a [u8]) -> Option<Self> {
        let (magic, _) = bytes.split_first_chunk::<4>()?;
        if *magic != field::MAGIC || *bytes.get(field::VERSION_AT)? != field::VERSION {
            return None;
        }
        let table = match *bytes.get(field::FRICTION_AT)? {
            0 => false,
            1 => true,
            _ => return None,
        };
        let count = u16::from_be_bytes(*bytes.get(field::SETTINGS)?.first_chunk()?);
        let friction_len = if table { field::TABLE_LEN } else { field::POLYNOMIAL_LEN };
        let (friction, rest) = bytes.get(field::FRICTION..)?.split_at_checked(friction_len)?;
        let (settings, name) = rest.split_at_checked(VALUE_LEN * usize::from(count))?;
        let friction = Floats::new(friction);
        Some(Self {
            pid: Floats::new(bytes.get(field::PID)?),
            model: Floats::new(bytes.get(field::MODEL)?),
            friction: if table {
                FrictionImage::Table(friction)
            } else {
                FrictionImage::Polynomial(friction)
            },
            settings: Values::parse(settings)?,
            name: Name::parse(name)?,
        })
    }
}

/// Hash of all parameters in an arm image that affect the motion of the arm (J-52). The hash does not include the name. The hash is
/// FNV-1a with 64 bits (RFC 9923). The caller may add the bytes in pieces of any length. The hash distinguishes two arms whose
/// parameters differ by accident, but does not protect against forgery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hash(u64);

impl Hash {
    /// Returns the hash of an empty image.
    pub const fn new() -> Self {
        Self(0xCBF2_9CE4_8422_2325)
    }

    /// Continues the hash over `bytes`.
    pub fn update(self, bytes: &[u8]) -> Self {
        Self(
            bytes
                .iter()
                .fold(self.0, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01B3)),
        )
    }

    /// Returns the hash as a number.
    pub const fn value(self) -> u64 {
        self.0
    }

    /// Returns the hash of a complete arm image, without its name.
    pub fn of_image(bytes: &[u8]) -> u64 {
        Self::new().update(bytes.get(..bytes.len().saturating_sub(NAME_LEN)).unwrap_or(&[])).value()
    }
}

impl Default for Hash {
    fn default() -> Self {
        Self::new()
    }
}
