//! All tests of the crate are in one program, so that only one program is linked. Each file in this directory is a
//! module of the program.
mod agent;
mod api;
mod arm;
mod attacks;
mod common;
mod dashboard;
mod flight_recorder;
mod halts;
mod jog;
mod kept;
mod maintain;
mod moves;
mod plans;
mod poses;
mod settings;
mod tls;
