//! Tests for rows of the acceptance table. The boards are simulated by a table of frames.

use super::bench::Exit;
use ucom_host::master::{
    AddressError, Error, Event, InitFinding, InitOptions, MasterError, Outcome, Request, ScanFinding,
};

use super::bench::{Bench, Script};

/// Returns boards 1 to n of the golden chain, as a table of frames.
fn golden(boards: usize) -> Script {
    let reports = &["441#21", "482#42", "4C3#63"][..boards];
    let mut script = Script::default().on("000#", reports).on("240#", reports);
    for (i, flash) in [0x21, 0x42, 0x63].into_iter().enumerate().take(boards) {
        let n = i + 1;
        // The first answer to PC_INFO contains the status 0x19. Later answers contain 0x1B, because the PC has set
        // OPINIT.
        let answer = |status: &str| {
            let numbers = format!("14{n}#{flash:02X}000{n}{status}34126E38");
            [numbers, format!("14{n}#0200"), format!("14{n}#55436F4D32206865"), format!("14{n}#61642070616E")]
        };
        let (before, after) = (answer("19"), answer("1B"));
        script = script
            .on(&format!("28{n}#"), &[&format!("0C{n}#0{n}")])
            .once(&format!("20{n}#"), &before.each_ref().map(String::as_str))
            .on(&format!("20{n}#"), &after.each_ref().map(String::as_str));
    }
    script
}

fn init(bench: &mut Bench) -> ucom_host::master::InitReport {
    match bench.go(Request::Init(InitOptions::default()), 60) {
        Ok(Outcome::Init(report)) => report,
        other => panic!("{other:?}"),
    }
}

/// P-1: a scan sends only `240#` and `200+n#`, and no heartbeats, on a silent and on a busy bus.
#[test]
fn p1_scan_is_harmless() {
    for boards in [0, 3] {
        let mut bench = Bench::script(golden(boards).at(50, "381#0000640065006600").at(60, "683#"));
        let Ok(Outcome::Scan(report)) = bench.go(Request::Scan, 10) else { panic!("no scan") };
        assert_eq!(report.boards.len(), boards);
        for text in bench.sent() {
            let asks = text == "240#" || (0x201..=0x21F).any(|id| text == format!("{id:03X}#"));
            assert!(asks, "{text}");
        }
        if boards == 3 {
            assert_eq!(report.boards[0].description.as_deref(), Some("UCoM2 head pan"));
            assert!(report.findings.is_empty(), "{:?}", report.findings);
        }
        assert!(!bench.master.is_master());
    }
}

/// P-2, vector 13.1: the test compares the frames that number the golden chain with the vector. The master detects
/// the end of the chain within one second.
#[test]
fn p2_init_of_the_golden_chain() {
    let mut bench = Bench::script(golden(3));
    let report = init(&mut bench);
    assert!(report.is_ok(), "{:?}", report.findings);
    assert_eq!(report.boards.iter().map(|b| b.info.flash_number).collect::<Vec<_>>(), [0x21, 0x42, 0x63]);
    let sent: Vec<String> = bench.sent().into_iter().filter(|t| t != "680#").collect();
    let expected = "000# 281# 201# 1C1#0202 201# 282# 202# 1C2#0202 202# 283# 203# 1C3#0202 203# \
        284# 204# 284# 204# 284# 204#";
    assert_eq!(sent.join(" "), expected);
    let end = bench.times_of("204#").pop().unwrap() - bench.times_of("284#")[0];
    assert!(end <= 1_000_000, "{end} us");
}

/// P-2: on a bus without boards, an init sends one reset and reports that no boards exist.
#[test]
fn p2_init_of_nobody() {
    let mut bench = Bench::script(Script::default());
    let report = init(&mut bench);
    assert_eq!(report.findings, [InitFinding::NoBoards]);
    assert_eq!(bench.count("000#"), 1);
    assert_eq!(report.exit(), 3);
}

