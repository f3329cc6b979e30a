//! Makes and reads frames for the line to the host and for the joint bus.

use jtc_bus::{Answer, GripperReport, JOINTS, JointReport, NODES, NodeState, Request, Scale};
use jtc_core::{SEGMENT_POINTS_MAX, SEGMENTS_MAX, settings};
use jtc_host::frame;
use jtc_host::labels;
use jtc_wire::{Command, EncodeError, ExecCommand, FrameType, Status, StatusReceiver};
use numpy::PyArray1;
use pyo3::IntoPyObjectExt as _;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arm::Arm;
use crate::array;
use crate::controller::{PyFrame, frame as bus_frame, to_python};
use crate::dynamics::{PayloadNumbers, payload};
use crate::error::Failure;
use crate::trajectory::Trajectory;

fn refused(error: EncodeError) -> Failure {
    Failure::usage(error.to_string())
}

fn emitted(command: &Command<'_>) -> Result<Vec<u8>, Failure> {
    let mut bytes = vec![0; 64];
    let length = command.emit(&mut bytes).map_err(refused)?;
    bytes.truncate(length);
    Ok(bytes)
}

/// Makes the frame of a command without arguments. `name` is the text that `openjtc.control.encode` passes, for example `pump on`.
#[pyfunction]
fn encode_command<'py>(py: Python<'py>, name: &str) -> Result<Bound<'py, PyBytes>, Failure> {
    let command = match name {
        "execute" => Command::TrajSetExecStatus(ExecCommand::Execute),
        "pause" => Command::TrajSetExecStatus(ExecCommand::Pause),
        "stop" => Command::TrajSetExecStatus(ExecCommand::Stop),
        "teach" => Command::TeachingModeEnable,
        "hold" => Command::TeachingModeDisable,
        "pump on" => Command::GripperControl { pump: true },
        "pump off" => Command::GripperControl { pump: false },
        "clear errors" => Command::ClearCurrentErrors { jtc: true, nodes: jtc_wire::ALL_NODES },
        "clear occurred errors" => Command::ClearOccurredErrors,
        "default friction" => Command::FrictionPolynomialUseDefault,
        "default gains" => Command::PidParamUseDefault,
        "default model" => Command::ArmModelUseDefault,
        "disable" => Command::Disable,
        other => return Err(Failure::usage(format!("command {other:?} does not exist"))),
    };
    Ok(PyBytes::new(py, &emitted(&command)?))
}

/// Makes the frames of the arm parameters: friction, model and gains. The gains are the last frame, because the controller waits for the
/// gains.
#[pyfunction]
fn encode_parameters<'py>(py: Python<'py>, arm: &Arm) -> Result<Vec<Bound<'py, PyBytes>>, Failure> {
    let set = arm.inner.parameter_set();
    set.check().map_err(|error| Failure::of(&error))?;
    let mut frames = Vec::new();
    if let Some(friction) = &set.friction {
        frames.push(frame::friction(friction).map_err(refused)?);
    }
    if let Some(model) = &set.model {
        frames.push(frame::arm_model(model).map_err(refused)?);
    }
    if let Some(pid) = &set.pid {
        frames.push(frame::pid(pid).map_err(refused)?);
    }
    Ok(frames.iter().map(|bytes| PyBytes::new(py, bytes)).collect())
}

/// Makes the frames of a trajectory.
#[pyfunction]
fn encode_trajectory<'py>(
    py: Python<'py>,
    trajectory: &Trajectory,
    number: u16,
    points_a_frame: usize,
) -> Result<Vec<Bound<'py, PyBytes>>, Failure> {
    if !(1..=SEGMENT_POINTS_MAX).contains(&points_a_frame) {
        let message = format!("points_a_frame: {points_a_frame} is out of range (1 to {SEGMENT_POINTS_MAX})");
        return Err(Failure::usage(message));
    }
    let points = trajectory.inner.raw().map_err(|error| Failure::usage(error.to_string()))?;
    let segments: Vec<_> = points.chunks(points_a_frame).collect();
    let count = |n: usize| {
        u16::try_from(n).ok().filter(|n| usize::from(*n) <= SEGMENTS_MAX).ok_or_else(|| {
            Failure::usage(format!("too many frames: {n}, a trajectory has at most {SEGMENTS_MAX}"))
                .next("pass a larger points_a_frame")
        })
    };
    let all = count(segments.len())?;
    let made = segments.iter().enumerate().map(|(n, part)| {
        let bytes = frame::segment(number, count(n)?, all, trajectory.inner.step_ms, part);
        Ok(PyBytes::new(py, &bytes.map_err(refused)?))
    });
    made.collect()
}

