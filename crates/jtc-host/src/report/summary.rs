//! Summary of a run, with tracking error and torque for each joint.

use serde::Serialize;

use crate::recording::RecordingInfo;
use crate::sample::{JointSample, Sample};

/// Values of one joint in the summary. A value is `None` if the source of the samples does not supply the value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointSummary {
    /// Name of the joint as in the arm file.
    pub name: String,
    /// Root mean square of the position error, mrad. The position error is the position that was commanded for the time of a measurement,
    /// minus the measured position (J-62).
    pub rms_error_mrad: Option<f64>,
    /// Largest magnitude of the position error, mrad.
    pub max_error_mrad: Option<f64>,
    /// Largest magnitude of the torque, N·m.
    pub peak_torque_nm: Option<f64>,
    /// Torque limit, N·m.
    pub torque_limit_nm: Option<f64>,
    /// Peak torque as a share of the limit, from 0 to 1.
    pub torque_share: Option<f64>,
    /// Largest magnitude of the speed, rad/s. The measured speed is used, or the commanded speed if no speed was measured.
    pub peak_velocity_rad_s: Option<f64>,
    /// Highest bearing temperature, °C.
    pub peak_temperature_c: Option<f64>,
}

/// Summary of a run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Time from the first to the last sample, s.
    pub recorded_s: f64,
    /// Duration of the execution, s.
    pub executed_s: f64,
    /// Number of samples that were used for the summary.
    pub samples: usize,
    /// Values of the joints, base to wrist.
    pub joints: Vec<JointSummary>,
}

impl Summary {
    /// Computes the summary from the samples of an execution. If the recording does not contain an execution, the function uses all
    /// samples.
    pub fn of(info: &RecordingInfo, samples: &[Sample]) -> Self {
        let mut figures = Figures::default();
        samples.iter().for_each(|sample| figures.push(sample));
        figures.summary(info)
    }

    /// Returns the joint with the largest value of `figure`, together with this value.
    pub fn worst(&self, figure: impl Fn(&JointSummary) -> Option<f64>) -> Option<(&JointSummary, f64)> {
        self.joints.iter().filter_map(|j| figure(j).map(|v| (j, v))).max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Summary data of streamed samples. The samples before an execution and the samples of the execution are summed separately.
#[derive(Clone, Debug, Default)]
pub(super) struct Figures {
    /// Times of the first and the last recorded sample.
    recorded: Option<(f64, f64)>,
    /// Sums over the samples before an execution. Without an execution, the sums include all samples.
    before: Sums,
    executed: Sums,
}

impl Figures {
    pub(super) fn push(&mut self, sample: &Sample) {
        self.recorded.get_or_insert((sample.time_s, sample.time_s)).1 = sample.time_s;
        if sample.is_operating() {
            self.executed.push(sample);
        } else if self.executed.samples == 0 {
            self.before.push(sample);
        }
    }

    pub(super) fn summary(&self, info: &RecordingInfo) -> Summary {
        let span = |times: Option<(f64, f64)>| times.map_or(0.0, |(first, last)| last - first);
        let any = self.executed.samples > 0;
        let counted = if any { &self.executed } else { &self.before };
        Summary {
            recorded_s: span(self.recorded),
            executed_s: span(self.executed.times),
            samples: counted.samples,
            joints: counted.joints.iter().enumerate().map(|(j, sums)| sums.summary(info, j)).collect(),
        }
    }
}

/// Sums over samples.
#[derive(Clone, Debug, Default)]
struct Sums {
    samples: usize,
    /// Times of the first and the last sample.
    times: Option<(f64, f64)>,
    joints: [JointSums; 6],
}

impl Sums {
    fn push(&mut self, sample: &Sample) {
        self.samples += 1;
        self.times.get_or_insert((sample.time_s, sample.time_s)).1 = sample.time_s;
        for (sums, joint) in self.joints.iter_mut().zip(&sample.joints) {
            sums.push(joint);
        }
    }
}

/// Highest known value.
#[derive(Clone, Copy, Debug, Default)]
struct Peak(Option<f64>);

impl Peak {
    fn push(&mut self, value: f64) {
        if value.is_finite() {
            self.0 = Some(self.0.map_or(value, |most| most.max(value)));
        }
    }
}

/// Sums over the samples of a joint.
#[derive(Clone, Copy, Debug, Default)]
struct JointSums {
    errors: u64,
    squares: f64,
    error: Peak,
    torque: Peak,
    velocity: Peak,
    set_velocity: Peak,
    temperature: Peak,
}

impl JointSums {
    fn push(&mut self, joint: &JointSample) {
        let error = joint.position_error();
        if error.is_finite() {
            let error = error * 1e3;
            self.errors += 1;
            self.squares += error * error;
            self.error.push(error.abs());
        }
        self.torque.push(joint.torque.abs());
        self.velocity.push(joint.velocity.abs());
        self.set_velocity.push(joint.set_velocity.abs());
        self.temperature.push(joint.temperature);
    }

    fn summary(&self, info: &RecordingInfo, j: usize) -> JointSummary {
        let limit = info.joints[j].torque_max_nm;
        let torque_limit_nm = (limit.is_finite() && limit > 0.0).then_some(limit);
        JointSummary {
            name: info.joint_name(j),
            rms_error_mrad: (self.errors > 0).then(|| (self.squares / self.errors as f64).sqrt()),
            max_error_mrad: self.error.0,
            peak_torque_nm: self.torque.0,
            torque_limit_nm,
            torque_share: self.torque.0.zip(torque_limit_nm).map(|(t, l)| t / l),
            peak_velocity_rad_s: self.velocity.0.or(self.set_velocity.0),
            peak_temperature_c: self.temperature.0,
        }
    }
}
