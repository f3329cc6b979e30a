//! Tests of many clients on one serial line. The tests check which client receives a response record, which client may send commands, and
//! how soon a Stop is sent.
use crate::board;

use std::time::Duration;

use board::Board;
use jtc_agent::line::{ClientId, OWNER};
use jtc_agent::{LineEvent, Policy, Role};
use jtc_wire::{
    ControllerState, DataStatus, ExecCommand, FrameType, RawPoint, SettingValue, TrajectoryState, fixed,
    trajectory,
};
use proptest::prelude::*;

const PAUSE: [u8; 7] = fixed::exec(ExecCommand::Pause);
const STOP: [u8; 7] = fixed::exec(ExecCommand::Stop);
const EXECUTE: [u8; 7] = fixed::exec(ExecCommand::Execute);

/// Returns a trajectory segment of `points` points.
fn segment(points: usize) -> Vec<u8> {
    let points = vec![RawPoint::default(); points];
    let mut bytes = vec![0; 60_000];
    let n = trajectory(&mut bytes, (1, 0, 9), 1, points).expect("it fits");
    bytes.truncate(n);
    bytes
}

fn operator(board: &mut Board, name: &str) -> ClientId {
    board.join(name, Role::Operator, Policy::Continue)
}

fn ask(board: &mut Board, client: ClientId) -> Result<(), jtc_agent::Denied> {
    let (now, last) = (board.now(), board.line.last_halt());
    board.line.ask_to_move(client, last, now)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn j04_j05_a_stop_in_the_middle_of_an_upload_is_on_the_line_within_40_ms(
        after_us in 0u64..400_000, points in 20usize..1666, viewer in any::<bool>(), pieces in 1usize..5000,
    ) {
        let mut board = Board::new(115_200);
        let uploader = operator(&mut board, "anna");
        let other = board.join("bob", if viewer { Role::Viewer } else { Role::Operator }, Policy::Continue);
        let bytes: Vec<u8> = (0..4).flat_map(|_| segment(points)).collect();
        bytes.chunks(pieces).for_each(|piece| board.send(uploader, piece));
        board.run_ms(after_us / 1000);
        let before = board.arrived(FrameType::Trajectory);
        board.send(other, &STOP);
        let asked = board.now();
        board.run_ms(100);
        let at = board.frames.iter().find(|(_, t, _)| *t == Some(FrameType::TrajSetExecStatus)).expect("it came").0;
        prop_assert!(at - asked <= Duration::from_millis(40), "{:?}", at - asked);
        // After the Stop, no further frame of the upload arrives, and the client of the upload receives the reason.
        board.run_ms(6_000);
        let behind = board.frames.iter().filter(|(t, kind, _)| *t > at && kind.is_some()).count();
        prop_assert_eq!(behind, 0);
        let after = board.arrived(FrameType::Trajectory);
        prop_assert!(after <= before + 1);
        let (records, denied) = board.take(uploader);
        let refused = records.iter().filter(|r| r.data == DataStatus::NotAllowed).count();
        prop_assert_eq!(refused, 4 - after);
        prop_assert!(denied.len() == refused && denied.iter().all(|why| why.contains("bob has stopped")));
        // The client that stopped the arm receives the response record of its Stop.
        let (records, _) = board.take(other);
        prop_assert!(records.len() == 1 && records[0].accepted());
    }

    /// The operating system may accept bytes with a delay. At most 256 bytes wait in the operating system, and the pause before a Stop
    /// separates the Stop from the interrupted frame.
    #[test]
    fn j04_j05_a_stop_in_an_upload_on_a_busy_computer_is_a_frame_of_its_own(
        after_us in 0u64..400_000, points in 20usize..1666, held_up_us in prop::collection::vec(0u64..15_000, 0..20),
    ) {
        let mut board = Board::new(115_200);
        let anna = operator(&mut board, "anna");
        let bob = board.join("bob", Role::Viewer, Policy::Continue);
        board.held_up_us = held_up_us.into();
        (0..4).for_each(|_| board.send(anna, &segment(points)));
        board.run_ms(after_us / 1000);
        board.send(bob, &STOP);
        board.run_ms(100);
        // If the operating system delays the bytes of a frame, the board sends several error records for this frame.
        // If an error record may belong to the Stop, the line sends the Stop again. Each Stop arrives as a complete
        // frame.
        let stops = board.written.iter().filter(|(_, bytes)| bytes.ends_with(&STOP)).count();
        prop_assert!(stops >= 1);
        prop_assert_eq!(board.arrived(FrameType::TrajSetExecStatus), stops);
        prop_assert!(board.queued_most <= 256, "{}", board.queued_most);
    }

    #[test]
    fn j04_each_client_has_the_records_of_its_own_frames_in_their_order(
        frames in prop::collection::vec((0usize..3, 0usize..6), 1..60), seed_ms in 1u64..40,
    ) {
        let mut board = Board::new(115_200);
        let clients = [operator(&mut board, "a"), operator(&mut board, "b"), operator(&mut board, "c")];
        let asks = [FrameType::GetInfo, FrameType::TrajSetExecStatus];
        let mut sent = [Vec::new(), Vec::new(), Vec::new()];
        for (client, kind) in frames {
            // All clients send read requests. Only the first client also sends a command.
            let frame: Vec<u8> = match (client, kind) {
                (_, 0) => fixed::GET_INFO.to_vec(),
                (_, 1) => fixed::get_arm(256).to_vec(),
                (0, 2) => fixed::CLEAR_OCCURRED_ERRORS.to_vec(),
                (0, 3) => fixed::gripper_control(true).to_vec(),
                (0, _) => segment(kind),
                _ => fixed::get_settings(0).to_vec(),
            };
            sent[client].push(frame[1]);
            board.send(clients[client], &frame);
            board.run_ms(seed_ms);
        }
        // A request for a frame of the controller waits until the previous request is answered. The simulated board
        // never sends the requested frames, so each request waits for its full timeout.
        board.run_ms(60 * 520 + 2000);
        for (client, sent) in clients.iter().zip(&sent) {
            let (records, denied) = board.take(*client);
            prop_assert_eq!(denied.len(), 0);
            let got: Vec<u8> = records.iter().map(|r| r.frame_type).collect();
            prop_assert_eq!(&got, sent, "{:?}", asks);
        }
    }

    #[test]
    fn what_clients_send_at_random_puts_them_out_and_nobody_else(
        noise in prop::collection::vec(any::<u8>(), 0..200), header in any::<bool>(),
    ) {
        let mut board = Board::new(115_200);
        let (a, b) = (operator(&mut board, "a"), operator(&mut board, "b"));
        let bytes = if header { [&[0x9B, 0x04, 0x00][..], &noise].concat() } else { noise };
        board.send(a, &bytes);
        board.send(b, &fixed::CLEAR_OCCURRED_ERRORS);
        board.run_ms(200);
        // Only complete valid frames are written to the line.
        prop_assert!(board.frames.iter().all(|(_, kind, _)| *kind == Some(FrameType::ClearOccurredErrors)));
        prop_assert_eq!(board.take(b).0.len(), 1);
    }
}

