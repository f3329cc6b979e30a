//! Tests of updates that are not completed, because the bus fails, the user cancels, or another board answers instead of the selected
//! board.

use super::bench::Exit;
use ucom::{Frame, Status};
use ucom_host::master::update::{UpdateFailure, UpdateOptions, UpdateOutcome, UpdateReport};
use ucom_host::master::{
    Diagnose, Error, Event, IdentityError, Master, MasterError, Outcome, Request, StatusError,
};

use super::answering::Answering;
use super::bench::{Bench, From, Member, OLD, Script};
use super::chain::initialised;
use super::loader::{Loader, loader};
use super::update::{check_program, options, outcomes, recorded, update};

const DATE: u16 = 0x3AC1;

/// Starts an update, and calls `end` when `stop` returns `true`. The function returns the report of the update, which
/// must be available at once.
fn ended(
    bench: &mut Bench,
    options: UpdateOptions,
    stop: impl Fn(&Bench) -> bool,
    end: fn(&mut Bench, ucom_host::master::ProcedureId),
) -> UpdateReport {
    let id = bench.master.start(bench.now, Request::Update(options)).unwrap();
    bench.until(stop);
    end(bench, id);
    bench.run(10_000);
    let report = bench.events.iter().find_map(|(_, event)| match event {
        Event::Done { id: which, result: Ok(Outcome::Update(report)) } if *which == id => {
            Some(report.clone())
        }
        _ => None,
    });
    report.expect("the update has ended")
}

fn unplugged(bench: &mut Bench, id: ucom_host::master::ProcedureId) {
    bench.master.abandon(id, "the adapter is gone");
}

/// D-46: the bus fails at any frame of an update of two boards. The report is available at once and contains the true state of each board.
/// The exit code is 5 if memory of a board was erased.
#[test]
fn d46_a_bus_that_fails_leaves_a_report() {
    let (from, to) = {
        let mut bench = initialised(&[0x21, 0x42]);
        let before = bench.log.len();
        update(&mut bench, options(&[1, 2], 128));
        (before, bench.log.len())
    };
    let mut seen = std::collections::BTreeSet::new();
    for at in from..to {
        let mut bench = initialised(&[0x21, 0x42]);
        let report = ended(&mut bench, options(&[1, 2], 128), |b| b.log.len() >= at, unplugged);
        assert_eq!(report.boards.len(), 2);
        for (i, result) in report.boards.iter().enumerate() {
            let holds = check_program(&mut bench, i, 128);
            let bus = Error::Master(MasterError::Bus { reason: "the adapter is gone".into() });
            match result.outcome {
                UpdateOutcome::NotStarted => {
                    assert_eq!(holds, OLD, "{at}: {report:?}");
                    assert_eq!(result.failure, Some(UpdateFailure::NoAnswer(Box::new(bus))), "{at}");
                }
                UpdateOutcome::Incomplete | UpdateOutcome::Written => {
                    assert_eq!(result.failure, Some(UpdateFailure::After(Box::new(bus))), "{at}");
                    assert_eq!(report.exit(), 5, "{at}: {report:?}");
                }
                UpdateOutcome::Verified => assert_eq!((holds.1, &result.failure), (DATE, &None), "{at}"),
                other => panic!("{at}: {other:?}"),
            }
            assert!(holds == OLD || result.outcome != UpdateOutcome::NotStarted, "{at}: {report:?}");
            seen.insert(result.outcome.name());
        }
        let touched = report
            .boards
            .iter()
            .any(|b| matches!(b.outcome, UpdateOutcome::Incomplete | UpdateOutcome::Written));
        let done = report.boards.iter().all(|b| b.failure.is_none());
        let exit = if touched {
            5
        } else if done {
            0
        } else {
            3
        };
        assert_eq!(report.exit(), exit, "{at}: {report:?}");
    }
    let all = ["incomplete", "not-started", "verified", "written"];
    assert_eq!(seen.into_iter().collect::<Vec<_>>(), all);
}

/// A procedure whose bus has failed sends no further frame, even if it was being cancelled at that moment.
#[test]
fn an_abandoned_update_sends_nothing() {
    for cancel_first in [false, true] {
        let mut bench = initialised(&[0x21]);
        let id = bench.master.start(bench.now, Request::Update(options(&[1], 128))).unwrap();
        bench.until(|b| b.beginning("2C1#") >= 3 * 8 + 11);
        if cancel_first {
            bench.master.cancel(id);
        }
        let sent = bench.sent().len();
        bench.master.abandon(id, "the adapter is gone");
        let Ok(Outcome::Update(report)) = bench.wait(id, 1) else { panic!() };
        assert_eq!((report.exit(), report.boards[0].outcome), (5, UpdateOutcome::Incomplete));
        bench.run(2000);
        assert!(bench.sent()[sent..].iter().all(|t| t == "680#"), "{:?}", &bench.sent()[sent..]);
        assert!(!bench.master.is_busy());
    }
    // A procedure of any other kind, here a scan, ends with the error of the bus.
    let mut bench = initialised(&[0x21]);
    let id = bench.master.start(bench.now, Request::Scan).unwrap();
    bench.master.abandon(id, "the adapter is gone");
    let error = bench.wait(id, 1).unwrap_err();
    assert_eq!((error.exit(), error.code()), (3, "bus"));
    assert!(error.to_string().contains("the adapter is gone"));
}

