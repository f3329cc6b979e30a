//! Measured position and velocity of a joint, and their prediction while its answers are missing (J-35, J-63).
//!
//! An answer is *usable* if the joint can have moved from the last usable answer to this position in the time between
//! both answers. In a tick without a usable answer, the controller uses the *prediction*: the last usable answer,
//! extrapolated with the rate of the joint, plus the change of its commanded velocity since that answer. The first
//! usable answer after missing answers differs from the prediction by an *offset*. The offset fades, so that missing
//! and returning answers do not cause a step of the position or of the derivative of the position error.
//!
//! A *late* answer ([`Lateness`]) belongs to the time at which it was due. The answer is compared with the prediction
//! for that time, and the new prediction starts from it. A late answer that is close to its prediction is used
//! directly, like an answer that arrives on time. If it caused a fading offset in each tick, the offset would act as a
//! filter in the position loop, and the loop would oscillate.
//!
//! The offset is not a part of the prediction. The prediction depends only on answers and commands, so the position
//! loop stays closed even if many answers are lost.
mod history;
mod jump;
mod lateness;

use core::f64::consts::{PI, TAU};

use jtc_wire::StopKind;

use crate::bit_codec::bit_codec;
use crate::commanded::Commanded;
use crate::config::Config;
use crate::{DT, JOINTS};
use history::{Answered, History};
pub(super) use jump::Ways;
use jump::{Jumps, Seen};
use lateness::Lateness;

/// Speed that a joint cannot reach, as a multiple of its velocity limit. The *implausible distance* is the distance at
/// this speed in the time since the last usable answer. An answer is not usable if it is farther from its prediction
/// (J-35).
const IMPLAUSIBLE: f64 = 3.0;
/// Largest distance from the prediction, as a share of the implausible distance, at which an answer is used to
/// compute the rate of the joint. A larger distance can come from a jump of the encoder.
const UNEXPECTED: f64 = 0.1;
/// Largest distance between a late answer and its prediction at which the answer is used directly, in encoder steps.
/// The limit is more than one step, because positions and predicted rates have only the resolution of the encoder.
const IN_ITS_PLACE: f64 = 2.0;
/// Largest encoder step for [`IN_ITS_PLACE`], rad. With a coarser encoder, an answer that is used directly could
/// cause a larger position step than this.
const COARSEST: f64 = 1e-4;
/// Largest distance from the prediction at which a corrected answer is used, as a share of the implausible distance.
/// A corrected answer is an answer from which an encoder jump was subtracted.
const NEAR: f64 = 0.5;
/// Highest difference between the predicted rate of a joint and its reported velocity, rad/s.
const DISAGREEMENT: f64 = 0.2;
/// Limit of the velocity over the last 5 ms, relative to the reported velocity, which is a mean over 10 ms. Both are
/// compared with the due velocity. The first deviation may be at most this multiple of the second. At a constant
/// acceleration, it is twice the second.
const YOUNGER: f64 = 2.5;
/// Highest rate of a joint in a prediction, as a multiple of the velocity limit.
const FASTEST: f64 = 1.2;
/// Product of the double pole of the filter for a fading offset and the configured time. With this value, a fifth of
/// the offset remains after the configured time, and a fiftieth after twice this time.
const FADING: f64 = 3.0;
/// Magnitude below which an offset is set to zero, rad or rad/s.
const FADED: f64 = 1e-9;

/// Position and velocity of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Reading {
    /// Position, rad.
    pub position: f64,
    /// Velocity, rad/s.
    pub velocity: f64,
}

/// Measurements of one joint in one tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tick {
    /// Answer of the joint, if an answer has arrived in this tick.
    pub answer: Option<Reading>,
    /// `true` if a Move requested an answer in this tick.
    pub expected: bool,
    /// `true` if the bus acknowledged the Move that requested this answer.
    pub asked: bool,
    /// Number of answers in this tick. All answers except the last one were late.
    pub answers: u8,
    /// Commanded velocity of the joint, rad/s.
    pub commanded: f64,
    /// Time since the last tick, ms.
    pub elapsed_ms: u32,
    /// Velocity limit of the joint, rad/s.
    pub velocity_max: f64,
    /// `true` if the drive is enabled.
    pub enabled: bool,
    /// Index of the joint.
    pub joint: usize,
}

