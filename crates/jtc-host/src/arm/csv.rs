//! Tables of numbers in the file formats of existing programs: friction tables, friction polynomials, gains, arm model.

use jtc_core::{JOINTS, PidGains, TableOf};
use jtc_dynamics::{ArmModel, Link, Origin};
use jtc_wire::Joint;

use crate::file::{FileError, Place, number, number_rows, rows};

/// Parameter that a table of numbers contains.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Table {
    /// Friction table of one joint.
    Friction(Box<TableOf<f32>>),
    /// Friction tables of all joints.
    FrictionAll(Box<[TableOf<f32>; JOINTS]>),
    /// Friction polynomials of all joints, c0 to c5.
    Polynomial([[f64; 6]; JOINTS]),
    /// Gains of one joint.
    Pid(PidGains),
    /// Gains of all joints.
    PidAll([PidGains; JOINTS]),
    /// Kinematics and masses of the arm.
    Model(Box<ArmModel>),
}

/// Parses a table of numbers. The number of rows and columns, or a header with `vel_index`, determines the parameter.
pub(super) fn read(text: &str) -> Result<Table, FileError> {
    let first = rows(text).next();
    if first.as_ref().is_some_and(|(_, cells)| cells.contains(&"vel_index")) {
        return long_table(text);
    }
    let all = number_rows(text)?;
    let width = |row: &(usize, Vec<f64>)| row.1.len();
    let (n, w) = (all.len(), all.first().map_or(0, width));
    let same =
        |rows: &[(usize, Vec<f64>)], w: usize| rows.iter().find(|r| r.1.len() != w).map(|r| (r.0, r.1.len()));
    let uneven = |found: Option<(usize, usize)>, want: usize| match found {
        Some((line, n)) => Err(FileError::at(Place::line(line), format!("{n} columns, expected {want}"))),
        None => Ok(()),
    };
    match (n, w) {
        (22, _) | (_, 20) => {
            uneven(same(&all, 20), 20)?;
            joint_table(&all).map(|t| Table::Friction(Box::new(t)))
        }
        (6, 4 | 6) => {
            uneven(same(&all, w), w)?;
            polynomial(&all)
        }
        (1, 5) => Ok(Table::Pid(gains(&all[0])?)),
        (6, 5) => {
            uneven(same(&all, 5), 5)?;
            let gains = all.iter().map(gains).collect::<Result<Vec<_>, _>>()?;
            Ok(Table::PidAll(std::array::from_fn(|i| gains[i])))
        }
        (14, 6) => {
            uneven(same(&all[..7], 6), 6)?;
            uneven(same(&all[7..], 13), 13)?;
            Ok(Table::Model(Box::new(model(&all))))
        }
        _ => Err(FileError::form(format!(
            "unknown table of {n} rows with {w} numbers, expected friction of a joint 22 x 20, friction polynomial 6 x 4 or 6 x 6, gains of a joint \
             1 x 5 or of all 6 x 5, arm model 7 x 6 and 7 x 13"
        ))),
    }
}

fn joint_table(all: &[(usize, Vec<f64>)]) -> Result<TableOf<f32>, FileError> {
    if all.len() != 22 {
        let problem =
            format!("{} rows, expected 22 (velocities, temperatures, 20 rows of torques)", all.len());
        return Err(FileError::form(problem));
    }
    let row = |i: usize| -> [f32; 20] { std::array::from_fn(|c| all[i].1[c] as f32) };
    for (i, name) in [(0, "velocities"), (1, "temperatures")] {
        increasing(&row(i), all[i].0, name)?;
    }
    let table =
        TableOf { velocity: row(0), temperature: row(1), torque: std::array::from_fn(|i| row(2 + i)) };
    Ok(table)
}

fn increasing(axis: &[f32; 20], line: usize, name: &str) -> Result<(), FileError> {
    match axis.windows(2).position(|w| w[1] <= w[0] || w[1].is_nan() || w[0].is_nan()) {
        None => Ok(()),
        Some(i) => {
            let problem = format!("{} is not greater than {}: the axis must increase", axis[i + 1], axis[i]);
            Err(FileError::at(Place::cell(line, i + 2).named(name), problem))
        }
    }
}

