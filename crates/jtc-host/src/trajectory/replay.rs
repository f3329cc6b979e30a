//! Extraction of a trajectory from a recording.
//!
//! A sample of an execution contains the path time of the controller in milliseconds. Therefore the path can be reconstructed even if the
//! line, the host or pauses make the times of the samples irregular.

use std::path::Path;

use jtc_core::JOINTS;

use jtc_wire::{ControllerState, TrajectoryState};

use super::fit::Samples;
use super::{Form, Loaded, Point};
use crate::file::{FileError, Place};
use crate::recording::{NothingLeft, Recording, RecordingError};
use crate::sample::Sample;

/// Spacing of the points to which a dense path is reduced, ms. A path is dense if all its points are closer together.
/// The points of other paths are not reduced.
const GRID_MS: u32 = 10;

/// Spacing of measured positions, s. At a smaller spacing, encoder noise would look like a motion.
const MEASURED_S: f64 = 0.04;
/// Maximum movement of an arm that is considered at rest, rad.
const STILL: f64 = 0.002;

/// First columns in the header of a recording as CSV.
const CSV_HEADER: &str = "time_s,state,tes,point,";

/// Returns `true` if the file is a recording of an execution or a motion by hand. The function recognises MCAP by the file name and CSV by
/// the header.
pub(super) fn is_recording(path: &Path, text: Option<&str>) -> bool {
    let mcap = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap"));
    mcap || text.is_some_and(|text| text.trim_start_matches('\u{feff}').starts_with(CSV_HEADER))
}

/// Reads a recording and extracts its last execution.
pub(super) fn load(path: &Path) -> Result<Loaded, FileError> {
    let recording = read(path)?;
    if let Some(mut whole) = held(&recording) {
        if let Some(cut) = recording.cut {
            whole.notes.insert(0, format!("{}: {cut}", path.display()));
        }
        return Ok(whole);
    }
    let mut loaded = executed(&recording.samples).map_err(|e| match (e, &recording.cut) {
        (FileError::At { path, place, problem }, Some(cut)) => {
            FileError::At { path, place, problem: format!("{problem}; {cut}") }
        }
        (e, _) => e,
    });
    if let (Ok(loaded), Some(cut)) = (&mut loaded, recording.cut) {
        loaded.notes.insert(0, format!("{}: {cut}", path.display()));
    }
    loaded.map_err(|e| e.in_file(path))
}

/// Returns the commanded trajectory that is stored in the recording of a run. This trajectory is complete, even if the
/// run was interrupted.
fn held(recording: &Recording) -> Option<Loaded> {
    let whole = recording.info.as_ref()?.commanded.as_deref()?;
    let note = match recording.resume_point(whole) {
        Ok(broken) => format!(
            "the whole trajectory of the recording; the run reached {:.3} s of its {:.3} s, and `jtc traj continue` runs only the remainder",
            f64::from(broken.last_ms) * 1e-3,
            whole.duration_s()
        ),
        Err(NothingLeft::Finished) => "the trajectory of the recording, at the speed of the run".to_owned(),
        Err(_) => "the trajectory of the recording".to_owned(),
    };
    Some(Loaded {
        trajectory: whole.clone(),
        form: Form::Recording,
        notes: vec![note],
        overshoot: Vec::new(),
        units_named: true,
    })
}

fn read(path: &Path) -> Result<Recording, FileError> {
    Recording::read(path).map_err(|e| match e {
        RecordingError::Io { path, source } => FileError::Io { path, source },
        // The error message may begin with the name of the file, which is removed here.
        other => {
            let words = other.to_string();
            let name = path.display().to_string();
            let problem =
                words.strip_prefix(&name).map_or(words.as_str(), |w| w.trim_start_matches([':', ',', ' ']));
            FileError::form(problem.to_owned()).in_file(path)
        }
    })
}

/// Reads a recording and extracts the measured motion. The result is the last teaching. If the recording has no teaching, the result is the
/// last execution.
pub(super) fn load_measured(path: &Path) -> Result<Loaded, FileError> {
    let recording = read(path)?;
    let mut loaded = measured(&recording.samples).map_err(|e| e.in_file(path))?;
    if let Some(cut) = recording.cut {
        loaded.notes.insert(0, format!("{}: {cut}", path.display()));
    }
    Ok(loaded)
}

