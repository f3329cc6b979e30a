//! Stream of board outputs.

use std::sync::Arc;
use std::time::{Duration, Instant};

use host_kit::ErrorKind;
use pyo3::prelude::*;
use serde_json::json;

use super::chain::Chain;
use super::objects;
use super::owner::LOOK;
use super::shared::Listener;
use crate::error::Failure;
use crate::json;

/// Time without outputs on the bus after which no control loop can be running.
const SILENCE: Duration = Duration::from_secs(3);

/// Reader of the outputs of boards. Each call returns one set of outputs.
#[pyclass(frozen, module = "openjtc._native")]
pub(super) struct ChainSamples {
    pub chain: Py<Chain>,
    pub listener: Arc<Listener>,
}

#[pymethods]
impl ChainSamples {
    /// Returns the next sample. None means that no sample arrived within `patience` seconds.
    fn next<'py>(&self, py: Python<'py>, patience: Option<f64>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let chain = self.chain.get();
        let since = Instant::now();
        let patience = patience.and_then(|s| Duration::try_from_secs_f64(s.max(0.0)).ok());
        loop {
            // A waiting reader counts as a call of the program, so it restarts the deadline.
            chain.owner.shared.asked();
            let left = patience.map_or(LOOK, |patience| patience.saturating_sub(since.elapsed()));
            let sample = py.detach(|| self.listener.next(left.min(LOOK)));
            if let Err(error) = py.check_signals() {
                chain.owner.interrupted(py);
                return Err(error);
            }
            chain.owner.shared.check()?;
            if let Some(sample) = sample {
                let value = json!({
                    "time_s": sample.snapshot.time_us as f64 * 1e-6,
                    "board": sample.known.board,
                    "outputs": objects::outputs(&sample.known, &sample.snapshot.words),
                    "missed": sample.snapshot.incomplete_before,
                });
                return json::to_python(py, &value).map(Some);
            }
            if let Some(gone) = chain.owner.shared.gone() {
                return Err(gone.into());
            }
            if patience.is_some_and(|patience| since.elapsed() >= patience) {
                return Ok(None);
            }
            if since.elapsed() >= SILENCE {
                return Err(silent().into());
            }
        }
    }

    #[getter]
    fn dropped(&self) -> u64 {
        self.listener.dropped()
    }
}

fn silent() -> Failure {
    let message = format!("no board sent outputs for {} s: no control loop runs", SILENCE.as_secs());
    Failure::new(ErrorKind::NoLink, "no-outputs", message).next("start the control loops with run()")
}
