//! Tests of descriptions, inputs, parameters, flags, and supervision of running boards.

use super::bench::Exit;
use ucom::profile::OnLost;
use ucom::{Admin, Profile};
use ucom_host::master::io::{IoDescription, ParValue};
use ucom_host::master::{
    AdminChange, Diagnose, Error, Event, ExchangeError, IdentityError, InitOptions, Life, MasterError,
    Outcome, Request, RunBoard, RunOptions, RunningError, Setting, SignalError, StopLevel, Supervision,
};

use super::bench::{Bench, CI, MS, PAR, SO, Script};
use super::chain::initialised;

fn run_options(boards: &[u8]) -> RunOptions {
    let board = |b: &u8| RunBoard { board: *b, ..Default::default() };
    RunOptions { boards: boards.iter().map(board).collect(), active: true, force: false }
}

fn running(flash_ids: &[u16], boards: &[u8]) -> Bench {
    let mut bench = initialised(flash_ids);
    bench.go(Request::Run(run_options(boards)), 30).unwrap();
    bench
}

/// Vector 13.2: the master starts only board 1. The test compares each frame with the vector.
#[test]
fn start_order() {
    let mut bench = initialised(&[0x21]);
    let before = bench.log.len();
    let options = RunOptions {
        boards: vec![RunBoard {
            board: 1,
            ci: vec![Setting { name: CI[0].into(), value: 1500 }],
            par: vec![Setting { name: PAR[0].into(), value: 120 }],
        }],
        active: true,
        force: false,
    };
    let Ok(Outcome::Running(report)) = bench.go(Request::Run(options), 20) else { panic!() };
    assert_eq!(report.boards, [(1, Admin { run: true, active: true, ..Admin::default() })]);
    let repeated = ["201#", "680#", "341#0000DC0509000000"];
    let sent: Vec<String> = bench.log[before..]
        .iter()
        .filter(|(_, from, _)| *from == super::bench::From::Master)
        .map(|(.., f)| f.to_string())
        .filter(|t| !repeated.contains(&t.as_str()))
        .collect();
    assert_eq!(sent.join(" "), "301# 581# 5C1# 3C1#00007800 541# 601#01000000 601#01010000");
    // The master sends inputs before the control loop starts, and every 20 ms after that.
    let inputs = bench.times_of("341#0000DC0509000000");
    assert!(inputs[0] < bench.times_of("541#")[0]);
    bench.run(1000);
    let repeated = bench.times_of("341#0000DC0509000000").len() - inputs.len();
    assert!((48..=52).contains(&repeated), "{repeated}");
    let board = bench.board(0);
    assert_eq!((board.application.latched_ci.as_slice(), board.application.par[0]), (&[1500, 9][..], 120));
}

/// D-34: the master sends a changed input at once. D-35: the master stores a written parameter as an assumed value.
/// After a restart of the application, the value is unknown.
#[test]
fn d34_d35_inputs_and_parameters() {
    let mut bench = running(&[0x21], &[1]);
    assert_eq!(bench.master.parameters(1), [ParValue::Unknown; 3]);
    let now = bench.now;
    bench.master.set_input(now, 1, "current limit", 77).unwrap();
    bench.master.set_parameter(now, 1, "I", 5).unwrap();
    bench.run(2);
    assert_eq!(bench.board(0).application.ci, [7, 77]);
    assert_eq!(bench.board(0).application.par, [0, 5, 0]);
    assert_eq!(bench.master.parameters(1), [ParValue::Unknown, ParValue::Assumed(5), ParValue::Unknown]);
    assert!(matches!(bench.master.set_input(now, 1, "nonsense", 1), Err(SignalError::NoSignal { .. })));
    let stop = Request::Stop { board: 1, level: StopLevel::Application, force: false };
    bench.go(stop, 10).unwrap();
    bench.go(Request::Start { board: 1, force: false }, 10).unwrap();
    assert_eq!(bench.master.parameters(1), [ParValue::Unknown; 3]);
}

