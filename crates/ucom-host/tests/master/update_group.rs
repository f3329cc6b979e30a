//! Tests of updates of several boards at once. The tests cover boards of the group, boards outside the group, and the report of boards that
//! missed a block.

use super::bench::Exit;
use ucom::{Frame, Profile};
use ucom_host::master::update::{UpdateFailure, UpdateMode, UpdateOptions, UpdateOutcome};
use ucom_host::master::{Error, Request, StatusError};

use super::answering::Answering;
use super::bench::{Bench, From, Member, OLD};
use super::chain::initialised;
use super::update::{check_program, options, outcomes, update};

const DATE: u16 = 0x3AC1;

fn group(boards: &[u8]) -> UpdateOptions {
    UpdateOptions { mode: UpdateMode::Group, keep_going: true, ..options(boards, 128) }
}

/// Returns the number of PC_PROG frames that were sent by broadcast.
fn broadcasts(bench: &Bench) -> usize {
    bench.beginning("2C0#")
}

/// D-46: the master commands every board that is not selected to leave programming mode, and then requests the state
/// of each board separately. Answers to a broadcast PC_INFO can be lost, and a board that still has PROG = 1 would be
/// erased with the group.
#[test]
fn d46_a_group_leaves_other_boards_alone() {
    for lose in [vec![], vec![("> 142#", 2)], vec![("> 142#", 2), ("< 1C2#0400", 2)]] {
        let mut bench = initialised(&[0x21, 0x42, 0x63]);
        bench.go(Request::XReset { board: 2, force: false }, 20).unwrap();
        bench.lose = lose.clone();
        let report = update(&mut bench, group(&[1, 3]));
        assert!(report.boards.iter().all(|b| b.outcome == UpdateOutcome::Verified), "{lose:?}: {report:?}");
        assert_eq!(check_program(&mut bench, 1, 128), OLD, "{lose:?}");
        assert_eq!(broadcasts(&bench), 48, "{lose:?}");
        let first = bench.log.iter().position(|(.., f)| f.id() == 0x2C0).unwrap();
        let commanded = |number: u16| {
            let commanded = |(_, from, f): &(u64, From, Frame)| {
                *from == From::Master && f.id() == 0x1C0 + number && f.data() == [4, 0]
            };
            bench.log[..first].iter().any(commanded)
        };
        assert!((1..=31).filter(|n| *n != 1 && *n != 3).all(commanded), "{lose:?}");
        assert!(!commanded(1) && !commanded(3));
    }
}

/// Returns a board that always keeps PROG = 1 and does not answer broadcast queries.
fn stubborn() -> impl Member {
    Answering::new(|frame| if frame == "209#" { &["149#7700091F34126E38", "149#0000"] } else { &[] })
}

/// D-46: a board outside the group stays in programming mode. The master refuses the update before it sends any frame to the group.
#[test]
fn d46_a_group_is_refused_while_another_board_listens() {
    let mut bench = initialised(&[0x21, 0x42]);
    bench.join(Box::new(stubborn()));
    let report = update(&mut bench, group(&[1, 2]));
    for result in &report.boards {
        let Some(UpdateFailure::Refused(e)) = &result.failure else { panic!("{report:?}") };
        assert!(matches!(**e, Error::Status(StatusError::StatusNotTaken { board: 9, .. })), "{e}");
    }
    assert_eq!((report.exit(), broadcasts(&bench), bench.count("041#")), (4, 0, 0));
    assert_eq!((check_program(&mut bench, 0, 128), check_program(&mut bench, 1, 128)), (OLD, OLD));
}

/// D-42: the master sends the first frame of a block only after every selected board has answered the previous block.
#[test]
fn d42_a_group_waits_for_every_board() {
    let mut bench = initialised(&[0x21, 0x42, 0x63]);
    bench.board(2).flash.erase_us = 4_000_000;
    let before = bench.log.len();
    let report = update(&mut bench, group(&[1, 3]));
    assert_eq!(report.exit(), 0, "{report:?}");
    let (mut in_block, mut answers) = (0, 2);
    for (_, _, frame) in &bench.log[before..] {
        match frame.to_string().get(..4) {
            Some("2C0#") => {
                if in_block == 8 {
                    in_block = 0;
                }
                if in_block == 0 {
                    assert_eq!(answers, 2, "a block before all have answered");
                    answers = 0;
                }
                in_block += 1;
            }
            Some("181#" | "183#" | "101#" | "103#") => answers += 1,
            _ => {}
        }
    }
}

