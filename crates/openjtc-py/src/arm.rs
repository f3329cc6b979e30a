//! Arm model: kinematics, masses, limits, gains, friction and named poses.

use std::path::PathBuf;
use std::sync::Arc;

use jtc_core::JOINTS;
use jtc_host::arm::{Arm as HostArm, ArmChoice};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::array;
use crate::error::{Failure, in_python};

/// Arm model that was loaded from a file. The object is immutable.
#[pyclass(frozen, module = "openjtc")]
pub(crate) struct Arm {
    pub inner: Arc<HostArm>,
}

impl Arm {
    /// Wraps an arm for Python.
    pub(crate) fn of(arm: HostArm) -> Self {
        Self { inner: Arc::new(arm) }
    }
}

#[pymethods]
impl Arm {
    /// Loads a TOML or URDF file. The content of the file determines the format.
    #[staticmethod]
    fn load(path: PathBuf) -> Result<Self, Failure> {
        Ok(Self::of(HostArm::load(&path)?))
    }

    /// Parses the text of a TOML or URDF file.
    #[staticmethod]
    fn parse(text: &str) -> Result<Self, Failure> {
        Ok(Self::of(HostArm::parse(text)?))
    }

    /// Imports a robot description. If data is missing, the import proposes values and marks these values.
    #[staticmethod]
    #[pyo3(signature = (path, joints=None, tip=None, friction=false))]
    fn import_urdf(
        path: PathBuf,
        joints: Option<Vec<String>>,
        tip: Option<String>,
        friction: bool,
    ) -> Result<Self, Failure> {
        Ok(Self::of(HostArm::import(&path, &ArmChoice { joints, tip, friction })?))
    }

    /// Returns the built-in arm.
    #[staticmethod]
    fn avena() -> Self {
        Self::of(HostArm::avena())
    }

    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    #[getter]
    fn joint_names(&self) -> Vec<&str> {
        self.inner.joint_names.iter().map(String::as_str).collect()
    }

    /// Named poses: joint positions in rad.
    #[getter]
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let poses = PyDict::new(py);
        for (name, position) in &self.inner.poses {
            poses.set_item(name, PyArray1::from_slice(py, position))?;
        }
        Ok(poses)
    }

    fn pose<'py>(&self, py: Python<'py>, name: &str) -> Result<Bound<'py, PyArray1<f64>>, Failure> {
        let position = self.inner.pose(name).map_err(|error| Failure::of(&error))?;
        Ok(PyArray1::from_slice(py, &position))
    }

    /// Effective limits by name, each (6,): `position_min` and `position_max` (rad), `velocity_max` (rad/s), `acceleration_max` (rad/s²),
    /// `torque_max` (N·m).
    #[getter]
    fn limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let config = self.inner.config();
        let limits = PyDict::new(py);
        type Of = fn(&jtc_core::JointConfig) -> f64;
        let columns: [(&str, Of); 5] = [
            ("position_min", |j| j.position_min),
            ("position_max", |j| j.position_max),
            ("velocity_max", |j| j.velocity_max),
            ("acceleration_max", |j| j.acceleration_max),
            ("torque_max", |j| j.torque_max),
        ];
        for (name, of) in columns {
            limits.set_item(name, PyArray1::from_slice(py, &config.joints.each_ref().map(of)))?;
        }
        Ok(limits)
    }

    /// Gains (6, 3): Kp (N·m/rad), Ki (N·m/(rad·s)), Kd (N·m·s/rad); `None` if the arm file has no gains.
    #[getter]
    fn gains<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        let gains = self.inner.pid?;
        Some(array::wide(py, &gains.map(|g| [g.kp, g.ki, g.kd])))
    }

    /// Friction polynomials (6, 6), one row per joint: c0 (N·m), c1 (N·m·s/rad), c2 (N·m·s²/rad²), c3 (N·m·s³/rad³), c4 (1/K), c5 (°C);
    /// `None` if the arm file has no friction.
    #[getter]
    fn friction<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray2<f64>>> {
        self.inner.polynomial.as_ref().map(|all| array::wide(py, all))
    }

    /// Inertia of the rotor of each drive, converted to the joint side of the gear (6,), kg·m².
    #[getter]
    fn rotor_inertia<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.inner.config().joints.each_ref().map(|j| j.rotor_inertia))
    }

    /// Masses of the links, base first (7,), kg.
    #[getter]
    fn masses<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.inner.model.links.each_ref().map(|link| link.mass))
    }

    /// Acceleration of gravity in the base frame (3,), m/s².
    #[getter]
    fn gravity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.inner.config().gravity)
    }

    /// Notes on data that the loader ignored, completed or proposed.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.inner.warnings.iter().map(ToString::to_string).collect()
    }

    /// Returns the findings of `jtc arm check`. Each finding has a severity, a description, a reason and a next step.
    fn findings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let list = PyList::empty(py);
        for found in self.inner.check().findings {
            let value = serde_json::to_value(&found).unwrap_or_default();
            let values = crate::json::to_python(py, &value)?;
            values.set_item("next", in_python(&found.finding.next))?;
            list.append(values)?;
        }
        Ok(list)
    }

    /// Returns the arm as the text of an arm file in TOML.
    fn to_toml(&self) -> String {
        self.inner.to_toml()
    }

    /// Returns the arm as the text of a robot description in URDF.
    fn to_urdf(&self) -> String {
        self.inner.to_urdf()
    }

    /// Saves a pose in an arm file, without changing the comments and the order of the file.
    #[staticmethod]
    #[pyo3(signature = (path, name, position, force=false))]
    fn save_pose(path: PathBuf, name: &str, position: &Bound<'_, PyAny>, force: bool) -> Result<(), Failure> {
        let position: [f64; JOINTS] = array::joints(position, "position")?;
        jtc_host::arm::save_pose(&path, name, &position, force).map_err(|error| Failure::of(&error))
    }

    fn __repr__(&self) -> String {
        format!("Arm({:?})", self.inner.name)
    }
}

/// Registers the class in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Arm>()
}
