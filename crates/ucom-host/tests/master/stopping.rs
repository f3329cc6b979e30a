//! Tests of stops on a bus that loses frames and whose boards report errors. A stop also works for a board that has received a start
//! command but does not run yet.

use super::bench::Exit;
use ucom::node::Phase;
use ucom::{ErrorCode, Profile};
use ucom_host::master::{
    Error, ExchangeError, Master, MasterError, Outcome, Request, RunBoard, RunOptions, Setting, StopLevel,
};

use super::bench::{Bench, CI, MS, Script};
use super::chain::initialised;
use super::update::{options, update};

fn run(boards: &[u8]) -> Request {
    let board = |b: &u8| RunBoard { board: *b, ..Default::default() };
    Request::Run(RunOptions { boards: boards.iter().map(board).collect(), active: true, force: false })
}

/// Makes board 1 send error 7 (CAN_RECEIVE) repeatedly, as on a bad bus.
fn bad_bus(bench: &mut Bench) {
    let from = bench.now / MS;
    bench.join(Box::new((0..20_000).step_by(10).fold(Script::default(), |s, ms| s.at(from + ms, "081#07"))));
}

/// Section 9: errors 6 to 8 of a board are only logged. If such an error arrives and ADMIN_DATA is lost, the master
/// still repeats the stop.
#[test]
fn an_error_of_a_bad_bus_does_not_end_a_stop() {
    for lost in ["< 601#00000000", "< 601#01000000"] {
        let mut bench = initialised(&[0x21]);
        bench.go(run(&[1]), 30).unwrap();
        bad_bus(&mut bench);
        bench.lose = vec![(lost, 1)];
        let result = bench.go(Request::Stop { board: 1, level: StopLevel::Loop, force: true }, 30);
        assert!(result.is_ok(), "{lost}: {result:?}");
        assert!(!bench.board(0).application.running, "{lost}");
    }
    // After all attempts to stop the board have failed, the error of the board is reported.
    let mut bench = initialised(&[0x21]);
    bench.go(run(&[1]), 30).unwrap();
    bad_bus(&mut bench);
    bench.lose = vec![("< 601#", 1000)];
    let result = bench.go(Request::Stop { board: 1, level: StopLevel::Loop, force: true }, 30);
    assert!(
        matches!(result, Err(Error::Exchange(ExchangeError::Device { code: ErrorCode::CanReceive, .. }))),
        "{result:?}"
    );
    assert_eq!(bench.count("601#00000000"), 3);
}

/// Section 9, D-30: the master still waits for the start of a board if the board reports errors of the bus. Error 11 of a board ends the
/// start at once.
#[test]
fn an_error_of_a_bad_bus_does_not_end_a_start() {
    let mut bench = initialised(&[0x21]);
    bench.board(0).application.start_us = 500_000;
    bad_bus(&mut bench);
    let result = bench.go(Request::Start { board: 1, force: false }, 30);
    assert!(matches!(result, Ok(Outcome::Started(_))), "{result:?}");
    assert_eq!(bench.count("301#"), 1);

    let refuses = Script::default().on("201#", &["141#2100011BFFFFFFFF", "141#0000"]).on("301#", &["081#0B"]);
    let mut bench = Bench::script(refuses);
    let result = bench.go(Request::Start { board: 1, force: true }, 30);
    let code = ErrorCode::AutostartForbidden;
    assert_eq!(result, Err(Error::Exchange(ExchangeError::Device { board: 1, code, during: "PC_START" })));
    assert_eq!(bench.count("301#"), 1);
}

/// If a board is silent, the master repeats the stop at every level.
#[test]
fn a_silent_board_gets_the_stop_more_than_once() {
    for level in [StopLevel::Outputs, StopLevel::Loop, StopLevel::Application] {
        let mut bench = initialised(&[0x21]);
        bench.go(run(&[1]), 30).unwrap();
        // The first three stop frames `601#` and all answers with the status are lost.
        bench.lose = vec![("> 141#", 1000), ("< 601#", 3)];
        let result = bench.go(Request::Stop { board: 1, level, force: true }, 30);
        assert!(result.is_err(), "{level:?}");
        assert!(!bench.board(0).application.active, "{level:?}");
        assert!(level == StopLevel::Outputs || !bench.board(0).application.running, "{level:?}");
    }
}

