//! Limits in the cells of a plan, evaluated at points.
use super::Problem;
use super::place::{Place, Three, Torque};
use super::spline::knot;
use crate::along::Plan;
use crate::cells::{Cell, End, planned_torque};
use crate::path::PathPoint;
use crate::{JOINTS, JointVec};

/// Squared speed, its slope and its second derivative.
type Values = (Three, Three, Three);

/// Part of the spline between two knots.
struct Span {
    left: Values,
    middle: Values,
    right: Values,
}

impl Span {
    fn new(knots: &[f64], i: isize) -> Self {
        let at = |k: isize| knot(knots, k);
        let (left, right, h) = (at(i + 1) - at(i - 1), at(i + 2) - at(i), at(i + 1) - at(i));
        let b_left = [h / left, (at(i) - at(i - 1)) / left, 0.0];
        let b_right = [0.0, (at(i + 2) - at(i + 1)) / right, h / right];
        let s_left = [-2.0 / left, 2.0 / left, 0.0];
        let s_right = [0.0, -2.0 / right, 2.0 / right];
        let bend: Three = std::array::from_fn(|j| (s_right[j] - s_left[j]) / h);
        let b = std::array::from_fn(|j| b_left[j] + h * (0.5 * s_left[j] + 0.125 * bend[j] * h));
        let slope = std::array::from_fn(|j| 0.5 * (s_left[j] + s_right[j]));
        Self { left: (b_left, s_left, bend), middle: (b, slope, bend), right: (b_right, s_right, bend) }
    }
}

/// Share of the acceleration and jerk limits that is used at the ends of the cells.
const SHARE: f64 = 0.995;

impl<'a> Problem<'a> {
    /// Creates the problem. `slower` contains the time factor of each cell.
    pub(super) fn new(plan: &'a Plan, slower: &[f64]) -> Option<Self> {
        let cells = plan.cells;
        let count = cells.len();
        if count < 5 {
            return None;
        }
        let knots: Vec<f64> = cells[1..].iter().map(|c| c.from).collect();
        let end = cells[count - 1].to;
        let spans = knots.len() - 1;
        let (h_first, h_last) = (knots[1] - knots[0], knots[spans] - knots[spans - 1]);
        let (x_first, x_last) = (cells[0].to, end - cells[count - 1].from);
        let ties =
            (1.0 / (1.0 + 2.0 * h_first / (3.0 * x_first)), 1.0 / (1.0 + 2.0 * h_last / (3.0 * x_last)));
        let mut problem = Self { plan, places: Vec::with_capacity(2 * count), knots, ties, limits: 0.0, end };
        // At both ends of the section the arm is at rest. Near an end, the squared speed grows with the power 4/3 of
        // the distance from the end.
        let power = |x: f64, sign: f64| (sign * 4.0 / (3.0 * x), 4.0 / (9.0 * x * x));
        let (slope, bend) = power(x_first, 1.0);
        let one = |index: usize, value: f64| -> Three {
            std::array::from_fn(|i| if i == index { value } else { 0.0 })
        };
        problem.push((0, 0), slower, 0, (one(0, 0.0), one(0, 0.0), one(0, bend)), None);
        problem.push((0, 1), slower, 0, (one(0, 1.0), one(0, slope), one(0, bend)), None);
        problem.places[0].b = one(0, 1.0);
        problem.places[0].at_rest();
        let spans_of: Vec<Span> = (0..spans).map(|k| Span::new(&problem.knots, k as isize)).collect();
        for (k, span) in spans_of.iter().enumerate() {
            let sixth = |cell: usize| cells[cell].length() / 6.0;
            let weight = sixth(k + 1) + if k == 0 { 3.0 * x_first } else { sixth(k) };
            problem.push((k + 1, 0), slower, k, span.left, Some(weight));
            if let Some(place) = problem.places.last_mut() {
                place.middle = (span.middle.0, 4.0 * sixth(k + 1));
            }
            if !cells[k + 1].is_straight() {
                problem.push_middle(k + 1, slower, k, span.middle);
            }
            let last = k + 1 == spans;
            let weight = sixth(k + 1) + 3.0 * x_last;
            problem.push((k + 1, 1), slower, k, span.right, last.then_some(weight));
        }
        let (slope, bend) = power(x_last, -1.0);
        problem.push((count - 1, 0), slower, spans - 1, (one(2, 1.0), one(2, slope), one(2, bend)), None);
        problem.push((count - 1, 1), slower, spans - 1, (one(2, 1.0), one(2, 0.0), one(2, bend)), None);
        if let Some(last) = problem.places.last_mut() {
            last.at_rest();
        }
        Some(problem)
    }

