//! Detection of encoder jumps (J-35).
//!
//! A drive has two encoders. The position that the drive reports comes from the encoder of the joint, and the speed
//! comes from the encoder of the motor. The speed is the mean over a window of some milliseconds. From this speed,
//! the controller computes the expected change of the position within the window. If the position changes by more
//! than expected between two answers, and this difference lasts, the encoder of the joint has jumped. The joint
//! itself has not moved. The controller subtracts this jump from all further answers, so the arm does not move.
use jtc_wire::StopKind;

use super::Reading;
use super::history::{Answered, History};
use crate::DT;
use crate::bit_codec::bit_codec;
use crate::config::Config;

/// Number of answers in which a difference between the encoders must be constant before the difference counts as a jump.
const CONSTANT: u8 = 5;
/// Highest number of consecutive answers that the controller treats as a possible jump, even if the size of the jump
/// changes.
const LOOKS: u8 = 15;
/// Highest number of changes of the size of a possible jump. If the size changes more often, the controller attributes the difference to a
/// twisted gear.
const CHANGES: u8 = 2;
/// Longest time between two consecutive answers that the controller can compare to detect a jump, ms.
const WITHIN_MS: u32 = 3;
/// Difference between the encoders that is tolerated, in encoder steps.
const STEPS: f64 = 3.0;
/// Lower bound of the tolerated difference between the encoders, rad. The bound applies if [`STEPS`] encoder steps
/// are smaller.
const LEAST: f64 = 2e-5;
/// Additional tolerated difference between the encoders, as a fraction of the distance that corresponds to the
/// reported speed.
const SHARE: f64 = 0.1;
/// Size that a jump must exceed, as a multiple of the tolerated difference. The clocks of a drive and of the
/// controller drift against each other, so an answer may contain an encoder reading that is one drive tick too old.
/// Two such answers must not count as a jump.
const SLIPS: f64 = 2.0;
/// Share of the full scale above which the controller does not use a reported speed.
const SATURATED: f64 = 0.98;

/// State of the detection of jumps of an encoder.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Jumps {
    /// Jump that is subtracted from each answer, rad.
    taken_off: f64,
    /// Difference of the two encoders before the possible jump, rad.
    before: f32,
    /// Size of the possible jump, rad. After a fault was found, this field contains the value of the fault instead:
    /// the size of the jump (rad), or the ratio of the position rate to the reported speed.
    value: f32,
    /// Number of answers with the possible jump.
    answers: u8,
    /// Number of consecutive answers that were treated as a possible jump.
    looks: u8,
    /// Number of changes of the size of the possible jump.
    changes: u8,
    /// Fault that was found since the drive was configured.
    found: Option<StopKind>,
}

bit_codec!(Jumps { taken_off, before, value, answers, looks, changes, found });

/// Meaning of an unexpected answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Seen {
    /// The answer shows a motion, or cannot be classified.
    Motion,
    /// The answer possibly shows a jump by this distance, rad. Until the controller has decided whether this is a jump, it treats the
    /// answer as a jump.
    Perhaps(f64),
    /// The answer shows a jump by this distance, rad.
    Jump(f64),
}

/// Distances that a joint has moved within the window of its reported speed: the measured distance, and the distance
/// computed from this speed.
#[derive(Clone, Copy, Debug)]
pub(in crate::nodes) struct Ways {
    /// Distance between the answered positions, rad.
    pub measured: f64,
    /// Distance that corresponds to the reported speed, rad.
    pub reported: f64,
}

impl Ways {
    /// Returns the two distances for an answer and the position (rad) one window earlier. Returns `None` if the speed is close to its full
    /// scale.
    pub(super) fn of(answer: &Reading, from: f64, config: &Config) -> Option<Self> {
        if answer.velocity.abs() > SATURATED * config.velocity_full_scale {
            return None;
        }
        let window = f64::from(config.drive_speed_window_ms) * DT;
        Some(Self { measured: answer.position - from, reported: answer.velocity * window })
    }

    /// Returns the difference between the measured distance and the distance that corresponds to the reported speed,
    /// rad.
    pub(crate) fn unexplained(&self) -> f64 {
        self.measured - self.reported
    }

