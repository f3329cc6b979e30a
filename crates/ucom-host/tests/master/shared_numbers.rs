//! Tests with two boards that have the same number (D-24). A stop reaches both boards, and so does a request that
//! switches outputs off. Every other request to a shared number fails with a specific error before any board is
//! changed.

use super::bench::Exit;
use ucom::{Profile, Status};
use ucom_host::master::conformance::ConformanceOptions;
use ucom_host::master::probe::ProbeOptions;
use ucom_host::master::update::{UpdateFailure, UpdateImage, UpdateOptions, UpdateOutcome, UpdateTarget};
use ucom_host::master::{
    AdminChange, Diagnose, Error, Event, IdentityError, InitOptions, Outcome, Request, RunBoard, RunOptions,
    ScanFinding, StopLevel,
};
use ucom_sim::memory::WirePins;

use super::bench::{Bench, From, Member, Script, image, node};

/// Returns a bus with two boards that are both wired like the first board of the chain.
fn strapped(flash: [u16; 2]) -> Bench {
    let board =
        |flash| Box::new(node(flash, WirePins::chain(1).remove(0), Profile::default())) as Box<dyn Member>;
    Bench::new(Profile::default(), flash.map(board).into_iter().collect())
}

/// Returns a bus with two boards that have the number 1. Another PC assigned this number before it disconnected. `more` contains further
/// frames of the other PC by time in milliseconds.
fn sharing(flash: [u16; 2], more: &[(u64, &str)]) -> Bench {
    let mut bench = strapped(flash);
    let script =
        more.iter().fold(Script::default().at(100, "281#"), |script, (at, text)| script.at(*at, text));
    bench.join(Box::new(script));
    bench.run(3_000);
    for i in 0..2 {
        assert_eq!(bench.board(i).number().map(|n| n.number()), Some(1));
    }
    bench
}

fn is_shared(error: &Error, flash: [u16; 2]) -> bool {
    let shared =
        Error::Identity(IdentityError::NumberShared { board: 1, found: flash.to_vec(), given_back: false });
    *error == shared && error.exit() == 4 && error.code() == "number-shared"
}

/// Returns requests for board 1, and requests that change all boards.
fn requests() -> Vec<Request> {
    let (board, force) = (1, false);
    let target = UpdateTarget { board, flash_number: Some(0x21) };
    let image = UpdateImage { bytes: image(200).into(), address_words: 0 };
    vec![
        Request::Info { board },
        Request::SetStatus { board, mask: Status::ASTART, value: Status::ASTART, force },
        Request::SetStatus { board, mask: Status::INIT, value: Status(0), force },
        Request::RawStatus { board: Some(1), seen: vec![1], mask: 0x40, value: 0x40, force },
        Request::Reset { board: Some(1), force },
        Request::Reset { board: None, force },
        Request::XReset { board, force },
        Request::Start { board, force },
        Request::Admin { board, change: AdminChange { active: Some(true), ..Default::default() }, force },
        Request::Describe { board, fresh: false },
        Request::InitialInputs { board },
        Request::Run(RunOptions {
            boards: vec![RunBoard { board, ..Default::default() }],
            active: true,
            force,
        }),
        Request::Repair { board, flash_number: 0x21, force },
        Request::Probe(ProbeOptions { alive: true, ..Default::default() }),
        Request::Conformance(ConformanceOptions { run: true, ..Default::default() }),
        Request::Update(UpdateOptions::new(vec![target], image.clone(), 0x3AC1)),
        Request::Update(UpdateOptions { force: true, ..UpdateOptions::new(vec![target], image, 0x3AC1) }),
    ]
}

/// Returns `true` if the frame is a query or a heartbeat.
fn changes_nothing(frame: &str) -> bool {
    let id = u16::from_str_radix(&frame[..3], 16).unwrap();
    matches!(id >> 6, 8 | 9 | 22 | 23) || frame == "680#"
}

fn refuses(flash: [u16; 2]) {
    for started in [false, true] {
        let more: &[(u64, &str)] = if started { &[(400, "301#")] } else { &[] };
        for request in requests() {
            let mut bench = sharing(flash, more);
            let what = format!("{request:?}, started: {started}");
            let from = bench.log.len();
            match bench.go(request, 60) {
                Err(error) => assert!(is_shared(&error, flash), "{what}: {error:?}"),
                Ok(Outcome::Update(report)) => {
                    assert_eq!(report.exit(), 4, "{what}");
                    let failure = report.boards[0].failure.clone().unwrap();
                    let UpdateFailure::Refused(error) = failure else { panic!("{what}: {failure:?}") };
                    assert!(is_shared(&error, flash), "{what}: {error:?}");
                }
                other => panic!("{what}: {other:?}"),
            }
            let of_master = bench.log[from..].iter().filter(|(_, by, _)| *by == From::Master);
            let sent: Vec<String> = of_master.map(|(.., f)| f.to_string()).collect();
            assert!(sent.iter().all(|f| changes_nothing(f)), "{what}: {sent:?}");
            let reported = |(_, e): &&(u64, Event)| matches!(e, Event::NumberShared { board: 1, .. });
            assert_eq!(bench.events.iter().filter(reported).count(), 1, "{what}");
            assert_eq!(bench.master.shared_numbers().len(), 1, "{what}");
        }
    }
}

