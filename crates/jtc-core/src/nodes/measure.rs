//! Measured position and velocity of a joint, and their substitutes while its answers are missing (J-35, J-63).
//!
//! Terms: an answer is *usable* if the joint can have reached its position since the last usable answer. A tick without a usable answer
//! takes the *prediction*: the last usable answer, extrapolated at the rate at which the joint moved, plus the change of the commanded
//! velocity since. The first usable answer after missing ones differs from the prediction by an *offset*, which fades, so that neither the
//! loss nor the return makes a step of position, nor of the derivative of its error. A *late* answer ([`Lateness`]) belongs to the time at
//! which it was due: it is compared with the prediction for that time, and the prediction continues from it. A late answer that is close to
//! its prediction is used directly, like an answer in time. Offsets that fade in each tick would be a filter in the position loop, which
//! would make the loop swing. The offset has no part in the prediction: the prediction depends on answers and commands alone, so that the
//! position loop stays closed even if many answers are lost.
mod history;
mod jump;
mod lateness;

use core::f64::consts::{PI, TAU};

use jtc_wire::StopKind;

use crate::commanded::Commanded;
use crate::config::Config;
use crate::remembered::remembered;
use crate::{DT, JOINTS};
use history::{Answered, History};
pub(super) use jump::Ways;
use jump::{Jumps, Seen};
use lateness::Lateness;

/// Speed, in velocity limits, that no joint has: an answer that is further from the prediction than that counts as no answer (J-35).
const IMPLAUSIBLE: f64 = 3.0;
/// Distance from the prediction, as a share of the implausible distance, from which on an answer does not count for the rate:
/// the joint of an encoder that jumps has not moved.
const UNEXPECTED: f64 = 0.1;
/// Maximum difference of a late answer from its prediction, in steps of the encoder. Positions and their predicted rate have this
/// resolution.
const IN_ITS_PLACE: f64 = 2.0;
/// Coarsest encoder for which [`IN_ITS_PLACE`] counts, rad: an answer that is used without a correction may cause a step of this size.
const COARSEST: f64 = 1e-4;
/// Distance from the prediction, as a share of the implausible one, within which an answer must be after the jump of its encoder is
/// subtracted.
const NEAR: f64 = 0.5;
/// Highest difference between the rate carried on and the reported velocity, rad/s.
const DISAGREEMENT: f64 = 0.2;
/// Highest ratio of two deviations from the due velocity: that of the last 5 ms to that of the reported mean of 10 ms; with an even
/// acceleration it is 2.
const YOUNGER: f64 = 2.5;
/// Highest rate that is carried on, in velocity limits.
const FASTEST: f64 = 1.2;
/// Double pole of a fading offset times the setting: a fifth remains after that time, a fiftieth after twice that time.
const FADING: f64 = 3.0;
/// Remainder at which an offset ends, rad or rad/s.
const FADED: f64 = 1e-9;

/// Position and velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Reading {
    /// rad.
    pub position: f64,
    /// rad/s.
    pub velocity: f64,
}

/// The measurements of a joint in a tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tick {
    /// Answer of the joint, if it has arrived.
    pub answer: Option<Reading>,
    /// A Move requested an answer.
    pub expected: bool,
    /// That Move was acknowledged.
    pub asked: bool,
    /// Number of answers of this tick: those before the last were late.
    pub answers: u8,
    /// Commanded velocity, rad/s.
    pub commanded: f64,
    /// Milliseconds since the last tick.
    pub elapsed_ms: u32,
    /// Velocity limit of the joint, rad/s.
    pub velocity_max: f64,
    /// The drive is enabled.
    pub enabled: bool,
    /// Index of the joint.
    pub joint: usize,
}

/// Result of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// The answer is usable.
    Used,
    /// The answer is not usable, or is missing.
    Predicted,
    /// The answer is usable, and has shown that the encoder has jumped (J-35).
    Jumped,
}

/// An answer that is far from its expected position.
struct Unexpected {
    answer: Reading,
    /// Distance of the prediction beyond the answer, rad.
    off: f64,
    /// The implausible distance, rad.
    reach: f64,
    /// Time at which the answer was due, ms.
    at_ms: u32,
    /// The encoder may have jumped.
    looked_at: bool,
    /// Index of the joint.
    joint: usize,
}

/// A late answer, and the motion that was commanded since it was due.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Late {
    /// ms.
    pub ms: u32,
    /// Velocity that was commanded when it was due, rad/s.
    pub commanded: f64,
    /// Distance that was commanded since, rad.
    pub commanded_way: f64,
}