#[test]
fn a_stop_on_a_quiet_line_is_written_within_5_ms() {
    let mut board = Board::new(115_200);
    let viewer = board.join("tablet", Role::Viewer, Policy::Continue);
    for n in 0..40 {
        board.run_ms(7);
        let before = board.written.len();
        let asked = board.now();
        board.send(viewer, &STOP);
        board.run_ms(100);
        assert!(board.written[before].0 - asked <= Duration::from_millis(5), "{n}");
    }
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 40);
}

#[test]
fn one_client_commands_and_all_see_who() {
    let mut board = Board::new(115_200);
    let (a, b) = (operator(&mut board, "anna"), operator(&mut board, "bob"));
    let viewer = board.join("tablet", Role::Viewer, Policy::Continue);
    board.send(a, &fixed::CLEAR_OCCURRED_ERRORS);
    assert_eq!(board.line.lease().map(|lease| lease.holder), Some(a));
    board.run_ms(12_000);
    for (client, why) in
        [(b, "anna has held the lease of this arm for 12 s"), (viewer, "can only read and stop")]
    {
        board.take(client);
        board.send(client, &fixed::gripper_control(true));
        board.run_ms(100);
        let (records, denied) = board.take(client);
        assert!(records.len() == 1 && records[0].data == DataStatus::NotAllowed, "{records:?}");
        assert_eq!(records[0].frame_type, FrameType::GripperControl as u8);
        assert!(denied.len() == 1 && denied[0].contains(why), "{denied:?}");
    }
    assert_eq!(board.arrived(FrameType::GripperControl), 0);
    // When the lease holder releases the lease, the waiting client receives the lease.
    let now = board.now();
    board.line.want_lease(b, now).expect("somebody has it");
    assert!(board.take(a).1.contains(&"bob wants it".to_owned()));
    let now = board.now();
    assert!(board.line.release_lease(b, now).is_err());
    board.line.release_lease(a, now).expect("it has it");
    assert_eq!(board.line.lease().map(|lease| lease.holder), Some(b));
    board.send(b, &fixed::gripper_control(true));
    board.run_ms(100);
    assert_eq!(board.arrived(FrameType::GripperControl), 1);
}

