//! A connection to a controller: one thread has the conversation, Python's threads ask it.

pub mod machine;
pub mod motion;
mod questions;
mod worker;

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

use jtc_core::JOINTS;
use jtc_host::Port as _;
use jtc_host::plan::kinematics::{Orientation, Target as Place};
use jtc_host::session::Flow;
use jtc_sim::FaultPlan;
use jtc_wire::{ControllerState, TrajectoryState};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arm::Arm;
use crate::array;
use crate::dynamics::{PayloadNumbers, payload};
use crate::error::Failure;
use crate::run::Samples;
use crate::trajectory::Trajectory;
use machine::{Machine, Simulated, Target, Way};
use motion::{Course, Order, Ran};
pub use questions::samples as samples_of;
use worker::{Asked, Wish, Worker, lock};

/// How often is looked for the next status of a motion.
const LOOK: Duration = Duration::from_millis(2);

/// The connection; `openjtc.Robot` is what people use.
#[pyclass(frozen, module = "openjtc._native")]
pub struct Link {
    worker: Worker,
}

/// A motion that was begun.
#[pyclass(frozen, module = "openjtc._native")]
pub struct Motion {
    link: Py<Link>,
    came: Mutex<Option<Receiver<Result<Ran, Failure>>>>,
}

#[pymethods]
impl Motion {
    /// What came of it: the samples, and the error that ended it; `None` when it is not over within this time (s).
    #[pyo3(signature = (timeout=None))]
    fn wait(&self, py: Python<'_>, timeout: Option<f64>) -> PyResult<Option<(Samples, Option<Py<PyAny>>)>> {
        let Some(came) = lock(&self.came).take() else {
            return Err(Failure::usage("what came of this motion was taken already").into());
        };
        let longest = timeout.map(|s| Duration::from_secs_f64(s.clamp(0.0, 1e6)));
        match self.link.get().worker.wait_for(py, came, longest)? {
            Err(came) => {
                *lock(&self.came) = Some(came);
                Ok(None)
            }
            Ok(ran) => {
                let mut ran = ran?;
                let error = ran.failure.take().map(|failure| PyErr::from(failure).into_value(py).into_any());
                Ok(Some((Samples::of_run(ran), error)))
            }
        }
    }
}

/// What a motion is run with.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Options {
    name: String,
    approach: bool,
    speed: f64,
    repeat: u32,
    accept_device_limits: bool,
    record: Option<PathBuf>,
    overwrite: bool,
}

impl Options {
    fn order(self, course: Course) -> Order {
        let Self { name, approach, speed, repeat, accept_device_limits, record, overwrite } = self;
        let record = record.map(|path| (path, overwrite));
        Order { course, name, approach, speed, repeat, accept_device_limits, record }
    }
}

impl Link {
    fn call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut Machine, &Asked) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        self.worker.call(py, job)
    }

    fn begin(slf: &Bound<'_, Self>, order: Order) -> Result<Motion, Failure> {
        let worker = &slf.get().worker;
        worker.shared.report("waiting", 0.0, 0.0);
        let came = worker.ask(move |machine, asked| {
            if asked.is_halted() {
                return Err(jtc_host::Error::Cancelled.into());
            }
            machine.run(&order, asked)
        })?;
        Ok(Motion { link: slf.clone().unbind(), came: Mutex::new(Some(came)) })
    }

    /// Of a run that is on its way, once its arm moves; or else of what the controller does.
    fn wish(
        &self,
        py: Python<'_>,
        flow: Flow,
        else_do: impl FnOnce(&mut Machine) -> Result<(), Failure> + Send + 'static,
    ) -> PyResult<()> {
        if !self.worker.shared.running.load(Ordering::SeqCst) {
            return self.call(py, move |machine, _| else_do(machine));
        }
        let (done, came) = mpsc::channel();
        lock(&self.worker.shared.wishes).push_back(Wish { flow, done });
        if !self.worker.shared.running.load(Ordering::SeqCst) {
            lock(&self.worker.shared.wishes).clear();
        }
        match self.worker.wait(py, came) {
            Ok(result) => Ok(result?),
            Err(_) if !self.worker.is_closed() && py.check_signals().is_ok() => {
                Err(Failure::refused("not-moving", "the motion was over before", "").into())
            }
            Err(error) => Err(error),
        }
    }
}