/// D-36: the description of each board is read once after its application has started. P-14: heartbeats continue while the master reads the
/// descriptions.
#[test]
fn d36_p14_descriptions_are_cached() {
    let mut bench = initialised(&[0x21, 0x42]);
    for board in [1, 2] {
        bench.go(Request::Start { board, force: false }, 10).unwrap();
        let Ok(Outcome::Description { description, .. }) =
            bench.go(Request::Describe { board, fresh: false }, 10)
        else {
            panic!()
        };
        assert_eq!(
            (description.description.as_str(), description.so.as_slice()),
            ("head pan control", &SO.map(String::from)[..])
        );
    }
    bench.go(Request::Describe { board: 2, fresh: false }, 10).unwrap();
    bench.go(Request::InitialInputs { board: 2 }, 10).unwrap();
    assert_eq!((bench.count("581#"), bench.count("582#")), (1, 1));
    bench.go(Request::Describe { board: 2, fresh: true }, 10).unwrap();
    assert_eq!(bench.count("582#"), 2);
    let alive = bench.times_of("680#");
    assert!(alive.windows(2).all(|w| (450 * MS..=550 * MS).contains(&(w[1] - w[0]))));
    // If a board has no running application, the master refuses the request, and the error suggests the command that helps.
    let mut bench = initialised(&[0x21]);
    let error = bench.go(Request::Describe { board: 1, fresh: false }, 10).unwrap_err();
    assert_eq!(error, Error::Signal(SignalError::NoApplication { board: 1, valid: true }));
    assert!(error.hint().contains("ucom start 1"));
}

/// D-36: the names that are stored for a board's program belong to another application. The master detects the wrong names before the
/// control loop runs.
#[test]
fn d36_kept_names_of_another_application_start_nothing() {
    let mut bench = initialised(&[0x21]);
    bench.go(Request::Start { board: 1, force: false }, 10).unwrap();
    bench.go(Request::Describe { board: 1, fresh: false }, 10).unwrap();
    let kept = bench.master.descriptions();
    bench.go(Request::Stop { board: 1, level: StopLevel::Application, force: false }, 10).unwrap();
    for (key, names) in kept {
        bench.master.know_description(key, IoDescription { ci: vec![CI[0].into()], ..names });
    }
    let ci = vec![Setting { name: CI[0].into(), value: 5 }];
    let boards = vec![RunBoard { board: 1, ci, par: Vec::new() }];
    let options = RunOptions { boards, active: true, force: false };
    let error = bench.go(Request::Run(options.clone()), 10).unwrap_err();
    assert_eq!(error, Error::Signal(SignalError::StaleNames { board: 1 }));
    assert_eq!((bench.count("341#"), bench.count("541#")), (0, 0), "no inputs, no loop");
    // During the failed run, the master has read the correct names from the board.
    assert!(matches!(bench.go(Request::Run(options), 10), Ok(Outcome::Running(_))));
}

/// D-14: if frames of a dump are missing, surplus or swapped, the master requests the dump again. The master sends
/// at most three requests.
#[test]
fn d14_dump_is_accepted_only_if_the_totals_fit() {
    let good = ["581#010000000000", "581#0100", "581#6865616420", "581#0100", "581#737065656400"];
    let short = &good[..4];
    let surplus = [good[0], good[1], good[2], good[3], good[4], "581#0000"];
    let info = ["141#2100018B34126E38", "141#0000"];
    let read = |tries: &[&[&str]]| {
        let mut script = Script::default().on("201#", &info);
        for answer in tries {
            script = script.once("581#", answer);
        }
        let mut bench = Bench::script(script);
        let result = bench.go(Request::Describe { board: 1, fresh: false }, 10);
        (result, bench.count("581#"))
    };
    for bad in [short, &surplus, &[good[0], good[1], good[3], good[2], good[4]]] {
        let (result, tries) = read(&[bad, &good]);
        let Ok(Outcome::Description { description, .. }) = result else { panic!("{bad:?}: {result:?}") };
        assert_eq!((description.ci, tries), (vec!["speed".to_owned()], 2), "{bad:?}");
        let (result, tries) = read(&[bad; 4]);
        assert!(
            matches!(result, Err(Error::Exchange(ExchangeError::Incomplete { .. }))),
            "{bad:?}: {result:?}"
        );
        assert_eq!(tries, 3);
    }
    assert!(matches!(read(&[]), (Err(Error::Exchange(ExchangeError::NoAnswer { tries: 3, .. })), 3)));
}

/// P-6: while board 2 sends a dump, other boards send SO at full rate, and board 3 sends DSP_INFO. The master does
/// not mix the frames.
#[test]
fn p6_nothing_is_mixed_up() {
    let dump = [
        "1:582#010001000000",
        "2:582#0200",
        "3:582#68656164207061",
        "4:582#6E",
        "5:582#0100",
        "6:582#7370656564",
        "7:582#0100",
        "8:582#706F73",
    ];
    let mut bytes: Vec<String> = dump.iter().map(|t| t.to_string()).collect();
    // Every package of a string except the last must have 8 bytes, so the first package of this string gets an eighth
    // byte.
    bytes[2] = "3:582#6865616420706120".into();
    let dump: Vec<&str> = bytes.iter().map(String::as_str).collect();
    let mut script = Script::default()
        .on("202#", &["142#4200028B34126E38", "142#0000"])
        .on("203#", &["143#6300039B34126E38"])
        .on("582#", &dump);
    for ms in 0..400 {
        let other = 3 + ms % 10;
        script = script.at(ms, &format!("{:03X}#0000640065006600", 14 << 6 | other));
        script = script.at(ms, &format!("143#{:02X}00030034126E38", ms % 256));
        script = script.at(ms, "583#0100");
    }
    let mut bench = Bench::script(script);
    let Ok(Outcome::Description { description, .. }) =
        bench.go(Request::Describe { board: 2, fresh: true }, 10)
    else {
        panic!("{:?}", bench.events.last())
    };
    assert_eq!(
        (description.description.as_str(), description.ci[0].as_str(), description.so[0].as_str()),
        ("head pa n", "speed", "pos")
    );
}

