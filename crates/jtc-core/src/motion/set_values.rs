//! Set-point computation (J-40 to J-44): for an arm that is held, for joints that come to rest, for the approach and
//! for the path.
use crate::bit_codec::bit_codec;
use crate::commanded::Commanded;
use crate::config::Config;
use crate::config::limits::JointConfig;
use crate::interpolation::SetPoint;
use crate::motion::catch::Catch;
use crate::motion::deceleration::{Deceleration, moves};
use crate::motion::jog::Jog;
use crate::nodes::Nodes;
use crate::trajectory::path::PathClock;
use crate::{DT, JOINTS};

/// Set values of the arm, including those of joints that have not come to rest yet. In HoldPos, [`hold`](Self::hold)
/// executes each tick. In Operate, [`approach`](Self::approach) and [`follow`](Self::follow) execute each tick.
#[derive(Clone, Debug, Default)]
pub(crate) struct SetValues {
    /// Set values of the present tick.
    pub point: SetPoint,
    /// Set values of the last ticks (J-62).
    pub commanded: Commanded,
    /// `true` if the joint is enabled and its set position is latched.
    pub(super) holding: [bool; JOINTS],
    /// `true` if the joint is marked as absent (J-53), so that the controller need not hold the joint.
    absent: [bool; JOINTS],
    /// `true` for each joint whose set values were restarted from its measured motion since the last tick.
    found_moving: [bool; JOINTS],
    /// State of the catch of each joint.
    pub(super) catch: [Catch; JOINTS],
    /// Deceleration of each joint that comes to rest.
    pub(super) deceleration: [Option<Deceleration>; JOINTS],
    /// `true` if the joints decelerate after a hand has moved the arm.
    led: bool,
    /// State of the present jog (J-58).
    jog: Option<Jog>,
}

bit_codec!(SetValues { point, commanded, holding, absent, found_moving, catch, deceleration, led, jog });

impl SetValues {
    /// Releases all joints, because the torque is off. The set positions are then equal to the measured positions.
    pub(crate) fn release(&mut self, nodes: &Nodes) {
        let Self { point, commanded, holding, absent, found_moving, catch, deceleration, led, jog } = self;
        *point = SetPoint::still(*nodes.positions());
        commanded.rest(nodes.positions());
        (*holding, *absent, *found_moving) = ([false; JOINTS], [false; JOINTS], [true; JOINTS]);
        *catch = [Catch::default(); JOINTS];
        *deceleration = [None; JOINTS];
        *led = false;
        *jog = None;
    }

    /// Restarts the set values at rest at `position`, so that any motion can follow.
    pub(crate) fn begin_at(&mut self, position: &[f64; JOINTS]) {
        self.commanded.rest(position);
        self.restart(position);
    }

    /// Restarts all set values at rest at `position`, except the set values of the last ticks.
    fn restart(&mut self, position: &[f64; JOINTS]) {
        self.point = SetPoint::still(*position);
        // J-63: a restart of the set values does not stop a joint. When the controller predicts missing answers, it
        // must therefore ignore the jump of the commanded velocity at this restart.
        self.found_moving = [true; JOINTS];
        self.deceleration = [None; JOINTS];
        self.led = false;
        self.jog = None;
    }

    /// Sets the set position to the measured position while a hand moves the arm.
    pub(crate) fn follow_measured(&mut self, nodes: &Nodes) {
        self.point = SetPoint::still(*nodes.positions());
        self.commanded.rest(nodes.positions());
    }

    /// Begins the next tick of the set values. Returns `true` for each joint whose set values were restarted in the
    /// last tick. Such a restart began at the measured motion, so it did not change the motion of the joint.
    pub(crate) fn next_tick(&mut self) -> [bool; JOINTS] {
        self.commanded.next_tick();
        core::mem::take(&mut self.found_moving)
    }

