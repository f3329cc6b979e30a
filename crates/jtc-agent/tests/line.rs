//! Many clients on one line: whose records are whose, who may command, and how soon a Stop is on the line.
mod board;

use std::time::Duration;

use board::Board;
use jtc_agent::line::{ClientId, OWNER};
use jtc_agent::{LineEvent, Policy, Role};
use jtc_wire::{
    ControllerState, DataStatus, ExecCommand, FrameType, RawPoint, TrajectoryState, fixed, trajectory,
};
use proptest::prelude::*;

const PAUSE: [u8; 7] = fixed::exec(ExecCommand::Pause);
const STOP: [u8; 7] = fixed::exec(ExecCommand::Stop);
const EXECUTE: [u8; 7] = fixed::exec(ExecCommand::Execute);

/// A segment of so many points.
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
        // Nothing of the upload comes any more, and whoever sends it knows why.
        board.run_ms(6_000);
        let behind = board.frames.iter().filter(|(t, kind, _)| *t > at && kind.is_some()).count();
        prop_assert_eq!(behind, 0);
        let after = board.arrived(FrameType::Trajectory);
        prop_assert!(after <= before + 1);
        let (records, denied) = board.take(uploader);
        let refused = records.iter().filter(|r| r.data == DataStatus::NotAllowed).count();
        prop_assert_eq!(refused, 4 - after);
        prop_assert!(denied.len() == refused && denied.iter().all(|why| why.contains("bob has stopped")));
        // The one who stopped has the record of it.
        let (records, _) = board.take(other);
        prop_assert!(records.len() == 1 && records[0].accepted());
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
            // The first one commands; all of them ask and pause.
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
        // A request that returns something waits for what the last one returned, which this board never sends.
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
        // Only whole good frames get on the line.
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
    for (client, why) in [(b, "anna has commanded this arm for 12 s"), (viewer, "to look and to stop")] {
        board.take(client);
        board.send(client, &fixed::gripper_control(true));
        board.run_ms(100);
        let (records, denied) = board.take(client);
        assert!(records.len() == 1 && records[0].data == DataStatus::NotAllowed, "{records:?}");
        assert_eq!(records[0].frame_type, FrameType::GripperControl as u8);
        assert!(denied.len() == 1 && denied[0].contains(why), "{denied:?}");
    }
    assert_eq!(board.arrived(FrameType::GripperControl), 0);
    // With consent it is another's.
    board.line.want_lease(b).expect("somebody has it");
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
        // An arm that was taught is held again.
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
    // It is sent again by a program that does not look at the reason; and what it has sent before is known to have come.
    for n in 0..20 {
        board.run_ms(400);
        board.send(a, &EXECUTE);
        if n == 10 {
            let last = board.line.last_halt();
            board.line.confirm_halt(a, last);
        }
    }
    board.run_ms(100);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 1, "it has gone on all the time");
    board.run_ms(600);
    board.send(a, &EXECUTE);
    board.run_ms(100);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 2);
    // Nor does what one has sent before a Stop of one's own.
    let before = board.frames.len();
    board.send(a, &segment(1600));
    board.run_ms(50);
    for frame in [STOP, EXECUTE, STOP] {
        board.send(a, &frame);
    }
    board.run_ms(200);
    let sent: Vec<u8> = board.frames[before..].iter().filter(|f| f.1.is_some()).map(|f| f.2[4]).collect();
    assert_eq!(sent, [1]);
    // Nobody is kept from starting again after it.
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

#[test]
fn a_client_that_does_not_answer_begins_no_motion_behind_a_stop_however_long_it_takes() {
    let mut board = Board::new(115_200);
    let (a, b) = (operator(&mut board, "anna"), operator(&mut board, "bob"));
    board.send(b, &STOP);
    board.run_ms(60_000);
    board.send(a, &EXECUTE);
    board.run_ms(100);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), 1);
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
    // However many ask for what, the last word is Stop, and all of them have its record.
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
    board.line.want_lease(b).expect("anna commands");
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

/// Behind a Stop only that moves the arm which was asked for after it, however long it has waited.
#[test]
fn what_was_asked_for_before_a_halt_moves_nothing_however_late_it_comes() {
    let mut board = Board::new(115_200);
    let anna = operator(&mut board, "anna");
    let bob = board.join("bob", Role::Viewer, Policy::Continue);
    let now = board.now();
    board.line.ask_to_move(anna, now).expect("nobody has stopped anything");
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
    // Asked for anew it is sent, and what it pauses itself on its way it goes on from.
    let now = board.now();
    board.line.ask_to_move(anna, now).expect("it is long ago");
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
    let now = board.now();
    board.line.ask_to_move(anna, now).expect("her own");
    board.line.halt_for(None, "bob", ExecCommand::Pause, now);
    board.run_ms(100);
    let now = board.now();
    board.line.halt_for(Some(anna), "anna", ExecCommand::Pause, now);
    board.run_ms(100);
    let now = board.now();
    assert!(board.line.ask_to_move(anna, now).is_err(), "bob's counts");
    // She comes again, and the three seconds are the same.
    board.line.leave(anna, now);
    let again = operator(&mut board, "anna");
    let now = board.now();
    assert!(board.line.ask_to_move(again, now).is_err(), "bob's counts");
    let before = board.arrived(FrameType::TrajSetExecStatus);
    board.send(again, &EXECUTE);
    board.run_ms(200);
    assert_eq!(board.arrived(FrameType::TrajSetExecStatus), before);
    board.run_ms(3_500);
    let now = board.now();
    board.line.ask_to_move(again, now).expect("it is over");
}

/// A client whose policy has ended its motion begins no other one by itself, also where somebody else has gone on with the first.
#[test]
fn a_lease_that_lapsed_with_a_pause_is_not_taken_again_by_what_waits() {
    let mut board = Board::new(115_200);
    let anna = board.join("anna", Role::Operator, Policy::Pause);
    let now = board.now();
    board.line.take_lease(anna, Some(Duration::from_secs(1)), now).expect("nobody has it");
    board.line.ask_to_move(anna, now).expect("nobody has stopped anything");
    board.send(anna, &EXECUTE);
    board.run_ms(1_500);
    assert!(board.line.lease().is_none());
    board.run_ms(4_000);
    let bob = operator(&mut board, "bob");
    let now = board.now();
    board.line.ask_to_move(bob, now).expect("it is long ago");
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
    board.line.want_lease(bob).expect("anna has it");
    board.run_ms(1_200);
    assert_eq!(board.line.lease().map(|lease| lease.holder), Some(bob));
}