/// Known motion of a joint.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Measurement {
    /// Position and velocity that the control law uses.
    used: Reading,
    /// There is a last usable answer.
    known: bool,
    /// Time, ms. Wraps around after 49 days, which does not affect differences.
    clock_ms: u32,
    /// The last usable answer, its position carried on since.
    answer: Reading,
    /// Time at which the answer came.
    answered_ms: u32,
    /// Commanded velocity then, rad/s.
    commanded: f64,
    /// Rate of the answered positions then, rad/s.
    rate: f64,
    /// That rate as far as the reported velocity confirms it, rad/s: the rate that a prediction carries on.
    carried: f64,
    /// The last usable answers.
    history: History,
    /// Lateness of the answers.
    lateness: Lateness,
    /// Jumps of the encoder.
    jumps: Jumps,
    /// An answer has been missing since the last usable one.
    missing: bool,
    /// The part of prediction minus answer that has not faded.
    position_offset: Fading,
    velocity_offset: Fading,
    /// At least one of the offsets has not faded.
    fading: bool,
}

/// An offset that fades without a step, nor one of its slope: a critically damped filter of second order. The offset continues to fade when
/// more is added to it. If it restarted instead, it would never fade while every other answer is lost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Fading {
    /// rad or rad/s.
    left: f64,
    /// Change in a millisecond.
    slope: f64,
}

