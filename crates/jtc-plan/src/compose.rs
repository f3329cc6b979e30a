//! Composition of a motion from a path and a time law.
use crate::law::Law;
use crate::motion::{Motion, Piece};
use crate::path::{Path, PathPoint};
use crate::{JOINTS, JointVec, Limits, State};

/// Minimum duration of a polynomial piece of a motion with a jerk limit, s. In a shorter piece, rounding errors
/// dominate the third derivative.
const SHORTEST: f64 = 2e-4;
/// Minimum duration of a polynomial piece of a motion without a jerk limit, s. In a shorter piece, rounding errors
/// dominate the second derivative.
const SHORTEST_WITHOUT_JERK: f64 = 1e-5;
/// Largest distance between the middle of a polynomial piece and the path, rad.
const AWAY: f64 = 1e-9;
/// Largest error of the acceleration in the middle of a polynomial piece, as a share of the acceleration limit.
const ACCELERATION_AWAY: f64 = 1e-3;
/// Maximum number of times that a piece is halved to stay within the two error limits above.
const HALVINGS: u8 = 7;

/// Section of a path from one stop to the next. The path changes its form at the breaks of the section.
pub(crate) struct Section<'a> {
    pub path: &'a dyn Path,
    pub from: f64,
    pub to: f64,
    /// Parameters of the breaks in ascending order, without the ends of the section.
    pub breaks: Vec<f64>,
    /// Parameters of the waypoints that belong to the section, in ascending order. The waypoint at the start of a
    /// section belongs to the section only if it is the start of the path.
    pub waypoints: Vec<f64>,
    /// Number of parts between the breaks of the whole path.
    pub parts_of_path: usize,
}

impl Section<'_> {
    /// Returns position and derivatives at the parameter `s`. `side` is a part between two breaks. If `s` is a break,
    /// the derivatives are those inside `side`.
    pub(crate) fn at(&self, s: f64, side: (f64, f64)) -> PathPoint {
        self.path.at(s.clamp(side.0.next_up(), side.1.next_down().max(side.0.next_up())))
    }

    /// Returns the start and end of each part between two breaks.
    pub(crate) fn parts(&self) -> impl Iterator<Item = (f64, f64)> {
        let ends = || self.breaks.iter().copied();
        std::iter::once(self.from).chain(ends()).zip(ends().chain([self.to]))
    }

    /// Returns the motion along the section. In the list of waypoint times, the first entry is the start of the
    /// section.
    pub(crate) fn motion(&self, law: &Law, limits: &Limits) -> Motion {
        let mut pieces = Vec::new();
        let shortest = if limits.has_jerk() { SHORTEST } else { SHORTEST_WITHOUT_JERK };
        for (part, (begin, end)) in self.parts().zip(self.times(law)) {
            let part_of = |from: f64, to: f64| Part {
                section: self,
                law,
                side: part,
                from,
                to,
                acceleration: &limits.acceleration,
            };
            let first = law.phases.partition_point(|p| p.start <= begin + shortest);
            let inside = law.phases[first..].iter().map(|p| p.start).take_while(|t| *t < end - shortest);
            let mut from = begin;
            for t in inside.chain([end]) {
                if t - from >= shortest || t == end {
                    part_of(from, t).pieces(&mut pieces, HALVINGS);
                    from = t;
                }
            }
        }
        let time = |s: &f64| if *s == self.to { law.duration() } else { law.time_of(s - self.from) };
        let waypoints = self.waypoints.iter().map(time);
        let times = std::iter::once(0.0).chain(waypoints).collect();
        Motion::new(pieces, self.path.at(self.to).position, times)
    }

    /// Returns the start and end time of each part between two breaks.
    fn times(&self, law: &Law) -> Vec<(f64, f64)> {
        let mut times: Vec<f64> = vec![0.0];
        times.extend(self.breaks.iter().map(|s| law.time_of(s - self.from)));
        times.push(law.duration());
        times.windows(2).map(|pair| (pair[0], pair[1])).collect()
    }
}

/// A time interval within one part of a section.
struct Part<'a> {
    section: &'a Section<'a>,
    law: &'a Law,
    side: (f64, f64),
    from: f64,
    to: f64,
    acceleration: &'a JointVec,
}

impl Part<'_> {
    /// Adds the polynomial pieces of the motion in this part. A piece that deviates too far from the path is halved.
    fn pieces(&self, pieces: &mut Vec<Piece>, halvings: u8) {
        let (from, to) = (self.from, self.to);
        if to <= from {
            return;
        }
        let length = to - from;
        let mut start = self.state(from, 1.0);
        // A piece starts exactly at the end of the previous piece, so that rounding does not cause a jump.
        if let Some(last) = pieces.last() {
            let end = last.at(last.length);
            (start.position, start.velocity) = (end.position, end.velocity);
        }
        let piece = Piece::between(from, length, &start, &self.state(to, -1.0));
        let middle = from + 0.5 * length;
        if halvings > 0 && length > 2.0 * SHORTEST && self.is_off(&piece.at(0.5 * length), middle) {
            Part { to: middle, ..*self }.pieces(pieces, halvings - 1);
            Part { from: middle, ..*self }.pieces(pieces, halvings - 1);
        } else {
            pieces.push(piece);
        }
    }

    fn is_off(&self, piece: &State, time: f64) -> bool {
        let exact = self.state(time, 1.0);
        (0..JOINTS).any(|j| {
            let acceleration = (piece.acceleration[j] - exact.acceleration[j]).abs();
            (piece.position[j] - exact.position[j]).abs() > AWAY
                || acceleration > ACCELERATION_AWAY * self.acceleration[j]
        })
    }

    /// Returns the state at `time`. If the acceleration jumps at `time`, returns the state just after the jump
    /// (`after` = 1) or just before the jump (−1).
    fn state(&self, time: f64, after: f64) -> State {
        let (s, v, a) = self.law.beside(time, after);
        let at = self.section.at(self.section.from + s, self.side);
        State {
            position: at.position,
            velocity: at.first.map(|q| q * v),
            acceleration: std::array::from_fn(|j| at.first[j] * a + at.second[j] * v * v),
        }
    }
}