    /// Returns the set positions (rad) for the time of the measurement of this tick (J-62).
    pub(crate) fn due(&self, config: &Config) -> &[f64; JOINTS] {
        self.commanded.position(config.delay_ticks)
    }

    /// Sets the joint velocities (rad/s) and the highest joint accelerations (rad/s²) of the jog.
    pub(crate) fn jog(&mut self, wanted: &[f64; JOINTS], acceleration: &[f64; JOINTS], config: &Config) {
        let jog = self.jog.get_or_insert_with(Jog::begin);
        jog.command(wanted, acceleration, &self.point.position, config);
    }

    /// Begins a tick of a jog. Returns `true` if the jog begins to come to rest in this tick.
    pub(crate) fn jog_ends(&mut self) -> bool {
        self.jog.as_mut().is_some_and(Jog::ends)
    }

    /// Executes one tick of a jog. `ramp` advances the clock of the jog while its rate changes.
    pub(crate) fn jog_on(&mut self, config: &Config, ramp: impl FnOnce(&SetPoint, &mut PathClock)) {
        let Some(jog) = &mut self.jog else { return };
        jog.step(&mut self.point, config, ramp);
        if jog.rests() {
            self.jog = None;
        }
    }

    /// Brings the jogged joints to rest.
    pub(crate) fn end_jog(&mut self) {
        if let Some(jog) = &mut self.jog {
            jog.end();
        }
    }

    /// Ends the jog at once, even if joints still move.
    pub(crate) fn drop_jog(&mut self) {
        self.jog = None;
    }

    /// Returns `true` if the arm is jogged and has not begun to come to rest.
    pub(crate) fn jogs_on(&self) -> bool {
        self.jog.as_ref().is_some_and(Jog::goes_on)
    }

    /// Returns `true` from the start of a jog until the arm has come to rest.
    pub(crate) fn jogging(&self) -> bool {
        self.jog.is_some()
    }

    /// Returns `true` if a joint is jogged or decelerates.
    pub(crate) fn coming_to_rest(&self) -> bool {
        self.jog.is_some() || self.deceleration.iter().any(Option::is_some)
    }

    /// Begins to hold the arm at its measured position. An arm that still moves after hand guiding first comes to
    /// rest within `length_ms`. During this time, each joint is in a catch, as if it carried a falling load.
    pub(crate) fn hold_measured(&mut self, nodes: &Nodes, length_ms: f64, config: &Config) {
        let (from, velocity) = (nodes.positions(), nodes.velocities());
        if !velocity.iter().any(|&v| moves(v)) {
            self.begin_at(from);
            return;
        }
        self.restart(from);
        for j in 0..JOINTS {
            if self.holding[j] {
                let led = Deceleration::led(from[j], velocity[j], length_ms, &config.joints[j]);
                self.decelerate(j, led, config);
                self.led = true;
            } else {
                // This joint is not held. The joint gets its set position when it is enabled.
                self.commanded.begin(j, from[j], 0.0, 0);
            }
        }
        if self.led {
            self.catch = [Catch::begin(config); JOINTS];
        }
    }

    /// Returns `true` if the joints that a hand has moved have come to rest. A catch then begins, because a joint may
    /// swing after it has come to rest.
    pub(crate) fn led_to_rest(&mut self, config: &Config) -> bool {
        self.led = self.deceleration.iter().any(Option::is_some);
        if !self.led {
            self.catch = [Catch::begin(config); JOINTS];
        }
        !self.led
    }

    /// Returns `true` while the arm comes to rest after hand guiding.
    pub(crate) fn is_led(&self) -> bool {
        self.led
    }

    /// Brings a joint to rest from its measured position.
    fn decelerate(&mut self, j: usize, mut deceleration: Deceleration, config: &Config) {
        let (from, velocity) = deceleration.start();
        self.commanded.begin(j, from, velocity, config.delay_ticks);
        // J-62: the joint has moved further since its encoder was read, so the deceleration begins at the present
        // position.
        deceleration.shift(self.commanded.position(0)[j] - from);
        self.deceleration[j] = Some(deceleration);
        self.found_moving[j] = true;
    }

