//! The tests of the crate in one program, so that only one program is linked. Each file here is a module of it.
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
