//! Set values (J-40 to J-44): of the held arm, of what comes to rest, of the approach and of the path.
use super::commanded::Commanded;
use crate::catch::Catch;
use crate::config::Config;
use crate::deceleration::{Deceleration, moves};
use crate::interpolation::SetPoint;
use crate::jog::Jog;
use crate::limits::JointConfig;
use crate::nodes::Nodes;
use crate::path::PathClock;
use crate::remembered::remembered;
use crate::{DT, JOINTS};

/// Where the arm is wanted, and what is not at rest there yet. HoldPos steps it by [`hold`](Self::hold), Operate by
/// [`approach`](Self::approach) and [`follow`](Self::follow).
#[derive(Clone, Debug, Default)]
pub(crate) struct SetValues {
    /// The set values of this tick.
    pub point: SetPoint,
    /// Those of the last ticks (J-62).
    pub commanded: Commanded,
    /// The joint is enabled and its set position latched.
    pub(super) holding: [bool; JOINTS],
    /// The joint is set absent (J-53): there is nothing to hold.
    absent: [bool; JOINTS],
    /// Joints whose set values began anew from where they were found since the last tick, in motion or at rest.
    found_moving: [bool; JOINTS],
    /// Joints whose load is being caught.
    pub(super) catch: [Catch; JOINTS],
    /// Joints that decelerate to rest.
    pub(super) deceleration: [Option<Deceleration>; JOINTS],
    /// They do so because a hand has led them.
    led: bool,
    /// The arm is jogged (J-58).
    jog: Option<Jog>,
}

remembered!(SetValues { point, commanded, holding, absent, found_moving, catch, deceleration, led, jog });

impl SetValues {
    /// Nothing is held; the set position is the measured one.
    pub fn release(&mut self, nodes: &Nodes) {
        let Self { point, commanded, holding, absent, found_moving, catch, deceleration, led, jog } = self;
        *point = SetPoint::still(*nodes.positions());
        commanded.rest(nodes.positions());
        (*holding, *absent, *found_moving) = ([false; JOINTS], [false; JOINTS], [true; JOINTS]);
        *catch = [Catch::default(); JOINTS];
        *deceleration = [None; JOINTS];
        *led = false;
        *jog = None;
    }

    /// Whatever comes next begins at rest at `position`.
    pub fn begin_at(&mut self, position: &[f64; JOINTS]) {
        self.point = SetPoint::still(*position);
        self.commanded.rest(position);
        // J-63: joints do not stop because the set values begin anew, least of all one that had not followed them.
        self.found_moving = [true; JOINTS];
        self.deceleration = [None; JOINTS];
        self.led = false;
        self.jog = None;
    }

    /// The arm is led: the set position is the measured one.
    pub fn follow_measured(&mut self, nodes: &Nodes) {
        self.point = SetPoint::still(*nodes.positions());
        self.commanded.rest(nodes.positions());
    }

    /// The next tick begins. Returns joints whose set values began anew in the last one, without a change of their motion: they were
    /// found in it.
    pub fn next_tick(&mut self) -> [bool; JOINTS] {
        self.commanded.next_tick();
        core::mem::take(&mut self.found_moving)
    }

    /// Positions (rad) that are due in the measurement of this tick (J-62).
    pub fn due(&self, config: &Config) -> &[f64; JOINTS] {
        self.commanded.position(config.delay_ticks)
    }

    /// Joint velocities to move at from now on, rad/s, and the highest accelerations, rad/s².
    pub fn jog(&mut self, wanted: &[f64; JOINTS], acceleration: &[f64; JOINTS], config: &Config) {
        let jog = self.jog.get_or_insert_with(Jog::begin);
        jog.command(wanted, acceleration, &self.point.position, config);
    }

    /// A tick of a jog begins. Returns whether it begins to come to rest with it.
    pub fn jog_ends(&mut self) -> bool {
        self.jog.as_mut().is_some_and(Jog::ends)
    }

    /// A tick of a jog; `ramp` takes its clock on from what is commanded.
    pub fn jog_on(&mut self, config: &Config, ramp: impl FnOnce(&SetPoint, &mut PathClock)) {
        let Some(jog) = &mut self.jog else { return };
        jog.step(&mut self.point, config, ramp);
        if jog.rests() {
            self.jog = None;
        }
    }