/// P-12: an update session that is cancelled before the erase ends with exit code 4. Boards whose update is done keep the new program; the
/// other boards keep the old program.
#[test]
fn p12_a_cancelled_update_session() {
    let mut bench = initialised(&[0x21, 0x42, 0x63]);
    let begun = |b: &Bench| b.beginning("2C2#") >= 3;
    let report = ended(&mut bench, options(&[1, 2, 3], 128), begun, |b, id| b.master.cancel(id));
    assert_eq!((outcomes(&report), report.exit()), (vec!["verified", "cancelled", "cancelled"], 4));
    assert!(report.boards[1].failure.as_ref().unwrap().to_string().contains("nothing was erased"));
    assert_eq!((check_program(&mut bench, 1, 128), check_program(&mut bench, 2, 128)), (OLD, OLD));
}

/// The user cancels the update while the new application starts. The board is verified, and the report contains this.
#[test]
fn p12_cancelled_while_it_starts() {
    let mut bench = initialised(&[0x21]);
    let start = UpdateOptions { start: true, ..options(&[1], 128) };
    let report = ended(&mut bench, start, |b| b.beginning("301#") >= 1, |b, id| b.master.cancel(id));
    let left = UpdateOutcome::Verified;
    assert_eq!(report.boards[0].failure, Some(UpdateFailure::Cancelled { left }));
    assert_eq!((report.boards[0].outcome, report.exit()), (left, 5));
    assert_eq!(check_program(&mut bench, 0, 128).1, DATE);
    // The update has stopped the application again. If the answers of the board are lost, its state is unknown, and the report states this.
    assert!(!bench.board(0).status().has(ucom::Status::MSTART));
    let mut bench = initialised(&[0x21]);
    let start = UpdateOptions { start: true, ..options(&[1], 128) };
    let begun = |b: &Bench| b.beginning("301#") >= 1;
    let report = ended(&mut bench, start, begun, |b, id| {
        b.lose = vec![("> 141#", u32::MAX)];
        b.master.cancel(id);
    });
    let left = UpdateOutcome::Running;
    assert_eq!(report.boards[0].failure, Some(UpdateFailure::Cancelled { left }));
    assert_eq!((report.boards[0].outcome, report.exit()), (UpdateOutcome::Verified, 5));
    assert!(report.boards[0].failure.as_ref().unwrap().to_string().contains("may be started"));
}

/// `--start` also starts a board that already has the image. If the user cancels before the start, the report states that the board is up
/// to date.
#[test]
fn a_board_that_is_up_to_date_is_started() {
    let mut bench = initialised(&[0x21, 0x42]);
    let first = update(&mut bench, options(&[1], 128));
    let start = UpdateOptions { start: true, keep_going: true, ..options(&[1, 2], 128) };
    let start = recorded(start, &first);
    let mut cancelled = initialised(&[0x21, 0x42]);
    update(&mut cancelled, options(&[1], 128));
    let begun = |b: &Bench| b.beginning("2C2#") >= 3;
    let report = ended(&mut cancelled, start.clone(), begun, |b, id| b.master.cancel(id));
    let left = UpdateOutcome::UpToDate;
    assert_eq!(report.boards[0].failure, Some(UpdateFailure::Cancelled { left }));
    assert_eq!((report.exit(), cancelled.beginning("301#")), (4, 0));
    let blocks = bench.beginning("2C1#");
    let report = update(&mut bench, start.clone());
    assert_eq!((outcomes(&report), report.exit()), (vec!["running", "running"], 0), "{report:?}");
    assert_eq!(bench.beginning("2C1#"), blocks);
    // All boards are up to date and already run, so the update does not send PC_START again.
    let sent = bench.beginning("301#");
    let mut all = recorded(start.clone(), &report);
    all.records.extend(start.records);
    assert_eq!((update(&mut bench, all).exit(), bench.beginning("301#")), (0, sent));
}

