//! Curves through points. A cubic spline is used for a file with only positions. A quintic connects two points of a trajectory.

use jtc_core::JOINTS;

use super::Point;

pub(super) fn column(rows: &[[f64; JOINTS]], j: usize) -> Vec<f64> {
    rows.iter().map(|r| r[j]).collect()
}

/// Returns the first derivatives of a cubic spline through `y` at its knots. If `rest` is set, the slope at both ends is 0. If `rest` is
/// not set, the curvature at both ends is 0.
pub(super) fn spline_slopes(t: &[f64], y: &[f64], rest: bool) -> Vec<f64> {
    let n = y.len();
    if n < 2 {
        return vec![0.0; n];
    }
    let h = |i: usize| t[i + 1] - t[i];
    let delta = |i: usize| (y[i + 1] - y[i]) / h(i);
    // Elements of each row of the tridiagonal system: below the diagonal, on the diagonal, above the diagonal, and
    // right-hand side.
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
    // The Thomas algorithm is stable here, because the system is diagonally dominant.
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

/// Returns the second derivatives of the cubic spline with these slopes at its knots.
pub(super) fn spline_bends(t: &[f64], y: &[f64], slopes: &[f64]) -> Vec<f64> {
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

/// Returns the quintic through both points, with its derivatives, at the fraction `u` of its duration `h` (s).
pub(super) fn quintic(a: &Point, b: &Point, h: f64, u: f64) -> Point {
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
