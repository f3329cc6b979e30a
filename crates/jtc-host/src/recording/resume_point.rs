//! Search in a recording for the point at which a run was interrupted.

use std::sync::Arc;

use host_kit::{Diagnose, Diagnosis, ErrorKind};
use jtc_core::JOINTS;
use jtc_wire::{ControllerState, Status, TrajectoryState};

use super::Recording;
use crate::sample::Sample;
use crate::trajectory::Trajectory;

/// Maximum path time that the arm needs to come to rest after a Stop, ms.
const RAMP_MS: u32 = 1000;
/// Maximum distance (rad) between an arm at rest and a position of the path at which the two count as equal.
const AT_REST: f64 = 0.01;
/// Maximum distance between a commanded position in a recording and the recorded trajectory at which the two count as
/// equal, rad.
const SAME: f64 = 2e-3;

/// Position on the path that the arm has certainly reached, according to the recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResumePoint {
    /// Path time of the last position on the path that the recording contains, ms; 0 if the motion had not begun.
    pub last_ms: u32,
}

/// Point at which a run can be resumed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resumption {
    /// Path time, ms.
    pub ms: u32,
    /// `true` if the controller reports this point, because the motion continued after the last recorded sample.
    /// `false` if the point comes from the recording.
    pub shown: bool,
    /// `true` if the arm is at this point.
    pub stands: bool,
}

impl ResumePoint {
    /// Returns the point at which the run on `trajectory` can be resumed without skipping a part of the path. This is
    /// the last position that the recording shows, or a later point. The function uses a later point only if `status`
    /// shows that the motion continued to this point and that the arm is at this point.
    ///
    /// The position of the arm alone does not prove progress, because a user may have moved the arm along the path. A
    /// controller that was restarted or that received another motion does not report a point of this motion. After a
    /// Stop, a controller counts the point index from the start of the trajectory again.
    ///
    /// `tolerance` is the maximum distance (rad) at which the arm is considered to be at a point.
    ///
    /// # Errors
    ///
    /// Returns [`NothingLeft::Finished`] if the controller reports the end of the path.
    pub fn resumption(
        &self,
        trajectory: &Trajectory,
        status: &Status,
        tolerance: f64,
    ) -> Result<Resumption, NothingLeft> {
        let (end_ms, q) = (end_ms(trajectory), status.positions());
        let stands_at = |ms: u32| trajectory.at_ms(ms).is_some_and(|at| away(&at.position, &q) <= tolerance);
        let on_its_way = status.trajectory.is_in(&[TrajectoryState::Execute, TrajectoryState::Pause]);
        // A motion ends in Finish only at its last point.
        let at_end = status.trajectory == TrajectoryState::Finish && status.point == end_ms;
        let shown = (on_its_way || at_end) && status.point >= self.last_ms && stands_at(status.point);
        let ms = if shown { status.point } else { self.last_ms };
        if ms >= end_ms {
            return Err(NothingLeft::Finished);
        }
        Ok(Resumption { ms, shown, stands: stands_at(ms) })
    }
}

/// Returns the path time of the last point, ms.
fn end_ms(trajectory: &Trajectory) -> u32 {
    (trajectory.duration_s() * 1e3).round() as u32
}

/// Returns the largest difference between the two positions over all joints, rad.
fn away(a: &[f64; JOINTS], b: &[f64; JOINTS]) -> f64 {
    // If a position is unknown, the distance is infinite.
    let far = |(a, b): (&f64, &f64)| if (a - b).is_nan() { f64::INFINITY } else { (a - b).abs() };
    a.iter().zip(b).map(far).fold(0.0, f64::max)
}

/// Reason why a run cannot be resumed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NothingLeft {
    /// The run reached the end of the path.
    #[error("the run reached its end, so no part of it remains")]
    Finished,
    /// The recording contains no motion.
    #[error("the recording contains no execution of this trajectory")]
    NoExecution,
    /// The commanded positions belong to another trajectory.
    #[error("the recording is of another trajectory, or of this trajectory at another speed")]
    Other,
}