/// D-37: the master changes flags by read-modify-write, and outputs are never active without the control loop.
#[test]
fn d37_flags() {
    let mut bench = running(&[0x21], &[1]);
    let change = AdminChange { debug: Some(true), ..Default::default() };
    let Ok(Outcome::Admin { admin, .. }) = bench.go(Request::Admin { board: 1, change, force: false }, 10)
    else {
        panic!()
    };
    assert_eq!(admin, Admin { run: true, active: true, debug: true, global_debug: false });
    let change = AdminChange { run: Some(false), ..Default::default() };
    let Ok(Outcome::Admin { admin, .. }) = bench.go(Request::Admin { board: 1, change, force: false }, 10)
    else {
        panic!()
    };
    assert_eq!(admin, Admin { debug: true, ..Admin::default() });
    assert!(!bench.board(0).application.running);
}

/// A stop performs its steps in the order outputs, loop, application, which is the reverse of a start. During the stop, the status changes
/// from 0xAB to 0x8B to 0x1B.
#[test]
fn stop_in_reverse() {
    let mut bench = running(&[0x21], &[1]);
    for (level, status) in
        [(StopLevel::Outputs, 0xAB), (StopLevel::Loop, 0x8B), (StopLevel::Application, 0x1B)]
    {
        let Ok(Outcome::Status { info, .. }) = bench.go(Request::Stop { board: 1, level, force: false }, 10)
        else {
            panic!()
        };
        assert_eq!(info.status.0, status);
        assert!(!bench.board(0).application.active);
    }
    bench.run(10_000);
    let lost = bench.events.iter().any(|(_, e)| matches!(e, Event::Supervision { .. }));
    assert!(!lost, "an application that was stopped on purpose is not lost");
}

/// P-15, D-51: the master reports a lost board within 3.1 s of the board's last heartbeat. The master sends the frames that `on_lost`
/// requires within 100 ms.
#[test]
fn p15_d51_lost_boards() {
    for (on_lost, frame) in [
        (OnLost::StopAll, Some("600#00000000")),
        (OnLost::StopBoard, Some("602#00000000")),
        (OnLost::Report, None),
    ] {
        let profile = Profile { on_lost, ..Profile::default() };
        let mut bench = Bench::chain_with(&[0x21, 0x42], profile);
        bench.go(Request::Init(InitOptions::default()), 20).unwrap();
        bench.go(Request::Run(run_options(&[1, 2])), 30).unwrap();
        bench.run(2_500);
        bench.cut = vec![1];
        bench.run(6_000);
        let last = bench.master.boards().get(2).unwrap().alive_at.unwrap();
        let reported = |what: Supervision, bench: &Bench| {
            let is = |e: &Event| *e == Event::Supervision { board: 2, change: what };
            bench.events.iter().find(|(_, e)| is(e)).map(|(at, _)| *at)
        };
        assert!((1_500 * MS..1_600 * MS).contains(&(reported(Supervision::Late, &bench).unwrap() - last)));
        let lost = reported(Supervision::Lost, &bench).unwrap();
        assert!((3_000 * MS..=3_100 * MS).contains(&(lost - last)), "{}", lost - last);
        for text in ["600#00000000", "602#00000000"] {
            let times = bench.times_of(text);
            // The master sends the stop frame three times, because a single frame can be lost.
            assert_eq!(times.len(), 3 * usize::from(frame == Some(text)), "{on_lost:?} {text}");
            assert!(times.iter().all(|at| at - lost <= 100 * MS));
        }
        // The master does not repeat the inputs of a lost board.
        let repeated = bench.log.iter().rfind(|(.., f)| f.id() == 0x342).unwrap().0;
        assert!(repeated <= lost + MS, "{on_lost:?}");
        assert_eq!(bench.board(0).application.running, on_lost != OnLost::StopAll);
        bench.cut.clear();
        bench.run(2_000);
        assert!(reported(Supervision::Back, &bench).is_some());
        assert_eq!(bench.master.boards().get(2).unwrap().life, Life::Alive);
    }
}

