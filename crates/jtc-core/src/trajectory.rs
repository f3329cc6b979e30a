//! Trajectory of the host: check of its points (J-36), storage (J-30), and path time (J-33).
pub mod check;
pub(crate) mod path;
pub(crate) mod store;
