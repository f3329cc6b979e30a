//! Encoders that jump (J-35).
//!
//! A drive has two encoders: the joint's, which its position comes from, and the motor's, which its speed comes from. Its speed is the mean
//! over a window, so the way of the position within that window follows from it. A position that has gone further within one answer, and
//! stays there, is no motion: the encoder has jumped. What it has jumped by is taken off all further answers, so the arm does not move.
use jtc_wire::StopKind;

use super::Reading;
use super::history::{Answered, History};
use crate::DT;
use crate::config::Config;
use crate::remembered::remembered;

/// Answers for which a difference is constant when it is a jump.
const CONSTANT: u8 = 5;
/// Answers, one after the other, for which something may be taken for a jump, whatever its size becomes.
const LOOKS: u8 = 15;
/// How often the size of a jump changes before it stays: what changes more often is a gear that is twisted.
const CHANGES: u8 = 2;
/// Longest time between an answer and the one before it within which a jump can have come, ms.
const WITHIN_MS: u32 = 3;
/// Steps of the encoder that do not count.
const STEPS: f64 = 3.0;
/// What does not count where the encoder's step is given as less, rad.
const LEAST: f64 = 2e-5;
/// Share of the way that does not count.
const SHARE: f64 = 0.1;
/// A jump is so many times as large as what does not count: drives whose clocks drift against the controller's answer with a reading that
/// is one of their ticks older, or not, and two such slips are no jump.
const SLIPS: f64 = 2.0;
/// From this share of its full scale on a speed says nothing.
const SATURATED: f64 = 0.98;

/// The jumps of an encoder.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Jumps {
    /// What is taken off each answer, rad.
    taken_off: f64,
    /// Difference of the two encoders before what may be a jump, rad.
    before: f32,
    /// What may be a jump, rad; when something was found: the jump, or how many times as fast positions move as the speed says.
    value: f32,
    /// Answers that it has been there for.
    answers: u8,
    /// Answers that were taken for a jump, one after the other.
    looks: u8,
    /// How often its size has changed meanwhile.
    changes: u8,
    /// What was found since the drive was configured.
    found: Option<StopKind>,
}

remembered!(Jumps { taken_off, before, value, answers, looks, changes, found });

/// What an answer that was not expected is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Seen {
    /// A motion, or nothing is known of it.
    Motion,
    /// Perhaps a jump by this way, rad: until that is known, it is taken for one.
    Perhaps(f64),
    /// A jump by this way, rad.
    Jump(f64),
}

/// The way of a joint within the window of its drive's speed, and what that speed makes of it.
#[derive(Clone, Copy, Debug)]
pub(in crate::nodes) struct Ways {
    /// Way of the answered positions, rad.
    pub measured: f64,
    /// Way that the reported speed stands for, rad.
    pub reported: f64,
}

impl Ways {
    /// Of an answer, and the position (rad) a window before it; `None` where the speed is beyond its scale.
    pub(super) fn of(answer: &Reading, from: f64, config: &Config) -> Option<Self> {
        if answer.velocity.abs() > SATURATED * config.velocity_full_scale {
            return None;
        }
        let window = f64::from(config.drive_speed_window_ms) * DT;
        Some(Self { measured: answer.position - from, reported: answer.velocity * window })
    }

    /// What the speed does not explain, rad.
    pub fn unexplained(&self) -> f64 {
        self.measured - self.reported
    }

    /// As much of it does not count, rad.
    pub fn tolerance(&self, config: &Config) -> f64 {
        (STEPS * config.encoder_step).max(LEAST) + SHARE * self.reported.abs()
    }
}

impl Jumps {
    /// What is taken off each answer, rad.
    pub fn taken_off(&self) -> f64 {
        self.taken_off
    }

    /// What was found since the drive was configured, with a jump's size (rad) or a speed's factor.
    pub fn found(&self) -> Option<(StopKind, f64)> {
        self.found.map(|kind| (kind, self.value.into()))
    }

    /// It is not known yet whether it has jumped.
    #[inline(always)]
    pub fn watching(&self) -> bool {
        self.answers > 0
    }

    /// An answer came as expected.
    #[inline(always)]
    pub fn as_expected(&mut self) {
        self.answers = 0;
    }

    /// From now on this way (rad) is taken off each answer.
    pub fn take_off(&mut self, way: f64) {
        self.taken_off += way;
        self.found = Some(StopKind::EncoderJump);
    }

    /// Positions move `factor` times as fast as the speed says.
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
            // It has come within this answer, or become another one.
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
