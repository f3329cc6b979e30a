//! Tests of the client with the complete simulated controller: parameters, uploads on good and bad lines, execution and
//! recovery.

use jtc_wire::{ControllerState, TrajectoryState};
use std::time::Duration;

use jtc_bus::Joint;
use jtc_core::{Config, Friction};
use jtc_host::arm::{Arm, FrictionChoice, ParameterFile, ParameterSet};
use jtc_host::port::sim::SimPort;
use jtc_host::port::{Port, PortError};
use jtc_host::session::{Flow, Outcome, ParameterSource, RecoverStep, UploadOptions, UploadReport};
use jtc_host::{
    CheckOptions, CheckedTrajectory, Diagnose, Error, ErrorKind, MotionError, Session, Trajectory,
    UploadError, plan,
};
use jtc_sim::{Fault, FaultKind, Trigger};

use super::{Sim, inject, motion, ready, session};

/// Returns a motion to a pose and back, followed by a standstill, with `points` points in total.
fn trajectory(points: usize) -> Trajectory {
    let config = Config::avena();
    let there = plan::joint_move(&[0.0; 6], &[0.6, -0.5, 0.4, 0.8, -0.3, 0.9], &config, 60.0).unwrap();
    let back = there.points.iter().rev().map(|p| jtc_host::Point { velocity: p.velocity.map(|v| -v), ..*p });
    let both: Vec<jtc_host::Point> = there.points.iter().copied().chain(back).collect();
    let mut all: Vec<jtc_host::Point> =
        both.iter().copied().cycle().take(points / both.len() * both.len()).collect();
    all.resize(points, there.points[0]);
    Trajectory { step_ms: there.step_ms, points: all }
}

/// Checks a trajectory for the default arm, which is at the first point of the trajectory.
fn checked(t: &Trajectory, upload: UploadOptions) -> CheckedTrajectory {
    let options = CheckOptions { upload, ..CheckOptions::default() };
    CheckedTrajectory::check(t, &Arm::avena(), &t.points[0].position, &options).unwrap()
}

fn upload(s: &mut Sim, t: &Trajectory) -> Result<(CheckedTrajectory, UploadReport), Error> {
    let checked = checked(t, UploadOptions::default());
    let report = s.upload(&checked, |_| Flow::Continue)?;
    Ok((checked, report))
}

#[test]
fn parameters_go_over_and_the_controller_becomes_ready() {
    let mut s = session(Some(921_600));
    let status = s.next_status().unwrap();
    assert_eq!((status.state, status.jtc_init), (ControllerState::Init.into(), 7));
    let arm = Arm::avena();
    let file = ParameterFile { polynomial: arm.polynomial, table: arm.table, ..ParameterFile::default() };
    let table = s.push(&file.parameter_set(FrictionChoice::Table), |_| {}).unwrap();
    // The client sends the frame of the friction table twice, and the controller confirms both transmissions.
    assert_eq!((table[0].times, table[0].bytes), (2, 10_566));
    assert_eq!(s.fresh_status().unwrap().friction_type, 1);
    let pushed = s.push(&Arm::avena().parameter_set(), |_| {}).unwrap();
    assert_eq!(pushed.len(), 3);
    let status = s.wait_hold(Duration::from_secs(15)).unwrap();
    assert_eq!((status.jtc_init, status.node_init, status.friction_type), (0, 0, 0));
}

/// An upload uses at least 98 % of the capacity of the line.
#[test]
fn uploads_fill_the_line() {
    for (baud, points) in [(115_200, 2_000), (921_600, 12_000), (3_000_000, 12_000)] {
        let mut s = ready(Some(baud));
        let (_, report) = upload(&mut s, &trajectory(points)).unwrap();
        let share = report.line_share.unwrap();
        println!("{baud} Bd: {points} points in {:.3} s, {:.2} % of the line", report.time_s, share * 100.0);
        assert!(share >= 0.98, "{baud} Bd: {share}");
        assert_eq!(
            (report.retries, report.restarts, s.last().unwrap().trajectory),
            (0, 0, TrajectoryState::Stop.into())
        );
        assert_eq!(s.statistics().bad_frames, 0);
    }
}

/// Serial line that corrupts bytes on the way to the host.
struct Noisy {
    port: SimPort,
    random: u64,
    every: u64,
}

