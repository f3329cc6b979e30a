//! Values that an arm needs, and that neither its file nor a rule supplies.

use jtc_core::JOINTS;
use jtc_dynamics::ModelError;
use jtc_wire::Joint;

use super::{Arm, Change, Warning};
use crate::file::{FileError, Place};

/// Value that an arm needs and does not have. The arm contains 0 in its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Lacking {
    /// Mass of a link, by the index of the link; 0 is the base.
    Mass(usize),
    /// Inertia of a link, by the index of the link.
    Inertia(usize),
    /// Value of a joint, by its key in an arm file.
    OfJoint(Joint, &'static str),
}

impl Lacking {
    /// Returns the key of the value in an arm file.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Mass(_) => "mass_kg",
            Self::Inertia(_) => "inertia_kg_m2",
            Self::OfJoint(_, key) => key,
        }
    }
}

/// Largest excess of a moment of inertia over the sum of the two others with which the importer still writes a file,
/// as a share of this sum. Rounding in a CAD program causes such an excess. The check refuses the file.
const ROUNDED: f64 = 0.01;

impl Arm {
    /// Returns the name of the joint or link to which a missing value belongs: `link link_2`.
    pub(super) fn owner_of(&self, lacking: Lacking) -> String {
        match lacking {
            Lacking::Mass(i) | Lacking::Inertia(i) => {
                format!("link {}", self.link_names.get(i).map_or("", String::as_str))
            }
            Lacking::OfJoint(joint, _) => format!("joint {}", self.joint_names[joint.index()]),
        }
    }

    /// Returns the missing values, grouped by key, each with the names of the joints or links that lack it.
    pub fn lacking_by_key(&self) -> Vec<(&'static str, Vec<String>)> {
        let mut groups: Vec<(&'static str, Vec<String>)> = Vec::new();
        for lacking in &self.lacking {
            let owner = self.owner_of(*lacking);
            match groups.iter_mut().find(|(key, _)| *key == lacking.key()) {
                Some((_, owners)) => owners.push(owner),
                None => groups.push((lacking.key(), vec![owner])),
            }
        }
        groups
    }

    /// Returns `true` if the arm lacks the value of a key of a joint.
    pub(super) fn lacks(&self, joint: Joint, key: &str) -> bool {
        self.lacking.iter().any(|l| matches!(l, Lacking::OfJoint(of, name) if *of == joint && *name == key))
    }

    /// Returns `true` if the masses of all moving links are known.
    pub(super) fn has_masses(&self) -> bool {
        !self.lacking.iter().any(|lacking| matches!(lacking, Lacking::Mass(1..JOINTS)))
    }

    /// Checks that the arm lacks no value.
    pub(super) fn is_complete(&self) -> Result<(), FileError> {
        let Some(first) = self.lacking.first() else { return Ok(()) };
        let all: Vec<String> =
            self.lacking.iter().filter(|l| l.key() == first.key()).map(|l| self.owner_of(*l)).collect();
        let problem = match all.len() {
            1 => "missing".to_owned(),
            _ => format!("missing, and so for {}", all[1..].join(", ")),
        };
        Err(FileError::at(Place::name(format!("{}, {}", all[0], first.key())), problem))
    }

    /// Checks an imported arm. A missing mass, and an inertia that rounding can explain, become a warning, because the
    /// check of the arm file reports them. All other values that are physically impossible are an error.
    pub(super) fn is_importable(&mut self) -> Result<(), FileError> {
        let mut wrong: Vec<(String, String)> = Vec::new();
        for error in self.model_errors() {
            let place = self.name_of_part(&error);
            match error {
                ModelError::MassZero { .. } => {}
                ModelError::InertiaTriangle { moment, limit, .. } if moment <= (1.0 + ROUNDED) * limit => {
                    let place = place.trim_start_matches("arm model, ");
                    let problem = super::check::without_number(&error);
                    self.warnings.push(Warning::new(Change::Impossible, place, problem));
                }
                _ => wrong.push((place, error.to_string())),
            }
        }
        if let Some((place, problem)) = wrong.first() {
            let more: Vec<String> = wrong[1..].iter().map(|(_, problem)| format!("; {problem}")).collect();
            return Err(FileError::at(Place::name(place.clone()), format!("{problem}{}", more.concat())));
        }
        for (key, owners) in self.lacking_by_key() {
            let problem = format!("{key} is not in the description: the arm file lacks it, too");
            self.warnings.extend(
                owners.into_iter().map(|owner| Warning::new(Change::Missing, owner, problem.clone())),
            );
        }
        self.limits_are_valid()
    }
}
