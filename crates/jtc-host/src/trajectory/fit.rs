//! Makes points at a fixed step from samples at any times, with velocities and accelerations where the file has none.
//!
//! Missing velocities and accelerations are those of a cubic spline that starts and ends at rest; missing accelerations alone
//! those of a spline through the velocities, which the rounding of positions does not disturb. Between samples a quintic is
//! followed, so that resampled points agree with the samples in position, velocity and acceleration.

use std::cmp::Ordering;

use jtc_core::{JOINTS, POINTS_MAX};

use super::{Point, Trajectory};

/// Samples as a file has them; times in s, strictly increasing.
#[derive(Clone, Debug, Default)]
pub(crate) struct Samples {
    pub times: Vec<f64>,
    pub position: Vec<[f64; JOINTS]>,
    pub velocity: Option<Vec<[f64; JOINTS]>>,
    pub acceleration: Option<Vec<[f64; JOINTS]>>,
}

/// A sampled trajectory, and what was done to get there.
pub(crate) struct Fitted {
    pub trajectory: Trajectory,
    pub notes: Vec<String>,
}

/// Step that irregular files are resampled to, ms.
const STEP_MS: u16 = 10;
/// Deviation of a regular time column, s.
const REGULAR: f64 = 50e-6;
/// Longest trajectory that is resampled, s: longer ones do not fit into the controller at any useful step.
const DURATION_MAX: f64 = 86_400.0;

/// Why samples make no trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum FitError {
    /// Time does not increase at this sample (from 0).
    Time(usize),
    /// Longer than a day.
    Duration(f64),
}

impl Samples {
    pub fn fit(self) -> Result<Fitted, FitError> {
        let mut notes = Vec::new();
        if let Some(i) =
            self.times.windows(2).position(|w| w[1].partial_cmp(&w[0]) != Some(Ordering::Greater))
        {
            return Err(FitError::Time(i + 1));
        }
        let duration = self.times.last().unwrap_or(&0.0) - self.times.first().unwrap_or(&0.0);
        if !(0.0..=DURATION_MAX).contains(&duration) {
            return Err(FitError::Duration(duration));
        }
        if self.velocity.is_none() {
            notes.push(
                "velocities and accelerations are derived by a spline through the positions".to_owned(),
            );
        } else if self.acceleration.is_none() {
            notes.push("accelerations are derived by a spline through the velocities".to_owned());
        }
        let points = self.points();
        if let Some(step_ms) = self.regular_step() {
            return Ok(Fitted { trajectory: Trajectory { step_ms, points }, notes });
        }
        let step_ms = resampled_step(duration);
        notes.push(format!("times are irregular or no whole milliseconds: resampled to {step_ms} ms"));
        Ok(Fitted { trajectory: Trajectory { step_ms, points: self.resample(&points, step_ms) }, notes })
    }

    /// The step when all times lie on a grid of whole milliseconds.
    fn regular_step(&self) -> Option<u16> {
        let [first, second, ..] = self.times[..] else { return Some(STEP_MS) };
        let step = ((second - first) * 1e3).round();
        if !(1.0..=1000.0).contains(&step) {
            return None;
        }
        let regular = |(i, t): (usize, &f64)| (t - first - i as f64 * step * 1e-3).abs() < REGULAR;
        self.times.iter().enumerate().all(regular).then_some(step as u16)
    }

    /// The samples with velocity and acceleration.
    fn points(&self) -> Vec<Point> {
        let mut points: Vec<Point> =
            self.position.iter().map(|p| Point { position: *p, ..Point::default() }).collect();
        for j in 0..JOINTS {
            let position = column(&self.position, j);
            let slopes = match &self.velocity {
                Some(v) => column(v, j),
                None => spline_slopes(&self.times, &position, true),
            };
            let bends = match (&self.acceleration, &self.velocity) {
                (Some(a), _) => column(a, j),
                (None, Some(_)) => spline_slopes(&self.times, &slopes, false),
                (None, None) => spline_bends(&self.times, &position, &slopes),
            };
            for (i, point) in points.iter_mut().enumerate() {
                point.velocity[j] = slopes[i];
                point.acceleration[j] = bends[i];
            }
        }
        points
    }

    fn resample(&self, points: &[Point], step_ms: u16) -> Vec<Point> {
        let first = self.times[0];
        let duration = self.times[self.times.len() - 1] - first;
        let step = f64::from(step_ms) * 1e-3;
        let count = (duration / step).ceil() as usize + 1;
        let mut out = Vec::with_capacity(count);
        let mut i = 0;
        for k in 0..count {
            let t = first + (k as f64 * step).min(duration);
            while i + 2 < points.len() && self.times[i + 1] <= t {
                i += 1;
            }
            let h = self.times[i + 1] - self.times[i];
            out.push(quintic(&points[i], &points[i + 1], h, (t - self.times[i]) / h));
        }
        out
    }
}

/// 10 ms, more where that would be too many points.
fn resampled_step(duration: f64) -> u16 {
    let fits = (duration * 1e3 / (POINTS_MAX - 1) as f64).ceil();
    fits.clamp(f64::from(STEP_MS), 60_000.0) as u16
}

fn column(rows: &[[f64; JOINTS]], j: usize) -> Vec<f64> {
    rows.iter().map(|r| r[j]).collect()
}

