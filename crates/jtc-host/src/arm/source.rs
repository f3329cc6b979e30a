//! Where each number of an arm comes from: its file, a proposal of `jtc arm import`, or nowhere.

use std::collections::BTreeSet;

use jtc_wire::Joint;
use serde::Serialize;

/// Where a number comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// The file gives it.
    File,
    /// The file gives it and marks it as a starting value that nobody has measured or looked up.
    Proposed,
    /// The file does not give it, and a default counts.
    Default,
    /// The file does not give it, and there is none.
    Missing,
}

impl Source {
    /// Its name, as in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::File => "file",
            Self::Proposed => "proposed",
            Self::Default => "default",
            Self::Missing => "missing",
        }
    }
}

/// A key of an arm file: of a joint, or of the arm.
pub type Key = (Option<Joint>, &'static str);

/// Keys of the arm that can be proposed.
pub(super) const ARM_KEYS: [&str; 1] = ["gravity_m_s2"];
/// Keys of a joint that can be proposed, in the order of the file.
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

/// The keys whose values are not simply those of the file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sources {
    proposed: BTreeSet<Key>,
    defaults: BTreeSet<Key>,
}

impl Sources {
    /// The keys that the file marks as proposals, those of the arm first, then joint by joint.
    pub fn proposed(&self) -> impl Iterator<Item = Key> + '_ {
        self.proposed.iter().copied()
    }

    /// Where the value of a key that has one comes from.
    pub fn of(&self, key: Key) -> Source {
        if self.proposed.contains(&key) {
            Source::Proposed
        } else if self.defaults.contains(&key) {
            Source::Default
        } else {
            Source::File
        }
    }

    /// The value of `key` is a proposal.
    pub(super) fn propose(&mut self, key: Key) {
        self.defaults.remove(&key);
        self.proposed.insert(key);
    }

    /// The file has no such key, and a default counts.
    pub(super) fn fill_in(&mut self, key: Key) {
        self.defaults.insert(key);
    }

    /// Marked keys of a joint or of the arm, in the order of the file.
    pub(super) fn marked(&self, joint: Option<Joint>) -> Vec<&'static str> {
        let keys: &[&str] = if joint.is_some() { &JOINT_KEYS } else { &ARM_KEYS };
        keys.iter().copied().filter(|key| self.proposed.contains(&(joint, key))).collect()
    }
}