impl Port for Noisy {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        let n = self.port.read(buffer, timeout)?;
        for byte in &mut buffer[..n] {
            self.random = self.random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            if (self.random >> 33).is_multiple_of(self.every) {
                *byte ^= 0x10;
            }
        }
        Ok(n)
    }
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.port.write_all(bytes)
    }
    fn now(&self) -> Duration {
        self.port.now()
    }
    fn baud(&self) -> Option<u32> {
        self.port.baud()
    }
}

/// J-04: the controller sends each response record only once. If a response record is lost on the way to the host, an
/// upload or a command must not fail.
#[test]
fn j04_lost_confirmations_are_survived() {
    for seed in 1..6 {
        // About one status in ten arrives damaged at the host.
        let mut s =
            Session::new(Noisy { port: ready(Some(921_600)).into_port(), random: seed, every: 1_700 });
        let options = UploadOptions { points_per_segment: Some(60), ..UploadOptions::default() };
        let t = checked(&trajectory(3_000), options);
        let report = s.upload(&t, |_| Flow::Continue).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        println!(
            "seed {seed}: {:.2} s, {} retries, {} restarts",
            report.time_s, report.retries, report.restarts
        );
        assert!(s.statistics().bad_bytes > 0);
        s.execute(&t).unwrap();
        s.stop().unwrap();
    }
}

/// J-04, J-30: after an upload over a line with any losses, the controller has every point.
#[test]
fn uploads_survive_a_bad_line() {
    for (seed, kind) in [
        (1, FaultKind::SerialFlipped { probability: 2e-5 }),
        (2, FaultKind::SerialLost { probability: 2e-5 }),
        (3, FaultKind::SerialFlipped { probability: 1e-4 }),
    ] {
        let mut s = ready(Some(921_600));
        s.port_mut().world_mut().inject(Fault { kind, trigger: Trigger::At(0), duration_ms: None });
        let (_, report) =
            upload(&mut s, &trajectory(3_000)).unwrap_or_else(|e| panic!("seed {seed}, {kind:?}: {e}"));
        println!(
            "{kind:?}: {:.2} s, {} retries, {} restarts",
            report.time_s, report.retries, report.restarts
        );
        assert_eq!(s.last().unwrap().trajectory, TrajectoryState::Stop);
    }
}

#[test]
fn a_trajectory_runs_to_its_end_and_is_followed() {
    let mut s = ready(Some(921_600));
    let config = Config::avena();
    let t = plan::joint_move(&[0.0; 6], &[0.4, -0.3, 0.2, 0.1, 0.2, -0.5], &config, 60.0).unwrap();
    let (t, _) = upload(&mut s, &t).unwrap();
    s.execute(&t).unwrap();
    let mut seen = 0;
    let outcome = s
        .follow(|_| {
            seen += 1;
            Flow::Continue
        })
        .unwrap();
    let Outcome::Finished(status) = outcome else { panic!("{outcome:?}") };
    assert_eq!(status.point, (t.trajectory().duration_s() * 1e3).round() as u32);
    assert!(seen > 10 && (f64::from(status.joints[0].position) - 0.4).abs() < 0.01);
    // In Finish, the arm is at the end of the path and not at the first point. Therefore the controller rejects a
    // second execution (J-34).
    let error = s.execute(&t).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Device);
    assert!(error.hint().contains("--approach"), "{error}");
}

#[test]
fn pause_resume_and_stop() {
    let mut s = ready(Some(921_600));
    let (t, _) = upload(&mut s, &motion(1.0, 50.0)).unwrap();
    s.execute(&t).unwrap();
    let (mut paused, mut resumed, mut stopped) = (false, false, false);
    let outcome = s
        .follow(|status| match (status.trajectory.known(), status.point) {
            (Some(TrajectoryState::Execute), 300..) if !paused => {
                paused = true;
                Flow::Pause
            }
            (Some(TrajectoryState::Pause), _) if !resumed => {
                resumed = true;
                Flow::Resume
            }
            (Some(TrajectoryState::Execute), 900..) if resumed && !stopped => {
                stopped = true;
                Flow::Stop
            }
            _ => Flow::Continue,
        })
        .unwrap();
    assert!(matches!(outcome, Outcome::Stopped(_)) && resumed && stopped, "{outcome:?}");
}