/// Reads the long form of a friction table: `joint,vel_index,vel,temp_index,temp,torque`, 2400 rows.
fn long_table(text: &str) -> Result<Table, FileError> {
    let empty =
        TableOf { velocity: [f32::NAN; 20], temperature: [f32::NAN; 20], torque: [[f32::NAN; 20]; 20] };
    let mut tables = Box::new([empty; JOINTS]);
    for (line, cells) in rows(text).skip(1) {
        if cells.len() != 6 {
            return Err(FileError::at(Place::line(line), format!("{} columns, expected 6", cells.len())));
        }
        let value = |c: usize| number(cells[c], || Place::cell(line, c + 1)).map(|v| v as f32);
        let index = |c: usize, most: usize| match cells[c].parse::<usize>() {
            Ok(v) if v < most => Ok(v),
            _ => {
                let problem =
                    format!("\"{}\" is out of range, expected 0..{}", crate::file::short(cells[c]), most - 1);
                Err(FileError::at(Place::cell(line, c + 1), problem))
            }
        };
        let table = &mut tables[index(0, JOINTS)?];
        let (v, t) = (index(1, 20)?, index(3, 20)?);
        table.velocity[v] = value(2)?;
        table.temperature[t] = value(4)?;
        table.torque[v][t] = value(5)?;
    }
    for (joint, t) in Joint::ALL.into_iter().zip(tables.iter()) {
        if t.torque.iter().flatten().any(|v| v.is_nan()) {
            return Err(FileError::form(format!("the table of {joint} is not complete, expected 400 rows")));
        }
        increasing(&t.velocity, 0, "velocities")?;
        increasing(&t.temperature, 0, "temperatures")?;
    }
    Ok(Table::FrictionAll(tables))
}

/// Returns `true` if the friction coefficients are plausible. Plausible Coulomb and viscous coefficients are positive, the temperature
/// coefficient is small, and the reference temperature is between −20 and 100 °C.
fn plausible(c: &[f64]) -> bool {
    let viscous = c[0] > 0.0 && c[1] > 0.0;
    match c {
        [_, _, _, _, c4, c5] => viscous && c4.abs() < 0.2 && (-20.0..=100.0).contains(c5),
        _ => viscous,
    }
}

fn polynomial(all: &[(usize, Vec<f64>)]) -> Result<Table, FileError> {
    let reversed = |c: &Vec<f64>| c.iter().rev().copied().collect::<Vec<f64>>();
    let wrong: Vec<usize> = (0..all.len()).filter(|i| !plausible(&all[*i].1)).collect();
    let turned = wrong.iter().filter(|i| plausible(&reversed(&all[**i].1))).count();
    // Most rows are plausible only if their numbers are read from right to left. Then the columns of the file are in
    // the wrong order.
    if turned * 2 > all.len() {
        let (line, row) = (all[wrong[0]].0, &all[wrong[0]].1);
        let problem = format!(
            "the coefficients are in descending order ({} first), expected c0 (Coulomb), c1, c2, c3{} from left to right",
            row[0],
            if row.len() == 6 { ", c4 (1/K), c5 (°C)" } else { "" }
        );
        return Err(FileError::at(Place::line(line), problem));
    }
    Ok(Table::Polynomial(std::array::from_fn(|j| {
        std::array::from_fn(|k| all[j].1.get(k).copied().unwrap_or(0.0))
    })))
}

fn gains((line, row): &(usize, Vec<f64>)) -> Result<PidGains, FileError> {
    let [kp, ki, kd, int_min, int_max] = row[..] else {
        return Err(FileError::at(Place::line(*line), format!("{} columns, expected 5", row.len())));
    };
    if int_min > int_max {
        let problem = format!("lower bound {int_min} of the integral is above its upper bound {int_max}");
        return Err(FileError::at(Place::cell(*line, 4), problem));
    }
    Ok(PidGains { kp, ki, kd, int_min, int_max })
}

fn model(all: &[(usize, Vec<f64>)]) -> ArmModel {
    let origin = |r: &[f64]| Origin { xyz: [r[0], r[1], r[2]], rpy: [r[3], r[4], r[5]] };
    ArmModel {
        joints: std::array::from_fn(|i| origin(&all[i].1)),
        links: std::array::from_fn(|i| {
            let r = &all[7 + i].1;
            Link { origin: origin(r), inertia: std::array::from_fn(|k| r[6 + k]), mass: r[12] }
        }),
    }
}