/// P-3: the INITACK of a board is lost. The master sends PC_INFO before it repeats PC_INIT.
#[test]
fn p3_lost_ack_asks_info_first() {
    let script = Script::default()
        .on("000#", &["441#21"])
        .on("281#", &[])
        .once("201#", &["141#2100011934126E38", "141#0000"])
        .rule("201#", 0, 1, &["141#2100011934126E38", "141#0000"])
        .on("201#", &["141#2100011B34126E38", "141#0000"]);
    let mut bench = Bench::script(script);
    let report = init(&mut bench);
    assert!(report.is_ok(), "{:?}", report.findings);
    assert_eq!(bench.count("281#"), 1, "{:?}", bench.sent());
    // No board answers to number 2. The master always sends a PC_INFO between two PC_INIT.
    let sent: Vec<String> = bench.sent().into_iter().filter(|t| t == "282#" || t == "202#").collect();
    assert_eq!(sent, ["282#", "202#", "282#", "202#", "282#", "202#"]);
}

/// P-4, D-24: identifier and data of INITACK contain different numbers. The master refuses the number and does not choose between the two
/// values.
#[test]
fn p4_d24_ack_mismatch_is_refused() {
    for ack in ["0C1#02", "0C2#01"] {
        let mut bench = Bench::script(
            Script::default().on("000#", &["441#21"]).on("240#", &["441#21"]).on("281#", &[ack]),
        );
        let report = init(&mut bench);
        let refused = |f: &InitFinding| {
            matches!(
                f,
                InitFinding::Refused { board: 1, error: Error::Address(AddressError::AckMismatch { .. }) }
            )
        };
        assert!(report.findings.iter().any(refused), "{:?}", report.findings);
        assert!(report.boards.is_empty());
        assert_eq!(bench.count("282#"), 0);
    }
}

/// P-16, D-26: a report without a request shows a reboot of the board; a requested report does not.
#[test]
fn p16_spontaneous_report() {
    let mut bench = Bench::script(golden(1).at(9_000, "441#21"));
    init(&mut bench);
    bench.run(10_000);
    let rebooted: Vec<_> = bench
        .events
        .iter()
        .filter(|(_, e)| matches!(e, Event::Supervision { .. }))
        .map(|(at, e)| (*at, e.clone()))
        .collect();
    assert_eq!(rebooted.len(), 1, "{rebooted:?}");
    let (at, event) = &rebooted[0];
    assert!((9_000_000..9_010_000).contains(at));
    let expected =
        Event::Supervision { board: 1, change: ucom_host::master::Supervision::Rebooted { ucom_id: 0x21 } };
    assert_eq!(*event, expected);
}

/// P-17, D-08: if another master sends frames, this master refuses the command unless `force` is set. The master does not interpret
/// heartbeats of a running board as frames of another master.
#[test]
fn p17_d08_second_master() {
    for foreign in ["680#", "341#0000000000000000", "240#", "581#"] {
        let mut bench = Bench::script(golden(1).at(100, foreign));
        let result = bench.go(Request::Init(InitOptions::default()), 10);
        assert!(
            matches!(result, Err(Error::Master(MasterError::CompetingMaster { .. }))),
            "{foreign}: {result:?}"
        );
        assert!(bench.sent().is_empty(), "{:?}", bench.sent());
        assert_eq!(result.unwrap_err().exit(), 4);
        let mut bench = Bench::script(golden(1).at(100, foreign));
        let forced = InitOptions { force: true, ..Default::default() };
        assert!(matches!(bench.go(Request::Init(forced), 10), Ok(Outcome::Init(r)) if r.is_ok()));
    }
    let mut bench =
        Bench::script(golden(1).at(100, "683#").at(110, "601#01010000").at(120, "381#0000640065006600"));
    assert!(matches!(bench.go(Request::Init(InitOptions::default()), 10), Ok(Outcome::Init(r)) if r.is_ok()));
    // The master listens to the bus for 600 ms before its first frame.
    assert!(bench.log.iter().find(|(_, f, _)| *f == super::bench::From::Master).unwrap().0 >= 600_000);
}

