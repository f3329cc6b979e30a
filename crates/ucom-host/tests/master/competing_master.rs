//! Tests of heartbeats that a competing master sends to single boards (D-08), and of resets of single boards.

use super::bench::Exit;
use ucom::Profile;
use ucom::node::Phase;
use ucom::{Function, Status};
use ucom_host::master::{
    Diagnose, Error, Event, ExchangeError, InitOptions, Life, MasterError, Outcome, Request, StatusError,
};

use super::bench::{Bench, MS, Script, frame};
use super::chain::initialised;

fn has_competing_master(bench: &Bench) -> bool {
    bench.events.iter().any(|(_, e)| matches!(e, Event::CompetingMaster { .. }))
}

/// D-08: a heartbeat with a board's number arrives before the first command that changes boards. If the board is not
/// started, the heartbeat comes from another PC, and the master refuses the command. If the board is started or does
/// not answer, the master does not refuse the command.
#[test]
fn d08_whose_heartbeat_is_it() {
    for (status, refused) in [(Some("8B"), false), (Some("AB"), false), (Some("1B"), true), (None, false)] {
        let mut script = Script::default().at(100, "681#").at(600, "681#").on("301#", &["501#"]);
        if let Some(status) = status {
            script = script.on("201#", &[&format!("141#210001{status}34126E38"), "141#0000"]);
        }
        let mut bench = Bench::script(script);
        let result = bench.go(Request::Start { board: 1, force: false }, 30);
        let is_refused = matches!(
            result,
            Err(Error::Master(MasterError::CompetingMaster { function: Function::Alive, to: 1, .. }))
        );
        assert_eq!(is_refused, refused, "status {status:?}: {result:?}");
        let commands = bench.sent().iter().filter(|t| *t != "201#" && *t != "680#").count();
        assert!(!refused || commands == 0, "{:?}", bench.sent());
    }
}

/// D-08, D-51: this PC is the master, and another PC sends a heartbeat with the number of a board that is not
/// started. The master reports the other PC and does not expect further heartbeats of this board. Heartbeats of a
/// board that this PC has started are not reported.
#[test]
fn d08_d51_heartbeats_of_another_pc() {
    let mut bench = initialised(&[0x21, 0x42]);
    bench.go(Request::Start { board: 2, force: false }, 10).unwrap();
    bench.run(5_000);
    assert!(!has_competing_master(&bench), "{:?}", bench.events);
    let now = bench.now;
    bench.master.handle(now, Ok(frame("681#")));
    bench.run(10_000);
    let reported = Event::CompetingMaster { function: Function::Alive, to: 1 };
    assert!(bench.events.iter().any(|(_, e)| *e == reported), "{:?}", bench.events);
    assert_eq!(bench.master.boards().get(1).unwrap().life, Life::Unarmed);
    assert_eq!(bench.master.boards().get(2).unwrap().life, Life::Alive);
    assert!(!bench.events.iter().any(|(_, e)| matches!(e, Event::Supervision { .. })), "{:?}", bench.events);
}

/// D-25: the heartbeats of a board are not mistaken for the heartbeats of another PC. The test uses a board that
/// starts its application by itself, and a board that is stopped and started again.
#[test]
fn d08_d25_no_board_is_mistaken_for_a_pc() {
    let mut bench = initialised(&[0x21, 0x42]);
    let set = |mask, value| Request::SetStatus { board: 1, mask, value, force: false };
    bench.go(set(Status::ASTART, Status::ASTART), 10).unwrap();
    bench.go(Request::Init(InitOptions::default()), 20).unwrap();
    bench.run(5_000);
    assert_eq!(bench.board(0).phase(), Phase::Ready);
    for round in 0..20 {
        bench.go(set(Status::MSTART, Status(0)), 10).unwrap();
        bench.run(137 * round);
        bench.go(set(Status::MSTART, Status::MSTART), 10).unwrap();
        bench.run(1_000 + 100 * round);
    }
    assert!(!has_competing_master(&bench), "{:?}", bench.events);
    assert_eq!(bench.master.boards().get(1).unwrap().life, Life::Alive);
}