/// Makes the frame of a jog with these velocities, rad/s.
#[pyfunction]
fn encode_jog<'py>(py: Python<'py>, velocity: &Bound<'py, PyAny>) -> Result<Bound<'py, PyBytes>, Failure> {
    let velocity = array::joints(velocity, "velocity")?;
    let mut bytes = vec![0; 64];
    let length = jtc_wire::floats(&mut bytes, FrameType::Jog, velocity).map_err(refused)?;
    Ok(PyBytes::new(py, &bytes[..length]))
}

/// Makes the frame that sets a payload.
#[pyfunction]
fn encode_payload(py: Python<'_>, numbers: PayloadNumbers) -> Result<Bound<'_, PyBytes>, Failure> {
    let payload = payload(Some(numbers))?;
    let mut bytes = vec![0; jtc_wire::FRAME_MAX];
    let length = jtc_wire::set_settings(&mut bytes, settings::payload_values(&payload)).map_err(refused)?;
    Ok(PyBytes::new(py, &bytes[..length]))
}

/// Reader of the statuses in the bytes that a controller sends.
#[pyclass(module = "openjtc._native")]
struct StatusReader {
    receiver: StatusReceiver,
}

#[pymethods]
impl StatusReader {
    #[new]
    fn new() -> Self {
        Self { receiver: StatusReceiver::new() }
    }

    /// Returns the statuses that are complete after these bytes, oldest first.
    fn feed<'py>(&mut self, py: Python<'py>, bytes: &[u8]) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let mut rest = bytes;
        let mut found = Vec::new();
        while let Some(status) = self.receiver.next(&mut rest) {
            found.push(status_dict(py, &status)?);
        }
        Ok(found)
    }
}

fn status_dict<'py>(py: Python<'py>, status: &Status) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("state", status.state.name())?;
    dict.set_item("trajectory", status.trajectory.name())?;
    dict.set_item("point", status.point)?;
    dict.set_item("errors", status.errors)?;
    dict.set_item("occurred", status.occurred)?;
    dict.set_item("causes", labels::causes(status))?;
    let of = |value: fn(&jtc_wire::JointStatus) -> f64| {
        PyArray1::from_slice(py, &status.joints.each_ref().map(value))
    };
    dict.set_item("position", of(|joint| joint.position.into()))?;
    dict.set_item("velocity", of(|joint| joint.velocity.into()))?;
    dict.set_item("torque", of(|joint| joint.torque.into()))?;
    dict.set_item("temperature", of(|joint| joint.temperature.into()))?;
    dict.set_item("drives", status.joints.iter().map(|joint| joint.state.name()).collect::<Vec<_>>())?;
    let response = status.response();
    let response = response.map(|r| (r.frame_type, r.accepted(), r.to_string(), r.length));
    dict.set_item("response", response)?;
    Ok(dict)
}

