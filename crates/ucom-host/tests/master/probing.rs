//! Tests of the probe and of the doctor.

use ucom::profile::{AliveMode, Endian, ReportMode};
use ucom::{Checksum, Profile, Status};
use ucom_host::master::doctor::{Controller, Observation, Severity, findings};
use ucom_host::master::probe::ProbeOptions;
use ucom_host::master::update::UpdateFailure;
use ucom_host::master::{
    Diagnose, Error, Event, IdentityError, InitFinding, InitOptions, MasterError, Outcome, Request, RunBoard,
    RunOptions, RunningError, ScanFinding,
};

use super::bench::{Bench, image};
use super::chain::initialised;
use super::update::options;

/// P-20: the probe derives the profile of the boards from their answers, also if this profile is not the default
/// profile.
#[test]
fn p20_probe_finds_the_profile() {
    let others = [
        Profile::default(),
        Profile { endian: Endian::Big, ..Profile::default() },
        Profile { endian: Endian::Big, string_count_includes_header: true, ..Profile::default() },
        Profile {
            report_mode: ReportMode::All4,
            chain_auto_opinit: true,
            dlc_strict: true,
            ..Profile::default()
        },
        Profile {
            endian: Endian::Big,
            string_count_includes_header: true,
            report_mode: ReportMode::All4,
            chain_auto_opinit: true,
            ..Profile::default()
        },
        Profile { report_mode: ReportMode::Seq, ..Profile::default() },
        Profile { addr_broadcast: ucom::profile::Broadcast::None, ..Profile::default() },
    ];
    for profile in others {
        let mut bench = Bench::chain_with(&[0x21, 0x42, 0x63], profile);
        // The master of this PC starts with the default profile.
        bench.master = ucom_host::master::Master::new(Profile::default());
        let probe = Request::Probe(ProbeOptions { init: true, ..Default::default() });
        let Ok(Outcome::Probe(report)) = bench.go(probe, 120) else { panic!() };
        assert_eq!(report.profile, profile, "{}", report.table());
        assert_eq!(report.boards, [1, 2, 3]);
    }
}

/// D-10: if the byte order is wrong, the error mentions the byte order and the command `probe`. The error about the byte order does not
/// mention the wire, the load or the flash numbers.
#[test]
fn d10_a_wrong_byte_order_is_named() {
    for (boards, here) in [(Endian::Big, Endian::Little), (Endian::Little, Endian::Big)] {
        let new = || {
            let mut bench =
                Bench::chain_with(&[0x21, 0x42], Profile { endian: boards, ..Profile::default() });
            bench.master = ucom_host::master::Master::new(Profile { endian: here, ..Profile::default() });
            bench
        };
        let mut bench = new();
        let init = Request::Init(InitOptions { expected: vec![(1, 0x21), (2, 0x42)], force: false });
        let Ok(Outcome::Init(report)) = bench.go(init, 60) else { panic!("no init") };
        assert_eq!(report.findings, [InitFinding::ByteOrder { endian: here }], "{here:?}");
        let Ok(Outcome::Scan(scan)) = bench.go(Request::Scan, 60) else { panic!("no scan") };
        assert_eq!(scan.findings, [ScanFinding::ByteOrder { endian: here }], "{here:?}");
        let (statistics, boards) = (bench.master.statistics(), bench.master.boards());
        let (profile, scan) = (bench.master.profile(), Some(scan));
        let all = findings(&Observation { statistics, boards, profile, scan, ..Default::default() });
        let problems: Vec<_> = all.iter().filter(|f| f.severity != Severity::Good).collect();
        assert_eq!(problems.len(), 1, "{problems:?}");
        assert!(
            problems[0].what.contains("byte order") && problems[0].next.to_string().contains("ucom probe"),
            "{problems:?}"
        );
        // The master refuses `update` because of the byte order, before it changes the board. `info` still succeeds,
        // and a note reports the wrong byte order.
        let before = bench.log.len();
        let Ok(Outcome::Update(report)) = bench.go(Request::Update(options(&[1], 128)), 60) else { panic!() };
        let Some(UpdateFailure::Refused(error)) = &report.boards[0].failure else { panic!("{report:?}") };
        assert_eq!(**error, Error::Identity(IdentityError::ByteOrder { endian: here }));
        assert!(error.hint().contains("ucom probe"));
        assert!(bench.log[before..].iter().all(|(_, from, frame)| {
            *from != super::bench::From::Master || matches!(frame.id() >> 6, 8 | 9 | 26)
        }));
        let received = bench.events.len();
        bench.go(Request::Info { board: 1 }, 60).unwrap();
        let noted = |(_, event): &(_, Event)| matches!(event, Event::Note { text, .. } if text.contains("wrong byte order"));
        assert!(bench.events[received..].iter().any(noted));
        // The application must run, because a board sends its description only while an application runs. The request
        // for the description also fails because of the byte order.
        bench.go(Request::Start { board: 1, force: false }, 60).unwrap();
        let error = bench.go(Request::Describe { board: 1, fresh: true }, 60).unwrap_err();
        assert!(error.to_string().contains("byte order") && error.hint().contains("ucom probe"), "{error:?}");
    }
    // A flash number that equals its byte-swapped form must not cause a report about the byte order.
    let mut bench = Bench::chain(&[0x2121, 0x42]);
    assert!(matches!(bench.go(Request::Init(InitOptions::default()), 60), Ok(Outcome::Init(r)) if r.is_ok()));
}

