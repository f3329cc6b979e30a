//! Planning of motions from poses and waypoints, and the check that every trajectory must pass before upload.

use std::path::PathBuf;
use std::sync::Arc;

use jtc_host::check::{Checker, Verdict};
use jtc_host::plan::kinematics::{Orientation, Target};
use jtc_host::plan::{
    COLD, MARGIN_PCT, Planned, Planner as HostPlanner, WayOptions, Waypoint, WaypointPath, margin_in_range,
};
use jtc_host::recording::RecordingInfo;
use jtc_host::waypoints::WaypointFile;
use numpy::PyArray1;
use pyo3::prelude::*;

use crate::arm::Arm;
use crate::dynamics::PayloadNumbers;
use crate::error::{Failure, in_python};
use crate::run::Samples;
use crate::trajectory::Trajectory;
use crate::{array, json};

/// Converts the result of the trajectory check to plain values, with refusals and warnings as text.
pub(crate) fn verdict<'py>(py: Python<'py>, verdict: &Verdict) -> PyResult<Bound<'py, PyAny>> {
    let all = json::plain(py, verdict)?;
    all.set_item("ok", verdict.is_ok())?;
    all.set_item("text", verdict.to_string())?;
    all.set_item("refusals", verdict.refusals().map(ToString::to_string).collect::<Vec<_>>())?;
    let low = verdict.margin.and_then(|margin| margin.warning());
    let warnings: Vec<String> = verdict.warnings().map(ToString::to_string).chain(low).collect();
    all.set_item("warnings", warnings)?;
    all.set_item("next", if verdict.is_ok() { String::new() } else { in_python(&verdict.hint()) })?;
    Ok(all)
}

/// Planned motion that passed the check.
#[pyclass(frozen, module = "openjtc._native")]
pub(crate) struct Plan {
    planned: Planned,
    samples: Vec<jtc_host::Sample>,
    info: RecordingInfo,
}

#[pymethods]
impl Plan {
    #[getter]
    fn trajectory(&self) -> Trajectory {
        Trajectory::of(self.planned.trajectory.clone())
    }

    #[getter]
    fn waypoint_times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.planned.waypoint_times)
    }

    /// Returns the time intervals in which a joint is at one of its limits.
    fn binding<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>, Failure> {
        json::plain(py, &self.planned.binding)
    }

    #[getter]
    fn notes(&self) -> Vec<String> {
        self.planned.notes.clone()
    }

    fn check<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        verdict(py, &self.planned.verdict)
    }

    /// Returns the commanded values of each point, including the torques.
    fn samples(&self) -> Samples {
        let Planned { binding, notes, .. } = &self.planned;
        Samples::of_plan(self.info.clone(), self.samples.clone(), binding.clone(), notes.clone())
    }
}

/// Planner for one arm.
#[pyclass(frozen, module = "openjtc._native")]
pub(crate) struct Planner {
    arm: Arc<jtc_host::Arm>,
    config: jtc_core::Config,
    speed: f64,
    blend: f64,
    blend_m: f64,
    line: bool,
    jerk: bool,
    temperature: f64,
    margin_pct: f64,
}

impl Planner {
    /// Returns the blend that was passed to the call, or the blend of the planner if no blend was passed.
    fn blend(&self, given: Option<f64>) -> Result<f64, Failure> {
        given.map_or(Ok(self.blend), |blend| distance("blend", blend))
    }

