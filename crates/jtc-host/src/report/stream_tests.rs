//! Tests that a report from streamed samples is equal to a report from all samples in memory, and that the memory use is bounded.

use super::curves::{Curve, Joined, POINTS_MAX, Runs};
use super::*;
use crate::Sample;
use crate::sample::JointSample;
use jtc_wire::{ControllerState, NodeState, TrajectoryState};
use proptest::prelude::*;

/// Returns a random sample, inside or outside an execution. The sample may contain unknown values and errors.
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

/// Returns samples with increasing times.
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

/// Computes the values of the summary from their definition, with all samples in memory.
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
        // The test compares text, because unknown values are NaN, and NaN is not equal to itself.
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

/// Returns the value of sample `i`: noise with isolated peaks.
fn noise(i: usize) -> f64 {
    let mixed = (i as u64 + 1)
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .rotate_left(29)
        .wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed >> 11) as f64 / (1_u64 << 53) as f64
}

/// The number of points of a curve is bounded for a recording of any length. Each point represents a piece of equal
/// length. The lowest and the highest value of a piece are stored in the order of their times. For a short recording,
/// the curve contains every sample.
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

/// Even if the state changes with every sample, the pieces of equal state need bounded memory, and no error is lost.
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