    /// What is jogged comes to rest.
    pub fn end_jog(&mut self) {
        if let Some(jog) = &mut self.jog {
            jog.end();
        }
    }

    /// The jog is over, whatever still moves.
    pub fn drop_jog(&mut self) {
        self.jog = None;
    }

    /// The arm is jogged, and does not come to rest.
    pub fn jogs_on(&self) -> bool {
        self.jog.as_ref().is_some_and(Jog::goes_on)
    }

    /// The arm is jogged, or has not come to rest since.
    pub fn jogging(&self) -> bool {
        self.jog.is_some()
    }

    /// A joint is jogged or decelerates.
    pub fn coming_to_rest(&self) -> bool {
        self.jog.is_some() || self.deceleration.iter().any(Option::is_some)
    }

    /// Begin to hold where the arm is. One that moves, because a hand has led it, comes to rest within `length_ms` first, and is caught like a
    /// falling load.
    pub fn hold_measured(&mut self, nodes: &Nodes, length_ms: f64, config: &Config) {
        let (from, velocity) = (nodes.positions(), nodes.velocities());
        self.begin_at(from);
        let moving = velocity.iter().any(|&v| moves(v));
        for j in 0..JOINTS {
            // Joints that are enabled later begin on their own.
            self.deceleration[j] = None;
            if moving && self.holding[j] {
                let led = Deceleration::led(from[j], velocity[j], length_ms, &config.joints[j]);
                self.decelerate(j, led, config);
                self.led = true;
            }
        }
        if self.led {
            self.catch = [Catch::begin(config); JOINTS];
        }
    }

    /// Whether what a hand has led has come to rest. From then on what swings may have to be caught like a load.
    pub fn led_to_rest(&mut self, config: &Config) -> bool {
        self.led = self.deceleration.iter().any(Option::is_some);
        if !self.led {
            self.catch = [Catch::begin(config); JOINTS];
        }
        !self.led
    }

    /// The arm comes to rest because a hand has led it.
    pub fn is_led(&self) -> bool {
        self.led
    }

    /// A joint comes to rest from where it was measured.
    fn decelerate(&mut self, j: usize, mut deceleration: Deceleration, config: &Config) {
        let (from, velocity) = deceleration.start();
        self.commanded.begin(j, from, velocity, config.delay_ticks);
        // J-62: it has gone on since.
        deceleration.shift(self.commanded.position(0)[j] - from);
        self.deceleration[j] = Some(deceleration);
        self.found_moving[j] = true;
    }

    /// Joints that move, by their set values or as measured.
    pub fn moving(&self, nodes: &Nodes) -> [bool; JOINTS] {
        core::array::from_fn(|j| moves(self.point.velocity[j]) || moves(nodes.velocities()[j]))
    }

    /// As if every joint were enabled and its position latched.
    #[cfg(test)]
    pub fn hold_for_test(&mut self) {
        self.holding = [true; JOINTS];
    }

    /// A joint that yields is where it is dragged to, rad: its set values are no motion.
    pub fn lead(&mut self, j: usize, position: f64) {
        (self.point.position[j], self.point.velocity[j], self.point.acceleration[j]) = (position, 0.0, 0.0);
        self.commanded.begin(j, position, 0.0, 0);
        self.deceleration[j] = None;
        self.found_moving[j] = true;
    }

    /// The joint has been at rest, within its torque limit, since it was enabled.
    pub fn settled(&self, joint: usize) -> bool {
        self.catch[joint].settled()
    }

    /// Every joint that is there is enabled and held at rest.
    pub fn all_holding(&self) -> bool {
        self.jog.is_none()
            && self.deceleration.iter().all(Option::is_none)
            && self.holding.iter().zip(&self.absent).all(|(&holding, &absent)| holding | absent)
            && !self.catch.iter().any(Catch::busy)
    }