#[test]
fn d24_nothing_is_done_to_two_boards_with_one_number() {
    refuses([0x21, 0x42]);
}

#[test]
fn d24_nothing_is_done_to_two_boards_that_cannot_be_told_apart() {
    refuses([0x21, 0x21]);
}

/// The answer of the second board arrives late, after the answer of the first board has ended. The request still
/// fails because of the shared number.
#[test]
fn d24_the_second_answer_may_come_late() {
    let answers = |ms: u64| {
        let head = |at: u64, flash: &str| {
            [format!("{at}:141#{flash}00011B34126E38"), format!("{at}:141#0100"), format!("{at}:141#78")]
        };
        [head(1, "21"), head(ms, "42")].concat()
    };
    for ms in [2, 30, 90] {
        let answers = answers(ms);
        let answers: Vec<&str> = answers.iter().map(String::as_str).collect();
        for request in [Request::Info { board: 1 }, Request::Start { board: 1, force: false }] {
            let mut bench = Bench::script(Script::default().on("201#", &answers));
            let error = bench.go(request.clone(), 20).unwrap_err();
            assert!(is_shared(&error, [0x21, 0x42]), "{request:?} after {ms} ms: {error:?}");
            assert_eq!(bench.count("301#"), 0, "{request:?} after {ms} ms");
        }
    }
}

/// The second board does not answer the first PC_INFO, but answers when the PC reads the board back after the start.
/// The error still reports the shared number, and the started application is stopped.
#[test]
fn d24_it_is_named_when_it_shows_on_the_way() {
    let one = |flash: &str, status: &str| {
        [format!("141#{flash}0001{status}34126E38"), "141#0100".to_owned(), "141#78".to_owned()]
    };
    let both = [one("21", "8B"), one("42", "8B")].concat();
    let both: Vec<&str> = both.iter().map(String::as_str).collect();
    let before = one("21", "1B");
    let before: Vec<&str> = before.iter().map(String::as_str).collect();
    let script = || Script::default().once("201#", &before).on("201#", &both).on("301#", &["501#"]);
    let mut bench = Bench::script(script());
    let error = bench.go(Request::Start { board: 1, force: false }, 20).unwrap_err();
    assert!(is_shared(&error, [0x21, 0x42]), "{error:?}");
    let mut bench = Bench::script(script());
    let boards = vec![RunBoard { board: 1, ..Default::default() }];
    let run = Request::Run(RunOptions { boards, active: true, force: false });
    let error = bench.go(run, 60).unwrap_err();
    assert!(is_shared(&error, [0x21, 0x42]), "{error:?}");
    assert_eq!((bench.count("541#"), bench.count("1C1#8000") > 0), (0, true), "{:?}", bench.sent());
}

/// A second board takes the same number at any step while the first board is programmed. The second board either
/// sends an error about program data, or is written together with the first board. In both cases, the update fails
/// because of the shared number, and no board stays in programming mode.
#[test]
fn d24_it_is_named_when_it_shows_in_an_update() {
    let strap = |flash| node(flash, WirePins::chain(1).remove(0), Profile::default());
    let target = UpdateTarget { board: 1, flash_number: Some(0x21) };
    let image = UpdateImage { bytes: image(500).into(), address_words: 0 };
    let options = || UpdateOptions::new(vec![target], image.clone(), 0x3AC1);
    let frames = {
        let mut bench = super::chain::initialised(&[0x21]);
        assert!(matches!(bench.go(Request::Update(options()), 60), Ok(Outcome::Update(r)) if r.exit() == 0));
        program_frames(&bench)
    };
    for flash in [0x42, 0x21] {
        for programming in [false, true] {
            for after in (1..frames).step_by(23).chain([frames - 1, frames]) {
                let what =
                    format!("flash number {flash:#x}, programming {programming}, after {after} frames");
                let mut bench = super::chain::initialised(&[0x21]);
                let id = bench.master.start(bench.now, Request::Update(options())).unwrap();
                bench.until(|b| program_frames(b) >= after);
                let now = bench.now / 1000;
                let other = Script::default().at(now, "281#");
                let other = if programming { other.at(now + 1, "1C1#0404") } else { other };
                bench.join(Box::new(strap(flash)));
                bench.join(Box::new(other));
                let Ok(Outcome::Update(report)) = bench.wait(id, 60) else { panic!("{what}: no report") };
                let failure = report.boards[0].failure.clone();
                let code = failure.as_ref().map(UpdateFailure::code);
                assert_eq!(code, Some("number-shared"), "{what}: {failure:?}");
                let erased = report.boards[0].outcome != UpdateOutcome::NotStarted;
                assert_eq!(report.exit(), if erased { 5 } else { 4 }, "{what}: {failure:?}");
                assert_eq!(bench.master.shared_numbers().len(), 1, "{what}");
                for i in 0..2 {
                    assert!(!bench.board(i).status().has(Status::PROG), "{what}: board {i}");
                }
            }
        }
    }
}