fn reset(board: u8) -> Request {
    Request::Reset { board: Some(board), force: false }
}

/// The test resets a single board. The board must answer before the reset, and must not have a number after the reset. The master does not
/// send a reset to a board that does not answer.
#[test]
fn a_single_reset_is_checked() {
    let mut bench = initialised(&[0x21, 0x42, 0x63]);
    let error = bench.go(reset(4), 10).unwrap_err();
    assert!(
        matches!(error, Error::Exchange(ExchangeError::NoAnswer { board: 4, asked: Function::Info, .. })),
        "{error:?}"
    );
    assert_eq!((error.exit(), bench.count("004#")), (3, 0));
    assert!(error.hint().contains("ucom scan"), "{}", error.hint());

    // The test loses each frame of a reset in turn. Either the reset is done, or an error reports that the board
    // still has its number.
    let mut whole = initialised(&[0x21, 0x42, 0x63]);
    let from = whole.log.len();
    whole.go(reset(2), 10).unwrap();
    for lost in from..whole.log.len() {
        let mut bench = initialised(&[0x21, 0x42, 0x63]);
        bench.fault = Some((lost, super::bench::Fault::Lost));
        let what = format!("{:?}", whole.log[lost]);
        match bench.go(reset(2), 20) {
            Ok(Outcome::Reset(reports)) => {
                assert!(reports.ids.iter().eq(&[0x42]), "{what}: {reports:?}");
                assert_eq!(bench.board(1).phase(), Phase::Uninitialised, "{what}");
            }
            Err(Error::Status(StatusError::NotReached { board: 2, .. })) => {
                assert_eq!(bench.board(1).phase(), Phase::Idle, "{what}");
            }
            other => panic!("{what}: {other:?}"),
        }
        assert_eq!((bench.board(0).phase(), bench.board(2).phase()), (Phase::Idle, Phase::Idle), "{what}");
    }
    // The board has executed the reset, but its reports do not arrive. The master returns an error for the missing
    // answer.
    let mut bench = initialised(&[0x21, 0x42, 0x63]);
    bench.lose = vec![("> 482#", 100)];
    let error = bench.go(reset(2), 20).unwrap_err();
    assert!(
        matches!(error, Error::Exchange(ExchangeError::NoAnswer { board: 2, asked: Function::Reset, .. })),
        "{error:?}"
    );
}

/// D-50: the driver delivers frames to the master late. The master does not report a silent board while a frame is
/// not delivered yet, and it still sends heartbeats.
#[test]
fn d50_a_driver_that_is_behind() {
    let mut master = ucom_host::master::Master::new(Profile::default());
    master.begin_session(0);
    let id = master.start(0, Request::Info { board: 1 }).unwrap();
    let (mut alive, mut asked) = (0, 0);
    for ms in 0..3_000 {
        while let Some(sent) = master.poll_behind(ms * MS, 0) {
            alive += u32::from(sent == frame("680#"));
            asked += u32::from(sent == frame("201#"));
        }
    }
    assert_eq!((alive, asked), (6, 1), "the question is not repeated");
    master.handle(3_000 * MS, Ok(frame("141#2100011B34126E38")));
    master.handle(3_000 * MS, Ok(frame("141#0000")));
    // The answer is complete now, so the master does not repeat the query.
    for ms in 3_000..3_200 {
        while let Some(sent) = master.poll(ms * MS) {
            assert_ne!(sent, frame("201#"), "the question is not repeated");
        }
    }
    let done = core::iter::from_fn(|| master.take_event())
        .find(|e| matches!(e, Event::Done { id: which, result: Ok(_) } if *which == id));
    assert!(done.is_some());
}
