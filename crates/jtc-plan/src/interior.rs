//! Laws of time that are limited in jerk, by an interior-point method (Boyd and Vandenberghe 2004).
//!
//! The squared speed of the parameter is a quadratic spline of it, whose knots are the ends of cells: acceleration is half its slope, and
//! jerk half its second derivative times the speed. Velocity, acceleration and torque are then linear in the coefficients, and jerk is
//! so but for the root of the squared speed. Sum of the time and barriers of all limits is made the least by Newton's method, the second
//! derivatives of the limits left out; what couples are neighbours alone, so that a step takes time in proportion to the length of the path.
//! In the first and the last cell the jerk is constant: from rest the squared speed rises by the power 4/3, which no spline does.
use crate::along::Plan;
use crate::cells::{Cell, End, TORQUE_SHARE};
use crate::law::{Law, Phase};
use crate::path::PathPoint;
use crate::{JOINTS, JointVec};

/// Share of the limits of acceleration and jerk at the ends of the cells.
const SHARE: f64 = 0.995;
/// Shares of the time that the barriers may cost, one after the other.
const GAPS: [f64; 3] = [0.2, 0.04, 0.008];
/// Steps for each of them at most.
const STEPS: usize = 12;
/// A step that promises less than this share of what the barriers may cost is the last.
const WORTH: f64 = 0.25;
/// Share by which the speed may change in two phases of a law, and into how many pairs of phases a cell is divided at most.
const ALIKE: f64 = 0.2;
const PARTS_MAX: f64 = 4.0;
/// The shortest part of a step.
const SHORTEST: f64 = 1e-3;
/// By what squared speeds are lowered to be within the limits, and how often.
const LOWER: f64 = 0.85;
const LOWER_AGAIN: f64 = 0.97;
const LOWER_MAX: usize = 100;

/// Three neighbouring coefficients from an index on make a value.
type Three = [f64; 3];

/// A place at which limits hold: one end of a cell.
struct Place {
    /// Index of the first coefficient.
    at: usize,
    /// Squared speed, its slope and its second derivative.
    b: Three,
    slope: Three,
    bend: Three,
    /// By bend, slope and squared speed, as shares of the limits: jerk but for the speed as a factor, and acceleration (without bend).
    jerk: [JointVec; 3],
    acceleration: [JointVec; 2],
    /// Highest squared speed, where it is asked for here, with acceleration and torque.
    cap: f64,
    /// Its reciprocal speed counts this long, and that of the middle of the cell, with the squared speed there.
    weight: f64,
    middle: (Three, f64),
    torque: Option<Torque>,
}

struct Torque {
    /// Of the path's direction.
    first: JointVec,
    /// By slope.
    mass: JointVec,
    /// By squared speed.
    speed: JointVec,
    high: JointVec,
    low: JointVec,
}

/// What is made the least.
struct Problem<'a> {
    plan: &'a Plan<'a>,
    places: Vec<Place>,
    /// Knots, between the first and the last cell.
    knots: Vec<f64>,
    /// First and last coefficient as shares of their neighbours.
    ties: (f64, f64),
    /// How many limits.
    limits: f64,
    end: f64,
}

impl Place {
    /// Shares of the jerk limits, but for the speed as a factor.
    fn jerks(&self, b: f64, slope: f64, bend: f64) -> JointVec {
        let [by_bend, by_slope, by_b] = &self.jerk;
        std::array::from_fn(|j| by_bend[j] * bend + by_slope[j] * slope + by_b[j] * b)
    }

    /// Shares of the acceleration limits.
    fn accelerations(&self, b: f64, slope: f64) -> JointVec {
        let [by_slope, by_b] = &self.acceleration;
        std::array::from_fn(|j| by_slope[j] * slope + by_b[j] * b)
    }

    /// Where the arm rests there is nothing but jerk along the path.
    fn at_rest(&mut self) {
        (self.jerk[1], self.jerk[2]) = ([0.0; JOINTS], [0.0; JOINTS]);
    }
}