#[pymethods]
impl Link {
    /// A simulated controller.
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
            let message = format!("speed: {speed} times real time is outside 0.01..1000");
            return Err(Failure::usage(message).next("None is as fast as the computer is").into());
        }
        let way = Way::Simulated(Box::new(Simulated { seed, speed, faults, payload }));
        let arm = arm.map(|arm| Arc::clone(&arm.inner));
        let target = Target { way, arm, name: String::new(), token: None, certificates: None };
        Ok(Self { worker: Worker::begin(py, target)? })
    }

    /// A serial port, or an agent.
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

    /// Stops what moves here, switches off the teaching that was switched on here, and ends the connection.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        if self.worker.is_closed() {
            return Ok(());
        }
        self.worker.shared.halt();
        let ended = self.call(py, |machine, _| {
            let stopped = if machine.in_motion { machine.stop() } else { Ok(()) };
            let held =
                if machine.teaching { machine.session.teach(false).map_err(Into::into) } else { Ok(()) };
            stopped.and(held)
        });
        self.worker.end(py);
        ended
    }

    fn run(slf: &Bound<'_, Self>, trajectory: &Trajectory, options: Options) -> Result<Motion, Failure> {
        Self::begin(slf, options.order(Course::Along(Arc::clone(&trajectory.inner))))
    }

    fn move_to_joints(
        slf: &Bound<'_, Self>,
        position: &Bound<'_, PyAny>,
        line: bool,
        options: Options,
    ) -> Result<Motion, Failure> {
        let target = Place::Joints(array::joints(position, "position")?);
        Self::begin(slf, options.order(Course::To { target, line }))
    }

    /// `flange`: x y z (m), roll pitch yaw (rad) in the base frame.
    fn move_to_flange(
        slf: &Bound<'_, Self>,
        flange: &Bound<'_, PyAny>,
        line: bool,
        options: Options,
    ) -> Result<Motion, Failure> {
        let [x, y, z, angles @ ..] = array::joints(flange, "flange")?;
        let pose = Orientation::Rpy(angles).at([x, y, z]);
        let pose = pose.map_err(|error| Failure::usage(error.to_string()))?;
        Self::begin(slf, options.order(Course::To { target: Place::Flange(pose), line }))
    }

    /// Phase, how far, of how much.
    fn progress(&self) -> (&'static str, f64, f64) {
        let progress = *lock(&self.worker.shared.progress);
        (progress.phase, progress.done, progress.total)
    }

    fn pause(&self, py: Python<'_>) -> PyResult<()> {
        self.wish(py, Flow::Pause, |machine| Ok(machine.session.pause()?))
    }

    fn resume(&self, py: Python<'_>) -> PyResult<()> {
        self.wish(py, Flow::Resume, |machine| Ok(machine.session.resume()?))
    }

    /// Stops the arm on its path, whoever moves it; whatever was asked for before is not done any more.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        self.worker.shared.halt();
        self.call(py, |machine, _| machine.stop())
    }

    fn speed(&self, py: Python<'_>) -> PyResult<f64> {
        self.call(py, |machine, _| Ok(machine.session.speed()?))
    }

    fn set_speed(&self, py: Python<'_>, speed: f64) -> PyResult<()> {
        if !(0.01..=1.0).contains(&speed) {
            return Err(Failure::usage(format!("speed: {speed} is outside 0.01..1")).into());
        }
        self.wish(py, Flow::Speed((speed * 100.0).round() as u8), move |machine| {
            Ok(machine.session.set_speed(speed)?)
        })
    }

    /// Jogs at these velocities (rad/s) for this time; returns where the arm rests (rad).
    fn jog(&self, py: Python<'_>, velocity: &Bound<'_, PyAny>, seconds: f64) -> PyResult<[f64; JOINTS]> {
        let velocity = array::joints(velocity, "velocity")?;
        let seconds = Duration::from_secs_f64(seconds.clamp(0.0, 600.0));
        self.call(py, move |machine, asked| machine.jog(&velocity, seconds, asked))
    }

    fn teach(&self, py: Python<'_>, on: bool) -> PyResult<()> {
        self.call(py, move |machine, asked| {
            if on {
                machine.session.teach_until(|| asked.is_halted())?;
            } else {
                machine.session.teach(false)?;
            }
            machine.teaching = on;
            Ok(())
        })
    }

    /// Positions (rad) at their times (s) while the arm is led by hand, for this time.
    fn record_teaching<'py>(
        &self,
        py: Python<'py>,
        seconds: f64,
    ) -> PyResult<(Vec<f64>, Bound<'py, numpy::PyArray2<f64>>)> {
        let seconds = seconds.clamp(0.0, 3600.0);
        let taught = self.call(py, move |machine, asked| machine.record_teaching(seconds, asked))?;
        let (times, rows): (Vec<f64>, Vec<[f64; JOINTS]>) = taught.into_iter().unzip();
        Ok((times, array::matrix(py, &rows)))
    }

    /// A status that came after this call.
    fn status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let shared = &self.worker.shared;
        let before = shared.seen.load(Ordering::SeqCst);
        // A run shows each status, and has no time for questions.
        while shared.running.load(Ordering::SeqCst) {
            if shared.seen.load(Ordering::SeqCst) != before
                && let Some(status) = *lock(&shared.status)
            {
                return questions::status(py, &status);
            }
            py.detach(|| std::thread::sleep(LOOK));
            py.check_signals()?;
        }
        let status = self.call(py, |machine, _| Ok(machine.session.fresh_status()?))?;
        questions::status(py, &status)
    }

    /// Waits until the arm is held with all drives enabled, s at most.
    fn wait_ready(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let longest = Duration::from_secs_f64(seconds.clamp(0.0, 600.0));
        self.call(py, move |machine, _| Ok(machine.session.wait_ready(longest).map(drop)?))
    }

    /// Where the port leads.
    #[getter]
    fn port(&self, py: Python<'_>) -> PyResult<String> {
        self.call(py, |machine, _| Ok(machine.session.port().name()))
    }
}

