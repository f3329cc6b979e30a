//! Tests of the procedure of a run, which all front ends share (J-55).

use std::cell::RefCell;
use std::rc::Rc;

use jtc_host::port::sim::SimPort;
use jtc_host::run::{Ended, Leg, Observer, Order, Phase, SampleReceiver, StartError, run};
use jtc_host::session::{Flow, Outcome, Progress, UploadReport};
use jtc_host::{Arm, CheckOptions, CheckedTrajectory, Error, Session, Trajectory, plan};
use jtc_wire::Status;

use super::{Sim, motion, ready};

/// Front end that records the calls it receives.
#[derive(Default)]
struct Diary {
    steps: Vec<String>,
    samples: Rc<RefCell<usize>>,
    /// Number of calls of `is_cancelled` after which it returns `true`.
    cancels_at: Option<usize>,
    asked: usize,
    /// Path time at which the front end requests a stop, ms.
    stops_at: Option<u32>,
    /// `true` if the front end requests full speed at each status during the motion.
    speeds: bool,
    /// Number of statuses during the motion. `applied` is the number of requested actions whose result was reported.
    statuses: usize,
    applied: usize,
}

impl Diary {
    fn step(&mut self, what: &str, phase: Phase) {
        self.steps.push(format!("{what} {}", phase.name()));
    }
}

impl Observer<SimPort> for Diary {
    type Failure = String;

    fn refused(&mut self, error: StartError) -> String {
        format!("refused: {error}")
    }

    fn failed(&mut self, error: Error) -> String {
        format!("failed: {error}")
    }

    fn is_cancelled(&mut self) -> bool {
        self.asked += 1;
        self.cancels_at.is_some_and(|at| self.asked > at)
    }

    fn checked(&mut self, phase: Phase, _: &CheckedTrajectory) {
        self.step("checked", phase);
    }

    fn uploading(&mut self, _: Phase, _: &Progress) {}

    fn uploaded(&mut self, phase: Phase, _: &UploadReport) {
        self.step("uploaded", phase);
    }

    fn begins(
        &mut self,
        _: &mut Session<SimPort>,
        phase: Phase,
        _: &CheckedTrajectory,
    ) -> Result<SampleReceiver, String> {
        self.step("begins", phase);
        let samples = Rc::clone(&self.samples);
        Ok(Box::new(move |_| *samples.borrow_mut() += 1))
    }

    fn status(&mut self, _: Phase, status: &Status) -> Flow {
        self.statuses += 1;
        match self.stops_at {
            Some(at) if status.point >= at => Flow::Stop,
            _ if self.speeds => Flow::Speed(100),
            _ => Flow::Continue,
        }
    }

    fn applied(&mut self, flow: Flow, result: &Result<(), Error>) {
        assert!(result.is_ok(), "{flow:?}: {result:?}");
        self.applied += 1;
    }

    fn ended(&mut self, _: &mut Session<SimPort>, leg: &Leg) -> Result<(), String> {
        self.step("ended", leg.phase);
        Ok(())
    }

    fn goes_on(&mut self, n: u32) {
        self.steps.push(format!("run {n}"));
    }
}

/// Runs `trajectory` `runs` times, with approaches. At the start, the controller holds the arm in the zero pose.
fn runs(diary: &mut Diary, session: &mut Sim, trajectory: &Trajectory, runs: u32) -> Result<Ended, String> {
    let (arm, options) = (Arm::avena(), CheckOptions::default());
    let approach_pct = Some(50.0);
    let order = Order { arm: &arm, options: &options, trajectory, later: trajectory, runs, approach_pct };
    let status = session.fresh_status().expect("a status");
    run(session, &order, &status, diary)
}

const LEG: [&str; 4] = ["checked motion", "uploaded motion", "begins motion", "ended motion"];
const APPROACH: [&str; 4] = ["checked approach", "uploaded approach", "begins approach", "ended approach"];