#[test]
fn a_fault_while_running_is_an_error_with_the_point_and_recover_leads_back() {
    let mut s = ready(Some(921_600));
    let (t, _) = upload(&mut s, &motion(1.0, 50.0)).unwrap();
    inject(&mut s, FaultKind::MotorFault { joint: Joint::ALL[2], bits: 2 }, Trigger::AtPoint(500), 300);
    s.execute(&t).unwrap();
    let error = s.follow(|_| Flow::Continue).unwrap_err();
    let Error::Motion(MotionError::RunFault { point, .. }) = &error else { panic!("{error}") };
    // The reported point comes from the last status before the fault, which may be up to 40 ms old.
    assert!((459..600).contains(point), "{error}");
    assert_eq!(error.kind(), ErrorKind::Fault);
    assert!(error.to_string().contains("joint 3"), "{error}");
    let mut steps = Vec::new();
    let status = s
        .recover(ParameterSource::None, |step| steps.push(step.clone()))
        .unwrap_or_else(|e| panic!("{e}: {steps:?}"));
    assert_eq!((status.state, status.errors), (ControllerState::HoldPos.into(), 0), "{steps:?}");
    assert!(steps.iter().any(|s| matches!(s, RecoverStep::Clear(_))));
    // J-24: after the recovery, the arm must not move without a command.
    assert_ne!(status.trajectory, TrajectoryState::Execute);
}

#[test]
fn a_silent_device_is_no_link_and_a_wrong_state_is_refused() {
    use jtc_host::port::test::ScriptedPort;
    let mut silent = Session::new(ScriptedPort::new(Some(115_200), |_, _| Vec::new()));
    let error = silent.next_status().unwrap_err();
    let diagnosis = error.diagnosis();
    assert_eq!((diagnosis.kind, diagnosis.code), (ErrorKind::NoLink, "no-link"));
    assert_eq!(silent.clear(true, 0).unwrap_err().diagnosis().kind, ErrorKind::NoLink);
    // `Cargo.toml` is a regular file, so it cannot be opened as a port.
    let error = jtc_host::port::SerialPort::open("Cargo.toml", 115_200).map(drop).unwrap_err();
    assert_eq!(error.to_string(), "Cargo.toml is no serial port");
    let mut s = ready(Some(921_600));
    let error = s.stop().unwrap_err();
    assert!(error.hint().contains("cannot pause or stop"), "{}", error.hint());
    let mut s = session(Some(921_600));
    let error = upload(&mut s, &trajectory(50)).unwrap_err();
    assert!(matches!(error, Error::Upload(UploadError::SegmentRefused { segment: 0, .. })), "{error}");
    assert_eq!(s.teach(true).unwrap_err().kind(), ErrorKind::Device);
}

/// If a person pushes the arm, the motion ends without success. The arm yields to the push, and then the controller
/// holds it. After the error is cleared, the client can resume the motion.
#[test]
fn j66_j69_a_motion_that_the_controller_stopped_is_no_success_and_can_go_on() {
    let mut s = ready(None);
    let (t, _) = upload(&mut s, &trajectory(2_000)).unwrap();
    inject(&mut s, FaultKind::Push { joint: Joint::ALL[4], torque: 38.0 }, Trigger::AtPoint(500), 400);
    s.execute(&t).unwrap();
    let error = s.follow(|_| Flow::Continue).unwrap_err();
    assert_eq!((error.code(), error.kind()), ("held-stop", ErrorKind::Fault));
    let text = error.to_string();
    assert!(text.contains("holds the arm: joint 5 was pushed: the controller held "), "{text}");
    let facts = error.facts();
    let limit = 0.3 * 40.0;
    assert_eq!((facts.joint, facts.limit.map(|found| (found - limit).abs() < 1e-3)), (Some(5), Some(true)));
    assert!(facts.value.is_some_and(|value| value.abs() > limit), "{facts:?}");
    assert!(error.hint().contains("jtc clear") && error.hint().contains("jtc traj resume"));
    s.pass(Duration::from_secs(2)).unwrap();
    let held = s.fresh_status().unwrap();
    assert_eq!(held.state, ControllerState::HoldPos);
    assert!(held.is_held_stop() && !held.is_faulty());
    assert!(
        jtc_host::labels::errors_line(&held).starts_with("held stop: joint 5"),
        "{}",
        jtc_host::labels::errors_line(&held)
    );
    assert!(jtc_host::labels::next_step(&held).to_string().contains("jtc clear"));
    // The client sends no frame that moves the arm, and the error of the client contains the cause.
    assert_eq!(s.resume().unwrap_err().code(), "held-stop");
    let error = s.ready_to_move(|_| (), || false).unwrap_err();
    assert!(error.code() == "held-stop" && error.to_string().contains("joint 5"), "{error}");
    assert_eq!(s.settle_for_jog().unwrap_err().code(), "held-stop");
    s.clear(true, 0).unwrap();
    let cleared = s.fresh_status().unwrap();
    assert!(!cleared.is_held_stop() && cleared.errors == 0);
}