    /// Adds the jerk limit at one end of a cell. If `whole` is `Some`, also adds the other limits. The value in
    /// `whole` is then the weight of this point in the numerical integration of 1/speed, which gives the duration.
    fn push(
        &mut self,
        (cell, side): (usize, usize),
        slower: &[f64],
        at: usize,
        (b, slope, bend): Values,
        whole: Option<f64>,
    ) {
        let plan = self.plan;
        let end: &End = &plan.cells[cell].ends[side];
        let mut place = self.place(cell, slower, at, (b, slope, bend), &end.point);
        self.limits += 2.0 * JOINTS as f64;
        if let Some(weight) = whole {
            let other = if side == 0 { cell - 1 } else { cell + 1 };
            let cap = |c: usize| plan.caps[c] * (plan.shares[c] / slower[c]).powi(2);
            place.cap = cap(cell).min(cap(other));
            place.weight = weight;
            self.limits += 2.0 * JOINTS as f64 + 1.0;
            if let (Some(loads), Some(arm)) = (&end.loads, plan.arm) {
                self.limits += 2.0 * JOINTS as f64;
                let share = plan.shares[cell] / slower[cell];
                let square = share * share;
                let limit = |j: usize| planned_torque(arm, plan.limits, j, loads.hold[j]);
                place.torque = Some(Torque {
                    first: end.point.first,
                    mass: loads.mass.map(|m| 0.5 * m / square),
                    speed: loads.speed.map(|s| s / square),
                    high: std::array::from_fn(|j| limit(j) - loads.hold[j]),
                    low: std::array::from_fn(|j| limit(j) + loads.hold[j]),
                });
            }
        }
        self.places.push(place);
    }

    /// Adds the jerk limit in the middle of a cell, between its two equal parts.
    fn push_middle(&mut self, cell: usize, slower: &[f64], at: usize, values: Values) {
        let of = &self.plan.cells[cell];
        let [from, to] = of.ends.map(|end| end.point);
        let bulge = 0.125 * of.length() * of.length();
        let point = PathPoint {
            position: from.position,
            first: std::array::from_fn(|j| 0.5 * (from.first[j] + to.first[j]) - bulge * of.third[j]),
            second: std::array::from_fn(|j| 0.5 * (from.second[j] + to.second[j])),
        };
        let place = self.place(cell, slower, at, values, &point);
        self.limits += 2.0 * JOINTS as f64;
        self.places.push(place);
    }

    /// Returns a point that has only a jerk limit.
    fn place(
        &self,
        cell: usize,
        slower: &[f64],
        at: usize,
        (b, slope, bend): Values,
        point: &PathPoint,
    ) -> Place {
        let plan = self.plan;
        let share = plan.shares[cell] / slower[cell];
        let (by_a, by_j) = ((share * share).recip(), (share * share * share).recip());
        let shares = |values: &JointVec, limits: &JointVec, factor: f64| -> JointVec {
            std::array::from_fn(|j| factor * values[j] / (SHARE * limits[j]))
        };
        let (a, j) = (&plan.limits.acceleration, &plan.limits.jerk);
        let third = &plan.cells[cell].third;
        Place {
            at,
            b,
            slope,
            bend,
            jerk: [
                shares(&point.first, j, 0.5 * by_j),
                shares(&point.second, j, 1.5 * by_j),
                shares(third, j, by_j),
            ],
            acceleration: [shares(&point.first, a, 0.5 * by_a), shares(&point.second, a, by_a)],
            cap: f64::INFINITY,
            weight: 0.0,
            middle: ([0.0; 3], 0.0),
            torque: None,
        }
    }
}

impl Cell {
    fn length(&self) -> f64 {
        self.to - self.from
    }
}
