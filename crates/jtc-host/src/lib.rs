#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod arm;
pub mod check;
pub mod doctor;
pub mod error;
pub mod example;
pub mod explain;
pub mod file;
pub mod firmware;
pub mod frame;
#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzzing;
pub mod held_stop;
pub mod labels;
pub mod log;
pub mod plan;
pub mod port;
pub mod recording;
pub mod report;
pub mod run;
pub mod sample;
pub mod session;
mod table;
pub mod trajectory;
pub mod waypoints;

pub use arm::Arm;
pub use check::{CheckOptions, CheckedTrajectory};
pub use error::{
    CheckError, Diagnose, Diagnosis, Error, LinkError, MotionError, ParametersError, StateError, UploadError,
};
pub use host_kit::ErrorKind;
pub use port::{Port, PortError};
pub use sample::{JointSample, Sample};
pub use session::Session;
pub use trajectory::{Point, Trajectory};
