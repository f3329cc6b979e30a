//! The real control code of the board; each call runs one tick.

use jtc_bus::{Format, Frame};
use jtc_core::{BusState, Config};
use jtc_host::Arm as HostArm;
use jtc_sim::{Board, Pins, SimConfig};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyBytes;

use crate::arm::Arm;
use crate::error::Failure;
use crate::telemetry::Telemetry;

/// Frame of the joint bus as Python passes it.
pub(crate) type PyFrame<'py> = (u16, Bound<'py, PyBytes>);

/// Outputs of a tick: frame for the joint bus, bytes for the host, safety output, and `true` if the watchdog reset the controller.
type PyOutputs<'py> = (Option<PyFrame<'py>>, Bound<'py, PyBytes>, bool, bool);

/// Converts a joint bus frame from Python.
pub(crate) fn frame(id: u32, data: &[u8]) -> Result<Frame, Failure> {
    Frame::received(id, Format::BUS, data).map_err(|error| Failure::usage(error.to_string()))
}

/// Converts a joint bus frame to Python.
pub(crate) fn to_python<'py>(py: Python<'py>, frame: &Frame) -> PyFrame<'py> {
    (frame.id, PyBytes::new(py, frame.data()))
}

/// Returns the controller settings for an arm, and the image of the arm for the memory of the controller. Without an arm,
/// returns the settings of a new controller and no image.
pub(crate) fn of_arm(arm: Option<&HostArm>) -> Result<(Config, Option<Vec<u8>>), Failure> {
    let Some(arm) = arm else { return Ok((Config::avena(), None)) };
    let image = arm.image().map_err(|error| Failure::usage(error.to_string()))?;
    // With an image, the controller reads all data from the image, as on a board. Without an image, the controller has only the
    // limits, and waits for parameters.
    Ok(if image.is_some() { (Config::avena(), image) } else { (arm.config(), None) })
}

/// Controller together with its board. The time of the board advances only when a tick runs.
#[pyclass(module = "openjtc._native")]
pub(crate) struct Controller {
    board: Board,
    now_us: u64,
    /// Level of the safety output pin. The level does not change in a missed tick.
    safety_output: bool,
}

#[pymethods]
impl Controller {
    #[new]
    #[pyo3(signature = (arm=None))]
    fn new(arm: Option<&Arm>) -> Result<Self, Failure> {
        let (config, stored) = of_arm(arm.map(|arm| &*arm.inner))?;
        let world = SimConfig::default();
        let board = Board::new(config, stored, world.inter_byte_timeout_us, world.watchdog_ms);
        Ok(Self { board, now_us: 0, safety_output: false })
    }

    /// Runs one tick, which is 1 ms.
    #[allow(clippy::too_many_arguments, reason = "the inputs of a tick; Python has them in one object")]
    fn tick<'py>(
        &mut self,
        py: Python<'py>,
        bus: Vec<(u32, PyBackedBytes)>,
        host: &[u8],
        acknowledged: bool,
        bus_off: bool,
        safety_input: bool,
        status_free: bool,
        ticked: bool,
    ) -> Result<PyOutputs<'py>, Failure> {
        let frames = bus.iter().map(|(id, data)| frame(*id, data)).collect::<Result<Vec<_>, _>>()?;
        self.board.receive(self.now_us, host);
        self.now_us += 1_000;
        if !ticked {
            let reset = self.board.miss();
            self.safety_output &= !reset;
            return Ok((None, PyBytes::new(py, &[]), self.safety_output, reset));
        }
        let outputs = self.board.tick(&Pins {
            bus: &frames,
            bus_state: BusState { acknowledged, bus_off },
            safety_input,
            status_free,
        });
        let sent = outputs.bus.map(|frame| to_python(py, &frame));
        let to_host = PyBytes::new(py, &self.board.bytes_to_host(&outputs));
        self.safety_output = outputs.safety_output;
        Ok((sent, to_host, self.safety_output, false))
    }

    /// Values that the last tick computed.
    #[getter]
    fn telemetry(&self) -> Telemetry {
        Telemetry(*self.board.telemetry())
    }

    /// Time since the start of the controller, s.
    #[getter]
    fn time(&self) -> f64 {
        self.now_us as f64 * 1e-6
    }
}

/// Registers the class in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Controller>()
}