/// The user presses Ctrl-C while a board starts and its status does not show the start yet. The master must not
/// report this board as stopped, and sends the stop command again after the start timeout.
#[test]
fn a_board_that_is_still_starting_is_stopped() {
    let info = |status: &str| [format!("141#210001{status}34126E38"), "141#0000".to_owned()];
    for request in [run(&[1]), Request::Start { board: 1, force: true }] {
        // The status of the board shows the start only after the third query. Therefore the board must receive
        // another stop command after the start timeout.
        let (idle, started) = (info("1B"), info("8B"));
        let idle: Vec<&str> = idle.iter().map(String::as_str).collect();
        let started: Vec<&str> = started.iter().map(String::as_str).collect();
        let was_run = matches!(request, Request::Run(_));
        // The first three queries return the idle status: before the start, at the stop, and when the master reads
        // the stop back.
        let script = Script::default().rule("201#", 0, 3, &idle).on("201#", &started);
        let mut bench = Bench::script(script.on("601#00000000", &["601#00000000"]));
        bench.run(2_000);
        let id = bench.master.start(bench.now, request).unwrap();
        bench.run(200);
        assert_eq!(bench.count("301#"), 1);
        let commanded = bench.times_of("301#")[0];
        bench.master.cancel(id);
        let result = bench.wait(id, 60);
        assert_eq!(result, Err(Error::Master(MasterError::Cancelled)));
        if !was_run {
            // A cancelled start request does not stop the board, so the caller must stop it. The stop fails here,
            // because the simulated board never leaves the started state.
            bench.go(Request::Stop { board: 1, level: StopLevel::Application, force: true }, 60).unwrap_err();
        }
        let stops = bench.times_of("1C1#8000");
        let timeout = u64::from(Profile::default().start_timeout) * MS;
        assert!(stops[0] < commanded + timeout, "commanded to stop at once: {stops:?}, {commanded}");
        assert!(
            stops.iter().any(|at| *at >= commanded + timeout),
            "and again once it is up: {stops:?}, {commanded}"
        );
    }
}

/// A board that starts slowly is idle again after Ctrl-C at any moment.
#[test]
fn slow_boards_are_idle_after_a_cancelled_run() {
    for at in (0..1_000).step_by(90) {
        let mut bench = initialised(&[0x21, 0x42]);
        bench.board(1).application.start_us = 1_000_000;
        let id = bench.master.start(bench.now, run(&[1, 2])).unwrap();
        bench.run(at);
        bench.master.cancel(id);
        let result = bench.wait(id, 60);
        bench.run(3_000);
        let phases = [0, 1].map(|i| bench.board(i).phase());
        assert_eq!(phases, [Phase::Idle; 2], "{at} ms: {result:?}");
    }
}

/// A stop of all boards begins with a broadcast, which the master sends three times. A stop of some boards is sent
/// only to these boards.
#[test]
fn a_stop_of_all_hangs_on_no_board_and_no_frame() {
    let mut bench = initialised(&[0x21, 0x42, 0x63]);
    bench.go(run(&[1, 2, 3]), 30).unwrap();
    bench.run(500);
    bench.lose = vec![("< 600#", 2)];
    let now = bench.now;
    bench.master.stop_at_once(now, None);
    bench.run(100);
    let times = bench.times_of("600#00000000");
    assert!(times.len() == 3 && times[0] - now < 2 * MS, "{times:?} at {now}");
    assert!((0..3).all(|i| !bench.board(i).application.running));

    let mut bench = initialised(&[0x21, 0x42, 0x63]);
    bench.go(run(&[1, 2, 3]), 30).unwrap();
    let now = bench.now;
    bench.master.stop_at_once(now, Some(&[1, 3]));
    bench.run(100);
    assert_eq!([0, 1, 2].map(|i| bench.board(i).application.running), [false, true, false]);
    assert_eq!(["601#00000000", "603#00000000", "600#00000000"].map(|f| bench.count(f)), [3, 3, 0]);
    // The boards are stopped in the reverse order of the given list.
    assert!(bench.times_of("603#00000000")[0] < bench.times_of("601#00000000")[0]);
}

/// U-2: a running board prevents an update even if one of its answers and its sensor outputs are lost. The master
/// sends two queries to determine if a board runs.
#[test]
fn u2_a_board_whose_answer_is_lost_still_forbids_an_update() {
    let mut bench = initialised(&[0x21, 0x42]);
    bench.go(run(&[2]), 30).unwrap();
    bench.lose = vec![("> 382#", 100_000), ("> 142#4200", 1)];
    let report = update(&mut bench, options(&[1], 128));
    assert_eq!(report.exit(), 4, "{report:?}");
    assert_eq!(bench.count("041#"), 0);
}

/// A running board keeps the inputs that another PC set, unless the user sets new inputs.
#[test]
fn a_board_that_runs_is_not_given_initial_inputs() {
    for given in [false, true] {
        let mut bench = initialised(&[0x21]);
        bench.go(run(&[1]), 30).unwrap();
        let now = bench.now;
        bench.master.set_input(now, 1, CI[0], 1234).unwrap();
        bench.run(100);
        assert_eq!(bench.board(0).application.ci, [1234, 9]);
        // Another PC becomes the master.
        bench.master = Master::new(Profile::default());
        let ci = given.then(|| Setting { name: CI[1].into(), value: 5 });
        let board = RunBoard { board: 1, ci: ci.into_iter().collect(), par: Vec::new() };
        let options = RunOptions { boards: vec![board], active: true, force: true };
        bench.go(Request::Run(options), 30).unwrap();
        bench.run(500);
        let expected = if given { [7, 5] } else { [1234, 9] };
        assert_eq!(bench.board(0).application.ci, expected, "given {given}");
        assert!(bench.board(0).application.active);
    }
}
