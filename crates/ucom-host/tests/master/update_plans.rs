//! Tests of updates with unusual plans and headers. The tests cover the memories that each cycle may erase, the updates that can be
//! verified, and the report of updates that cannot be verified.

use super::bench::Exit;
use ucom::profile::{HeaderForm, Plan};
use ucom::{Checksum, Memory, Profile};
use ucom_host::master::update::{
    PlanError, Unverifiable, UpdateFailure, UpdateImage, UpdateOptions, UpdateOutcome, UpdateReport,
};
use ucom_host::master::{Error, InitOptions, Request};

use super::bench::{Bench, OLD, image};
use super::loader::Loader;
use super::update::{options, update};

fn with_plan(prog_plan: Plan) -> Profile {
    Profile { prog_plan, ..Profile::default() }
}

/// Returns options with an image of 16 data blocks, and with a second image of 64 bytes if the plan requires it.
fn two(plan: Plan) -> UpdateOptions {
    let second = UpdateImage { bytes: [9; 64].into(), address_words: 0x20 };
    let second = (plan != Plan::VerifyWrite).then_some(second);
    UpdateOptions { second, ..options(&[1], 1000) }
}

/// The test compares the exit codes of each plan: 1 or 3 before an erase, 5 after an erase. Only the plans `verify-write` and
/// `exloader-app` do not change flash in their first cycle.
#[test]
fn d40_what_the_first_cycle_may_have_erased() {
    let cases = [
        (Plan::VerifyWrite, 34, false),
        (Plan::ExloaderApp, 2 + 17, false),
        (Plan::PmemXmem, 17 + 2, true),
        (Plan::Raw, 16 + 1, true),
    ];
    for (plan, blocks, erased) in cases {
        let left = if erased { UpdateOutcome::Incomplete } else { UpdateOutcome::NotStarted };
        type Special = fn(usize, usize) -> Option<&'static str>;
        let ends: [(Special, u8); 3] = [
            (|_, block| (block == 1).then_some("081#01"), 1),
            (|_, block| (block == 0).then_some("081#02"), 1),
            (|_, block| (block == 1).then_some(""), 3),
        ];
        for (special, before) in ends {
            let board = Loader { special, ..Loader::new(blocks) };
            let mut bench = Bench::new(with_plan(plan), vec![Box::new(board)]);
            let report = update(&mut bench, two(plan));
            assert_eq!(report.exit(), if erased { 5 } else { before }, "{plan}: {report:?}");
            assert_eq!(report.boards[0].outcome, left, "{plan}: {report:?}");
        }
        // The board sends error 3 after block 16 of the attempt, counted from 0. With `verify-write`, block 16 is the last block of cycle
        // 1; with the other plans, it comes after an erase.
        let board = Loader { special: |_, block| (block == 16).then_some("081#03"), ..Loader::new(blocks) };
        let mut bench = Bench::new(with_plan(plan), vec![Box::new(board)]);
        let expected = if plan == Plan::VerifyWrite { 1 } else { 5 };
        assert_eq!(update(&mut bench, two(plan)).exit(), expected, "{plan}");
    }
}

/// The update writes each of the two images to the memory that the plan defines. The report contains address, length
/// and Program ID of each image.
#[test]
fn d40_two_images_reach_two_memories() {
    for (plan, memory) in [(Plan::ExloaderApp, Memory::Ram), (Plan::PmemXmem, Memory::Data)] {
        let mut bench = Bench::chain_with(&[0x21], with_plan(plan));
        assert!(bench.go(Request::Init(InitOptions::default()), 60).is_ok());
        let report = update(&mut bench, two(plan));
        assert_eq!((report.boards[0].outcome, report.exit()), (UpdateOutcome::Verified, 0), "{report:?}");
        let flash = &bench.board(0).flash;
        assert_eq!(flash.bytes(Memory::Program)[..1000], image(1000));
        assert_eq!(flash.bytes(memory)[0x40..0x80], [9; 64], "{plan}");
        let [first, second] = report.images.as_slice() else { panic!("{report:?}") };
        assert_eq!((first.memory, first.address_words, first.bytes), (Some(Memory::Program), Some(0), 1000));
        assert_eq!((second.memory, second.address_words, second.bytes), (Some(memory), Some(0x20), 64));
        assert_eq!((first.program_id, report.program_id), (Some(0x4B3F), Some(0x4B3F)));
        assert_ne!(second.program_id, first.program_id);
        let cycles = if plan == Plan::ExloaderApp { [(2, 2), (1, 1)] } else { [(1, 1), (2, 2)] };
        assert_eq!([first.cycles, second.cycles], cycles);
    }
}

/// Runs an update with the plan `raw`. At the end of the update, the board reports `after` and `done_status`.
fn raw(after: &'static str, done_status: u8, expect_program_id: Option<u16>) -> UpdateReport {
    let board = Loader { info: ["34126E38", after], done_status, ..Loader::new(32) };
    let mut bench = Bench::new(with_plan(Plan::Raw), vec![Box::new(board)]);
    update(&mut bench, UpdateOptions { expect_program_id, ..options(&[1], 1000) })
}