/// Without `init`, a probe sends only harmless frames.
#[test]
fn p20_probe_is_harmless_unless_allowed() {
    let mut bench = initialised(&[0x21]);
    bench.master = ucom_host::master::Master::new(Profile::default());
    let before = bench.log.len();
    let Ok(Outcome::Probe(report)) = bench.go(Request::Probe(ProbeOptions::default()), 60) else { panic!() };
    assert_eq!(report.profile, Profile::default());
    let row = |key: &str| report.rows.iter().find(|r| r.key == key).unwrap();
    assert!(row("endian").measured && !row("chain.auto_opinit").measured);
    for (_, from, frame) in &bench.log[before..] {
        let harmless = matches!(frame.id() >> 6, 8 | 9 | 22 | 23);
        assert!(harmless || *from != super::bench::From::Master, "{frame}");
    }
}

/// The probe determines the checksum of a board's program and the heartbeat mode that a running board accepts.
#[test]
fn probe_of_checksum_and_heartbeats() {
    let theirs = Profile { prog_checksum: Checksum::Sum16, ..Profile::default() };
    let mut bench = Bench::chain_with(&[0x21], theirs);
    bench.go(Request::Init(InitOptions::default()), 20).unwrap();
    bench.go(Request::Update(options(&[1], 1000)), 60).unwrap();
    bench.master = ucom_host::master::Master::new(Profile::default());
    let asked = ProbeOptions { image: Some(image(1000).into()), alive: true, ..Default::default() };
    let Ok(Outcome::Probe(report)) = bench.go(Request::Probe(asked), 120) else { panic!() };
    assert_eq!(report.profile.prog_checksum, Checksum::Sum16, "{}", report.table());
    assert_eq!(report.profile.alive_mode, AliveMode::Broadcast);
    assert!(report.rows.iter().any(|r| r.key == "alive.mode" && r.measured));
    assert!(!bench.board(0).application.running);
}

/// After a probe has ended for any reason, the session uses its previous profile, and boards that did not run before do not run.
#[test]
fn a_probe_leaves_the_session_and_the_boards_as_they_were() {
    let theirs = Profile { prog_checksum: Checksum::Sum16, ..Profile::default() };
    let numbered = || {
        let mut bench = Bench::chain_with(&[0x21, 0x42], theirs);
        bench.go(Request::Init(InitOptions::default()), 20).unwrap();
        bench.go(Request::Update(options(&[1], 1000)), 60).unwrap();
        bench.master = ucom_host::master::Master::new(Profile::default());
        bench
    };
    let alive = ProbeOptions { image: Some(image(1000).into()), alive: true, ..Default::default() };
    let mut bench = numbered();
    let Ok(Outcome::Probe(report)) = bench.go(Request::Probe(alive.clone()), 120) else { panic!() };
    assert_eq!(report.profile.prog_checksum, Checksum::Sum16, "{}", report.table());
    assert_eq!(bench.master.profile(), Profile::default());
    assert!(!bench.board(0).application.running && !bench.board(0).status().has(Status::MSTART));
    // A board whose application was started before the probe stays started.
    bench.go(Request::Start { board: 1, force: false }, 20).unwrap();
    bench.go(Request::Probe(alive.clone()), 120).unwrap();
    assert!(!bench.board(0).application.running && bench.board(0).status().has(Status::MSTART));
    // The test cancels the probe while it reads all frames in raw form (after `201#`), and while it starts a control
    // loop (after `541#`).
    for until in ["<201#", "<541#"] {
        let mut bench = numbered();
        let id = bench.master.start(bench.now, Request::Probe(alive.clone())).unwrap();
        let before = bench.log.len();
        bench.until(|bench| bench.log[before..].iter().any(|(_, from, frame)| sent(*from, frame) == until));
        bench.master.cancel(id);
        assert_eq!(bench.wait(id, 60), Err(Error::Master(MasterError::Cancelled)));
        assert_eq!(bench.master.profile(), Profile::default(), "{until}");
        assert!(!bench.board(0).application.running && !bench.board(0).status().has(Status::MSTART));
    }
}

