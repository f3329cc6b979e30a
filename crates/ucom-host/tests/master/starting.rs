//! Tests of runs that fail to start: the master returns every board to its previous state.

use super::bench::Exit;
use ucom::node::Phase;
use ucom::profile::OnLost;
use ucom::{Admin, Profile};
use ucom_host::master::{
    AdminChange, Error, Event, ExchangeError, InitOptions, MasterError, Outcome, Request, RunBoard,
    RunOptions, RunningError, Setting, SignalError, Supervision,
};

use super::bench::{Bench, MS};
use super::chain::initialised;

const IDS: [u16; 4] = [0x21, 0x42, 0x63, 0x04];
/// Phase of each board of [`found`] before the run, and `true` if its outputs are active, in the order of the boards.
const FOUND: [(Phase, bool); 4] =
    [(Phase::Idle, false), (Phase::Ready, false), (Phase::Running, false), (Phase::Running, true)];

fn run(boards: &[u8], active: bool, force: bool) -> Request {
    let board = |b: &u8| RunBoard { board: *b, ..Default::default() };
    Request::Run(RunOptions { boards: boards.iter().map(board).collect(), active, force })
}

/// Returns a bus with four boards: idle, started, running with safe outputs, running with active outputs.
fn found(profile: Profile) -> Bench {
    let mut bench = Bench::chain_with(&IDS, profile);
    bench.go(Request::Init(InitOptions::default()), 20).unwrap();
    bench.go(Request::Start { board: 2, force: false }, 10).unwrap();
    bench.go(run(&[3], false, true), 20).unwrap();
    bench.go(run(&[4], true, true), 20).unwrap();
    assert_eq!(now_is(&mut bench), FOUND);
    bench
}

fn now_is(bench: &mut Bench) -> [(Phase, bool); 4] {
    [0, 1, 2, 3].map(|i| (bench.board(i).phase(), bench.board(i).application.active))
}

/// P-19: the master refuses a start that would cause too much bus load. Boards that were idle before the request are idle afterwards. If
/// the master knows the descriptions, it refuses the request before it starts a board.
#[test]
fn p19_a_refusal_leaves_every_board_as_it_was() {
    let mut bench = found(Profile { load_limit: 1, ..Profile::default() });
    let error = bench.go(run(&[1, 2, 3, 4], true, false), 60).unwrap_err();
    assert!(matches!(error, Error::Running(RunningError::Load(_))) && error.exit() == 4, "{error}");
    assert_eq!(now_is(&mut bench), FOUND);
    // All boards have the same program, and the master already knows its description. Therefore the master can refuse
    // the run before it starts a board.
    assert_eq!(bench.count("301#"), 0, "nothing was started");

    let mut bench = initialised(&IDS);
    let name = Setting { name: "no such input".into(), value: 1 };
    let mut boards: Vec<RunBoard> = (1..=4).map(|board| RunBoard { board, ..Default::default() }).collect();
    boards[3].ci = vec![name];
    let options = RunOptions { boards, active: true, force: false };
    for known in [false, true] {
        let before = bench.count("301#");
        let error = bench.go(Request::Run(options.clone()), 60).unwrap_err();
        assert!(matches!(error, Error::Signal(SignalError::NoSignal { board: 4, .. })), "{error}");
        assert_eq!(now_is(&mut bench), [(Phase::Idle, false); 4]);
        // All boards have the same names. If the master does not know the names, it starts only board 1 to read them.
        assert_eq!(bench.count("301#") - before, usize::from(!known));
    }
}

/// The test repeats the run for every board and every step; each time, the answers of the board in this step are
/// lost. After the failed run, the other boards are in their previous state.
#[test]
fn a_run_that_fails_is_undone() {
    let steps = [("> 14", "PC_INFO"), ("> 60", "flags"), ("> 6C", "initial inputs")];
    for (start, what) in steps {
        for silent in 1..=4_usize {
            let mut bench = found(Profile::default());
            let start: &'static str = Box::leak(format!("{start}{silent}#").into_boxed_str());
            bench.lose = vec![(start, 100_000)];
            let result = bench.go(run(&[1, 2, 3, 4], true, false), 120);
            assert!(result.is_err(), "{what} of board {silent} lost: {result:?}");
            let (after, silent) = (now_is(&mut bench), silent - 1);
            for board in (0..4).filter(|board| *board != silent) {
                assert_eq!(after[board], FOUND[board], "board {} {what} of {} lost", board + 1, silent + 1);
            }
            // The master cannot read the state of the silent board. If the outputs of this board were safe before the
            // run, they are safe afterwards.
            assert!(!after[silent].1 || FOUND[silent].1, "{what}: {after:?}");
        }
    }
}

