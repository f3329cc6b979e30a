//! Tests that the conformance tests restore the state of the boards: at their end, after a cancel, and when a board
//! disconnects. This file also contains tests in which the master refuses to run the conformance tests.

use super::bench::Exit;
use ucom::{Function, Status};
use ucom_host::master::conformance::{ConformanceOptions, ConformanceProgram, ConformanceReport, Verdict};
use ucom_host::master::update::UpdateImage;
use ucom_host::master::{
    AddressError, BoardSeen, Error, Event, IdentityError, InitOptions, MasterError, Outcome, ProcedureId,
    Request, RunBoard, RunOptions, RunningError,
};

use super::bench::{Bench, From, image};
use super::conformance::all;

const FLASH: [u16; 3] = [0x21, 0x42, 0x63];

fn info(bench: &mut Bench, board: u8) -> BoardSeen {
    match bench.go(Request::Info { board }, 20) {
        Ok(Outcome::Info(seen)) => seen,
        other => panic!("board {board}: {other:?}"),
    }
}

/// Returns a chain of three boards with numbers. The application of the second board is started. The third board starts its application by
/// itself, but this application does not run yet.
fn chain() -> Bench {
    let mut bench = Bench::chain(&FLASH);
    bench.go(Request::Init(InitOptions::default()), 60).unwrap();
    bench.go(Request::Start { board: 2, force: false }, 20).unwrap();
    let (mask, value) = (Status::ASTART, Status::ASTART);
    bench.go(Request::SetStatus { board: 3, mask, value, force: false }, 20).unwrap();
    bench
}

/// Returns the state of a board that must not change: its flash number and its bits ASTART, MSTART, MCARUN and PROG.
fn state(bench: &mut Bench, board: u8) -> (u16, Status) {
    let seen = info(bench, board).info;
    let bits = Status::ASTART | Status::MSTART | Status::MCARUN | Status::PROG;
    (seen.flash_number, seen.status & bits)
}

fn states(bench: &mut Bench, boards: &[u8]) -> Vec<(u16, Status)> {
    boards.iter().map(|n| state(bench, *n)).collect()
}

fn done(bench: &Bench, id: ProcedureId) -> bool {
    bench.events.iter().any(|(_, e)| matches!(e, Event::Done { id: which, .. } if *which == id))
}

/// Advances the time until `frames` frames were on the bus or the procedure has ended.
fn until(bench: &mut Bench, id: ProcedureId, frames: usize) {
    while bench.log.len() < frames && !done(bench, id) {
        bench.run(1);
    }
}

fn report(bench: &mut Bench, id: ProcedureId) -> ConformanceReport {
    let ended = bench.events.iter().find_map(|(_, e)| match e {
        Event::Done { id: which, result } if *which == id => Some(result.clone()),
        _ => None,
    });
    match ended.unwrap_or_else(|| bench.wait(id, 2_000)) {
        Ok(Outcome::Conformance(report)) => report,
        other => panic!("{other:?}"),
    }
}

/// Cancels the conformance tests at many different moments. After the cancel, ASTART, MSTART, MCARUN, PROG and the numbers must be as
/// before the tests. The report of the tests is complete and lists a board that was erased.
#[test]
fn cancelled_tests_leave_the_boards_as_they_were() {
    let mut bench = chain();
    let before = states(&mut bench, &[1, 2, 3]);
    let from = bench.log.len();
    let id = bench.master.start(bench.now, Request::Conformance(all())).unwrap();
    let whole = report(&mut bench, id);
    assert_eq!((whole.error.clone(), whole.left.clone()), (None, vec![]));
    assert_eq!(states(&mut bench, &[1, 2, 3]), before, "at the end");
    let frames = bench.log.len() - from;
    for moment in 1..32 {
        let mut bench = chain();
        let before = states(&mut bench, &[1, 2, 3]);
        let id = bench.master.start(bench.now, Request::Conformance(all())).unwrap();
        let at = bench.log.len() + moment * frames / 32;
        until(&mut bench, id, at);
        bench.master.cancel(id);
        let result = bench.wait(id, 200);
        let report = match result {
            Ok(Outcome::Conformance(report)) => report,
            // No board was changed before the first conformance test.
            Err(Error::Master(MasterError::Cancelled)) => {
                assert_eq!(states(&mut bench, &[1, 2, 3]), before, "moment {moment}");
                continue;
            }
            other => panic!("moment {moment}: {other:?}"),
        };
        if report.error.is_some() {
            assert_eq!(report.exit(), 5);
            let skipped = Verdict::Skipped("cancelled".into());
            assert!(report.tests.iter().any(|t| t.verdict == skipped), "moment {moment}");
            assert_eq!(report.tests.len(), whole.tests.len(), "moment {moment}");
        }
        let programless = !info(&mut bench, 1).info.has_application();
        let named = report.left.iter().any(|l| l.starts_with("board 1 has no program now"));
        assert_eq!(named, programless, "moment {moment}: {:?}", report.left);
        assert_eq!(report.left.len(), usize::from(named), "moment {moment}: {:?}", report.left);
        // Waits until the third board has started its application by itself.
        bench.run(4_000);
        assert_eq!(states(&mut bench, &[1, 2, 3]), before, "moment {moment} {:?}", report.tests.last());
    }
}