    fn plan(
        &self,
        py: Python<'_>,
        plan: impl FnOnce(&HostPlanner<'_>) -> Result<Planned, Failure> + Send,
    ) -> PyResult<Plan> {
        let planned = py.detach(|| {
            let friction = self.arm.friction();
            let planner = HostPlanner {
                model: Some(&self.arm.model),
                friction: friction.as_ref(),
                temperature: self.temperature,
                speed_pct: self.speed,
                jerk: self.jerk,
                margin_pct: self.margin_pct,
                ..HostPlanner::new(&self.config)
            };
            let planned = plan(&planner)?;
            let samples = planner.samples(&planned.trajectory);
            let (source, trajectory) = ("planned, not run".to_owned(), "plan".to_owned());
            let info = RecordingInfo { source, trajectory, ..RecordingInfo::of(&self.arm) };
            Ok::<_, Failure>(Plan { planned, samples, info })
        });
        Ok(planned?)
    }

    fn waypoints(&self, py: Python<'_>, file: WaypointFile, blend: Option<f64>) -> PyResult<Plan> {
        let blend = self.blend(blend)?;
        self.plan(py, |planner| {
            let options = WayOptions { line: self.line, blend, blend_m: self.blend_m };
            let way = WaypointPath::of(&file, &self.arm, options).map_err(Failure::from)?;
            way.planned(&HostPlanner { blend, ..planner.clone() })
                .map_err(|error| Failure::of(&error).message(file.located(&error)))
        })
    }
}

/// Returns a valid blend, or an error if the blend is negative or not finite.
fn distance(what: &str, value: f64) -> Result<f64, Failure> {
    if value.is_finite() && value >= 0.0 {
        return Ok(value);
    }
    Err(Failure::usage(format!(
        "{what}: {value} is not a valid distance, expected a finite number of at least 0"
    )))
}

/// Returns the torque margin that was passed to the call, or the default margin if no margin was passed, %.
pub(crate) fn margin_of(given: Option<f64>) -> Result<f64, Failure> {
    let percent = given.unwrap_or(MARGIN_PCT);
    margin_in_range(percent)?;
    Ok(percent)
}

#[pymethods]
impl Planner {
    #[new]
    #[pyo3(signature = (arm, speed, blend, blend_m, line, jerk, temperature, payload, margin))]
    #[allow(clippy::too_many_arguments, reason = "Python names them")]
    fn new(
        arm: &Arm,
        speed: f64,
        blend: f64,
        blend_m: f64,
        line: bool,
        jerk: bool,
        temperature: Option<f64>,
        payload: Option<PayloadNumbers>,
        margin: Option<f64>,
    ) -> Result<Self, Failure> {
        let margin_pct = margin_of(margin)?;
        let payload = crate::dynamics::payload(payload)?;
        let (blend, blend_m) = (distance("blend", blend)?, distance("blend_m", blend_m)?);
        let config = jtc_core::Config { payload, ..arm.inner.config() };
        let temperature = temperature.unwrap_or(COLD);
        let arm = Arc::clone(&arm.inner);
        Ok(Self { arm, config, speed, blend, blend_m, line, jerk, temperature, margin_pct })
    }

    /// Plans a motion between two positions. The arm is at rest at both positions.
    fn to(&self, py: Python<'_>, start: &Bound<'_, PyAny>, to: &Bound<'_, PyAny>) -> PyResult<Plan> {
        let target = Target::Joints(array::joints(to, "to")?);
        let start = array::joints(start, "start")?;
        self.plan(py, |planner| Ok(planner.to_target(&self.arm.model, &start, &target, self.line)?))
    }

    /// Plans a motion from a position at rest to a pose of the flange: x y z (m), roll pitch yaw (rad).
    fn to_flange(
        &self,
        py: Python<'_>,
        start: &Bound<'_, PyAny>,
        flange: &Bound<'_, PyAny>,
    ) -> PyResult<Plan> {
        let [x, y, z, angles @ ..] = array::joints(flange, "flange")?;
        let pose = Orientation::Rpy(angles).at([x, y, z]);
        let target = Target::Flange(pose.map_err(|error| Failure::usage(error.to_string()))?);
        let start = array::joints(start, "start")?;
        self.plan(py, |planner| Ok(planner.to_target(&self.arm.model, &start, &target, self.line)?))
    }

