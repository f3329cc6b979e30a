//! Computation of times for statuses, which contain no time stamp.

use std::time::Duration;

use jtc_wire::Status;

/// Maximum transmission delay of a status that the clock assumes, s.
const DELAY_S: f64 = 0.1;
/// Minimum difference between the times of two statuses, s. With this difference, statuses that a slow computer reads together have
/// different times.
const APART_S: f64 = 1e-6;

/// Clock for statuses. While the arm moves along the path, the clock uses the millisecond count of the controller,
/// which has no transmission jitter. At all other times, it uses the arrival time of the status. At a reduced speed,
/// the path time is slower than real time (J-57). Therefore the difference between the clock and the arrival time is
/// limited to 0.1 s.
pub struct StatusClock {
    start: Duration,
    arrived: Duration,
    point: u32,
    /// Time of the previous status.
    time_s: Option<f64>,
}

impl StatusClock {
    /// Starts a clock at the port's time `now`, with the controller at the path point `point`.
    pub fn begin(now: Duration, point: u32) -> Self {
        Self { start: now, arrived: now, point, time_s: None }
    }

    /// Returns the time of the next status, in seconds since the start of the clock. `now` is the time of the port at which
    /// the status arrived. The returned times always increase.
    pub fn at(&mut self, now: Duration, status: &Status) -> f64 {
        let moved = f64::from(status.point.saturating_sub(self.point)) * 1e-3;
        let waited = now.saturating_sub(self.arrived).as_secs_f64();
        let time_s = self.time_s.unwrap_or_default() + if moved > 0.0 { moved } else { waited };
        let passed = now.saturating_sub(self.start).as_secs_f64();
        let near = time_s.clamp((passed - DELAY_S).max(0.0), passed + DELAY_S);
        let time_s = self.time_s.map_or(near, |before| near.max(before + APART_S));
        (self.arrived, self.point, self.time_s) = (now, status.point, Some(time_s));
        time_s
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn times(statuses: &[(u64, u32)]) -> Vec<f64> {
        let mut clock = StatusClock::begin(Duration::from_secs(5), 0);
        let status = |point| Status { point, ..Status::default() };
        statuses
            .iter()
            .map(|(ms, point)| clock.at(Duration::from_millis(5000 + ms), &status(*point)))
            .collect()
    }

    #[test]
    fn j57_time_is_the_controllers_at_full_speed_and_never_far_from_ours() {
        // The statuses arrive with different delays, but the times of the clock must be exactly the path times.
        assert_eq!(times(&[(40, 40), (95, 80), (121, 120), (160, 160)]), [0.04, 0.08, 0.12, 0.16]);
        // At half of the full speed, the clock lags the arrival time by at most 0.1 s. After a standstill, it equals
        // the arrival time.
        let slow: Vec<_> = (1..=100).map(|n| (40 * n, 20 * n as u32)).collect();
        assert!((times(&slow)[99] - 3.9).abs() < 1e-9);
        assert!((times(&[(40, 40), (80, 40), (1_080, 40)])[2] - 1.08).abs() < 1e-9);
        // Several statuses are read at once, either from an arm at rest or from a controller that is ahead of the
        // host's time. Their times must differ, because a recording merges samples with equal times.
        let at_once = times(&[(40, 40), (200, 40), (200, 40), (200, 400), (200, 440), (200, 440)]);
        assert!(at_once.is_sorted_by(|a, b| a < b), "{at_once:?}");
    }

    proptest! {
        /// For random statuses, the times increase and stay within 0.1 s of the arrival times. Statuses may be missing, and the point index
        /// may jump, for example because another trajectory begins.
        #[test]
        fn time_goes_on_and_is_that_of_arrival_to_a_tenth_of_a_second(
            begins_at in any::<u32>(),
            statuses in prop::collection::vec((prop_oneof![Just(0_u64), 0_u64..3_000], any::<u32>()), 1..50),
        ) {
            let mut clock = StatusClock::begin(Duration::ZERO, begins_at);
            let (mut arrived, mut last) = (Duration::ZERO, -1.0);
            for (after, point) in statuses {
                arrived += Duration::from_millis(after);
                let time = clock.at(arrived, &Status { point, ..Status::default() });
                prop_assert!(time > last && (time - arrived.as_secs_f64()).abs() <= DELAY_S + 50.0 * APART_S);
                last = time;
            }
        }
    }
}
