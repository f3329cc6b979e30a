//! Connection to a controller. A single thread runs the session, and the Python threads send jobs to this thread.

mod commands;
pub(crate) mod motion;
mod motion_handle;
mod port;
mod queries;
mod recording;
mod shared;
mod tape;
mod worker;
pub(crate) mod worker_state;

use std::path::PathBuf;
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

use jtc_core::JOINTS;
use jtc_host::plan::kinematics::{Orientation, Target as Place};
use jtc_host::session::Flow;
use jtc_sim::FaultPlan;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arm::Arm;
use crate::dynamics::{PayloadNumbers, payload};
use crate::error::Failure;
use crate::threads::lock;
use crate::trajectory::Trajectory;
use crate::{array, number};
use motion::{Course, Order};
use motion_handle::Motion;
pub(crate) use queries::samples as samples_of;
use shared::{Asked, Wish};
use worker::{Waited, Worker};
use worker_state::{Simulated, Target, Way, WorkerState};

/// Interval at which a waiting call checks for the next status of a motion.
const LOOK: Duration = Duration::from_millis(2);
/// Longest jog, s.
const JOG_MAX: f64 = 600.0;
/// Maximum duration of a teaching recording, s.
const TEACH_MAX: f64 = 3600.0;

/// Connection of `openjtc.Robot`.
#[pyclass(frozen, module = "openjtc._native")]
pub(crate) struct Link {
    worker: Worker,
}

/// Options of a motion.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Options {
    name: String,
    approach: bool,
    speed: Option<f64>,
    repeat: u32,
    accept_device_limits: bool,
    record: Option<PathBuf>,
    overwrite: bool,
    asked: u64,
}

impl Options {
    fn begin(self, link: &Bound<'_, Link>, course: Course) -> Result<Motion, Failure> {
        let Self { name, approach, speed, repeat, accept_device_limits, record, overwrite, asked } = self;
        if let Some(speed) = speed {
            number::within(speed, 1.0..=100.0, "speed", "%")?;
        }
        number::within(repeat.into(), 1.0..=f64::from(u32::MAX), "repeat", "")?;
        let record = record.map(|path| (path, overwrite));
        let progress = Arc::<Mutex<_>>::default();
        let order = Order { course, name, approach, speed, repeat, accept_device_limits, record, progress };
        Motion::begin(link, order, asked)
    }
}

impl Link {
    fn call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut WorkerState, &Asked) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        self.worker.call(py, job)
    }

    /// Returns `true` while a requested run has not ended. During this time, the thread of the connection does not
    /// answer queries.
    fn is_running(&self) -> bool {
        self.worker.shared.is_running() && !self.worker.is_closed()
    }

    /// Sends a request to the current or next run (execution of a motion). The run executes the request when the arm
    /// moves. Without a run, the request is sent directly to the controller.
    fn wish(
        &self,
        py: Python<'_>,
        flow: Flow,
        else_do: impl FnOnce(&mut WorkerState) -> Result<(), Failure> + Send + 'static,
    ) -> PyResult<()> {
        if !self.is_running() {
            return self.call(py, move |state, _| else_do(state));
        }
        let (done, came) = mpsc::channel();
        self.worker.shared.wish(Wish { flow, done });
        match self.worker.wait_for(py, &Mutex::new(came), None)? {
            Waited::Came(result) => {
                self.worker.look_for_signals(py)?;
                Ok(result?)
            }
            Waited::NotYet | Waited::Gone if self.worker.is_closed() => Err(worker::closed().into()),
            Waited::NotYet | Waited::Gone => {
                Err(Failure::refused("not-moving", "the motion has already ended", "").into())
            }
        }
    }
}