/// Result of one tick for one joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// The answer is usable, and the control law uses it.
    Used,
    /// The answer is not usable or is missing, so the control law uses the prediction.
    Predicted,
    /// The answer is usable, and it shows that the encoder has jumped (J-35).
    Jumped,
}

/// Answer that is far from its predicted position.
struct Unexpected {
    answer: Reading,
    /// Predicted position minus answered position, rad.
    off: f64,
    /// Implausible distance of this answer, rad. See [`IMPLAUSIBLE`].
    reach: f64,
    /// Time at which the answer was due, ms.
    at_ms: u32,
    /// `true` if the answer must be checked for a jump of the encoder.
    looked_at: bool,
    /// Index of the joint.
    joint: usize,
}

/// Data about a late answer: its lateness, and the motion that was commanded since the answer was due.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Late {
    /// Lateness of the answer, ms.
    pub ms: u32,
    /// Velocity that was commanded when the answer was due, rad/s.
    pub commanded: f64,
    /// Distance that was commanded since the answer was due, rad.
    pub commanded_way: f64,
}

/// State of the measurement of a joint.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Measurement {
    /// Position and velocity that the control law uses.
    used: Reading,
    /// `true` if at least one usable answer has arrived.
    known: bool,
    /// Time of the measurement, ms. The clock overflows after 49 days, which does not affect time differences.
    clock_ms: u32,
    /// Last usable answer, with its position extrapolated to the present tick.
    answer: Reading,
    /// Time to which the last usable answer belongs, ms.
    answered_ms: u32,
    /// Velocity that was commanded at the time of the last usable answer, rad/s.
    commanded: f64,
    /// Rate at which the positions in the answers changed at the time of the last usable answer, rad/s.
    rate: f64,
    /// Rate that the prediction uses, rad/s. The rate is limited to values near the reported velocity.
    carried: f64,
    /// Last usable answers of the joint.
    history: History,
    /// Lateness of the answers.
    lateness: Lateness,
    /// State of the detection of encoder jumps.
    jumps: Jumps,
    /// `true` if at least one answer is missing since the last usable answer.
    missing: bool,
    /// Remainder of the position difference between prediction and answer that has not faded yet. `velocity_offset`
    /// is the same for the velocity.
    position_offset: Fading,
    velocity_offset: Fading,
    /// `true` if at least one offset has not faded yet.
    fading: bool,
}

/// Offset that fades without a step of its value or slope, like a critically damped filter of second order. When a
/// further difference is added, the fading continues from its present state. If the fading restarted instead, the
/// offset would never fade while every second answer is lost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Fading {
    /// Remainder of the offset, rad or rad/s.
    left: f64,
    /// Change of the offset per millisecond.
    slope: f64,
}

bit_codec!(Reading { position, velocity });
bit_codec!(Fading { left, slope });
bit_codec!(Measurement {
    used,
    known,
    clock_ms,
    answer,
    answered_ms,
    commanded,
    rate,
    carried,
    history,
    lateness,
    jumps,
    missing,
    position_offset,
    velocity_offset,
    fading,
});

impl Fading {
    /// Executes one tick, in which the offset fades.
    fn step(&mut self, elapsed_ms: u32, config: &Config) {
        let ms = f64::from(elapsed_ms);
        let pole = FADING / f64::from(config.blend_ms.max(1));
        let x = pole * ms;
        // 1/eˣ is computed from the series of eˣ. The result is stable for any length of the tick.
        let decay = 1.0 / (1.0 + x * (1.0 + x / 2.0 * (1.0 + x / 3.0)));
        let both = self.slope + pole * self.left;
        (self.left, self.slope) = ((self.left + both * ms) * decay, (self.slope - pole * both * ms) * decay);
        if self.left.abs() < FADED && self.slope.abs() < FADED {
            *self = Self::default();
        }
    }

    /// Reduces the offset by `by` if the signs are opposite. The offset does not change its sign.
    fn take_back(&mut self, by: f64) {
        let left = self.left + by;
        self.left = if self.left > 0.0 { left.max(0.0).min(self.left) } else { left.min(0.0).max(self.left) };
    }
}

/// Returns the highest distance between a late answer and its prediction at which the controller uses the answer directly, rad.
fn place(config: &Config) -> f64 {
    config.encoder_step.min(COARSEST) * IN_ITS_PLACE
}