    /// Latches the set position of joints that have just been enabled, and brings those to rest that move; joints that are
    /// not enabled are followed, without torque. Returns which joints were held before, and which have just been enabled.
    pub fn latch(&mut self, nodes: &Nodes, config: &Config) -> Latched {
        let (measured, velocity) = (nodes.positions(), nodes.velocities());
        let enabled = core::array::from_fn(|j| nodes.node(j).enabled());
        if self.holding == [true; JOINTS] && enabled == self.holding {
            return Latched { held: enabled, just_enabled: [false; JOINTS] };
        }
        self.absent = core::array::from_fn(|j| nodes.node(j).absent());
        let held = core::array::from_fn(|j| enabled[j] && self.holding[j]);
        let just_enabled: [bool; JOINTS] = core::array::from_fn(|j| enabled[j] && !self.holding[j]);
        let another = just_enabled.contains(&true);
        for j in 0..JOINTS {
            if !held[j] {
                self.point.position[j] = measured[j];
                self.commanded.begin(j, measured[j], 0.0, 0);
                self.catch[j] = if just_enabled[j] { Catch::begin(config) } else { Catch::default() };
                self.deceleration[j] = None;
                if just_enabled[j] && moves(velocity[j]) {
                    let falling = Deceleration::falling(measured[j], velocity[j], config, &config.joints[j]);
                    self.decelerate(j, falling, config);
                }
            } else if another {
                // Its load moves when that of another joint does.
                self.catch[j] = Catch::begin(config);
            }
        }
        self.holding = enabled;
        Latched { held, just_enabled }
    }

    /// A tick of HoldPos: the held position.
    pub fn hold(&mut self, config: &Config) {
        (self.point.velocity, self.point.acceleration) = ([0.0; JOINTS], [0.0; JOINTS]);
        for j in 0..JOINTS {
            let Some(deceleration) = &mut self.deceleration[j] else { continue };
            let ([position, velocity, acceleration], rests) = deceleration.step(&config.joints[j]);
            (self.point.position[j], self.point.velocity[j]) = (position, velocity);
            self.point.acceleration[j] = if self.led { acceleration } else { 0.0 };
            if rests {
                self.deceleration[j] = None;
            }
        }
    }

    /// A tick on the path or of the approach: full-speed values `at`, scaled by the rate of path time and its slope (1/s) (J-33).
    pub fn follow(&mut self, at: &SetPoint, rate: f64, slope: f64) {
        self.point.position = at.position;
        for j in 0..JOINTS {
            self.point.velocity[j] = at.velocity[j] * rate;
            self.point.acceleration[j] = at.acceleration[j] * rate * rate + at.velocity[j] * slope;
        }
    }

    /// The set position of a joint whose load is being caught moves on towards it, by as much as the torque is beyond the limit
    /// (`excess`, N·m) at a position error of `error` (rad). Returns by how much, rad.
    pub fn sag(&mut self, j: usize, excess: f64, kp: f64, error: f64, limits: &JointConfig) -> f64 {
        let step = self.catch[j].sag(excess, kp, error, limits);
        self.point.position[j] += step;
        self.commanded.shift(j, step);
        if let Some(deceleration) = &mut self.deceleration[j] {
            deceleration.shift(step);
        }
        step
    }
}

/// The approach from a held position to a point, at `u` (0..1) of `length_ms`: a minimum-jerk (fifth-order) polynomial.
pub(crate) fn approach(from: &[f64; JOINTS], to: &[f64; JOINTS], u: f64, length_ms: f64) -> SetPoint {
    let (rest, length) = (1.0 - u, length_ms * DT);
    let rise = u * u * u * (10.0 + u * (6.0 * u - 15.0));
    let speed = 30.0 * u * u * rest * rest / length;
    let curve = 60.0 * u * rest * (1.0 - 2.0 * u) / (length * length);
    let way: [f64; JOINTS] = core::array::from_fn(|j| to[j] - from[j]);
    SetPoint {
        position: core::array::from_fn(|j| from[j] + way[j] * rise),
        velocity: way.map(|way| way * speed),
        acceleration: way.map(|way| way * curve),
    }
}

/// What [`SetValues::latch`] found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Latched {
    /// Joints that go on being held.
    pub held: [bool; JOINTS],
    /// Joints that were latched in this tick.
    pub just_enabled: [bool; JOINTS],
}