remembered!(Reading { position, velocity });
remembered!(Fading { left, slope });
remembered!(Measurement {
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
    /// Runs one tick.
    fn step(&mut self, elapsed_ms: u32, config: &Config) {
        let ms = f64::from(elapsed_ms);
        let pole = FADING / f64::from(config.blend_ms.max(1));
        let x = pole * ms;
        // 1/eˣ by its series, which is stable for any length of the tick.
        let decay = 1.0 / (1.0 + x * (1.0 + x / 2.0 * (1.0 + x / 3.0)));
        let both = self.slope + pole * self.left;
        (self.left, self.slope) = ((self.left + both * ms) * decay, (self.slope - pole * both * ms) * decay);
        if self.left.abs() < FADED && self.slope.abs() < FADED {
            *self = Self::default();
        }
    }

    /// Removes the part of the offset that is opposite to `by`.
    fn take_back(&mut self, by: f64) {
        let left = self.left + by;
        self.left = if self.left > 0.0 { left.max(0.0).min(self.left) } else { left.min(0.0).max(self.left) };
    }
}

/// Returns the distance from its prediction within which a late answer is in its place, rad.
fn place(config: &Config) -> f64 {
    config.encoder_step.min(COARSEST) * IN_ITS_PLACE
}

impl Late {
    /// Creates a late answer of this joint that is `ticks` late, as far back as the commanded motion is known.
    #[cold]
    pub fn new(ticks: u8, joint: usize, commanded: &Commanded, config: &Config) -> Self {
        let now = config.delay_ticks.max(1);
        let then = (now + ticks).min(Commanded::OLDEST);
        let of = |values: &[f64; JOINTS]| values.get(joint).copied().unwrap_or_default();
        Self {
            ms: (then - now).into(),
            commanded: of(commanded.velocity(then)),
            commanded_way: of(commanded.position(now)) - of(commanded.position(then)),
        }
    }

    /// Returns the distance that a joint has moved since, rad, if its rate was `carried` (rad/s) then.
    fn way(&self, carried: f64) -> f64 {
        self.commanded_way + (carried - self.commanded) * (f64::from(self.ms) * DT)
    }
}

impl Measurement {
    /// Returns the position and velocity that the control law uses.
    pub fn used(&self) -> Reading {
        self.used
    }

    /// Returns the speed of the joint, rad/s: its reported velocity or the rate of its positions, whichever is higher. Reported velocities
    /// are not trusted alone: their full scale depends on the drive (J-11).
    pub fn speed(&self) -> f64 {
        self.used.velocity.abs().max(self.rate.abs())
    }

    /// Returns the velocity over the last 5 ms, rad/s, which is younger than the reported one. This velocity differs from the `due`
    /// velocity (rad/s) in the same direction as the reported one, and not by much more. Otherwise an encoder has jumped, and the joint has
    /// not moved.
    pub fn young_velocity(&self, due: f64) -> f64 {
        // Without the part of an offset that still fades: that part is older still.
        let (young, reported) = (self.rate - due, self.used.velocity - self.velocity_offset.left - due);
        let most = YOUNGER * reported.abs();
        if young * reported > 0.0 { due + young.max(-most).min(most) } else { due }
    }

    /// Returns the jump of the encoder that is subtracted from an answer, rad.
    pub fn taken_off(&self) -> f64 {
        self.jumps.taken_off()
    }

    /// Returns the misfit of the two encoders since the drive was configured: a jump and its size (rad), or the factor of a speed.
    pub fn misfit(&self) -> Option<(StopKind, f64)> {
        self.jumps.found()
    }

    /// Stores that positions move `factor` times as fast as the speed says.
    pub fn find_factor(&mut self, factor: f32) {
        self.jumps.find_factor(factor);
    }

    /// Returns the ways of an answer of this tick; `None` without an answer, or if nothing is known of its ways.
    pub fn ways(&self, config: &Config) -> Option<Ways> {
        let window_ms = config.drive_speed_window_ms;
        let from = self.history.before(self.clock_ms, window_ms).filter(|_| window_ms > 0)?;
        let Answered { position, .. } = self.history.newest();
        Ways::of(&Reading { position, ..self.answer }, from, config)
    }

    /// Takes the next answer without a correction.
    pub fn forget(&mut self) {
        self.known = false;
    }

    /// Makes this velocity, rad/s, the reference of the commanded velocity from now on.
    pub fn go_on_moving(&mut self, commanded: f64) {
        self.commanded = commanded;
    }

    /// Runs one tick. The jump of the encoder is already taken off the answer. `past`: commanded motion since the given number of ticks
    /// ago.
    pub fn step(&mut self, tick: &Tick, past: impl Fn(u8) -> Late, config: &Config) -> Outcome {
        let change = tick.commanded - self.commanded;
        self.clock_ms = self.clock_ms.wrapping_add(tick.elapsed_ms);
        self.answer.position += (self.carried + change) * (f64::from(tick.elapsed_ms) * DT);
        if self.fading {
            self.position_offset.step(tick.elapsed_ms, config);
            self.velocity_offset.step(tick.elapsed_ms, config);
            self.fading = [self.position_offset, self.velocity_offset] != [Fading::default(); 2];
        }
        // Nearly always every answer is in time. The code for this case is compiled separately.
        if self.lateness.stands(tick.answers) {
            self.take(tick, None, config)
        } else {
            self.take_late(*tick, past, config)
        }
    }

    /// Runs the rest of a tick whose answer may be late. `tick` is a copy: with a `tick` in memory, every tick is slower.
    #[cold]
    #[inline(never)]
    fn take_late(&mut self, tick: Tick, past: impl Fn(u8) -> Late, config: &Config) -> Outcome {
        let counted = self.lateness.count(tick.asked, tick.answers, tick.elapsed_ms);
        // Younger than the last one: a frame that comes twice counts as evidence, too, and may have been counted wrongly.
        let since = self.clock_ms.wrapping_sub(self.answered_ms).saturating_sub(1);
        let ticks = if self.known { counted.min(since.min(u8::MAX.into()) as u8) } else { counted };
        let late = self.late(ticks, &tick, past, config);
        self.take(&tick, late, config)
    }

    /// Takes the answer of a tick, if the answer is usable. Inlined, because half of the code is not needed without a late answer.
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
            // While answers may be late, each may also be the first that is counted otherwise than those before.
            if known && (self.missing || late.is_some()) {
                let in_its_place = late.is_some() && off <= place(config);
                self.bridge(&predicted, tick.commanded, in_its_place);
            }
            // A suspected jump that was not a jump leaves a difference like a missing answer.
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
        // A position less its jump may be on the other side of the point at which the positions of the drive wrap around.
        let turn = if self.jumps.taken_off() == 0.0 || off.abs() <= PI { 0.0 } else { off.signum() * TAU };
        let (answer, off) = (Reading { position: answer.position + turn, ..answer }, off - turn);
        let seen = if off.abs() <= UNEXPECTED * reach || !looked_at {
            Seen::Motion
        } else {
            let torque_max = config.joints.get(joint).map_or(0.0, |limits| limits.torque_max);
            let twist = torque_max / config.gear_stiffness;
            self.jumps.look(&answer, self.answer.velocity, at_ms, twist, &self.history, config)
        };
        // Less the jump, the position must be near the prediction of the motion. Otherwise its speed is wrong, too.
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

    /// Bridges the difference between the answer of this tick and `predicted`, which must not be a step. An answer in its place makes no
    /// step; it reduces the remainder of earlier differences as far as it can, because they would add up otherwise.
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

    /// Returns the motion that was commanded since the answer of this tick was due: the counted `ticks` ago.
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
        // Fast joints show at once that an answer was lost: the answers after it are at the positions of answers that are less late.
        let Some(later) = (0..ticks).rev().find(|&ticks| in_its_place(&past(ticks))) else {
            return Some(counted);
        };
        self.lateness.lost(later);
        Some(past(later))
    }

    /// Takes the rate at an answer, since the youngest answer that is old enough. The rate comes from answers alone: a rate that came from
    /// predictions would carry itself on, for any motion of the joint, while every other answer is lost. `as_predicted`: the answer was
    /// close to the motion so far. Inlined for the sake of the ticks without a late answer.
    #[inline(always)]
    fn take_rate(&mut self, answer: &Reading, at_ms: u32, as_predicted: bool, velocity_max: f64) {
        let Reading { position, velocity } = *answer;
        let answered = Answered { position, at_ms };
        let rate = self.history.take(&answered, as_predicted);
        self.rate = rate.map_or(0.0, |rate| rate.rad_s);
        // If the encoder of the joint has jumped, only the report of the drive counts.
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