#[test]
fn a_lease_that_is_not_renewed_lapses_and_its_policy_counts() {
    for (policy, wanted) in [(Policy::Continue, None), (Policy::Pause, Some(2)), (Policy::Stop, Some(1))] {
        let mut board = Board::new(115_200);
        board.status.trajectory = TrajectoryState::Execute.into();
        board.status.state = ControllerState::Operate.into();
        let a = board.join("anna", Role::Operator, policy);
        let b = operator(&mut board, "bob");
        board.run_ms(50);
        let now = board.now();
        board.line.take_lease(a, Some(Duration::from_secs(3)), now).expect("nobody has it");
        board.run_ms(2_900);
        let now = board.now();
        assert!(board.line.take_lease(b, None, now).is_err());
        board.line.take_lease(a, Some(Duration::from_secs(3)), now).expect("it is renewed");
        board.run_ms(2_900);
        assert!(board.line.lease().is_some());
        board.run_ms(200);
        assert_eq!(board.line.lease(), None, "{policy:?}");
        let sent = board.frames.iter().find(|f| f.1 == Some(FrameType::TrajSetExecStatus)).map(|f| f.2[4]);
        // The agent ends Teaching, so the arm is in position hold again.
        assert_eq!(board.arrived(FrameType::TeachingModeDisable), usize::from(wanted.is_some()));
        assert_eq!(sent, wanted, "{policy:?}");
        let now = board.now();
        board.line.take_lease(b, None, now).expect("nobody has it");
    }
}

#[test]
fn a_client_that_goes_leaves_its_policy_and_no_half_frame() {
    let mut board = Board::new(115_200);
    board.status.trajectory = TrajectoryState::Execute.into();
    let a = board.join("anna", Role::Operator, Policy::Stop);
    let b = operator(&mut board, "bob");
    board.run_ms(50);
    board.send(a, &segment(1000));
    board.run_ms(500);
    let now = board.now();
    board.line.leave(a, now);
    board.run_ms(100);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 1);
    assert!(board.line.take_events().iter().any(|e| matches!(e, LineEvent::PolicyApplied { .. })));
    board.send(b, &fixed::CLEAR_OCCURRED_ERRORS);
    board.run_ms(100);
    assert_eq!((board.arrived(FrameType::ClearOccurredErrors), board.arrived(FrameType::Trajectory)), (1, 0));
    let (records, _) = board.take(b);
    assert_eq!(records.len(), 1, "the record of the half frame is nobody's: {records:?}");
}

#[test]
fn what_may_have_been_on_its_way_when_somebody_stopped_begins_no_motion() {
    let mut board = Board::new(115_200);
    let (a, b) = (operator(&mut board, "anna"), operator(&mut board, "bob"));
    board.send(a, &fixed::CLEAR_OCCURRED_ERRORS);
    board.run_ms(100);
    board.send(b, &STOP);
    board.run_ms(100);
    board.send(a, &EXECUTE);
    board.send(a, &fixed::gripper_control(false));
    board.run_ms(100);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 1);
    assert_eq!(board.arrived(FrameType::GripperControl), 1, "it moves nothing");
    // A program may ignore the refusal, repeat the command, and send an upload. The agent sends no frame of this
    // program to the controller.
    for _ in 0..20 {
        board.run_ms(400);
        board.send(a, &EXECUTE);
        board.send(a, &segment(1));
    }
    board.run_ms(100);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 1, "nobody has asked for it since");
    assert_eq!(board.arrived(FrameType::Trajectory), 0);
    // A request for a motion must contain the number of the last Stop.
    let (now, last) = (board.now(), board.line.last_halt());
    assert!(board.line.ask_to_move(a, last - 1, now).is_err());
    board.send(a, &EXECUTE);
    board.run_ms(100);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 1);
    board.line.ask_to_move(a, last, now).expect("it is long ago");
    board.send(a, &EXECUTE);
    board.run_ms(100);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 2);
    // Frames that a client sent before its own Stop do not start a motion either.
    let before = board.frames.len();
    board.send(a, &segment(1600));
    board.run_ms(50);
    for frame in [STOP, EXECUTE, STOP] {
        board.send(a, &frame);
    }
    board.run_ms(200);
    let sent: Vec<u8> = board.frames[before..].iter().filter(|f| f.1.is_some()).map(|f| f.2[4]).collect();
    assert_eq!(sent, [1]);
    // The client that sent the Stop may start a motion again at once.
    board.send(a, &STOP);
    board.send(a, &EXECUTE);
    board.run_ms(100);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 5);
}