impl Diagnose for NothingLeft {
    fn diagnosis(&self) -> Diagnosis {
        let next = match self {
            Self::Finished => "`jtc traj replay RECORDING --approach` runs it again",
            Self::Other => {
                "name the trajectory that was run, at its speed; an MCAP recording contains its trajectory"
            }
            Self::NoExecution => {
                "use a recording of the run and its trajectory: `jtc traj run FILE --record run.mcap`"
            }
        };
        Diagnosis::new(ErrorKind::Refused, "nothing-left", next)
    }
}

impl Recording {
    /// Returns the progress of the last run in this recording along `trajectory`. The progress ends at the last sample of the moving arm.
    /// After a Stop, the progress ends at the later position at which the arm is at rest.
    ///
    /// # Errors
    ///
    /// Returns [`NothingLeft`] if the run reached the end of the path, if the recording contains no run, or if the run is on another
    /// trajectory.
    pub fn resume_point(&self, trajectory: &Trajectory) -> Result<ResumePoint, NothingLeft> {
        let moving = |s: &Sample| s.trajectory.is_in(&[TrajectoryState::Execute, TrajectoryState::Pause]);
        let number = self.samples.iter().rposition(moving).ok_or(NothingLeft::NoExecution)?;
        let (last, behind) = (&self.samples[number], &self.samples[number + 1..]);
        if self.ending.outcome == "finished" {
            return Err(NothingLeft::Finished);
        }
        let is_end = self.samples.last().is_some_and(|s| s.trajectory == TrajectoryState::Finish);
        if !is_on(last, trajectory) {
            let info = self.info.as_ref();
            let own = |of: Option<&Arc<Trajectory>>| of.is_some_and(|own| **own == *trajectory);
            let own = own(info.and_then(|info| info.commanded.as_ref()))
                || own(info.and_then(|info| info.then.as_ref()));
            // The recorded motion was the approach to the first point of the trajectory, so the run on the trajectory
            // has not begun.
            return if own { Ok(ResumePoint { last_ms: 0 }) } else { Err(NothingLeft::Other) };
        }
        if is_end || last.point >= end_ms(trajectory) {
            return Err(NothingLeft::Finished);
        }
        Ok(ResumePoint { last_ms: at_rest(last.point, behind, trajectory).unwrap_or(last.point) })
    }
}

impl Recording {
    /// Returns the number of completed runs of a repeated motion. The first run must follow the trajectory `first`,
    /// and all later runs must follow `then`. Approaches between the runs are not counted.
    pub fn runs_finished(&self, first: &Trajectory, then: &Trajectory) -> u32 {
        let mut finished = 0;
        for (leg, ended) in self.executions() {
            let of = if finished == 0 { first } else { then };
            finished += u32::from(ended && leg.iter().all(|sample| is_on(sample, of)));
        }
        finished
    }

    /// Returns the samples of each execution, and `true` if the execution reached its end. The end counts as reached
    /// if another execution follows or if the controller reports the end.
    fn executions(&self) -> Vec<(Vec<&Sample>, bool)> {
        let moving = |s: &Sample| s.trajectory.is_in(&[TrajectoryState::Execute, TrajectoryState::Pause]);
        let mut all: Vec<(Vec<&Sample>, bool)> = Vec::new();
        for sample in &self.samples {
            match all.last_mut() {
                Some((leg, ended)) if moving(sample) && !*ended => match leg.last() {
                    // The point index has decreased, so another execution begins at this sample.
                    Some(before) if sample.point < before.point => {
                        *ended = true;
                        all.push((vec![sample], false));
                    }
                    _ => leg.push(sample),
                },
                _ if moving(sample) => all.push((vec![sample], false)),
                Some((_, ended)) => *ended |= sample.trajectory == TrajectoryState::Finish,
                None => {}
            }
        }
        if let Some((_, ended)) = all.last_mut() {
            *ended |= self.ending.outcome == "finished";
        }
        all
    }
}

