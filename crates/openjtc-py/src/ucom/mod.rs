//! Chains of UCoM boards: a session on a bus that a thread of its own keeps, and calls of Python into it.
//!
//! - [`owner`], [`shared`], [`alarms`]: the thread, what is asked of it, how Python waits for it, and what it raises.
//! - [`hands`], [`operator`]: the session in that thread.
//! - [`procedures`], [`running`], [`values`], [`update`]: what is done with it; results are JSON, which Python makes dataclasses of.
//! - [`chain`], [`samples`], [`recording`], [`simulated`]: the classes.

mod alarms;
mod chain;
mod hands;
mod objects;
mod operator;
mod owner;
mod procedures;
mod recording;
mod running;
mod samples;
mod shared;
mod simulated;
mod update;
mod values;

use pyo3::prelude::*;

/// Adds the classes to the module.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<chain::Chain>()?;
    module.add_class::<recording::ChainRecording>()?;
    module.add_class::<samples::ChainSamples>()?;
    module.add_class::<simulated::SimulatedChain>()
}