impl Machine {
    /// Stops whatever moves; that nothing does is no error.
    fn stop(&mut self) -> Result<(), Failure> {
        let status = self.session.fresh_status()?;
        let moves = status.trajectory.is_in(&[TrajectoryState::Execute, TrajectoryState::Pause]);
        if status.state == ControllerState::Operate || moves {
            match self.session.stop() {
                // It came to its end meanwhile.
                Err(jtc_host::Error::Link(jtc_host::LinkError::Refused { .. })) => {}
                done => done?,
            }
        }
        self.in_motion = false;
        Ok(())
    }

    fn jog(
        &mut self,
        velocity: &[f64; JOINTS],
        time: Duration,
        asked: &Asked,
    ) -> Result<[f64; JOINTS], Failure> {
        if asked.is_halted() {
            return Err(jtc_host::Error::Cancelled.into());
        }
        self.session.ask_to_move()?;
        self.session.settle_for_jog()?;
        let end = self.session.now() + time;
        let jogged = self.session.jog_while(velocity, |session| asked.is_halted() || session.now() >= end);
        // Whatever ended it: the arm comes to rest now, and not only when the controller has waited.
        let rested = self.session.jog_to_rest();
        jogged?;
        let still = || Failure::fault("still-moving", "the arm still moves", "press the emergency stop");
        Ok(rested?.ok_or_else(still)?.positions())
    }

    fn record_teaching(&mut self, seconds: f64, asked: &Asked) -> Result<Vec<(f64, [f64; JOINTS])>, Failure> {
        let start = self.session.now();
        let mut taught = Vec::new();
        loop {
            let time = (self.session.now() - start).as_secs_f64();
            if asked.is_halted() || time >= seconds {
                return Ok(taught);
            }
            let status = self.session.next_status()?;
            if status.state == ControllerState::Error || status.errors != 0 {
                let words = jtc_host::words::errors_line(&status);
                return Err(Failure::fault("run-fault", words, jtc_host::words::next_step(&status)));
            }
            if status.state == ControllerState::Teaching {
                taught.push(((self.session.now() - start).as_secs_f64(), status.positions()));
            }
        }
    }
}

/// The classes.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Link>()?;
    module.add_class::<Motion>()
}