/// U-10: with the plan `raw`, the image's Program ID is unknown. The outcome is never `verified`, and the update is done only when the
/// board reports an application. The report contains the reason, a method to verify the program, and the board's answers before and after
/// the update.
#[test]
fn u10_what_cannot_be_verified_says_so() {
    let report = raw("3F4BC13A", 0x1B, None);
    let board = &report.boards[0];
    assert_eq!((board.outcome, &board.failure, report.exit()), (UpdateOutcome::Written, &None, 5));
    // If the user accepts unverified programs, the exit code is 0.
    assert_eq!(UpdateReport { accept_unverified: true, ..report.clone() }.exit(), 0);
    assert_eq!((report.unverifiable, report.program_id), (Some(Unverifiable::RawPlan), None));
    assert!(report.unverifiable.unwrap().hint().contains("--expect-program-id"));
    let shown = [board.before, board.after].map(|info| info.map(|i| (i.program_id, i.date)));
    assert_eq!(shown, [Some(OLD), Some((0x4B3F, 0x3AC1))]);
    // DSP_PROGFINISHED does not prove success if the board then reports no application, or if an application already
    // runs.
    for (after, status) in [("FFFFFFFF", 0x1B), ("3F4BC13A", 0x8B)] {
        let report = raw(after, status, None);
        let failure = report.boards[0].failure.clone();
        assert!(matches!(failure, Some(UpdateFailure::NotValid { .. })), "{report:?}");
        assert_eq!((report.boards[0].outcome, report.exit()), (UpdateOutcome::Written, 5));
    }
}

/// U-10: the user gives a Program ID for the image. The update verifies the board with this Program ID, and refuses an image with another
/// Program ID.
#[test]
fn u10_a_named_program_id_is_verified() {
    let report = raw("3F4BC13A", 0x1B, Some(0x4B3F));
    assert_eq!((report.boards[0].outcome, report.exit()), (UpdateOutcome::Verified, 0), "{report:?}");
    assert_eq!((report.unverifiable, report.program_id), (None, Some(0x4B3F)));
    let report = raw("3F4BC13A", 0x1B, Some(0x4B40));
    assert!(matches!(
        report.boards[0].failure,
        Some(UpdateFailure::NotVerified { program_id: 0x4B3F, wanted_id: 0x4B40, wanted_date: None, .. })
    ));
    assert_eq!(report.exit(), 5);
    // The board already reports the requested Program ID (U-3). No flash record confirms the image, so the outcome is
    // not `up-to-date` (D-62).
    let report = raw("3F4BC13A", 0x1B, Some(OLD.0));
    assert_eq!((report.boards[0].outcome, report.boards[0].attempts), (UpdateOutcome::ProgramUpToDate, 0));
    // If the Program ID of an image is known, it must equal the Program ID that the user gives.
    let mut bench = Bench::new(Profile::default(), vec![Box::new(Loader::new(34))]);
    let other = UpdateOptions { expect_program_id: Some(0x4B40), ..options(&[1], 1000) };
    let error = bench.go(Request::Update(other), 60).unwrap_err();
    assert_eq!(error, Error::Plan(PlanError::OtherProgram { image: 0x4B3F, expected: 0x4B40 }));
    assert_eq!((error.exit(), bench.sent().len()), (4, 0));
    let same = UpdateOptions { expect_program_id: Some(0x4B3F), ..options(&[1], 1000) };
    assert_eq!(update(&mut bench, same).boards[0].outcome, UpdateOutcome::Verified);
}

/// U-9: if DSP_PROGFINISHED is lost, PC_INFO can show the success of the update only if the expected Program ID is
/// known. Without an expected Program ID, the update fails.
#[test]
fn u9_not_where_nothing_is_expected() {
    let board = Loader { special: |_, block| (block == 31).then_some(""), ..Loader::new(32) };
    let mut bench = Bench::new(with_plan(Plan::Raw), vec![Box::new(board)]);
    let report = update(&mut bench, options(&[1], 1000));
    assert_eq!((report.exit(), report.boards[0].attempts), (5, 3), "{report:?}");
}

/// Boards of the crate `ucom` that use no checksums or no headers are written and started, and the report calls them unverified.
#[test]
fn boards_without_checksum_or_header() {
    let none = Profile { prog_checksum: Checksum::None, ..Profile::default() };
    let headerless = Profile { prog_header: HeaderForm::None, ..Profile::default() };
    for (profile, why, bytes) in
        [(none, Unverifiable::NoChecksum, 1000), (headerless, Unverifiable::NoHeader, 0x10000)]
    {
        let mut bench = Bench::chain_with(&[0x21], profile);
        assert!(bench.go(Request::Init(InitOptions::default()), 60).is_ok());
        let unverified = UpdateOptions { start: true, accept_unverified: true, ..options(&[1], bytes) };
        let report = update(&mut bench, unverified);
        assert_eq!((report.boards[0].outcome, report.exit()), (UpdateOutcome::Running, 0), "{report:?}");
        assert_eq!(report.unverifiable, Some(why));
        assert_eq!(bench.board(0).flash.bytes(Memory::Program)[..bytes], image(bytes));
    }
}