#[test]
fn a_client_that_never_reads_is_put_out_and_nobody_else_notices() {
    let mut board = Board::new(115_200);
    let (deaf, a) = (board.join("deaf", Role::Viewer, Policy::Continue), operator(&mut board, "anna"));
    for _ in 0..200 {
        board.run_ms(1_000);
        board.send(a, &fixed::CLEAR_OCCURRED_ERRORS);
        board.run_ms(50);
        assert_eq!(board.take(a).0.len(), 1);
    }
    assert_eq!(board.line.take_deliveries(deaf), None);
    assert_eq!(board.line.clients(), 1);
}

#[test]
fn a_client_that_sends_without_end_is_put_out() {
    let mut board = Board::new(115_200);
    let a = operator(&mut board, "a");
    for _ in 0..20 {
        board.send(a, &segment(1666));
    }
    assert_eq!(board.line.take_deliveries(a), None);
}

/// The controller begins Teaching only in position hold, and refuses a Stop before that. If the agent did not end
/// Teaching, the arm would become compliant after the Stop.
#[test]
fn somebody_who_stops_an_arm_ends_the_teaching_that_was_asked_for() {
    for damaged in [0, 10] {
        let mut board = Board::new(115_200);
        board.status.state = ControllerState::HoldPos.into();
        let (a, b) = (operator(&mut board, "anna"), operator(&mut board, "bob"));
        board.send(b, &STOP);
        board.run_ms(500);
        assert_eq!(board.arrived(FrameType::TeachingModeDisable), 0, "nobody teaches");
        board.run_ms(3_000);
        ask(&mut board, a).expect("it is long ago");
        board.send(a, &fixed::TEACHING_MODE_ENABLE);
        board.run_ms(500);
        board.damaged = damaged;
        board.send(b, &STOP);
        board.run_ms(1_000);
        assert_eq!(board.arrived(FrameType::TeachingModeDisable), 1);
        assert!(board.line.is_idle());
        // A Stop also ends Teaching if Teaching is active. When Teaching has ended, the agent does not send the frame
        // that ends Teaching again.
        board.status.state = ControllerState::Teaching.into();
        board.run_ms(100);
        board.send(b, &STOP);
        board.run_ms(500);
        assert_eq!(board.arrived(FrameType::TeachingModeDisable), 2);
        board.status.state = ControllerState::HoldPos.into();
        board.run_ms(100);
        board.send(b, &STOP);
        board.run_ms(500);
        assert_eq!(board.arrived(FrameType::TeachingModeDisable), 2);
    }
}

/// If a client disconnects while the arm is at rest, no hold-off begins for the other clients.
#[test]
fn a_policy_where_nothing_moves_stops_nobody_else() {
    for (state, moves, sent) in [
        (ControllerState::HoldPos, false, None),
        (ControllerState::Operate, true, None),
        (ControllerState::Teaching, true, None),
        (ControllerState::HoldPos, true, Some(EXECUTE.to_vec())),
        (ControllerState::HoldPos, true, Some(fixed::TEACHING_MODE_ENABLE.to_vec())),
    ] {
        let mut board = Board::new(115_200);
        board.status.state = state.into();
        let (a, b) = (board.join("anna", Role::Operator, Policy::Stop), operator(&mut board, "bob"));
        board.send(a, &fixed::CLEAR_OCCURRED_ERRORS);
        board.run_ms(500);
        if let Some(frame) = &sent {
            board.send(a, frame);
            board.run_ms(100);
        }
        let before = board.arrived(FrameType::TrajSetExecStatus);
        let now = board.now();
        board.line.leave(a, now);
        board.run_ms(100);
        assert_eq!(board.arrived(FrameType::TrajSetExecStatus), before + 1, "in doubt it is stopped");
        assert_eq!(ask(&mut board, b).is_err(), moves, "{state:?} {sent:?}");
        let applied = board.line.take_events().iter().any(|e| matches!(e, LineEvent::PolicyApplied { .. }));
        assert_eq!(applied, moves);
    }
}