impl Late {
    /// Creates the data of an answer of this joint that is `ticks` late. The lateness is limited to the ticks for which the commanded
    /// motion is stored.
    #[cold]
    pub(super) fn new(ticks: u8, joint: usize, commanded: &Commanded, config: &Config) -> Self {
        let now = config.delay_ticks.max(1);
        let then = (now + ticks).min(Commanded::OLDEST);
        let of = |values: &[f64; JOINTS]| values.get(joint).copied().unwrap_or_default();
        Self {
            ms: (then - now).into(),
            commanded: of(commanded.velocity(then)),
            commanded_way: of(commanded.position(now)) - of(commanded.position(then)),
        }
    }

    /// Returns the distance that the joint has moved since the answer was due, rad, for a rate of `carried` (rad/s) at that time.
    fn way(&self, carried: f64) -> f64 {
        self.commanded_way + (carried - self.commanded) * (f64::from(self.ms) * DT)
    }
}

impl Measurement {
    /// Returns the position and velocity that the control law uses.
    pub(super) fn used(&self) -> Reading {
        self.used
    }

    /// Returns the highest known speed of the joint, rad/s: the reported velocity or the rate of the positions. The
    /// reported velocity alone is not sufficient, because its full scale depends on the drive (J-11).
    pub(super) fn speed(&self) -> f64 {
        self.used.velocity.abs().max(self.rate.abs())
    }

    /// Returns the velocity over the last 5 ms, rad/s, which is more recent than the reported velocity. Its
    /// difference from the `due` velocity (rad/s) is limited to [`YOUNGER`] times the difference between the reported
    /// and the `due` velocity.
    ///
    /// If the two differences have opposite signs, the encoder has jumped while the joint did not move. The function
    /// then returns the `due` velocity.
    pub(super) fn young_velocity(&self, due: f64) -> f64 {
        // The reported velocity includes the remainder of a fading offset, which is older than the measurement. This
        // remainder is subtracted.
        let (young, reported) = (self.rate - due, self.used.velocity - self.velocity_offset.left - due);
        let most = YOUNGER * reported.abs();
        if young * reported > 0.0 { due + young.max(-most).min(most) } else { due }
    }

    #[cfg(test)]
    pub(super) fn move_at(&mut self, velocity: f64) {
        (self.rate, self.used.velocity) = (velocity, velocity);
    }

    /// Returns the jump of the encoder that is subtracted from each answer, rad.
    pub(super) fn taken_off(&self) -> f64 {
        self.jumps.taken_off()
    }

    /// Returns the disagreement of the two encoders of the joint since its drive was configured. The second element
    /// is the size of an encoder jump (rad), or the ratio of the speed from the positions to the reported speed.
    pub(super) fn misfit(&self) -> Option<(StopKind, f64)> {
        self.jumps.found()
    }

    /// Records that the positions of the joint change `factor` times as fast as the reported speed.
    pub(super) fn find_factor(&mut self, factor: f32) {
        self.jumps.find_factor(factor);
    }

    /// Returns two distances of the joint over the window in which the drive averages its speed: one from the
    /// positions, and one from the reported speed. Returns `None` if the distances are not known.
    pub(super) fn ways(&self, config: &Config) -> Option<Ways> {
        let window_ms = config.drive_speed_window_ms;
        let from = self.history.before(self.clock_ms, window_ms).filter(|_| window_ms > 0)?;
        let Answered { position, .. } = self.history.newest();
        Ways::of(&Reading { position, ..self.answer }, from, config)
    }

    /// Discards the prediction, so that the controller uses the next answer without a correction.
    pub(super) fn forget(&mut self) {
        self.known = false;
    }

    /// Sets the velocity (rad/s) from which changes of the commanded velocity are counted.
    pub(super) fn go_on_moving(&mut self, commanded: f64) {
        self.commanded = commanded;
    }

    /// Executes one tick of the measurement. A known jump of the encoder has already been subtracted from the answer
    /// in `tick`. For a number of ticks, `past` returns the motion that was commanded in these last ticks.
    pub(super) fn step(&mut self, tick: &Tick, past: impl Fn(u8) -> Late, config: &Config) -> Outcome {
        let change = tick.commanded - self.commanded;
        self.clock_ms = self.clock_ms.wrapping_add(tick.elapsed_ms);
        self.answer.position += (self.carried + change) * (f64::from(tick.elapsed_ms) * DT);
        if self.fading {
            self.position_offset.step(tick.elapsed_ms, config);
            self.velocity_offset.step(tick.elapsed_ms, config);
            self.fading = [self.position_offset, self.velocity_offset] != [Fading::default(); 2];
        }
        // Answers are rarely late. The code for late answers is a separate function, so that the normal tick stays
        // short.
        if self.lateness.stands(tick.answers) {
            self.take(tick, None, config)
        } else {
            self.take_late(*tick, past, config)
        }
    }

