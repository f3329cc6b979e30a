//! Tests that the page is complete, works offline and has a bounded size, and that the values are correct.

use super::curves::Curve;
use super::*;
use crate::plan::Planner;
use crate::sample::JointSample;
use crate::{Arm, Sample};
use jtc_wire::{ControllerState, Joint, NodeState, TrajectoryState};

fn run(samples: usize) -> (RecordingInfo, Vec<Sample>) {
    let mut info =
        RecordingInfo { arm: "avena".into(), trajectory: "</script> & Co".into(), ..Default::default() };
    for joint in &mut info.joints {
        joint.torque_max_nm = 50.0;
    }
    let sample = |i: usize| {
        let t = i as f64 * 1e-3;
        let joint = |j: usize| JointSample {
            set_position: (t * 0.5).sin() * (j + 1) as f64 * 0.3,
            set_velocity: (t * 0.5).cos() * (j + 1) as f64 * 0.15,
            set_acceleration: 0.0,
            position: (t * 0.5).sin() * (j + 1) as f64 * 0.3
                - 1e-3 * if i.is_multiple_of(2) { 1.0 } else { -1.0 },
            error: f64::NAN,
            velocity: (t * 0.5).cos() * (j + 1) as f64 * 0.15,
            torque_model: 20.0,
            torque_p: 1.0,
            torque_i: 0.5,
            torque_d: -0.5,
            torque_friction: 4.0,
            torque: 25.0,
            temperature: 30.0,
            state: NodeState::ENABLED,
            internal: 0,
        };
        let (state, trajectory) = if i < samples / 10 {
            (ControllerState::HoldPos, TrajectoryState::Stop)
        } else {
            (ControllerState::Operate, TrajectoryState::Execute)
        };
        Sample {
            time_s: t,
            state: state.into(),
            trajectory: trajectory.into(),
            point: i as u32,
            errors: 0,
            can_current: 0,
            joints: std::array::from_fn(joint),
        }
    };
    (info, (0..samples).map(sample).collect())
}

#[test]
fn figures_are_those_of_the_execution() {
    let (info, mut samples) = run(1000);
    samples[3].joints[0].position = 9.0; // This sample is before the execution, so the summary does not use it.
    let summary = Summary::of(&info, &samples);
    let joint = &summary.joints[0];
    assert!((joint.rms_error_mrad.unwrap() - 1.0).abs() < 1e-9);
    assert!((joint.max_error_mrad.unwrap() - 1.0).abs() < 1e-9);
    assert_eq!(joint.torque_share, Some(0.5));
    assert_eq!(summary.samples, 900);
    assert!((summary.executed_s - 0.899).abs() < 1e-9);
}

#[test]
fn what_is_not_known_is_none() {
    let (_, mut samples) = run(10);
    for s in &mut samples {
        for j in &mut s.joints {
            j.set_position = f64::NAN;
        }
    }
    let summary = Summary::of(&RecordingInfo::default(), &samples);
    assert_eq!(summary.joints[5].rms_error_mrad, None);
    assert_eq!(summary.joints[5].torque_share, None);
    assert_eq!(Summary::of(&RecordingInfo::default(), &[]).joints[0].peak_torque_nm, None);
}

#[test]
fn the_page_is_whole_and_needs_no_network() {
    let (info, samples) = run(10_530);
    let page = html(&ReportInput::new(&info, &Digest::of(&samples)));
    assert!(!page.contains("{{"), "a mark was left");
    assert!(page.len() < 5_000_000, "{} bytes", page.len());
    assert!(!page.contains("</script> & Co"), "a name ends the script");
    for outside in ["src=\"http", "href=\"http", "url(http", "@import", "fetch("] {
        assert!(!page.contains(outside), "{outside}");
    }
}

#[test]
fn an_hour_is_thinned_without_losing_its_peak() {
    let (info, mut samples) = run(400_000);
    samples[123_457].joints[2].position -= 0.05;
    let page = html(&ReportInput::new(&info, &Digest::of(&samples)));
    assert!(page.len() < 5_000_000, "{} bytes", page.len());
    let peak = Digest::of(&samples).curves.values(Curve::Error, 2).into_iter().fold(0.0, f64::max);
    assert!(peak > 49.0);
}

#[test]
fn a_run_without_samples_is_still_a_page() {
    let info = RecordingInfo::default();
    assert!(html(&ReportInput::new(&info, &Digest::new())).contains("</html>"));
    assert!(picture_svg(&ReportInput::new(&info, &Digest::new())).ends_with("</svg>\n"));
}

#[test]
fn the_picture_is_small() {
    let (info, samples) = run(10_530);
    let picture = picture_svg(&ReportInput::new(&info, &Digest::of(&samples)));
    assert!(picture.len() < 150_000, "{} bytes", picture.len());
    assert!(!picture.contains("NaN"));
}

