//! Replay of a log through the controller.

use jtc_bus::{Answer, Scale};
use jtc_core::recorder::{Outcome, Record, RecordedInputs, Replay, Step, Unsure};
use jtc_core::{Config, Controller, JOINTS, POINTS_MAX};
use jtc_wire::{Code, RawPoint, Status};
use serde::Serialize;

use super::FlightLog;
use crate::sample::{JointSample, Sample};

/// Reliability of the values of a replayed tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Worth {
    /// The replayed tick is identical to the original tick, bit for bit.
    Same,
    /// The original controller computed different outputs in this tick.
    Differs,
    /// The tick was computed while an input was missing. Until the next snapshot, the computed values may differ from
    /// the original values, but the measured values are correct.
    Unsure,
    /// The tick was not computed, because the arm or the trajectory that the device used is missing. The tick
    /// contains only the measured values.
    Measured,
}

/// A replayed tick of a log.
#[derive(Clone, Debug)]
pub struct Tick {
    /// Number of ticks since the start of the device.
    pub tick: u64,
    /// Number of starts of the device.
    pub boots: u32,
    /// Computed and measured values of the tick.
    pub sample: Sample,
    /// Status that the controller would have reported in this tick, with the errors of the drives. This status contains
    /// only the fields that the replay can compute.
    pub status: Status,
    /// Inputs of the tick. `None` if the tick is a state that was read from a snapshot.
    pub inputs: Option<RecordedInputs>,
    /// Reliability of the values of the tick.
    pub worth: Worth,
}

/// Range of ticks that are missing in a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Gap {
    /// Last tick before the gap.
    pub after: u64,
    /// First tick after the gap.
    pub before: u64,
}

/// First replayed tick that differs from the log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Difference {
    /// Number of ticks since the start of the device.
    pub tick: u64,
    /// State of the controller in the replay.
    pub state: &'static str,
    /// Text with the outputs of the replay that differ from the log.
    pub replayed: String,
}

/// Log after its replay through the controller.
#[derive(Clone, Debug, Default)]
pub struct Replayed {
    /// Replayed ticks in order.
    pub ticks: Vec<Tick>,
    /// Configuration of a controller that uses the arm of the log.
    pub config: Option<Box<Config>>,
    /// Number of replayed ticks that equal the original ticks.
    pub same: usize,
    /// First tick that differs from the original tick.
    pub difference: Option<Difference>,
    /// Number of ticks that were computed while an input was missing.
    pub unsure: usize,
    /// Number of ticks that were recorded with an arm that differs from the arm used for the replay.
    pub other_arm: usize,
    /// Number of ticks during a motion along a trajectory that is not available.
    pub other_points: usize,
    /// Gaps in the log.
    pub gaps: Vec<Gap>,
    /// Hashes of the arms in the log that differ from the available arm.
    pub arms: Vec<u64>,
    /// `true` if the log contains a state that no controller can reach. The replay ends at this state.
    pub broken: bool,
}

impl FlightLog {
    /// Builds a controller with the arm `arm` and with the trajectory points of the log.
    fn controller(&self, arm: &[u8]) -> Controller<Vec<RawPoint>> {
        let mut controller = Controller::new(Config::avena(), vec![RawPoint::default(); POINTS_MAX]);
        controller.load_arm(arm);
        controller.put_points(self.first_point, &self.points);
        controller
    }

    /// Replays the log through the controller. `arm` is the image of an arm that is used instead of the arm in the log.
    pub fn replay(&self, arm: Option<&[u8]>) -> Replayed {
        let controller = self.controller(arm.unwrap_or(&self.arm));
        let points = (!self.points.is_empty()).then_some(self.points_hash);
        let mut replayed =
            Replayed { config: Some(Box::new(controller.config().clone())), ..Replayed::default() };
        let mut replay = Replay::new(self.log(), controller, points);
        let own = replay.arm();
        // A manipulated file may contain a state that no controller can reach, and the controller code then panics.
        // The panic is caught, and the replay ends at this state.
        let all = std::panic::AssertUnwindSafe(|| {
            while let Some(step) = replay.next() {
                let tick = tick(&step, &replay);
                replayed.take(&step, tick);
            }
        });
        let whole = std::panic::catch_unwind(all).is_ok();
        replayed.broken = !whole;
        for record in self.log() {
            if let Record::Snapshot(snapshot) = record
                && let Some(hash) = snapshot.origin.arm
                && Some(hash) != own
                && !replayed.arms.contains(&hash)
            {
                replayed.arms.push(hash);
            }
        }
        replayed
    }
}

impl Replayed {
    fn take(&mut self, step: &Step, tick: Tick) {
        match step.outcome {
            Outcome::Same => self.same += 1,
            Outcome::Differs => {}
            Outcome::Unsure(Unsure::Arm) => self.other_arm += 1,
            Outcome::Unsure(Unsure::Points) => self.other_points += 1,
            Outcome::Unsure(_) => self.unsure += 1,
        }
        if step.outcome == Outcome::Differs && self.difference.is_none() {
            self.difference = Some(difference(step));
        }
        if let Some(last) = self.ticks.last()
            && (tick.boots != last.boots || tick.tick != last.tick + 1)
        {
            self.gaps.push(Gap { after: last.tick, before: tick.tick });
        }
        self.ticks.push(tick);
    }

    /// Returns the samples of the ticks.
    pub fn samples(&self) -> Vec<Sample> {
        self.ticks.iter().map(|tick| tick.sample).collect()
    }
}

fn difference(step: &Step) -> Difference {
    let what = match (&step.outputs, step.telemetry.errors) {
        (None, _) => "another state of the controller".to_owned(),
        (Some(outputs), errors) => {
            let frame = outputs.bus.map_or("no frame".to_owned(), |frame| frame.to_string());
            format!("{frame}; errors {errors:#06x}, trajectory {}", step.telemetry.trajectory)
        }
    };
    Difference { tick: step.telemetry.tick, state: step.telemetry.state.name(), replayed: what }
}

fn tick(step: &Step, replay: &Replay<'_, Vec<RawPoint>>) -> Tick {
    let status = replay.controller().current_status();
    let worth = match step.outcome {
        Outcome::Same => Worth::Same,
        Outcome::Differs => Worth::Differs,
        Outcome::Unsure(Unsure::Arm | Unsure::Points) => Worth::Measured,
        Outcome::Unsure(_) => Worth::Unsure,
    };
    let mut sample = Sample { can_current: status.can_current, ..Sample::from(&step.telemetry) };
    if worth == Worth::Measured {
        sample = measured(&sample, step.inputs.as_ref(), replay.controller().config());
    }
    Tick { tick: step.telemetry.tick, boots: step.boots, sample, status, inputs: step.inputs, worth }
}

/// Returns the values that the drives reported in their answers.
fn measured(sample: &Sample, inputs: Option<&RecordedInputs>, config: &Config) -> Sample {
    let mut joints = [JointSample::UNKNOWN; JOINTS];
    let scale = Scale { velocity: config.velocity_full_scale };
    for frame in inputs.iter().flat_map(|inputs| inputs.bus()) {
        if let Ok(Answer::Joint { node, report }) = Answer::parse(&frame, scale)
            && let Some(joint) = joints.get_mut(usize::from(node))
        {
            *joint = JointSample {
                position: report.position,
                velocity: report.velocity,
                torque: report.torque,
                temperature: f64::from(report.temperature),
                state: report.state,
                ..JointSample::UNKNOWN
            };
        }
    }
    let unknown = u8::MAX;
    Sample { state: Code::new(unknown), trajectory: Code::new(unknown), errors: 0, joints, ..*sample }
}
