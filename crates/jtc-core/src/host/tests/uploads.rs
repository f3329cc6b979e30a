//! Tests of uploads that are interrupted by a Stop, and of segments on a plain line (J-30, J-36, J-51).
use super::*;
use crate::execution::phase::Phase;
use crate::trajectory::check::{Quantity, Violation};

/// Executes all slices of a segment with two points.
fn send(controller: &mut Bench, number: u8, plain: bool, overtaken: bool) -> Result<(), DataStatus> {
    let body = body(number, 2);
    let segment = Segment::parse(&body).expect("a segment");
    controller.slice_progress = SliceProgress::Begin;
    loop {
        match controller.take_segment(&segment, &HostEvent { plain, overtaken, ..ON_LINE_0 }) {
            SliceOutcome::Unfinished(next) => controller.slice_progress = next,
            SliceOutcome::Done => return Ok(()),
            SliceOutcome::Refused(status) => return Err(status),
        }
    }
}

/// On a plain line, the host repeats segment 0 until it is accepted, and sends no Stop before. Therefore segment 0
/// stops the path.
#[test]
fn j30_segment_0_on_a_plain_line_stops_a_path() {
    let stop = Some(TrajectoryState::Stop);
    for (segment, plain, leave) in [(0, true, stop), (1, true, None), (0, false, None), (1, false, None)] {
        let mut controller = holding();
        (controller.state, controller.trajectory) = (ControllerState::Operate, TrajectoryState::Execute);
        controller.phase = Phase::Running { leave: None };
        assert_eq!(send(&mut controller, segment, plain, false), Err(DataStatus::NotAllowed));
        assert_eq!(controller.phase, Phase::Running { leave }, "{segment} {plain}");
    }
}

/// A Stop arrives after the segments and takes effect before the controller processes them (`overtaken`). If the line
/// is not plain, the controller refuses the segments and Execute. If the line is plain, it accepts the segments and
/// refuses Execute.
#[test]
fn j30_a_stop_after_segment_0_refuses_the_upload_or_its_execution() {
    let not_allowed = Err(DataStatus::NotAllowed);
    for (plain, overtaken, segments, execute) in [
        (false, true, not_allowed, not_allowed),
        (true, true, Ok(()), not_allowed),
        (false, false, Ok(()), Ok(())),
        (true, false, Ok(()), Ok(())),
    ] {
        let mut controller = holding();
        controller.priorities[0].stopped = true;
        assert_eq!(send(&mut controller, 0, plain, overtaken), segments, "{plain} {overtaken}");
        assert_eq!(send(&mut controller, 1, plain, overtaken), segments, "{plain} {overtaken}");
        assert_eq!(controller.execute(ExecCommand::Execute), execute, "{plain} {overtaken}");
    }
}

/// Segment 0 came on a plain line. The host has used an extension since then, so the line is not plain any more. A Stop
/// nevertheless does not refuse the later segment, but the controller refuses Execute.
#[test]
fn j30_j51_a_stop_does_not_refuse_a_later_segment_of_an_upload_that_began_plain() {
    let mut controller = holding();
    assert_eq!(send(&mut controller, 0, true, false), Ok(()));
    controller.priorities[0].stopped = true;
    assert_eq!(controller.execute(ExecCommand::Stop), Ok(()));
    assert_eq!(send(&mut controller, 1, false, true), Ok(()));
    assert_eq!(controller.execute(ExecCommand::Execute), Err(DataStatus::NotAllowed));
}

/// A Stop that arrives between the check and the copy of segment 0 drops the upload.
#[test]
fn j30_a_stop_drops_an_upload_whose_segment_0_is_copied() {
    for (stops, expected) in [(false, Ok(())), (true, Err(DataStatus::NotAllowed))] {
        let mut controller = holding();
        let body = body(0, 2);
        let segment = Segment::parse(&body).expect("a segment");
        let SliceOutcome::Unfinished(next) = controller.take_segment(&segment, &ON_LINE_0) else {
            panic!("the copy needs another slice")
        };
        assert_eq!(next, SliceProgress::PointCopy(0));
        controller.slice_progress = next;
        if stops {
            assert_eq!(controller.execute(ExecCommand::Stop), Ok(()));
        }
        let outcome = match controller.take_segment(&segment, &ON_LINE_0) {
            SliceOutcome::Done => Ok(()),
            SliceOutcome::Refused(status) => Err(status),
            SliceOutcome::Unfinished(next) => panic!("{next:?}"),
        };
        assert_eq!(outcome, expected, "{stops}");
        assert_eq!(controller.store.tail().is_some(), !stops);
    }
}

/// A violation that the check found in one upload is cleared by segment 0 of the next upload.
#[test]
fn j36_a_new_upload_is_not_refused_for_the_last_violation() {
    let violation =
        Violation { point: 0, fraction: 0.0, joint: 3, quantity: Quantity::Position, value: 9.0, limit: 3.0 };
    let mut controller = holding();
    assert_eq!(send(&mut controller, 0, true, false), Ok(()));
    controller.store.refuse(violation);
    assert_eq!(send(&mut controller, 1, true, false), Ok(()));
    assert_eq!(controller.violation(), Some(&violation));
    assert_eq!(controller.store.refused(), Some(violation));
    assert_eq!(send(&mut controller, 0, true, false), Ok(()));
    assert_eq!((controller.violation(), controller.store.refused()), (None, None));
}
