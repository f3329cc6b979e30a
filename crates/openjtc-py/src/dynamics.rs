//! Dynamics and kinematics of an arm; each call handles many states.

use std::sync::Arc;

use jtc_core::{Friction, JOINTS, Payload, friction};
use jtc_dynamics::{Dynamics as ArmDynamics, JointVec, Pose};
use jtc_host::Arm as HostArm;
use jtc_host::plan::PlanError;
use jtc_host::plan::kinematics::{Kinematics, PoseError};
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods as _, PyUntypedArrayMethods as _};
use pyo3::prelude::*;

use crate::arm::Arm;
use crate::array;
use crate::error::Failure;

/// Payload as Python passes it: mass, centre of mass, inertia.
pub(crate) type PayloadNumbers = (f64, [f64; 3], [f64; 6]);

/// Makes a payload. Returns an error if the values are not physically consistent.
pub(crate) fn payload(numbers: Option<PayloadNumbers>) -> Result<Payload, Failure> {
    let Some((mass, com, inertia)) = numbers else { return Ok(Payload::NONE) };
    let payload = Payload { mass, com, inertia };
    payload.check().map_err(|error| Failure::usage(error.to_string()))?;
    Ok(payload)
}

/// Dynamics of one arm. The object is immutable.
#[pyclass(frozen, module = "openjtc._native")]
pub(crate) struct Dynamics {
    arm: Arc<HostArm>,
    dynamics: ArmDynamics,
    kinematics: Kinematics,
    rotor: JointVec,
    sign_width: f64,
}

#[pymethods]
impl Dynamics {
    #[new]
    #[pyo3(signature = (arm, payload=None, gravity=None))]
    fn new(arm: &Arm, payload: Option<PayloadNumbers>, gravity: Option<[f64; 3]>) -> Result<Self, Failure> {
        let arm = Arc::clone(&arm.inner);
        let config = arm.config();
        let gravity = gravity.unwrap_or(config.gravity);
        if let Some(bad) = gravity.iter().find(|g| !g.is_finite()) {
            return Err(Failure::usage(format!("gravity: {bad} m/s² is not finite")));
        }
        let limits = std::array::from_fn(|joint| config.position_range(joint));
        Ok(Self {
            dynamics: ArmDynamics::with_payload(&arm.model, gravity, &self::payload(payload)?),
            kinematics: Kinematics::new(&arm.model, &limits),
            rotor: config.joints.each_ref().map(|joint| joint.rotor_inertia),
            sign_width: config.friction_sign_width,
            arm,
        })
    }

    /// Computes the joint torques of the rigid-body model.
    fn inverse<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        qdd: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Failure> {
        let states = States::read([("q", q), ("qd", qd), ("qdd", qdd)])?;
        let torques = states.map(py, |[q, qd, qdd]| self.dynamics.inverse(q, qd, qdd));
        Ok(array::as_given(py, &torques, states.one))
    }

