//! Time along the path: pause, stop and resume without leaving it (J-33).

/// Path time and how fast it goes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathClock {
    /// Time since point 0 along the path, ms.
    pub time: f64,
    /// Path seconds per second, 0..1.
    pub rate: f64,
    /// Change of `rate`, 1/s.
    pub slope: f64,
    /// The rate that is wanted, 0 or 1.
    target: f64,
}

/// Length of a tick, s.
const DT: f64 = 0.001;
/// A slope in the wrong direction (a pause during a resume) is taken out this much faster than a ramp is rounded.
const REVERSAL: f64 = 8.0;

impl PathClock {
    /// At point 0 and at full speed.
    pub fn start() -> Self {
        Self { rate: 1.0, target: 1.0, ..Self::default() }
    }

    /// Standing at the present time, about to go.
    pub fn go(&mut self) {
        self.target = 1.0;
    }

    /// Slow down to standstill.
    pub fn halt(&mut self) {
        self.target = 0.0;
    }

    /// Not moving, and not about to.
    pub fn standing(&self) -> bool {
        self.rate == 0.0 && self.target == 0.0
    }

    /// Neither at full speed nor standing.
    pub fn ramping(&self) -> bool {
        self.rate != self.target
    }

    /// Moves on by one tick, at most to `end` (ms).
    pub fn advance(&mut self, end: f64) {
        self.time = (self.time + self.rate).min(end);
    }

    /// Changes the rate towards the wanted one: along an S of `ramp_ms` (parabola, line, parabola, a third each), or slower
    /// where the slope would leave `bounds`. The rate never goes the other way.
    pub fn change_rate(&mut self, ramp_ms: f64, bounds: (f64, f64)) {
        let distance = (self.target - self.rate).abs();
        if distance == 0.0 {
            self.slope = 0.0;
            return;
        }
        let length = ramp_ms.max(1.0) / 1000.0;
        // An S of this slope and curvature takes exactly `length` from 0 to 1.
        let (steepest, curvature) = (1.5 / length, 4.5 / (length * length));
        let direction = if self.target > self.rate { 1.0 } else { -1.0 };
        // In the direction of travel: slope now, and the slope from which the rest of the way just suffices to flatten out.
        let now = self.slope * direction;
        let round = curvature * DT;
        let flatten = round * (root(0.25 + 2.0 * distance / (round * DT)) - 0.5);
        let step = if now < 0.0 { REVERSAL * round } else { round };
        let wanted = flatten.min(steepest).min(now + step);
        let (low, high) = if direction > 0.0 { bounds } else { (-bounds.1, -bounds.0) };
        // Bounds that leave nothing, or only the other direction: keep the rate for now.
        let slope = if low <= high { wanted.min(high).max(low.min(wanted)) } else { 0.0 };
        let slope = if now < 0.0 { slope } else { slope.max(0.0) };
        self.slope = slope * direction;
        let rate = self.rate + self.slope * DT;
        if slope * DT >= distance || distance < 1e-9 {
            (self.rate, self.slope) = (self.target, 0.0);
        } else if !(0.0..=1.0).contains(&rate) {
            self.rate = rate.clamp(0.0, 1.0);
            self.slope = 0.0;
        } else {
            self.rate = rate;
        }
    }
}

/// Square root by Newton's method from above, which needs no library: enough for a slope, not for more.
fn root(x: f64) -> f64 {
    let mut y = 0.5 * (x + 1.0);
    for _ in 0..24 {
        y = 0.5 * (y + x / y);
    }
    y
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

    fn tick(clock: &mut PathClock, bounds: (f64, f64)) {
        clock.advance(1e9);
        clock.change_rate(200.0, bounds);
    }

    #[test]
    fn j33_full_speed_counts_whole_milliseconds() {
        let mut clock = PathClock::start();
        for k in 1..100_000 {
            tick(&mut clock, FREE);
            assert_eq!(clock.time, f64::from(k));
        }
    }

    #[test]
    fn j33_a_ramp_takes_its_length() {
        let mut clock = PathClock::start();
        clock.halt();
        let mut ticks = 0;
        while !clock.standing() {
            tick(&mut clock, FREE);
            ticks += 1;
        }
        assert!((195..=206).contains(&ticks), "{ticks}");
    }

    #[test]
    fn roots() {
        for x in [0.25, 1.0, 2.0, 1e3, 1e5, 1e6, 2e9] {
            assert!((root(x) / x.sqrt() - 1.0).abs() < 1e-12, "{x}");
        }
    }

    proptest! {
        /// Whatever is asked when: the rate stays within 0..1, never goes the wrong way for long, has no step, and the slope
        /// is the derivative of it.
        #[test]
        fn j33_the_ramp_is_smooth(switches in prop::collection::vec((1..400u32, any::<bool>()), 1..12), bound in 0.5..20.0f64) {
            let mut clock = PathClock::start();
            for (ticks, go) in switches {
                if go { clock.go() } else { clock.halt() }
                let mut wrong = 0.0;
                for _ in 0..ticks {
                    let before = clock;
                    tick(&mut clock, (-bound, bound));
                    let change = clock.rate - before.rate;
                    prop_assert!((0.0..=1.0).contains(&clock.rate));
                    prop_assert!(change.abs() <= 0.0076);
                    prop_assert!(clock.slope.abs() <= bound + 1e-9 || clock.slope.abs() <= before.slope.abs());
                    if clock.rate != 0.0 && clock.rate != 1.0 {
                        prop_assert!((change - clock.slope * DT).abs() < 1e-12);
                    }
                    prop_assert!((clock.slope - before.slope).abs() < 1.0, "{:?} {:?}", before, clock);
                    wrong += if go { (-change).max(0.0) } else { change.max(0.0) };
                    prop_assert!(clock.time >= before.time);
                }
                prop_assert!(wrong < 0.04, "{wrong} in the wrong direction");
            }
            clock.halt();
            for _ in 0..5_000 {
                tick(&mut clock, (-bound, bound));
            }
            prop_assert!(clock.standing());
        }
    }
}