    /// Plans a motion through positions (N, 6). `blend` (rad) replaces the blend of the planner. `times` are in s from the first
    /// position. For a time of NaN, the arm reaches the position as soon as the limits allow.
    #[pyo3(signature = (positions, blend=None, times=None))]
    fn through(
        &self,
        py: Python<'_>,
        positions: &Bound<'_, PyAny>,
        blend: Option<f64>,
        times: Option<Vec<f64>>,
    ) -> PyResult<Plan> {
        let blend = self.blend(blend)?;
        let (positions, _) = array::rows(positions, "waypoints")?;
        let times = times.unwrap_or_else(|| vec![f64::NAN; positions.len()]);
        if times.len() != positions.len() {
            let (count, given) = (positions.len(), times.len());
            return Err(Failure::usage(format!(
                "{count} waypoints, but {given} times: pass one time per waypoint"
            ))
            .into());
        }
        let waypoints: Vec<Waypoint> = positions
            .into_iter()
            .zip(times)
            .map(|(position, time)| Waypoint { position, time: time.is_finite().then_some(time) })
            .collect();
        self.plan(py, |planner| Ok(HostPlanner { blend, ..planner.clone() }.through(&waypoints)?))
    }

    /// Plans a motion through the waypoints of a CSV or JSON file.
    fn through_file(
        &self,
        py: Python<'_>,
        path: PathBuf,
        blend: Option<f64>,
        degrees: bool,
    ) -> PyResult<Plan> {
        let file = WaypointFile::load(&path).map_err(Failure::from)?;
        let file = if degrees { file.in_degrees().map_err(Failure::from)? } else { file };
        self.waypoints(py, file, blend)
    }

    /// Plans a motion through the waypoints in the text of a CSV or JSON file.
    fn through_text(&self, py: Python<'_>, text: &str, blend: Option<f64>, degrees: bool) -> PyResult<Plan> {
        let file = WaypointFile::parse(text).map_err(Failure::from)?;
        let file = if degrees { file.in_degrees().map_err(Failure::from)? } else { file };
        self.waypoints(py, file, blend)
    }

    /// Checks a trajectory. If `start` is set, the motion starts at this position of the arm.
    #[pyo3(signature = (trajectory, start=None))]
    fn check<'py>(
        &self,
        py: Python<'py>,
        trajectory: &Trajectory,
        start: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let start = start.map(|start| array::joints(start, "start")).transpose()?;
        let found = py.detach(|| {
            let friction = self.arm.friction();
            let checker = Checker {
                model: Some(&self.arm.model),
                friction: friction.as_ref(),
                start,
                ..Checker::new(&self.config)
            };
            checker.check(&trajectory.inner)
        });
        verdict(py, &found)
    }
}

/// Returns the text of an example trajectory or file by its name.
#[pyfunction]
fn example_text(name: &str) -> Result<String, Failure> {
    let all = &jtc_host::example::EXAMPLES;
    all.iter().find(|example| example.name == name).map(|example| example.text()).ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|example| example.name).collect();
        Failure::usage(format!("example {name:?} does not exist"))
            .next(format!("the examples are {}", names.join(", ")))
    })
}

/// Reduces positions (N, 6) to waypoints. Every removed position is within a tolerance (rad) of the straight lines between the waypoints.
#[pyfunction]
fn thinned<'py>(
    py: Python<'py>,
    positions: &Bound<'py, PyAny>,
    tolerance: f64,
) -> Result<Bound<'py, numpy::PyArray2<f64>>, Failure> {
    if !(1e-6..=1.0).contains(&tolerance) {
        return Err(Failure::usage(format!("tolerance {tolerance} rad is out of range (0.000001 to 1 rad)"))
            .next("choose a tolerance in this range; 0.01 rad is about half a degree"));
    }
    let (rows, _) = array::rows(positions, "positions")?;
    let kept = py.detach(|| jtc_host::waypoints::thinned(&rows, tolerance));
    Ok(array::matrix(py, &kept.into_iter().map(|i| rows[i]).collect::<Vec<_>>()))
}

/// Registers the classes and functions in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Planner>()?;
    module.add_class::<Plan>()?;
    module.add_function(wrap_pyfunction!(thinned, module)?)?;
    module.add_function(wrap_pyfunction!(example_text, module)?)
}
