//! All tests of the crate are in one program, so the linker links only one program. Each file in this folder is a
//! module of this program.
mod along;
mod choices;
mod error_places;
mod flange_errors;
mod flange_path;
mod judge;
mod kinematics;
mod lines;
mod point_to_point;
mod random;
mod robots;
mod route;
mod times;