/// First derivatives at the knots of a cubic spline through `y`; at its ends at rest, or else free of bending.
fn spline_slopes(t: &[f64], y: &[f64], rest: bool) -> Vec<f64> {
    let n = y.len();
    if n < 2 {
        return vec![0.0; n];
    }
    let h = |i: usize| t[i + 1] - t[i];
    let delta = |i: usize| (y[i + 1] - y[i]) / h(i);
    // Rows of the tridiagonal system: below, diagonal, above, right side.
    let row = |i: usize| -> [f64; 4] {
        match (i, rest) {
            (i, true) if i == 0 || i == n - 1 => [0.0, 1.0, 0.0, 0.0],
            (0, _) => [0.0, 2.0, 1.0, 3.0 * delta(0)],
            (i, _) if i == n - 1 => [1.0, 2.0, 0.0, 3.0 * delta(n - 2)],
            (i, _) => {
                let (a, b) = (1.0 / h(i - 1), 1.0 / h(i));
                [a, 2.0 * (a + b), b, 3.0 * (a * delta(i - 1) + b * delta(i))]
            }
        }
    };
    // Thomas algorithm; the system is diagonally dominant.
    let (mut above, mut right) = (vec![0.0; n], vec![0.0; n]);
    for i in 0..n {
        let [below, diagonal, up, value] = row(i);
        let (a, r) = if i == 0 { (0.0, 0.0) } else { (above[i - 1], right[i - 1]) };
        let pivot = diagonal - below * a;
        above[i] = up / pivot;
        right[i] = (value - below * r) / pivot;
    }
    for i in (0..n - 1).rev() {
        right[i] -= above[i] * right[i + 1];
    }
    right
}

/// Second derivatives at the knots of the cubic spline with these slopes.
fn spline_bends(t: &[f64], y: &[f64], slopes: &[f64]) -> Vec<f64> {
    let n = y.len();
    if n < 2 {
        return vec![0.0; n];
    }
    (0..n)
        .map(|i| {
            if i < n - 1 {
                let h = t[i + 1] - t[i];
                (6.0 * (y[i + 1] - y[i]) / h - 4.0 * slopes[i] - 2.0 * slopes[i + 1]) / h
            } else {
                let h = t[i] - t[i - 1];
                (-6.0 * (y[i] - y[i - 1]) / h + 2.0 * slopes[i - 1] + 4.0 * slopes[i]) / h
            }
        })
        .collect()
}

/// The quintic through both points at the fraction `u` of `h` seconds, with its derivatives.
pub(crate) fn quintic(a: &Point, b: &Point, h: f64, u: f64) -> Point {
    let mut out = Point::default();
    for j in 0..JOINTS {
        let (v0, v1) = (a.velocity[j] * h, b.velocity[j] * h);
        let (a0, a1) = (a.acceleration[j] * h * h, b.acceleration[j] * h * h);
        let d = b.position[j] - a.position[j];
        let c3 = 10.0 * d - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1;
        let c4 = -15.0 * d + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1;
        let c5 = 6.0 * d - 3.0 * (v0 + v1) + 0.5 * (a1 - a0);
        out.position[j] = a.position[j] + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5))));
        out.velocity[j] = (v0 + u * (a0 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / h;
        out.acceleration[j] = (a0 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))) / (h * h);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A smooth move from rest to rest.
    fn shape(t: f64) -> (f64, f64, f64) {
        let (u, d) = (t / 2.0, 2.0);
        (
            u * u * u * (10.0 - 15.0 * u + 6.0 * u * u),
            30.0 * u * u * (1.0 - u) * (1.0 - u) / d,
            60.0 * u * (1.0 - 3.0 * u + 2.0 * u * u) / (d * d),
        )
    }

    fn samples(times: Vec<f64>, velocity: bool) -> Samples {
        Samples {
            position: times.iter().map(|t| [shape(*t).0; 6]).collect(),
            velocity: velocity.then(|| times.iter().map(|t| [shape(*t).1; 6]).collect()),
            acceleration: None,
            times,
        }
    }

    fn agrees(fitted: &Fitted, position: f64, velocity: f64, acceleration: f64) {
        let step = f64::from(fitted.trajectory.step_ms) * 1e-3;
        for (i, p) in fitted.trajectory.points.iter().enumerate() {
            let (q, v, a) = shape((i as f64 * step).min(2.0));
            assert!((p.position[2] - q).abs() < position, "point {i}: {} for {q}", p.position[2]);
            assert!((p.velocity[2] - v).abs() < velocity, "point {i}: {} for {v}", p.velocity[2]);
            assert!((p.acceleration[2] - a).abs() < acceleration, "point {i}: {} for {a}", p.acceleration[2]);
        }
    }

    #[test]
    fn derived_channels_are_those_of_the_motion() {
        let times: Vec<f64> = (0..=200).map(|i| f64::from(i) * 0.01).collect();
        let fitted = samples(times.clone(), false).fit().unwrap();
        assert_eq!((fitted.trajectory.step_ms, fitted.trajectory.points.len()), (10, 201));
        agrees(&fitted, 1e-12, 1e-5, 0.08);
        agrees(&samples(times, true).fit().unwrap(), 1e-12, 1e-12, 0.08);
    }

    #[test]
    fn irregular_times_are_resampled() {
        let times: Vec<f64> = (0..=97).map(|i| 2.0 * (f64::from(i) / 97.0).powf(1.1)).collect();
        let fitted = samples(times, true).fit().unwrap();
        assert_eq!((fitted.trajectory.step_ms, fitted.trajectory.points.len()), (10, 201));
        agrees(&fitted, 1e-4, 5e-3, 0.4);
        assert_eq!(fitted.notes.len(), 2);
    }

    #[test]
    fn long_irregular_files_get_a_longer_step() {
        assert_eq!(resampled_step(10.0), 10);
        assert_eq!(resampled_step(1200.0), 101);
    }

    #[test]
    fn time_must_increase() {
        let Err(e) = samples(vec![0.0, 0.01, 0.01], false).fit() else { panic!("accepted") };
        assert_eq!(e, FitError::Time(2));
    }
}
