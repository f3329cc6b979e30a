//! Numbers of the joints. Users count joints from 1, but the bus counts nodes from 0.
use core::fmt;

use crate::JOINTS;

/// A joint of the arm. Texts, JSON values and files count joints from 1, starting at the base. On the bus and in arrays the number is one
/// lower, so joint 1 is node 0 and index 0. A joint is printed as `joint 3`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Joint(u8);

impl Joint {
    /// All joints, base to wrist.
    pub const ALL: [Self; JOINTS] = [Self(0), Self(1), Self(2), Self(3), Self(4), Self(5)];

    /// Returns the joint with this number, 1..6. Returns `None` for another number.
    pub fn from_number(number: usize) -> Option<Self> {
        number.checked_sub(1).and_then(Self::from_index)
    }

    /// Returns the joint at this index of an array, 0..5, which is also its node number. Returns `None` for another index.
    pub fn from_index(index: usize) -> Option<Self> {
        Self::ALL.get(index).copied()
    }

    /// Returns the number that users see, 1..6.
    pub const fn number(self) -> u8 {
        self.0 + 1
    }

    /// Returns the index in arrays, which is also the node number, 0..5.
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for Joint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "joint {}", self.number())
    }
}

/// Serialises the joint as its number, 1..6.
#[cfg(feature = "serde")]
impl serde::Serialize for Joint {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_u8(self.number())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::ToString;

    use super::*;

    #[test]
    fn people_count_joints_from_1_and_arrays_from_0() {
        assert_eq!(Joint::from_number(0), None);
        assert_eq!(Joint::from_number(7), None);
        assert_eq!(Joint::from_index(6), None);
        for (index, joint) in Joint::ALL.into_iter().enumerate() {
            assert_eq!((Joint::from_index(index), Joint::from_number(index + 1)), (Some(joint), Some(joint)));
            assert_eq!((joint.index(), usize::from(joint.number())), (index, index + 1));
        }
        assert_eq!(Joint::ALL[2].to_string(), "joint 3");
        assert_eq!(serde_json::to_string(&Joint::ALL[2]).unwrap(), "3");
    }
}
