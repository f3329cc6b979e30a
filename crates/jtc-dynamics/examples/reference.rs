//! Answers a line of numbers with a line of results, for comparison with other implementations.
//!
//! Standard input, numbers separated by blanks:
//! * `model` and 136 numbers: 7 joint origins (xyz rpy), 7 links (origin, ixx ixy ixz iyy iyz izz, mass), gravity;
//! * `state` and 30 numbers: q, qd, qdd, torque, rotor inertia (6 each). Answered by one line: inverse
//!   dynamics, gravity torque (6 each), mass matrix (36, by rows), acceleration under the torque with and without
//!   rotors (6 each), and the poses of 7 frames (position, rotation by rows).
use std::io::{BufRead, Write};

use jtc_dynamics::{ArmModel, Dynamics, JointVec, Link, Origin};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let mut dynamics = None;
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let mut words = line.split_whitespace();
        let kind = words.next().unwrap_or_default();
        let numbers = words.map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        match kind {
            "model" => {
                let (model, gravity) = model(&numbers).ok_or("model: not 136 numbers")?;
                model.check()?;
                dynamics = Some(Dynamics::new(&model, gravity));
            }
            "state" => {
                let vectors = numbers.as_chunks::<6>().0;
                let &[q, qd, qdd, tau, rotor] = vectors else { return Err("state: not 30 numbers".into()) };
                let d = dynamics.as_ref().ok_or("state: there is no model yet")?;
                let results = answer(d, &q, &qd, &qdd, &tau, &rotor);
                let words: Vec<String> = results.iter().map(|v| format!("{v:.17e}")).collect();
                writeln!(out, "{}", words.join(" "))?;
            }
            _ => return Err(format!("'{kind}' is neither model nor state").into()),
        }
    }
    Ok(())
}

fn answer(
    d: &Dynamics,
    q: &JointVec,
    qd: &JointVec,
    qdd: &JointVec,
    tau: &JointVec,
    rotor: &JointVec,
) -> Vec<f64> {
    let mut all = Vec::new();
    all.extend(d.inverse(q, qd, qdd));
    all.extend(d.gravity_torque(q));
    all.extend(d.mass_matrix(q).as_flattened());
    all.extend(d.forward(q, qd, tau, rotor));
    all.extend(d.forward(q, qd, tau, &[0.0; 6]));
    for pose in d.forward_kinematics(q) {
        all.extend(pose.position);
        all.extend(pose.rotation.as_flattened());
    }
    all
}

fn model(numbers: &[f64]) -> Option<(ArmModel, [f64; 3])> {
    let mut rest = numbers.iter().copied();
    let mut model = ArmModel::default();
    for joint in &mut model.joints {
        *joint = origin(&mut rest)?;
    }
    for link in &mut model.links {
        *link = Link { origin: origin(&mut rest)?, inertia: take(&mut rest)?, mass: rest.next()? };
    }
    let gravity = take(&mut rest)?;
    rest.next().is_none().then_some((model, gravity))
}

fn origin(numbers: &mut impl Iterator<Item = f64>) -> Option<Origin> {
    Some(Origin { xyz: take(numbers)?, rpy: take(numbers)? })
}

fn take<const N: usize>(numbers: &mut impl Iterator<Item = f64>) -> Option<[f64; N]> {
    let mut out = [0.0; N];
    for v in &mut out {
        *v = numbers.next()?;
    }
    Some(out)
}
