//! Tests of firmware updates, with boards of the crate `ucom` and with boards that are simulated by tables of frames.

use super::bench::Exit;
use ucom::{BoardInfo, Memory};
use ucom_host::files::FlashRecord;
use ucom_host::master::update::{
    UpdateFailure, UpdateImage, UpdateMode, UpdateOptions, UpdateOutcome, UpdateReport, UpdateResult,
    UpdateTarget,
};
use ucom_host::master::{
    Error, Event, IdentityError, InitOptions, Outcome, Request, RunBoard, RunOptions, RunningError,
};

use super::bench::{Bench, Fault, MS, OLD, Script, image};
use super::chain::initialised;
use super::loader::{Loader, loader};

pub(super) const DATE: u16 = 0x3AC1;

pub(super) fn options(boards: &[u8], len: usize) -> UpdateOptions {
    let targets = boards.iter().map(|b| UpdateTarget { board: *b, flash_number: None }).collect();
    UpdateOptions::new(targets, UpdateImage { bytes: image(len).into(), address_words: 0 }, DATE)
}

pub(super) fn update(bench: &mut Bench, options: UpdateOptions) -> UpdateReport {
    match bench.go(Request::Update(options), 600) {
        Ok(Outcome::Update(report)) => report,
        other => panic!("{other:?} (fault {:?})", bench.fault),
    }
}

/// Returns the options of an update, extended by the flash records of an earlier update with the same image.
pub(super) fn recorded(options: UpdateOptions, report: &UpdateReport) -> UpdateOptions {
    let image = &options.image;
    let record = |info: &BoardInfo| FlashRecord::new(&image.bytes, image.address_words, info);
    let shown = report.boards.iter().filter_map(|board| board.after);
    let records = shown.map(|info| (info.flash_number, record(&info))).collect();
    UpdateOptions { records, ..options }
}

pub(super) fn outcomes(report: &UpdateReport) -> Vec<&str> {
    report.boards.iter().map(|b| b.outcome.name()).collect()
}

/// Checks that a board has the complete old program, the complete new program, or no program.
pub(super) fn check_program(bench: &mut Bench, board: usize, len: usize) -> (u16, u16) {
    let record = bench.board(board).record();
    let bytes = bench.board(board).flash.bytes(Memory::Program).to_vec();
    match record.map(|r| (r.program_id, r.date)) {
        None => (0xFFFF, 0xFFFF),
        Some(OLD) => {
            assert_eq!(bytes[..64], [0x55; 64], "the old program is damaged");
            OLD
        }
        Some(new) => {
            assert_eq!(bytes[..len], image(len)[..], "half an image counts as valid");
            new
        }
    }
}

/// Returns `true` if the board reports the program: either this update wrote the program, or the board had it before and no flash record
/// proves the image.
fn shows_it(result: &UpdateResult) -> bool {
    matches!(result.outcome, UpdateOutcome::Verified | UpdateOutcome::ProgramUpToDate)
}

/// Vector 13.4: the test writes the golden image to a board, and compares the frames of the update and of the
/// read-back with the vector.
#[test]
fn golden_update() {
    let mut bench = initialised(&[0x21]);
    let before = bench.log.len();
    let report = update(&mut bench, options(&[1], 1000));
    assert_eq!(report.boards[0].outcome, UpdateOutcome::Verified, "{report:?}");
    assert_eq!((report.program_id, report.exit(), report.boards[0].attempts), (Some(0x4B3F), 0, 1));
    let sent: Vec<String> = bench.log[before..].iter().map(|(.., f)| f.to_string()).collect();
    let prog: Vec<&String> = sent.iter().filter(|t| t.starts_with("2C1#")).collect();
    assert_eq!(prog.len(), 2 * 136);
    let first =
        ["2C1#4355010001000000", "2C1#00000000F4010000", "2C1#3F4BC13AFFFFFFFF", "2C1#FFFFFFFFFFFFFFFF"];
    assert_eq!(prog[..4], first);
    assert_eq!((prog[7].as_str(), prog[8].as_str()), ("2C1#FFFFFFFFFFFFDC22", "2C1#0B30557A9FC4E90E"));
    // OPINIT does not change: the status is 0x1B before and after the update.
    assert_eq!(sent.iter().rfind(|t| t.starts_with("141#2100")).unwrap(), "141#2100011B3F4BC13A");
    assert_eq!(sent.iter().filter(|t| *t == "041#").count(), 1);
    assert_eq!(check_program(&mut bench, 0, 1000), (0x4B3F, DATE));
    // A second update detects that the board is up to date, and sends only queries.
    let before = bench.log.len();
    let report = update(&mut bench, recorded(options(&[1], 1000), &report));
    assert_eq!((report.boards[0].outcome, report.boards[0].verified), (UpdateOutcome::UpToDate, true));
    let silent = ["201#", "200#", "680#"];
    let master = bench.log[before..].iter().filter(|(_, f, _)| *f == super::bench::From::Master);
    assert!(master.map(|(.., f)| f.to_string()).all(|t| silent.contains(&t.as_str())));
}

