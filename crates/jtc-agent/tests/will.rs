//! Tests of the policy that applies to a motion after the agent was killed.
use crate::board;

use std::time::Duration;

use board::Board;
use jtc_agent::line::{Applied, Moves, Will};
use jtc_agent::{LineEvent, Policy, Role};
use jtc_wire::{ControllerState, ExecCommand, FrameType, RawPoint, TrajectoryState, fixed, trajectory};

/// Returns the values of the last will that were reported since the previous call, in order.
fn wills(board: &mut Board) -> Vec<Option<Will>> {
    let events = board.line.take_events().into_iter();
    events.filter_map(|event| if let LineEvent::Will(will) = event { Some(will) } else { None }).collect()
}

fn will(client: &str, policy: Policy, what: Moves) -> Option<Will> {
    Some(Will { client: client.into(), policy, what })
}

fn segment() -> Vec<u8> {
    let mut bytes = vec![0; 60_000];
    let n = trajectory(&mut bytes, (1, 0, 9), 1, vec![RawPoint::default(); 20]).expect("it fits");
    bytes.truncate(n);
    bytes
}

#[test]
fn a_will_is_there_from_the_upload_to_rest_and_is_that_of_who_commands() {
    let mut board = Board::new(115_200);
    board.status.state = ControllerState::HoldPos.into();
    let anna = board.join("anna", Role::Operator, Policy::Stop);
    board.run_ms(100);
    assert_eq!(wills(&mut board), []);
    board.send(anna, &segment());
    board.run_ms(300);
    assert_eq!(wills(&mut board), [will("anna", Policy::Stop, Moves::Upload)]);
    // The last will changes before any status shows the motion.
    board.send(anna, &fixed::exec(ExecCommand::Execute));
    board.run_ms(20);
    assert_eq!(wills(&mut board), [will("anna", Policy::Stop, Moves::Motion)]);
    board.status.trajectory = TrajectoryState::Execute.into();
    board.run_ms(3_000);
    board.line.set_policy(anna, Policy::Continue);
    board.run_ms(20);
    assert_eq!(wills(&mut board), [will("anna", Policy::Continue, Moves::Motion)]);
    // While no status arrives, the arm may still be moving, so the last will stays valid.
    board.deaf_until = board.now() + Duration::from_secs(3);
    board.run_ms(3_500);
    assert_eq!(wills(&mut board), []);
    // The last will stays valid after its client has disconnected. When another client takes the lease, the policy of that client
    // replaces the last will.
    let now = board.now();
    board.line.leave(anna, now);
    let bob = board.join("bob", Role::Operator, Policy::Pause);
    board.run_ms(20);
    board.send(bob, &fixed::gripper_control(true));
    board.run_ms(50);
    assert_eq!(wills(&mut board), [will("bob", Policy::Pause, Moves::Motion)]);
    let now = board.now();
    board.line.release_lease(bob, now).expect("it is his");
    board.run_ms(20);
    assert_eq!(wills(&mut board), [will("bob", Policy::Continue, Moves::Motion)]);
    board.status.trajectory = TrajectoryState::Finish.into();
    board.run_ms(1_100);
    assert_eq!(wills(&mut board), [None]);
}

#[test]
fn teaching_has_a_will_before_it_shows_and_an_upload_that_leads_nowhere_none_after_a_while() {
    let mut board = Board::new(115_200);
    board.status.state = ControllerState::HoldPos.into();
    let anna = board.join("anna", Role::Operator, Policy::Pause);
    board.send(anna, &fixed::TEACHING_MODE_ENABLE);
    board.run_ms(5_000);
    assert_eq!(wills(&mut board), [will("anna", Policy::Pause, Moves::Teaching)]);
    board.send(anna, &fixed::empty(FrameType::TeachingModeDisable));
    board.run_ms(1_500);
    assert_eq!(wills(&mut board), [None]);
    board.send(anna, &segment());
    board.run_ms(6_000);
    assert_eq!(wills(&mut board), [will("anna", Policy::Pause, Moves::Upload), None]);
}

