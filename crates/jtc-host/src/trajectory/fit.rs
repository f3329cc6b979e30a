//! Fit of a trajectory (points at a fixed step) to samples at any times. The fit derives missing velocities and accelerations.
//!
//! The units are s, rad, rad/s and rad/s², as in a trajectory, and the joints are in order from base to wrist.
//!
//! # Derived values
//!
//! - **Positions only**: a cubic spline through the positions (continuous position, velocity and acceleration) supplies
//!   velocities and accelerations. The velocity at the first and at the last sample is 0. The acceleration at these samples
//!   is not 0, so the motion begins and ends with a step in acceleration.
//! - **Positions and velocities**: for each joint, a cubic spline through the velocities supplies the accelerations. Therefore rounded
//!   positions have no effect on the accelerations. The spline is natural, so the jerk is 0 at its ends. The velocities are used unchanged,
//!   also at the ends.
//! - **All three channels**: no values are derived.
//!
//! # Time
//!
//! If the times of the samples are on a grid of whole milliseconds, the samples become the points unchanged. The grid has a step of 1 to
//! 1000 ms, and the times may deviate from the grid by up to 50 µs. All other samples are resampled to a step of 10 ms. If the controller
//! cannot store the points of a 10 ms step, the step is longer. Between two samples, the trajectory follows a quintic with the positions,
//! velocities and accelerations of these samples. The last point of the trajectory is the last sample. If the duration is not a whole
//! number of steps, the last part of the motion is stretched to a whole step.
//!
//! # Overshoot
//!
//! A spline passes through every sample. Between two samples, the spline may leave the interval between the positions of these samples.
//! After a step in position, the spline overshoots by about 10 % of the step if the samples are equally spaced. The fit does not limit this
//! overshoot. [`Fitted::overshoot`] reports the overshoot of each joint, and [`CheckedTrajectory::check`](crate::CheckedTrajectory::check)
//! checks the fitted trajectory, also between the points. With denser samples near a change of direction the overshoot is small.
//!
//! # Example
//!
//! ```
//! use jtc_host::trajectory::fit::Samples;
//!
//! // Joint 1 moves to 0.5 rad in two seconds, through a position at 0.8 s.
//! let position = [0.0, 0.2, 0.5].map(|q| [q, 0.0, 0.0, 0.0, 0.0, 0.0]).to_vec();
//! let fitted = Samples { times: vec![0.0, 0.8, 2.0], position, ..Samples::default() }.fit()?;
//! assert_eq!((fitted.trajectory.step_ms, fitted.trajectory.points.len()), (10, 201));
//! assert!(fitted.trajectory.points[200].velocity[0].abs() < 1e-9);
//! for note in &fitted.notes {
//!     println!("{note}"); // description of the derived and resampled values
//! }
//! # Ok::<(), jtc_host::trajectory::fit::FitError>(())
//! ```

use std::cmp::Ordering;

use jtc_core::{JOINTS, POINTS_MAX};

use super::overshoot::{Overshoot, overshoots};
use super::spline::{column, quintic, spline_bends, spline_slopes};
use super::{Point, Trajectory};

/// Samples of a motion, as read from a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// Times, s. The times strictly increase. The first time may differ from 0.
    pub times: Vec<f64>,
    /// Positions in rad, one row for each time.
    pub position: Vec<[f64; JOINTS]>,
    /// Velocities in rad/s, one row for each time. If `None`, the velocities are derived.
    pub velocity: Option<Vec<[f64; JOINTS]>>,
    /// Accelerations in rad/s², one row for each time. If `None`, the accelerations are derived. If the velocities are `None`, the
    /// accelerations are ignored.
    pub acceleration: Option<Vec<[f64; JOINTS]>>,
}

/// A trajectory that was fitted to samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// Points at a fixed step.
    pub trajectory: Trajectory,
    /// Messages about the derived and resampled values.
    pub notes: Vec<String>,
    /// Overshoot of each joint whose spline leaves the interval between two samples. The list is empty if the samples have velocities.
    pub overshoot: Vec<Overshoot>,
}

/// Step for resampling irregular files, ms.
const STEP_MS: u16 = 10;
/// Maximum deviation of a time from the grid, s.
const REGULAR: f64 = 50e-6;
/// Maximum deviation of a time from the mean step, if the times were rounded to 1 ms, s.
const ROUNDED: f64 = 1.1e-3;
/// Shortest step of a trajectory, s.
const STEP_MIN: f64 = 1e-3;
/// Longest step of a trajectory that is not resampled, s.
const STEP_MAX: f64 = 1.0;
/// Longest duration that is resampled, s. With a longer duration, the trajectory would have more points than the
/// controller can store, at any useful step.
const DURATION_MAX: f64 = 86_400.0;

