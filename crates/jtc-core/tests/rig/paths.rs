//! Trajectories, and motions to a point of a trajectory.
use jtc_core::TrajectoryState;
use jtc_wire::{DataStatus, ExecCommand, FrameType, RawPoint};

use super::{Rig, segment_body};

/// Returns the points of a motion of a joint (0..5) that consists of pieces with constant acceleration. Each piece has an acceleration
/// (rad/s²) and a number of points 10 ms apart.
pub(crate) fn pieces(joint: usize, list: &[(f64, u32)]) -> Vec<RawPoint> {
    let (mut p, mut v) = (0.0f64, 0.0f64);
    let mut points = vec![RawPoint::default()];
    for &(a, n) in list {
        for i in 1..=n {
            let next = v + a * 0.01;
            p += 0.5 * (v + next) * 0.01;
            v = next;
            points.push(point(joint, p, v, if i < n { a } else { 0.0 }));
        }
    }
    points
}

/// Returns a point that moves only one joint, with position (rad), velocity (rad/s) and acceleration (rad/s²).
pub(crate) fn point(joint: usize, q: f64, v: f64, a: f64) -> RawPoint {
    let mut point = RawPoint::default();
    put(&mut point, joint, q, v, a);
    point
}

/// Sets the position (rad), velocity (rad/s) and acceleration (rad/s²) of a joint in a point.
pub(crate) fn put(point: &mut RawPoint, joint: usize, q: f64, v: f64, a: f64) {
    point.position[joint] = raw(q, 3.141592);
    point.velocity[joint] = raw(v, 6.283185);
    point.acceleration[joint] = raw(a, 12.566370);
}

/// Returns a value as an integer in the wire format. `scale` is the value of the largest integer in the wire format.
pub(crate) fn raw(value: f64, scale: f64) -> i16 {
    (value / scale * 32767.0).round() as i16
}

/// Returns a point at rest with the position `raw` for every joint.
pub(crate) fn rest(raw: i16) -> RawPoint {
    RawPoint { position: [raw; 6], ..RawPoint::default() }
}

/// Returns the angle of a position in the wire format, rad.
pub(crate) fn rad(raw: i16) -> f64 {
    f64::from(raw) * (3.141592 / 32767.0)
}

impl Rig {
    /// Uploads a trajectory in segments of at most 100 points.
    pub(crate) fn upload(&mut self, points: &[RawPoint], step: u16) {
        let chunks: Vec<_> = points.chunks(100).collect();
        for (i, chunk) in chunks.iter().enumerate() {
            let body = segment_body(7, i as u16, chunks.len() as u16, step, chunk);
            assert_eq!(self.ask(FrameType::Trajectory, &body), DataStatus::NoError, "segment {i}");
        }
        assert_eq!(self.trajectory(), TrajectoryState::Stop);
    }

    /// Uploads points that are 10 ms apart and executes them.
    pub(crate) fn execute(&mut self, points: &[RawPoint]) {
        self.upload(points, 10);
        assert_eq!(self.exec(ExecCommand::Execute), DataStatus::NoError);
    }

    /// Uploads points that are 10 ms apart, executes them, and executes ticks until path time is at `point` ms.
    pub(crate) fn move_along(&mut self, points: &[RawPoint], point: u32) {
        self.execute(points);
        self.until(4_000, |rig| rig.controller.telemetry().point >= point);
    }
}
