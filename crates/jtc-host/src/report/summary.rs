//! The figures of a run: tracking error and torque per joint.

use serde::Serialize;

use crate::recording::RecordingInfo;
use crate::sample::Sample;

/// Figures of one joint; `None` where the source does not know them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointSummary {
    /// As in the arm file.
    pub name: String,
    /// Root mean square of the position error, mrad: what was commanded for the time of a measurement minus that (J-62).
    pub rms_error_mrad: Option<f64>,
    /// Largest absolute error, mrad.
    pub max_error_mrad: Option<f64>,
    /// Largest absolute torque, N·m.
    pub peak_torque_nm: Option<f64>,
    /// The limit, N·m.
    pub torque_limit_nm: Option<f64>,
    /// Peak torque as a share of the limit, 0..1.
    pub torque_share: Option<f64>,
    /// Largest absolute speed, rad/s: measured, or commanded where nothing was measured.
    pub peak_velocity_rad_s: Option<f64>,
    /// Highest bearing temperature, °C.
    pub peak_temperature_c: Option<f64>,
}

/// Figures of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// From the first sample to the last, s.
    pub recorded_s: f64,
    /// While the trajectory was executed, s.
    pub executed_s: f64,
    /// Samples that the figures are made of.
    pub samples: usize,
    /// Base to wrist.
    pub joints: Vec<JointSummary>,
}

impl Summary {
    /// The figures over the samples in which a trajectory was executed, or over all when there is none.
    pub fn of(info: &RecordingInfo, samples: &[Sample]) -> Self {
        let executing = |s: &&Sample| s.is_operating();
        let any = samples.iter().any(|s| executing(&s));
        let counted: Vec<&Sample> = samples.iter().filter(|s| !any || executing(s)).collect();
        let span = |first: Option<f64>, last: Option<f64>| last.zip(first).map_or(0.0, |(l, f)| l - f);
        let joints = (0..6).map(|j| JointSummary::of(info, j, &counted)).collect();
        Self {
            recorded_s: span(samples.first().map(|s| s.time_s), samples.last().map(|s| s.time_s)),
            executed_s: if any {
                span(counted.first().map(|s| s.time_s), counted.last().map(|s| s.time_s))
            } else {
                0.0
            },
            samples: counted.len(),
            joints,
        }
    }

    /// The joint with the largest value of `figure`, and the value.
    pub fn worst(&self, figure: impl Fn(&JointSummary) -> Option<f64>) -> Option<(&JointSummary, f64)> {
        self.joints.iter().filter_map(|j| figure(j).map(|v| (j, v))).max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

impl JointSummary {
    fn of(info: &RecordingInfo, j: usize, samples: &[&Sample]) -> Self {
        let errors = || {
            let error = |s: &&Sample| s.joints[j].position_error();
            samples.iter().map(error).filter(|e| e.is_finite()).map(|e| e * 1e3)
        };
        let count = errors().count();
        let rms = (count > 0).then(|| (errors().map(|e| e * e).sum::<f64>() / count as f64).sqrt());
        let peak = |value: fn(&Sample, usize) -> f64| {
            let finite = samples.iter().map(|s| value(s, j)).filter(|v| v.is_finite());
            finite.reduce(f64::max)
        };
        let peak_torque_nm = peak(|s, j| s.joints[j].torque.abs());
        let limit = info.joints[j].torque_max_nm;
        let torque_limit_nm = (limit.is_finite() && limit > 0.0).then_some(limit);
        Self {
            name: info.joint_name(j),
            rms_error_mrad: rms,
            max_error_mrad: errors().map(f64::abs).reduce(f64::max),
            peak_torque_nm,
            torque_limit_nm,
            torque_share: peak_torque_nm.zip(torque_limit_nm).map(|(t, l)| t / l),
            peak_velocity_rad_s: peak(|s, j| s.joints[j].velocity.abs())
                .or_else(|| peak(|s, j| s.joints[j].set_velocity.abs())),
            peak_temperature_c: peak(|s, j| s.joints[j].temperature),
        }
    }
}
