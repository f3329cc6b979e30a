//! Tests that check the conformance tests themselves. Boards of the crate `ucom` pass all conformance tests, and each
//! faulty board fails the conformance test for its fault.

use super::bench::Exit;
use std::sync::atomic::{AtomicUsize, Ordering};

use ucom::profile::Endian;
use ucom::{Frame, Function, Profile};
use ucom_host::master::conformance::{
    ConformanceOptions, ConformanceProgram, ConformanceReport, Verdict, test_names,
};
use ucom_host::master::update::UpdateImage;
use ucom_host::master::{Event, InitOptions, Outcome, Request};
use ucom_sim::memory::WirePins;

use super::bench::{Bench, From, Member, TestNode, frame, image, node};

/// Returns options that allow every conformance test.
pub(super) fn all() -> ConformanceOptions {
    let program = ConformanceProgram {
        board: 1,
        flash_number: 0x21,
        image: UpdateImage { bytes: image(1000).into(), address_words: 0 },
        date: 0x5C21,
    };
    ConformanceOptions { init: true, run: true, program: Some(program), ..Default::default() }
}

fn numbered(mut bench: Bench) -> Bench {
    bench.go(Request::Init(InitOptions::default()), 60).unwrap();
    bench
}

fn judged(bench: &mut Bench, options: ConformanceOptions) -> ConformanceReport {
    match bench.go(Request::Conformance(options), 2_000) {
        Ok(Outcome::Conformance(report)) => report,
        other => panic!("{other:?}"),
    }
}

fn failed(report: &ConformanceReport) -> Vec<String> {
    let failed = report.tests.iter().filter(|t| matches!(t.verdict, Verdict::Fail(_)));
    failed.map(|t| format!("{} {:?} {:?}", t.id, t.board, t.verdict)).collect()
}

/// Runs every conformance test in both byte orders, and no test fails. Only tests that cannot run on this bus are
/// skipped.
#[test]
fn boards_of_this_crate_pass_every_test() {
    for endian in [Endian::Little, Endian::Big] {
        let profile = Profile { endian, prog_endian: endian, ..Profile::default() };
        let mut bench = numbered(Bench::chain_with(&[0x21, 0x42, 0x63], profile));
        let report = judged(&mut bench, all());
        assert!(failed(&report).is_empty(), "{endian}: {:?}", failed(&report));
        let skipped: Vec<&str> =
            report.tests.iter().filter(|t| matches!(t.verdict, Verdict::Skipped(_))).map(|t| t.id).collect();
        // D-T10 and D-T11 are skipped because no application runs at this point. D-T19 to D-T21 are skipped because
        // they need a special bus.
        assert_eq!(
            skipped,
            ["D-T10", "D-T11", "D-T10", "D-T11", "D-T10", "D-T11", "D-T19", "D-T20", "D-T21"]
        );
        for n in 0..3 {
            assert!(!bench.board(n).application.running && bench.board(n).number().is_some());
        }
        for i in 0..3 {
            bench.go(Request::Start { board: i + 1, force: false }, 20).unwrap();
        }
        let only = ["D-T10", "D-T11"].map(str::to_owned).to_vec();
        assert_eq!(judged(&mut bench, ConformanceOptions { only, ..Default::default() }).passed(), 6);
    }
}

/// Without options, the run performs no action that needs a permission. The test checks the frames that the master sends in this run.
#[test]
fn without_options_only_harmless_frames_leave() {
    let mut bench = numbered(Bench::chain(&[0x21, 0x42]));
    bench.go(Request::Start { board: 1, force: false }, 20).unwrap();
    let before = bench.log.len();
    let report = judged(&mut bench, ConformanceOptions::default());
    assert_eq!((failed(&report).len(), report.passed()), (0, 5));
    let mut last = 0;
    for (_, from, frame) in bench.log[before..].iter().filter(|(_, from, _)| *from == From::Master) {
        let function = frame.id() >> 6;
        // Without options, the master sends only PC_INFO, PC_REPORT, PC_INIT with a number that the board already
        // has, and dump requests. The master also sends heartbeats, which began with the start of the application.
        assert!(matches!(function, 8 | 9 | 10 | 22 | 23 | 26), "{from:?} {frame}");
        if function == 10 {
            // The master sends PC_INIT(n) only directly after a PC_INFO to number n.
            assert_eq!(last, u16::from(Function::Info.number()) << 6 | frame.id() & 31, "{frame}");
        }
        if function != 26 {
            last = frame.id();
        }
    }
    let reported = bench.events.iter().filter(|(_, e)| matches!(e, Event::Tested { .. })).count();
    assert_eq!(reported, 7, "one event of each test that may be done, D-T2 and three of each board");
    let listed = |id: &str| report.tests.iter().any(|t| t.id == id);
    assert!(test_names().all(listed), "all are listed, also those that cannot be done");
    assert!(bench.board(0).status().0 == 0x8B && bench.board(1).status().0 == 0x1B);
}