    /// Returns `true` for each joint that moves according to its set velocity or to its measured velocity.
    pub(crate) fn moving(&self, nodes: &Nodes) -> [bool; JOINTS] {
        core::array::from_fn(|j| moves(self.point.velocity[j]) || moves(nodes.velocities()[j]))
    }

    /// Sets the state as if every joint were enabled and its set position latched.
    #[cfg(test)]
    pub(crate) fn hold_for_test(&mut self) {
        self.holding = [true; JOINTS];
    }

    /// Moves the set position of a yielding joint to the `position` to which its spring pulls, rad. This change does
    /// not count as a motion.
    pub(crate) fn lead(&mut self, j: usize, position: f64) {
        (self.point.position[j], self.point.velocity[j], self.point.acceleration[j]) = (position, 0.0, 0.0);
        self.commanded.begin(j, position, 0.0, 0);
        self.deceleration[j] = None;
        self.found_moving[j] = true;
    }

    /// Returns `true` if the joint has come to rest, with a torque within its limit, at least once since it was
    /// enabled.
    pub(crate) fn settled(&self, joint: usize) -> bool {
        self.catch[joint].settled()
    }

    /// Returns `true` if every joint is enabled and held at rest, except absent joints.
    pub(crate) fn all_holding(&self) -> bool {
        self.jog.is_none()
            && self.deceleration.iter().all(Option::is_none)
            && self.holding.iter().zip(&self.absent).all(|(&holding, &absent)| holding | absent)
            && !self.catch.iter().any(Catch::busy)
    }

    /// Latches the set positions of joints that have just been enabled. A joint that moves is brought to rest. The
    /// set position of a joint that is not enabled is its measured position. Returns the joints that were already
    /// held, and the joints that have just been enabled.
    pub(crate) fn latch(&mut self, nodes: &Nodes, config: &Config) -> Latched {
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
                // Another joint was just enabled. If the load of that joint moves, it can also move the load of this
                // joint.
                self.catch[j] = Catch::begin(config);
            }
        }
        self.holding = enabled;
        Latched { held, just_enabled }
    }

    /// Executes one tick of the position hold in HoldPos.
    pub(crate) fn hold(&mut self, config: &Config) {
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

    /// Executes one tick on the path or during the approach. `at` contains the set values for full speed. The set
    /// values are scaled with the `rate` of path time and with its `slope` (1/s) (J-33).
    pub(crate) fn follow(&mut self, at: &SetPoint, rate: f64, slope: f64) {
        self.point.position = at.position;
        for j in 0..JOINTS {
            self.point.velocity[j] = at.velocity[j] * rate;
            self.point.acceleration[j] = at.acceleration[j] * rate * rate + at.velocity[j] * slope;
        }
    }

    /// During a catch, moves the set position of the joint towards its measured position. The distance corresponds to the torque above the
    /// limit (`excess`, N·m), but is at most the position error (`error`, rad). Returns this distance, rad.
    pub(crate) fn sag(&mut self, j: usize, excess: f64, kp: f64, error: f64, limits: &JointConfig) -> f64 {
        let step = self.catch[j].sag(excess, kp, error, limits);
        self.point.position[j] += step;
        self.commanded.shift(j, step);
        if let Some(deceleration) = &mut self.deceleration[j] {
            deceleration.shift(step);
        }
        step
    }
}

/// Returns the set values of the approach from a held position to a point at the fraction `u` (0..1) of `length_ms`. The approach is a
/// minimum-jerk (fifth-order) polynomial.
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

/// Result of [`SetValues::latch`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Latched {
    /// Joints that were already held and are still held.
    pub held: [bool; JOINTS],
    /// Joints that were latched in this tick.
    pub just_enabled: [bool; JOINTS],
}
