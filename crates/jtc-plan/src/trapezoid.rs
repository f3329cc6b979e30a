//! Motions without a jerk limit. Their speed profiles are trapezoidal.
use crate::motion::{Motion, Piece};
use crate::{JOINTS, JointVec, Limits};

/// A trapezoidal speed profile from rest to rest.
#[derive(Clone, Copy, Debug)]
struct Trapezoid {
    /// Acceleration, with the sign of the motion.
    acceleration: f64,
    /// Time to accelerate to the highest speed, s. The deceleration takes the same time.
    ramp: f64,
    /// Time at the highest speed, s.
    cruise: f64,
}

impl Trapezoid {
    /// Returns the fastest trapezoid for the distance `way` within the limits `velocity` and `acceleration`.
    fn new(way: f64, velocity: f64, acceleration: f64) -> Self {
        let distance = way.abs();
        if distance == 0.0 {
            return Self { acceleration: 0.0, ramp: 0.0, cruise: 0.0 };
        }
        let ramp = (velocity / acceleration).min((distance / acceleration).sqrt());
        let cruise = (distance / (acceleration * ramp) - ramp).max(0.0);
        Self { acceleration: acceleration.copysign(way), ramp, cruise }
    }

    fn duration(&self) -> f64 {
        2.0 * self.ramp + self.cruise
    }

    /// Returns the motion with `factor` times the duration.
    fn stretched(&self, factor: f64) -> Self {
        Self {
            acceleration: self.acceleration / (factor * factor),
            ramp: self.ramp * factor,
            cruise: self.cruise * factor,
        }
    }

    /// Returns distance, speed and acceleration at `t`. If the acceleration jumps at `t`, returns the value after the
    /// jump.
    fn at(&self, t: f64) -> (f64, f64, f64) {
        let (a, top) = (self.acceleration, self.acceleration * self.ramp);
        let left = self.duration() - t;
        if t < self.ramp {
            (0.5 * a * t * t, a * t, a)
        } else if left > self.ramp {
            (top * (t - 0.5 * self.ramp), top, 0.0)
        } else {
            (top * (self.ramp + self.cruise) - 0.5 * a * left * left, a * left, -a)
        }
    }
}

/// Plans a motion from rest to rest. The path is a straight line if a straight line does not take longer. If a straight line takes longer,
/// each joint moves separately, in the time of the slowest joint.
pub(crate) fn straight_or_joined(from: &JointVec, to: &JointVec, limits: &Limits) -> Motion {
    let way: JointVec = std::array::from_fn(|j| to[j] - from[j]);
    let mut parts: [Trapezoid; JOINTS] =
        std::array::from_fn(|j| Trapezoid::new(way[j], limits.velocity[j], limits.acceleration[j]));
    let joined = parts.iter().map(Trapezoid::duration).fold(0.0, f64::max);
    let line = line(&way, limits);
    if line.duration() <= joined * (1.0 + 1e-9) {
        parts = way.map(|w| Trapezoid { acceleration: line.acceleration * w, ..line });
    } else {
        for part in parts.iter_mut().filter(|p| p.duration() > 0.0) {
            *part = part.stretched(joined / part.duration());
        }
    }
    pieces(from, to, &parts)
}

/// Returns the profile of a straight line, as a fraction of its length from 0 to 1.
fn line(way: &JointVec, limits: &Limits) -> Trapezoid {
    let least = |limit: &JointVec| {
        way.iter()
            .zip(limit)
            .filter(|(w, _)| **w != 0.0)
            .map(|(w, l)| l / w.abs())
            .fold(f64::INFINITY, f64::min)
    };
    Trapezoid::new(1.0, least(&limits.velocity), least(&limits.acceleration))
}

fn pieces(from: &JointVec, to: &JointVec, parts: &[Trapezoid; JOINTS]) -> Motion {
    let end = parts.iter().map(Trapezoid::duration).fold(0.0, f64::max);
    let mut breaks = vec![0.0, end];
    breaks.extend(parts.iter().flat_map(|p| [p.ramp, p.ramp + p.cruise]));
    breaks.sort_by(f64::total_cmp);
    breaks.dedup_by(|b, a| *b - *a < 1e-12);
    let pieces = breaks.windows(2).map(|pair| {
        let (start, length) = (pair[0], pair[1] - pair[0]);
        let coefficients = std::array::from_fn(|j| {
            let (way, speed, _) = parts[j].at(start);
            let (.., acceleration) = parts[j].at(start + 0.5 * length);
            [from[j] + way, speed, 0.5 * acceleration, 0.0, 0.0, 0.0]
        });
        Piece { start, length, coefficients }
    });
    Motion::new(pieces.collect(), *to, vec![0.0, end])
}