    /// Computes joint accelerations. If `rotors` is set, the rotor inertias of the arm are included.
    fn forward<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        qd: &Bound<'py, PyAny>,
        tau: &Bound<'py, PyAny>,
        rotors: bool,
    ) -> Result<Bound<'py, PyAny>, Failure> {
        let states = States::read([("q", q), ("qd", qd), ("tau", tau)])?;
        let rotor = if rotors { self.rotor } else { [0.0; JOINTS] };
        let accelerations = states.map(py, |[q, qd, tau]| self.dynamics.forward(q, qd, tau, &rotor));
        Ok(array::as_given(py, &accelerations, states.one))
    }

    /// Computes the joint torques that hold the arm at rest.
    fn gravity<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Failure> {
        let states = States::read([("q", q)])?;
        let torques = states.map(py, |[q]| self.dynamics.gravity_torque(q));
        Ok(array::as_given(py, &torques, states.one))
    }

    /// Computes mass matrices without rotor inertias.
    fn mass_matrix<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>, Failure> {
        let states = States::read([("q", q)])?;
        let matrices = states.map(py, |[q]| self.dynamics.mass_matrix(q));
        shaped(py, matrices.as_flattened().as_flattened(), states.one, states.count, &[JOINTS, JOINTS])
    }

    /// Computes the poses of the six joint frames and of the flange, as 4×4 matrices.
    fn frames<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>, Failure> {
        let states = States::read([("q", q)])?;
        let frames = states.map(py, |[q]| self.dynamics.forward_kinematics(q).map(|pose| homogeneous(&pose)));
        let flat = frames.as_flattened().as_flattened().as_flattened();
        shaped(py, flat, states.one, states.count, &[JOINTS + 1, 4, 4])
    }

    /// Computes poses of the flange, as 4×4 matrices.
    fn forward_kinematics<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>, Failure> {
        let states = States::read([("q", q)])?;
        let poses = states.map(py, |[q]| homogeneous(&self.kinematics.flange(q)));
        shaped(py, poses.as_flattened().as_flattened(), states.one, states.count, &[4, 4])
    }

    /// Computes geometric Jacobians of the flange.
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>, Failure> {
        let states = States::read([("q", q)])?;
        let jacobians = states.map(py, |[q]| self.kinematics.jacobian(q));
        shaped(py, jacobians.as_flattened().as_flattened(), states.one, states.count, &[6, JOINTS])
    }

    /// Computes joint positions for poses of the flange. Each result is the solution that is nearest to `near`.
    fn inverse_kinematics<'py>(
        &self,
        py: Python<'py>,
        pose: &Bound<'py, PyAny>,
        near: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Failure> {
        let (poses, one_pose) = poses(pose)?;
        let (near, one_near) = array::rows(near, "near")?;
        let count = common([("pose", poses.len(), one_pose), ("near", near.len(), one_near)])?;
        let solved = py.detach(|| {
            let solve = |k: usize| {
                let (pose, near) = (pick(&poses, k), pick(&near, k));
                self.kinematics.solve(pose, near).map_err(|error| (k, error))
            };
            (0..count).map(solve).collect::<Result<Vec<_>, _>>()
        });
        let one = one_pose && one_near;
        match solved {
            Ok(solved) => Ok(array::as_given(py, &solved, one)),
            Err((_, error)) if one => Err(pose_failure(error)),
            Err((row, error)) => {
                let failure = pose_failure(error);
                let message = format!("row {row}: {}", failure.message);
                Err(failure.message(message))
            }
        }
    }

    /// Computes all joint positions within the limits for one pose of the flange.
    fn all_inverse_kinematics<'py>(
        &self,
        py: Python<'py>,
        pose: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Failure> {
        let (poses, one) = poses(pose)?;
        let [pose] = poses[..] else {
            return Err(Failure::usage(format!("pose: {} poses, expected one", poses.len())));
        };
        if !one {
            return Err(Failure::usage("pose: shape [1, 4, 4], expected (4, 4)"));
        }
        let all = py.detach(|| self.kinematics.all(&pose));
        Ok(array::matrix(py, &all).into_any())
    }

    /// Computes the friction torques that the controller compensates at these velocities.
    fn friction<'py>(
        &self,
        py: Python<'py>,
        qd: &Bound<'py, PyAny>,
        temperature: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Failure> {
        let model = self.arm.friction().ok_or_else(|| {
            let what = format!("the file of the arm {:?} gives no friction", self.arm.name);
            Failure::usage(what)
                .next("add friction_polynomial to the joints of the arm file (`jtc help files`)")
        })?;
        let states = States::read([("qd", qd), ("temperature", temperature)])?;
        let width = self.sign_width;
        let torque = |joint: usize, v: f64, t: f64| match &model {
            Friction::Polynomial(c) => Some(friction::polynomial(&c[joint], v, t, width)),
            Friction::Table(tables) => friction::table(&tables[joint], v, t),
        };
        let found = states.map(py, |[qd, temperature]| {
            std::array::from_fn::<_, JOINTS, _>(|joint| torque(joint, qd[joint], temperature[joint]))
        });
        for (row, found) in found.iter().enumerate() {
            if let Some(joint) = found.iter().position(Option::is_none) {
                let v = pick(&states.columns[0], row)[joint];
                let message =
                    format!("qd: row {row}: {v} rad/s is outside the friction table of joint {}", joint + 1);
                return Err(Failure::usage(message));
            }
        }
        let torques: Vec<JointVec> =
            found.into_iter().map(|row| row.map(|torque| torque.unwrap_or(f64::NAN))).collect();
        Ok(array::as_given(py, &torques, states.one))
    }

    /// Inertia of each rotor, kg·m².
    #[getter]
    fn rotor_inertia<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.rotor)
    }
}

/// Arguments for many states. Each argument has one row for every state, or a single row for all states.
struct States<const K: usize> {
    columns: [Vec<JointVec>; K],
    count: usize,
    /// `true` if every argument was a single row without a second dimension.
    one: bool,
}

