//! Measured position and velocity of a joint, and what stands for them while its answers are missing (J-35, J-63).
//!
//! Terms: an answer is *usable* when its position is one that the joint can have reached since the last usable one. A tick
//! without a usable answer takes the *prediction*: the last one, carried on at the rate at which the joint moved, and the
//! change of the commanded velocity since. The first usable answer after missing ones differs from the prediction by an
//! *offset*, which fades, so that neither the loss nor the return makes a step of position, nor of the derivative of its error.
//! The same holds when answers that had been late are overtaken by one in time: what came with the first is taken back by the last,
//! and the offsets of many do not add up.
//! The offset has no part in the prediction: what is predicted depends on answers and commands alone, so that the position loop
//! stays closed however often answers are lost.
mod history;

use crate::DT;
use crate::config::Config;
use crate::remembered::remembered;
use history::{Answered, History};

/// Speed, in velocity limits, that no joint has: what is further from the prediction than that counts as no answer (J-35).
const IMPLAUSIBLE: f64 = 3.0;
/// Distance from the prediction, as a share of the implausible distance, from which on an answer does not count for the rate:
/// the joint of an encoder that jumps has not moved.
const UNEXPECTED: f64 = 0.1;
/// Most that the rate carried on differs from the reported velocity, rad/s.
const DISAGREEMENT: f64 = 0.2;
/// Most that is carried on, in velocity limits.
const FASTEST: f64 = 1.2;
/// Double pole of a fading offset times the setting: a fifth is left when that is over, a fiftieth after twice as long.
const FADING: f64 = 3.0;
/// What is left of it when it ends, rad or rad/s.
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
    /// What the joint answered, if it did.
    pub answer: Option<Reading>,
    /// A Move asked for an answer.
    pub expected: bool,
    /// It is not the only answer of this tick: those before it were late.
    pub again: bool,
    /// Commanded velocity, rad/s.
    pub commanded: f64,
    /// Milliseconds since the last tick.
    pub elapsed_ms: u32,
    /// Velocity limit of the joint, rad/s.
    pub velocity_max: f64,
}

/// What is known of a joint's motion.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Measurement {
    /// What the control law uses.
    used: Reading,
    /// There is a last usable answer.
    known: bool,
    /// Milliseconds; it wraps around after 49 days, which the differences that are taken of it do not notice.
    clock_ms: u32,
    /// The last usable answer, its position carried on since.
    answer: Reading,
    /// When it came.
    answered_ms: u32,
    /// Commanded velocity then, rad/s.
    commanded: f64,
    /// Rate of the answered positions then, rad/s.
    rate: f64,
    /// That rate as far as the reported velocity bears it out, rad/s: what a prediction carries on.
    carried: f64,
    /// The last usable answers.
    history: History,
    /// An answer has been missing since the last usable one.
    missing: bool,
    /// Prediction less answer, as much as has not faded.
    position_offset: Fading,
    velocity_offset: Fading,
    /// Something of them is left.
    fading: bool,
}

/// An offset that fades without a step, nor one of its slope: a critically damped filter of second order. It goes on fading
/// whatever is added to it; where it began anew instead, it would never fade while every other answer is lost.
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
    missing,
    position_offset,
    velocity_offset,
    fading,
});

impl Fading {
    /// One tick.
    fn step(&mut self, elapsed_ms: u32, config: &Config) {
        let ms = f64::from(elapsed_ms);
        let pole = FADING / f64::from(config.blend_ms.max(1));
        let x = pole * ms;
        // 1/eˣ by its series, which is stable however long the tick was.
        let decay = 1.0 / (1.0 + x * (1.0 + x / 2.0 * (1.0 + x / 3.0)));
        let both = self.slope + pole * self.left;
        (self.left, self.slope) = ((self.left + both * ms) * decay, (self.slope - pole * both * ms) * decay);
        if self.left.abs() < FADED && self.slope.abs() < FADED {
            *self = Self::default();
        }
    }
}

impl Measurement {
    /// Position and velocity that the control law uses.
    pub fn used(&self) -> Reading {
        self.used
    }

    /// Speed of the joint, rad/s: its reported velocity or the rate of its positions, whichever is higher. Reported velocities are not
    /// trusted alone: their full scale depends on the drive (J-11).
    pub fn speed(&self) -> f64 {
        self.used.velocity.abs().max(self.rate.abs())
    }

    /// The next answer is taken as it is.
    pub fn forget(&mut self) {
        self.known = false;
    }

    /// What is commanded is from now on relative to this velocity, rad/s.
    pub fn go_on_moving(&mut self, commanded: f64) {
        self.commanded = commanded;
    }

    /// One tick; false when the answer is not usable, or there is none.
    pub fn step(&mut self, tick: &Tick, config: &Config) -> bool {
        let change = tick.commanded - self.commanded;
        self.clock_ms = self.clock_ms.wrapping_add(tick.elapsed_ms);
        self.answer.position += (self.carried + change) * (f64::from(tick.elapsed_ms) * DT);
        if self.fading {
            self.position_offset.step(tick.elapsed_ms, config);
            self.velocity_offset.step(tick.elapsed_ms, config);
            self.fading = [self.position_offset, self.velocity_offset] != [Fading::default(); 2];
        }

        let age_ms = self.clock_ms.wrapping_sub(self.answered_ms);
        let reach = (IMPLAUSIBLE * DT) * tick.velocity_max * f64::from(age_ms);
        let usable = tick
            .answer
            .filter(|answer| !self.known || (answer.position - self.answer.position).abs() <= reach);
        if let Some(answer) = usable {
            let off = self.answer.position - answer.position;
            if !self.known {
                *self = Self { known: true, ..Self::default() };
            } else if self.missing | tick.again {
                self.position_offset.left += off;
                self.velocity_offset.left += self.answer.velocity + change - answer.velocity;
                self.fading = true;
            }
            self.answer = answer;
            (self.answered_ms, self.commanded, self.missing) = (self.clock_ms, tick.commanded, false);
            self.take_rate(off.abs() <= UNEXPECTED * reach, tick.velocity_max);
        } else {
            self.missing |= tick.expected || tick.answer.is_some();
        }

        let change = tick.commanded - self.commanded;
        self.used = Reading {
            position: self.answer.position + self.position_offset.left,
            velocity: self.answer.velocity + change + self.velocity_offset.left,
        };
        usable.is_some()
    }

    /// The rate at an answer, since the youngest one that is old enough. It is of answers alone: a rate that came from
    /// predictions would carry itself on, whatever the joint does, while every other answer is lost. `as_predicted`: the answer
    /// was about where the motion so far had led.
    fn take_rate(&mut self, as_predicted: bool, velocity_max: f64) {
        let Reading { position, velocity } = self.answer;
        let answered = Answered { position, at_ms: self.clock_ms };
        let rate = self.history.rate_to(&answered);
        self.history.push(answered, as_predicted);
        self.rate = rate.map_or(0.0, |rate| rate.rad_s);
        // Where a joint has jumped on the way, its own report counts alone.
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
