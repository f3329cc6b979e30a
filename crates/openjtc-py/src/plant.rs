//! Simulated arm with its drives, for controllers written in Python.

use jtc_bus::{Answer, JointReport, NodeState, Request, Scale, Target};
use jtc_core::JOINTS;
use jtc_sim::{DriveConfig, Plant as SimPlant, SimConfig, Support};
use numpy::PyArray1;
use pyo3::prelude::*;

use crate::array;
use crate::error::Failure;
use crate::simulated::{SimulatedArm, pass};
use crate::simulator::truth;

/// Boot time of the drives, ms. During the boot time, enough samples arrive to fill the averaging window of the
/// drive speed.
const BOOT_MS: u32 = 12;
/// Maximum time until the drives are enabled, ms.
const BRING_UP_MS: u64 = 2_000;

/// Simulated arm, with or without drives.
#[pyclass(module = "openjtc._native")]
pub(crate) struct Plant {
    config: SimConfig,
    plant: SimPlant,
    drives: bool,
    ticks: u64,
    /// Latest reports of the drives.
    reports: [JointReport; JOINTS],
}

#[pymethods]
impl Plant {
    #[new]
    #[pyo3(signature = (arm, *, drives))]
    fn new(py: Python<'_>, arm: SimulatedArm<'_>, drives: bool) -> Result<Self, Failure> {
        let mut config = SimConfig { support: Support::Brakes, gripper: false, ..arm.config()? };
        for drive in &mut config.drives {
            // The boot and alignment times of the simulated drives are short, so that the plant starts quickly.
            *drive = DriveConfig { boot_ms: BOOT_MS, first_enable_ms: 1, ..*drive };
        }
        let plant = SimPlant::new(&config);
        let mut new = Self { config, plant, drives, ticks: 0, reports: Default::default() };
        py.detach(|| new.bring_up())?;
        Ok(new)
    }

    /// Restarts the simulation with the arm at rest at `position` and the drives just enabled.
    fn reset(&mut self, py: Python<'_>, position: &Bound<'_, PyAny>) -> Result<(), Failure> {
        let position = array::joints(position, "position")?;
        for (joint, (q, (low, high))) in position.iter().zip(&self.config.arm.stops).enumerate() {
            if !(*low..=*high).contains(q) {
                let joint = joint + 1;
                let what = format!(
                    "position: joint {joint} at {q} rad is outside its end stops ({low} to {high} rad)"
                );
                return Err(Failure::usage(what));
            }
        }
        self.config.start = position;
        self.plant = SimPlant::new(&self.config);
        (self.ticks, self.reports) = (0, Default::default());
        py.detach(|| self.bring_up())
    }

    /// Applies torques for `ms` milliseconds.
    fn step(&mut self, py: Python<'_>, torque: &Bound<'_, PyAny>, ms: u64) -> PyResult<()> {
        let torque = array::joints(torque, "torque")?;
        pass(py, ms, || self.millisecond(&torque))
    }

    #[getter]
    fn time_ms(&self) -> u64 {
        self.ticks
    }

    /// Joint positions in the latest reports of the drives, or the true positions without drives.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.measured(|report| report.position, self.plant.truth().q))
    }

    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.measured(|report| report.velocity, self.plant.truth().qd))
    }

    #[getter]
    fn temperature<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let of = |report: &JointReport| f64::from(report.temperature);
        PyArray1::from_slice(py, &self.measured(of, self.plant.truth().temperature))
    }

    /// Returns true values of the arm: `position`, `velocity`, `torque`, `outside`, `temperature`.
    fn truth<'py>(&self, py: Python<'py>, what: &str) -> Result<Bound<'py, PyArray1<f64>>, Failure> {
        truth(py, self.plant.truth(), what)
    }

    /// Flags that are `true` for drives that hold their joints.
    #[getter]
    fn enabled(&self) -> Vec<bool> {
        let states = self.plant.node_states();
        states[..JOINTS].iter().map(|state| !self.drives || *state == NodeState::ENABLED).collect()
    }

    /// Error bits of the drives.
    #[getter]
    fn errors(&self) -> Vec<u32> {
        self.reports.iter().map(|report| report.errors.into()).collect()
    }

    /// Maximum torques of the drives, N·m.
    #[getter]
    fn torque_max<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.config.arm.torque_ceiling)
    }
}

impl Plant {
    fn measured(&self, of: impl Fn(&JointReport) -> f64, truth: [f64; JOINTS]) -> [f64; JOINTS] {
        if self.drives { self.reports.each_ref().map(of) } else { truth }
    }

    fn millisecond(&mut self, torque: &[f64; JOINTS]) {
        if self.drives {
            self.ask(&Request::Move { torque: *torque, pump: false });
            self.plant.step(true);
        } else {
            self.plant.step_free(torque);
        }
        self.ticks += 1;
    }

    /// Sends a request to the drives, and stores the drives' answers to Move frames.
    fn ask(&mut self, request: &Request) {
        let mut answers = Vec::new();
        self.plant.receive(self.ticks * 1_000, &request.emit(), &mut answers);
        for (_, frame) in answers {
            let scale = Scale { velocity: self.config.drives[0].velocity_full_scale };
            if let Ok(Answer::Joint { node, report }) = Answer::parse(&frame, scale)
                && let Some(kept) = self.reports.get_mut(usize::from(node))
            {
                *kept = report;
            }
        }
    }

    /// Configures and enables the drives in the same way as the controller does. Until the drives are enabled,
    /// brakes hold the arm.
    fn bring_up(&mut self) -> Result<(), Failure> {
        if !self.drives {
            return Ok(());
        }
        let bits = self.config.controller.joint_config_bits;
        let configure = Request::ChangeMode { mode: [1; JOINTS], config: [bits; JOINTS], gripper: 0 };
        let to = |target| Request::ChangeFsm { target: [target; jtc_bus::NODES] };
        let mut configured = false;
        for _ in 0..BRING_UP_MS {
            let states = self.plant.node_states();
            let all = |state: NodeState| states[..JOINTS].iter().all(|each| *each == state);
            if all(NodeState::ENABLED) {
                // The answers to this request contain the measured values at the beginning of the first step.
                self.ask(&Request::zero_torque(false));
                self.ticks = 0;
                return Ok(());
            }
            // At most one frame per millisecond is sent, as on the real bus.
            if all(NodeState::INIT) && !configured {
                self.ask(&configure);
                configured = true;
            } else if all(NodeState::INIT) {
                self.ask(&to(Target::Ready));
            } else if all(NodeState::READY) {
                self.ask(&to(Target::Enable));
            } else {
                self.ask(&Request::zero_torque(false));
            }
            self.plant.step(true);
            self.ticks += 1;
        }
        Err(Failure::usage(format!(
            "the drives are not enabled after {BRING_UP_MS} ms: {:?}",
            self.plant.node_states()
        )))
    }
}

/// Registers the class in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Plant>()
}