/// Decodes a frame that contains a request of the controller to the nodes. Returns the kind and the numbers of the
/// request.
#[pyfunction]
fn bus_request<'py>(
    py: Python<'py>,
    id: u32,
    data: &[u8],
) -> Result<(&'static str, Bound<'py, PyAny>), Failure> {
    let request = Request::parse(&bus_frame(id, data)?).map_err(|error| Failure::usage(error.to_string()))?;
    let made = match request {
        Request::Move { torque, pump } => {
            ("move", (PyArray1::from_slice(py, &torque), pump).into_bound_py_any(py))
        }
        Request::ChangeFsm { target } => {
            ("state", target.map(|target| target as u8).to_vec().into_bound_py_any(py))
        }
        Request::ChangeMode { mode, config, gripper } => {
            let numbers = (mode.to_vec(), config.to_vec(), gripper);
            ("configure", numbers.into_bound_py_any(py))
        }
        Request::ResetAll => ("reset", py.None().into_bound_py_any(py)),
        Request::Reset(node) => ("reset", node.into_bound_py_any(py)),
    };
    let (kind, numbers) = made;
    Ok((kind, numbers.map_err(|error| Failure::usage(error.to_string()))?))
}

fn node(node: u8, below: usize) -> Result<u8, Failure> {
    if usize::from(node) < below {
        return Ok(node);
    }
    Err(Failure::usage(format!("node: {node} is out of range (0 to {})", below - 1)))
}

/// Makes the answer of a joint to a Move frame.
#[pyfunction]
#[pyo3(name = "bus_joint_answer")]
#[allow(clippy::too_many_arguments, reason = "the numbers of a frame; Python has them as keywords")]
fn joint_answer(
    py: Python<'_>,
    number: u8,
    position: f64,
    velocity: f64,
    torque: f64,
    temperature: u8,
    state: u8,
    errors: u8,
    warnings: u8,
) -> Result<PyFrame<'_>, Failure> {
    let report = JointReport {
        position,
        velocity,
        torque,
        temperature,
        state: NodeState::new(state),
        errors,
        warnings,
        motor_temperature: Some(temperature),
        ..JointReport::default()
    };
    let answer = Answer::Joint { node: node(number, JOINTS)?, report };
    Ok(to_python(py, &answer.emit(Scale::CURRENT)))
}

/// Makes the answer of the gripper to a Move frame.
#[pyfunction]
#[pyo3(name = "bus_gripper_answer")]
fn gripper_answer(py: Python<'_>, pump: bool, part: bool, state: u8, errors: u8) -> PyFrame<'_> {
    let state = NodeState::new(state);
    let report = GripperReport { pump, pressure1: part, pressure2: part, state, errors, warnings: 0 };
    to_python(py, &Answer::Gripper(report).emit(Scale::CURRENT))
}

/// Makes the answer of a node to a request for a state.
#[pyfunction]
#[pyo3(name = "bus_state_answer")]
fn state_answer(py: Python<'_>, number: u8, state: u8) -> Result<PyFrame<'_>, Failure> {
    let answer = Answer::State { node: node(number, NODES)?, state: NodeState::new(state) };
    Ok(to_python(py, &answer.emit(Scale::CURRENT)))
}

/// Makes the answer of a node to a configuration request.
#[pyfunction]
#[pyo3(name = "bus_configured_answer")]
fn configured_answer(py: Python<'_>, number: u8, accepted: bool) -> Result<PyFrame<'_>, Failure> {
    let answer = Answer::Mode { node: node(number, NODES)?, accepted };
    Ok(to_python(py, &answer.emit(Scale::CURRENT)))
}

/// Registers the functions and the class in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<StatusReader>()?;
    module.add_function(wrap_pyfunction!(encode_command, module)?)?;
    module.add_function(wrap_pyfunction!(encode_parameters, module)?)?;
    module.add_function(wrap_pyfunction!(encode_trajectory, module)?)?;
    module.add_function(wrap_pyfunction!(encode_jog, module)?)?;
    module.add_function(wrap_pyfunction!(encode_payload, module)?)?;
    module.add_function(wrap_pyfunction!(bus_request, module)?)?;
    module.add_function(wrap_pyfunction!(joint_answer, module)?)?;
    module.add_function(wrap_pyfunction!(gripper_answer, module)?)?;
    module.add_function(wrap_pyfunction!(state_answer, module)?)?;
    module.add_function(wrap_pyfunction!(configured_answer, module)?)
}