/// The user presses Ctrl-C at any moment during the start of a run. Afterwards, either all boards run, or all boards
/// are in their previous state.
#[test]
fn a_run_that_is_cancelled_is_undone() {
    let mut bench = found(Profile::default());
    let begin = bench.now;
    bench.go(run(&[1, 2, 3, 4], true, false), 60).unwrap();
    let whole = (bench.now - begin) / MS;
    for at in 0..=whole {
        let mut bench = found(Profile::default());
        let now = bench.now;
        let id = bench.master.start(now, run(&[1, 2, 3, 4], true, false)).unwrap();
        bench.run(at);
        bench.master.cancel(id);
        match bench.wait(id, 60) {
            Err(Error::Master(MasterError::Cancelled)) => {
                assert_eq!(now_is(&mut bench), FOUND, "cancelled after {at} ms")
            }
            Ok(_) => {
                assert!(now_is(&mut bench).iter().all(|(phase, active)| *phase == Phase::Running && *active))
            }
            Err(error) => panic!("cancelled after {at} ms: {error}"),
        }
    }
}

/// D-51: a board is lost while other boards are still being started. With `StopAll`, the master starts no further control loop; with
/// `Report`, the start continues. In both cases, boards that were idle before the run are idle again.
#[test]
fn d51_a_board_lost_while_others_start() {
    for on_lost in [OnLost::StopAll, OnLost::Report] {
        let mut bench = Bench::chain_with(&IDS, Profile { on_lost, ..Profile::default() });
        bench.go(Request::Init(InitOptions::default()), 20).unwrap();
        bench.go(run(&[1], true, false), 20).unwrap();
        for i in 1..4 {
            bench.board(i).application.start_us = 1_500_000;
        }
        let now = bench.now;
        let id = bench.master.start(now, run(&[2, 3, 4, 1], true, false)).unwrap();
        bench.run(500);
        bench.cut = vec![0];
        let result = bench.wait(id, 60);
        let lost = Event::Supervision { board: 1, change: Supervision::Lost };
        assert!(bench.events.iter().any(|(_, e)| *e == lost), "{on_lost:?}: {result:?}");
        let started = ["542#", "543#", "544#"].map(|text| bench.count(text));
        match on_lost {
            OnLost::StopAll => {
                assert_eq!(result, Err(Error::Running(RunningError::Lost { board: 1 })));
                assert_eq!(started, [0; 3]);
            }
            // The run ends with an error about board 1, which does not answer.
            _ => {
                assert!(
                    matches!(result, Err(Error::Exchange(ExchangeError::NoAnswer { board: 1, .. }))),
                    "{result:?}"
                );
                assert_eq!(started, [1; 3]);
            }
        }
        for i in 1..4 {
            assert_eq!(bench.board(i).phase(), Phase::Idle, "{on_lost:?} board {}", i + 1);
        }
    }
}

/// After a failed run, no procedure of the run is still active, so the boards accept new requests.
#[test]
fn after_a_failed_run_boards_are_free() {
    let mut bench = initialised(&IDS);
    bench.lose = vec![("> 6C4#", 100)];
    bench.go(run(&[2, 4], true, false), 60).unwrap_err();
    bench.go(Request::Start { board: 2, force: false }, 10).unwrap();
    let change = AdminChange { debug: Some(true), ..Default::default() };
    let result = bench.go(Request::Admin { board: 2, change, force: false }, 10);
    let admin = Admin { debug: true, ..Admin::default() };
    assert_eq!(result, Ok(Outcome::Admin { board: 2, admin }));
}