/// Returns the last measured motion, without the standstill before and after the motion. The result is a motion by
/// hand, if there is one. Without a motion by hand, the result is a motion along a trajectory.
fn measured(samples: &[Sample]) -> Result<Loaded, FileError> {
    let by_hand = samples.iter().any(|s| s.state == ControllerState::Teaching);
    let timed = if by_hand { led(samples) } else { followed(samples) };
    let mut path = Samples::default();
    for (time_s, sample) in timed {
        let position = sample.joints.map(|joint| joint.position);
        let due = path.times.last().is_none_or(|t| time_s - t >= MEASURED_S - 1e-6);
        if due && position.iter().all(|q| q.is_finite()) {
            path.times.push(time_s);
            path.position.push(position);
        }
    }
    let moved = |a: &[f64; JOINTS], b: &[f64; JOINTS]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > STILL);
    let first = path.position.first().and_then(|rest| path.position.iter().position(|q| moved(q, rest)));
    let last = path.position.last().and_then(|rest| path.position.iter().rposition(|q| moved(q, rest)));
    let (Some(first), Some(last)) = (first, last) else {
        let problem = "the recording contains no motion by hand and no execution in which the arm moves";
        return Err(FileError::at(Place::default(), problem));
    };
    // At each end of the motion, one position at rest is kept.
    let kept = first.saturating_sub(1)..(last + 2).min(path.times.len());
    let (times, position) = (path.times[kept.clone()].to_vec(), path.position[kept].to_vec());
    let start = times.first().copied().unwrap_or(0.0);
    let times = times.into_iter().map(|t| ((t - start) * 1e3).round() * 1e-3).collect();
    let fitted = Samples { times, position, ..Samples::default() }.fit();
    let fitted = fitted.map_err(|e| FileError::form(e.to_string()))?;
    let what = if by_hand { "teaching" } else { "execution" };
    let mut loaded = Loaded::fitted(fitted, Form::Recording);
    loaded.notes.insert(0, format!("the last {what} in the recording, as measured"));
    Ok(loaded)
}

/// Returns the last motion by hand. The times are the times of the recording.
fn led(samples: &[Sample]) -> Vec<(f64, &Sample)> {
    let taught = |s: &Sample| s.state == ControllerState::Teaching;
    let end = samples.iter().rposition(taught).map_or(0, |i| i + 1);
    let begin = samples[..end].iter().rposition(|s| !taught(s)).map_or(0, |i| i + 1);
    samples[begin..end].iter().map(|s| (s.time_s, s)).collect()
}

/// Returns the last execution, including its pauses. The times are path times, because the host times have jitter and
/// have no meaning in a simulation with virtual time. The last sample is the pose in which the arm came to rest.
fn followed(samples: &[Sample]) -> Vec<(f64, &Sample)> {
    let on_path = |s: &Sample| s.trajectory.is_in(&[TrajectoryState::Execute, TrajectoryState::Pause]);
    let end = samples.iter().rposition(on_path).map_or(0, |i| i + 1);
    let mut begin = end;
    while begin > 0
        && on_path(&samples[begin - 1])
        && (begin == end || samples[begin - 1].point <= samples[begin].point)
    {
        begin -= 1;
    }
    let seconds = |s: &Sample| f64::from(s.point) * 1e-3;
    let mut timed: Vec<(f64, &Sample)> = samples[begin..end].iter().map(|s| (seconds(s), s)).collect();
    let at_rest =
        |s: &&Sample| s.trajectory.is_in(&[TrajectoryState::Stop, TrajectoryState::Finish]) && s.errors == 0;
    if let (Some((last, _)), Some(rest)) = (timed.last().copied(), samples.get(end).filter(at_rest)) {
        timed.push((seconds(rest).max(last + MEASURED_S), rest));
    }
    timed
}

/// Positions of a path that the recording contains, with the millisecond count of the controller.
#[derive(Default)]
struct Seen {
    ms: Vec<u32>,
    points: Vec<Point>,
}

impl Seen {
    /// Reduces a dense path to one point every 10 ms, and keeps both ends. With a point at each millisecond, a path
    /// could have more points than the controller can store. A path with a gap of 10 ms or more is returned
    /// unchanged.
    fn thinned(self) -> Self {
        let last = self.ms.len().saturating_sub(1);
        if self.ms.iter().zip(self.ms.iter().skip(1)).any(|(a, b)| b - a >= GRID_MS) {
            return self;
        }
        let kept = |(i, ms): &(usize, u32)| ms % GRID_MS == 0 || *i == 0 || *i == last;
        let kept: Vec<usize> = self.ms.iter().copied().enumerate().filter(kept).map(|(i, _)| i).collect();
        Self {
            ms: kept.iter().map(|i| self.ms[*i]).collect(),
            points: kept.iter().map(|i| self.points[*i]).collect(),
        }
    }