/// After its lease has lapsed, a client with the policy Continue takes the lease again for its upload. If the client has the policy Pause,
/// its upload ends.
#[test]
fn an_upload_whose_lease_lapses_goes_on_by_its_policy() {
    for (policy, arrived) in [(Policy::Continue, 4), (Policy::Pause, 0)] {
        let mut board = Board::new(115_200);
        let a = board.join("anna", Role::Operator, policy);
        let now = board.now();
        board.line.take_lease(a, Some(Duration::from_secs(1)), now).expect("nobody has it");
        ask(&mut board, a).expect("nobody has stopped anything");
        for _ in 0..4 {
            board.send(a, &segment(500));
        }
        board.run_ms(9_000);
        assert_eq!(board.arrived(FrameType::Trajectory), arrived, "{policy:?}");
        assert!(board.line.lease().is_none());
        // If the client has the policy Pause, its later commands also do not take the lease again.
        board.send(a, &fixed::gripper_control(true));
        assert_eq!(board.line.lease().is_some(), policy == Policy::Continue);
        let now = board.now();
        if policy == Policy::Pause {
            assert!(board.line.is_halted(a) && board.line.halted_by(a).contains("policy"));
            board.line.take_lease(a, None, now).expect("it asks for it");
            assert!(board.line.is_halted(a), "what it was asked for before is over");
            let (_, denied) = board.take(a);
            assert!(!denied.is_empty() && denied.iter().all(|why| !why.starts_with(' ')), "{denied:?}");
        }
    }
}

#[test]
fn a_client_that_sends_too_much_can_stop_the_arm_all_the_same() {
    let mut board = Board::new(115_200);
    let a = operator(&mut board, "anna");
    let mut bytes = fixed::GET_INFO.repeat(500);
    bytes.extend(STOP);
    board.send(a, &bytes);
    board.run_ms(200);
    assert_eq!(board.line.take_deliveries(a), None, "it is put out");
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 1);
}

/// If a jog key is held down during a Stop, the user must release the key before the key can move the arm again.
#[test]
fn who_goes_on_asking_for_a_jog_behind_a_stop_does_not_get_it() {
    let mut board = Board::new(115_200);
    let (a, b) = (operator(&mut board, "anna"), operator(&mut board, "bob"));
    board.send(b, &STOP);
    for _ in 0..80 {
        board.run_ms(80);
        let (now, last) = (board.now(), board.line.last_halt());
        assert!(board.line.ask_to_jog(a, last, now).is_err());
    }
    board.run_ms(600);
    let (now, last) = (board.now(), board.line.last_halt());
    board.line.ask_to_jog(a, last, now).expect("it was let go");
}

#[test]
fn j04_a_stop_that_the_line_damages_is_sent_again_for_whoever_asked() {
    let mut board = Board::new(115_200);
    let viewer = board.join("tablet", Role::Viewer, Policy::Continue);
    board.damaged = 3;
    let now = board.now();
    board.line.halt(OWNER, "http", ExecCommand::Stop, now);
    board.run_ms(2_000);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 1);
    assert!(board.line.is_idle());
    // A viewer requests many Pauses before and after the Stop of another client. The last command on the serial line is a Stop, and the
    // viewer receives a response record.
    for _ in 0..100 {
        board.send(viewer, &PAUSE);
    }
    let now = board.now();
    board.line.halt(OWNER, "http", ExecCommand::Stop, now);
    for _ in 0..100 {
        board.send(viewer, &PAUSE);
    }
    board.run_ms(500);
    let last = board.frames.iter().rev().find(|f| f.1 == Some(FrameType::TrajSetExecStatus)).map(|f| f.2[4]);
    assert_eq!(last, Some(1));
    assert!(board.arrived(FrameType::TrajSetExecStatus) <= 3);
    assert!(!board.take(viewer).0.is_empty());
}

#[test]
fn what_was_sent_under_a_lease_that_is_gone_is_not_written_under_another() {
    let mut board = Board::new(115_200);
    let (a, b) = (operator(&mut board, "anna"), operator(&mut board, "bob"));
    board.send(a, &[segment(1500), segment(1500), EXECUTE.to_vec()].concat());
    board.run_ms(100);
    let now = board.now();
    board.line.want_lease(b, now).expect("anna commands");
    let now = board.now();
    board.line.release_lease(a, now).expect("she has it");
    board.run_ms(15_000);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 0);
    assert_eq!(board.arrived(FrameType::Trajectory), 1, "the one that was on the line");
}

