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
    ramp: Option<Ramp>,
}

/// A cubic from the rate and slope at its start to a steady rate.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Ramp {
    from: f64,
    slope: f64,
    to: f64,
    elapsed_ms: f64,
    length_ms: f64,
}

impl PathClock {
    /// At point 0 and at full speed.
    pub fn start() -> Self {
        Self { rate: 1.0, ..Self::default() }
    }

    /// Go to `rate` (0 or 1) within `length_ms`.
    pub fn ramp_to(&mut self, rate: f64, length_ms: f64) {
        self.ramp = Some(Ramp {
            from: self.rate,
            slope: self.slope,
            to: rate,
            elapsed_ms: 0.0,
            length_ms: length_ms.max(1.0),
        });
    }

    /// Not moving, and not about to.
    pub fn standing(&self) -> bool {
        self.rate == 0.0 && self.ramp.is_none()
    }

    /// One tick.
    pub fn advance(&mut self) {
        let before = self.rate;
        if let Some(ramp) = &mut self.ramp {
            ramp.elapsed_ms += 1.0;
            if ramp.elapsed_ms >= ramp.length_ms {
                (self.rate, self.slope) = (ramp.to, 0.0);
                self.ramp = None;
            } else {
                let length = ramp.length_ms / 1000.0;
                let u = ramp.elapsed_ms / ramp.length_ms;
                let rise = u * u * (3.0 - 2.0 * u);
                let bump = u * (1.0 - u) * (1.0 - u);
                // A slope at the start may carry the cubic a little beyond its ends.
                self.rate =
                    (ramp.from + (ramp.to - ramp.from) * rise + ramp.slope * length * bump).clamp(0.0, 1.0);
                self.slope = (ramp.to - ramp.from) * 6.0 * u * (1.0 - u) / length
                    + ramp.slope * (1.0 - u) * (1.0 - 3.0 * u);
            }
        }
        self.time += 0.5 * (before + self.rate);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn j33_full_speed_counts_whole_milliseconds() {
        let mut clock = PathClock::start();
        for k in 1..100_000 {
            clock.advance();
            assert_eq!(clock.time, f64::from(k));
        }
    }

    proptest! {
        /// Whatever is asked when: the rate stays within 0..1, has no step, and its slope is the derivative of it.
        #[test]
        fn j33_the_ramp_is_smooth(switches in prop::collection::vec((1..400u32, any::<bool>()), 1..12)) {
            let mut clock = PathClock::start();
            for (ticks, go) in switches {
                clock.ramp_to(if go { 1.0 } else { 0.0 }, 200.0);
                for _ in 0..ticks {
                    let before = clock;
                    clock.advance();
                    prop_assert!((0.0..=1.0).contains(&clock.rate));
                    prop_assert!((clock.rate - before.rate).abs() < 0.012, "{:?} {:?}", before, clock);
                    prop_assert!(clock.time >= before.time);
                }
                if ticks >= 200 {
                    prop_assert_eq!(clock.rate, if go { 1.0 } else { 0.0 });
                    prop_assert_eq!(clock.slope, 0.0);
                    prop_assert_eq!(clock.standing(), !go);
                }
            }
        }
    }
}