/// A board disconnects during the conformance tests. The exit code is 3, the remaining conformance tests are skipped with the reason, and
/// the state of the other boards does not change.
#[test]
fn a_board_that_is_gone_ends_the_tests_with_their_report() {
    let mut bench = chain();
    let before = states(&mut bench, &[1, 3]);
    let options = ConformanceOptions { run: true, ..Default::default() };
    let id = bench.master.start(bench.now, Request::Conformance(options)).unwrap();
    let started = |b: &Bench| {
        let tested =
            |e: &Event| matches!(e, Event::Tested { test, .. } if test.id == "D-T9" && test.board == Some(2));
        b.events.iter().any(|(_, e)| tested(e))
    };
    while !started(&bench) {
        bench.run(10);
    }
    bench.cut = vec![1];
    let report = report(&mut bench, id);
    assert_eq!(report.exit(), 3, "{:?}", report.error);
    let skipped = Verdict::Skipped("board 2 does not answer".into());
    assert!(report.tests.iter().any(|t| t.board == Some(3) && t.id == "D-T8" && t.verdict == skipped));
    assert!(report.left.iter().any(|l| l.starts_with("board 2")), "{:?}", report.left);
    assert_eq!(states(&mut bench, &[1, 3]), before);
}

/// A board of the chain has no number. After a new address assignment, another board could have the number of the tested board, so the
/// master refuses the request.
#[test]
fn address_assignment_is_refused_when_a_board_has_no_number() {
    let mut bench = chain();
    let (mask, value) = (Status::INIT, Status(0));
    bench.go(Request::SetStatus { board: 1, mask, value, force: false }, 20).unwrap();
    let from = bench.log.len();
    let options = ConformanceOptions { init: true, ..Default::default() };
    let refused = bench.go(Request::Conformance(options), 60).unwrap_err();
    assert_eq!(refused, Error::Address(AddressError::NotNumbered { reports: 3, boards: 2 }));
    assert_eq!(refused.exit(), 4);
    let changes = |f: &ucom::Frame| matches!(f.address(), Ok((Function::Reset | Function::SetStatus, _)));
    assert!(!bench.log[from..].iter().any(|(_, who, f)| *who == From::Master && changes(f)));
}

/// The conformance tests program only the selected board. The header of the image contains the flash number of this board and the address
/// of the image.
#[test]
fn programs_the_board_that_is_named_alone() {
    let mut bench = chain();
    let program = ConformanceProgram {
        board: 1,
        flash_number: 0x21,
        image: UpdateImage { bytes: image(1000).into(), address_words: 0x0001_0040 },
        date: 0x5C21,
    };
    let only = vec!["D-T17".to_owned()];
    let options = |flash_number| ConformanceOptions {
        program: Some(ConformanceProgram { flash_number, ..program.clone() }),
        only: only.clone(),
        ..Default::default()
    };
    let refused = bench.go(Request::Conformance(options(0x42)), 60).unwrap_err();
    assert_eq!(refused, Error::Identity(IdentityError::WrongBoard { board: 1, wanted: 0x42, found: 0x21 }));
    let from = bench.log.len();
    bench.go(Request::Conformance(options(0x21)), 60).unwrap();
    let mut header = Vec::new();
    for (_, _, frame) in bench.log[from..].iter().filter(|(_, who, _)| *who == From::Master) {
        if let Ok((Function::Prog, to)) = frame.address() {
            assert_eq!(to.number(), 1);
            header.extend_from_slice(frame.data());
        }
    }
    assert_eq!((&header[8..12], &header[20..22]), (&[0x40, 0, 1, 0][..], &[0x21, 0][..]));
    // U-2: the master refuses the test if any board runs, even if the test does not cover this board.
    let run = RunOptions { boards: vec![RunBoard { board: 2, ..Default::default() }], ..Default::default() };
    bench.go(Request::Run(run), 20).unwrap();
    let tested = ConformanceOptions { boards: vec![1], ..options(0x21) };
    let refused = bench.go(Request::Conformance(tested), 60).unwrap_err();
    assert_eq!(refused, Error::Running(RunningError::LoopRuns { boards: vec![2] }));
}
