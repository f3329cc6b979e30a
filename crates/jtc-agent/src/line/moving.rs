//! What may be moving the arm, as far as frames and statuses show it; and the end of teaching, until the device has taken it.
use std::time::Duration;

use jtc_wire::{ControllerState, FrameType, Status, TrajectoryState, fixed};

use super::Moves;
use super::class::HostFrame;

/// A frame that may begin a motion shows in the statuses within this time; a status that is older shows nothing.
const SHOWS: Duration = Duration::from_secs(1);
/// A motion follows its upload within this time.
const FOLLOWS: Duration = Duration::from_secs(5);
/// The end of teaching is sent again after this time without a record.
const AGAIN: Duration = Duration::from_millis(250);

#[derive(Debug, Default)]
pub(super) struct Moving {
    /// When the last frame was written that may begin a motion.
    begun_at: Option<Duration>,
    /// When the last of a trajectory was written.
    uploaded_at: Option<Duration>,
    /// Teaching was asked for: it may wait for seconds until the arm is held, and no status shows that.
    teaches: bool,
    /// When its end is to be written.
    end_at: Option<Duration>,
}

impl Moving {
    /// The line has carried this frame at `at`, which may begin a motion.
    pub fn begun(&mut self, frame_type: FrameType, at: Duration) {
        self.begun_at = Some(at);
        self.teaches |= frame_type == FrameType::TeachingModeEnable;
    }

    /// The line has carried a part of a trajectory at `at`.
    pub fn uploaded(&mut self, at: Duration) {
        self.uploaded_at = Some(at);
    }

    /// The line has carried the end of teaching.
    pub fn taught(&mut self) {
        self.teaches = false;
    }

    /// The arm may be moving, or may begin to. In doubt it may.
    pub fn may_move(&self, status: Option<&(Duration, Status)>, now: Duration) -> bool {
        let shown = |at: Duration| now.saturating_sub(at) < SHOWS;
        let rests = status.is_some_and(|(at, status)| shown(*at) && !shows_motion(status));
        self.teaches || self.begun_at.is_some_and(shown) || !rests
    }

    /// What moves the arm or is about to, `before` where no status shows it anew.
    pub fn what(
        &self,
        status: Option<&(Duration, Status)>,
        now: Duration,
        before: Option<Moves>,
    ) -> Option<Moves> {
        let within = |at: Option<Duration>, time| at.is_some_and(|at| now.saturating_sub(at) < time);
        let shown = status.filter(|(at, _)| within(Some(*at), SHOWS)).map(|(_, status)| status);
        if self.teaches || shown.is_some_and(|status| status.state == ControllerState::Teaching) {
            Some(Moves::Teaching)
        } else if within(self.begun_at, SHOWS) || shown.is_some_and(shows_motion) {
            Some(Moves::Motion)
        } else if shown.is_none() && before.is_some_and(|before| before != Moves::Upload) {
            before
        } else {
            within(self.uploaded_at, FOLLOWS).then_some(Moves::Upload)
        }
    }

    /// The controller moves the arm, or lets it be led: what host supervision (J-59) ends. A paused arm does not move.
    pub fn is_supervised(&self, status: Option<&(Duration, Status)>, now: Duration) -> bool {
        let moves = [ControllerState::Operate, ControllerState::Teaching];
        self.begun_at.is_some_and(|at| now.saturating_sub(at) < SHOWS)
            || status.is_some_and(|(_, status)| status.state.is_in(&moves))
    }

    /// Teaching may be on, or begin.
    pub fn may_teach(&self, status: Option<&(Duration, Status)>) -> bool {
        self.teaches || status.is_some_and(|(_, status)| status.state == ControllerState::Teaching)
    }

    /// Teaching is to end.
    pub fn end_teaching(&mut self, now: Duration) {
        self.end_at = Some(now);
    }

    /// The frame that ends it, where it is to be written now.
    pub fn frame(&mut self, now: Duration) -> Option<HostFrame> {
        self.end_at.take_if(|at| now >= *at)?;
        self.end_at = Some(now + AGAIN);
        HostFrame::parse(fixed::empty(FrameType::TeachingModeDisable).to_vec())
    }

    /// The device has taken it, or refused it because nobody teaches.
    pub fn answered(&mut self) {
        self.end_at = None;
    }

    /// When the frame that ends it is to be written.
    pub fn due(&self) -> Option<Duration> {
        self.end_at
    }
}

/// The arm moves by this status, or may be gone on with from a pause.
fn shows_motion(status: &Status) -> bool {
    status.state.is_in(&[ControllerState::Operate, ControllerState::Teaching])
        || status.trajectory.is_in(&[TrajectoryState::Execute, TrajectoryState::Pause])
}
