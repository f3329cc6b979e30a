//! Motions as functions of time.
use jtc_wire::Joint;

use crate::binding::{Binding, LimitKind};
use crate::{JOINTS, JointVec};

/// Position, velocity and acceleration at one point in time.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct State {
    /// Position, rad.
    pub position: JointVec,
    /// Velocity, rad/s.
    pub velocity: JointVec,
    /// Acceleration, rad/s².
    pub acceleration: JointVec,
}

impl State {
    /// Returns the state at rest.
    pub(crate) fn rest(position: JointVec) -> Self {
        Self { position, ..Self::default() }
    }
}

/// Part of a motion in which each joint's position is a polynomial of degree 5 in the time since `start`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    /// Start, s.
    pub start: f64,
    /// Duration of the piece, greater than 0 s.
    pub length: f64,
    /// Coefficients of the polynomial of each joint, in ascending order.
    pub coefficients: [[f64; 6]; JOINTS],
}

impl Piece {
    /// Returns the piece that begins in the state `a` and ends in the state `b` (Hermite interpolation).
    pub(crate) fn between(start: f64, length: f64, a: &State, b: &State) -> Self {
        let h = length;
        let coefficients = std::array::from_fn(|j| {
            let (p, v, c) = (a.position[j], a.velocity[j], 0.5 * a.acceleration[j]);
            // Remaining differences at the end of the piece, in units of time of the piece's duration.
            let dp = b.position[j] - (p + h * (v + h * c));
            let dv = (b.velocity[j] - (v + 2.0 * h * c)) * h;
            let da = (b.acceleration[j] - 2.0 * c) * h * h;
            let d3 = 10.0 * dp - 4.0 * dv + 0.5 * da;
            let d4 = -15.0 * dp + 7.0 * dv - da;
            let d5 = 6.0 * dp - 3.0 * dv + 0.5 * da;
            let h3 = h * h * h;
            [p, v, c, d3 / h3, d4 / (h3 * h), d5 / (h3 * h * h)]
        });
        Self { start, length, coefficients }
    }

    /// Returns the state `t` seconds after the start.
    pub(crate) fn at(&self, t: f64) -> State {
        let mut state = State::default();
        for (j, c) in self.coefficients.iter().enumerate() {
            let [c0, c1, c2, c3, c4, c5] = *c;
            state.position[j] = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))));
            state.velocity[j] = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5)));
            state.acceleration[j] = 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5));
        }
        state
    }

    /// Returns the third derivative `t` seconds after the start, rad/s³.
    pub(crate) fn jerk(&self, t: f64) -> JointVec {
        self.coefficients.map(|[_, _, _, c3, c4, c5]| 6.0 * c3 + t * (24.0 * c4 + t * 60.0 * c5))
    }

    /// Returns a piece on the same path, with `factor` times the duration.
    pub(crate) fn stretched(&self, factor: f64) -> Self {
        let mut coefficients = self.coefficients;
        for c in &mut coefficients {
            let mut power = 1.0;
            for x in c {
                *x *= power;
                power /= factor;
            }
        }
        Self { start: self.start * factor, length: self.length * factor, coefficients }
    }
}

/// Motion as a function of time, from rest to rest.
#[derive(Clone, Debug)]
pub struct Motion {
    pub(crate) pieces: Vec<Piece>,
    pub(crate) end: State,
    pub(crate) binding: Vec<Binding>,
    /// Joint whose torque limit is the reason why the whole motion was slowed down.
    pub(crate) slowed: Option<Joint>,
    pub(crate) waypoint_times: Vec<f64>,
}

impl Motion {
    /// Creates a motion from consecutive pieces without gaps. At the end of the last piece, the arm is at rest at
    /// `end`.
    pub(crate) fn new(pieces: Vec<Piece>, end: JointVec, waypoint_times: Vec<f64>) -> Self {
        Self { pieces, end: State::rest(end), binding: Vec::new(), slowed: None, waypoint_times }
    }

    /// Returns the duration from rest to rest, which is greater than 0 s.
    pub fn duration(&self) -> f64 {
        self.pieces.last().map_or(0.0, |p| p.start + p.length)
    }