/// P-7: the master sends the first frame of a block only after DSP_READY for the previous block. P-14: the master sends heartbeats every
/// 500 ±50 ms during the update.
#[test]
fn p7_p14_flow_control_and_heartbeats() {
    let mut bench = initialised(&[0x21]);
    bench.board(0).flash.erase_us = 8_000_000;
    let before = bench.log.len();
    let report = update(&mut bench, options(&[1], 3000));
    assert_eq!(report.boards[0].outcome, UpdateOutcome::Verified);
    let mut in_block = 0;
    for (_, _, frame) in &bench.log[before..] {
        match frame.to_string().get(..4) {
            Some("2C1#") => {
                assert!(in_block < 8, "a frame before READY");
                in_block += 1;
            }
            Some("181#" | "101#") => in_block = 0,
            _ => {}
        }
    }
    let alive = bench.times_of("680#");
    assert!(alive.len() > 15, "{}", alive.len());
    assert!(alive.windows(2).all(|w| (450 * MS..=550 * MS).contains(&(w[1] - w[0]))), "{alive:?}");
}

/// P-8: the board sends DSP_READY after 0.9 s, and its erase takes 8 s. The master does not report a timeout.
#[test]
fn p8_slow_boards_are_waited_for() {
    let mut bench =
        loader(Loader { delay: |block| if block == 17 { 8_000 } else { 900 }, ..Loader::new(34) });
    let report = update(&mut bench, options(&[1], 1000));
    assert_eq!(
        (report.boards[0].outcome, report.boards[0].attempts),
        (UpdateOutcome::Verified, 1),
        "{report:?}"
    );
}

/// P-9, U-9: DSP_PROGFINISHED of the board is lost. The answer to PC_INFO shows that the update is done.
#[test]
fn p9_lost_finished_is_a_success() {
    let mut bench = loader(Loader { special: |_, block| (block == 33).then_some(""), ..Loader::new(34) });
    let report = update(&mut bench, options(&[1], 1000));
    assert_eq!(
        (report.boards[0].outcome, report.boards[0].attempts),
        (UpdateOutcome::Verified, 1),
        "{report:?}"
    );
    assert_eq!(bench.count("041#"), 1);
}

/// P-10, U-10: the board reports success but still has the old program. The result of the update is a failure.
#[test]
fn p10_success_must_be_read_back() {
    let mut bench = loader(Loader { info: ["34126E38"; 2], ..Loader::new(34) });
    let report = update(&mut bench, options(&[1], 1000));
    assert_eq!(report.boards[0].outcome, UpdateOutcome::Written);
    assert!(matches!(report.boards[0].failure, Some(UpdateFailure::NotVerified { program_id: 0x1234, .. })));
    assert_eq!(report.exit(), 5);
}