/// Returns a run in which joint 3 stops answering at point 600.
fn silent_joint() -> (RecordingInfo, Vec<Sample>) {
    let (info, mut samples) = run(1000);
    for s in &mut samples[600..] {
        (s.state, s.trajectory, s.errors, s.can_current) =
            (ControllerState::Error.into(), TrajectoryState::Null.into(), 0x20, 1 << 10);
        s.joints[2] = JointSample { set_position: f64::NAN, ..JointSample::UNKNOWN };
    }
    (info, samples)
}

#[test]
fn a_failed_run_leads_with_what_broke_first() {
    let (info, samples) = silent_joint();
    let failure = RunFailure::find(&info, &samples).expect("it failed");
    assert_eq!((failure.joint.map(Joint::number), failure.at_ms.round()), (Some(3), 600.0));
    assert_eq!(failure.headline(), "FAILED 600 ms into the run: joint 3: does not answer");
    assert_eq!(failure.causes, ["joint 3: does not answer", "controller: internal CAN error"]);
    let times: Vec<f64> = failure.moments.iter().map(|m| m.time_ms.round()).collect();
    assert_eq!(times, [597.0, 598.0, 599.0, 600.0, 601.0, 602.0]);
    let (before, first) = (&failure.moments[2], &failure.moments[3]);
    assert!(before.position_rad.is_finite() && before.torque_limit_nm == 50.0 && before.errors.is_empty());
    assert!(first.first && first.position_rad.is_nan() && first.errors == ["does not answer"]);

    let page =
        html(&ReportInput { failure: Some(&failure), ..ReportInput::new(&info, &Digest::of(&samples)) });
    let headline = page.find("FAILED 600 ms into the run: joint 3: does not answer").expect("the headline");
    assert!(headline < page.find("class=\"hero\"").unwrap(), "it leads the page");
    assert!(page.contains("<title>FAILED: "), "the title reports it");
    assert!(page.contains("<td>–</td>"), "what is not measured is no number");
    let picture = picture_svg(&ReportInput {
        failure: Some(&failure),
        ..ReportInput::new(&info, &Digest::of(&samples))
    });
    assert!(picture.contains("FAILED") && !picture.contains("tracking error at most"), "{picture}");
    assert!(!picture.contains("NaN"));

    let (info, samples) = run(1000);
    assert_eq!(RunFailure::find(&info, &samples), None);
}

#[test]
fn a_run_without_its_own_error_says_why_it_ended() {
    let (info, samples) = run(1000);
    let failure = RunFailure::ended_by(&info, &samples, "the link was lost".into());
    assert_eq!(
        (failure.joint.map(Joint::number), failure.moments.len(), failure.at_ms.round()),
        (None, 24, 999.0)
    );
    assert_eq!(RunFailure::ended_by(&info, &[], "early".into()).moments, []);
}

#[test]
fn drives_name_their_own_faults() {
    let (info, samples) = silent_joint();
    let mut status =
        jtc_wire::Status { state: ControllerState::Error.into(), errors: 0x80, ..Default::default() };
    status.joints[4].mc_current = 4;
    let failure = RunFailure::find(&info, &samples).unwrap().with_status(&status);
    assert_eq!(failure.causes[0], "joint 5: under-voltage");
}

/// The status does not show which joint failed. The report finds the joint whose position step is impossible, and
/// shows the samples before this step.
#[test]
fn an_encoder_that_jumps_is_named_by_its_step() {
    let (mut info, mut samples) = run(1000);
    for joint in &mut info.joints {
        joint.velocity_max_rad_s = 3.0;
    }
    for s in &mut samples[600..] {
        (s.state, s.trajectory, s.errors) =
            (ControllerState::Error.into(), TrajectoryState::Null.into(), 0x20);
        s.joints[3].position += 0.4;
    }
    let failure = RunFailure::find(&info, &samples).unwrap();
    assert_eq!((failure.joint.map(Joint::number), failure.moments[0].time_ms.round()), (Some(4), 597.0));
    assert!(
        failure.causes[0].starts_with("joint 4: the measured position changed by "),
        "{:?}",
        failure.causes
    );

    for s in &mut samples[600..] {
        s.joints[3].position -= 0.4;
    }
    let failure = RunFailure::find(&info, &samples).unwrap();
    assert_eq!((failure.joint.map(Joint::number), failure.moments[0].time_ms.round()), (None, 597.0));
    let page =
        html(&ReportInput { failure: Some(&failure), ..ReportInput::new(&info, &Digest::of(&samples)) });
    assert!(!page.contains("marked line") && !page.contains("<tr class=\"first\">"));
}