/// P-18: the master reports an unknown error code as a number.
#[test]
fn p18_unknown_error_code() {
    let mut bench = Bench::script(Script::default().at(10, "081#2A"));
    bench.run(100);
    let [(_, Event::BoardError { board: 1, code, during: None })] = bench.events.as_slice() else {
        panic!("{:?}", bench.events)
    };
    assert_eq!(code.number(), 0x2A);
}

/// D-T21: two boards have the same flash number, so their reports are equal. The init finds more boards than
/// different reports.
#[test]
fn dt21_two_boards_with_one_flash_id() {
    let info = |n: u8, status: &str| vec![format!("14{n}#21000{n}{status}34126E38"), format!("14{n}#0000")];
    let mut script = Script::default().on("000#", &["441#21"]).on("240#", &["441#21"]);
    for n in 1..=2 {
        let (first, later) = (info(n, "19"), info(n, "1B"));
        script = script
            .on(&format!("28{n}#"), &[&format!("0C{n}#0{n}")])
            .once(&format!("20{n}#"), &first.iter().map(String::as_str).collect::<Vec<_>>())
            .on(&format!("20{n}#"), &later.iter().map(String::as_str).collect::<Vec<_>>());
    }
    let mut bench = Bench::script(script);
    let report = init(&mut bench);
    assert!(report.findings.contains(&InitFinding::MoreBoardsThanReports { boards: 2, reports: 1 }));
    let same = InitFinding::DuplicateFlash { flash_number: 0x21, first: 1, second: 2 };
    assert!(report.findings.contains(&same), "{:?}", report.findings);
}

/// The init wire after board 1 is broken: a second board has sent a report but gets no number. The init reports the
/// UCoM id of this board and the position of the fault.
#[test]
fn init_names_a_broken_wire() {
    let script = Script::default()
        .on("000#", &["441#21", "482#42"])
        .on("240#", &["441#21", "482#42"])
        .on("281#", &["0C1#01"])
        .once("201#", &["141#2100011934126E38", "141#0000"])
        .on("201#", &["141#2100011B34126E38", "141#0000"]);
    let mut bench = Bench::script(script);
    let report = init(&mut bench);
    assert_eq!(report.findings, [InitFinding::NotReached { after: 1, ids: vec![0x42] }]);
    assert!(report.findings[0].to_string().contains("0x42 after position 1"));
}

/// D-07: the master identifies the board by the data byte of its report, even if the identifier does not match the
/// report mode of the profile.
#[test]
fn d07_reports_by_data_byte() {
    let script = Script::default().on("240#", &["401#21", "441#21", "481#21", "4C1#21"]);
    let mut bench = Bench::script(script);
    let Ok(Outcome::Scan(report)) = bench.go(Request::Scan, 10) else { panic!() };
    assert_eq!(report.reports.ids.iter().copied().collect::<Vec<_>>(), [0x21]);
    assert_eq!(report.reports.frames[&0x21], 4);
    assert!(report.findings.contains(&ScanFinding::Unnumbered { ucom_id: 0x21 }));
    assert!(report.findings.contains(&ScanFinding::Disagrees { ucom_id: 0x21 }));
}

/// D-14: before the master repeats a request, it waits until the incomplete answer has ended. Without this wait, packages of the old and
/// the new answer would mix.
#[test]
fn d14_a_truncated_answer_runs_dry() {
    let info = "141#2100011B34126E38";
    let late = [
        info,
        "1:141#0300",
        "2:141#6162636465666768",
        "130:141#6162636465666768",
        "180:141#6162636465666768",
    ];
    let whole = [info, "1:141#0100", "2:141#6865616420"];
    let mut bench = Bench::script(Script::default().once("201#", &late).on("201#", &whole));
    let Ok(Outcome::Info(seen)) = bench.go(Request::Info { board: 1 }, 5) else { panic!() };
    assert_eq!(seen.description.as_deref(), Some("head "));
    let asked = bench.times_of("201#");
    assert_eq!(asked.len(), 2);
    assert!(asked[1] >= asked[0] + 280_000, "{asked:?}");
}