#[pymethods]
impl Link {
    /// Connects to a simulated controller.
    #[staticmethod]
    #[pyo3(signature = (arm, seed, speed, faults, payload_of_arm))]
    fn simulated(
        py: Python<'_>,
        arm: Option<&Arm>,
        seed: u64,
        speed: Option<f64>,
        faults: Option<&str>,
        payload_of_arm: Option<PayloadNumbers>,
    ) -> PyResult<Self> {
        let faults = faults.map(FaultPlan::from_toml).transpose();
        let faults = faults.map_err(|error| Failure::usage(format!("faults: {error}")))?.unwrap_or_default();
        let payload = payload(payload_of_arm)?;
        if let Some(speed) = speed.filter(|speed| !(0.01..=1000.0).contains(speed)) {
            let message = format!("speed: {speed} times real time is out of range (0.01 to 1000)");
            return Err(Failure::usage(message).next("pass None for the highest possible speed").into());
        }
        let way = Way::Simulated(Box::new(Simulated { seed, speed, faults, payload }));
        let arm = arm.map(|arm| Arc::clone(&arm.inner));
        let target = Target { way, arm, name: String::new(), token: None, certificates: None };
        Ok(Self { worker: Worker::begin(py, target)? })
    }

    /// Connects to a controller through a serial port or an agent.
    #[staticmethod]
    #[pyo3(signature = (target, arm, baud, name, token, certificates))]
    fn open(
        py: Python<'_>,
        target: String,
        arm: Option<&Arm>,
        baud: u32,
        name: String,
        token: Option<String>,
        certificates: Option<PathBuf>,
    ) -> PyResult<Self> {
        let way = if target.starts_with("http://") || target.starts_with("https://") {
            Way::Agent { url: target }
        } else {
            Way::Serial { path: target, baud }
        };
        let arm = arm.map(|arm| Arc::clone(&arm.inner));
        Ok(Self { worker: Worker::begin(py, Target { way, arm, name, token, certificates })? })
    }

    #[getter]
    fn is_closed(&self) -> bool {
        self.worker.is_closed()
    }

    /// Returns the number of Stops that were requested so far. A later Stop discards all requests that were made
    /// before it.
    fn asked(&self) -> u64 {
        // A forked process refuses every request, so the number of Stops does not matter there.
        self.worker.now().unwrap_or_default()
    }

    /// Discards all earlier requests and stops the motion of this connection. Does not wait.
    fn halt(&self) {
        self.worker.halt();
    }

    /// Like `halt`, but also waits until the motion of this connection is at rest.
    fn rest(&self, py: Python<'_>) {
        self.worker.rest(py);
    }