impl<const K: usize> States<K> {
    fn read(arguments: [(&'static str, &Bound<'_, PyAny>); K]) -> Result<Self, Failure> {
        let mut columns = [const { Vec::new() }; K];
        let mut shapes = [("", 0, true); K];
        for ((column, shape), (name, value)) in columns.iter_mut().zip(&mut shapes).zip(arguments) {
            let (rows, one) = array::rows(value, name)?;
            *shape = (name, rows.len(), one);
            *column = rows;
        }
        let count = common(shapes)?;
        Ok(Self { columns, count, one: shapes.iter().all(|(_, _, one)| *one) })
    }

    /// Computes a value for each state. Other Python threads can run during the computation.
    fn map<T: Send>(&self, py: Python<'_>, of: impl Fn([&JointVec; K]) -> T + Sync) -> Vec<T> {
        py.detach(|| {
            (0..self.count).map(|k| of(self.columns.each_ref().map(|column| pick(column, k)))).collect()
        })
    }
}

/// Returns row `k`, or the only row if it applies to all states.
fn pick<T>(rows: &[T], k: usize) -> &T {
    if let [row] = rows { row } else { &rows[k] }
}

/// Returns the number of states, which must be the same for all arguments.
fn common<const K: usize>(shapes: [(&'static str, usize, bool); K]) -> Result<usize, Failure> {
    let many = shapes.iter().find(|(_, _, one)| !one);
    let Some(&(first, count, _)) = many else { return Ok(1) };
    match shapes.iter().find(|(_, rows, one)| !one && *rows != count) {
        None => Ok(count),
        Some((other, rows, _)) => Err(Failure::usage(format!(
            "{first} has {count} rows, but {other} has {rows}: pass the same number of rows, or one row of \
             shape (6,) for all states"
        ))),
    }
}

/// Makes an array of `count` values of the shape `inner`. If `one` is set, the array has no dimension for the states.
fn shaped<'py>(
    py: Python<'py>,
    flat: &[f64],
    one: bool,
    count: usize,
    inner: &[usize],
) -> Result<Bound<'py, PyArrayDyn<f64>>, Failure> {
    let shape: Vec<usize> = (!one).then_some(count).into_iter().chain(inner.iter().copied()).collect();
    let array = PyArray1::from_slice(py, flat).reshape(shape);
    array.map_err(|error| Failure::usage(error.to_string()))
}

/// Returns the 4×4 matrix of a pose.
fn homogeneous(pose: &Pose) -> [[f64; 4]; 4] {
    let [x, y, z] = std::array::from_fn(|i| {
        let [a, b, c] = pose.rotation[i];
        [a, b, c, pose.position[i]]
    });
    [x, y, z, [0.0, 0.0, 0.0, 1.0]]
}

/// Reads poses from 4×4 matrices. The returned flag is `true` if the array was a single matrix without a third
/// dimension.
fn poses(value: &Bound<'_, PyAny>) -> Result<(Vec<Pose>, bool), Failure> {
    let array = array::floats(value, "pose")?;
    let shape = array.shape().to_vec();
    let one = shape == [4, 4];
    if !one && (shape.len() != 3 || shape[1..] != [4, 4]) {
        return Err(Failure::usage(format!("pose: shape {shape:?}, expected (4, 4) or (N, 4, 4)"))
            .next("pass homogeneous matrices: rotation, and translation (m) in the last column"));
    }
    let numbers = array.as_slice().map_err(|e| Failure::usage(format!("pose: {e}")))?;
    let (rows, _) = numbers.as_chunks::<4>();
    let (matrices, _) = rows.as_chunks::<4>();
    let pose = |m: &[[f64; 4]; 4]| {
        if m[3] != [0.0, 0.0, 0.0, 1.0] {
            return Err(Failure::usage(format!("pose: last row {:?}, expected 0 0 0 1", m[3])));
        }
        Ok(Pose {
            rotation: std::array::from_fn(|i| [m[i][0], m[i][1], m[i][2]]),
            position: std::array::from_fn(|i| m[i][3]),
        })
    };
    Ok((matrices.iter().map(pose).collect::<Result<_, _>>()?, one))
}

fn pose_failure(error: PoseError) -> Failure {
    PlanError::Plan(error.into()).into()
}

/// Registers the class in the Python module.
pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Dynamics>()
}