#[test]
fn running_boards_are_left_alone() {
    let mut bench = numbered(Bench::chain(&[0x21]));
    let run = ucom_host::master::RunOptions {
        boards: vec![ucom_host::master::RunBoard { board: 1, ..Default::default() }],
        ..Default::default()
    };
    bench.go(Request::Run(run), 20).unwrap();
    let refused = bench.go(Request::Conformance(all()), 20).unwrap_err();
    assert_eq!(refused.exit(), 4, "{refused}");
}

/// Board with a fault that changes the frames that the board receives and sends.
struct Flawed {
    inner: TestNode,
    mistake: Mistake,
    waiting: Vec<Frame>,
    inside: Option<Frame>,
    count: usize,
}

/// Frames that replace a frame that the board receives or sends.
#[derive(Clone, Copy)]
struct Mistake {
    receives: fn(&TestNode, &Frame) -> Vec<Frame>,
    sends: fn(&TestNode, &Frame, usize) -> Vec<Frame>,
}

const NONE: Mistake = Mistake { receives: |_, f| vec![*f], sends: |_, f, _| vec![*f] };

fn receives(receives: fn(&TestNode, &Frame) -> Vec<Frame>) -> Mistake {
    Mistake { receives, ..NONE }
}

fn sends(sends: fn(&TestNode, &Frame, usize) -> Vec<Frame>) -> Mistake {
    Mistake { sends, ..NONE }
}

impl Member for Flawed {
    fn poll(&mut self, now: u64) -> Option<Frame> {
        if self.waiting.is_empty() && self.inside.is_none() {
            let own = self.inner.poll(now)?;
            self.inside = Some(own);
            self.count += 1;
            self.waiting = (self.mistake.sends)(&self.inner, &own, self.count);
            if self.waiting.is_empty() {
                self.inside = None;
                self.inner.sent(now, &own);
            }
        }
        self.waiting.first().copied()
    }
    fn sent(&mut self, now: u64, _: &Frame) {
        if !self.waiting.is_empty() {
            self.waiting.remove(0);
        }
        if self.waiting.is_empty()
            && let Some(own) = self.inside.take()
        {
            self.inner.sent(now, &own);
        }
    }
    fn receive(&mut self, now: u64, frame: &Frame) {
        for frame in (self.mistake.receives)(&self.inner, frame) {
            self.inner.receive(now, &frame);
        }
    }
    fn deadline(&self) -> u64 {
        if self.waiting.is_empty() { self.inner.next_deadline() } else { 0 }
    }
    fn board(&mut self) -> Option<&mut TestNode> {
        Some(&mut self.inner)
    }
}

/// Returns a bus with two boards; the first board has the fault.
fn with(mistake: Mistake) -> Bench {
    let mut pins = WirePins::chain(2);
    let profile = Profile::default();
    let first = Flawed {
        inner: node(0x21, pins.remove(0), profile),
        mistake,
        waiting: Vec::new(),
        inside: None,
        count: 0,
    };
    let second = node(0x42, pins.remove(0), profile);
    Bench::new(profile, vec![Box::new(first), Box::new(second)])
}

