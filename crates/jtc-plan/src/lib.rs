#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod along;
mod binding;
mod blend;
mod cells;
mod choose;
mod compose;
mod distance;
mod error;
mod interior;
mod jerk;
pub mod kinematics;
mod law;
mod limits;
mod motion;
mod p2p;
mod path;
mod plateau;
mod profile;
mod reach;
mod reasons;
mod thin;
mod through;
mod torque;
mod trapezoid;
mod verify;
mod warp;

pub use along::along;
pub use binding::{Binding, LimitKind};
pub use blend::BlendedPath;
pub use distance::furthest_joint;
pub use error::PlanError;
pub use jtc_dynamics::{JOINTS, JointVec};
pub use limits::{JERK_TIME, Limits, MARGIN_MAX};
pub use motion::{Motion, State};
pub use p2p::point_to_point;
pub use path::{Path, PathPoint};
pub use through::{Waypoint, on_route, through};
pub use torque::{ArmDynamics, HOLD_SHARE};