/// A selected board executes XRESET and then sends no further frame. Frames to the group could erase this board without any report.
/// Therefore the master sends no frames to the group, and updates the other boards one by one.
#[test]
fn a_silent_board_that_may_listen_ends_the_broadcast() {
    let mut bench = initialised(&[0x21, 0x42, 0x63]);
    let id = bench.master.start(bench.now, Request::Update(group(&[1, 2, 3]))).unwrap();
    bench.until(|b| b.count("043#") > 0);
    bench.lose = vec![("> 143#", u32::MAX)];
    let Ok(ucom_host::master::Outcome::Update(report)) = bench.wait(id, 120) else { panic!() };
    assert_eq!(outcomes(&report), ["verified", "verified", "not-started"], "{report:?}");
    assert_eq!((report.exit(), broadcasts(&bench)), (3, 0));
    assert_eq!(check_program(&mut bench, 2, 128), OLD);
}

/// A board whose DSP_READY is lost is removed from the group. The master then reads the board to determine whether it
/// accepted the later blocks.
#[test]
fn a_board_that_fell_behind_is_asked() {
    // `block` is the number of DSP_READY frames that board 2 sends before one of them is lost. The board still
    // accepts all blocks, so it needs no second attempt.
    for block in [0, 2, 3, 5] {
        let mut bench = initialised(&[0x21, 0x42]);
        let id = bench.master.start(bench.now, Request::Update(group(&[1, 2]))).unwrap();
        bench.until(|b| b.beginning("182#") >= block);
        bench.lose = vec![("> 182#", 1), ("> 102#", 1)];
        let Ok(ucom_host::master::Outcome::Update(report)) = bench.wait(id, 120) else { panic!() };
        assert_eq!(report.exit(), 0, "block {block}: {report:?}");
        assert_eq!((bench.count("042#"), check_program(&mut bench, 1, 128).1), (1, DATE), "block {block}");
    }
}

/// A board was removed from the group before the erase, and has been silent since then. The memory of this board may be erased, so its
/// outcome is `unknown` and the exit code is 5.
#[test]
fn a_board_that_was_lost_in_a_group_may_be_erased() {
    let mut bench = initialised(&[0x21, 0x42]);
    let id = bench.master.start(bench.now, Request::Update(group(&[1, 2]))).unwrap();
    bench.until(|b| broadcasts(b) >= 4);
    bench.lose = vec![("> 182#", u32::MAX), ("> 142#", u32::MAX), ("> 102#", u32::MAX), ("> 0C2#", u32::MAX)];
    let Ok(ucom_host::master::Outcome::Update(report)) = bench.wait(id, 120) else { panic!() };
    assert_eq!(report.boards[0].outcome, UpdateOutcome::Verified, "{report:?}");
    assert_eq!((report.boards[1].outcome, report.exit()), (UpdateOutcome::Unknown, 5));
    let failure = report.boards[1].failure.as_ref().unwrap();
    assert!(matches!(failure, UpdateFailure::MayBeErased(_)), "{failure}");
    assert!(failure.to_string().contains("may be erased"));
    assert_ne!(check_program(&mut bench, 1, 128), OLD, "it was");
    // The board is disconnected before the erase and receives no further block. Later it reports its old program,
    // which shows that its memory was not erased.
    let mut bench = initialised(&[0x21, 0x42]);
    let id = bench.master.start(bench.now, Request::Update(group(&[1, 2]))).unwrap();
    bench.until(|b| broadcasts(b) >= 4);
    bench.cut = vec![1];
    bench.until(|b| broadcasts(b) >= 48);
    bench.cut.clear();
    bench.lose = vec![("> 182#", u32::MAX)];
    let Ok(ucom_host::master::Outcome::Update(report)) = bench.wait(id, 120) else { panic!() };
    assert_eq!((report.boards[1].outcome, report.exit()), (UpdateOutcome::NotStarted, 3), "{report:?}");
    assert_eq!(check_program(&mut bench, 1, 128), OLD);
}

