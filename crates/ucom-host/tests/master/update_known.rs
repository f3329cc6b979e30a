//! Tests of the conditions under which a board is up to date (D-62, U-3). A board is up to date if both its answer and
//! its flash record match the image. Some tests cover cases in which even this is not enough.

use super::bench::{Bench, Exit};
use super::chain::initialised;
use super::update::{DATE, options, recorded, update};
use ucom::profile::Plan;
use ucom::{Memory, Profile, Status};
use ucom_host::master::update::{UpdateImage, UpdateMode, UpdateOptions, UpdateOutcome, UpdateReport};
use ucom_host::master::{Event, InitOptions, Request};

/// Returns the number of frames with program data, to one board or to all boards.
fn data_frames(bench: &Bench) -> usize {
    bench.log.iter().filter(|(.., f)| matches!(f.to_string().get(..3), Some("2C0" | "2C1" | "2C2"))).count()
}

/// Returns a chain of two boards that have the image of `options`, and the options with the flash records of these boards.
fn written() -> (Bench, UpdateOptions) {
    let mut bench = initialised(&[0x21, 0x42]);
    let options = UpdateOptions { keep_going: true, ..options(&[1, 2], 128) };
    let report = update(&mut bench, options.clone());
    assert!(report.boards.iter().all(|b| (b.outcome, b.verified) == (UpdateOutcome::Verified, true)));
    (bench, recorded(options, &report))
}