/// Reason why no trajectory can be fitted to the samples.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FitError {
    /// The number of samples in a channel differs from the number of times.
    #[error("{samples} samples of the {channel}, expected {times} for the times")]
    Count {
        /// "position", "velocity" or "acceleration".
        channel: &'static str,
        /// Number of samples in the channel.
        samples: usize,
        /// Number of times.
        times: usize,
    },
    /// A value of this sample (from 0) is not a finite number.
    #[error("sample {0}: a number is not finite")]
    NotFinite(usize),
    /// The time of this sample (from 0) is not later than the time of the previous sample.
    #[error("sample {0}: its time is not after the time of the previous sample")]
    Time(usize),
    /// The samples last longer than one day. The value is the duration of the samples, s.
    #[error("the duration {0} s is longer than a day")]
    Duration(f64),
}

impl Samples {
    /// Returns the trajectory through the samples. Without samples, the trajectory is empty and does not pass a check.
    ///
    /// # Errors
    ///
    /// Returns [`FitError`] for channels of different length, values that are not finite, times that do not increase, or a duration of more
    /// than one day.
    pub fn fit(self) -> Result<Fitted, FitError> {
        self.whole()?;
        let mut notes = Vec::new();
        if let Some(i) =
            self.times.windows(2).position(|w| w[1].partial_cmp(&w[0]) != Some(Ordering::Greater))
        {
            return Err(FitError::Time(i + 1));
        }
        let duration = self.times.last().unwrap_or(&0.0) - self.times.first().unwrap_or(&0.0);
        if !(0.0..=DURATION_MAX).contains(&duration) {
            return Err(FitError::Duration(duration));
        }
        if self.velocity.is_none() {
            notes.push(
                "velocities and accelerations are derived by a spline through the positions".to_owned(),
            );
        } else if self.acceleration.is_none() {
            notes.push("accelerations are derived by a spline through the velocities".to_owned());
        }
        let points = self.points();
        if points.len() == 1 {
            notes.push("a single point is a pose, not a motion".to_owned());
        }
        let overshoot = if self.velocity.is_none() { overshoots(&self.times, &points) } else { Vec::new() };
        if let Some(step_ms) = self.regular_step() {
            return Ok(Fitted { trajectory: Trajectory { step_ms, points }, notes, overshoot });
        }
        let step_ms = resampled_step(duration);
        notes.push(format!("{}: resampled to {step_ms} ms", self.why_resampled()));
        let points = self.resample(&points, step_ms);
        Ok(Fitted { trajectory: Trajectory { step_ms, points }, notes, overshoot })
    }

    /// Checks that each channel has as many samples as there are times, and that all values are finite.
    fn whole(&self) -> Result<(), FitError> {
        let times = self.times.len();
        let channels = [
            ("position", Some(&self.position)),
            ("velocity", self.velocity.as_ref()),
            ("acceleration", self.acceleration.as_ref()),
        ];
        for (channel, rows) in channels.into_iter().filter_map(|(name, rows)| Some((name, rows?))) {
            if rows.len() != times {
                return Err(FitError::Count { channel, samples: rows.len(), times });
            }
            if let Some(i) = rows.iter().position(|row| row.iter().any(|v| !v.is_finite())) {
                return Err(FitError::NotFinite(i));
            }
        }
        self.times.iter().position(|t| !t.is_finite()).map_or(Ok(()), |i| Err(FitError::NotFinite(i)))
    }

    /// Returns the step if all times lie on a grid of whole milliseconds.
    fn regular_step(&self) -> Option<u16> {
        let [first, second, ..] = self.times[..] else { return Some(STEP_MS) };
        let step = ((second - first) * 1e3).round();
        if !(STEP_MIN * 1e3..=STEP_MAX * 1e3).contains(&step) {
            return None;
        }
        let regular = |(i, t): (usize, &f64)| (t - first - i as f64 * step * 1e-3).abs() < REGULAR;
        self.times.iter().enumerate().all(regular).then_some(step as u16)
    }

