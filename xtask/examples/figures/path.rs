//! Trajectories for the measurements of performance figures.
use jtc_host::Point;
use jtc_wire::RawPoint;

/// Time between trajectory points, ms.
pub(crate) const STEP_MS: u16 = 10;

/// Returns a smooth motion of all joints with `points` points. The motion consists of whole periods of about 10 s,
/// and begins and ends at rest at position zero.
pub(crate) fn smooth(points: usize) -> Vec<Point> {
    const AMPLITUDE: [f64; 6] = [0.8, -0.5, 0.9, 0.7, -0.8, 1.0];
    let seconds = points.saturating_sub(1) as f64 * f64::from(STEP_MS) * 1e-3;
    let omega = std::f64::consts::TAU * (seconds / 10.0).round().max(1.0) / seconds;
    (0..points)
        .map(|i| {
            // The velocity and the acceleration of (1 − cos ωt)²/4 are zero at the start and the end of each period.
            let t = i as f64 * f64::from(STEP_MS) * 1e-3;
            let (s, c) = (omega * t).sin_cos();
            let u = 1.0 - c;
            let position = u * u / 4.0;
            let velocity = omega * u * s / 2.0;
            let acceleration = omega * omega * (s * s + u * c) / 2.0;
            Point {
                position: AMPLITUDE.map(|a| a * position),
                velocity: AMPLITUDE.map(|a| a * velocity),
                acceleration: AMPLITUDE.map(|a| a * acceleration),
            }
        })
        .collect()
}

/// Returns the points of a trajectory in the format of the JTC protocol.
pub(crate) fn raw(points: &[Point]) -> Result<Vec<RawPoint>, Box<dyn std::error::Error>> {
    Ok(points.iter().enumerate().map(|(i, point)| point.raw(i)).collect::<Result<_, _>>()?)
}
