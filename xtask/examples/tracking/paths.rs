//! Paths along which the program compares both controllers.
use jtc_host::example;
use jtc_wire::RawPoint;

use crate::run::{Path, Result};

/// Indices (from 0) of the recorded points after which the recording lacks one point.
const MISSING_AFTER: [usize; 5] = [184, 358, 544, 726, 906];
/// Name of the recorded path on the page.
pub(crate) const RECORDED: &str = "recorded path";
/// Time between the points of the recorded path, ms.
const STEP_MS: u16 = 10;

/// Returns the path of `jtc demo`. The function also returns the path that was recorded with the existing arm, if the
/// data of the recording are available.
pub(crate) fn all() -> Result<Vec<Path>> {
    let demo = example::demo_motion();
    let mut paths = vec![Path { name: "demo path", points: demo.raw()?, step_ms: demo.step_ms }];
    if let Some(points) = recorded() {
        paths.push(Path { name: RECORDED, points, step_ms: STEP_MS });
    }
    Ok(paths)
}

/// Returns the points of `TrajectoryInt.csv`. The function interpolates points that are missing in the recording.
fn recorded() -> Option<Vec<RawPoint>> {
    let raw =
        |[position, velocity, acceleration]: [[i16; 6]; 3]| RawPoint { position, velocity, acceleration };
    let given: Vec<RawPoint> =
        test_kit::existing::points("TrajectoryInt.csv")?.into_iter().map(raw).collect();
    let mut points = Vec::with_capacity(given.len() + MISSING_AFTER.len());
    for (n, point) in given.iter().enumerate() {
        points.push(*point);
        if let (true, Some(next)) = (MISSING_AFTER.contains(&n), given.get(n + 1)) {
            points.push(between(point, next));
        }
    }
    Some(points)
}

/// Returns the point halfway between two points that are 20 ms apart. The function interpolates the position with a
/// cubic polynomial.
fn between(a: &RawPoint, b: &RawPoint) -> RawPoint {
    let mean = |a: &[i16; 6], b: &[i16; 6]| {
        core::array::from_fn(|j| ((i32::from(a[j]) + i32::from(b[j])) / 2) as i16)
    };
    let (p, v) = ([a.position_rad(), b.position_rad()], [a.velocity_rad_s(), b.velocity_rad_s()]);
    let unit = jtc_wire::POSITION_SCALE / f64::from(i16::MAX);
    RawPoint {
        position: core::array::from_fn(|j| {
            let middle = 0.5 * (p[0][j] + p[1][j]) + 0.02 / 8.0 * (v[0][j] - v[1][j]);
            (middle / unit).round() as i16
        }),
        velocity: mean(&a.velocity, &b.velocity),
        acceleration: mean(&a.acceleration, &b.acceleration),
    }
}