    /// Returns the reason why the times are not the times of a trajectory.
    fn why_resampled(&self) -> String {
        let (first, count) = (self.times[0], self.times.len());
        let step = (self.times[count - 1] - first) / (count - 1) as f64;
        // Many programs write three decimals, so that the times of a regular step are rounded to 1 ms.
        let even = |(i, t): (usize, &f64)| (t - first - i as f64 * step).abs() < ROUNDED;
        if step < STEP_MIN || !self.times.iter().enumerate().all(even) {
            "times are irregular".to_owned()
        } else if step > STEP_MAX {
            format!("the step of {} s is longer than {STEP_MAX} s", figure(step))
        } else {
            format!("the step of {} ms is not whole milliseconds", figure(step * 1e3))
        }
    }

    /// Returns the samples with their velocities and accelerations.
    fn points(&self) -> Vec<Point> {
        let mut points: Vec<Point> =
            self.position.iter().map(|p| Point { position: *p, ..Point::default() }).collect();
        for j in 0..JOINTS {
            let position = column(&self.position, j);
            let slopes = match &self.velocity {
                Some(v) => column(v, j),
                None => spline_slopes(&self.times, &position, true),
            };
            let bends = match (&self.acceleration, &self.velocity) {
                (Some(a), Some(_)) => column(a, j),
                (None, Some(_)) => spline_slopes(&self.times, &slopes, false),
                (_, None) => spline_bends(&self.times, &position, &slopes),
            };
            for (i, point) in points.iter_mut().enumerate() {
                point.velocity[j] = slopes[i];
                point.acceleration[j] = bends[i];
            }
        }
        points
    }

    fn resample(&self, points: &[Point], step_ms: u16) -> Vec<Point> {
        let first = self.times[0];
        let duration = self.times[self.times.len() - 1] - first;
        let step = f64::from(step_ms) * 1e-3;
        let count = (duration / step).ceil() as usize + 1;
        let mut out = Vec::with_capacity(count);
        let mut i = 0;
        for k in 0..count {
            let t = first + (k as f64 * step).min(duration);
            while i + 2 < points.len() && self.times[i + 1] <= t {
                i += 1;
            }
            let h = self.times[i + 1] - self.times[i];
            out.push(quintic(&points[i], &points[i + 1], h, (t - self.times[i]) / h));
        }
        out
    }
}