    /// Returns the state at `t` seconds after the start. Before the start and after the end, the arm rests exactly at
    /// the first or the last waypoint. Without a jerk limit, the acceleration can jump. At a jump, the function
    /// returns the acceleration after the jump.
    pub fn at(&self, t: f64) -> State {
        match self.piece(t) {
            None => self.end,
            Some(first) if t <= 0.0 => {
                let state = first.at(0.0);
                if t < 0.0 { State::rest(state.position) } else { state }
            }
            Some(piece) => piece.at(t - piece.start),
        }
    }

    /// Returns the jerk at `t` seconds after the start, rad/s³; 0 while the arm is at rest.
    pub fn jerk_at(&self, t: f64) -> JointVec {
        if t < 0.0 {
            return [0.0; JOINTS];
        }
        self.piece(t).map_or([0.0; JOINTS], |piece| piece.jerk(t - piece.start))
    }

    /// Returns the binding limits in chronological order. In an interval in which no limit is reached, the binding
    /// limit is the nearest limit. If the whole motion was slowed down because of a torque limit, this torque limit
    /// is the binding limit of such an interval.
    pub fn binding(&self) -> &[Binding] {
        &self.binding
    }

    /// Returns the time at which the motion is nearest to each waypoint, in seconds after the start.
    pub fn waypoint_times(&self) -> &[f64] {
        &self.waypoint_times
    }

    /// Returns the piece at `t`. Before the start, returns the first piece. At and after the end, returns `None`.
    fn piece(&self, t: f64) -> Option<&Piece> {
        if t.is_nan() || t >= self.duration() {
            return None;
        }
        let after = self.pieces.partition_point(|p| p.start <= t);
        self.pieces.get(after.saturating_sub(1))
    }

    /// Returns a motion on the same path, with `factor` times the duration.
    pub(crate) fn stretched(&self, factor: f64) -> Self {
        Self {
            pieces: self.pieces.iter().map(|p| p.stretched(factor)).collect(),
            end: self.end,
            binding: Vec::new(),
            slowed: None,
            waypoint_times: self.waypoint_times.iter().map(|t| t * factor).collect(),
        }
    }

    /// Inserts a standstill of `length` seconds at the waypoint with this index, if the motion is at rest at this
    /// waypoint. The standstill delays all later waypoints.
    pub(crate) fn rest_at(&mut self, waypoint: usize, length: f64) {
        let Some(&time) = self.waypoint_times.get(waypoint) else { return };
        let at = self.pieces.partition_point(|p| p.start + 0.5 * p.length < time);
        let place = self.pieces.get(at).map_or(self.end, |p| State::rest(p.at(0.0).position));
        for piece in &mut self.pieces[at..] {
            piece.start += length;
        }
        self.pieces.insert(at, Piece::between(time, length, &place, &place));
        for time in &mut self.waypoint_times[waypoint + 1..] {
            *time += length;
        }
        let mut binding = Vec::with_capacity(self.binding.len() + 2);
        let after = self.binding.partition_point(|b| b.from < time);
        let joint = self.binding.get(after.saturating_sub(1)).map_or(Joint::ALL[0], |b| b.joint);
        binding.extend(self.binding[..after].iter().map(|b| Binding { to: b.to.min(time), ..*b }));
        binding.push(Binding { from: time, to: time + length, joint, limit: LimitKind::GivenTime });
        // A binding interval around the standstill is split into two intervals.
        let both = self.binding[..after].last().filter(|b| b.to > time).map(|b| Binding { from: time, ..*b });
        let later = both.into_iter().chain(self.binding[after..].iter().copied());
        binding.extend(later.map(|b| Binding { from: b.from + length, to: b.to + length, ..b }));
        self.binding = binding;
    }

    /// Appends another motion that begins at the end of this motion. The first waypoint of `next` is the last waypoint
    /// of this motion.
    pub(crate) fn append(&mut self, next: &Self) {
        let start = self.duration();
        self.pieces.extend(next.pieces.iter().map(|p| Piece { start: p.start + start, ..*p }));
        self.waypoint_times.extend(next.waypoint_times.iter().skip(1).map(|t| t + start));
        self.end = next.end;
    }
}
