//! Client library of the joint trajectory controller: ports, session, upload, checks, parameters, recording.
//!
//! A [`Session`] is a conversation with a controller over a [`Port`]: a serial port
//! ([`SerialPort`](port::SerialPort)), or the simulated controller, drives and arm in the same process (`port::sim::SimPort`, behind
//! the feature `sim`). An [`Arm`] has kinematics, masses, limits, gains and friction; a [`Trajectory`] has points at a fixed step.
//! Only a [`CheckedTrajectory`] can be uploaded and executed: one that passed the check against an arm, from the pose in which that
//! arm stands. Positions are in rad, speeds in rad/s, torques in N·m, joints in order from base to wrist.
//!
//! # Example
//!
//! The whole way on a simulated controller, in virtual time. With a real one only the port differs:
//! `SerialPort::open("/dev/ttyUSB0", 115_200)?`.
//!
//! ```
//! use std::{path::Path, time::Duration};
//! use jtc_host::session::{Flow, Outcome};
//! use jtc_host::trajectory::Loaded;
//! use jtc_host::{Arm, CheckOptions, CheckedTrajectory, Session, example, port::sim::SimPort};
//! use jtc_sim::{SimConfig, World};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let arm = Arm::load(Path::new("../../arms/avena.toml"))?;
//! let motion = Loaded::parse(&example::EXAMPLES[0].text(), Some(&arm.joint_names))?.trajectory; // or `Loaded::load`
//!
//! let mut session = Session::new(SimPort::new(World::new(SimConfig::new(arm.config(), &arm.parameters()))));
//! session.push(&arm.parameter_set(), |_| {})?;
//! let here = session.wait_ready(Duration::from_secs(15))?.positions();
//!
//! let checked = CheckedTrajectory::check(&motion, &arm, &here, &CheckOptions::default())?;
//! session.upload(&checked, |_| Flow::Continue)?;
//! let run = session.run(&checked, |_| Flow::Continue); // the arm moves
//! for joint in run.summary(&arm).joints {
//!     println!("{}: at most {:.1} mrad off the path", joint.name, joint.max_error_mrad.unwrap_or(f64::NAN));
//! #   assert!(joint.max_error_mrad.is_some_and(|e| e > 0.0 && e < 20.0));
//! }
//! assert!(matches!(run.outcome?, Outcome::Finished(_)));
//! # Ok(())
//! # }
//! ```
//!
//! # Errors
//!
//! Every [`Error`] has words with the facts ([`Display`](std::fmt::Display)), a short name for programs ([`Error::code`]), and what
//! helps ([`Error::hint`]). One that is lost in motion says so: after [`Error::LinkLost`] the arm may be moving.
#![forbid(unsafe_code)]

pub mod arm;
pub mod check;
pub mod doctor;
pub mod error;
pub mod example;
pub mod explain;
pub mod file;
pub mod frame;
#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzzing;
pub mod plan;
pub mod port;
pub mod recording;
pub mod report;
pub mod sample;
pub mod session;
pub mod trajectory;
pub mod words;

pub use arm::Arm;
pub use check::{CheckOptions, CheckedTrajectory};
pub use error::{Error, ErrorKind};
pub use port::{Port, PortError};
pub use sample::{JointSample, Sample};
pub use session::Session;
pub use trajectory::{Point, Trajectory};