#[test]
fn a_recording_without_its_end_is_no_success() {
    use crate::recording::Ending;
    let (info, mut samples) = run(1000);
    let of = |samples: &[Sample], outcome: &str, reason: &str| {
        RunFailure::of_recording(
            &info,
            samples,
            &Ending { outcome: outcome.into(), reason: reason.into(), ..Ending::default() },
        )
    };
    assert_eq!(of(&samples, "fault", "the link was lost").unwrap().causes, ["the link was lost"]);
    let unseen = of(&samples, "", "").expect("a failure");
    assert!(unseen.headline().starts_with("FAILED 999 ms") && unseen.causes[0].contains("was not recorded"));
    assert_eq!(of(&samples, "finished", ""), None);
    let last = samples.len() - 1;
    samples[last].trajectory = TrajectoryState::Stop.into();
    assert_eq!(of(&samples, "", ""), None);
    assert_eq!(of(&samples, "stopped", ""), None);
}

/// The page of a plan shows the commanded values and the limits that determine the speed. The measured values are
/// unknown.
#[test]
fn the_page_of_a_plan_has_its_torques_and_what_binds() {
    let arm = Arm::avena();
    let (config, friction) = (arm.config(), arm.friction());
    let planner = Planner { model: Some(&arm.model), friction: friction.as_ref(), ..Planner::new(&config) };
    let planned = planner.to(&[0.0; 6], &[0.5, 0.3, -0.4, 0.2, 0.6, -0.5]).unwrap();
    let (info, samples) = (RecordingInfo::of(&arm), planner.samples(&planned.trajectory));
    let summary = Summary::of(&info, &samples);
    for (of_page, of_check) in summary.joints.iter().zip(&planned.verdict.joints) {
        let (speed, torque) = (of_page.peak_velocity_rad_s.unwrap(), of_page.peak_torque_nm.unwrap());
        // The page uses only the trajectory points, and a lower bearing temperature than the check. Therefore its
        // values differ slightly from the values of the check.
        assert!((speed / of_check.velocity_peak_rad_s - 1.0).abs() < 0.05, "{of_page:?} {of_check:?}");
        let peak = of_check.torque_peak_nm.unwrap();
        assert!((0.95..1.5).contains(&(torque / peak)), "{of_page:?} {of_check:?}");
        assert_eq!((of_page.rms_error_mrad, of_page.peak_temperature_c), (None, None));
    }
    let page = |plan| html(&ReportInput { plan, ..ReportInput::new(&info, &Digest::of(&samples)) });
    let of_plan = page(Some(&planned.binding[..]));
    let first = serde_json::to_value(planned.binding[0]).unwrap().to_string();
    assert!(of_plan.contains(&format!("\"plan\":[{first}")), "{first}");
    assert!(of_plan.contains("\"set_acceleration_rad_s2\":[{"));
    let of_run = page(None);
    assert!(of_run.contains("\"plan\":null") && of_run.contains("\"set_acceleration_rad_s2\":null"));
}

/// For any motion of the joints, the picture is small and its axes are readable. The test includes joints that do not move, move very
/// little, are far from zero, or have no values.
#[test]
fn a_picture_is_small_whatever_the_joints_do() {
    type Lead = fn(f64) -> f64;
    let lead: [(&str, Lead); 11] = [
        ("zero", |_| 0.0),
        ("stands", |_| -0.7),
        ("by 1e-12", |t| 0.3 + 1e-12 * t),
        ("by 1e9", |t| 1e9 * t),
        ("at 1e6", |_| 1e6),
        ("at -1e6, moving", |t| -1e6 + t),
        ("at 1e17", |_| 1e17),
        ("at 1e300", |_| 1e300),
        ("no number", |_| f64::NAN),
        ("now and then infinite", |t| if t > 0.5 { f64::INFINITY } else { t }),
        ("from minus infinity", |t| if t < 0.5 { f64::NEG_INFINITY } else { -t }),
    ];
    for (name, position) in lead {
        for offset_s in [0.0, 1.7e9, 1e17] {
            let (info, mut samples) = run(1000);
            for sample in &mut samples {
                let at = position(sample.time_s);
                sample.time_s += offset_s;
                for joint in &mut sample.joints {
                    (joint.position, joint.set_position) = (at, at);
                }
            }
            let picture = picture_svg(&ReportInput::new(&info, &Digest::of(&samples)));
            let (lines, labels) = (picture.matches("class=\"g\"").count(), picture.matches("<text").count());
            assert!(lines <= 7 * 12 && labels < 110, "{name}: {lines} lines, {labels} labels");
            assert!(lines >= 6 * 2, "{name}: {lines} lines");
            assert!(picture.len() < 200_000, "{name}: {} bytes", picture.len());
            assert!(!picture.contains("NaN") && !picture.contains("inf"), "{name}");
        }
    }
}