/// The conformance test for each fault detects the fault.
#[test]
fn each_mistake_is_found_by_its_test() {
    let mistakes: [(&str, Mistake); 17] = [
        ("D-T1", sends(|_, f, _| if f.id() == 0x441 { vec![*f, *f] } else { vec![*f] })),
        // The faulty board omits every second report.
        ("D-T2", sends(|_, f, n| if f.id() == 0x441 && n % 2 == 0 { vec![] } else { vec![*f] })),
        // The faulty board answers a request with a report even though it has no number.
        (
            "D-T3",
            receives(|b, f| {
                if b.number().is_none() && f.id() == 0x2C1 { vec![*f, frame("240#")] } else { vec![*f] }
            }),
        ),
        // The outgoing pin of the faulty board does not follow the value in PC_SETSTATUS.
        (
            "D-T4",
            receives(|_, f| {
                // The PC switches on the pin twice: when it numbers the chain, and in the test. The fault loses only
                // the second command.
                static RECEIVED: AtomicUsize = AtomicUsize::new(0);
                let raised = f.to_string() == "1C1#0202";
                if raised && RECEIVED.fetch_add(1, Ordering::Relaxed) == 1 { vec![] } else { vec![*f] }
            }),
        ),
        ("D-T5", receives(|b, f| if b.number().is_some() && f.id() == 0x281 { vec![] } else { vec![*f] })),
        // The faulty board ignores value bits of PC_SETSTATUS that are outside the mask.
        ("D-T6", receives(|_, f| if f.to_string() == "1C1#0040" { vec![] } else { vec![*f] })),
        // If PC_SETSTATUS clears EXLRUN, the faulty board sets ASTART.
        (
            "D-T7",
            receives(|_, f| if f.to_string() == "1C1#1000" { vec![frame("1C1#4040")] } else { vec![*f] }),
        ),
        // The status bit PROG of the faulty board stays 0.
        ("D-T8", receives(|_, f| if f.id() == 0x041 { vec![*f, frame("1C1#0400")] } else { vec![*f] })),
        ("D-T9", sends(|_, f, _| if f.id() == 0x501 { vec![] } else { vec![*f] })),
        ("D-T10", receives(|_, f| if f.to_string() == "581#00" { vec![frame("581#")] } else { vec![*f] })),
        (
            "D-T11",
            sends(|_, f, _| if f.id() == 0x6C1 { vec![frame("6C1#000007000900FF00")] } else { vec![*f] }),
        ),
        ("D-T12", sends(|_, f, _| if f.to_string() == "081#05" { vec![] } else { vec![*f] })),
        // The faulty board starts its control loop as soon as it receives a heartbeat.
        (
            "D-T13",
            receives(|b, f| {
                let ready = f.to_string() == "680#" && b.status().0 == 0x8B;
                if ready { vec![*f, frame("541#")] } else { vec![*f] }
            }),
        ),
        // A heartbeat stops the control loop of the faulty board.
        (
            "D-T14",
            receives(|b, f| {
                if f.to_string() == "680#" && b.application.running {
                    vec![frame("601#00000000")]
                } else {
                    vec![*f]
                }
            }),
        ),
        (
            "D-T15",
            receives(
                |_, f| {
                    if f.to_string() == "601#02000000" { vec![frame("601#00000000")] } else { vec![*f] }
                },
            ),
        ),
        ("D-T17", sends(|_, f, _| if f.id() == 0x101 { vec![] } else { vec![*f] })),
        ("D-T18", sends(|_, f, _| if f.to_string() == "081#0A" { vec![*f, *f] } else { vec![*f] })),
    ];
    for (id, mistake) in mistakes {
        let mut bench = with(mistake);
        // The init must assign a number to each of the two boards.
        if bench.go(Request::Init(InitOptions::default()), 60).is_err() {
            panic!("{id}: no numbers");
        }
        if ["D-T10", "D-T11"].contains(&id) {
            bench.go(Request::Start { board: 1, force: false }, 20).unwrap();
        }
        let options = ConformanceOptions { only: vec![id.into()], ..all() };
        let report = judged(&mut bench, options);
        assert!(report.failed() > 0, "{id}: {report:?}");
        // Boards without a fault pass this conformance test.
        let mut bench = numbered(with(NONE));
        if ["D-T10", "D-T11"].contains(&id) {
            bench.go(Request::Start { board: 1, force: false }, 20).unwrap();
        }
        let report = judged(&mut bench, ConformanceOptions { only: vec![id.into()], ..all() });
        assert!(failed(&report).is_empty(), "{id}: {:?}", failed(&report));
    }
}
