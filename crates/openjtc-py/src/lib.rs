#![doc = include_str!("../README.md")]

mod arm;
mod array;
mod controller;
mod dynamics;
mod error;
mod json;
mod log;
mod number;
mod planner;
mod plant;
mod robot;
mod run;
mod simulated;
mod simulator;
mod telemetry;
mod threads;
mod trajectory;
mod ucom;
mod wire;

use pyo3::prelude::*;

/// Compiled part of the package `openjtc`. Users import the Python modules instead.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    arm::register(module)?;
    trajectory::register(module)?;
    planner::register(module)?;
    run::register(module)?;
    log::register(module)?;
    robot::register(module)?;
    telemetry::register(module)?;
    controller::register(module)?;
    dynamics::register(module)?;
    plant::register(module)?;
    simulator::register(module)?;
    wire::register(module)?;
    ucom::register(module)?;
    Ok(())
}
