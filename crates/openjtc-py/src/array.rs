//! Converts numpy arrays to arrays of joint values, and back. An array has one row per state and one column per joint, base to wrist.

use jtc_core::JOINTS;
use jtc_host::error::Facts;
use jtc_wire::Joint;
use numpy::{
    PyArray1, PyArray2, PyArrayDyn, PyArrayMethods as _, PyReadonlyArrayDyn, PyUntypedArrayMethods as _,
};
use pyo3::prelude::*;

use crate::error::Failure;

/// Reads a numpy array, or a list or tuple, as floats.
pub(crate) fn floats<'py>(
    value: &Bound<'py, PyAny>,
    what: &str,
) -> Result<PyReadonlyArrayDyn<'py, f64>, Failure> {
    let made = || -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let numpy = value.py().import("numpy")?;
        let array = numpy.call_method1("ascontiguousarray", (value, "float64"))?;
        // `ascontiguousarray` would give a scalar a dimension, but no argument of this function is a scalar.
        Ok(array.cast_into::<PyArrayDyn<f64>>()?)
    };
    made().map(|array| array.readonly()).map_err(|error| {
        Failure::usage(format!("{what}: not an array of numbers: {error}"))
            .next("pass six numbers, or rows of six")
    })
}

/// Reads six finite numbers, base to wrist. Errors contain `what` as the name of the numbers.
pub(crate) fn joints(value: &Bound<'_, PyAny>, what: &str) -> Result<[f64; JOINTS], Failure> {
    let array = floats(value, what)?;
    let numbers = array.as_slice().ok().and_then(|all| <[f64; JOINTS]>::try_from(all).ok());
    let numbers = numbers.filter(|_| array.ndim() == 1).ok_or_else(|| {
        Failure::usage(format!("{what}: shape {:?}, expected (6,)", array.shape()))
            .next("pass one number per joint, base to wrist")
    })?;
    finite(&[numbers], what)?;
    Ok(numbers)
}

/// Reads rows of six finite numbers. The returned flag is `true` if the array was a single row without a second
/// dimension.
pub(crate) fn rows(value: &Bound<'_, PyAny>, what: &str) -> Result<(Vec<[f64; JOINTS]>, bool), Failure> {
    let array = floats(value, what)?;
    let shape = array.shape().to_vec();
    let one = shape == [JOINTS];
    if !one && (shape.len() != 2 || shape[1] != JOINTS) {
        return Err(Failure::usage(format!("{what}: shape {shape:?}, expected (6,) or (N, 6)"))
            .next("pass one number per joint, base to wrist, in each row"));
    }
    let numbers = array.as_slice().map_err(|e| Failure::usage(format!("{what}: {e}")))?;
    let rows: Vec<[f64; JOINTS]> = numbers.as_chunks::<JOINTS>().0.to_vec();
    finite(&rows, what)?;
    Ok((rows, one))
}

fn finite(rows: &[[f64; JOINTS]], what: &str) -> Result<(), Failure> {
    for (number, row) in rows.iter().enumerate() {
        if let Some(joint) = row.iter().position(|value| !value.is_finite()) {
            let place = if rows.len() > 1 { format!("row {number}, ") } else { String::new() };
            let failure =
                Failure::usage(format!("{what}: {place}joint {} is not finite: {}", joint + 1, row[joint]));
            let facts = Facts {
                joint: Joint::from_index(joint).map(Joint::number),
                value: Some(row[joint]),
                ..Facts::default()
            };
            return Err(failure.with(facts));
        }
    }
    Ok(())
}

/// Makes an (N, 6) array.
pub(crate) fn matrix<'py>(py: Python<'py>, rows: &[[f64; JOINTS]]) -> Bound<'py, PyArray2<f64>> {
    wide(py, rows)
}

/// Makes an (N, M) array.
pub(crate) fn wide<'py, const M: usize>(py: Python<'py>, rows: &[[f64; M]]) -> Bound<'py, PyArray2<f64>> {
    let flat = PyArray1::from_slice(py, rows.as_flattened());
    flat.reshape([rows.len(), M]).unwrap_or_else(|_| PyArray2::zeros(py, [rows.len(), M], false))
}

/// Makes a (6,) array if the input was a single row, else an (N, 6) array.
pub(crate) fn as_given<'py>(py: Python<'py>, rows: &[[f64; JOINTS]], one: bool) -> Bound<'py, PyAny> {
    match rows {
        [row] if one => PyArray1::from_slice(py, row).into_any(),
        rows => matrix(py, rows).into_any(),
    }
}