fn sent(from: super::bench::From, frame: &ucom::Frame) -> String {
    format!("{}{frame}", if from == super::bench::From::Master { '<' } else { '>' })
}

/// The master refuses a probe that would end a running control loop unless `force` is set.
#[test]
fn a_probe_that_would_end_control_loops_is_refused() {
    for asked in [
        ProbeOptions { alive: true, ..Default::default() },
        ProbeOptions { init: true, ..Default::default() },
    ] {
        let mut bench = initialised(&[0x21, 0x42]);
        let boards = vec![RunBoard { board: 2, ..Default::default() }];
        bench.go(Request::Run(RunOptions { boards, ..Default::default() }), 20).unwrap();
        let refused = bench.go(Request::Probe(asked.clone()), 60);
        assert_eq!(refused, Err(Error::Running(RunningError::LoopRuns { boards: vec![2] })), "{asked:?}");
        bench.run(2_000);
        assert!(bench.board(1).application.running);
        let forced = ProbeOptions { force: true, ..asked };
        assert!(matches!(bench.go(Request::Probe(forced), 60), Ok(Outcome::Probe(_))));
    }
}

fn text(o: &Observation) -> String {
    findings(o).iter().map(|f| format!("{:?} {} / {} / {}\n", f.severity, f.what, f.why, f.next)).collect()
}

fn observe(bench: &mut Bench) -> Observation {
    let scan = match bench.go(Request::Scan, 30) {
        Ok(Outcome::Scan(report)) => Some(report),
        other => panic!("{other:?}"),
    };
    Observation {
        listened_us: bench.now,
        now_us: bench.now,
        statistics: bench.master.statistics(),
        boards: bench.master.boards(),
        scan,
        profile: Profile::default(),
        ..Default::default()
    }
}

#[test]
fn doctor_distinguishes_silence_rate_and_termination() {
    let mut silent = observe(&mut Bench::chain(&[]));
    assert!(text(&silent).contains("Problem no frame within"));
    silent.controller = Some(Controller { no_acknowledge: 3, ..Default::default() });
    assert!(text(&silent).contains("no node acknowledges the frames of this PC (3 times)"));
    silent.controller = Some(Controller { protocol_errors: 40, ..Default::default() });
    assert!(text(&silent).contains(
        "40 bus errors and no valid frame / frames are on the bus but cannot be read: usually the bit rate \
         is wrong"
    ));
    silent.other_bitrate = Some(500_000);
    assert!(text(&silent).contains("wrong bit rate: frames are received at 500000 bit/s"));
    let mut good = observe(&mut initialised(&[0x21, 0x42]));
    good.controller = Some(Controller { tec: Some(0), rec: Some(0), ..Default::default() });
    assert!(findings(&good).iter().all(|f| f.severity == Severity::Good), "{}", text(&good));
    assert!(text(&good).contains("2 boards already have numbers"));
    good.controller =
        Some(Controller { protocol_errors: 7, tec: Some(120), rec: Some(3), ..Default::default() });
    assert!(text(&good).contains("termination missing"));
}

#[test]
fn doctor_names_what_is_wrong_in_the_chain() {
    let mut bench = Bench::chain(&[0x21, 0x42]);
    let o = observe(&mut bench);
    assert!(text(&o).contains("2 boards, none has a number"), "{}", text(&o));
    let mut bench = initialised(&[0x21, 0x42]);
    let now = bench.now;
    bench.board(1).restart(now);
    bench.run(300);
    let o = observe(&mut bench);
    let t = text(&o);
    assert!(
        t.contains("1 of 2 boards has no number / a board rebooted, or the init wire after board 1"),
        "{t}"
    );
    assert!(t.contains("board 2 rebooted"), "{t}");
    assert!(findings(&o).is_sorted_by_key(|f| f.severity));
}