    /// Returns the largest difference of the two distances that is tolerated, rad.
    pub(crate) fn tolerance(&self, config: &Config) -> f64 {
        (STEPS * config.encoder_step).max(LEAST) + SHARE * self.reported.abs()
    }
}

impl Jumps {
    /// Returns the jump that is subtracted from each answer, rad.
    pub(super) fn taken_off(&self) -> f64 {
        self.taken_off
    }

    /// Returns the fault that was found since the drive was configured. The second element is the size of the jump
    /// (rad), or the ratio of the position rate to the reported speed.
    pub(super) fn found(&self) -> Option<(StopKind, f64)> {
        self.found.map(|kind| (kind, self.value.into()))
    }

    /// Returns `true` while a possible jump is neither confirmed nor rejected.
    #[inline(always)]
    pub(super) fn watching(&self) -> bool {
        self.answers > 0
    }

    /// Records that an answer was close to its prediction.
    #[inline(always)]
    pub(super) fn as_expected(&mut self) {
        self.answers = 0;
    }

    /// Starts to subtract this distance (rad) from each answer.
    pub(super) fn take_off(&mut self, way: f64) {
        self.taken_off += way;
        self.found = Some(StopKind::EncoderJump);
    }

    /// Records that the positions of the joint change `factor` times as fast as the reported speed.
    pub(super) fn find_factor(&mut self, factor: f32) {
        (self.value, self.answers) = (factor, 0);
        self.found = Some(StopKind::SpeedScale);
    }

    /// Evaluates an unexpected answer that was due at `at_ms`. `velocity` is the velocity in the previous answer,
    /// rad/s. `twist` is the largest possible twist of the gear, rad.
    ///
    /// If an object strikes a joint, the gear can twist within a few answers and stay twisted. The joint then has
    /// moved relative to its motor, by less than `twist`. This is a motion and not a jump.
    pub(super) fn look(
        &mut self,
        answer: &Reading,
        velocity: f64,
        at_ms: u32,
        twist: f64,
        history: &History,
        config: &Config,
    ) -> Seen {
        let watched = core::mem::take(&mut self.answers);
        self.looks = if watched == 0 { 0 } else { self.looks.saturating_add(1) };
        if config.drive_speed_window_ms == 0 || self.looks >= LOOKS {
            return Seen::Motion;
        }
        let ways = |answer: &Reading, at_ms: u32| {
            let from = history.at(at_ms.wrapping_sub(config.drive_speed_window_ms.into()))?;
            Ways::of(answer, from, config)
        };
        let Some(now) = ways(answer, at_ms) else {
            // The answer at the start of the window was lost. The present answer therefore neither confirms nor
            // rejects the possible jump.
            self.answers = watched;
            return if watched > 0 { Seen::Perhaps(self.value.into()) } else { Seen::Motion };
        };
        let tolerance = now.tolerance(config);
        let mut same = watched;
        if watched == 0 {
            let Answered { position, at_ms: last_ms } = history.newest();
            let before = if at_ms.wrapping_sub(last_ms) <= WITHIN_MS {
                ways(&Reading { position, velocity }, last_ms)
            } else {
                None
            };
            let Some(before) = before else { return Seen::Motion };
            (self.before, self.changes) = (before.unexplained() as f32, 0);
        }
        let size = now.unexplained() - f64::from(self.before);
        if watched == 0 || (size - f64::from(self.value)).abs() > tolerance {
            // A possible jump has begun with this answer, or the size of the possible jump has changed.
            (self.value, same) = (size as f32, 0);
            self.changes += u8::from(watched > 0);
            let twisted = self.changes > CHANGES || (self.changes > 0 && size.abs() <= twist);
            if size.abs() <= SLIPS * tolerance || twisted {
                return Seen::Motion;
            }
        }
        let way = f64::from(self.value);
        if same + 1 < CONSTANT {
            self.answers = same + 1;
            return Seen::Perhaps(way);
        }
        Seen::Jump(way)
    }
}

#[cfg(test)]
mod tests;