/// Returns the path time at which the arm came to rest after a Stop, ms. `last_ms` is the path time of the last sample in motion. The
/// result is the first path time after `last_ms` at which the path position matches the arm at rest. An arm without torque may have left
/// the path, so its position does not prove progress.
fn at_rest(last_ms: u32, behind: &[Sample], trajectory: &Trajectory) -> Option<u32> {
    let held = |s: &Sample| s.errors == 0 && s.state.known().is_none_or(ControllerState::has_torque);
    let rest = behind.last().filter(|_| behind.iter().all(held))?;
    if rest.trajectory != TrajectoryState::Stop {
        return None;
    }
    let stood = rest.joints.map(|joint| joint.position);
    let mut nearest: Option<(u32, f64)> = None;
    for ms in last_ms..=last_ms.saturating_add(RAMP_MS).min(end_ms(trajectory)) {
        let far = away(&trajectory.at_ms(ms)?.position, &stood);
        match nearest {
            Some((_, least)) if far < least => nearest = Some((ms, far)),
            // From this point on, the path leads away from the position of the arm, so the search ends. The path may
            // return to this position later, but that time is not the time of the Stop.
            Some(_) if far > AT_REST => break,
            None if far <= AT_REST => nearest = Some((ms, far)),
            _ => {}
        }
    }
    nearest.map(|(ms, _)| ms)
}

