//! Queries, and changes other than motions: arm, settings, payload, errors and flight recorder. The module also applies disturbances
//! to a simulated arm.

use std::sync::Arc;
use std::time::Duration;

use jtc_core::{JOINTS, settings};
use jtc_host::held_stop::{self, HeldStop, Reacting};
use jtc_host::log::Account;
use jtc_host::sample::is_measured;
use jtc_host::session::RecoverParameters;
use jtc_host::{StateError, doctor, labels};
use jtc_sim::{HandPath, TypedEvent};
use jtc_wire::{Joint, SettingValue, Status, StopCause};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use super::Link;
use crate::arm::Arm;
use crate::dynamics::{PayloadNumbers, payload};
use crate::error::{Failure, in_python};
use crate::log::FlightLog;
use crate::run::Samples;
use crate::trajectory::Trajectory;
use crate::{array, json};

/// Time for which the diagnosis (`jtc doctor`) observes the controller.
const LOOK: Duration = Duration::from_millis(1500);

/// Returns the measured joint positions (rad). Returns an error if a joint has no measurement.
fn measured(status: &Status) -> Result<[f64; JOINTS], StateError> {
    match Joint::ALL.into_iter().find(|joint| !is_measured(status, joint.index())) {
        Some(joint) => Err(StateError::NotMeasured { joint }),
        None => Ok(status.positions()),
    }
}

/// Converts a status to plain values. Values that a joint does not report are NaN. `stop` is the current held stop, if the controller
/// reports one.
pub(super) fn status<'py>(
    py: Python<'py>,
    status: &Status,
    stop: Option<(StopCause, u32)>,
) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    all.set_item("state", status.state.name())?;
    all.set_item("trajectory", status.trajectory.name())?;
    all.set_item("point", status.point)?;
    let joints = &status.joints;
    let column = |of: fn(&jtc_wire::JointStatus) -> f64| {
        let value = |j: usize| if is_measured(status, j) { of(&joints[j]) } else { f64::NAN };
        PyArray1::from_slice(py, &std::array::from_fn::<f64, JOINTS, _>(value))
    };
    all.set_item("position", column(|joint| joint.position.into()))?;
    all.set_item("velocity", column(|joint| joint.velocity.into()))?;
    all.set_item("torque", column(|joint| joint.torque.into()))?;
    all.set_item("temperature", column(|joint| joint.temperature.into()))?;
    all.set_item("joint_states", joints.each_ref().map(|joint| joint.state.name()).to_vec())?;
    all.set_item("errors", labels::causes(status))?;
    all.set_item("warnings", labels::warnings(status))?;
    all.set_item("waiting_for", labels::waiting_for(status))?;
    let cause = stop.as_ref().map(|(cause, _)| cause);
    all.set_item("next", in_python(&held_stop::next_step(status, cause)))?;
    all.set_item("held_stop", json::plain(py, &stop.map(|(cause, ago_ms)| HeldStop::new(&cause, ago_ms)))?)?;
    Ok(all)
}

#[pymethods]
impl Link {
    /// Returns the arm of the controller. If the controller cannot report its arm, returns the arm that the caller passed, or the
    /// built-in arm.
    fn arm(&self, py: Python<'_>) -> PyResult<Arm> {
        Ok(Arm::of(self.call(py, |state, _| state.device_arm())?))
    }

    /// Sends a complete arm to the controller. With `store`, the controller also stores the arm in its non-volatile memory.
    fn push_arm(&self, py: Python<'_>, arm: &Arm, store: bool) -> PyResult<()> {
        let arm = Arc::clone(&arm.inner);
        self.call(py, move |state, asked| {
            let session = &mut state.session;
            if store {
                session.push_and_store_arm_until(&arm, || asked.is_halted(), |_| {})?;
            } else if session.info()?.is_some() {
                session.push_arm_until(&arm, || asked.is_halted(), |_| {})?;
            } else {
                // A controller without extensions accepts only the friction, gains and model of an arm.
                let device = session.device_config()?;
                let differences = arm.device_differences(&device);
                if !differences.is_empty() {
                    let arm = arm.name.clone();
                    return Err(jtc_host::CheckError::DeviceLimits { arm, differences }.into());
                }
                session.push_until(&arm.parameter_set(), || asked.is_halted(), |_| {})?;
            }
            (state.arm, state.named) = (arm, true);
            Ok(())
        })
    }

