//! Motion tracker, which determines from frames and statuses whether the arm is possibly in motion. The tracker also
//! repeats the frame that ends Teaching until the controller confirms it.
use std::time::Duration;

use jtc_wire::{ControllerState, FrameType, Status, TrajectoryState, fixed};

use super::Moves;
use super::frame_class::HostFrame;

/// Longest time until the statuses show that a frame has begun a motion. Statuses that are older than this time are
/// ignored.
const SHOWS: Duration = Duration::from_secs(1);
/// Longest expected time from an upload to the start of the uploaded motion.
const FOLLOWS: Duration = Duration::from_secs(5);
/// Interval at which the frame that ends Teaching is repeated until the controller confirms it.
const AGAIN: Duration = Duration::from_millis(250);

#[derive(Debug, Default)]
pub(super) struct MotionTracker {
    /// Time at which a frame that may begin a motion was last sent.
    begun_at: Option<Duration>,
    /// Time at which a segment of a trajectory was last sent.
    uploaded_at: Option<Duration>,
    /// `true` after a client requested Teaching. Teaching can start seconds later, when position hold begins. Before Teaching
    /// starts, no status shows that Teaching was requested.
    teaches: bool,
    /// Time at which the frame that ends Teaching must be sent.
    end_at: Option<Duration>,
}

impl MotionTracker {
    /// Records that a frame that may begin a motion was sent at `at`.
    pub(super) fn begun(&mut self, frame_type: FrameType, at: Duration) {
        self.begun_at = Some(at);
        self.teaches |= frame_type == FrameType::TeachingModeEnable;
    }

    /// Records that a segment of a trajectory was sent at `at`.
    pub(super) fn uploaded(&mut self, at: Duration) {
        self.uploaded_at = Some(at);
    }

    /// Records that Teaching is not expected: the frame that ends Teaching was sent, or the controller refused
    /// Teaching.
    pub(super) fn taught(&mut self) {
        self.teaches = false;
    }

    /// Returns false only if the arm is certainly at rest and no motion is about to begin.
    pub(super) fn may_move(&self, status: Option<&(Duration, Status)>, now: Duration) -> bool {
        let shown = |at: Duration| now.saturating_sub(at) < SHOWS;
        let rests = status.is_some_and(|(at, status)| shown(*at) && !shows_motion(status));
        self.teaches || self.begun_at.is_some_and(shown) || !rests
    }

    /// Returns the cause of the present or next motion. If no recent status exists, the previous cause `before` stays
    /// valid, unless it was an upload.
    pub(super) fn what(
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

    /// Returns true during a motion or Teaching, which host supervision (J-59) can end. Host supervision does not apply to a
    /// paused arm, because the arm does not move.
    pub(super) fn is_supervised(&self, status: Option<&(Duration, Status)>, now: Duration) -> bool {
        let moves = [ControllerState::Operate, ControllerState::Teaching];
        self.begun_at.is_some_and(|at| now.saturating_sub(at) < SHOWS)
            || status.is_some_and(|(_, status)| status.state.is_in(&moves))
    }

    /// Returns true if Teaching may be active, or may begin later.
    pub(super) fn may_teach(&self, status: Option<&(Duration, Status)>) -> bool {
        self.teaches || status.is_some_and(|(_, status)| status.state == ControllerState::Teaching)
    }

    /// Requests the end of Teaching.
    pub(super) fn end_teaching(&mut self, now: Duration) {
        self.end_at = Some(now);
    }

    /// Returns the frame that ends Teaching if the frame must be sent now.
    pub(super) fn frame(&mut self, now: Duration) -> Option<HostFrame> {
        self.end_at.take_if(|at| now >= *at)?;
        self.end_at = Some(now + AGAIN);
        HostFrame::parse(fixed::empty(FrameType::TeachingModeDisable).to_vec())
    }

    /// Records that the controller confirmed the end of Teaching, or refused the frame because Teaching was not active.
    pub(super) fn answered(&mut self) {
        self.end_at = None;
    }

    /// Returns the time at which the frame that ends Teaching must be sent.
    pub(super) fn due(&self) -> Option<Duration> {
        self.end_at
    }
}

/// Returns true if the status shows a motion, or a paused motion that may resume.
fn shows_motion(status: &Status) -> bool {
    status.state.is_in(&[ControllerState::Operate, ControllerState::Teaching])
        || status.trajectory.is_in(&[TrajectoryState::Execute, TrajectoryState::Pause])
}