    /// Executes the remaining steps of a tick whose answer may be late. `tick` is passed by value. A reference would
    /// keep the value in memory and slow down every call of the normal path.
    #[cold]
    #[inline(never)]
    fn take_late(&mut self, tick: Tick, past: impl Fn(u8) -> Late, config: &Config) -> Outcome {
        let counted = self.lateness.count(tick.asked, tick.answers, tick.elapsed_ms);
        // An answer cannot be older than the answer before it, which limits its lateness. The counted lateness can be
        // wrong, because a repeated frame also counts as a late answer.
        let since = self.clock_ms.wrapping_sub(self.answered_ms).saturating_sub(1);
        let ticks = if self.known { counted.min(since.min(u8::MAX.into()) as u8) } else { counted };
        let late = self.late(ticks, &tick, past, config);
        self.take(&tick, late, config)
    }

    /// Uses the answer of a tick if it is usable. The function is inlined: if no answer is late, the compiler can then
    /// remove half of its code.
    #[inline(always)]
    fn take(&mut self, tick: &Tick, late: Option<Late>, config: &Config) -> Outcome {
        let change = tick.commanded - self.commanded;
        let predicted = Reading { velocity: self.answer.velocity + change, ..self.answer };
        let at_ms = self.clock_ms.wrapping_sub(late.map_or(0, |late| late.ms));
        let age_ms = at_ms.wrapping_sub(self.answered_ms);
        let reach = (IMPLAUSIBLE * DT) * tick.velocity_max * f64::from(age_ms);
        // Distance that the joint has moved since a late answer was due.
        let since = |carried: f64| late.map_or(0.0, |late| late.way(carried));
        let way = since(self.carried);
        let off_of = |answer: &Reading| predicted.position - (answer.position + way);
        let known = self.known;
        let (usable, off, outcome) = match tick.answer {
            None => (None, 0.0, Outcome::Predicted),
            Some(answer) => {
                let off = off_of(&answer);
                if !known || off.abs() <= UNEXPECTED * reach {
                    self.jumps.as_expected();
                    (tick.answer, off.abs(), Outcome::Used)
                } else {
                    let looked_at = tick.enabled && late.is_none_or(|late| late.ms == 0);
                    let unexpected = Unexpected { answer, off, reach, at_ms, looked_at, joint: tick.joint };
                    let (usable, outcome) = self.unexpected(unexpected, config);
                    (usable, usable.map_or(off, |usable| off_of(&usable)).abs(), outcome)
                }
            }
        };
        if let Some(answer) = usable {
            if !known {
                let Self { clock_ms, lateness, jumps, .. } = *self;
                let history = History::of(&Answered { position: answer.position, at_ms });
                *self = Self { known: true, clock_ms, lateness, jumps, history, ..Self::default() };
            }
            self.take_rate(&answer, at_ms, off <= UNEXPECTED * reach, tick.velocity_max);
            self.answer = Reading { position: answer.position + since(self.carried), ..answer };
            self.answered_ms = at_ms;
            self.commanded = late.map_or(tick.commanded, |late| late.commanded);
            // After missing or late answers, this answer can differ from the prediction. The difference becomes an
            // offset that fades, so that it causes no step.
            if known && (self.missing || late.is_some()) {
                let in_its_place = late.is_some() && off <= place(config);
                self.bridge(&predicted, tick.commanded, in_its_place);
            }
            // While a suspected jump is not confirmed, the joint is treated as if an answer were missing. A
            // difference between the next answer and the prediction then becomes a fading offset.
            self.missing = self.jumps.watching();
        } else {
            self.missing |= tick.expected || tick.answer.is_some();
        }

        let change = tick.commanded - self.commanded;
        self.used = Reading {
            position: self.answer.position + self.position_offset.left,
            velocity: self.answer.velocity + change + self.velocity_offset.left,
        };
        outcome
    }

