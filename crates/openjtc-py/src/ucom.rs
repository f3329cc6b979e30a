//! Chains of UCoM boards. A separate thread runs a session on a bus, and Python calls this thread.
//!
//! - [`owner`], [`shared`], [`alarms`]: the thread, its requests, the waits of Python threads, and the errors that are raised.
//! - [`worker_state`], [`operator`]: the session that runs in the thread.
//! - [`procedures`], [`running`], [`values`], [`update`]: procedures of the session. Python converts the JSON results to dataclasses.
//! - [`chain`], [`samples`], [`recording`], [`simulated`]: the Python classes.

mod alarms;
mod chain;
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
mod worker_state;

use pyo3::prelude::*;

/// Registers the classes in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<chain::Chain>()?;
    module.add_class::<recording::ChainRecording>()?;
    module.add_class::<samples::ChainSamples>()?;
    module.add_class::<simulated::SimulatedChain>()
}
