//! Prints how many bytes the controller takes with its trajectory.
use jtc_core::{Controller, POINTS_MAX};
use jtc_wire::RawPoint;

fn main() {
    println!("controller_bytes {}", size_of::<Controller<[RawPoint; POINTS_MAX]>>());
    println!("trajectory_bytes {}", size_of::<[RawPoint; POINTS_MAX]>());
}
