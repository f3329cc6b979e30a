//! Time laws. A time law is the parameter of a path section as a function of time.

/// Part of a time law in which the third derivative of the parameter is constant.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Phase {
    /// Start of the phase, s.
    pub start: f64,
    /// Length of the phase, s.
    pub length: f64,
    /// Parameter and its first three time derivatives, at the start of the phase.
    pub s: f64,
    pub speed: f64,
    pub acceleration: f64,
    pub jerk: f64,
}

impl Phase {
    /// Returns the parameter and its first two derivatives, `t` seconds after the start of the phase.
    pub(crate) fn at(&self, t: f64) -> (f64, f64, f64) {
        let (v, a, j) = (self.speed, self.acceleration, self.jerk);
        (self.s + t * (v + t * (0.5 * a + t * j / 6.0)), v + t * (a + 0.5 * t * j), a + t * j)
    }
}

/// Time law of a section of a path. The path parameter begins at 0 and never decreases.
#[derive(Clone, Debug)]
pub(crate) struct Law {
    pub phases: Vec<Phase>,
    /// Value of the path parameter at the end of the law.
    pub end: f64,
    /// `true` if the law begins and ends at rest.
    pub rests: bool,
}

impl Law {
    /// Creates the law along the vertices (parameter, squared speed). Between two vertices the squared speed is linear
    /// in the parameter, so the acceleration is constant.
    pub(crate) fn of_vertices(vertices: &[(f64, f64)]) -> Self {
        let mut phases = Vec::with_capacity(vertices.len());
        let mut start = 0.0;
        for pair in vertices.windows(2) {
            let [(s, a), (to, b)] = [pair[0], pair[1]];
            let (v, w) = (a.max(0.0).sqrt(), b.max(0.0).sqrt());
            if to <= s || v + w <= 0.0 {
                continue;
            }
            let length = 2.0 * (to - s) / (v + w);
            phases.push(Phase { start, length, s, speed: v, acceleration: (w - v) / length, jerk: 0.0 });
            start += length;
        }
        Self { phases, end: vertices.last().map_or(0.0, |v| v.0), rests: true }
    }

    /// Returns the duration, s.
    pub(crate) fn duration(&self) -> f64 {
        self.phases.last().map_or(0.0, |p| p.start + p.length)
    }

    /// Returns the parameter and its first two derivatives at `t`.
    pub(crate) fn at(&self, t: f64) -> (f64, f64, f64) {
        let moving = |speed: f64| if self.rests { 0.0 } else { speed };
        if t <= 0.0 {
            return self.phases.first().map_or((0.0, 0.0, 0.0), |p| (0.0, moving(p.speed), p.acceleration));
        }
        if t >= self.duration() {
            let (_, speed, acceleration) = self.phases.last().map_or((0.0, 0.0, 0.0), |p| p.at(p.length));
            return (self.end, moving(speed), acceleration);
        }
        let phase = &self.phases[self.phases.partition_point(|p| p.start <= t).saturating_sub(1)];
        let (s, v, a) = phase.at(t - phase.start);
        (s.clamp(0.0, self.end), v.max(0.0), a)
    }

    /// Like [`Law::at`], but if the acceleration jumps at `t`, evaluates the law just after the jump (`after` = 1) or
    /// just before the jump (−1).
    pub(crate) fn beside(&self, t: f64, after: f64) -> (f64, f64, f64) {
        const NEAR: f64 = 1e-10;
        let (s, speed, _) = self.at(t);
        let inside = (t + after * NEAR).clamp(NEAR, self.duration() - NEAR);
        (s, speed, self.at(inside).2)
    }

    /// Returns the time at which the parameter is `s`.
    pub(crate) fn time_of(&self, s: f64) -> f64 {
        if s <= 0.0 {
            return 0.0;
        }
        if s >= self.end {
            return self.duration();
        }
        let phase = &self.phases[self.phases.partition_point(|p| p.s <= s).saturating_sub(1)];
        let (mut low, mut high) = (0.0, phase.length);
        let mut t = 0.5 * high;
        // Newton's method finds the time between two bounds.
        for _ in 0..60 {
            let (at, speed, _) = phase.at(t);
            if at < s {
                low = t
            } else {
                high = t
            }
            let next = t - (at - s) / speed;
            let next = if next > low && next < high { next } else { 0.5 * (low + high) };
            if (next - t).abs() < 1e-13 * self.duration() {
                break;
            }
            t = next;
        }
        phase.start + t
    }

    /// Returns the law averaged over a window of `window` seconds. Each jump of the acceleration becomes a ramp as long
    /// as the window, and the duration of the law increases by `window` seconds. The law must be a law without a jerk
    /// limit.
    pub(crate) fn averaged(&self, window: f64) -> Self {
        let ends: Vec<f64> = self.phases.iter().map(|p| p.start).chain([self.duration()]).collect();
        let mut times: Vec<f64> = ends.iter().copied().chain(ends.iter().map(|t| t + window)).collect();
        times.sort_by(f64::total_cmp);
        let mut phases: Vec<Phase> = Vec::with_capacity(times.len());
        let mut s = 0.0;
        for pair in times.windows(2) {
            let (start, length) = (pair[0], pair[1] - pair[0]);
            if length <= 0.0 {
                continue;
            }
            let now = |t: f64| if t >= self.duration() { (self.end, 0.0, 0.0) } else { self.at(t) };
            let (head, tail) = (now(start), now(start - window));
            let (speed, acceleration) = ((head.0 - tail.0) / window, (head.1 - tail.1) / window);
            // The acceleration can jump at the ends of the phase, so it is evaluated in the middle.
            let middle = start + 0.5 * length;
            let inside = |t: f64| if t <= 0.0 { 0.0 } else { now(t).2 };
            let jerk = (inside(middle) - inside(middle - window)) / window;
            let phase = Phase { start, length, s, speed, acceleration, jerk };
            s = phase.at(length).0;
            phases.push(phase);
        }
        // The remaining rounding error is distributed over all phases.
        let factor = if s > 0.0 { self.end / s } else { 1.0 };
        for phase in &mut phases {
            phase.s *= factor;
        }
        Self { phases, end: self.end, rests: true }
    }
}