#[test]
fn a_flood_of_frames_puts_its_sender_out_and_stops_go_on() {
    let mut board = Board::new(115_200);
    let (flood, b) = (board.join("x", Role::Viewer, Policy::Continue), operator(&mut board, "bob"));
    for _ in 0..50 {
        board.send(flood, &[fixed::gripper_control(true); 20].concat());
        board.run_ms(1);
    }
    assert_eq!(board.line.take_deliveries(flood), None);
    board.send(b, &STOP);
    board.run_ms(50);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 1);
}

#[test]
fn a_pause_whose_record_is_lost_does_not_take_the_place_of_a_stop_behind_it() {
    let mut board = Board::new(115_200);
    board.deaf_until = Duration::from_millis(300);
    let (a, b) =
        (board.join("a", Role::Viewer, Policy::Continue), board.join("b", Role::Viewer, Policy::Continue));
    board.send(a, &PAUSE);
    board.run_ms(100);
    board.send(b, &STOP);
    board.run_ms(3_000);
    let sent: Vec<u8> = board.frames.iter().map(|f| f.2[4]).collect();
    let stop = sent.iter().position(|command| *command == 1).expect("it came");
    assert!(sent[stop..].iter().all(|command| *command == 1), "{sent:?}");
    assert!(!board.take(a).0.is_empty() && !board.take(b).0.is_empty());
}

#[test]
fn a_stop_is_not_given_up_while_the_device_is_away() {
    let mut board = Board::new(115_200);
    board.deaf_until = Duration::from_secs(30);
    let now = board.now();
    board.line.halt(OWNER, "http", ExecCommand::Stop, now);
    board.run_ms(29_000);
    assert!(board.arrived(FrameType::TrajSetExecStatus) > 30);
    assert!(board.line.take_events().contains(&LineEvent::NotTaken));
    assert!(!board.line.is_idle());
    board.run_ms(5_000);
    assert!(board.line.is_idle());
}

/// After a Stop, a motion begins only if a client requested it after that Stop. The arrival time of the frame that starts the motion does
/// not matter.
#[test]
fn what_was_asked_for_before_a_halt_moves_nothing_however_late_it_comes() {
    let mut board = Board::new(115_200);
    let anna = operator(&mut board, "anna");
    let bob = board.join("bob", Role::Viewer, Policy::Continue);
    ask(&mut board, anna).expect("nobody has stopped anything");
    assert!(!board.line.is_halted(anna));
    board.send(bob, &STOP);
    board.run_ms(10_000);
    assert!(board.line.is_halted(anna));
    let before = board.arrived(FrameType::TrajSetExecStatus);
    board.send(anna, &EXECUTE);
    board.run_ms(1_000);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), before, "it was asked for before the Stop");
    let (_, denied) = board.take(anna);
    assert!(denied.iter().any(|why| why.contains("bob has stopped")), "{denied:?}");
    // After a new motion request, the Execute frame is sent. A Pause of the same client does not cancel its motion request.
    ask(&mut board, anna).expect("it is long ago");
    board.send(anna, &EXECUTE);
    board.run_ms(1_000);
    board.send(anna, &PAUSE);
    board.run_ms(1_000);
    board.send(anna, &EXECUTE);
    board.run_ms(1_000);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), before + 3);
}

#[test]
fn ones_own_pause_takes_nothing_back_of_somebody_elses_and_a_newcomer_waits_as_well() {
    let mut board = Board::new(115_200);
    let anna = operator(&mut board, "anna");
    let now = board.now();
    board.line.halt_for(Some(anna), "anna", ExecCommand::Pause, now);
    board.run_ms(100);
    ask(&mut board, anna).expect("her own");
    board.line.halt_for(None, "bob", ExecCommand::Pause, now);
    board.run_ms(100);
    let now = board.now();
    board.line.halt_for(Some(anna), "anna", ExecCommand::Pause, now);
    board.run_ms(100);
    assert!(ask(&mut board, anna).is_err(), "bob's counts");
    // The hold-off of three seconds also applies to a client that reconnects.
    board.line.leave(anna, now);
    let again = operator(&mut board, "anna");
    assert!(ask(&mut board, again).is_err(), "bob's counts");
    let before = board.arrived(FrameType::TrajSetExecStatus);
    board.send(again, &EXECUTE);
    board.run_ms(200);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), before);
    board.run_ms(3_500);
    ask(&mut board, again).expect("it is over");
}

