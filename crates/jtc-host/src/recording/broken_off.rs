//! Where a run was broken off, as its recording shows it.

use host_kit::{Diagnose, Diagnosis, ErrorKind};
use jtc_core::JOINTS;
use jtc_wire::{ControllerState, TrajectoryState};

use super::Recording;
use crate::sample::Sample;
use crate::trajectory::Trajectory;

/// The arm comes to rest within this time after a stop, ms of path time.
const RAMP_MS: u32 = 1000;
/// Commanded positions of a recording are those of its trajectory to this, rad.
const SAME: f64 = 2e-3;

/// How far a run got along its path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrokenOff {
    /// Path time of its last sample in motion, ms; 0 where the motion had not begun.
    pub last_ms: u32,
    /// Path time up to which the arm may have gone on unseen, ms.
    pub until_ms: u32,
}

/// There is nothing to go on with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NothingLeft {
    /// The run came to its end.
    #[error("the run came to its end: nothing is left of it")]
    Finished,
    /// The recording holds no motion.
    #[error("the recording holds no execution of this trajectory")]
    NoExecution,
    /// What was commanded is not on this trajectory.
    #[error("the recording is of another trajectory, or of this one at another speed")]
    Other,
}

impl Diagnose for NothingLeft {
    fn diagnosis(&self) -> Diagnosis {
        let next = match self {
            Self::Finished => "`jtc traj replay RECORDING --approach` runs it again",
            Self::Other => "name the trajectory as it was run; a recording in MCAP holds it itself",
            Self::NoExecution => {
                "a recording of the run is needed, and the trajectory that was run: `jtc traj run FILE --record run.mcap`"
            }
        };
        Diagnosis::new(ErrorKind::Refused, "nothing-left", next)
    }
}

impl Recording {
    /// How far the last run of this recording got along `trajectory`. Where an error or a stop ended it, the arm came to rest soon after
    /// its last sample; where the link was lost or the program was killed, the controller may have gone on to the end.
    ///
    /// # Errors
    ///
    /// [`NothingLeft`]: it came to its end, is no run, or one of another trajectory.
    pub fn broken_off(&self, trajectory: &Trajectory) -> Result<BrokenOff, NothingLeft> {
        let end_ms = (trajectory.duration_s() * 1e3).round() as u32;
        let moving = |s: &&Sample| s.trajectory.is_in(&[TrajectoryState::Execute, TrajectoryState::Pause]);
        let last = self.samples.iter().rfind(moving).ok_or(NothingLeft::NoExecution)?;
        if self.ending.outcome == "finished" {
            return Err(NothingLeft::Finished);
        }
        let is_end = self.samples.last().is_some_and(|s| s.trajectory == TrajectoryState::Finish);
        if !is_on(last, trajectory) {
            let own = self.info.as_ref().and_then(|info| info.commanded.as_deref()) == Some(trajectory);
            // The way to the first point of its own trajectory: nothing of that was run.
            return if own { Ok(BrokenOff { last_ms: 0, until_ms: 0 }) } else { Err(NothingLeft::Other) };
        }
        if is_end || last.point >= end_ms {
            return Err(NothingLeft::Finished);
        }
        let seen = self.samples.last().is_some_and(|s| !moving(&s))
            || self.samples.iter().any(|s| s.errors != 0 || s.state == ControllerState::Error)
            || self.ending.outcome == "stopped";
        let until_ms = if seen { last.point.saturating_add(RAMP_MS).min(end_ms) } else { end_ms };
        Ok(BrokenOff { last_ms: last.point, until_ms })
    }
}

/// What was commanded then is the trajectory's; of a recording that does not hold it, where the arm was.
fn is_on(sample: &Sample, trajectory: &Trajectory) -> bool {
    let Some(at) = trajectory.at_ms(sample.point) else { return false };
    (0..JOINTS).all(|j| {
        let joint = &sample.joints[j];
        // Measured positions lag behind and are off by the tracking error.
        let (value, same) =
            if joint.set_position.is_finite() { (joint.set_position, SAME) } else { (joint.position, 0.1) };
        (value - at.position[j]).abs() <= same
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::{Ending, RecordingInfo, write_all};
    use super::*;
    use crate::example::demo_motion;

    /// Samples of the demo's motion at these points, with their states.
    fn recording(points: &[(u32, TrajectoryState)], outcome: &str) -> Recording {
        let whole = demo_motion();
        let sample = |(point, trajectory): &(u32, TrajectoryState)| {
            let at = whole.at_ms(*point).unwrap();
            let mut sample = Sample { point: *point, trajectory: (*trajectory).into(), ..Sample::default() };
            for (joint, q) in sample.joints.iter_mut().zip(at.position) {
                joint.set_position = q;
            }
            sample
        };
        let ending = Ending { outcome: outcome.into(), reason: String::new() };
        Recording::new(None, ending, points.iter().map(sample).collect(), None)
    }

    #[test]
    fn the_last_sample_in_motion_counts_and_what_may_have_followed() {
        use TrajectoryState::{Execute, Finish, Null, Pause, Stop};
        let of = |points: &[(u32, TrajectoryState)], outcome| {
            recording(points, outcome).broken_off(&demo_motion())
        };
        let way = [(0, Execute), (40, Execute), (4_000, Execute)];
        // The link was lost, or the program killed.
        for outcome in ["", "fault"] {
            assert_eq!(of(&way, outcome), Ok(BrokenOff { last_ms: 4_000, until_ms: 10_000 }));
        }
        let stopped = [&way[..], &[(4_300, Stop)]].concat();
        assert_eq!(of(&stopped, "stopped"), Ok(BrokenOff { last_ms: 4_000, until_ms: 5_000 }));
        let paused = [&way[..], &[(4_300, Pause)]].concat();
        assert_eq!(of(&paused, "stopped"), Ok(BrokenOff { last_ms: 4_300, until_ms: 5_300 }));
        let fault = [&way[..], &[(0, Null)]].concat();
        assert_eq!(of(&fault, "fault"), Ok(BrokenOff { last_ms: 4_000, until_ms: 5_000 }));
        assert_eq!(of(&[&way[..], &[(10_000, Finish)]].concat(), "finished"), Err(NothingLeft::Finished));
        assert_eq!(of(&[(0, Stop)], "stopped"), Err(NothingLeft::NoExecution));
        // Its points are those of another path.
        let mut approach = recording(&way, "fault");
        approach.samples[2].joints[1].set_position += 0.1;
        assert_eq!(approach.broken_off(&demo_motion()), Err(NothingLeft::Other));
        // Unless that is the recording's own: it was on the way to its first point.
        approach.info =
            Some(RecordingInfo { commanded: Some(Arc::new(demo_motion())), ..RecordingInfo::default() });
        assert_eq!(approach.broken_off(&demo_motion()), Ok(BrokenOff { last_ms: 0, until_ms: 0 }));
    }

    #[cfg(feature = "mcap")]
    #[test]
    fn an_mcap_file_holds_the_whole_trajectory_as_the_wire_carries_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("run.mcap");
        let whole = demo_motion();
        let info = RecordingInfo { commanded: Some(Arc::new(whole.clone())), ..RecordingInfo::default() };
        write_all(&path, &info, &recording(&[(0, TrajectoryState::Execute)], "").samples).unwrap();
        let read = Recording::read(&path).unwrap();
        assert_eq!(read.samples.len(), 1);
        let back = read.info.unwrap().commanded.unwrap();
        assert_eq!((back.step_ms, back.raw().unwrap()), (whole.step_ms, whole.raw().unwrap()));
    }
}