fn dot(three: &Three, c: &[f64]) -> f64 {
    three[0] * c[0] + three[1] * c[1] + three[2] * c[2]
}

impl<'a> Problem<'a> {
    /// `slower`: factors of the time in each cell.
    fn new(plan: &'a Plan, slower: &[f64]) -> Option<Self> {
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
        // From rest.
        let power = |x: f64, sign: f64| (sign * 4.0 / (3.0 * x), 4.0 / (9.0 * x * x));
        let (slope, bend) = power(x_first, 1.0);
        let one = |index: usize, value: f64| -> Three {
            std::array::from_fn(|i| if i == index { value } else { 0.0 })
        };
        problem.push((0, 0), slower, 0, (one(0, 0.0), one(0, 0.0), one(0, bend)), None);
        problem.push((0, 1), slower, 0, (one(0, 1.0), one(0, slope), one(0, bend)), None);
        problem.places[0].b = one(0, 1.0);
        problem.places[0].at_rest();
        let at = |k: isize| knot(&problem.knots, k);
        let mut rows = Vec::with_capacity(spans);
        for k in 0..spans {
            let i = k as isize;
            let (left, right) = (at(i + 1) - at(i - 1), at(i + 2) - at(i));
            let h = at(i + 1) - at(i);
            let b_left = [h / left, (at(i) - at(i - 1)) / left, 0.0];
            let b_right = [0.0, (at(i + 2) - at(i + 1)) / right, h / right];
            let s_left = [-2.0 / left, 2.0 / left, 0.0];
            let s_right = [0.0, -2.0 / right, 2.0 / right];
            let bend: Three = std::array::from_fn(|j| (s_right[j] - s_left[j]) / h);
            rows.push((b_left, s_left, b_right, s_right, bend));
        }
        for (k, (b_left, s_left, b_right, s_right, bend)) in rows.into_iter().enumerate() {
            let sixth = |cell: usize| cells[cell].length() / 6.0;
            let weight = sixth(k + 1) + if k == 0 { 3.0 * x_first } else { sixth(k) };
            problem.push((k + 1, 0), slower, k, (b_left, s_left, bend), Some(weight));
            let last = k + 1 == spans;
            let h = cells[k + 1].length();
            if let Some(place) = problem.places.last_mut() {
                let b: Three =
                    std::array::from_fn(|j| b_left[j] + h * (0.5 * s_left[j] + 0.125 * bend[j] * h));
                place.middle = (b, 4.0 * sixth(k + 1));
                if !cells[k + 1].is_straight() {
                    let slope = std::array::from_fn(|j| 0.5 * (s_left[j] + s_right[j]));
                    problem.push_middle(k + 1, slower, k, (b, slope, bend));
                }
            }
            let weight = sixth(k + 1) + 3.0 * x_last;
            problem.push((k + 1, 1), slower, k, (b_right, s_right, bend), last.then_some(weight));
        }
        let (slope, bend) = power(x_last, -1.0);
        problem.push((count - 1, 0), slower, spans - 1, (one(2, 1.0), one(2, slope), one(2, bend)), None);
        problem.push((count - 1, 1), slower, spans - 1, (one(2, 1.0), one(2, 0.0), one(2, bend)), None);
        if let Some(last) = problem.places.last_mut() {
            last.at_rest();
        }
        Some(problem)
    }