fn program_frames(bench: &Bench) -> usize {
    bench.log.iter().filter(|(.., f)| f.to_string().starts_with("2C1#")).count()
}

/// A number that two boards share does not delay a stop, and the master does not refuse the stop. Both boards stop, and the master reports
/// the shared number.
#[test]
fn d24_a_stop_stops_both() {
    let mut bench =
        sharing([0x21, 0x42], &[(400, "301#"), (2_000, "541#"), (2_100, "680#"), (2_600, "680#")]);
    assert!((0..2).all(|i| bench.board(i).application.running));
    let from = bench.now;
    bench.master.stop_at_once(from, Some(&[1]));
    let stop = Request::Stop { board: 1, level: StopLevel::Application, force: true };
    let id = bench.master.start(from, stop).unwrap();
    bench.run(1);
    assert!((0..2).all(|i| !bench.board(i).application.running), "at once");
    assert!(matches!(bench.wait(id, 20), Ok(Outcome::Status { board: 1, .. })));
    assert!((0..2).all(|i| !bench.board(i).status().has(Status::MSTART)));
    let reported = |(_, e): &(u64, Event)| matches!(e, Event::NumberShared { board: 1, found } if *found == [0x21, 0x42]);
    assert!(bench.events.iter().any(reported));
}

/// A request that switches outputs off is handled like a stop.
#[test]
fn d24_outputs_are_turned_off_on_both() {
    let mut bench =
        sharing([0x21, 0x42], &[(400, "301#"), (2_000, "541#"), (2_100, "680#"), (2_600, "680#")]);
    let off = AdminChange { active: Some(false), run: Some(false), ..Default::default() };
    assert!(bench.go(Request::Admin { board: 1, change: off, force: true }, 20).is_ok());
    assert!((0..2).all(|i| !bench.board(i).application.running));
}

/// An init that assigns the same number to two boards removes the number from both boards and reports the shared number.
#[test]
fn d24_an_init_leaves_no_number_to_two_boards() {
    let mut bench = strapped([0x21, 0x42]);
    let error = bench.go(Request::Init(InitOptions::default()), 60).unwrap_err();
    let wanted =
        Error::Identity(IdentityError::NumberShared { board: 1, found: vec![0x21, 0x42], given_back: true });
    assert_eq!(error, wanted);
    assert!((0..2).all(|i| bench.board(i).number().is_none()));
    // Board 2 is replaced by a board that is wired like the first board, and another PC sends PC_INIT(1). The master
    // detects that two boards have number 1.
    let mut bench = Bench::chain(&[0x21, 0x42]);
    bench.go(Request::Init(InitOptions::default()), 60).unwrap();
    bench.members[1] = Box::new(node(0x42, WirePins::chain(1).remove(0), Profile::default()));
    bench.join(Box::new(Script::default().at(bench.now / 1000 + 300, "281#")));
    bench.run(2_000);
    assert!(bench.go(Request::Info { board: 1 }, 10).is_err_and(|e| is_shared(&e, [0x21, 0x42])));
}

/// A scan of two boards with the same number has one finding, which lists both boards. The scan does not report a
/// board without a number.
#[test]
fn d24_a_scan_names_both() {
    let mut bench = sharing([0x21, 0x42], &[]);
    let Ok(Outcome::Scan(report)) = bench.go(Request::Scan, 20) else { panic!("no scan") };
    let shared = ScanFinding::NumberShared { board: 1, first: 0x21, second: 0x42 };
    assert_eq!(report.findings, [shared]);
    assert_eq!(shared.error(), bench.master.shared_numbers().pop());
    assert!(shared.to_string().contains("flash numbers 0x0021 and 0x0042"), "{shared}");
}

/// A frame that a gateway doubles or corrupts is not mistaken for a second board.
#[test]
fn d24_a_doubled_frame_is_no_board() {
    let whole = {
        let mut bench = super::chain::initialised(&[0x21]);
        let from = bench.log.len();
        bench.go(Request::Info { board: 1 }, 10).unwrap();
        from..bench.log.len()
    };
    for at in whole {
        for fault in [super::bench::Fault::Doubled, super::bench::Fault::Corrupted(3)] {
            let mut bench = super::chain::initialised(&[0x21]);
            bench.fault = Some((at, fault));
            let result = bench.go(Request::Info { board: 1 }, 10);
            assert!(
                !matches!(result, Err(Error::Identity(IdentityError::NumberShared { .. }))),
                "{at} {fault:?}: {result:?}"
            );
        }
    }
}
