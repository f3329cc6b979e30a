//! Solves inverse kinematics for flange poses and straight flange paths, for comparison with other implementations.
//!
//! Each input line is a list of words. The example answers each line except `model` with one line:
//!
//! - `model`: 7 joint origins (xyz in m, rpy in rad), then lowest and highest position of the 6 joints (rad).
//! - `pose`: position (m), quaternion x y z w, joint positions near which the solution should be. Answer: `solved`,
//!   the nearest solution, and all solutions within the limits; or `refused` and the reason.
//! - `line`: joint positions at the start, position and quaternion at the end, number of samples. Answer: `path`, and
//!   for each sample, at equal distances from start to end, its parameter, joint positions, first and second
//!   derivatives; or `refused` and the reason.
use std::io::{BufRead, Write};

use jtc_dynamics::{ArmModel, Origin, Pose};
use jtc_plan::kinematics::{FlangePath, Kinematics, Leg, Orientation, PoseError};
use jtc_plan::{JointVec, Path};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let mut kinematics = None;
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let (kind, numbers) = line.split_once(' ').ok_or("a line without numbers")?;
        let numbers = numbers.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        if kind == "model" {
            kinematics = Some(model(&numbers).ok_or("a model of another length")?);
            continue;
        }
        let arm = kinematics.as_ref().ok_or("a line before the first model")?;
        let answer = match kind {
            "pose" => solved(arm, &numbers),
            "line" => path(arm, &numbers),
            _ => return Err(format!("'{kind}' is neither model, pose nor line").into()),
        };
        match answer.ok_or("a line of another length")? {
            Ok((word, values)) => {
                let words: Vec<String> = values.iter().map(|v| format!("{v:.17e}")).collect();
                writeln!(out, "{word} {}", words.join(" "))?;
            }
            Err(error) => writeln!(out, "refused {error}")?,
        }
    }
    Ok(())
}

type Answer = Option<Result<(&'static str, Vec<f64>), PoseError>>;

fn model(numbers: &[f64]) -> Option<Kinematics> {
    let (origins, limits) = (numbers.get(..42)?, numbers.get(42..54)?);
    let mut model = ArmModel::default();
    for (joint, v) in model.joints.iter_mut().zip(origins.chunks_exact(6)) {
        *joint = Origin { xyz: [v[0], v[1], v[2]], rpy: [v[3], v[4], v[5]] };
    }
    let limits = std::array::from_fn(|j| (limits[2 * j], limits[2 * j + 1]));
    Some(Kinematics::new(&model, &limits))
}

fn pose(numbers: &[f64]) -> Option<Result<Pose, PoseError>> {
    let orientation = Orientation::Quaternion(numbers.get(3..7)?.try_into().ok()?);
    Some(orientation.at(numbers[..3].try_into().ok()?))
}

fn solved(arm: &Kinematics, numbers: &[f64]) -> Answer {
    let near: JointVec = numbers.get(7..13)?.try_into().ok()?;
    Some(pose(numbers)?.and_then(|target| {
        let mut values = arm.solve(&target, &near)?.to_vec();
        values.extend(arm.all(&target).iter().flatten());
        Ok(("solved", values))
    }))
}

fn path(arm: &Kinematics, numbers: &[f64]) -> Answer {
    let start: JointVec = numbers.get(..6)?.try_into().ok()?;
    let samples = *numbers.get(13)? as usize;
    Some(pose(numbers.get(6..13)?)?.and_then(|to| {
        let path = FlangePath::new(arm, &start, &[Leg::Line { to }], 0.0)?;
        let mut values = Vec::new();
        for k in 0..=samples {
            let s = path.end() * k as f64 / samples.max(1) as f64;
            let here = path.at(s);
            values.push(s);
            values.extend([here.position, here.first, here.second].as_flattened());
        }
        Ok(("path", values))
    }))
}