    fn into_samples(self) -> Samples {
        let known = |part: fn(&Point) -> [f64; JOINTS]| {
            let values: Vec<_> = self.points.iter().map(part).collect();
            values.iter().flatten().all(|v| v.is_finite()).then_some(values)
        };
        let velocity = known(|p| p.velocity);
        Samples {
            times: self.ms.iter().map(|ms| f64::from(*ms) * 1e-3).collect(),
            position: self.points.iter().map(|p| p.position).collect(),
            acceleration: velocity.as_ref().and_then(|_| known(|p| p.acceleration)),
            velocity,
        }
    }
}

/// Returns the path of the last execution in the samples.
fn executed(samples: &[Sample]) -> Result<Loaded, FileError> {
    let mut path = Seen::default();
    for sample in samples {
        let place = match (sample.trajectory.known(), path.points.last()) {
            (Some(TrajectoryState::Execute), _) => Point {
                position: sample.joints.map(|joint| joint.set_position),
                velocity: sample.joints.map(|joint| joint.set_velocity),
                acceleration: sample.joints.map(|joint| joint.set_acceleration),
            },
            // At the end of the path, the recording contains no commanded values. The arm is then at rest, close to
            // the position of the previous sample, so this position is used.
            (Some(TrajectoryState::Finish), Some(place)) => {
                Point { position: place.position, ..Point::default() }
            }
            _ => continue,
        };
        if place.position.iter().any(|q| !q.is_finite()) || path.ms.last() == Some(&sample.point) {
            continue;
        }
        if path.ms.last().is_some_and(|point| sample.point < *point) {
            // At this sample another execution begins, for example after an approach.
            path = Seen::default();
        }
        path.ms.push(sample.point);
        path.points.push(place);
    }
    let count = path.ms.len();
    if count < 2 {
        let problem = "the recording contains no execution of a trajectory with known commanded positions";
        return Err(FileError::at(Place::default(), problem));
    }
    let (from, to) = (f64::from(path.ms[0]) * 1e-3, f64::from(path.ms[count - 1]) * 1e-3);
    let longest = path.ms.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0);
    let fitted = path
        .thinned()
        .into_samples()
        .fit()
        .map_err(|_| FileError::form("the times of the path do not increase"))?;
    let mut notes = vec![format!(
        "the last execution in the recording, {from:.3}..{to:.3} s of its path, known at {count} places at most {longest} ms apart"
    )];
    let loaded = Loaded::fitted(fitted, Form::Recording);
    notes.extend(loaded.notes);
    Ok(Loaded { notes, ..loaded })
}

#[cfg(test)]
mod tests {
    use TrajectoryState::{Execute, Finish, Pause, Stop};

    use super::*;
    use crate::sample::JointSample;

    /// Returns a sample at `point` with the commanded positions of a smooth path of 2 s.
    fn sample(trajectory: TrajectoryState, point: u32) -> Sample {
        let s = f64::from(point) / 2_000.0;
        let q = 0.3 * s * s * (3.0 - 2.0 * s);
        let joint = JointSample { set_position: q, position: q + 1e-4, ..JointSample::UNKNOWN };
        // The times of the host have no meaning in virtual time, so the sample contains none.
        Sample { trajectory: trajectory.into(), point, joints: [joint; JOINTS], ..Sample::default() }
    }

    #[test]
    fn the_path_is_found_by_the_point_index_over_pauses_and_lost_samples() {
        let unknown = Sample { joints: [JointSample::UNKNOWN; JOINTS], ..sample(Execute, 500) };
        let pause = [sample(Execute, 800), sample(Pause, 800), sample(Execute, 800)];
        let mut samples = vec![sample(Stop, 0), sample(Execute, 0), sample(Execute, 0), unknown];
        samples.extend((0..20).map(|k| sample(Execute, 40 * k)));
        samples.extend(pause);
        samples.extend((21..50).filter(|k| k % 7 != 0).map(|k| sample(Execute, 40 * k)));
        samples.extend([sample(Finish, 2_000), sample(Finish, 2_000)]);
        let loaded = executed(&samples).unwrap();
        assert_eq!(loaded.form, Form::Recording);
        assert!((loaded.trajectory.duration_s() - 2.0).abs() < 1e-9);
        // Some samples are missing in the recording, among them those of the last 40 ms of the path. The extracted
        // path may deviate from the real path by at most 2 mrad.
        for (i, point) in loaded.trajectory.points.iter().enumerate() {
            let s = i as f64 * f64::from(loaded.trajectory.step_ms) / 2_000.0;
            let q = 0.3 * s * s * (3.0 - 2.0 * s);
            assert!((point.position[2] - q).abs() < 2e-3, "{i}: {} {q}", point.position[2]);
        }
    }

