//! Segments of a trajectory: accepted (J-30), checked and copied in slices (J-36).
use jtc_wire::{Command, DataStatus, ExecCommand, RawPoint, Segment};

use super::slices::{SliceOutcome, SliceProgress};
use crate::check::{TrajectoryCheck, Violation};
use crate::controller::Controller;
use crate::io::HostEvent;
use crate::remembered::remembered;
use crate::{ControllerState, TrajectoryState};

/// Maximum number of ticks for the check of a segment (J-36), and ticks for copying it: with the record, less than 40 ms.
const CHECK_TICKS: usize = 28;
const COPY_TICKS: usize = 10;
/// Points of a short segment checked and copied in one tick.
const CHECKED_PER_TICK: usize = 16;
const COPIED_PER_TICK: usize = 64;

/// State of a line for the last upload that was begun on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LineUpload {
    /// Its segment 0 came on a plain line (J-51). `None` before the first, and after the Execute of one that did not.
    plain: Option<bool>,
}

remembered!(LineUpload { plain });

impl LineUpload {
    /// Returns `true` if the record of a `command` has plain words, as decided by the segment 0 of its upload.
    pub fn in_plain_words(&mut self, command: &Command<'_>, plain: bool) -> bool {
        match command {
            Command::Trajectory(segment) if segment.segment == 0 => *self.plain.insert(plain),
            Command::Trajectory(_) | Command::TrajSetExecStatus(ExecCommand::Execute) => {
                self.plain.unwrap_or(plain)
            }
            _ => plain,
        }
    }

    /// Notes that a trajectory is executed. Another client that executes it again has not shown yet if it knows the extensions.
    pub fn executed(&mut self) {
        self.plain = self.plain.filter(|plain| *plain);
    }
}

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Takes a segment (J-30, J-36): all points are checked before the first is copied, so that a refused segment changes nothing.
    pub(super) fn take_segment(&mut self, segment: &Segment<'_>, received: &HostEvent<'_>) -> SliceOutcome {
        let first = segment.segment == 0;
        if self.state == ControllerState::Operate && first && received.plain {
            // The host repeats the segment until it is accepted, and forwards no Stop meanwhile. The segment is refused in the tick of this
            // Stop.
            self.execute(ExecCommand::Stop).ok();
        }
        if self.state != ControllerState::HoldPos {
            // Also in the middle of a segment: the change of state has cleared the trajectory.
            return SliceOutcome::Refused(DataStatus::NotAllowed);
        }
        // The segment is older than a Stop that has acted.
        let stopped =
            received.overtaken && self.overtaking.get(received.line).is_some_and(|before| before.stopped);
        if first && !received.plain && stopped {
            self.store.refuse_rest();
            return SliceOutcome::Refused(DataStatus::NotAllowed);
        }
        // Also in the middle of a segment.
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
                        // A single violation is enough, and the first one is kept.
                        Some(violation) => self.take_refused(segment, violation, stopped),
                        None => self.check_points(segment, 0, received.plain, stopped),
                    }
                }
            },
        }
    }

    /// Begins the check: segment 0 begins a trajectory, other segments continue after the received ones.
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

    /// Takes a segment of a trajectory that breaks J-36, whose host, on a plain line, survives no refused segment: the trajectory is not
    /// executed.
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