/// The report does not call a board silent if the board answers but does not enable programming. The exit code of this update is 1.
#[test]
fn a_board_that_does_not_enable_programming_answers() {
    let info = ["141#2100011B34126E38", "141#0000"];
    let mut bench = Bench::script(Script::default().on("201#", &info));
    let report = update(&mut bench, options(&[1], 128));
    let Some(UpdateFailure::Reported(e)) = &report.boards[0].failure else { panic!("{report:?}") };
    assert!(matches!(**e, Error::Status(StatusError::StatusNotTaken { board: 1, .. })), "{e}");
    assert_eq!((report.boards[0].outcome, report.exit()), (UpdateOutcome::NotStarted, 1));
}

/// U-1: the master checks the board before every attempt. A board that was replaced since the last attempt does not get XRESET or program
/// data.
#[test]
fn u1_a_board_that_is_swapped_between_attempts() {
    let swapped = |resets, cancelled| if resets == 1 && cancelled { "4200" } else { "2100" };
    let special = |_, block| (block == 33).then_some("081#01");
    let mut bench = loader(Loader { flash: swapped, special, ..Loader::new(34) });
    let report = update(&mut bench, options(&[1], 1000));
    let wrong = Error::Identity(IdentityError::WrongBoard { board: 1, wanted: 0x21, found: 0x42 });
    assert_eq!(report.boards[0].failure, Some(UpdateFailure::After(Box::new(wrong.clone()))));
    assert_eq!((bench.count("041#"), report.exit()), (1, 5), "{report:?}");
    // The board is replaced by another board at the moment of XRESET. The master refuses the update, the other board leaves programming
    // mode, and no memory is written.
    let mut bench = loader(Loader { flash: |n, _| if n == 0 { "2100" } else { "4200" }, ..Loader::new(34) });
    let report = update(&mut bench, options(&[1], 1000));
    assert_eq!(report.boards[0].failure, Some(UpdateFailure::Refused(Box::new(wrong))));
    assert_eq!((bench.beginning("2C1#"), bench.count("1C1#0400"), report.exit()), (0, 1, 4));
}

/// The master does not report a single corrupted answer as another board.
#[test]
fn one_damaged_answer_is_no_swapped_board() {
    let mut bench = initialised(&[0x21]);
    let asked = {
        let mut bench = initialised(&[0x21]);
        let before = bench.log.len();
        update(&mut bench, options(&[1], 128));
        let reset = bench.log.iter().position(|(.., f)| f.to_string() == "041#").unwrap();
        let info = |(i, (.., f)): (usize, &(u64, From, Frame))| {
            (f.to_string().starts_with("141#21") && i > before && i < reset).then_some(i)
        };
        bench.log.iter().enumerate().filter_map(info).next_back().unwrap()
    };
    bench.fault = Some((asked, super::bench::Fault::Corrupted(1)));
    let report = update(&mut bench, options(&[1], 128));
    assert_eq!((report.boards[0].outcome, report.exit()), (UpdateOutcome::Verified, 0), "{report:?}");
}

/// Returns a board that becomes silent at XRESET. Another board takes the number when the master assigns the number again (5.4).
fn impostor() -> impl Member {
    let (mut silent, mut other) = (false, false);
    Answering::new(move |frame| match frame {
        "041#" => {
            silent = true;
            &[]
        }
        "1C1#0800" => {
            other = false;
            &[]
        }
        "281#" => {
            other = true;
            &["0C1#01"]
        }
        "201#" if other => &["141#4200011934126E38", "141#0000"],
        "201#" if !silent => &["141#2100011B34126E38", "141#0000"],
        _ => &[],
    })
}

/// 5.4: another board took the number of the selected board. The master refuses the update with exit code 4, no memory is written, and the
/// other board loses the number again.
#[test]
fn u4_repair_that_finds_another_board_is_refused() {
    let mut bench = Bench::new(Default::default(), vec![Box::new(impostor())]);
    let report = update(&mut bench, options(&[1], 1000));
    let wrong = Error::Identity(IdentityError::WrongBoard { board: 1, wanted: 0x21, found: 0x42 });
    assert_eq!(report.boards[0].failure, Some(UpdateFailure::Refused(Box::new(wrong))));
    assert_eq!((report.exit(), bench.beginning("2C1#")), (4, 0));
    assert_eq!(report.boards[0].outcome, UpdateOutcome::NotStarted);
    assert_eq!(bench.count("1C1#0800"), 3);
    // The master switches off the outgoing pin before it assigns the number again (5.4).
    let sent = bench.sent();
    let place = |text: &str| sent.iter().position(|t| t == text).unwrap();
    assert!(place("1C1#0200") < place("281#"));
}

