//! Trajectory: positions, velocities and accelerations of six joints at a constant time step.

use std::path::PathBuf;
use std::sync::Arc;

use jtc_core::JOINTS;
use jtc_host::file::FileError;
use jtc_host::trajectory::{ArmNames, Loaded, Trajectory as HostTrajectory, overshoot_words};
use jtc_host::{Point, plan};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::arm::Arm;
use crate::array;
use crate::error::Failure;

/// Reads a trajectory with the names of the joints of `arm` (default: the built-in arm), or without names if the numbers in the names of the
/// joints determine their order.
fn named(
    arm: Option<&Arm>,
    joints_by_number: bool,
    read: impl FnOnce(Option<ArmNames<'_>>) -> Result<Loaded, FileError>,
) -> Result<Loaded, FileError> {
    let arm = arm.map_or_else(|| Arc::new(jtc_host::Arm::avena()), |arm| arm.inner.clone());
    read((!joints_by_number).then(|| arm.names()))
}

/// Trajectory: points with a constant time step, `step_ms` (ms). The object is immutable.
///
/// `time` (N,) is in s and `duration` in s; `position`, `velocity` and `acceleration` (N, 6) are in rad, rad/s and rad/s², one column per
/// joint, base to wrist.
#[pyclass(frozen, module = "openjtc")]
pub(crate) struct Trajectory {
    pub inner: Arc<HostTrajectory>,
    /// Notes on data that the loader derived, resampled or omitted.
    notes: Vec<String>,
}

impl Trajectory {
    /// Wraps a trajectory for Python.
    pub(crate) fn of(trajectory: HostTrajectory) -> Self {
        Self { inner: Arc::new(trajectory), notes: Vec::new() }
    }

    fn loaded(loaded: Loaded, degrees: bool) -> Result<Self, Failure> {
        let loaded = if degrees { loaded.in_degrees()? } else { loaded };
        let notes = loaded.notes.into_iter().chain(overshoot_words(&loaded.overshoot)).collect();
        Ok(Self { inner: Arc::new(loaded.trajectory), notes })
    }

    fn channel<'py>(
        &self,
        py: Python<'py>,
        of: impl Fn(&Point) -> [f64; JOINTS],
    ) -> Bound<'py, PyArray2<f64>> {
        array::matrix(py, &self.inner.points.iter().map(of).collect::<Vec<_>>())
    }
}

#[pymethods]
impl Trajectory {
    /// Makes a trajectory from points (N, 6), which are `step_ms` (ms) apart: positions (rad), velocities (rad/s) and accelerations
    /// (rad/s²).
    #[new]
    fn new(
        step_ms: u16,
        position: &Bound<'_, PyAny>,
        velocity: &Bound<'_, PyAny>,
        acceleration: &Bound<'_, PyAny>,
    ) -> Result<Self, Failure> {
        let [(position, _), (velocity, _), (acceleration, _)] = [
            array::rows(position, "position")?,
            array::rows(velocity, "velocity")?,
            array::rows(acceleration, "acceleration")?,
        ];
        let count = position.len();
        if velocity.len() != count || acceleration.len() != count {
            return Err(Failure::usage(format!(
                "{count} positions, {} velocities and {} accelerations: expected the same number of each",
                velocity.len(),
                acceleration.len()
            )));
        }
        let points = position.into_iter().zip(velocity).zip(acceleration);
        let points =
            points.map(|((position, velocity), acceleration)| Point { position, velocity, acceleration });
        Ok(Self::of(HostTrajectory { step_ms, points: points.collect() }))
    }

    /// Loads a file in any format that `jtc traj run` reads. A file that names the joints of another arm than `arm`
    /// (default: the built-in arm) is refused. With `joints_by_number`, the numbers in the names of the joints determine their order.
    #[staticmethod]
    #[pyo3(signature = (path, arm=None, degrees=false, joints_by_number=false))]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        arm: Option<&Arm>,
        degrees: bool,
        joints_by_number: bool,
    ) -> Result<Self, Failure> {
        py.detach(|| Self::loaded(named(arm, joints_by_number, |names| Loaded::load(&path, names))?, degrees))
    }

    /// Parses the text of a trajectory file.
    #[staticmethod]
    #[pyo3(signature = (text, arm=None, degrees=false, joints_by_number=false))]
    fn parse(
        py: Python<'_>,
        text: &str,
        arm: Option<&Arm>,
        degrees: bool,
        joints_by_number: bool,
    ) -> Result<Self, Failure> {
        py.detach(|| Self::loaded(named(arm, joints_by_number, |names| Loaded::parse(text, names))?, degrees))
    }

    /// Loads the measured motion from a recording.
    #[staticmethod]
    fn load_measured(py: Python<'_>, path: PathBuf) -> Result<Self, Failure> {
        py.detach(|| Self::loaded(Loaded::load_measured(&path)?, false))
    }

    /// Time from one point to the next, ms.
    #[getter]
    fn step_ms(&self) -> u16 {
        self.inner.step_ms
    }

    /// Time from the first point to the last point, s.
    #[getter]
    fn duration(&self) -> f64 {
        self.inner.duration_s()
    }

    /// Notes on data that the loader derived, resampled or omitted.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// Time of each point (N,), s.
    #[getter]
    fn time<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let step = f64::from(self.inner.step_ms) * 1e-3;
        PyArray1::from_iter(py, (0..self.inner.points.len()).map(|k| k as f64 * step))
    }

    /// Joint positions (N, 6), rad.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.channel(py, |point| point.position)
    }

    /// Joint velocities (N, 6), rad/s.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.channel(py, |point| point.velocity)
    }

    /// Joint accelerations (N, 6), rad/s².
    #[getter]
    fn acceleration<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.channel(py, |point| point.acceleration)
    }

    /// Returns a trajectory with the same path at another speed, 1 to 100 % of the original speed.
    fn at_speed(&self, percent: f64) -> Result<Self, Failure> {
        Ok(Self::of(plan::at_speed(&self.inner, percent)?))
    }

    /// Returns the trajectory as CSV with all digits, in the format that `jtc traj run` reads.
    fn to_csv(&self) -> String {
        self.inner.to_exact_csv()
    }

    fn to_json(&self) -> String {
        self.inner.to_json()
    }

    fn __len__(&self) -> usize {
        self.inner.points.len()
    }

    fn __repr__(&self) -> String {
        format!("Trajectory({} points, {:.3} s)", self.inner.points.len(), self.inner.duration_s())
    }
}

/// Registers the class in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Trajectory>()
}
