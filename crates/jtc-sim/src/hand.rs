//! A simulated hand that guides the arm along a path in Teaching. The hand pulls on every joint with a compliant and
//! limited torque.
use jtc_dynamics::{JOINTS, JointVec};

/// Torque per position difference between a joint and the hand's target, N·m/rad.
const STIFFNESS: f64 = 1500.0;
/// Torque per speed difference between a joint and the target of the hand, N·m·s/rad.
const DAMPING: f64 = 80.0;
/// Maximum torque of the hand on a joint, N·m.
const STRONGEST: f64 = 60.0;
/// Mean speed of the motion to the first point of the path, rad/s.
const APPROACH: f64 = 0.2;
/// Time for which the hand holds the last point, s.
const HELD: f64 = 0.5;
/// Duration of a tick, s.
const TICK: f64 = 1e-3;

/// A path of joint positions with a fixed time step.
#[derive(Clone, Debug, PartialEq)]
pub struct HandPath {
    points: Vec<JointVec>,
    step_s: f64,
}

impl HandPath {
    /// Creates a path. `points` contains joint positions (rad) that are `step_s` seconds apart. Returns `None` if
    /// `points` is empty, if a number is not finite, or if `step_s` ≤ 0.
    pub fn new(points: Vec<JointVec>, step_s: f64) -> Option<Self> {
        let finite = points.iter().flatten().all(|q| q.is_finite());
        let good = !points.is_empty() && finite && step_s.is_finite() && step_s > 0.0;
        good.then_some(Self { points, step_s })
    }

    /// Returns the time from the first point to the last, s.
    pub fn duration_s(&self) -> f64 {
        self.step_s * (self.points.len() - 1) as f64
    }

    /// Returns the position `t` seconds after the first point, with linear interpolation.
    fn at(&self, t: f64) -> JointVec {
        let place = (t / self.step_s).clamp(0.0, (self.points.len() - 1) as f64);
        let i = place as usize;
        let (a, b) = (&self.points[i], &self.points[(i + 1).min(self.points.len() - 1)]);
        core::array::from_fn(|j| a[j] + (place - i as f64) * (b[j] - a[j]))
    }
}

/// A hand that guides the arm along a path.
#[derive(Clone, Debug)]
pub(crate) struct Hand {
    path: HandPath,
    led: Option<Led>,
}

/// State of the hand since Teaching began: pose of the arm at the start of Teaching, duration of the motion to the
/// first point (s), and elapsed time (s).
#[derive(Clone, Copy, Debug)]
struct Led {
    from: JointVec,
    approach_s: f64,
    t: f64,
}

impl Hand {
    pub(crate) fn new(path: HandPath) -> Self {
        Self { path, led: None }
    }

    /// Returns the hand's torque in this millisecond, N·m, for an arm with the positions `q` and velocities `qd`.
    /// Before Teaching begins, the hand does nothing. When the path or Teaching ends, the hand releases the arm, and
    /// the result is `None`.
    pub(crate) fn torque(&mut self, teaching: bool, q: &JointVec, qd: &JointVec) -> Option<JointVec> {
        if !teaching {
            return if self.led.is_some() { None } else { Some([0.0; JOINTS]) };
        }
        let led = self.led.get_or_insert_with(|| {
            let first = &self.path.points[0];
            let far = first.iter().zip(q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            Led { from: *q, approach_s: far / APPROACH, t: 0.0 }
        });
        led.t += TICK;
        let led = *led;
        if led.t > led.approach_s + self.path.duration_s() + HELD {
            return None;
        }
        let (now, before) = (self.wanted(&led, led.t), self.wanted(&led, led.t - TICK));
        Some(core::array::from_fn(|j| {
            let speed = (now[j] - before[j]) / TICK;
            (STIFFNESS * (now[j] - q[j]) + DAMPING * (speed - qd[j])).clamp(-STRONGEST, STRONGEST)
        }))
    }

    /// Returns the joint positions to which the hand pulls the arm. The target first moves smoothly to the first point,
    /// and then follows the path.
    fn wanted(&self, led: &Led, t: f64) -> JointVec {
        if t >= led.approach_s {
            return self.path.at(t - led.approach_s);
        }
        let s = t / led.approach_s;
        let s = s * s * (3.0 - 2.0 * s);
        core::array::from_fn(|j| led.from[j] + s * (self.path.points[0][j] - led.from[j]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_needs_points_and_time() {
        assert_eq!(HandPath::new(Vec::new(), 0.01), None);
        assert_eq!(HandPath::new(vec![[0.0; 6]], 0.0), None);
        assert_eq!(HandPath::new(vec![[f64::NAN; 6]], 0.01), None);
        let path = HandPath::new(vec![[0.0; 6], [1.0; 6]], 2.0).unwrap();
        assert_eq!((path.at(1.0), path.at(9.0), path.duration_s()), ([0.5; 6], [1.0; 6], 2.0));
    }

    #[test]
    fn a_hand_waits_for_teaching_pulls_with_bounded_force_and_lets_go() {
        let mut hand = Hand::new(HandPath::new(vec![[3.0; 6]; 11], 0.01).unwrap());
        assert_eq!(hand.torque(false, &[0.0; 6], &[0.0; 6]), Some([0.0; 6]));
        // The arm does not move, so the torque of the hand must rise to its limit and then stay constant.
        let mut strongest = 0.0f64;
        let mut ms = 0;
        while let Some(torque) = hand.torque(true, &[0.0; 6], &[0.0; 6]) {
            strongest = strongest.max(torque[0]);
            ms += 1;
        }
        assert_eq!(strongest, STRONGEST);
        // The expected duration is 15 s for 3 rad at 0.2 rad/s, plus 0.1 s for the path, plus 0.5 s at the last
        // point.
        assert!((15_590..15_610).contains(&ms), "{ms} ms");
        let mut hand = Hand::new(HandPath::new(vec![[3.0; 6]], 0.01).unwrap());
        hand.torque(true, &[0.0; 6], &[0.0; 6]);
        assert_eq!(hand.torque(false, &[0.0; 6], &[0.0; 6]), None, "Teaching is over");
    }
}
