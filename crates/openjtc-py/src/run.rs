//! Results of a run: samples as arrays, performance figures, and the report.

use std::path::PathBuf;

use jtc_host::Sample;
use jtc_host::plan::Bound as Binding;
use jtc_host::recording::{RecordingInfo, write_all};
use jtc_host::report::{Digest, Facts, ReportInput, RunFailure, html};
use jtc_host::sample::JointSample;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::Failure;
use crate::robot::motion::Ran;
use crate::{array, json};

/// Samples of a run, a plan or a flight recorder, with their metadata.
#[pyclass(frozen, module = "openjtc._native")]
pub(crate) struct Samples {
    outcome: String,
    info: RecordingInfo,
    samples: Vec<Sample>,
    facts: Vec<Facts>,
    broken: Option<RunFailure>,
    binding: Option<Vec<Binding>>,
    notes: Vec<String>,
}

impl Samples {
    /// Makes the samples of a run.
    pub(crate) fn of_run(ran: Ran) -> Self {
        let Ran { outcome, broken, info, samples, upload, link, baud, notes, .. } = ran;
        let facts = upload.map(|upload| Facts::of_link(&upload, &link, baud)).into_iter().collect();
        Self { outcome: outcome.into(), info, samples, facts, broken, binding: None, notes }
    }

    /// Makes the samples of a planned motion.
    pub(crate) fn of_plan(
        info: RecordingInfo,
        samples: Vec<Sample>,
        binding: Vec<Binding>,
        notes: Vec<String>,
    ) -> Self {
        let (outcome, facts) = ("planned".into(), Vec::new());
        Self { outcome, info, samples, facts, broken: None, binding: Some(binding), notes }
    }

    /// Makes the samples of a flight recorder.
    pub(crate) fn of_log(info: RecordingInfo, samples: Vec<Sample>, broken: Option<RunFailure>) -> Self {
        let outcome = "log".into();
        Self { outcome, info, samples, facts: Vec::new(), broken, binding: None, notes: Vec::new() }
    }

    fn input<'a>(&'a self, digest: &'a Digest) -> ReportInput<'a> {
        ReportInput {
            facts: &self.facts,
            failure: self.broken.as_ref(),
            plan: self.binding.as_deref(),
            ..ReportInput::new(&self.info, digest)
        }
    }
}

type Of = fn(&JointSample) -> f64;

/// Columns with joint values, by the names that Python uses.
const COLUMNS: [(&str, Of); 13] = [
    ("set_position", |j| j.set_position),
    ("set_velocity", |j| j.set_velocity),
    ("set_acceleration", |j| j.set_acceleration),
    ("position", |j| j.position),
    ("velocity", |j| j.velocity),
    ("error", JointSample::position_error),
    ("torque", |j| j.torque),
    ("torque_model", |j| j.torque_model),
    ("torque_p", |j| j.torque_p),
    ("torque_i", |j| j.torque_i),
    ("torque_d", |j| j.torque_d),
    ("torque_friction", |j| j.torque_friction),
    ("temperature", |j| j.temperature),
];

#[pymethods]
impl Samples {
    #[getter]
    fn outcome(&self) -> &str {
        &self.outcome
    }

    #[getter]
    fn arm(&self) -> &str {
        &self.info.arm
    }

    #[getter]
    fn joint_names(&self) -> Vec<String> {
        (0..self.info.joints.len()).map(|j| self.info.joint_name(j)).collect()
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    /// Text of the first failure, in one line.
    #[getter]
    fn failure(&self) -> Option<String> {
        self.broken.as_ref().map(RunFailure::headline)
    }

    fn __len__(&self) -> usize {
        self.samples.len()
    }

    /// Returns each column as an array of shape (N,), or (N, 6) for joint values. Unknown values are NaN.
    fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        all.set_item("time", PyArray1::from_iter(py, self.samples.iter().map(|s| s.time_s)))?;
        all.set_item("point", PyArray1::from_iter(py, self.samples.iter().map(|s| f64::from(s.point))))?;
        for (name, of) in COLUMNS {
            let rows: Vec<_> = self.samples.iter().map(|s| s.joints.each_ref().map(of)).collect();
            all.set_item(name, array::matrix(py, &rows))?;
        }
        Ok(all)
    }

    /// State of the controller at each sample.
    #[getter]
    fn states(&self) -> Vec<&'static str> {
        self.samples.iter().map(|sample| sample.state.name()).collect()
    }

    /// Returns the performance figures: recorded_s, executed_s, samples, and the figures of each joint.
    fn summary<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>, Failure> {
        let summary = py.detach(|| Digest::of(&self.samples).summary(&self.info));
        json::plain(py, &summary)
    }

    /// Returns the report: a single HTML page that can be opened offline.
    fn html(&self, py: Python<'_>) -> String {
        py.detach(|| html(&self.input(&Digest::of(&self.samples))))
    }

    /// Writes a recording. The file extension selects MCAP or CSV.
    #[pyo3(signature = (path, overwrite=false))]
    fn write(&self, py: Python<'_>, path: PathBuf, overwrite: bool) -> Result<(), Failure> {
        if path.exists() && !overwrite {
            return Err(Failure::usage(format!("{}: the file already exists", path.display()))
                .next("choose another file, or pass overwrite=True"));
        }
        py.detach(|| write_all(&path, &self.info, &self.samples)).map_err(|error| Failure::of(&error))?;
        Ok(())
    }
}

/// Registers the class in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Samples>()
}
