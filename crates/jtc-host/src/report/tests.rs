//! The page is whole, offline and of bounded size; the figures are right.

use super::curves::{Curve, Joined, POINTS_MAX, Runs};
use super::*;
use crate::plan::Planner;
use crate::sample::JointSample;
use crate::{Arm, Sample};
use jtc_wire::{ControllerState, Joint, NodeState, TrajectoryState};
use proptest::prelude::*;

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
    samples[3].joints[0].position = 9.0; // before the execution: not counted
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

/// A run in which joint 3 falls silent at point 600.
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

/// The status names no joint: the one that went where no joint can go in the time is named, with the rows before.
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
    assert!(failure.causes[0].starts_with("joint 4: measured position went "), "{:?}", failure.causes);

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
    assert!(unseen.headline().starts_with("FAILED 999 ms") && unseen.causes[0].contains("was not seen"));
    assert_eq!(of(&samples, "finished", ""), None);
    let last = samples.len() - 1;
    samples[last].trajectory = TrajectoryState::Stop.into();
    assert_eq!(of(&samples, "", ""), None);
    assert_eq!(of(&samples, "stopped", ""), None);
}

/// A page of a plan shows what binds when, and figures of what is commanded: nothing of it was measured.
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
        // At the points alone, and colder than in the check before a run.
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

/// A sample as any source may give it: values that are not known, errors, executions that come and go.
fn any_sample() -> impl Strategy<Value = Sample> {
    let value = || prop_oneof![4 => -10.0..10.0, 1 => Just(f64::NAN), 1 => Just(0.0)];
    let joint = (prop::array::uniform12(value()), any::<bool>()).prop_map(|(v, fault)| JointSample {
        set_position: v[0],
        set_velocity: v[1],
        set_acceleration: v[2],
        position: v[3],
        error: v[4],
        velocity: v[5],
        torque_model: v[6],
        torque_p: v[7],
        torque_i: v[8],
        torque_d: v[8],
        torque_friction: v[9],
        torque: v[10],
        temperature: v[11],
        state: NodeState::ENABLED,
        internal: u16::from(fault),
    });
    let state = prop_oneof![
        Just((ControllerState::HoldPos, TrajectoryState::Stop)),
        Just((ControllerState::Operate, TrajectoryState::Execute)),
        Just((ControllerState::Operate, TrajectoryState::Pause)),
        Just((ControllerState::Error, TrajectoryState::Null)),
    ];
    let errors = prop_oneof![8 => Just(0_u16), 1 => Just(0x20)];
    (joint, state, errors, 0..3_u32).prop_map(|(joint, (state, trajectory), errors, point)| Sample {
        time_s: 0.0,
        state: state.into(),
        trajectory: trajectory.into(),
        point,
        errors,
        can_current: 0,
        joints: std::array::from_fn(|j| JointSample { position: joint.position + j as f64, ..joint }),
    })
}

/// Samples with times that go on.
fn any_samples(n: std::ops::Range<usize>) -> impl Strategy<Value = Vec<Sample>> {
    prop::collection::vec((any_sample(), 0.0..0.1), n).prop_map(|steps| {
        let mut time_s = 0.0;
        let at = |(sample, step): (Sample, f64)| {
            time_s += step;
            Sample { time_s, ..sample }
        };
        steps.into_iter().map(at).collect()
    })
}

