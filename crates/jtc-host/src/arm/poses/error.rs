//! Errors when poses are used or saved.

use std::path::PathBuf;

use host_kit::{Diagnose, Diagnosis, ErrorKind, Facts};
use jtc_wire::Joint;

use super::NAME_MAX;
use crate::file::FileError;

/// Reason why a pose cannot be used or saved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PoseError {
    /// The name is not valid: it cannot be used in a waypoint file or in an option.
    #[error(
        "\"{name}\" is not a valid name of a pose: a name begins with a letter, has only letters, digits, _, - and ., at most {NAME_MAX}, and is \
         not a number (nan, inf)"
    )]
    Name {
        /// Name of the pose.
        name: String,
    },
    /// The arm does not have a pose of this name.
    #[error("the arm {arm} has no pose \"{name}\"{}", known_words(known))]
    Unknown {
        /// Name of the pose.
        name: String,
        /// Name of the arm.
        arm: String,
        /// Names of the existing poses.
        known: Vec<String>,
        /// Name of the existing pose that is most similar to the unknown name.
        like: Option<String>,
    },
    /// The pose is outside the arm's limits.
    #[error("pose \"{name}\", {joint}: {value} rad is outside {min}..{max} rad")]
    Outside {
        /// Name of the pose.
        name: String,
        /// Joint that is outside its limits in this pose.
        joint: Joint,
        /// Position of the joint in the pose, rad.
        value: f64,
        /// Lower position limit of the joint, rad.
        min: f64,
        /// Upper position limit of the joint, rad.
        max: f64,
    },
    /// A pose of this name exists already.
    #[error("{}: pose \"{name}\" exists already", path.display())]
    Exists {
        /// Path of the arm file.
        path: PathBuf,
        /// Name of the pose.
        name: String,
    },
    /// The file is a robot description, which cannot contain poses.
    #[error("{} is a robot description, which cannot store poses", path.display())]
    Description {
        /// Path of the robot description.
        path: PathBuf,
    },
    /// The arm file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
}

fn known_words(known: &[String]) -> String {
    if known.is_empty() {
        "; the arm has no poses".into()
    } else {
        format!("; the arm has {}", known.join(", "))
    }
}

impl Diagnose for PoseError {
    fn diagnosis(&self) -> Diagnosis {
        let (kind, code, next) = match self {
            Self::Name { .. } => (ErrorKind::Usage, "pose-name", "choose another name, for example above-table".into()),
            Self::Unknown { like: Some(like), .. } => {
                (ErrorKind::Usage, "unknown-pose", format!("did you mean \"{like}\"? `jtc pose list` shows all poses of an arm file"))
            }
            Self::Unknown { .. } => (
                ErrorKind::Usage,
                "unknown-pose",
                "`jtc pose save NAME --arm FILE` saves the present pose; --arm FILE names the file with the pose".into(),
            ),
            Self::Outside { .. } => (
                ErrorKind::Refused,
                "outside-limits",
                "the pose is from another arm, or the limits have changed: save the pose again, or correct it in the file".into(),
            ),
            Self::Exists { .. } => (ErrorKind::Refused, "exists", "choose another name; --overwrite replaces the pose".into()),
            Self::Description { .. } => {
                (ErrorKind::Usage, "no-arm-file", "`jtc arm import URDF -o arm.toml` makes an arm file from it".into())
            }
            Self::File(e) => return e.diagnosis(),
        };
        Diagnosis::new(kind, code, next)
    }

    fn facts(&self) -> Facts {
        match self {
            Self::Outside { joint, value, min, max, .. } => {
                Facts::beyond(*value, if value < min { *min } else { *max }).at_joint(joint.number())
            }
            _ => Facts::default(),
        }
    }
}