/// If the controller has not confirmed a Stop, the Stop replaces a weaker policy in the last will. The next agent therefore sends
/// the Stop.
#[test]
fn a_stop_that_the_controller_does_not_take_is_left_to_the_next_agent() {
    let mut board = Board::new(115_200);
    board.status.trajectory = TrajectoryState::Execute.into();
    let anna = board.join("anna", Role::Operator, Policy::Continue);
    board.send(anna, &fixed::gripper_control(true));
    board.run_ms(200);
    assert_eq!(wills(&mut board), [will("anna", Policy::Continue, Moves::Motion)]);
    board.deaf_until = board.now() + Duration::from_secs(1);
    let now = board.now();
    board.line.halt_for(None, "the desk", ExecCommand::Stop, now);
    board.run_ms(900);
    // The owner of the line also calls `from_device` when no bytes have arrived.
    let now = board.now();
    board.line.from_device(&[], now);
    assert_eq!(wills(&mut board), [will("the desk", Policy::Stop, Moves::Motion)]);
}

#[test]
fn what_was_left_is_done_and_nothing_where_nothing_moves() {
    use TrajectoryState::{Execute, Finish, Pause as Paused};
    let (pause, stop) = (Applied::Sent(ExecCommand::Pause), Applied::Sent(ExecCommand::Stop));
    for (policy, state, trajectory, applied) in [
        (Policy::Continue, ControllerState::Operate, Execute, Applied::GoesOn),
        (Policy::Pause, ControllerState::Operate, Execute, pause),
        (Policy::Stop, ControllerState::Operate, Execute, stop),
        (Policy::Continue, ControllerState::HoldPos, Paused, Applied::GoesOn),
        (Policy::Pause, ControllerState::HoldPos, Paused, Applied::Paused),
        (Policy::Stop, ControllerState::HoldPos, Paused, stop),
        (Policy::Pause, ControllerState::Teaching, Finish, pause),
        (Policy::Continue, ControllerState::HoldPos, Finish, Applied::Rests),
        (Policy::Pause, ControllerState::HoldPos, Finish, Applied::Rests),
        (Policy::Stop, ControllerState::HoldPos, Finish, Applied::Rests),
    ] {
        let mut board = Board::new(115_200);
        (board.status.state, board.status.trajectory) = (state.into(), trajectory.into());
        board.run_ms(50);
        let now = board.now();
        assert_eq!(
            board.line.apply_left("anna", policy, now),
            applied,
            "{policy:?} {state:?} {trajectory:?}"
        );
        board.run_ms(300);
        // A hold-off begins only if a command was sent to a moving arm. The applied last will stays valid while the motion
        // continues.
        let sent = matches!(applied, Applied::Sent(_));
        assert_eq!(board.line.last_halt(), u64::from(sent));
        assert_eq!(
            board.arrived(FrameType::TeachingModeDisable) > 0,
            sent || (applied == Applied::Rests && policy != Policy::Continue)
        );
        let what = if state == ControllerState::Teaching { Moves::Teaching } else { Moves::Motion };
        let left = (applied != Applied::Rests).then(|| will("anna", policy, what));
        assert_eq!(wills(&mut board).last().cloned(), left, "{policy:?} {state:?} {trajectory:?}");
    }
}

/// Without a status, the agent cannot know that the arm is at rest. The applied last will therefore stays in the file for the next
/// agent.
#[test]
fn what_was_left_stays_in_force_while_the_controller_is_silent() {
    for policy in [Policy::Continue, Policy::Pause, Policy::Stop] {
        let mut board = Board::new(115_200);
        board.status.trajectory = TrajectoryState::Execute.into();
        board.deaf_until = board.now() + Duration::from_secs(4);
        let now = board.now();
        board.line.apply_left("anna", policy, now);
        board.run_ms(3_000);
        assert_eq!(board.line.will().cloned(), will("anna", policy, Moves::Motion), "{policy:?}");
        assert_eq!(wills(&mut board), [], "{policy:?}: it is as it was");
        // The controller reports that the arm is at rest again.
        board.status.trajectory = TrajectoryState::Finish.into();
        board.status.state = ControllerState::HoldPos.into();
        board.run_ms(3_000);
        assert_eq!(wills(&mut board).last(), Some(&None), "{policy:?}");
    }
}

/// If the controller refuses Teaching, the agent leaves no last will.
#[test]
fn teaching_that_is_refused_leaves_no_will() {
    let mut board = Board::new(115_200);
    board.status.state = ControllerState::Init.into();
    board.refuses = Some(FrameType::TeachingModeEnable);
    let anna = board.join("anna", Role::Operator, Policy::Stop);
    board.send(anna, &fixed::TEACHING_MODE_ENABLE);
    board.run_ms(2_500);
    assert_eq!(wills(&mut board).last(), Some(&None));
}
