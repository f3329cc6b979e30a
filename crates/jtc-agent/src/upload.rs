//! Trajectory of the controller, which the agent reassembles from the frames on the serial line.
use std::sync::Arc;

use jtc_host::{Point, Trajectory};
use jtc_wire::{Command, DataStatus, FrameRef, FrameStatus, FrameType, Response};

use crate::line::LineEvent;

/// Largest number of points that a controller accepts (J-30).
const POINTS_MAX: usize = 12_000;

/// Points of the received trajectory segments, in order.
#[derive(Clone, Default)]
struct Assembly {
    number: u16,
    step_ms: u16,
    segments: u16,
    /// Number of trajectory segments that were received.
    taken: u16,
    /// Number of trajectory points before the last segment; it is needed if the client sends the last segment again.
    before_last: usize,
    points: Vec<Point>,
}

/// Reassembles the trajectories that clients upload.
#[derive(Default)]
pub(crate) struct Upload {
    current: Option<Assembly>,
    /// Upload that has just begun. If the controller refuses the first segment of this upload, the previous trajectory stays valid.
    next: Option<Assembly>,
    whole: Option<Arc<Trajectory>>,
}

impl Upload {
    /// Returns `true` if the event belongs to the upload of a trajectory.
    pub(crate) fn is_of(event: &LineEvent) -> bool {
        match event {
            LineEvent::Sent { frame_type, .. } => *frame_type == FrameType::Trajectory,
            LineEvent::Answered { response, .. } => Self::answer(response).is_some(),
            _ => false,
        }
    }

    /// Processes an event of the serial line.
    pub(crate) fn see(&mut self, event: &LineEvent) {
        match event {
            LineEvent::Sent { frame_type: FrameType::Trajectory, bytes, .. } => self.sent(bytes),
            LineEvent::Answered { response, .. } => {
                if let Some(accepted) = Self::answer(response) {
                    self.answered(accepted);
                }
            }
            _ => {}
        }
    }

    /// Returns `true` if the controller accepted a Trajectory frame. Returns `None` if the response does not belong to an undamaged
    /// Trajectory frame.
    pub(crate) fn answer(response: &Response) -> Option<bool> {
        let whole =
            response.frame_type == FrameType::Trajectory as u8 && response.status == FrameStatus::NoError;
        whole.then_some(response.data == DataStatus::NoError)
    }

    /// Processes a Trajectory frame that was sent to the controller.
    pub(crate) fn sent(&mut self, frame: &[u8]) {
        let Some(Ok(Command::Trajectory(segment))) = FrameRef::new_checked(frame).map(Command::parse) else {
            return;
        };
        if segment.segment == 0 {
            self.next = Some(Assembly {
                number: segment.trajectory,
                step_ms: segment.step_time,
                segments: segment.segments,
                ..Assembly::default()
            });
        }
        let Some(assembly) = self.next.as_mut().or(self.current.as_mut()) else { return };
        let (number, step) = (segment.trajectory, segment.step_time);
        if (number, step, segment.segments) != (assembly.number, assembly.step_ms, assembly.segments) {
            return;
        }
        if segment.segment.checked_add(1) == Some(assembly.taken) {
            // The response record of this segment was lost, so the client sent the segment again.
            assembly.points.truncate(assembly.before_last);
        } else if segment.segment == assembly.taken && assembly.taken < assembly.segments {
            assembly.taken += 1;
            assembly.before_last = assembly.points.len();
        } else {
            return;
        }
        if assembly.points.len() + segment.len() <= POINTS_MAX {
            assembly.points.extend(segment.points().map(|raw| Point::from(&raw)));
        }
        self.whole = None;
    }

    /// Processes the answer to a Trajectory frame. Response records arrive in the order of the frames. The first response record after a
    /// first segment therefore belongs to that segment.
    pub(crate) fn answered(&mut self, accepted: bool) {
        if let Some(next) = self.next.take() {
            self.whole = None;
            if accepted {
                self.current = Some(next);
            }
        }
    }