/// Runs the update again. Returns the outcome and the verification of each board, the exit code, and `true` if program data were sent.
fn again(bench: &mut Bench, options: UpdateOptions) -> (Vec<(&'static str, bool)>, u8, bool) {
    let before = data_frames(bench);
    let report = update(bench, options);
    let boards = report.boards.iter().map(|b| (b.outcome.name(), b.verified)).collect();
    (boards, report.exit(), data_frames(bench) > before)
}

fn both(outcome: &'static str, verified: bool) -> Vec<(&'static str, bool)> {
    vec![(outcome, verified); 2]
}

/// D-62: the board's answer is not enough; the flash record is also needed. The test covers ten cases in which a board is not up to date,
/// with updates one by one and as a group.
#[test]
fn d62_the_flash_record_decides() {
    type Change = fn(&mut UpdateOptions);
    let cases: [(&str, Change, bool); 10] = [
        ("another hash", |o| o.records.values_mut().for_each(|r| r.sha256[31] ^= 1), true),
        ("another address", |o| o.records.values_mut().for_each(|r| r.address = 0x200), true),
        ("an image for another address", |o| o.image.address_words = 0x20, true),
        (
            "another hash and an older program",
            |o| o.records.values_mut().for_each(|r| (r.sha256[0], r.program_id) = (r.sha256[0] ^ 1, 7)),
            true,
        ),
        ("no record", |o| o.records.clear(), false),
        (
            "records of other boards",
            |o| o.records = o.records.iter().map(|(f, r)| (f + 1, *r)).collect(),
            false,
        ),
        ("another program since", |o| o.records.values_mut().for_each(|r| r.program_id ^= 1), false),
        ("written with another date", |o| o.records.values_mut().for_each(|r| r.date += 1), false),
        ("rewrite", |o| o.rewrite = true, true),
        ("force", |o| o.force = true, true),
    ];
    for mode in [UpdateMode::OneByOne, UpdateMode::Group] {
        for (name, change, is_sent) in cases {
            let (mut bench, mut options) = written();
            options.mode = mode;
            change(&mut options);
            let (boards, code, sent) = again(&mut bench, options);
            assert_eq!(sent, is_sent, "{name} {mode:?}");
            let expected = if is_sent { both("verified", true) } else { both("program-up-to-date", false) };
            assert_eq!((boards, code), (expected, if is_sent { 0 } else { 4 }), "{name} {mode:?}");
        }
        // The board is up to date if image and address are equal to those in the flash record.
        let (mut bench, mut options) = written();
        options.mode = mode;
        assert_eq!(again(&mut bench, options), (both("up-to-date", true), 0, false), "{mode:?}");
    }
}

/// D-62: the report does not call a program verified if it was never verified, even if the user accepts the program.
#[test]
fn d62_an_accepted_program_is_not_verified() {
    let (mut bench, options) = written();
    let unknown = UpdateOptions { records: Default::default(), ..options };
    let accepted = UpdateOptions { accept_unverified: true, ..unknown.clone() };
    assert_eq!(again(&mut bench, accepted.clone()), (both("program-up-to-date", false), 0, false));
    // Without a flash record, the master starts the application only if the user accepts the unverified program.
    let start = UpdateOptions { start: true, ..unknown };
    assert_eq!(again(&mut bench, start), (both("program-up-to-date", false), 4, false));
    assert!(!bench.board(0).status().has(Status::MSTART));
    let start = UpdateOptions { start: true, ..accepted };
    assert_eq!(again(&mut bench, start.clone()), (both("running", false), 0, false));
    // If the start fails, the program is also not verified.
    bench
        .go(Request::Stop { board: 1, level: ucom_host::master::StopLevel::Application, force: true }, 20)
        .unwrap();
    bench.lose = vec![("< 301#", u32::MAX)];
    let (boards, code, _) =
        again(&mut bench, UpdateOptions { targets: start.targets[..1].to_vec(), ..start });
    assert_eq!((boards, code), (vec![("program-up-to-date", false)], 5));
}

/// D-62: the Program ID of a board covers program memory only. Therefore every update writes a second image, which is
/// for data memory, even if flash records exist.
#[test]
fn d62_data_memory_is_written_each_time() {
    let profile = Profile { prog_plan: Plan::PmemXmem, ..Profile::default() };
    let mut bench = Bench::chain_with(&[0x21], profile);
    assert!(bench.go(Request::Init(InitOptions::default()), 60).is_ok());
    let data = |byte: u8| {
        let second = UpdateImage { bytes: [byte; 64].into(), address_words: 0 };
        UpdateOptions { second: Some(second), ..options(&[1], 128) }
    };
    let mut report = update(&mut bench, data(1));
    for byte in [2, 2, 3] {
        report = update(&mut bench, recorded(data(byte), &report));
        assert_eq!((report.boards[0].outcome, report.exit()), (UpdateOutcome::Verified, 0));
        assert_eq!(bench.board(0).flash.bytes(Memory::Data)[..64], [byte; 64]);
    }
}

/// U-3: a board that has this program with another date is up to date, unless the user requires the date.
#[test]
fn u3_another_date_is_up_to_date() {
    let today = |options: UpdateOptions| UpdateOptions { date: DATE + 1, any_date: true, ..options };
    let (mut bench, options) = written();
    let report: UpdateReport = update(&mut bench, today(options.clone()));
    let words = report.shown_already(&report.boards[0], &Profile::default());
    assert_eq!(words.as_deref(), Some("same Program ID, flashed 2009-06-01"));
    let words = report.outcome_words(&report.boards[0], &Profile::default());
    assert_eq!(words, "up-to-date (flashed 2009-06-01)");
    assert_eq!(again(&mut bench, today(options.clone())), (both("up-to-date", true), 0, false));
    // Without a flash record, a matching date does not prove the image.
    let unknown = UpdateOptions { records: Default::default(), ..today(options.clone()) };
    assert_eq!(again(&mut bench, unknown.clone()), (both("program-up-to-date", false), 4, false));
    let report = update(&mut bench, unknown);
    let words = report.shown_already(&report.boards[0], &Profile::default());
    assert_eq!(
        words.as_deref(),
        Some("same Program ID, flashed 2009-06-01; content and address not verified")
    );
    // The update writes the program with the date that the user requires.
    let asked = UpdateOptions { any_date: false, ..today(options) };
    assert_eq!(again(&mut bench, asked), (both("verified", true), 0, true));
    assert_eq!(bench.board(0).record().map(|r| r.date), Some(DATE + 1));
}

/// D-62: the flash record is removed before a board is reset for programming, and stored again after the board has been read back.
#[test]
fn d62_the_record_ends_before_anything_is_erased() {
    let mut bench = initialised(&[0x21]);
    update(&mut bench, options(&[1], 128));
    let times: Vec<u64> =
        bench.log.iter().filter(|(.., f)| f.to_string().starts_with("2C1#")).map(|(at, ..)| *at).collect();
    let (first, last) = (times[0], times[times.len() - 1]);
    let mut seen = Vec::new();
    for (at, event) in &bench.events {
        match event {
            Event::FlashBegins { flash_number, .. } => {
                assert!((*flash_number, *at < first) == (0x21, true), "{at} {first}");
                seen.push("begins");
            }
            Event::FlashVerified { info, .. } => {
                assert_eq!((info.flash_number, info.date, *at > last), (0x21, DATE, true));
                seen.push("verified");
            }
            _ => {}
        }
    }
    assert_eq!(seen, ["begins", "verified"]);
}