/// Formats a number with at most three decimals.
fn figure(value: f64) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Returns 10 ms, or a longer step if a step of 10 ms would result in too many points.
fn resampled_step(duration: f64) -> u16 {
    let fits = (duration * 1e3 / (POINTS_MAX - 1) as f64).ceil();
    fits.clamp(f64::from(STEP_MS), 60_000.0) as u16
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns position, velocity and acceleration of a smooth move from rest to rest.
    fn shape(t: f64) -> (f64, f64, f64) {
        let (u, d) = (t / 2.0, 2.0);
        (
            u * u * u * (10.0 - 15.0 * u + 6.0 * u * u),
            30.0 * u * u * (1.0 - u) * (1.0 - u) / d,
            60.0 * u * (1.0 - 3.0 * u + 2.0 * u * u) / (d * d),
        )
    }

    fn samples(times: Vec<f64>, velocity: bool) -> Samples {
        Samples {
            position: times.iter().map(|t| [shape(*t).0; 6]).collect(),
            velocity: velocity.then(|| times.iter().map(|t| [shape(*t).1; 6]).collect()),
            acceleration: None,
            times,
        }
    }

    fn agrees(fitted: &Fitted, position: f64, velocity: f64, acceleration: f64) {
        let step = f64::from(fitted.trajectory.step_ms) * 1e-3;
        for (i, p) in fitted.trajectory.points.iter().enumerate() {
            let (q, v, a) = shape((i as f64 * step).min(2.0));
            assert!((p.position[2] - q).abs() < position, "point {i}: {} for {q}", p.position[2]);
            assert!((p.velocity[2] - v).abs() < velocity, "point {i}: {} for {v}", p.velocity[2]);
            assert!((p.acceleration[2] - a).abs() < acceleration, "point {i}: {} for {a}", p.acceleration[2]);
        }
    }

    #[test]
    fn derived_channels_are_those_of_the_motion() {
        let times: Vec<f64> = (0..=200).map(|i| f64::from(i) * 0.01).collect();
        let fitted = samples(times.clone(), false).fit().unwrap();
        assert_eq!((fitted.trajectory.step_ms, fitted.trajectory.points.len()), (10, 201));
        agrees(&fitted, 1e-12, 1e-5, 0.08);
        agrees(&samples(times, true).fit().unwrap(), 1e-12, 1e-12, 0.08);
    }

    #[test]
    fn irregular_times_are_resampled() {
        let times: Vec<f64> = (0..=97).map(|i| 2.0 * (f64::from(i) / 97.0).powf(1.1)).collect();
        let fitted = samples(times, true).fit().unwrap();
        assert_eq!((fitted.trajectory.step_ms, fitted.trajectory.points.len()), (10, 201));
        agrees(&fitted, 1e-4, 5e-3, 0.4);
        assert_eq!(fitted.notes.len(), 2);
    }

    /// A regular step is not called irregular. The note contains the step, and the reason why the points are resampled.
    #[test]
    fn a_note_names_the_reason_for_resampling() {
        let note = |step: f64, digits: f64| {
            let times = (0..20).map(|i| (f64::from(i) * step * digits).round() / digits).collect();
            samples(times, true).fit().unwrap().notes.pop().unwrap()
        };
        assert_eq!(note(2.0, 1e9), "the step of 2 s is longer than 1 s: resampled to 10 ms");
        assert_eq!(
            note(1.0 / 120.0, 1e9),
            "the step of 8.333 ms is not whole milliseconds: resampled to 10 ms"
        );
        assert!(note(1.0 / 120.0, 1e3).contains("ms is not whole milliseconds"));
        let irregular = samples(vec![0.0, 0.013, 0.05, 0.07], true).fit().unwrap();
        assert_eq!(irregular.notes[1], "times are irregular: resampled to 10 ms");
    }

    #[test]
    fn long_irregular_files_get_a_longer_step() {
        assert_eq!(resampled_step(10.0), 10);
        assert_eq!(resampled_step(1200.0), 101);
    }

    /// The overshoot has the documented size. Joint 1 steps by 1 rad between two of ten equally spaced samples.
    #[test]
    fn a_spline_swings_over_after_a_step() {
        let position: Vec<_> = (0..10).map(|i| [f64::from(u8::from(i >= 5)); 6]).collect();
        let times = (0..10).map(|i| f64::from(i) * 0.1).collect();
        let fitted = Samples { times, position, ..Samples::default() }.fit().unwrap();
        let points = &fitted.trajectory.points;
        let between = |w: &[Point]| {
            (0..=20).map(|k| quintic(&w[0], &w[1], 0.1, f64::from(k) / 20.0).position[0]).fold(0.0, f64::max)
        };
        let over = points.windows(2).map(between).fold(0.0, f64::max) - 1.0;
        assert!((0.08..0.12).contains(&over), "{over}");
        // The velocity at both ends is 0. The acceleration at an end is not 0 if the position begins to change there,
        // as in `bent`.
        assert_eq!((points[0].velocity, points[9].velocity), ([0.0; 6], [0.0; 6]));
        let bent = Samples {
            times: vec![0.0, 0.5, 1.0],
            position: vec![[0.0; 6], [0.2; 6], [0.5; 6]],
            ..Samples::default()
        };
        assert!(bent.fit().unwrap().trajectory.points[0].acceleration[0].abs() > 1.0);
    }

    #[test]
    fn channels_that_do_not_belong_together_are_refused() {
        let good = samples(vec![0.0, 0.01, 0.02], true);
        let mut short = good.clone();
        short.position.pop();
        assert_eq!(short.fit(), Err(FitError::Count { channel: "position", samples: 2, times: 3 }));
        let mut long = good.clone();
        long.velocity.as_mut().unwrap().push([0.0; 6]);
        assert_eq!(long.fit(), Err(FitError::Count { channel: "velocity", samples: 4, times: 3 }));
        let mut none = good.clone();
        none.acceleration = Some(vec![[0.0; 6], [f64::INFINITY; 6], [0.0; 6]]);
        assert_eq!(none.fit(), Err(FitError::NotFinite(1)));
        let never = Samples { times: vec![f64::NAN], position: vec![[0.0; 6]], ..Samples::default() };
        assert_eq!(never.fit(), Err(FitError::NotFinite(0)));
        assert_eq!(Samples::default().fit().unwrap().trajectory.points.len(), 0);
        // Accelerations without velocities are ignored, because they would contradict the derived velocities.
        let alone = Samples { velocity: None, acceleration: Some(vec![[9.0; 6]; 3]), ..good };
        assert!(alone.fit().unwrap().trajectory.points.iter().all(|p| p.acceleration[0] != 9.0));
    }

    #[test]
    fn time_must_increase() {
        let Err(e) = samples(vec![0.0, 0.01, 0.01], false).fit() else { panic!("accepted") };
        assert_eq!(e, FitError::Time(2));
    }
}
