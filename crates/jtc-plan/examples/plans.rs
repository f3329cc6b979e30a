//! Plans the motions that the lines of standard input describe, for comparison with other implementations.
//!
//! Each input line is a list of words. Numbers are written with all digits. The arm is the default arm without friction
//! and payload:
//!
//! - `limits`, then velocity, acceleration, jerk (`inf`: no limit) and torque of six joints: sets the limits for the
//!   next lines.
//! - `move`, then start and end positions of six joints: prints the duration in s.
//! - `path`, then the blend (rad), 1 with torque or 0 without, the number of points, and waypoints of six joints:
//!   prints a line with duration (s), planning time (s) and the number of points. A line for each point follows, with
//!   the path parameter, then position, first and second derivative of six joints.
use std::error::Error;
use std::io::{BufRead, Write};
use std::time::Instant;

use jtc_core::{Config, Parameters};
use jtc_plan::{ArmDynamics, BlendedPath, JointVec, Limits, Path, along, point_to_point};

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = std::io::BufWriter::new(std::io::stdout().lock());
    let config = Config::avena();
    let arm = ArmDynamics::new(&config, &Parameters::avena().model, None);
    let mut limits = Limits::of(&config);
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let (kind, rest) = line.split_once(' ').unwrap_or((&line, ""));
        let numbers = rest.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()?;
        match kind {
            "limits" => {
                let joints = vectors(&numbers, 4)?;
                (limits.velocity, limits.acceleration) = (joints[0], joints[1]);
                (limits.jerk, limits.torque) = (joints[2], joints[3]);
            }
            "move" => {
                let joints = vectors(&numbers, 2)?;
                let motion = point_to_point(&joints[0], &joints[1], &limits, None)?;
                writeln!(out, "{:.17e}", motion.duration())?;
            }
            "path" => path(&numbers, &limits, &arm, &mut out)?,
            _ => return Err(format!("no such line: {kind}").into()),
        }
    }
    Ok(())
}

fn vectors(numbers: &[f64], least: usize) -> Result<Vec<JointVec>, Box<dyn Error>> {
    let vectors: Vec<JointVec> = numbers.chunks_exact(6).filter_map(|six| six.try_into().ok()).collect();
    if vectors.len() < least || vectors.len() * 6 != numbers.len() {
        return Err(format!("{} numbers are not {least} times six joints", numbers.len()).into());
    }
    Ok(vectors)
}

fn path(
    numbers: &[f64],
    limits: &Limits,
    arm: &ArmDynamics,
    out: &mut impl Write,
) -> Result<(), Box<dyn Error>> {
    let [blend, with_torque, places, waypoints @ ..] = numbers else {
        return Err("a path has a blend, a flag, a number of places and waypoints".into());
    };
    let path = BlendedPath::new(&vectors(waypoints, 2)?, *blend)?;
    let start = Instant::now();
    let motion = along(&path, limits, (*with_torque == 1.0).then_some(arm))?;
    let taken = start.elapsed().as_secs_f64();
    // Points of the path: the requested number of points, and the points at which the path changes its form.
    let mut parameters: Vec<f64> = (0..=*places as usize).map(|i| path.end() * i as f64 / places).collect();
    parameters.extend(path.breaks());
    parameters.sort_by(f64::total_cmp);
    parameters.dedup_by(|b, a| *b - *a < 1e-6 * path.end());
    writeln!(out, "{:.17e} {taken:.6e} {}", motion.duration(), parameters.len())?;
    for s in parameters {
        let point = path.at(s);
        let numbers = [s].into_iter().chain(point.position).chain(point.first).chain(point.second);
        let words: Vec<String> = numbers.map(|x| format!("{x:.17e}")).collect();
        writeln!(out, "{}", words.join(" "))?;
    }
    Ok(())
}