/// If the policy of a client has ended its motion, the client needs a new motion request for its next motion. The client also needs
/// a new request if another client has resumed the first motion.
#[test]
fn a_lease_that_lapsed_with_a_pause_is_not_taken_again_by_what_waits() {
    let mut board = Board::new(115_200);
    let anna = board.join("anna", Role::Operator, Policy::Pause);
    let now = board.now();
    board.line.take_lease(anna, Some(Duration::from_secs(1)), now).expect("nobody has it");
    ask(&mut board, anna).expect("nobody has stopped anything");
    board.send(anna, &EXECUTE);
    board.run_ms(1_500);
    assert!(board.line.lease().is_none());
    board.run_ms(4_000);
    let bob = operator(&mut board, "bob");
    ask(&mut board, bob).expect("it is long ago");
    board.send(bob, &EXECUTE);
    board.run_ms(200);
    board.line.leave(bob, board.now());
    let before = board.arrived(FrameType::TrajSetExecStatus);
    board.send(anna, &EXECUTE);
    board.run_ms(1_000);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), before, "anna's next motion is not begun");
}

#[test]
fn a_lease_that_lapses_goes_to_the_one_who_has_asked_for_it() {
    let mut board = Board::new(115_200);
    let anna = operator(&mut board, "anna");
    let bob = operator(&mut board, "bob");
    let now = board.now();
    board.line.take_lease(anna, Some(Duration::from_secs(1)), now).expect("nobody has it");
    board.line.want_lease(bob, now).expect("anna has it");
    board.run_ms(1_200);
    assert_eq!(board.line.lease().map(|lease| lease.holder), Some(bob));
}

#[test]
fn the_first_who_asks_for_a_lease_keeps_its_place_as_long_as_it_waits() {
    let mut board = Board::new(115_200);
    let [anna, bob, carl] = ["anna", "bob", "carl"].map(|name| operator(&mut board, name));
    let now = board.now();
    board.line.take_lease(anna, None, now).expect("nobody has it");
    board.line.want_lease(bob, now).expect("anna has it");
    board.line.want_lease(bob, now).expect("he may ask again");
    let denied = board.line.want_lease(carl, now).expect_err("bob was first").to_string();
    assert!(denied.contains("bob") && denied.contains("anna"), "{denied}");
    assert_eq!(board.line.lease().and_then(|lease| lease.wanted_by), Some(bob));
    // The client that waits for the lease disconnects.
    board.line.leave(bob, now);
    board.line.want_lease(carl, now).expect("nobody waits any more");
    // An HTTP client, which has no connection to the line, keeps its position in the queue for the lease by sending
    // requests.
    let dora = operator(&mut board, "dora");
    let lasts = Some(Duration::from_secs(1));
    board.line.leave(carl, now);
    assert!(board.line.take_lease(dora, lasts, now).is_err());
    board.line.want_lease(dora, now).expect("nobody waits any more");
    board.run_ms(800);
    let now = board.now();
    assert!(board.line.take_lease(dora, lasts, now).is_err(), "anna has it");
    board.run_ms(800);
    let (now, emil) = (board.now(), operator(&mut board, "emil"));
    assert!(board.line.want_lease(emil, now).is_err());
    board.run_ms(300);
    let now = board.now();
    board.line.want_lease(emil, now).expect("she has lapsed");
    board.line.release_lease(anna, now).expect("it is hers");
    // A client that has received the lease no longer waits for it.
    assert_eq!(board.line.lease().map(|lease| (lease.holder, lease.wanted_by)), Some((emil, None)));
    board.line.want_lease(anna, now).expect("nobody waits");
}

/// The controller detects a silent lease holder, even if another client sends requests all the time and requests are queued.
#[test]
fn j59_a_holder_that_falls_silent_is_not_hidden_by_questions() {
    for (timeout_ms, every_ms) in [(600, 10), (2000, 50), (2000, 250), (5000, 100)] {
        let mut board = Board::new(115_200);
        let anna = operator(&mut board, "anna");
        let bob = board.join("bob", Role::Viewer, Policy::Continue);
        board.status.state = ControllerState::HoldPos.into();
        board.run_ms(100);
        let mut frame = [0; 16];
        let setting = jtc_core::settings::named("host_timeout_ms").expect("it is a setting").number;
        let value = SettingValue { setting, joint: 0, value: timeout_ms as f64 };
        let n = jtc_wire::set_settings(&mut frame, [value]).expect("it fits");
        board.send(anna, &frame[..n]);
        board.run_ms(500);
        board.status.state = ControllerState::Operate.into();
        board.run_ms(100);
        board.send(anna, &fixed::get_settings(0));
        let silent_from = board.now();
        for _ in 0..2 * timeout_ms / every_ms {
            board.send(bob, &fixed::GET_INFO);
            board.run_ms(every_ms);
        }
        let asked = board.frames.iter().filter(|(_, kind, _)| *kind == Some(FrameType::GetInfo));
        let shown = asked.map(|(at, ..)| at.saturating_sub(silent_from)).max().unwrap_or_default();
        // If a frame is being written when half of the timeout has passed, the frame is sent completely.
        let limit = Duration::from_millis(timeout_ms / 2 + 20);
        assert!(shown <= limit, "{timeout_ms} ms, every {every_ms} ms: a frame came after {shown:?}");
    }
}

