//! `jtc dynamics`: runs the dynamics code of the controller on numbers from stdin and prints the results.

use std::io::{BufRead, Write};

use cli_kit::{Failure, Output};
use jtc_dynamics::{Dynamics, JOINTS, JointVec};
use serde_json::json;

use super::named_arm;
use crate::args::{DynamicsArgs, DynamicsKind};

/// Computes a result for each line of numbers until the end of stdin.
pub(super) fn dynamics(args: &DynamicsArgs, out: &Output) -> Result<(), Failure> {
    let arm = named_arm::load(args.arm.as_deref())?;
    named_arm::note_warnings(&arm, out);
    if args.rotors && arm.rotors_given.contains(&false) {
        out.note("note: the arm file does not give every rotor inertia: the missing ones count as 0");
    }
    let gravity = args.gravity.unwrap_or_else(|| arm.config().gravity);
    let dynamics = Dynamics::new(&arm.model, gravity);
    let rotor: JointVec =
        std::array::from_fn(|j| if args.rotors { arm.joints[j].rotor_inertia } else { 0.0 });
    let mut stdout = std::io::BufWriter::new(std::io::stdout().lock());
    for (number, line) in std::io::stdin().lock().lines().enumerate() {
        let line = line?;
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let values =
            numbers(&line, args.what).map_err(|e| Failure::usage(format!("line {}: {e}", number + 1)))?;
        let result = compute(args.what, &dynamics, &rotor, &values);
        let written = if out.is_json() {
            writeln!(stdout, "{}", json!({ key(args.what): result }))
        } else {
            // Seventeen significant digits (one before the decimal point, 16 after it) reproduce exactly the same f64.
            let words: Vec<String> = result.iter().map(|v| format!("{v:.16e}")).collect();
            writeln!(stdout, "{}", words.join(" "))
        };
        if let Err(e) = written {
            Output::lose(&e);
            return Ok(());
        }
    }
    if let Err(e) = stdout.flush() {
        Output::lose(&e);
    }
    Ok(())
}

fn key(what: DynamicsKind) -> &'static str {
    match what {
        DynamicsKind::Inverse => "torque_nm",
        DynamicsKind::Forward => "acceleration_rad_s2",
        DynamicsKind::Mass => "mass_matrix_kg_m2",
    }
}

fn numbers(line: &str, what: DynamicsKind) -> Result<Vec<f64>, String> {
    let need = if what == DynamicsKind::Mass { JOINTS } else { 3 * JOINTS };
    let words = line.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty());
    let values = words
        .map(|w| {
            w.parse::<f64>()
                .ok()
                .filter(|v| v.is_finite())
                .ok_or_else(|| format!("\"{w}\" is not a finite number"))
        })
        .collect::<Result<Vec<f64>, String>>()?;
    // A mass matrix needs only positions, but the command also accepts lines in the format of the other calculations.
    if values.len() == need || (what == DynamicsKind::Mass && values.len() == 3 * JOINTS) {
        Ok(values)
    } else {
        Err(format!("{} numbers in the line, expected {need}", values.len()))
    }
}

fn compute(what: DynamicsKind, dynamics: &Dynamics, rotor: &JointVec, values: &[f64]) -> Vec<f64> {
    let part = |k: usize| -> JointVec {
        std::array::from_fn(|j| values.get(k * JOINTS + j).copied().unwrap_or(0.0))
    };
    let (q, qd, last) = (part(0), part(1), part(2));
    match what {
        DynamicsKind::Inverse => {
            let torque = dynamics.inverse(&q, &qd, &last);
            (0..JOINTS).map(|j| torque[j] + rotor[j] * last[j]).collect()
        }
        DynamicsKind::Forward => dynamics.forward(&q, &qd, &last, rotor).to_vec(),
        DynamicsKind::Mass => {
            let mut matrix = dynamics.mass_matrix(&q);
            for j in 0..JOINTS {
                matrix[j][j] += rotor[j];
            }
            matrix.concat()
        }
    }
}
