//! Segments of a trajectory: acceptance (J-30), and checking and copying in slices (J-36).
use jtc_wire::{DataStatus, ExecCommand, RawPoint, Segment};

use super::slices::{SliceOutcome, SliceProgress};
use crate::controller::Controller;
use crate::io::HostEvent;
use crate::trajectory::check::{TrajectoryCheck, Violation};
use crate::{ControllerState, TrajectoryState};

/// Highest number of ticks for checking a segment (J-36). `COPY_TICKS` is the highest number of ticks for copying it.
/// Checking, copying and the response record together take less than 40 ms.
const CHECK_TICKS: usize = 28;
const COPY_TICKS: usize = 10;
/// Number of points that a tick checks in a short segment. `COPIED_PER_TICK` is the number of points that a tick
/// copies.
const CHECKED_PER_TICK: usize = 16;
const COPIED_PER_TICK: usize = 64;

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Checks and stores a segment of a trajectory (J-30, J-36). The controller checks all points before it copies the first point, so a
    /// refused segment does not change the trajectory.
    pub(super) fn take_segment(&mut self, segment: &Segment<'_>, received: &HostEvent<'_>) -> SliceOutcome {
        let first = segment.segment == 0;
        if self.state == ControllerState::Operate && first && received.plain {
            // A host on a plain line repeats segment 0 until it is accepted, and sends no Stop before. Therefore the
            // segment also acts as a Stop. In this tick, the segment itself is refused.
            self.execute(ExecCommand::Stop).ok();
        }
        if self.state != ControllerState::HoldPos {
            // If the controller has left HoldPos while it processes a segment, it has cleared the trajectory. The
            // controller then refuses the segment.
            return SliceOutcome::Refused(DataStatus::NotAllowed);
        }
        // `true` if this segment arrived before a Stop that has already taken effect.
        let stopped =
            received.overtaken && self.priorities.get(received.line).is_some_and(|before| before.stopped);
        if first && !received.plain && stopped {
            self.store.refuse_rest();
            return SliceOutcome::Refused(DataStatus::NotAllowed);
        }
        // A Stop that arrives while the controller processes this segment also drops the upload.
        let begun = !first || matches!(self.slice_progress, SliceProgress::PointCopy(_));
        if begun && self.store.dropped() {
            return SliceOutcome::Refused(DataStatus::NotAllowed);
        }
        match self.slice_progress {
            SliceProgress::PointCopy(from) => self.copy_points(segment, from),
            SliceProgress::PointCheck(from) => self.check_points(segment, from, received.plain, stopped),
            _ => match self.store.check(segment) {
                Err(status) => SliceOutcome::Refused(status),
                Ok(()) => {
                    self.begin_check(segment);
                    match self.store.refused().filter(|_| !first) {
                        // A violation in an earlier segment is enough to refuse the trajectory. This violation stays
                        // stored.
                        Some(violation) => self.take_refused(segment, violation, stopped),
                        None => self.check_points(segment, 0, received.plain, stopped),
                    }
                }
            },
        }
    }

    /// Begins the check of a segment. Segment 0 begins a new check of the trajectory. Each later segment continues the check after the
    /// points received so far.
    fn begin_check(&mut self, segment: &Segment<'_>) {
        let tables = self.parameters.tables_in_use();
        let check = TrajectoryCheck::new(&self.config, segment.step_time, tables);
        self.check = match self.store.tail() {
            Some((points, last, passed)) if segment.segment > 0 => check.behind(points, last, passed),
            _ => check,
        };
        self.violation = None;
    }

    fn check_points(
        &mut self,
        segment: &Segment<'_>,
        from: usize,
        plain: bool,
        stopped: bool,
    ) -> SliceOutcome {
        let slice = segment.len().div_ceil(CHECK_TICKS).max(CHECKED_PER_TICK);
        let mut points = segment.points_from(from).take(slice);
        let mut verdict = points.try_for_each(|point| self.check.take(&point));
        if verdict.is_ok() && from + slice < segment.len() {
            return SliceOutcome::Unfinished(SliceProgress::PointCheck(from + slice));
        }
        if segment.segment + 1 == segment.segments {
            verdict = verdict.and_then(|()| self.check.end());
        }
        let plain = if segment.segment == 0 { plain } else { self.store.plain() };
        match verdict {
            Ok(()) => self.begin_copy(segment, plain, stopped),
            Err(violation) if plain => self.take_refused(segment, violation, stopped),
            Err(violation) => {
                self.violation = Some(violation);
                SliceOutcome::Refused(DataStatus::IncorrectValue)
            }
        }
    }

    /// Accepts a segment of a trajectory that violates J-36, because a host on a plain line cannot handle a refused segment. The controller
    /// will not execute this trajectory.
    fn take_refused(&mut self, segment: &Segment<'_>, violation: Violation, stopped: bool) -> SliceOutcome {
        let outcome = self.begin_copy(segment, true, stopped);
        self.violation = Some(violation);
        self.store.refuse(violation);
        outcome
    }

    fn begin_copy(&mut self, segment: &Segment<'_>, plain: bool, stopped: bool) -> SliceOutcome {
        self.store.begin(segment, plain, stopped);
        if segment.segment == 0 {
            self.set_trajectory(TrajectoryState::Null);
            self.parameters.friction_is_new = false;
        }
        SliceOutcome::Unfinished(SliceProgress::PointCopy(0))
    }

    fn copy_points(&mut self, segment: &Segment<'_>, from: usize) -> SliceOutcome {
        let slice = segment.len().div_ceil(COPY_TICKS).max(COPIED_PER_TICK);
        let to = (from + slice).min(segment.len());
        self.store.copy(segment, from, to);
        if to < segment.len() {
            return SliceOutcome::Unfinished(SliceProgress::PointCopy(to));
        }
        self.store.commit(segment, self.check.passed());
        if self.store.complete() {
            self.set_trajectory(TrajectoryState::Stop);
        }
        SliceOutcome::Done
    }
}