    /// Requests that the controller uses its built-in or stored friction, gains and arm model.
    fn use_defaults(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, |state, _| Ok(state.session.use_defaults()?))
    }

    /// Returns the payload that the controller uses: mass (kg), centre of mass (m), inertia (kg·m²).
    fn payload(&self, py: Python<'_>) -> PyResult<PayloadNumbers> {
        let payload = self.call(py, |state, _| Ok(state.session.payload()?))?;
        Ok((payload.mass, payload.com, payload.inertia))
    }

    fn set_payload(&self, py: Python<'_>, numbers: PayloadNumbers) -> PyResult<()> {
        let payload = payload(Some(numbers))?;
        self.call(py, move |state, _| Ok(state.session.set_payload(&payload)?))
    }

    /// Recovers the controller to HoldPos. Returns the steps as text.
    #[pyo3(signature = (arm=None, defaults=false, accept_device_limits=false))]
    fn recover(
        &self,
        py: Python<'_>,
        arm: Option<&Arm>,
        defaults: bool,
        accept_device_limits: bool,
    ) -> PyResult<Vec<String>> {
        if arm.is_some() && defaults {
            return Err(Failure::usage(
                "arm and defaults cannot be combined: each selects a set of parameters; nothing was sent",
            )
            .next("pass only one of the two")
            .into());
        }
        let parameters = match arm.map(|arm| Arc::clone(&arm.inner)) {
            Some(arm) => RecoverParameters::Arm { arm, accept_device_limits },
            None if defaults => RecoverParameters::ControllerDefaults,
            None => RecoverParameters::None,
        };
        parameters.check().map_err(Failure::from)?;
        self.call(py, move |state, asked| {
            let mut steps = Vec::new();
            state.session.recover_with(
                &parameters,
                || asked.is_halted(),
                |step| steps.push(step.to_string()),
            )?;
            Ok(steps)
        })
    }

    fn clear(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, |state, _| Ok(state.session.clear_all()?))
    }

    fn disable(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, |state, _| Ok(state.session.disable()?))
    }

    fn gripper(&self, py: Python<'_>, pump: bool) -> PyResult<()> {
        self.call(py, move |state, _| Ok(state.session.gripper(pump)?))
    }

    /// Returns the identity of the controller; `None` if the controller has no extensions.
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(info) = self.call(py, |state, _| Ok(state.session.info()?))? else { return Ok(None) };
        let all = PyDict::new(py);
        all.set_item("board", info.board.to_string())?;
        all.set_item("firmware", info.firmware())?;
        all.set_item("revision", info.revision())?;
        all.set_item("arm", info.arm.to_string())?;
        all.set_item("hash", format!("{:016x}", info.hash))?;
        all.set_item("boots", info.boots)?;
        all.set_item("uptime", info.uptime_ms as f64 * 1e-3)?;
        all.set_item("log", info.log.name())?;
        all.set_item("reactions", json::plain(py, &Reacting::of(&info))?)?;
        Ok(Some(all))
    }

    /// Returns settings by name. The value of a joint setting is a list of six numbers.
    fn settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let values = self.call(py, |state, _| Ok(state.session.settings()?))?;
        let all = PyDict::new(py);
        for value in values {
            let Some(setting) = settings::setting(value.setting) else { continue };
            if value.joint == 0 {
                all.set_item(setting.name, value.value)?;
            } else if let Some(list) = all.get_item(setting.name)? {
                list.cast::<PyList>()?.append(value.value)?;
            } else {
                all.set_item(setting.name, PyList::new(py, [value.value])?)?;
            }
        }
        Ok(all)
    }

    /// Writes settings that are passed as (name, joint, value). Either all settings are written, or no setting is written. Joints are
    /// counted from 1; 0 selects a setting of the whole arm.
    fn set_settings(&self, py: Python<'_>, values: Vec<(String, u8, f64)>) -> PyResult<()> {
        let mut given = Vec::new();
        for (name, joint, value) in values {
            let setting = settings::named(&name).ok_or_else(|| {
                Failure::usage(format!("setting {name:?} does not exist"))
                    .next("`robot.settings` lists all settings")
            })?;
            given.push(SettingValue { setting: setting.number, joint, value });
        }
        // All settings are checked before the first setting is sent.
        self.call(py, move |state, _| Ok(state.session.change_settings(&given)?))
    }

    /// Returns the findings of `jtc doctor`, with the worst finding first.
    fn doctor<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let found = self.call(py, |state, asked| {
            let mut seen = state.session.examine_until(LOOK, || asked.is_halted())?;
            if asked.is_halted() {
                return Err(jtc_host::Error::Cancelled.into());
            }
            // The list of held stops and encoder jumps is read only if drives have torque, because these reactions do
            // not occur without torque.
            if seen.status.as_ref().is_some_and(labels::has_torque) {
                seen.reactions = state.session.reactions();
            }
            Ok(doctor::findings(&seen))
        })?;
        let all = PyList::empty(py);
        for finding in &found {
            let values = json::plain(py, finding)?;
            values.set_item("next", in_python(&finding.next))?;
            all.append(values)?;
        }
        Ok(all.into_any())
    }

    /// Reads the log of the flight recorder and replays the log.
    fn fetch_log(&self, py: Python<'_>) -> PyResult<FlightLog> {
        let account = self.call(py, |state, asked| {
            let log = state.session.fetch_log_until(|| asked.is_halted(), |_, _| {})?;
            let source = jtc_host::Port::name(state.session.port());
            Ok(Account::of(log, None, &source))
        })?;
        Ok(FlightLog::of(account))
    }

    fn clear_log(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, |state, _| Ok(state.session.clear_log()?))
    }

    /// Checks a trajectory in the same way as a run does, from the current position or from `start`.
    #[pyo3(signature = (trajectory, start=None, accept_device_limits=false))]
    fn check<'py>(
        &self,
        py: Python<'py>,
        trajectory: &Trajectory,
        start: Option<&Bound<'py, PyAny>>,
        accept_device_limits: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let start = start.map(|start| array::joints(start, "start")).transpose()?;
        let trajectory = Arc::clone(&trajectory.inner);
        let verdict = self.call(py, move |state, _| {
            let arm = state.arm_to_move()?;
            let device = state.session.device_config()?;
            let start = match start {
                Some(start) => start,
                None => measured(&state.session.fresh_status()?)?,
            };
            let options =
                jtc_host::CheckOptions { accept_device_limits, device, ..jtc_host::CheckOptions::default() };
            match jtc_host::CheckedTrajectory::check(&trajectory, &arm, &start, &options) {
                Ok(checked) => Ok(checked.verdict().clone()),
                Err(jtc_host::CheckError::Refused(verdict)) => Ok(*verdict),
                Err(error) => Err(error.into()),
            }
        })?;
        crate::planner::verdict(py, &verdict)
    }

    /// Applies a disturbance in the notation of `jtc sim`, such as `push 3 12 0.5`.
    fn simulate(&self, event: &str) -> Result<(), Failure> {
        let event = TypedEvent::parse(event).map_err(|error| Failure::usage(error.to_string()))?;
        if let Some(TypedEvent::Push { joint, torque, seconds }) = event {
            self.worker.touch(move |world| world.push(joint, torque, (seconds * 1e3) as u64))?;
        }
        Ok(())
    }

    /// Guides the simulated arm along a trajectory during Teaching, like the hand of an operator.
    fn lead(&self, trajectory: &Trajectory) -> Result<(), Failure> {
        let trajectory = &trajectory.inner;
        let points = trajectory.points.iter().map(|point| point.position).collect();
        let path = HandPath::new(points, f64::from(trajectory.step_ms) * 1e-3);
        let path = path.ok_or_else(|| Failure::usage("the trajectory has no points"))?;
        self.worker.touch(move |world| world.lead(path))
    }

    /// Injects the faults of a fault file. The fault times are counted from the start of the simulation.
    fn inject(&self, faults: &str) -> Result<(), Failure> {
        let plan =
            jtc_sim::FaultPlan::from_toml(faults).map_err(|error| Failure::usage(error.to_string()))?;
        self.worker.touch(move |world| plan.faults.into_iter().for_each(|fault| world.inject(fault)))
    }
}

/// Returns the samples of all ticks in the log, and the first failure.
pub(crate) fn samples(account: &Account) -> Samples {
    Samples::of_log(account.info.clone(), account.replayed.samples(), account.failure.clone())
}
