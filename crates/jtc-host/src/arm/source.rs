//! Source of each number of an arm: the arm file, a proposal of `jtc arm import`, or a default. A missing number has no source.

use std::collections::BTreeSet;

use jtc_wire::Joint;
use serde::Serialize;

/// Source of a number of an arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// The arm file contains the number.
    File,
    /// The arm file contains the number and marks it as a starting value, which was neither measured nor taken from a data sheet.
    Proposed,
    /// The arm file does not contain the number, and a default is used.
    Default,
    /// The arm file does not contain the number, and no default exists.
    Missing,
}

impl Source {
    /// Returns the name of the source, as used in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::File => "file",
            Self::Proposed => "proposed",
            Self::Default => "default",
            Self::Missing => "missing",
        }
    }
}

/// Key of a joint or of the arm in an arm file.
pub type Key = (Option<Joint>, &'static str);

/// Keys of the arm for which a value can be proposed.
pub(super) const ARM_KEYS: [&str; 1] = ["gravity_m_s2"];
/// Keys of a joint for which a value can be proposed, in the order of the arm file.
pub(super) const JOINT_KEYS: [&str; 10] = [
    "position_min_rad",
    "position_max_rad",
    "velocity_max_rad_s",
    "acceleration_max_rad_s2",
    "torque_max_nm",
    "position_error_max_rad",
    "rotor_inertia_kg_m2",
    "teach_damping_nm_s_rad",
    "pid",
    "friction_polynomial",
];

/// Keys of an arm whose values are proposals or defaults.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sources {
    proposed: BTreeSet<Key>,
    defaults: BTreeSet<Key>,
}

impl Sources {
    /// Returns the keys that the file marks as proposals: first the keys of the arm, then the keys of each joint.
    pub fn proposed(&self) -> impl Iterator<Item = Key> + '_ {
        self.proposed.iter().copied()
    }

    /// Returns the source of the value of `key`. The arm must have a value for this key.
    pub fn of(&self, key: Key) -> Source {
        if self.proposed.contains(&key) {
            Source::Proposed
        } else if self.defaults.contains(&key) {
            Source::Default
        } else {
            Source::File
        }
    }

    /// Marks the value of `key` as a proposal.
    pub(super) fn propose(&mut self, key: Key) {
        self.defaults.remove(&key);
        self.proposed.insert(key);
    }

    /// Marks the value of `key` as a default, because the key is missing in the file.
    pub(super) fn fill_in(&mut self, key: Key) {
        self.defaults.insert(key);
    }

    /// Returns the marked keys of a joint or of the arm, in the order of the arm file.
    pub(super) fn marked(&self, joint: Option<Joint>) -> Vec<&'static str> {
        let keys: &[&str] = if joint.is_some() { &JOINT_KEYS } else { &ARM_KEYS };
        keys.iter().copied().filter(|key| self.proposed.contains(&(joint, key))).collect()
    }
}