    /// Decides how to use an answer that is far from its expected position.
    #[cold]
    #[inline(never)]
    fn unexpected(&mut self, unexpected: Unexpected, config: &Config) -> (Option<Reading>, Outcome) {
        let Unexpected { answer, off, reach, at_ms, looked_at, joint } = unexpected;
        // The positions of a drive wrap around at ±π. When the jump of the encoder is subtracted from a position, the
        // result may be beyond this point, so a full turn is added or subtracted.
        let turn = if self.jumps.taken_off() == 0.0 || off.abs() <= PI { 0.0 } else { off.signum() * TAU };
        let (answer, off) = (Reading { position: answer.position + turn, ..answer }, off - turn);
        let seen = if off.abs() <= UNEXPECTED * reach || !looked_at {
            Seen::Motion
        } else {
            let torque_max = config.joints.get(joint).map_or(0.0, |limits| limits.torque_max);
            let twist = torque_max / config.gear_stiffness;
            self.jumps.look(&answer, self.answer.velocity, at_ms, twist, &self.history, config)
        };
        // After the jump is subtracted, the position must be near the predicted position. If it is not, the reported
        // speed is wrong too, and the jump is not confirmed.
        let near = |way: f64| (off + way).abs() <= NEAR * reach;
        let without = |way: f64| Some(Reading { position: answer.position - way, ..answer });
        match seen {
            Seen::Perhaps(way) if near(way) => (without(way), Outcome::Used),
            Seen::Jump(way) if near(way) => {
                self.jumps.take_off(way);
                (without(way), Outcome::Jumped)
            }
            _ => {
                self.jumps.as_expected();
                if off.abs() <= reach { (Some(answer), Outcome::Used) } else { (None, Outcome::Predicted) }
            }
        }
    }

    /// Turns the difference between the answer of this tick and `predicted` into an offset that fades, so that the
    /// difference does not cause a step.
    ///
    /// An answer close to its prediction (`in_its_place`) causes no step, so it adds no offset. Such an answer reduces
    /// the remaining offset of earlier differences, which would otherwise add up.
    #[inline(always)]
    fn bridge(&mut self, predicted: &Reading, commanded: f64, in_its_place: bool) {
        let position = predicted.position - self.answer.position;
        let velocity = predicted.velocity - (self.answer.velocity + (commanded - self.commanded));
        if in_its_place {
            self.position_offset.take_back(position);
            self.velocity_offset.take_back(velocity);
        } else {
            self.position_offset.left += position;
            self.velocity_offset.left += velocity;
            self.fading = true;
        }
    }

    /// Returns the motion that was commanded since the answer of this tick was due. `ticks` is the counted lateness of the answer.
    fn late(&mut self, ticks: u8, tick: &Tick, past: impl Fn(u8) -> Late, config: &Config) -> Option<Late> {
        let answer = tick.answer?;
        let counted = past(ticks);
        let in_its_place = |late: &Late| {
            let off = self.answer.position - (answer.position + late.way(self.carried));
            off.abs() <= place(config)
        };
        if !self.known || in_its_place(&counted) {
            return Some(counted);
        }
        // A lost answer may have been counted as a late answer, so that the counted lateness is too high. For a fast
        // joint, the positions show this at once, because they match the prediction for a lower lateness.
        let Some(later) = (0..ticks).rev().find(|&ticks| in_its_place(&past(ticks))) else {
            return Some(counted);
        };
        self.lateness.lost(later);
        Some(past(later))
    }

    /// Computes the rate of the joint from this answer and the most recent answer that is old enough. `as_predicted`
    /// is `true` if the answer was close to its prediction.
    ///
    /// Predictions are not used. While every second answer is lost, a rate from predictions would never be corrected.
    /// The function is inlined, so that ticks without a late answer need less code.
    #[inline(always)]
    fn take_rate(&mut self, answer: &Reading, at_ms: u32, as_predicted: bool, velocity_max: f64) {
        let Reading { position, velocity } = *answer;
        let answered = Answered { position, at_ms };
        let rate = self.history.take(&answered, as_predicted);
        self.rate = rate.map_or(0.0, |rate| rate.rad_s);
        // If the encoder of the joint has jumped, the prediction uses only the velocity that the drive reports.
        let carried = match rate {
            Some(rate) if as_predicted && rate.as_predicted => rate.rad_s,
            _ => velocity,
        };
        let most = FASTEST * velocity_max;
        self.carried = carried.max(velocity - DISAGREEMENT).min(velocity + DISAGREEMENT).max(-most).min(most);
    }
}

#[cfg(test)]
mod tests;