    #[test]
    fn of_several_executions_the_last_one_counts() {
        let approach = (0..10).map(|k| sample(Execute, 100 * k));
        let motion = (0..4).map(|k| sample(Execute, 50 * k));
        let loaded =
            executed(&approach.chain([sample(Finish, 1_000)]).chain(motion).collect::<Vec<_>>()).unwrap();
        assert!((loaded.trajectory.duration_s() - 0.15).abs() < 1e-9);
    }

    /// `jtc sim` records each millisecond, so one minute has more points than the controller can store. The replay
    /// must reduce the points and keep the commanded values, including velocities and accelerations.
    #[test]
    fn a_long_path_known_at_each_millisecond_can_be_run_again() {
        let at = |ms: u32| {
            let x = std::f64::consts::TAU * f64::from(ms) / 60_000.0;
            let w = std::f64::consts::TAU / 60.0;
            let joint = JointSample {
                set_position: 1.0 - x.cos(),
                set_velocity: w * x.sin(),
                set_acceleration: w * w * x.cos(),
                ..JointSample::UNKNOWN
            };
            Sample { trajectory: Execute.into(), point: ms, joints: [joint; JOINTS], ..Sample::default() }
        };
        let loaded = executed(&(0..=60_000).map(at).collect::<Vec<_>>()).unwrap();
        assert!(loaded.trajectory.points.len() <= jtc_core::POINTS_MAX);
        assert_eq!(loaded.trajectory.duration_s(), 60.0);
        for (i, point) in loaded.trajectory.points.iter().enumerate() {
            let joint = at(i as u32 * u32::from(loaded.trajectory.step_ms)).joints[0];
            let seen = (point.position[5], point.velocity[5], point.acceleration[5]);
            assert_eq!(seen, (joint.set_position, joint.set_velocity, joint.set_acceleration), "{i}");
        }
    }

    /// The reader finds a motion by hand even if there are standstills of any length before and after it, and earlier
    /// executions.
    #[test]
    fn a_motion_by_hand_is_found_as_it_was_measured() {
        let at = |ms: u32| {
            let u = ((f64::from(ms) - 1000.0) / 2000.0).clamp(0.0, 1.0);
            let joint = JointSample { position: 0.4 * u * u * (3.0 - 2.0 * u), ..JointSample::UNKNOWN };
            Sample {
                time_s: 7.0 + f64::from(ms) * 1e-3,
                state: ControllerState::Teaching.into(),
                joints: [joint; JOINTS],
                ..Sample::default()
            }
        };
        let mut samples: Vec<Sample> = (0..9).map(|k| sample(Execute, 40 * k)).collect();
        samples.extend((0..=4000).map(at));
        let led = measured(&samples).unwrap().trajectory;
        assert!((1.8..2.1).contains(&led.duration_s()), "{}", led.duration_s());
        let (first, last) = (led.points[0], led.points.last().unwrap());
        assert!(first.position[3].abs() < 2e-3 && (last.position[3] - 0.4).abs() < 2e-3);
        assert_eq!((first.velocity, last.velocity), ([0.0; JOINTS], [0.0; JOINTS]));
        // If the recording has no motion by hand, the last execution is used.
        let run: Vec<Sample> = (0..50)
            .map(|k| Sample {
                time_s: f64::from(k) * 0.04,
                state: ControllerState::Operate.into(),
                ..sample(Execute, 40 * k)
            })
            .collect();
        let executed = measured(&run).unwrap().trajectory;
        assert!((executed.points.last().unwrap().position[0] - 0.3).abs() < 3e-3);
        assert!(measured(&samples[9..500]).unwrap_err().to_string().contains("no motion by hand"));
    }

    #[test]
    fn a_recording_without_an_execution_is_refused() {
        let held: Vec<Sample> = (0..9).map(|_| sample(Stop, 0)).collect();
        assert!(executed(&held).unwrap_err().to_string().contains("no execution"));
        assert!(executed(&[sample(Execute, 0), sample(Finish, 0)]).is_err());
    }
}
