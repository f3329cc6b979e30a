//! Values that a tick of the controller computed.

use jtc_core::{JOINTS, JointTelemetry, Telemetry as CoreTelemetry};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

/// Values of one tick of the controller. Each array has six numbers, in the order from base to wrist.
#[pyclass(frozen, module = "openjtc._native", eq)]
pub(crate) struct Telemetry(pub CoreTelemetry);

impl PartialEq for Telemetry {
    /// Compares all values bit for bit.
    fn eq(&self, other: &Self) -> bool {
        self.bits() == other.bits()
    }
}

impl Telemetry {
    fn of<'py>(&self, py: Python<'py>, value: impl Fn(&JointTelemetry) -> f64) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.joints.each_ref().map(value))
    }

    fn bits(&self) -> Vec<u8> {
        let CoreTelemetry { tick, state, trajectory, point, braking, errors, records_lost, joints } = &self.0;
        let mut bits = Vec::with_capacity(32 + JOINTS * 13 * 8);
        bits.extend(tick.to_le_bytes());
        bits.extend([*state as u8, *trajectory as u8, u8::from(*braking)]);
        bits.extend(point.to_le_bytes());
        bits.extend(errors.to_le_bytes());
        bits.extend(records_lost.to_le_bytes());
        for joint in joints {
            // The pattern lists all fields, so that a new field causes a compiler error here.
            let JointTelemetry {
                set_position,
                set_velocity,
                set_acceleration,
                due_position,
                position,
                velocity,
                fresh,
                temperature,
                torque_model,
                torque_p,
                torque_i,
                torque_d,
                torque_friction,
                torque_other,
                torque,
                state,
                internal,
            } = joint;
            for value in [
                set_position,
                set_velocity,
                set_acceleration,
                due_position,
                position,
                velocity,
                temperature,
                torque_model,
                torque_p,
                torque_i,
                torque_d,
                torque_friction,
                torque_other,
                torque,
            ] {
                bits.extend(value.to_bits().to_le_bytes());
            }
            bits.extend([u8::from(*fresh), state.code()]);
            bits.extend(internal.to_le_bytes());
        }
        bits
    }
}

#[pymethods]
impl Telemetry {
    /// Commanded positions, rad.
    #[getter]
    fn set_position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.set_position)
    }

    /// Commanded velocities, rad/s.
    #[getter]
    fn set_velocity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.set_velocity)
    }

    /// Commanded accelerations, rad/s².
    #[getter]
    fn set_acceleration<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.set_acceleration)
    }

    /// Commanded positions for the time of the measurement, rad. The control law compares the measured positions with these positions.
    #[getter]
    fn due_position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.due_position)
    }

    /// Measured positions, rad.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.position)
    }

    /// Measured velocities, rad/s.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.velocity)
    }

    /// Bearing temperatures, °C.
    #[getter]
    fn temperature<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.temperature)
    }

    /// Torques of the model (inverse dynamics and rotors), N·m.
    #[getter]
    fn torque_model<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.torque_model)
    }

    /// Proportional parts of the torques, N·m.
    #[getter]
    fn torque_p<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.torque_p)
    }

    /// Integral parts of the torques, N·m.
    #[getter]
    fn torque_i<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.torque_i)
    }

    /// Derivative parts of the torques, N·m.
    #[getter]
    fn torque_d<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.torque_d)
    }

    /// Torques of the friction compensation, N·m.
    #[getter]
    fn torque_friction<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.torque_friction)
    }

    /// Other torques, N·m: the torques that smooth a change of state, and the payload and braking torques in Teaching.
    #[getter]
    fn torque_other<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.torque_other)
    }

    /// Torques that the controller commands on the joint bus, N·m.
    #[getter]
    fn torque<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, |joint| joint.torque)
    }

    /// Number of ticks since the start of the controller.
    #[getter]
    fn tick(&self) -> u64 {
        self.0.tick
    }

    /// State of the controller: `Start`, `Init`, `HoldPos`, `Operate`, `Teaching`, `Error`.
    #[getter]
    fn state(&self) -> &'static str {
        self.0.state.name()
    }

    /// State of the trajectory: `Null`, `Stop` (complete, arm at its start), `Pause`, `Execute`, `Finish`.
    #[getter]
    fn trajectory(&self) -> &'static str {
        self.0.trajectory.name()
    }

    /// Time on the trajectory, ms.
    #[getter]
    fn point(&self) -> u32 {
        self.0.point
    }

    /// True if a Pause or Stop brakes the arm with the full torque.
    #[getter]
    fn braking(&self) -> bool {
        self.0.braking
    }

    /// Error word of the controller; 0 means no error.
    #[getter]
    fn errors(&self) -> u16 {
        self.0.errors
    }

    /// Joint errors found by the controller, one error word per joint.
    #[getter]
    fn joint_errors(&self) -> Vec<u16> {
        self.0.joints.iter().map(|joint| joint.internal).collect()
    }

    /// Flags of the joints: true if the position and velocity of the joint were measured for this tick. For the other joints, the values
    /// are predicted.
    #[getter]
    fn fresh(&self) -> Vec<bool> {
        self.0.joints.iter().map(|joint| joint.fresh).collect()
    }

    /// States of the drives, as text.
    #[getter]
    fn drives(&self) -> Vec<&'static str> {
        self.0.joints.iter().map(|joint| joint.state.name()).collect()
    }

    /// Position errors, rad: `due_position` minus `position`.
    #[getter]
    fn position_error<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.of(py, JointTelemetry::position_error)
    }

    /// Returns the exact bits of all values. If two ticks are equal, their bytes are equal.
    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.bits())
    }

    fn __repr__(&self) -> String {
        let CoreTelemetry { tick, state, trajectory, point, errors, .. } = &self.0;
        format!(
            "Telemetry(tick={tick}, state={:?}, trajectory={:?}, point={point}, errors=0x{errors:04X})",
            state.name(),
            trajectory.name()
        )
    }
}

/// Registers the class in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Telemetry>()
}
