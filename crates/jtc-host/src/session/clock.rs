//! The time of statuses, which carry none of their own.

use std::time::Duration;

use jtc_wire::Status;

/// Longest that a status is taken to be on its way, s.
const DELAY_S: f64 = 0.1;
/// Least time between two statuses, s: those that a slow computer reads at once are samples of their own, not one.
const APART_S: f64 = 1e-6;

/// Time of statuses: the controller's own milliseconds while it follows the path, which no delay on the way to us can blur; the time
/// of arrival otherwise. Path time does not pass as fast at another speed (J-57): it never leaves that of arrival for long.
pub struct StatusClock {
    start: Duration,
    arrived: Duration,
    point: u32,
    /// Of the status before.
    time_s: Option<f64>,
}

impl StatusClock {
    /// A clock that begins at this time of the port, where the controller is at this point.
    pub fn begin(now: Duration, point: u32) -> Self {
        Self { start: now, arrived: now, point, time_s: None }
    }

    /// Time of the next status, which arrived at this time of the port: s since the clock began. It always goes on.
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
        // Delays do not blur it.
        assert_eq!(times(&[(40, 40), (95, 80), (121, 120), (160, 160)]), [0.04, 0.08, 0.12, 0.16]);
        // At half the speed, and while it stands.
        let slow: Vec<_> = (1..=100).map(|n| (40 * n, 20 * n as u32)).collect();
        assert!((times(&slow)[99] - 3.9).abs() < 1e-9);
        assert!((times(&[(40, 40), (80, 40), (1_080, 40)])[2] - 1.08).abs() < 1e-9);
        // Read at once, standing or ahead of our time: no two have one time, by which a recording would take them for one sample.
        let at_once = times(&[(40, 40), (200, 40), (200, 40), (200, 400), (200, 440), (200, 440)]);
        assert!(at_once.is_sorted_by(|a, b| a < b), "{at_once:?}");
    }

    proptest! {
        /// Whatever comes: statuses are missing, points begin anew, another trajectory is at another point.
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