/// Returns `true` if the commanded position of the sample is on the trajectory. If the commanded positions are unknown, the function
/// compares the measured positions.
fn is_on(sample: &Sample, trajectory: &Trajectory) -> bool {
    let Some(at) = trajectory.at_ms(sample.point) else { return false };
    (0..JOINTS).all(|j| {
        let joint = &sample.joints[j];
        // The tolerance for measured positions is larger, because these positions are delayed and contain the tracking error.
        let (value, same) =
            if joint.set_position.is_finite() { (joint.set_position, SAME) } else { (joint.position, 0.1) };
        (value - at.position[j]).abs() <= same
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Ending, RecordingInfo, write_all};
    use super::*;
    use crate::example::demo_motion;
    use crate::trajectory::Point;

    /// Returns a recording with samples of the demo motion at `points`, each with a trajectory state.
    fn recording(points: &[(u32, TrajectoryState)], outcome: &str) -> Recording {
        recording_of(&demo_motion(), points, outcome)
    }

    fn recording_of(whole: &Trajectory, points: &[(u32, TrajectoryState)], outcome: &str) -> Recording {
        let sample = |(point, trajectory): &(u32, TrajectoryState)| {
            let at = whole.at_ms(*point).unwrap();
            let mut sample = Sample { point: *point, trajectory: (*trajectory).into(), ..Sample::default() };
            for (joint, q) in sample.joints.iter_mut().zip(at.position) {
                joint.set_position = q;
            }
            sample
        };
        let ending = Ending { outcome: outcome.into(), reason: String::new(), ..Ending::default() };
        Recording { info: None, ending, samples: points.iter().map(sample).collect(), cut: None }
    }

    #[test]
    fn the_last_sample_in_motion_counts() {
        use TrajectoryState::{Execute, Finish, Null, Pause, Stop};
        let of = |points: &[(u32, TrajectoryState)], outcome| {
            recording(points, outcome).resume_point(&demo_motion())
        };
        let way = [(0, Execute), (40, Execute), (4_000, Execute)];
        let at = |last_ms| Ok(ResumePoint { last_ms });
        // The outcome is empty or `fault`. In both cases the run was interrupted: the link was lost, the program was
        // killed, or the controller ended the run.
        for outcome in ["", "fault"] {
            assert_eq!(of(&way, outcome), at(4_000));
        }
        assert_eq!(of(&[&way[..], &[(0, Null)]].concat(), "fault"), at(4_000));
        let paused = [&way[..], &[(4_300, Pause)]].concat();
        assert_eq!(of(&paused, "stopped"), at(4_300));
        assert_eq!(of(&[&way[..], &[(10_000, Finish)]].concat(), "finished"), Err(NothingLeft::Finished));
        assert_eq!(of(&[(0, Stop)], "stopped"), Err(NothingLeft::NoExecution));
        // The recorded points belong to another path.
        let mut approach = recording(&way, "fault");
        approach.samples[2].joints[1].set_position += 0.1;
        assert_eq!(approach.resume_point(&demo_motion()), Err(NothingLeft::Other));
        // If the header of the recording contains this trajectory, the recorded motion was the approach to its first point.
        approach.info =
            Some(RecordingInfo { commanded: Some(Arc::new(demo_motion())), ..RecordingInfo::default() });
        assert_eq!(approach.resume_point(&demo_motion()), at(0));
    }

    /// The function counts completed runs, but not the approaches between the runs. The first run may be the remainder of an interrupted
    /// run.
    #[test]
    fn runs_of_a_repeated_motion_are_counted() {
        use TrajectoryState::{Execute, Finish, Stop};
        let (demo, other) = (demo_motion(), back_and_forth());
        let whole = [(0, Execute), (5_000, Execute), (9_990, Execute), (10_000, Finish)];
        let joined = |parts: &[Recording], outcome: &str| {
            let samples = parts.iter().flat_map(|part| part.samples.clone()).collect();
            Recording {
                info: None,
                ending: Ending { outcome: outcome.into(), reason: String::new(), ..Ending::default() },
                samples,
                cut: None,
            }
        };
        let run = || recording(&whole, "");
        // Status frames arrive every 40 ms, so a recording may contain no status from the end of a run.
        let unseen = || recording(&whole[..3], "");
        let part = || recording(&whole[..2], "");
        let approach = || recording_of(&other, &[(0, Execute), (9_960, Execute), (10_000, Finish)], "");
        for (parts, outcome, finished) in [
            (vec![], "", 0),
            (vec![part()], "stopped", 0),
            (vec![run()], "", 1),
            (vec![unseen()], "finished", 1),
            (vec![unseen()], "", 0),
            (vec![run(), part()], "stopped", 1),
            (vec![unseen(), run(), unseen(), part()], "", 3),
            (vec![run(), approach(), run(), approach(), part()], "", 2),
            (vec![run(), approach()], "", 1),
            (vec![approach()], "", 0),
            (vec![run(), recording(&[(0, Stop)], "")], "stopped", 1),
        ] {
            assert_eq!(
                joined(&parts, outcome).runs_finished(&demo, &demo),
                finished,
                "{} parts",
                parts.len()
            );
        }
        // This recording contains the remainder of a run on the path `other`, then one complete run, and then a run
        // that was interrupted.
        let rest = joined(&[approach(), run(), part()], "stopped");
        assert_eq!(rest.runs_finished(&other, &demo), 2);
        assert_eq!(rest.resume_point(&demo), Ok(ResumePoint { last_ms: 5_000 }));
    }

    /// After a Stop, the point index of the controller is 0 again. The position of the arm at rest therefore shows the progress of the run.
    #[test]
    fn a_stop_proves_the_place_at_which_the_arm_came_to_rest() {
        use TrajectoryState::{Execute, Stop};
        let path = back_and_forth();
        let stopped = |last: u32, joint_1: f64| {
            let mut stopped =
                recording_of(&path, &[(last - 40, Execute), (last, Execute), (0, Stop)], "stopped");
            let at = [joint_1, 0.0, 0.0, 0.0, 0.0, 0.0];
            stopped.samples[2].state = ControllerState::HoldPos.into();
            stopped.samples[2].joints.iter_mut().zip(at).for_each(|(joint, q)| joint.position = q + 1e-4);
            stopped
        };
        let stood = |last: u32, ms: u32| stopped(last, path.at_ms(ms).unwrap().position[0]);
        for ms in [3_400, 3_580, 3_700, 4_200] {
            let found = stood(3_400, ms).resume_point(&path).unwrap().last_ms;
            assert!(found.abs_diff(ms) < 20, "{found} instead of {ms}");
        }
        // The path reverses its direction at 5 s, so its position is the same at 4.9 s and at 5.1 s. The recorded
        // motion ends at 4.9 s, and the arm is at rest at this position. The function must return the earlier time,
        // because the resumed run must not skip the reversal.
        assert!(stood(4_900, 5_100).resume_point(&path).unwrap().last_ms < 4_920);
        // If the arm is elsewhere on the path, away from the path, or without torque, its position does not prove the progress.
        let elsewhere = stood(3_400, 12_000);
        let (mut beside, mut error) = (stood(3_400, 3_700), stood(3_400, 3_700));
        beside.samples[2].joints[3].position += 0.05;
        error.samples[2].errors = 1;
        for recording in [elsewhere, beside, error] {
            assert_eq!(recording.resume_point(&path), Ok(ResumePoint { last_ms: 3_400 }));
        }
    }

    /// Returns a motion of joint 1 from 0.5 to 1.0, back to 0.5 and to −0.5 rad, at 0.1 rad/s.
    fn back_and_forth() -> Trajectory {
        let q = |k: i32| 0.01 * f64::from(if k <= 50 { 50 + k } else { 150 - k });
        let point = |k: i32| Point { position: [q(k), 0.0, 0.0, 0.0, 0.0, 0.0], ..Point::default() };
        Trajectory { step_ms: 100, points: (0..=200).map(point).collect() }
    }

    fn status(trajectory: TrajectoryState, point: u32, joint_1: f32) -> Status {
        let mut status = Status { trajectory: trajectory.into(), point, ..Status::default() };
        status.joints[0].position = joint_1;
        status
    }

    /// An arm at a later point of the path does not prove that the run reached this point. The controller must also report this point of
    /// the path.
    #[test]
    fn only_what_is_proved_counts_as_done() {
        use TrajectoryState::{Execute, Finish, Null, Pause, Stop};
        let (path, broken) = (back_and_forth(), ResumePoint { last_ms: 3_400 });
        let at = |status: &Status| broken.resumption(&path, status, 0.02);
        let recorded = |stands| Ok(Resumption { ms: 3_400, shown: false, stands });
        // These statuses prove no progress: the controller was restarted or stopped, or a user moved the arm. The
        // path reaches 0 rad at 15 s and −0.5 rad at its end. Only an arm at 0.84 rad is at the recorded point (3.4
        // s).
        for (joint_1, stands) in [(0.0, false), (-0.5, false), (0.84, true), (0.5, false)] {
            for (trajectory, point) in
                [(Null, 0), (Stop, 0), (Finish, 15_000), (Finish, 4_000), (Finish, 3_000), (Execute, 9_000)]
            {
                assert_eq!(
                    at(&status(trajectory, point, joint_1)),
                    recorded(stands),
                    "{trajectory:?} {joint_1}"
                );
            }
        }
        // The next statuses come from a motion that continued after the end of the recording.
        for trajectory in [Execute, Pause] {
            let on = at(&status(trajectory, 8_000, 0.7));
            assert_eq!(on, Ok(Resumption { ms: 8_000, shown: true, stands: true }));
        }
        assert_eq!(at(&status(Finish, 20_000, -0.5)), Err(NothingLeft::Finished));
        // On a closed path, the end is also the start. Therefore an arm at the end does not prove that the run has
        // finished.
        assert_eq!(at(&status(Null, 0, -0.5)), recorded(false));
    }

    #[cfg(feature = "mcap")]
    #[test]
    fn an_mcap_file_holds_the_whole_trajectory_as_the_wire_carries_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("run.mcap");
        let whole = demo_motion();
        let then = Some(Arc::new(back_and_forth()));
        let info = RecordingInfo {
            commanded: Some(Arc::new(whole.clone())),
            then,
            runs: Some(3),
            ..RecordingInfo::default()
        };
        write_all(&path, &info, &recording(&[(0, TrajectoryState::Execute)], "").samples).unwrap();
        let read = Recording::read(&path).unwrap();
        assert_eq!(read.samples.len(), 1);
        let info = read.info.unwrap();
        assert_eq!(info.runs, Some(3));
        for (back, given) in [(info.commanded, whole), (info.then, back_and_forth())] {
            let back = back.unwrap();
            assert_eq!((back.step_ms, back.raw().unwrap()), (given.step_ms, given.raw().unwrap()));
        }
    }
}