/// P-11, U-7: errors 2 and 5 end the update after one attempt. Other errors, and a missing answer, end it after three
/// attempts. Each attempt to update the board begins with XRESET.
#[test]
fn p11_attempts_by_error() {
    type Case = (fn(usize, usize) -> Option<&'static str>, usize, u8);
    let cases: [Case; 6] = [
        (|_, block| (block == 0).then_some("081#02"), 1, 1),
        (|_, block| (block == 0).then_some("081#05"), 1, 1),
        (|_, block| (block == 16).then_some("081#01"), 3, 1),
        (|_, block| (block == 33).then_some("081#01"), 3, 5),
        (|_, block| (block == 20).then_some("081#03"), 3, 5),
        (|_, block| (block == 3).then_some(""), 3, 3),
    ];
    for (i, (special, attempts, exit)) in cases.into_iter().enumerate() {
        let mut bench = loader(Loader { special, ..Loader::new(34) });
        let report = update(&mut bench, options(&[1], 1000));
        assert_eq!(bench.count("041#"), attempts, "case {i}");
        assert_eq!(report.exit(), exit, "case {i}: {report:?}");
        assert!(bench.count("1C1#0400") >= attempts, "case {i}: the transfer is cleared each time");
        let half = report.boards[0].outcome;
        assert_eq!(
            half,
            if exit == 5 { UpdateOutcome::Incomplete } else { UpdateOutcome::NotStarted },
            "case {i}"
        );
    }
    // The second attempt to update the board succeeds.
    let special = |reset, block| (reset == 1 && block == 16).then_some("081#01");
    let mut bench = loader(Loader { special, ..Loader::new(34) });
    let report = update(&mut bench, options(&[1], 1000));
    assert_eq!((report.boards[0].outcome, report.boards[0].attempts), (UpdateOutcome::Verified, 2));
}

/// Error 2 in the middle of a block is an answer to this block: the master does not wait for DSP_READY and does not
/// make another attempt.
#[test]
fn errors_in_the_middle_of_a_block_count() {
    let mut bench = loader(Loader { refuses_at: Some(3), ..Loader::new(34) });
    let report = update(&mut bench, options(&[1], 1000));
    assert_eq!((bench.count("041#"), report.exit()), (1, 1), "{report:?}");
    let code = |f: &UpdateFailure| matches!(f, UpdateFailure::Device { code, .. } if code.number() == 2);
    assert!(report.boards[0].failure.as_ref().is_some_and(code));
}

/// After an overrun on the board, the pause between frames is longer in the next attempt.
#[test]
fn overrun_widens_the_gap() {
    let special = |reset, block| (reset == 1 && block == 2).then_some("081#04");
    let mut bench = loader(Loader { special, ..Loader::new(34) });
    let report = update(&mut bench, options(&[1], 1000));
    assert_eq!(report.boards[0].outcome, UpdateOutcome::Verified);
    let times: Vec<u64> =
        bench.log.iter().filter(|(.., f)| f.to_string().starts_with("2C1#")).map(|(at, ..)| *at).collect();
    let last: Vec<u64> = times[times.len() - 8..].windows(2).map(|w| w[1] - w[0]).collect();
    let first: Vec<u64> = times[..8].windows(2).map(|w| w[1] - w[0]).collect();
    assert!(last.iter().min() > first.iter().max(), "{first:?} {last:?}");
    assert!(first.iter().all(|gap| *gap >= 200));
}

/// P-5, U-1: the master refuses the update before XRESET if the flash number differs from the requested number, or if the answer contains
/// another board number.
#[test]
fn p5_the_board_must_be_the_one_that_is_meant() {
    let mut bench = loader(Loader::new(34));
    let mut wanted = options(&[1], 1000);
    wanted.targets[0].flash_number = Some(0x22);
    let report = update(&mut bench, wanted);
    let Some(UpdateFailure::Refused(e)) = &report.boards[0].failure else { panic!("{report:?}") };
    assert_eq!(**e, Error::Identity(IdentityError::WrongBoard { board: 1, wanted: 0x22, found: 0x21 }));
    assert_eq!((report.exit(), bench.count("041#")), (4, 0));
    let mut bench = Bench::script(Script::default().on("201#", &["141#2100021934126E38", "141#0000"]));
    let report = update(&mut bench, options(&[1], 1000));
    let Some(UpdateFailure::Refused(e)) = &report.boards[0].failure else { panic!("{report:?}") };
    assert_eq!(**e, Error::Identity(IdentityError::WrongSequence { board: 1, reported: 2 }));
    assert_eq!((report.exit(), bench.count("041#")), (4, 0));
}

/// No board answers the queries of the update. The exit code is 3, and the master sent no frame that changes a board.
#[test]
fn update_of_nobody() {
    let mut bench = Bench::script(Script::default());
    let report = update(&mut bench, options(&[1], 1000));
    assert_eq!((report.exit(), bench.count("041#")), (3, 0));
    assert!(
        report.boards[0]
            .failure
            .as_ref()
            .unwrap()
            .to_string()
            .contains("no frame was received from this board")
    );
}

/// P-12: a cancel in the middle of a block ends the transfer. The board can still be used, and the report contains its state.
#[test]
fn p12_cancel() {
    // Number of PC_PROG frames after which the user cancels the update: two cases in cycle 1, one case in cycle 2.
    for (frames, erased) in [(3, false), (12, false), (3 * 8 + 11, true)] {
        let mut bench = initialised(&[0x21]);
        let id = bench.master.start(bench.now, Request::Update(options(&[1], 128))).unwrap();
        bench.until(|b| b.beginning("2C1#") >= frames);
        bench.master.cancel(id);
        let Ok(Outcome::Update(report)) = bench.wait(id, 10) else { panic!() };
        let erased = erased || bench.board(0).record().is_none();
        let left = if erased { UpdateOutcome::Incomplete } else { UpdateOutcome::Cancelled };
        assert_eq!(report.boards[0].failure, Some(UpdateFailure::Cancelled { left }));
        assert_eq!((report.boards[0].outcome, report.exit()), (left, if erased { 5 } else { 4 }));
        assert_eq!(bench.count("1C1#0400"), 1);
        let usable = update(&mut bench, options(&[1], 128));
        assert_eq!(usable.boards[0].outcome, UpdateOutcome::Verified, "{usable:?}");
    }
}

/// P-13: the tool is killed after any frame of an update; the next update succeeds.
#[test]
fn p13_killed_tool() {
    let total = {
        let mut bench = initialised(&[0x21, 0x42]);
        let before = bench.log.len();
        update(&mut bench, options(&[1], 128));
        (before, bench.log.len())
    };
    for at in total.0..total.1 {
        let mut bench = initialised(&[0x21, 0x42]);
        bench.master.start(bench.now, Request::Update(options(&[1], 128))).unwrap();
        bench.until(|b| b.log.len() >= at);
        bench.master = ucom_host::master::Master::new(Default::default());
        bench.run(300);
        check_program(&mut bench, 0, 128);
        let report = update(&mut bench, options(&[1], 128));
        assert!(shows_it(&report.boards[0]), "killed after frame {at}: {report:?}");
        let new = (report.program_id.unwrap(), DATE);
        assert_eq!(check_program(&mut bench, 0, 128), new);
    }
}

/// U-2: the master refuses an update while a board runs, unless `force` is set.
#[test]
fn u2_running_boards() {
    let mut bench = initialised(&[0x21, 0x42]);
    let run = RunOptions { boards: vec![RunBoard { board: 2, ..Default::default() }], ..Default::default() };
    assert!(bench.go(Request::Run(run), 20).is_ok());
    let report = update(&mut bench, options(&[1], 128));
    let Some(UpdateFailure::Refused(e)) = &report.boards[0].failure else { panic!("{report:?}") };
    assert_eq!(**e, Error::Running(RunningError::Running { boards: vec![2] }));
    assert_eq!(report.exit(), 4);
    let forced = UpdateOptions { force: true, ..options(&[1], 128) };
    assert_eq!(update(&mut bench, forced).boards[0].outcome, UpdateOutcome::Verified);
}

/// U-3, U-10: an update session skips boards that are up to date. With `start`, the application runs at the end.
#[test]
fn update_session_skips_and_starts() {
    let mut bench = initialised(&[0x21, 0x42, 0x63]);
    let first = update(&mut bench, options(&[2], 128));
    assert_eq!(first.boards[0].outcome, UpdateOutcome::Verified);
    let all = UpdateOptions { start: true, ..options(&[1, 2, 3], 128) };
    let report = update(&mut bench, recorded(all, &first));
    assert_eq!(outcomes(&report), ["running", "running", "running"]);
    assert_eq!(report.exit(), 0);
}

/// Group update by broadcast: the selected boards get the new program, and the other board keeps its program.
#[test]
fn group_update() {
    let mut bench = initialised(&[0x21, 0x42, 0x63]);
    let before = bench.log.len();
    let report = update(&mut bench, UpdateOptions { mode: UpdateMode::Group, ..options(&[1, 3], 128) });
    assert!(report.boards.iter().all(|b| b.outcome == UpdateOutcome::Verified), "{report:?}");
    assert_eq!(check_program(&mut bench, 1, 128), OLD);
    let prog = bench.log[before..].iter().filter(|(.., f)| f.id() >> 6 == 11);
    assert!(prog.clone().all(|(.., f)| f.id() == 0x2C0));
    assert_eq!(prog.count(), 48);
}

/// A dry run of an update reads the boards and does not change them.
#[test]
fn dry_run() {
    let mut bench = Bench::chain(&[0x21]);
    bench.go(Request::Init(InitOptions::default()), 20).unwrap();
    let before = bench.log.len();
    let report = update(&mut bench, UpdateOptions { dry_run: true, ..options(&[1], 1000) });
    assert_eq!(report.boards[0].outcome, UpdateOutcome::NotStarted);
    assert_eq!((report.exit(), report.bytes), (0, 2 * 17 * 64));
    let sent = bench.log[before..].iter().filter(|(_, f, _)| *f == super::bench::From::Master);
    assert!(sent.map(|(.., f)| f.to_string()).all(|t| ["201#", "200#", "680#"].contains(&t.as_str())));
}

/// U-6: the progress of an update counts the bytes of both cycles up to their total.
#[test]
fn progress_is_of_both_cycles() {
    let mut bench = initialised(&[0x21]);
    update(&mut bench, options(&[1], 1000));
    let bytes: Vec<_> = bench
        .events
        .iter()
        .filter_map(
            |(_, e)| if let Event::Progress { progress, .. } = e { Some(progress.bytes) } else { None },
        )
        .collect();
    assert_eq!(bytes, (1..=34).map(|i| 64 * i).collect::<Vec<u64>>());
}

/// In each run, another frame of an update has a fault. The report always describes the result correctly.
#[test]
fn every_frame_of_an_update_disturbed() {
    let (from, to) = {
        let mut bench = initialised(&[0x21, 0x42]);
        let before = bench.log.len();
        update(&mut bench, options(&[2], 128));
        (before, bench.log.len())
    };
    let mut failed = 0;
    for at in from..to {
        let kinds = [
            Fault::Lost,
            Fault::Doubled,
            Fault::Swapped,
            Fault::Delayed(30),
            Fault::Delayed(250),
            Fault::Corrupted((7 * at + 3) as u8),
        ];
        for fault in kinds {
            let mut bench = initialised(&[0x21, 0x42]);
            bench.fault = Some((at, fault));
            let report = update(&mut bench, options(&[2], 128));
            let result = &report.boards[0];
            let holds = check_program(&mut bench, 1, 128);
            let new = (report.program_id.unwrap(), DATE);
            match result.outcome {
                UpdateOutcome::Verified | UpdateOutcome::ProgramUpToDate => {
                    assert_eq!(holds, new, "{at} {fault:?}")
                }
                _ => {
                    assert!(result.failure.is_some(), "{at} {fault:?}: {report:?}");
                    failed += 1;
                    if result.outcome == UpdateOutcome::NotStarted {
                        assert_eq!(holds, OLD, "{at} {fault:?}: {report:?}");
                    }
                    // The next update of the board succeeds.
                    bench.fault = None;
                    let mut again = update(&mut bench, options(&[2], 128));
                    if again.exit() == 3 {
                        // At this point, the board has lost its number.
                        bench.go(Request::Init(InitOptions::default()), 60).unwrap();
                        again = update(&mut bench, options(&[2], 128));
                    }
                    assert!(shows_it(&again.boards[0]), "{at} {fault:?}: {again:?}");
                }
            }
            assert_eq!(
                check_program(&mut bench, 0, 128),
                OLD,
                "the other board: {at} {fault:?} {:?}",
                bench.log[at]
            );
        }
    }
    println!("{failed} of {} disturbed updates ended in a named error", 6 * (to - from));
}