    /// Stops the motion and teaching of this connection, and closes the connection.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.worker.end(py)
    }

    fn run(slf: &Bound<'_, Self>, trajectory: &Trajectory, options: Options) -> Result<Motion, Failure> {
        options.begin(slf, Course::Along(Arc::clone(&trajectory.inner)))
    }

    #[pyo3(signature = (position, line, margin, options))]
    fn move_to_joints(
        slf: &Bound<'_, Self>,
        position: &Bound<'_, PyAny>,
        line: bool,
        margin: Option<f64>,
        options: Options,
    ) -> Result<Motion, Failure> {
        let target = Place::Joints(array::joints(position, "position")?);
        let margin_pct = crate::planner::margin_of(margin)?;
        options.begin(slf, Course::To { target, line, margin_pct })
    }

    /// Moves the arm to a pose of the flange. `flange` is x y z (m) and roll pitch yaw (rad) in the base frame.
    #[pyo3(signature = (flange, line, margin, options))]
    fn move_to_flange(
        slf: &Bound<'_, Self>,
        flange: &Bound<'_, PyAny>,
        line: bool,
        margin: Option<f64>,
        options: Options,
    ) -> Result<Motion, Failure> {
        let margin_pct = crate::planner::margin_of(margin)?;
        let [x, y, z, angles @ ..] = array::joints(flange, "flange")?;
        let pose = Orientation::Rpy(angles).at([x, y, z]);
        let pose = pose.map_err(|error| Failure::usage(error.to_string()))?;
        options.begin(slf, Course::To { target: Place::Flange(pose), line, margin_pct })
    }

    fn pause(&self, py: Python<'_>) -> PyResult<()> {
        self.wish(py, Flow::Pause, |state| Ok(state.session.pause()?))
    }

    fn resume(&self, py: Python<'_>) -> PyResult<()> {
        self.wish(py, Flow::Resume, |state| {
            state.same_arm()?;
            Ok(state.session.resume()?)
        })
    }

    /// Stops the arm on its path, even if another program moves the arm, and waits for standstill. Discards all earlier
    /// requests.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        self.worker.stop(py)
    }

    fn speed(&self, py: Python<'_>) -> PyResult<f64> {
        let shared = &self.worker.shared;
        // During a run, the thread of the connection does not answer queries, so the run publishes the speed.
        while self.is_running() {
            if let Some(speed) = *lock(&shared.speed) {
                return Ok(speed);
            }
            self.worker.pass(py, LOOK)?;
        }
        self.call(py, |state, _| {
            let speed = state.session.speed()?;
            *lock(&state.shared.speed) = Some(speed);
            Ok(speed)
        })
    }

    fn set_speed(&self, py: Python<'_>, speed: f64) -> PyResult<()> {
        number::within(speed, 0.05..=1.0, "speed", "")?;
        self.wish(py, Flow::Speed((speed * 100.0).round() as u8), move |state| {
            state.session.set_speed(speed)?;
            *lock(&state.shared.speed) = Some(speed);
            Ok(())
        })
    }

    /// Jogs at the velocities `velocity` (rad/s) for `seconds` (s), and returns the positions at rest (rad).
    fn jog(&self, py: Python<'_>, velocity: &Bound<'_, PyAny>, seconds: f64) -> PyResult<[f64; JOINTS]> {
        let velocity = array::joints(velocity, "velocity")?;
        let time = number::seconds(seconds, JOG_MAX, "seconds")?;
        self.call(py, move |state, asked| state.jog(&velocity, time, asked))
    }

    fn teach(&self, py: Python<'_>, on: bool) -> PyResult<()> {
        if on {
            return self.call(py, |state, asked| state.teach(asked));
        }
        self.worker.call_always(py, WorkerState::hold)
    }

    /// Records the joint positions for `seconds` (s), while the operator guides the arm by hand. `take_taught` returns the
    /// positions, even if the recording was interrupted.
    fn record_teaching(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let time = number::seconds(seconds, TEACH_MAX, "seconds")?;
        self.call(py, move |state, asked| state.record_teaching(time, asked))
    }

    /// Returns the times (s) and positions (rad) that were recorded since the last call.
    fn take_taught<'py>(&self, py: Python<'py>) -> (Vec<f64>, Bound<'py, numpy::PyArray2<f64>>) {
        let taught = std::mem::take(&mut *lock(&self.worker.shared.taught));
        let (times, rows): (Vec<f64>, Vec<[f64; JOINTS]>) = taught.into_iter().unzip();
        (times, array::matrix(py, &rows))
    }

    /// Returns a status that arrived after this call began.
    fn status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let shared = &self.worker.shared;
        let before = shared.seen();
        // During a run, the thread of the connection does not answer queries, so the run publishes each status.
        while self.is_running() {
            if shared.seen() != before
                && let Some(status) = *lock(&shared.status)
            {
                self.worker.look_for_signals(py)?;
                return queries::status(py, &status, None);
            }
            self.worker.pass(py, LOOK)?;
        }
        let (status, stop) = self.worker.call_always(py, |state| {
            let status = state.session.fresh_status()?;
            let reactions = if status.is_held_stop() { state.session.reactions() } else { None };
            Ok((status, reactions.and_then(|reactions| reactions.stop)))
        })?;
        queries::status(py, &status, stop)
    }

    /// Waits at most `seconds` (s) until the controller holds the arm with all drives enabled.
    fn wait_ready(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let longest = number::timeout(seconds, "timeout")?;
        self.call(py, move |state, asked| {
            Ok(state.session.wait_ready_until(longest, || asked.is_halted()).map(drop)?)
        })
    }

    /// Name of the port.
    #[getter]
    fn port(&self) -> &str {
        &self.worker.port
    }
}

/// Registers the classes in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Link>()?;
    module.add_class::<Motion>()
}