/// D-43: after an error of its CAN controller or of its start, or after an unknown error code, a board still accepts
/// blocks. Its memory is then erased together with the memory of the other boards. If its later answers arrive, the
/// master reads the board and finds the new program. If they are lost, the outcome is `unknown`.
#[test]
fn d43_not_every_error_ends_a_transfer() {
    for code in ["06", "08", "09", "0B", "2A"] {
        for received in [true, false] {
            let mut bench = initialised(&[0x21, 0x42]);
            let id = bench.master.start(bench.now, Request::Update(group(&[1, 2]))).unwrap();
            bench.until(|b| broadcasts(b) >= 10);
            let now = bench.now;
            bench.master.handle(now, Ok(super::bench::frame(&format!("082#{code}"))));
            if !received {
                bench.lose = vec![("> 142#", u32::MAX), ("> 182#", u32::MAX), ("> 102#", u32::MAX)];
            }
            let Ok(ucom_host::master::Outcome::Update(report)) = bench.wait(id, 120) else { panic!() };
            assert_ne!(check_program(&mut bench, 1, 128), OLD, "{code}: it was erased");
            let expected = if received { (UpdateOutcome::Verified, 0) } else { (UpdateOutcome::Unknown, 5) };
            assert_eq!((report.boards[1].outcome, report.exit()), expected, "{code}: {report:?}");
        }
    }
}

/// U-3 with `force`: a board that was removed from the group already had this program before. Its answer does not
/// prove that the update wrote the program, so the board is updated again alone.
#[test]
fn u3_what_was_there_before_proves_nothing() {
    let mut bench = initialised(&[0x21, 0x42]);
    assert_eq!(update(&mut bench, group(&[1, 2])).exit(), 0);
    let forced = UpdateOptions { force: true, ..group(&[1, 2]) };
    let start = bench.log.len();
    let id = bench.master.start(bench.now, Request::Update(forced)).unwrap();
    bench.until(|b| broadcasts(b) >= 48 + 4);
    bench.cut = vec![1];
    bench.until(|b| broadcasts(b) >= 2 * 48);
    bench.cut.clear();
    let Ok(ucom_host::master::Outcome::Update(report)) = bench.wait(id, 120) else { panic!() };
    assert_eq!(
        (report.boards[1].outcome, report.boards[1].attempts),
        (UpdateOutcome::Verified, 2),
        "{report:?}"
    );
    let own = bench.log[start..].iter().filter(|(.., f)| f.id() == 0x2C2).count();
    assert_eq!(own, 48, "it was programmed by itself");
}

/// A board of the group gets an attempt on its own. A cancel during this attempt ends the programming mode of all boards of the group.
#[test]
fn p12_a_cancel_reaches_every_board_of_the_group() {
    let mut bench = initialised(&[0x21, 0x42, 0x63]);
    let id = bench.master.start(bench.now, Request::Update(group(&[1, 2, 3]))).unwrap();
    bench.until(|b| b.count("043#") > 0);
    // Board 3 is in its exloader, but its answers to PC_INFO do not arrive. Therefore the master sends no broadcast
    // and updates the boards one by one. Board 2 waits for its update with PROG = 1.
    bench.lose = vec![("> 143#", u32::MAX)];
    bench.until(|b| b.beginning("2C1#") >= 4);
    assert!(bench.board(1).status().has(ucom::Status::PROG));
    bench.master.cancel(id);
    let Ok(ucom_host::master::Outcome::Update(report)) = bench.wait(id, 60) else { panic!() };
    assert_ne!(report.exit(), 0);
    assert!(!bench.board(1).status().has(ucom::Status::PROG), "{report:?}");
}

/// Without a broadcast number, the master updates a group one by one.
#[test]
fn d04_no_broadcast_no_group() {
    let profile = Profile { addr_broadcast: ucom::profile::Broadcast::None, ..Profile::default() };
    let mut bench = Bench::chain_with(&[0x21, 0x42], profile);
    assert!(bench.go(Request::Init(Default::default()), 60).is_ok());
    let report = update(&mut bench, group(&[1, 2]));
    assert_eq!((report.exit(), broadcasts(&bench)), (0, 0), "{report:?}");
}
