//! Arms and states in a text format with one record per line. A `model` line has 136 numbers (7 joint origins xyz rpy; 7 links: origin, ixx
//! ixy ixz iyy iyz izz, mass; gravity). If the arm has a payload, ten more numbers follow (mass, centre of mass, ixx ixy ixz iyy iyz izz in
//! the flange frame). A `state` line has 30 numbers (q, qd, qdd, torque and rotor inertia of six joints).
use jtc_dynamics::{ArmModel, JointVec, Link, Origin, Payload};

pub(crate) enum Line {
    Model(Box<ArmModel>, [f64; 3], Payload),
    State(Box<[JointVec; 5]>),
}

pub(crate) fn parse(line: &str) -> Result<Line, Box<dyn std::error::Error>> {
    let mut words = line.split_whitespace();
    let kind = words.next().unwrap_or_default();
    let numbers = words.map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    let mut rest = numbers.iter().copied();
    let line = match kind {
        "model" => model(&mut rest),
        "state" => state(&mut rest),
        _ => return Err(format!("'{kind}' is neither model nor state").into()),
    };
    match (line, rest.next()) {
        (Some(line), None) => Ok(line),
        _ => Err(format!("{kind}: {} numbers are too many or too few", numbers.len()).into()),
    }
}

fn model(numbers: &mut impl Iterator<Item = f64>) -> Option<Line> {
    let mut model = ArmModel::default();
    for joint in &mut model.joints {
        *joint = origin(numbers)?;
    }
    for link in &mut model.links {
        *link = Link { origin: origin(numbers)?, inertia: take(numbers)?, mass: numbers.next()? };
    }
    let gravity = take(numbers)?;
    let payload = match numbers.next() {
        Some(mass) => Payload { mass, com: take(numbers)?, inertia: take(numbers)? },
        None => Payload::default(),
    };
    Some(Line::Model(Box::new(model), gravity, payload))
}

fn state(numbers: &mut impl Iterator<Item = f64>) -> Option<Line> {
    let mut vectors = Box::new([[0.0; 6]; 5]);
    for v in vectors.iter_mut() {
        *v = take(numbers)?;
    }
    Some(Line::State(vectors))
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