/// D-08: a dry run also checks for another PC, because it shows the result that a real update would have. The dry run still sends only
/// queries.
#[test]
fn d08_a_dry_run_looks_for_another_pc() {
    let info = ["141#2100011B34126E38", "141#0000"];
    let foreign = (0..40)
        .fold(Script::default().on("201#", &info).on("200#", &info), |script, i| script.at(50 * i, "680#"));
    let mut bench = Bench::script(foreign);
    let dry = UpdateOptions { dry_run: true, ..options(&[1], 1000) };
    let report = update(&mut bench, dry.clone());
    let Some(UpdateFailure::Refused(e)) = &report.boards[0].failure else { panic!("{report:?}") };
    assert!(matches!(**e, Error::Master(MasterError::CompetingMaster { .. })), "{e}");
    assert_eq!(report.exit(), 4);
    assert!(bench.sent().iter().all(|t| t == "201#" || t == "200#"), "{:?}", bench.sent());
    assert!(!bench.master.is_master());
    // Without another PC on the bus, the dry run succeeds and does not send heartbeats.
    let mut bench = Bench::script(Script::default().on("201#", &info).on("200#", &info));
    assert_eq!(update(&mut bench, dry).exit(), 0);
    assert!(bench.sent().iter().all(|t| t == "201#" || t == "200#"), "{:?}", bench.sent());
}

/// A board already has the image, but is still in programming mode, for example after an update tool was killed. An update ends the
/// programming mode of this board. A dry run of the update does not change any board.
#[test]
fn a_board_that_is_up_to_date_does_not_stay_in_programming_mode() {
    let left = || {
        let mut bench = initialised(&[0x21, 0x42]);
        let report = update(&mut bench, options(&[1], 128));
        bench.go(Request::XReset { board: 1, force: false }, 20).unwrap();
        assert!(bench.board(0).status().has(Status::PROG));
        (bench, recorded(options(&[1], 128), &report))
    };
    for start in [false, true] {
        let (mut bench, again) = left();
        let from = bench.log.len();
        let report = update(&mut bench, UpdateOptions { start, ..again });
        let wanted = if start { UpdateOutcome::Running } else { UpdateOutcome::UpToDate };
        assert_eq!((report.boards[0].outcome, report.exit()), (wanted, 0), "{report:?}");
        assert!(!bench.board(0).status().has(Status::PROG));
        assert!(bench.log[from..].iter().all(|(.., f)| !f.to_string().starts_with("2C1#")), "not programmed");
    }
    let (mut bench, again) = left();
    let report = update(&mut bench, UpdateOptions { dry_run: true, ..again });
    assert_eq!((report.boards[0].outcome, report.exit()), (UpdateOutcome::UpToDate, 0));
    assert!(bench.board(0).status().has(Status::PROG));
    // The board does not leave programming mode, and the report contains this failure.
    let (mut bench, again) = left();
    bench.lose = vec![("< 1C1#", u32::MAX)];
    let report = update(&mut bench, again);
    let code = report.boards[0].failure.as_ref().map(UpdateFailure::code);
    assert_eq!((code, report.boards[0].outcome), (Some("still-programming"), UpdateOutcome::UpToDate));
    assert_ne!(report.exit(), 0);
}

/// P-12: the update is cancelled, or the bus fails, at any time while the master reads boards in programming mode and ends this mode. The
/// report lists each board that is up to date but stays in programming mode.
#[test]
fn a_cancel_leaves_no_board_in_programming_mode_unnamed() {
    let left = || {
        let mut bench = initialised(&[0x21, 0x42]);
        let report = update(&mut bench, options(&[1, 2], 64));
        for board in [1, 2] {
            bench.go(Request::XReset { board, force: false }, 20).unwrap();
        }
        // A tool that was started recently listens for another PC before it sends a command that changes a board (D-08).
        bench.master = Master::new(ucom::Profile::default());
        (bench, recorded(options(&[1, 2], 64), &report))
    };
    let (mut whole, again) = left();
    let since = whole.now;
    update(&mut whole, again);
    let took = whole.now - since;
    let cancel: fn(&mut Bench, ucom_host::master::ProcedureId) = |bench, id| bench.master.cancel(id);
    for end in [cancel, unplugged] {
        let (mut taken_out, mut named) = (0, 0);
        for after in (0..=took).step_by(10_000) {
            let (mut bench, again) = left();
            let at = bench.now + after;
            let report = ended(&mut bench, again, |b| b.now >= at, end);
            for (i, result) in report.boards.iter().enumerate() {
                let code = result.failure.as_ref().map(UpdateFailure::code);
                if !bench.board(i).status().has(Status::PROG) {
                    taken_out += 1;
                } else if result.outcome == UpdateOutcome::UpToDate {
                    assert_eq!(code, Some("still-programming"), "after {after} µs: {result:?}");
                    named += 1;
                } else {
                    // The master had not read this board before the update ended, so the report contains only the
                    // cancel or the failure of the bus.
                    assert!(matches!(code, Some("cancelled" | "bus")), "after {after} µs: {result:?}");
                }
            }
        }
        assert!(named > 0 && taken_out > 0, "{named} named, {taken_out} taken out");
    }
}
