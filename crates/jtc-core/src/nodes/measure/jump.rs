//! Encoders that jump (J-35).
//!
//! A drive has two encoders: its position comes from the encoder of the joint, its speed from the encoder of the motor. The speed is the
//! mean over a window, so the distance that the position moves within that window follows from the speed. If a position moves further
//! within one answer, and stays there, this is not a motion: the encoder has jumped. The jump is subtracted from all further answers, so
//! that the arm does not move.
use jtc_wire::StopKind;

use super::Reading;
use super::history::{Answered, History};
use crate::DT;
use crate::config::Config;
use crate::remembered::remembered;

/// Number of answers for which a difference must be constant to be a jump.
const CONSTANT: u8 = 5;
/// Highest number of consecutive answers that may count as a jump, for any change of its size.
const LOOKS: u8 = 15;
/// Number of changes of a jump's size before the size stays: a size that changes more often comes from a gear that is twisted.
const CHANGES: u8 = 2;
/// Longest time between an answer and the one before it within which a jump can have come, ms.
const WITHIN_MS: u32 = 3;
/// Steps of the encoder that do not count.
const STEPS: f64 = 3.0;
/// Difference that does not count, rad, if [`STEPS`] configured steps of the encoder are less.
const LEAST: f64 = 2e-5;
/// Share of the way that does not count.
const SHARE: f64 = 0.1;
/// Multiple of the difference that does not count, which a jump must exceed: drives whose clocks drift against the controller's answer with
/// a reading that is one of their ticks older, or not, and two such slips are not a jump.
const SLIPS: f64 = 2.0;
/// From this share of its full scale on, a speed has no meaning.
const SATURATED: f64 = 0.98;

/// The jumps of an encoder.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Jumps {
    /// Jump that is subtracted from each answer, rad.
    taken_off: f64,
    /// Difference of the two encoders before the possible jump, rad.
    before: f32,
    /// Size of the possible jump, rad. After a finding: the size of the jump, or the factor: positions move this many times as fast as the
    /// speed says.
    value: f32,
    /// Number of answers with the possible jump.
    answers: u8,
    /// Number of consecutive answers that counted as a jump.
    looks: u8,
    /// Number of changes of its size meanwhile.
    changes: u8,
    /// Finding since the drive was configured.
    found: Option<StopKind>,
}

remembered!(Jumps { taken_off, before, value, answers, looks, changes, found });

/// Meaning of an answer that was not expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Seen {
    /// A motion, or nothing is known of it.
    Motion,
    /// Possibly a jump by this distance, rad. Until that is known, the answer counts as a jump.
    Perhaps(f64),
    /// A jump by this way, rad.
    Jump(f64),
}

/// Way of a joint within the window of its drive's speed, as measured and as that speed has it.
#[derive(Clone, Copy, Debug)]
pub(in crate::nodes) struct Ways {
    /// Way of the answered positions, rad.
    pub measured: f64,
    /// Way that the reported speed stands for, rad.
    pub reported: f64,
}

impl Ways {
    /// Returns the ways of an answer, and the position (rad) a window before it; `None` if the speed is beyond its scale.
    pub(super) fn of(answer: &Reading, from: f64, config: &Config) -> Option<Self> {
        if answer.velocity.abs() > SATURATED * config.velocity_full_scale {
            return None;
        }
        let window = f64::from(config.drive_speed_window_ms) * DT;
        Some(Self { measured: answer.position - from, reported: answer.velocity * window })
    }

    /// Returns the way that the speed does not explain, rad.
    pub fn unexplained(&self) -> f64 {
        self.measured - self.reported
    }

    /// Returns the unexplained way that does not count, rad.
    pub fn tolerance(&self, config: &Config) -> f64 {
        (STEPS * config.encoder_step).max(LEAST) + SHARE * self.reported.abs()
    }
}

impl Jumps {
    /// Returns the jump that is subtracted from each answer, rad.
    pub fn taken_off(&self) -> f64 {
        self.taken_off
    }

    /// Returns the finding since the drive was configured, with the size of a jump (rad) or the factor of a speed.
    pub fn found(&self) -> Option<(StopKind, f64)> {
        self.found.map(|kind| (kind, self.value.into()))
    }

    /// Returns `true` while it is not known if a possible jump is a jump.
    #[inline(always)]
    pub fn watching(&self) -> bool {
        self.answers > 0
    }

    /// Takes note of an answer that came as expected.
    #[inline(always)]
    pub fn as_expected(&mut self) {
        self.answers = 0;
    }

    /// Takes this way (rad) off each answer from now on.
    pub fn take_off(&mut self, way: f64) {
        self.taken_off += way;
        self.found = Some(StopKind::EncoderJump);
    }

    /// Stores that positions move `factor` times as fast as the speed says.
    pub fn find_factor(&mut self, factor: f32) {
        (self.value, self.answers) = (factor, 0);
        self.found = Some(StopKind::SpeedScale);
    }

    /// An answer came at `at_ms` that was not expected: `velocity` (rad/s) was reported in the one before it. `twist`: largest twist of the
    /// gear, rad. By less than that a joint that is struck gets away from its motor in some answers, and stays there.
    pub fn look(
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
            // The answer of then was lost: what is watched goes on to be.
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
            // The jump has come within this answer, or has become another one.
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
