//! Simulated system: line to the host, controller, joint bus, drives and arm.

use jtc_core::JOINTS;
use jtc_sim::{SimConfig, Truth, World};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::array;
use crate::controller::{PyFrame, to_python};
use crate::error::Failure;
use crate::simulated::{SimulatedArm, faults, hand, pass, support};
use crate::telemetry::Telemetry;

/// Inputs of the controller in one millisecond: frames, bytes of the host, and the flags acknowledged, bus-off, safety input, status
/// free, ticked.
type PyInputs<'py> = (Vec<PyFrame<'py>>, Bound<'py, PyBytes>, bool, bool, bool, bool, bool);
/// Outputs of the controller in one millisecond: frame, bytes to the host, safety output.
type PyOutputs<'py> = (Option<PyFrame<'py>>, Bound<'py, PyBytes>, bool);

/// Simulated system with a controller.
#[pyclass(module = "openjtc._native")]
pub(crate) struct Simulator {
    world: World,
}

#[pymethods]
impl Simulator {
    #[new]
    #[pyo3(signature = (arm, *, support, baud, answer_jitter_ms, faults, watch))]
    fn new(
        arm: SimulatedArm<'_>,
        support: &str,
        baud: Option<u32>,
        answer_jitter_ms: u8,
        faults: Option<&str>,
        watch: bool,
    ) -> Result<Self, Failure> {
        if baud.is_some_and(|baud| baud < 300) {
            return Err(Failure::usage(
                "baud is out of range: expected at least 300 Bd, or None for a line without delay",
            ));
        }
        let plan = faults.map(self::faults).transpose()?.unwrap_or_default();
        let config = SimConfig {
            support: self::support(support)?,
            baud,
            answer_jitter_ms,
            faults: plan,
            ..arm.config()?
        };
        let mut world = World::new(config);
        if watch {
            world.watch_board();
        }
        Ok(Self { world })
    }

    /// Advances the simulation by `ms` milliseconds.
    fn step(&mut self, py: Python<'_>, ms: u64) -> PyResult<()> {
        pass(py, ms, || self.world.step())
    }

    #[getter]
    fn time_ms(&self) -> u64 {
        self.world.now_us() / 1_000
    }

    #[getter]
    fn telemetry(&self) -> Telemetry {
        Telemetry(*self.world.telemetry())
    }

    /// Returns true values of the arm: `position`, `velocity`, `torque`, `outside`, `temperature`.
    fn truth<'py>(&self, py: Python<'py>, what: &str) -> Result<Bound<'py, PyArray1<f64>>, Failure> {
        truth(py, self.world.truth(), what)
    }

    fn write(&mut self, bytes: &[u8]) {
        self.world.host_write(bytes);
    }

    fn read<'py>(&mut self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let mut all = Vec::new();
        let mut part = [0; 4096];
        loop {
            match self.world.host_read(&mut part) {
                0 => return PyBytes::new(py, &all),
                count => all.extend_from_slice(&part[..count]),
            }
        }
    }

    /// Number of host bytes that have not reached the controller yet.
    #[getter]
    fn unsent(&self) -> usize {
        self.world.host_write_pending()
    }

    fn inject(&mut self, text: &str) -> Result<(), Failure> {
        self.world.inject_all(faults(text)?);
        Ok(())
    }

    fn lead(&mut self, path: &Bound<'_, PyAny>, step_s: f64) -> Result<(), Failure> {
        let (points, _) = array::rows(path, "path")?;
        self.world.lead(hand(points, step_s)?);
        Ok(())
    }

    fn set_safety_input(&mut self, level: bool) {
        self.world.set_safety_input(level);
    }

    #[getter]
    fn safety_output(&self) -> bool {
        self.world.safety_output()
    }

    /// Returns the frames that were on the joint bus in the last millisecond.
    fn bus_frames<'py>(&self, py: Python<'py>) -> Vec<PyFrame<'py>> {
        self.world.bus_frames().iter().map(|timed| to_python(py, &timed.frame)).collect()
    }

    /// Returns the events of the simulation. Each event has a time in s and a text.
    fn events(&self) -> Vec<(f64, String)> {
        let entries = self.world.log().entries();
        entries.map(|entry| (entry.time_us as f64 * 1e-6, entry.event.to_string())).collect()
    }

    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let statistics = self.world.statistics();
        let dict = PyDict::new(py);
        dict.set_item("bus_load", statistics.bus_load())?;
        dict.set_item("bus_frames", statistics.bus.frames)?;
        dict.set_item("serial_to_device", statistics.serial_to_device)?;
        dict.set_item("serial_to_host", statistics.serial_to_host)?;
        dict.set_item("good_frames", statistics.good_frames)?;
        dict.set_item("bad_frames", statistics.bad_frames)?;
        dict.set_item("watchdog_resets", statistics.watchdog_resets)?;
        Ok(dict)
    }

    /// Returns the inputs and outputs of the controller in the last millisecond; `None` if `watch` is not set.
    fn exchange<'py>(&self, py: Python<'py>) -> Option<(PyInputs<'py>, PyOutputs<'py>)> {
        let exchange = self.world.exchange()?;
        let frames = exchange.bus.iter().map(|frame| to_python(py, frame)).collect();
        let inputs = (
            frames,
            PyBytes::new(py, &exchange.host),
            exchange.bus_state.acknowledged,
            exchange.bus_state.bus_off,
            exchange.safety_input,
            exchange.status_free,
            exchange.ticked,
        );
        let sent = exchange.sent.map(|frame| to_python(py, &frame));
        let outputs = (sent, PyBytes::new(py, &exchange.to_host), exchange.safety_output);
        Some((inputs, outputs))
    }
}

/// Returns true values of the arm as one array.
pub(crate) fn truth<'py>(
    py: Python<'py>,
    truth: &Truth,
    what: &str,
) -> Result<Bound<'py, PyArray1<f64>>, Failure> {
    let values: &[f64; JOINTS] = match what {
        "position" => &truth.q,
        "velocity" => &truth.qd,
        "torque" => &truth.torque,
        "outside" => &truth.outside,
        "temperature" => &truth.temperature,
        other => return Err(Failure::usage(format!("the simulated arm has no value {other:?}"))),
    };
    Ok(PyArray1::from_slice(py, values))
}

/// Registers the class in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Simulator>()
}