/// A monitor that is not the master does not send frames when a board is lost.
#[test]
fn only_a_master_stops_boards() {
    let script = (0..5).fold(Script::default(), |s, i| s.at(i * 1000, "681#"));
    let mut bench = Bench::script(script);
    bench.run(20_000);
    assert!(
        bench.events.iter().any(|(_, e)| matches!(e, Event::Supervision { change: Supervision::Lost, .. }))
    );
    assert!(bench.sent().is_empty());
}

/// D-26: if a board reboots while it runs, the master also stops the other boards.
#[test]
fn d26_reboot_of_a_running_board() {
    let mut bench = running(&[0x21, 0x42], &[1, 2]);
    let now = bench.now;
    bench.board(1).restart(now);
    bench.run(500);
    let change = Supervision::Rebooted { ucom_id: 0x42 };
    assert!(bench.events.iter().any(|(_, e)| *e == Event::Supervision { board: 2, change }));
    assert!(!bench.board(0).application.running);
    assert_eq!(bench.count("600#00000000"), 3);
    // A repair assigns the number to the rebooted board again.
    let repair = Request::Repair { board: 2, flash_number: 0x42, force: false };
    assert!(matches!(bench.go(repair, 10), Ok(Outcome::Repaired(seen)) if seen.info.flash_number == 0x42));
    let repair = Request::Repair { board: 2, flash_number: 0x63, force: false };
    assert!(matches!(
        bench.go(repair, 10),
        Err(Error::Identity(IdentityError::WrongBoard { found: 0x42, .. }))
    ));
}

/// D-50: after the end of the session, the PC sends no heartbeats, so boards stop by themselves.
#[test]
fn d50_end_of_session() {
    let mut bench = running(&[0x21], &[1]);
    // The session ends at the time of a heartbeat, so the time without heartbeats is known exactly.
    let alive = bench.count("680#");
    bench.until(|b| b.count("680#") != alive);
    bench.master.end_session();
    let sent = bench.sent().len();
    bench.run(1_400);
    assert!(bench.board(0).application.running);
    bench.run(300);
    assert!(!bench.board(0).application.running);
    assert_eq!(bench.sent().len(), sent);
}

/// P-19: if the predicted bus load is above the limit, the master refuses the start before any control loop starts.
#[test]
fn p19_load_forecast() {
    let profile = Profile { so_period: 1, load_limit: 70, ..Profile::default() };
    let ids: Vec<u16> = (1..=3).collect();
    let mut bench = Bench::chain_with(&ids, profile);
    bench.go(Request::Init(InitOptions::default()), 20).unwrap();
    let options = run_options(&[1, 2, 3]);
    let error = bench.go(Request::Run(options.clone()), 60).unwrap_err();
    assert!(matches!(error, Error::Running(RunningError::Load(_))), "{error}");
    assert_eq!(error.exit(), 4);
    assert!((0..3).all(|i| !bench.board(i).application.running));
    assert!(bench.sent().iter().all(|t| !t.starts_with("54")));
    bench.go(Request::Run(RunOptions { force: true, ..options }), 60).unwrap();
    assert!(bench.board(2).application.running);
}

/// D-33: the master returns snapshots of a running board with the values that the board sent.
#[test]
fn d33_snapshots() {
    let mut bench = running(&[0x21], &[1]);
    bench.board(0).application.so = vec![100, 65516, 7, 9];
    bench.master.watch(1, None, true);
    bench.run(100);
    let mut snapshots = bench.events.iter().filter_map(|(_, e)| match e {
        Event::Snapshot { board: 1, snapshot } => Some(snapshot.clone()),
        _ => None,
    });
    let last = snapshots.next_back().unwrap();
    assert_eq!((last.words, last.incomplete_before), (vec![100, 65516, 7, 9], 0));
    assert!((9..=11).contains(&(snapshots.count() + 1)));
}

/// Only one procedure at a time may work with a board. A procedure for another board may run at the same time.
#[test]
fn one_procedure_a_board() {
    let mut bench = initialised(&[0x21, 0x42]);
    let now = bench.now;
    let first = bench.master.start(now, Request::Start { board: 1, force: false }).unwrap();
    let again = bench.master.start(now, Request::Info { board: 1 });
    assert!(matches!(again, Err(Error::Master(MasterError::Busy { with: "start", .. }))), "{again:?}");
    assert!(bench.go(Request::Info { board: 2 }, 5).is_ok());
    assert!(bench.wait(first, 10).is_ok());
}