    /// Removes all uploads, because the controller may have lost its trajectory.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Returns the controller's trajectory if all its segments were received. `executes` is true if the controller
    /// executes it; a trajectory that is executed is always complete.
    pub(crate) fn trajectory(&mut self, executes: bool) -> Option<Arc<Trajectory>> {
        if executes {
            // The controller executes the trajectory, so it has accepted all segments, even if the response record of
            // the first one was lost.
            self.answered(true);
        }
        let current = self.current.as_ref().filter(|c| c.taken == c.segments && c.points.len() >= 2)?;
        let whole = || Arc::new(Trajectory { step_ms: current.step_ms, points: current.points.clone() });
        Some(self.whole.get_or_insert_with(whole).clone())
    }
}

#[cfg(test)]
mod tests {
    use jtc_wire::RawPoint;

    use super::*;

    /// Returns trajectory segments of two points each; the positions begin at `from`.
    fn frames(number: u16, from: i16, segments: u16) -> Vec<Vec<u8>> {
        let segment = |i: u16| {
            let point = |k: i16| RawPoint { position: [from + 2 * i as i16 + k; 6], ..RawPoint::default() };
            jtc_host::frame::segment(number, i, segments, 10, &[point(0), point(1)]).expect("it fits")
        };
        (0..segments).map(segment).collect()
    }

    fn positions(upload: &mut Upload) -> Option<Vec<i16>> {
        let trajectory = upload.trajectory(true)?;
        let raw = trajectory.raw().expect("it came from the wire");
        Some(raw.iter().map(|point| point.position[3]).collect())
    }

    #[test]
    fn an_upload_is_put_together_from_its_frames() {
        let mut upload = Upload::default();
        assert_eq!(upload.trajectory(false), None);
        for (i, frame) in frames(7, 100, 3).iter().enumerate() {
            assert_eq!(upload.trajectory(false), None);
            upload.sent(frame);
            if i == 1 {
                // The response record of this segment was lost.
                upload.sent(frame);
            }
            upload.answered(true);
        }
        assert_eq!(positions(&mut upload).unwrap(), [100, 101, 102, 103, 104, 105]);
        // The next trajectory is incomplete, so `trajectory` does not return it before its last segment arrives.
        upload.sent(&frames(8, 500, 2)[0]);
        upload.answered(true);
        assert_eq!(positions(&mut upload), None);
        upload.sent(&frames(8, 500, 2)[1]);
        assert_eq!(positions(&mut upload).unwrap(), [500, 501, 502, 503]);
        upload.forget();
        assert_eq!(positions(&mut upload), None);
    }

    #[test]
    fn an_upload_that_is_refused_leaves_the_one_before_it() {
        let mut upload = Upload::default();
        let (old, new) = (frames(1, 0, 2), frames(2, 300, 2));
        for frame in &old {
            upload.sent(frame);
        }
        upload.answered(true);
        upload.answered(true);
        // The client sends all frames of the new upload before the first answer. The controller then refuses each of
        // these frames.
        for frame in &new {
            upload.sent(frame);
        }
        upload.answered(false);
        upload.answered(false);
        assert_eq!(positions(&mut upload).unwrap(), [0, 1, 2, 3]);
    }

    #[test]
    fn numbers_at_the_end_of_their_range_are_no_segments() {
        let mut upload = Upload::default();
        let point = [RawPoint::default(); 2];
        for i in [0, u16::MAX, 1, u16::MAX] {
            upload.sent(&jtc_host::frame::segment(0, i, 2, 1, &point).expect("it fits"));
        }
        assert_eq!(upload.next.as_ref().map(|assembly| assembly.taken), Some(2));
    }

    #[test]
    fn whatever_comes_is_no_trajectory_of_a_million_points() {
        let mut upload = Upload::default();
        let point = [RawPoint::default(); 1500];
        for i in 0..100 {
            upload.sent(&jtc_host::frame::segment(0, i, 100, 1, &point).expect("it fits"));
        }
        assert!(upload.trajectory(true).is_none_or(|t| t.points.len() <= POINTS_MAX));
    }
}