/// During a motion under host supervision, only frames of the lease holder show the controller that its host still runs.
#[test]
fn j59_questions_of_others_do_not_stand_for_the_client_that_commands() {
    use ControllerState::{HoldPos, Operate, Teaching};
    use TrajectoryState::{Execute, Finish, Pause, Stop};
    // Each case contains the timeout (ms), the controller state, `true` if the lease of the holder lapses, the frame
    // interval of the lease holder (ms; 0 for no frames), and `true` if the requests of the viewer are sent.
    let cases = [
        (0, (Operate, Execute), true, 0, true),
        (1500, (Operate, Execute), true, 0, false),
        (60_000, (Operate, Execute), true, 0, false),
        (1500, (Operate, Pause), true, 0, false),
        (1500, (Teaching, Stop), true, 0, false),
        (1500, (HoldPos, Pause), true, 0, true),
        (1500, (HoldPos, Finish), true, 0, true),
        (1500, (Operate, Execute), false, 0, false),
        (1500, (Operate, Execute), false, 500, true),
        (1500, (Teaching, Finish), false, 500, true),
        (300, (Operate, Execute), false, 2000, false),
        (0, (Teaching, Finish), false, 0, true),
    ];
    for (timeout_ms, (state, trajectory), lapses, every_ms, pass) in cases {
        let case =
            format!("{timeout_ms} ms, {state:?}, {trajectory:?}, lapses: {lapses}, every {every_ms} ms");
        let mut board = Board::new(115_200);
        let anna = operator(&mut board, "anna");
        let bob = board.join("bob", Role::Viewer, Policy::Continue);
        let now = board.now();
        board.line.take_lease(anna, lapses.then_some(Duration::from_secs(2)), now).expect("it is free");
        let mut frame = [0; 16];
        let setting = jtc_core::settings::named("host_timeout_ms").expect("it is a setting").number;
        let value = SettingValue { setting, joint: 0, value: f64::from(timeout_ms) };
        let n = jtc_wire::set_settings(&mut frame, [value]).expect("it fits");
        board.status.state = HoldPos.into();
        board.run_ms(100);
        board.send(anna, &frame[..n]);
        board.run_ms(500);
        (board.status.state, board.status.trajectory) = (state.into(), trajectory.into());
        board.run_ms(2500);
        board.take(bob);
        let before = board.arrived(FrameType::GetInfo);
        let (mut asked, mut own) = (0, 0);
        // The board never returns the requested frame, so each request waits for its full timeout. The requests
        // therefore take longer than 3 s.
        for ms in (0..13_000).step_by(250) {
            if every_ms > 0 && ms % every_ms == 0 {
                board.send(anna, &fixed::get_settings(0));
                own += 1;
            }
            // If the lease holder sends a frame every 2 s, requests of the viewer are permitted for a short time
            // after each of these frames. The test therefore sends no viewer's request in the first 400 ms after such
            // a frame.
            if ms < 3000 && (every_ms != 2000 || ms % 2000 >= 400) {
                board.send(bob, &fixed::GET_INFO);
                asked += 1;
            }
            board.run_ms(250);
        }
        board.run_ms(15_000);
        let arrived = board.arrived(FrameType::GetInfo) - before;
        let (_, denied) = board.take(bob);
        assert_eq!(arrived, if pass { asked } else { 0 }, "{case}");
        assert_eq!(denied.len(), asked - arrived, "{case}");
        assert!(denied.iter().all(|why| why.contains("anna is silent")), "{case}: {denied:?}");
        assert_eq!(board.arrived(FrameType::GetSettings), own, "{case}: those of the holder pass");
        board.send(bob, &STOP);
        board.run_ms(500);
        assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 1, "{case}: a Stop passes always");
    }
}