    /// Jerk at one end of a cell, and where `whole` has how long it counts, the other limits.
    fn push(
        &mut self,
        (cell, side): (usize, usize),
        slower: &[f64],
        at: usize,
        (b, slope, bend): (Three, Three, Three),
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
            if let (Some(loads), Some(_)) = (&end.loads, plan.arm) {
                self.limits += 2.0 * JOINTS as f64;
                let share = plan.shares[cell] / slower[cell];
                let square = share * share;
                let limit = |j: usize| TORQUE_SHARE * plan.limits.torque[j];
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

    /// Jerk in the middle of a cell, where its parts meet that are alike at the ends.
    fn push_middle(&mut self, cell: usize, slower: &[f64], at: usize, values: (Three, Three, Three)) {
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

    /// One at which there is jerk, and nothing else counts.
    fn place(
        &self,
        cell: usize,
        slower: &[f64],
        at: usize,
        (b, slope, bend): (Three, Three, Three),
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

    fn tied(&self, c: &mut [f64]) {
        let n = c.len();
        (c[0], c[n - 1]) = (self.ties.0 * c[1], self.ties.1 * c[n - 2]);
    }

    /// Sum of time and `barrier` times the barriers; infinite outside of the limits.
    fn value(&self, c: &[f64], barrier: f64) -> f64 {
        let (mut time, mut logs) = (0.0, 0.0);
        for place in &self.places {
            let c = &c[place.at..place.at + 3];
            let b = dot(&place.b, c);
            if b.is_nan() || b <= 0.0 {
                return f64::INFINITY;
            }
            let speed = b.sqrt();
            let (slope, bend) = (dot(&place.slope, c), dot(&place.bend, c));
            let mut product = 1.0;
            let mut least = f64::INFINITY;
            for jerk in place.jerks(b, slope, bend) {
                let slack = 1.0 - b * jerk * jerk;
                least = least.min(slack);
                product *= slack;
            }
            if place.weight > 0.0 {
                time += place.weight / speed;
                if place.middle.1 > 0.0 {
                    time += place.middle.1 / dot(&place.middle.0, c).sqrt();
                }
                let slack = 1.0 - b / place.cap;
                least = least.min(slack);
                product *= slack;
                for a in place.accelerations(b, slope) {
                    let slack = 1.0 - a * a;
                    least = least.min(slack);
                    product *= slack;
                }
                if let (Some(torque), Some(arm)) = (&place.torque, self.plan.arm) {
                    for j in 0..JOINTS {
                        let (low, high, ..) = arm.friction_line(j, torque.first[j] * speed);
                        let moving = torque.mass[j] * slope + torque.speed[j] * b;
                        let limit = self.plan.limits.torque[j];
                        let up = (torque.high[j] - high - moving) / limit;
                        let down = (torque.low[j] + low + moving) / limit;
                        least = least.min(up).min(down);
                        product *= up * down;
                    }
                }
            }
            if least.is_nan() || least <= 0.0 {
                return f64::INFINITY;
            }
            logs += product.ln();
        }
        time - barrier * logs
    }

    /// The step of Newton's method, and what it promises.
    fn step(&self, c: &[f64], barrier: f64) -> Option<(Vec<f64>, f64)> {
        let n = c.len();
        let (mut gradient, mut hessian) = (vec![0.0; n], vec![[0.0f64; 3]; n]);
        for place in &self.places {
            let at = place.at;
            let c = &c[at..at + 3];
            let b = dot(&place.b, c);
            let speed = b.sqrt();
            let (slope, bend) = (dot(&place.slope, c), dot(&place.bend, c));
            // By squared speed, slope and bend.
            let mut g = [0.0f64; 3];
            let mut h = [0.0f64; 6];
            let inner = place.jerks(b, slope, bend);
            for j in 0..JOINTS {
                let jerk = speed * inner[j];
                let [bend, slope, square] = &place.jerk;
                let d = [speed * square[j] + 0.5 * inner[j] / speed, speed * slope[j], speed * bend[j]];
                let left = (1.0 - jerk * jerk).recip();
                add(&mut g, &mut h, &d, 2.0 * jerk * left, 2.0 * (1.0 + jerk * jerk) * left * left);
            }
            if place.weight > 0.0 {
                let cap = (place.cap - b).recip();
                g[0] += cap;
                h[0] += cap * cap;
                let accelerations = place.accelerations(b, slope);
                let [slope_by, square_by] = &place.acceleration;
                for j in 0..JOINTS {
                    let a = accelerations[j];
                    let left = (1.0 - a * a).recip();
                    let d = [square_by[j], slope_by[j]];
                    add_two(&mut g, &mut h, &d, 2.0 * a * left, 2.0 * (1.0 + a * a) * left * left);
                }
                if let (Some(torque), Some(arm)) = (&place.torque, self.plan.arm) {
                    for j in 0..JOINTS {
                        let (low, high, low_by, high_by) = arm.friction_line(j, torque.first[j] * speed);
                        let by_b = 0.5 * torque.first[j] / speed;
                        let moving = torque.mass[j] * slope + torque.speed[j] * b;
                        let (up, down) = (
                            (torque.high[j] - high - moving).recip(),
                            (torque.low[j] + low + moving).recip(),
                        );
                        let d = [torque.speed[j] + high_by * by_b, torque.mass[j]];
                        add_two(&mut g, &mut h, &d, up, up * up);
                        let d = [torque.speed[j] + low_by * by_b, torque.mass[j]];
                        add_two(&mut g, &mut h, &d, -down, down * down);
                    }
                }
            }
            g.iter_mut().for_each(|x| *x *= barrier);
            h.iter_mut().for_each(|x| *x *= barrier);
            if place.weight > 0.0 {
                let time = place.weight / speed;
                g[0] -= 0.5 * time / b;
                h[0] += 0.75 * time / (b * b);
                if place.middle.1 > 0.0 {
                    let w = &place.middle.0;
                    let b = dot(w, c);
                    let time = place.middle.1 / b.sqrt();
                    for p in 0..3 {
                        gradient[at + p] -= 0.5 * time / b * w[p];
                        for q in p..3 {
                            hessian[at + p][q - p] += 0.75 * time / (b * b) * w[p] * w[q];
                        }
                    }
                }
            }
            let v = [&place.b, &place.slope, &place.bend];
            for p in 0..3 {
                gradient[at + p] += g[0] * v[0][p] + g[1] * v[1][p] + g[2] * v[2][p];
                // H·v of this coefficient: h is (00, 11, 22, 01, 02, 12).
                let w = [
                    h[0] * v[0][p] + h[3] * v[1][p] + h[4] * v[2][p],
                    h[3] * v[0][p] + h[1] * v[1][p] + h[5] * v[2][p],
                    h[4] * v[0][p] + h[5] * v[1][p] + h[2] * v[2][p],
                ];
                for q in p..3 {
                    hessian[at + p][q - p] += w[0] * v[0][q] + w[1] * v[1][q] + w[2] * v[2][q];
                }
            }
        }
        // The first and the last coefficient follow their neighbours.
        let (first, last) = self.ties;
        gradient[1] += first * gradient[0];
        hessian[1][0] += first * (2.0 * hessian[0][1] + first * hessian[0][0]);
        hessian[1][1] += first * hessian[0][2];
        gradient[n - 2] += last * gradient[n - 1];
        hessian[n - 2][0] += last * (2.0 * hessian[n - 2][1] + last * hessian[n - 1][0]);
        hessian[n - 3][1] += last * hessian[n - 3][2];
        let mut step = solved(&mut hessian[1..n - 1], &gradient[1..n - 1])?;
        step.insert(0, first * step[0]);
        step.push(last * step[n - 2]);
        let promise: f64 = gradient[1..n - 1].iter().zip(&step[1..n - 1]).map(|(g, d)| -g * d).sum();
        Some((step, promise))
    }

    /// Coefficients of a spline that is near a law.
    fn near(&self, law: &Law) -> Vec<f64> {
        let n = self.knots.len() as isize + 1;
        let place = |i: isize| 0.5 * (knot(&self.knots, i - 1) + knot(&self.knots, i));
        let mut c: Vec<f64> = (0..n).map(|i| law.at(law.time_of(place(i))).1.powi(2)).collect();
        self.tied(&mut c);
        c
    }

    /// Lowers the speeds until they are within all limits.
    fn within(&self, c: &mut [f64], by: f64) -> Option<()> {
        self.tied(c);
        let lower = |c: &mut [f64], by: f64| c.iter_mut().for_each(|c| *c *= by);
        for _ in 0..LOWER_MAX {
            let inside = self.value(c, 0.0).is_finite();
            lower(c, by);
            if inside {
                return Some(());
            }
        }
        None
    }

    /// Makes the time shorter, with barriers that cost these shares of it, one after the other.
    fn improve(&self, c: &mut Vec<f64>, gaps: &[f64]) {
        for gap in gaps {
            let time = self.value(c, 0.0);
            let barrier = gap * time / self.limits;
            let mut before = self.value(c, barrier);
            let mut length = 1.0f64;
            for _ in 0..STEPS {
                let Some((step, promise)) = self.step(c, barrier) else { return };
                length = (4.0 * length).min(1.0);
                let found = loop {
                    let next: Vec<f64> = c.iter().zip(&step).map(|(c, d)| c + length * d).collect();
                    let value = self.value(&next, barrier);
                    if value < before - 0.1 * length * promise {
                        break Some((next, value));
                    }
                    length *= 0.5;
                    if length < SHORTEST {
                        break None;
                    }
                };
                let Some((next, value)) = found else { break };
                (*c, before) = (next, value);
                if promise < WORTH * gap * time {
                    break;
                }
            }
        }
    }

    /// The law of a spline.
    fn law(&self, c: &[f64]) -> Law {
        let cells = self.plan.cells;
        let spans = self.knots.len() - 1;
        // Parameter, speed, acceleration at the knots.
        let states: Vec<(f64, f64, f64)> = (0..=spans)
            .map(|k| {
                let i = k as isize;
                let at = |k: isize| knot(&self.knots, k);
                let width = at(i + 1) - at(i - 1);
                let b = (c[k] * (at(i + 1) - at(i)) + c[k + 1] * (at(i) - at(i - 1))) / width;
                (at(i), b.sqrt(), (c[k + 1] - c[k]) / width)
            })
            .collect();
        let mut phases: Vec<Phase> = Vec::with_capacity(2 * cells.len());
        let (_, speed, acceleration) = states[0];
        let mut start = 3.0 * cells[0].to / speed;
        phases.push(Phase { length: start, jerk: acceleration / start, ..Phase::default() });
        for pair in states.windows(2) {
            let (from, to) = (pair[0], pair[1]);
            // The jerk of a phase is one, that of the spline grows with the speed.
            let parts = ((to.1 - from.1).abs() / (ALIKE * from.1.min(to.1))).ceil().clamp(1.0, PARTS_MAX);
            let mut before = from;
            for part in 1..=parts as usize {
                let after = if part as f64 == parts { to } else { between(from, to, part as f64 / parts) };
                start = phases_between(&mut phases, start, before, after);
                before = after;
            }
        }
        let (s, speed, acceleration) = states[spans];
        let length = 3.0 * (self.end - s) / speed;
        phases.push(Phase { start, length, s, speed, acceleration, jerk: -acceleration / length });
        Law { phases, end: self.end, rests: true }
    }
}

/// Parameter, speed and acceleration of a spline at a share of a cell with these ends.
fn between(from: (f64, f64, f64), to: (f64, f64, f64), share: f64) -> (f64, f64, f64) {
    let way = share * (to.0 - from.0);
    let acceleration = from.2 + share * (to.2 - from.2);
    let square = from.1 * from.1 + way * (from.2 + acceleration);
    (from.0 + way, square.max(0.0).sqrt(), acceleration)
}

/// Two phases of one length such that parameter, speed and acceleration are those at both ends; the time at the end.
fn phases_between(
    phases: &mut Vec<Phase>,
    start: f64,
    (s, v, a): (f64, f64, f64),
    (to, w, b): (f64, f64, f64),
) -> f64 {
    let (sum, way) = (v + w, to - s);
    let length = 2.0 * way / (sum + (sum * sum + 4.0 / 3.0 * way * (a - b)).max(0.0).sqrt());
    let middle = (w - v) / length - 0.5 * (a + b);
    let phase = Phase { start, length, s, speed: v, acceleration: a, jerk: (middle - a) / length };
    let (s, speed, acceleration) = phase.at(length);
    let start = start + length;
    phases.push(phase);
    phases.push(Phase { start, length, s, speed, acceleration, jerk: (b - middle) / length });
    start + length
}

fn knot(knots: &[f64], k: isize) -> f64 {
    knots[k.clamp(0, knots.len() as isize - 1) as usize]
}

/// Adds a barrier whose derivatives are `one` and `two` to the gradient and the second derivatives (00, 11, 22, 01, 02, 12).
fn add(g: &mut [f64; 3], h: &mut [f64; 6], d: &[f64; 3], one: f64, two: f64) {
    for i in 0..3 {
        g[i] += one * d[i];
        h[i] += two * d[i] * d[i];
    }
    h[3] += two * d[0] * d[1];
    h[4] += two * d[0] * d[2];
    h[5] += two * d[1] * d[2];
}

/// The same of one that does not depend on the bend.
fn add_two(g: &mut [f64; 3], h: &mut [f64; 6], d: &[f64; 2], one: f64, two: f64) {
    g[0] += one * d[0];
    g[1] += one * d[1];
    h[0] += two * d[0] * d[0];
    h[1] += two * d[1] * d[1];
    h[3] += two * d[0] * d[1];
}

/// The solution of a symmetric positive definite system with two bands beside the diagonal, whose right side is `-right`.
fn solved(bands: &mut [[f64; 3]], right: &[f64]) -> Option<Vec<f64>> {
    let n = bands.len();
    let mut x: Vec<f64> = right.iter().map(|r| -r).collect();
    for i in 0..n {
        let [d, e, f] = bands[i];
        if !(d > 0.0 && d.is_finite()) {
            return None;
        }
        let (e_d, f_d) = (e / d, f / d);
        if i + 1 < n {
            bands[i + 1][0] -= e * e_d;
            bands[i + 1][1] -= f * e_d;
            x[i + 1] -= e_d * x[i];
        }
        if i + 2 < n {
            bands[i + 2][0] -= f * f_d;
            x[i + 2] -= f_d * x[i];
        }
    }
    for i in (0..n).rev() {
        let [d, e, f] = bands[i];
        let mut value = x[i];
        if i + 1 < n {
            value -= e * x[i + 1];
        }
        if i + 2 < n {
            value -= f * x[i + 2];
        }
        x[i] = value / d;
    }
    Some(x)
}

/// A search for the fastest law along a plan's cells.
pub(crate) struct Search<'a> {
    plan: &'a Plan<'a>,
    /// Coefficients of the spline that was found last.
    c: Vec<f64>,
    found: bool,
}

impl<'a> Search<'a> {
    /// Begins near a law.
    pub fn new(plan: &'a Plan<'a>, near: &Law) -> Option<Self> {
        let c = Problem::new(plan, &vec![1.0; plan.cells.len()])?.near(near);
        Some(Self { plan, c, found: false })
    }

    /// The fastest law with these factors of the time in each cell.
    pub fn fastest(&mut self, slower: &[f64]) -> Option<Law> {
        let problem = Problem::new(self.plan, slower)?;
        if self.found {
            // What was found is slower where more is left over now.
            for (i, c) in self.c.iter_mut().enumerate() {
                let near = slower[i.saturating_sub(2)..slower.len().min(i + 3)].iter();
                let most = near.fold(1.0f64, |most, s| most.max(*s));
                *c /= most * most;
            }
        }
        problem.within(&mut self.c, if self.found { LOWER_AGAIN } else { LOWER })?;
        problem.improve(&mut self.c, if self.found { &GAPS[GAPS.len() - 1..] } else { &GAPS });
        self.found = true;
        Some(problem.law(&self.c))
    }
}

impl Cell {
    fn length(&self) -> f64 {
        self.to - self.from
    }
}
