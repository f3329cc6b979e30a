//! Tests with a fault on every single frame of scan, init and process data. The result of each test is success or a specific error, never a
//! wrong number or an endless wait. Every wait of the master is limited in virtual time.

use ucom_host::master::{InitFinding, InitOptions, Outcome, Request, RunBoard, RunOptions, Setting};

use super::bench::{Bench, CI, Fault, PAR, SO};
use super::chain::initialised;

const IDS: [u16; 3] = [0x21, 0x42, 0x63];

/// Returns every kind of fault for the frame with the index `at`. The index of the frame determines which bit is damaged.
pub(super) fn kinds(at: usize) -> [Fault; 6] {
    let bit = (at * 7 + 3) as u8;
    [
        Fault::Lost,
        Fault::Doubled,
        Fault::Swapped,
        Fault::Delayed(30),
        Fault::Delayed(250),
        Fault::Corrupted(bit),
    ]
}

/// Checks that no two boards have the same number.
fn check_numbers(bench: &mut Bench, what: &str) {
    let numbers: Vec<_> = (0..IDS.len()).filter_map(|i| bench.board(i).number()).collect();
    let mut unique = numbers.clone();
    unique.dedup();
    assert_eq!(unique.len(), numbers.len(), "{what}: {numbers:?}");
}

#[test]
fn every_frame_of_an_init_disturbed() {
    let total = initialised(&IDS).log.len();
    let (mut named, mut complete) = (0, 0);
    for at in 0..total {
        for fault in kinds(at) {
            let what = format!("frame {at} {fault:?}");
            let mut bench = Bench::chain(&IDS);
            bench.fault = Some((at, fault));
            let result = bench.go(Request::Init(InitOptions::default()), 60);
            check_numbers(&mut bench, &what);
            let Ok(Outcome::Init(report)) = result else { panic!("{what}: {result:?}") };
            for seen in &report.boards {
                let board = bench.board(usize::from(seen.number) - 1);
                assert_eq!(board.number().map(|n| n.number()), Some(seen.number), "{what}");
                assert_eq!(board.config().flash_number, seen.info.flash_number, "{what}");
            }
            if report.is_ok() {
                assert_eq!(report.boards.len(), 3, "{what}");
                complete += 1;
            } else {
                named += 1;
                // A single frame that is lost, doubled or late never results in an incomplete chain. Only a corrupted
                // frame can have this result.
                assert!(matches!(fault, Fault::Corrupted(_)), "{what}: {:?}", report.findings);
            }
        }
    }
    println!("{complete} chains complete, {named} named findings");
    assert!(complete > 9 * named);
}

#[test]
fn every_frame_of_a_scan_disturbed() {
    let scanned = |bench: &mut Bench| match bench.go(Request::Scan, 30) {
        Ok(Outcome::Scan(report)) => report,
        other => panic!("{other:?}"),
    };
    let mut bench = initialised(&IDS);
    let from = bench.log.len();
    scanned(&mut bench);
    let to = bench.log.len();
    for at in from..to {
        for fault in kinds(at) {
            let mut bench = initialised(&IDS);
            bench.fault = Some((at, fault));
            let report = scanned(&mut bench);
            let what = format!("frame {at} {fault:?} {:?}", bench.log[at]);
            for seen in &report.boards {
                assert_eq!(seen.info.flash_number, IDS[usize::from(seen.number) - 1], "{what}");
            }
            if !matches!(fault, Fault::Corrupted(_)) {
                assert_eq!(report.boards.len(), 3, "{what}");
            } else if report.boards.len() < 3 {
                // The corrupted frame has reset boards, so they have no numbers. The scan must report this.
                assert!(!report.findings.is_empty(), "{what}");
            }
        }
    }
}

/// The test repeats the start of a board, from the exloader to enabled outputs, each time with a fault in another
/// frame. Unless the frame is corrupted, every description that the master accepts is correct. The outputs of other
/// boards are never enabled.
#[test]
fn every_frame_of_a_start_disturbed() {
    let options = RunOptions {
        boards: vec![RunBoard {
            board: 2,
            ci: vec![Setting { name: CI[0].into(), value: 1500 }],
            par: vec![Setting { name: PAR[1].into(), value: 5 }],
        }],
        active: true,
        force: false,
    };
    let mut bench = initialised(&IDS);
    let from = bench.log.len();
    bench.go(Request::Run(options.clone()), 30).unwrap();
    let to = bench.log.len();
    let mut failed = 0;
    for at in from..to {
        for fault in kinds(at) {
            let mut bench = initialised(&IDS);
            bench.fault = Some((at, fault));
            let result = bench.go(Request::Run(options.clone()), 60);
            let what = format!("frame {at} {fault:?} {:?}", bench.log[at]);
            check_numbers(&mut bench, &what);
            if let Some(description) = bench.master.description(2)
                && !matches!(fault, Fault::Corrupted(_))
            {
                assert_eq!(description.ci, CI, "{what}");
                assert_eq!(description.so, SO, "{what}");
                assert_eq!(description.par, PAR, "{what}");
            }
            match result {
                Ok(_) => assert!(bench.board(1).application.active, "{what}"),
                Err(_) => failed += 1,
            }
            for other in [0, 2] {
                assert!(!bench.board(other).application.active, "{what}");
            }
        }
    }
    println!("{failed} of {} disturbed starts ended in a named error", 6 * (to - from));
}

#[test]
fn findings_have_words() {
    let finding = InitFinding::NotReached { after: 2, ids: vec![0x63, 4] };
    assert!(finding.to_string().contains("0x63, 0x04 after position 2"));
}