/// After a jump of the encoder position, the controller holds the arm. The controller executes no motion until the drive is reset, and the
/// error message contains this remedy.
#[test]
fn j35_j69_no_run_begins_where_an_encoder_has_jumped() {
    let mut s = ready(None);
    s.ready_to_move(|_| (), || false).unwrap();
    inject(&mut s, FaultKind::EncoderJump { joint: Joint::ALL[2], rad: 0.02 }, Trigger::At(0), 60_000);
    s.pass(Duration::from_secs(1)).unwrap();
    let error = s.ready_to_move(|_| (), || false).unwrap_err();
    assert_eq!((error.code(), error.kind()), ("held-stop", ErrorKind::Fault));
    assert!(error.to_string().contains("the encoder of joint 3 jumped by 0.02"), "{error}");
    s.clear(true, 0).unwrap();
    let error = s.ready_to_move(|_| (), || false).unwrap_err();
    assert_eq!((error.code(), error.facts().joint), ("encoder-jumped", Some(3)));
    assert!(error.hint().contains("jtc reset --joints JOINT"), "{}", error.hint());
}

/// If the client gives up waiting for the start of teaching, teaching is switched off, so that the arm does not
/// become compliant later.
#[test]
fn j25_teaching_that_is_not_waited_for_is_switched_off() {
    let mut s = ready(None);
    let given_up = s.teach_until(|| true);
    assert!(matches!(given_up, Err(Error::Cancelled)), "{given_up:?}");
    s.pass(Duration::from_secs(2)).unwrap();
    assert_eq!(s.fresh_status().unwrap().state, ControllerState::HoldPos);
    s.wait_ready(Duration::from_secs(15)).unwrap();
}

/// The answer of the controller contains only "incorrect value". The host determines the joint, the value and the
/// bounds.
#[test]
fn j06_a_refused_parameter_is_named() {
    let mut s = ready(Some(921_600));
    let good = Arm::avena().parameter_set();
    let refusal = |s: &mut Sim, set: &ParameterSet| {
        let error = s.push(set, |_| ()).expect_err("it is refused");
        assert_eq!((error.kind(), error.code()), (ErrorKind::Device, "beyond-bounds"), "{error}");
        error.to_string()
    };
    let mut set = ParameterSet { pid: good.pid, ..ParameterSet::default() };
    set.pid.as_mut().unwrap()[2].kp = 60_000.0;
    let text = refusal(&mut s, &set);
    assert!(text.contains("joint 3: Kp (N·m/rad) 60000 is outside 0..50000"), "{text}");
    let Some(Friction::Polynomial(mut c)) = good.friction.clone() else { panic!("a polynomial") };
    c[4][1] *= -1.0;
    let set = ParameterSet { friction: Some(Friction::Polynomial(c)), ..ParameterSet::default() };
    let text = refusal(&mut s, &set);
    assert!(text.contains("joint 5: friction torque (N·m) at ") && text.contains("is outside"), "{text}");
    let mut set = ParameterSet { model: good.model, ..ParameterSet::default() };
    set.model.as_mut().unwrap().links[0].mass = 51.0;
    let text = refusal(&mut s, &set);
    assert!(text.contains("mass of a link (kg) 51 is outside 0..50"), "{text}");
    // After the rejection, the controller still has the earlier parameters.
    assert_eq!(s.fresh_status().unwrap().jtc_init, 0);
    s.push(&good, |_| ()).unwrap();
}