#[test]
fn j55_a_run_that_does_not_lead_back_has_an_approach_before_each_motion() {
    let mut session = ready(None);
    let mut diary = Diary::default();
    let ended = runs(&mut diary, &mut session, &motion(0.3, 50.0), 2).expect("it runs");
    assert!(!ended.cut && ended.last.is_finished() && ended.last.phase == Phase::Motion);
    let expected = [&LEG[..], &["run 1"], &APPROACH, &LEG].concat();
    assert_eq!(diary.steps, expected);
    assert!(*diary.samples.borrow() > 50);
    assert!((session.fresh_status().expect("a status").positions()[0] - 0.3).abs() < 2e-3);
}

/// After a cancellation, no further motion begins, but a motion in progress continues to its end.
#[test]
fn j55_a_run_that_is_cancelled_begins_no_further_motion() {
    let mut counted = Diary::default();
    runs(&mut counted, &mut ready(None), &motion(0.3, 50.0), 2).expect("it runs");
    for at in 0..counted.asked {
        let mut session = ready(None);
        let mut diary = Diary { cancels_at: Some(at), ..Diary::default() };
        let result = runs(&mut diary, &mut session, &motion(0.3, 50.0), 2);
        let begun = diary.steps.iter().filter(|step| step.starts_with("begins")).count();
        let over = diary.steps.iter().filter(|step| step.starts_with("ended")).count();
        assert_eq!(begun, over, "{at}: {:?}", diary.steps);
        match result {
            Ok(ended) => assert!(ended.cut && ended.last.is_finished(), "{at}"),
            Err(failure) => {
                assert!(failure.starts_with("failed") && failure.contains("cancelled"), "{failure}")
            }
        }
        let last = diary.steps.last().map(String::as_str).unwrap_or_default();
        assert!(!last.starts_with("begins"), "{at}: {:?}", diary.steps);
        let place = session.fresh_status().expect("a status").positions()[0];
        let expected = if begun % 2 == 1 { 0.3 } else { 0.0 };
        assert!((place - expected).abs() < 2e-3, "{at}: {place} rad after {:?}", diary.steps);
    }
}

/// The action that the front end requests for the last status of a motion is not applied, because the motion has
/// already ended. The front end must report this to its client.
#[test]
fn j57_a_flow_for_the_last_status_of_a_motion_is_not_applied() {
    let mut diary = Diary { speeds: true, ..Diary::default() };
    runs(&mut diary, &mut ready(None), &motion(0.3, 50.0), 1).expect("it runs");
    assert!(diary.statuses > 10);
    assert_eq!(diary.applied, diary.statuses - 1);
}

#[test]
fn j33_j55_a_motion_that_is_stopped_ends_the_run() {
    let mut session = ready(None);
    let mut diary = Diary { stops_at: Some(200), ..Diary::default() };
    let ended = runs(&mut diary, &mut session, &motion(0.8, 50.0), 3).expect("it runs");
    assert!(matches!(ended.last.outcome, Ok(Outcome::Stopped(_))) && !ended.cut);
    assert_eq!(diary.steps, LEG);
}

#[test]
fn j55_nothing_moves_for_a_run_that_is_refused() {
    let mut session = ready(None);
    let mut diary = Diary::default();
    let there = [0.4, 0.2, 0.0, 0.0, 0.0, 0.0];
    let mut too_fast =
        plan::joint_move(&there, &[-0.4, 0.2, 0.0, 0.0, 0.0, 0.0], &Arm::avena().config(), 90.0)
            .expect("a move");
    for point in &mut too_fast.points {
        point.velocity[0] *= 3.0;
    }
    let failure = runs(&mut diary, &mut session, &too_fast, 1).expect_err("it is too fast");
    assert!(failure.starts_with("refused") && diary.steps.is_empty(), "{failure}, {:?}", diary.steps);
    assert!(session.fresh_status().expect("a status").positions()[0].abs() < 1e-3);
}