/// The figures as their definition has them, over all samples at once.
fn by_definition(info: &RecordingInfo, samples: &[Sample]) -> Summary {
    let any = samples.iter().any(Sample::is_operating);
    let counted: Vec<&Sample> = samples.iter().filter(|s| !any || s.is_operating()).collect();
    let span = |all: &[&Sample]| all.last().zip(all.first()).map_or(0.0, |(l, f)| l.time_s - f.time_s);
    let joint = |j: usize| {
        let known = |value: fn(&JointSample) -> f64| -> Vec<f64> {
            counted.iter().map(|s| value(&s.joints[j])).filter(|v| v.is_finite()).collect()
        };
        let peak = |value: fn(&JointSample) -> f64| known(value).into_iter().reduce(f64::max);
        let errors = known(|joint| joint.position_error() * 1e3);
        let peak_torque_nm = peak(|joint| joint.torque.abs());
        let limit = Some(info.joints[j].torque_max_nm).filter(|limit| *limit > 0.0);
        JointSummary {
            name: info.joint_name(j),
            rms_error_mrad: (!errors.is_empty())
                .then(|| (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()),
            max_error_mrad: errors.iter().map(|e| e.abs()).reduce(f64::max),
            peak_torque_nm,
            torque_limit_nm: limit,
            torque_share: peak_torque_nm.zip(limit).map(|(torque, limit)| torque / limit),
            peak_velocity_rad_s: peak(|joint| joint.velocity.abs())
                .or_else(|| peak(|joint| joint.set_velocity.abs())),
            peak_temperature_c: peak(|joint| joint.temperature),
        }
    };
    Summary {
        recorded_s: span(&samples.iter().collect::<Vec<_>>()),
        executed_s: if any { span(&counted) } else { 0.0 },
        samples: counted.len(),
        joints: (0..6).map(joint).collect(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn figures_of_a_stream_are_those_of_all_samples_at_once(samples in any_samples(0..60)) {
        let mut info = RecordingInfo::default();
        info.joints[2].torque_max_nm = 40.0;
        prop_assert_eq!(Digest::of(&samples).summary(&info), by_definition(&info, &samples));
    }

    #[test]
    fn the_failure_in_a_stream_is_that_of_all_samples_at_once(
        samples in any_samples(0..40),
        outcome in prop_oneof![Just(""), Just("finished"), Just("fault")],
        clean in any::<bool>(),
    ) {
        let mut samples = samples;
        if clean {
            samples.retain(|s| s.errors == 0 && s.state != ControllerState::Error);
        }
        let info = RecordingInfo::default();
        let ending = crate::recording::Ending { outcome: outcome.into(), ..Default::default() };
        let (stream, all) =
            (Digest::of(&samples).failure(&info, &ending), RunFailure::of_recording(&info, &samples, &ending));
        // Values that are not known are equal, too.
        prop_assert_eq!(format!("{stream:?}"), format!("{all:?}"));
    }

    #[test]
    fn pieces_of_a_row_of_states_are_the_runs_of_equal_values(values in prop::collection::vec(0..3_u64, 1..200)) {
        let mut runs = Runs::new(Joined::Longer);
        values.iter().enumerate().for_each(|(i, value)| runs.push(i as f64, *value));
        let pieces: Vec<&[u64]> = values.chunk_by(|a, b| a == b).collect();
        prop_assert_eq!(runs.as_slice().len(), pieces.len());
        let mut from = 0;
        for ((from_s, to_s, value), piece) in runs.as_slice().iter().zip(pieces) {
            let to = (from + piece.len()).min(values.len() - 1);
            prop_assert_eq!((*from_s, *to_s, *value), (from as f64, to as f64, piece[0]));
            from += piece.len();
        }
    }
}

/// Noise with single peaks; the value of sample `i`.
fn noise(i: usize) -> f64 {
    let mixed = (i as u64 + 1)
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .rotate_left(29)
        .wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64
}

/// However long a recording is, its curves have no more points; each stands for a piece of equal length and has the lowest and the
/// highest value of it, in their order. A recording that is shorter is there with each of its samples.
#[test]
fn curves_are_bounded_and_hold_the_extremes_of_each_piece() {
    for n in [1, 2, 15_999, POINTS_MAX, POINTS_MAX + 1, 31_999, 32_000, 32_001, 100_003] {
        let mut digest = Digest::new();
        let value = |i: usize| if i % 7 == 3 { f64::NAN } else { noise(i) };
        for i in 0..n {
            let mut sample = Sample { time_s: i as f64, ..Sample::default() };
            sample.joints[4].torque = value(i);
            digest.push(&sample);
        }
        let (times, drawn) = (digest.curves.times(), digest.curves.values(Curve::Torque, 4));
        assert_eq!(times.len(), drawn.len());
        assert!(times.len() <= POINTS_MAX && times.len() == digest.curves.len(), "{n}: {}", times.len());
        assert!(times.len() >= n.min(POINTS_MAX / 2), "{n}: {}", times.len());
        assert!(times.is_sorted() && times.first() == Some(&0.0));
        let width = digest.curves.bucket();
        assert_eq!(width == 1, n <= POINTS_MAX);
        if width == 1 {
            assert!(drawn.iter().enumerate().all(|(i, v)| v.to_bits() == value(i).to_bits()));
            continue;
        }
        assert_eq!(times.last(), Some(&((n - 1) as f64)).filter(|_| n % width != 0).or(times.last()));
        for (k, two) in drawn.chunks(2).enumerate() {
            let piece: Vec<f64> =
                (k * width..n.min((k + 1) * width)).map(value).filter(|v| v.is_finite()).collect();
            let low = piece.iter().copied().reduce(f64::min).unwrap_or(f64::NAN);
            let high = piece.iter().copied().reduce(f64::max).unwrap_or(f64::NAN);
            let at = |wanted: f64| piece.iter().position(|v| *v == wanted);
            let expected = if at(low) <= at(high) { [low, high] } else { [high, low] };
            assert_eq!(
                two.iter().map(|v| v.to_bits()).collect::<Vec<_>>(),
                expected.map(f64::to_bits),
                "{n} {k}"
            );
            assert_eq!(times[2 * k], (k * width) as f64);
        }
    }
}

/// States that change with every sample fill no memory; of errors none is lost.
#[test]
fn rows_of_states_are_bounded_and_lose_no_error() {
    let (mut states, mut errors) = (Runs::new(Joined::Longer), Runs::new(Joined::Both));
    for i in 0..200_000_u64 {
        states.push(i as f64, i % 5);
        errors.push(i as f64, if i % 1000 == 17 { 1 << (i / 1000 % 16) } else { i % 2 * 0x8000 });
    }
    for runs in [&states, &errors] {
        let runs = runs.as_slice();
        assert!(runs.len() <= 16_385, "{}", runs.len());
        assert!(runs.windows(2).all(|two| two[0].1 == two[1].0), "they leave no gap");
        assert_eq!((runs.first().map(|r| r.0), runs.last().map(|r| r.1)), (Some(0.0), Some(199_999.0)));
    }
    for i in (0..200_000_u64).filter(|i| i % 1000 == 17) {
        let seen = errors.as_slice().iter().any(|(from, to, value)| {
            (*from..=*to).contains(&(i as f64)) && value & (1 << (i / 1000 % 16)) != 0
        });
        assert!(seen, "the error at {i}");
    }
}
