//! A joint that yields to a push (J-68), or lowers a load that its torque limit does not hold (J-70).
//!
//! The position controller answers a push with the whole torque limit within a few milliradians: the joint clamps whatever it met, and
//! the limit is all it has. A joint that yields has a weak spring instead, whose other end is dragged along, and a damper. So it follows
//! a hand with a share of its torque limit, and stops a shove with all of it. The model and the load that the integral had found go on
//! carrying the arm meanwhile.
//!
//! A joint that lowers a load has no spring: the damper alone lets the load sink slowly, at any torque within the limit. What the damper
//! needs for that becomes part of the load, so a load that the limit does hold comes to rest.
use crate::limits::{JointConfig, within};
use crate::pid::PidTorque;
use crate::remembered::remembered;
use crate::soft_end;
use crate::{DT, JOINTS};

/// Longest stretch of the spring, rad.
const STRETCH: f64 = 0.02;
/// Natural frequency that the spring has with the inertia of the joint at most, 1/s.
pub(crate) const SPRING_RATE: f64 = 30.0;
/// Rate at which the damper of a load that is lowered reduces a speed, 1/s; of several, shared among them. Joints that are held move each
/// other at the frequencies that a late speed leaves unstable, so the inertia that a joint feels is a third of that with the others fixed.
const LOWERING_RATE: f64 = 40.0;
/// Part of the way to its value that the damper and the spring go in a tick.
const SETTLES: f64 = 0.2;
/// The same of the brake.
const BRAKE_SETTLES: f64 = 0.5;
/// Highest rate at which a damper reduces a speed, 1/s. Measured speeds are about 8 ms old, because the drives average them: a damper above
/// 200 1/s would drive a joint to and fro, and joints that move each other lower that bound.
const DAMPING_RATE: f64 = 100.0;
/// Speeds, in velocity limits, from which on a joint is braked where its damper does less, and at which that takes the whole torque limit; the
/// same where it lowers a load. The rate at which the brake reduces a speed is bounded, too, 1/s: positions are about 4 ms old.
const BRAKES: (f64, f64) = (0.2, 0.8);
const BRAKES_LOWERED: (f64, f64) = (0.4, 1.0);
const BRAKE_RATE: f64 = 250.0;
/// A joint swings that turns round twice, each within so many ms, from more than that (rad/s), the second time from more than this share of the
/// first. Each time it does all is softer by the first factor, and at most by the second. After the first time (ms) without a swing it is
/// harder again by a step, and by another after each of the second.
const SWINGS_MS: u8 = 80;
const SWINGS: f32 = 0.15;
const LASTING: f32 = 0.5;
const HARDENS_MS: (u16, u16) = (300, 100);
const SOFTER: f32 = 0.5;
const SOFTEST: f32 = 0.2;
/// Speed below which a joint that yields is calm, rad/s.
const CALM: f64 = 0.05;
/// Speed below which a load that is lowered is at rest, rad/s.
const AT_REST: f64 = 0.02;
/// How long a joint has to be calm until it is held again, and for how long its load may seem to drive it meanwhile, ms.
const CALM_MS: u16 = 200;
const DRIVEN_CALM_MS: u16 = 50;
/// Share of the torque limit by which gravity must load a joint before its motion counts as sinking.
const LOADED: f64 = 0.05;
/// Way (rad) and time (ms) of sinking after which the joint is taken for overloaded.
const SINKS: (f64, u16) = (0.5, 3_000);
/// Time constant with which the load takes over the torque of the damper, s.
const LEARNS_S: f64 = 0.5;
/// What spring and damper have against a joint that its own load drives, as a share of that load; the rest is friction. A load that has driven
/// the joint for so long (ms) is not there: somebody had leaned on the arm. It goes with the first time constant (s), and comes back with the
/// second where the joint sinks without it.
const DRIVEN: (f64, f64) = (0.5, 1.2);
/// The same from this speed on, rad/s.
const CREEPS: f64 = 0.002;
const DRIVEN_MS: u16 = 300;
const GOES_S: f64 = 1.0;
const COMES_BACK_S: f64 = 0.3;
/// Share of the torque limit up to which a lowered load is held by the position controller again: its encoder noise needs the rest.
const HOLDABLE: f64 = 0.95;
/// Missing answers after which the spring does not act.
const MISSING: u8 = 2;
/// Yields of a joint, while one of the arm comes within [`AGAIN_MS`] of the one before, of which the last one goes on until the host clears it.
const TIMES: u8 = 3;
/// See [`TIMES`].
const AGAIN_MS: u16 = 10_000;

/// A joint that yields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Yield {
    /// It lowers a load: there is no spring (J-70).
    lowers: bool,
    /// It goes on until the host clears it.
    stays: bool,
    /// Position that the spring pulls to, rad.
    set: f64,
    /// Inertia that the joint moves, kg·m²: a lower bound.
    inertia: f64,
    /// Torque of the load that the model lacks, N·m, and what it was at the begin, or at that of lowering: it is never taken back beyond that.
    load: f64,
    least: f64,
    /// How long the load has driven the joint, ms.
    driven_ms: u16,
    /// N·m·s/rad.
    damping: f64,
    /// Share of the brake that acts, and of the spring.
    braking: f64,
    grip: f64,
    swing: Swing,
    /// The position controller can hold what the joint carries; or the host has decided that it is to.
    holdable: bool,
    cleared: bool,
    calm_ms: u16,
    /// Answers of the joint that are missing now.
    missing: u8,
    /// Way (rad) and time (ms) in the direction in which gravity pulls.
    sunk: f64,
    sinks_ms: u16,
}

remembered!(Yield {
    lowers,
    stays,
    set,
    inertia,
    load,
    least,
    driven_ms,
    damping,
    braking,
    grip,
    swing,
    holdable,
    cleared,
    calm_ms,
    missing,
    sunk,
    sinks_ms,
});

/// What a yielding joint is given in a tick.
pub(crate) struct Joint<'a> {
    /// Measured position, rad.
    pub position: f64,
    /// Measured velocity, rad/s.
    pub velocity: f64,
    /// Velocity of the last 5 ms, rad/s.
    pub young_velocity: f64,
    /// All were measured for this tick.
    pub fresh: bool,
    /// Torque of the model, N·m.
    pub model: f64,
    pub limits: &'a JointConfig,
    /// Lowest and highest position, rad.
    pub range: (f64, f64),
    /// Most that spring and damper add for a slow push, as a share of the torque limit.
    pub share: f64,
    /// Joints that lower their loads, this one among them.
    pub lowering: u8,
}

impl Yield {
    /// The joint yields from now on; `set`: the position that it was commanded to, rad; `load`: torque that the model lacks, N·m.
    pub fn begin(lowers: bool, stays: bool, set: f64, inertia: f64, load: f64) -> Self {
        Self {
            lowers,
            stays,
            set,
            inertia,
            load,
            least: load,
            driven_ms: 0,
            damping: 0.0,
            braking: 0.0,
            grip: 1.0,
            swing: Swing::NONE,
            holdable: true,
            cleared: false,
            calm_ms: 0,
            missing: 0,
            sunk: 0.0,
            sinks_ms: 0,
        }
    }

    /// Drags the end of the spring along with a joint at `position` (rad). Returns where it is then.
    pub fn drag(&mut self, position: f64) -> f64 {
        self.set = self.set.max(position - STRETCH).min(position + STRETCH);
        self.set
    }

    /// The joint has been calm for long enough, but the host has to end this.
    pub fn is_calm(&self) -> bool {
        self.calm_ms >= CALM_MS
    }

    /// The position controller holds the joint again.
    pub fn is_over(&self) -> bool {
        self.is_calm() && (self.holdable || self.cleared) && !self.stays
    }

    /// The host ends it; it goes on until the joint is calm.
    pub fn clear(&mut self) {
        (self.stays, self.cleared) = (false, true);
    }

    /// The joint lowers a load.
    pub fn lowers(&self) -> bool {
        self.lowers
    }

    /// From now on the joint lowers its load. What the spring had of it, N·m, is part of that.
    pub fn lower(&mut self, spring: f64) {
        (self.lowers, self.calm_ms) = (true, 0);
        self.load += spring;
        self.least = self.load;
    }

    /// The load has turned out to be another one than was found.
    pub fn has_learned(&self) -> bool {
        self.lowers || self.load != self.least
    }

    /// What the position controller has to carry when it takes over, N·m: what the `spring` (N·m) has against the load acts no more,
    /// and what it has of a load that was doubted goes on.
    pub fn left(&self, spring: f64) -> f64 {
        if self.lowers {
            self.load
        } else {
            (self.load + spring).max(self.least.min(0.0)).min(self.least.max(0.0))
        }
    }

    /// What Teaching carries, N·m: of a load that is doubted what the `spring` (N·m) leaves, because the rest may not be there.
    pub fn taught_load(&self, spring: f64) -> f64 {
        if self.load.abs() < 0.5 * self.least.abs() { self.left(spring) } else { self.load }
    }

    /// Torque of the load that the model lacks, N·m.
    pub fn load(&self) -> f64 {
        self.load
    }

    /// A tick: spring, load and damper as the parts of a PID controller, N·m.
    pub fn step(&mut self, joint: &Joint<'_>) -> PidTorque {
        let limit = joint.limits.torque_max;
        let most = joint.share * limit;
        let velocity = joint.velocity;
        self.missing = if joint.fresh { 0 } else { self.missing.saturating_add(1) };

        let soft = self.swing.step(velocity);
        // With the first of them a joint at half of its velocity limit is braked with all of its torque limit.
        let wanted = 2.0 * (limit - most) / joint.limits.velocity_max;
        let damping = if self.lowers {
            LOWERING_RATE / f64::from(joint.lowering.max(1)) * self.inertia
        } else {
            wanted.min(soft * DAMPING_RATE * self.inertia)
        };
        self.damping += SETTLES * (damping - self.damping);
        // From nothing in the first tick: what it begins with would be blended in.
        let brakes = if self.lowers { BRAKES_LOWERED } else { BRAKES };
        let brake = soft * self.braking * self.grip * brake(joint, self.inertia, brakes);
        self.braking += BRAKE_SETTLES * (1.0 - self.braking);
        let damper = (-self.damping * velocity).max(-limit).min(limit);
        let d = if brake.abs() > damper.abs() { brake } else { damper };
        self.grip += SETTLES * (if self.missing > MISSING { 0.0 } else { 1.0 } - self.grip);
        let stiffness = (most / STRETCH).min(soft * SPRING_RATE * SPRING_RATE * self.inertia);
        let end = soft_end::spring(soft_end::depth(joint.position, joint.range), most);
        let pull = stiffness * (self.set - joint.position) + end;
        let spring = self.grip * pull.max(-most).min(most);
        // Only for a shove spring and damper together use more than the share.
        let p = if self.lowers { 0.0 } else { within(spring, d, most) };

        let carried = joint.model + if self.lowers { self.least } else { self.load };
        let loaded = carried.abs() > LOADED * limit;
        let sinks = loaded && velocity * carried < 0.0 && velocity.abs() > AT_REST;
        self.sinks_ms = if sinks { self.sinks_ms.saturating_add(1) } else { 0 };
        self.sunk = (self.sunk - velocity * carried.signum() * DT).max(0.0);
        if !self.lowers && loaded && (self.sunk > SINKS.0 || self.sinks_ms > SINKS.1) {
            self.lower(p);
        }
        if !self.lowers {
            self.doubt(velocity, p + d);
        } else if loaded {
            // Never beyond the limit; and what was there at the begin is not taken back from a joint that is lifted.
            let learned = self.load + damper * DT / LEARNS_S;
            let learned = if carried > 0.0 { learned.max(self.least) } else { learned.min(self.least) };
            self.load = learned.max(-limit - joint.model).min(limit - joint.model);
        }
        let calm = if self.lowers {
            self.holdable = (joint.model + self.load).abs() <= HOLDABLE * limit;
            velocity.abs() < AT_REST
        } else {
            velocity.abs() < CALM && d.abs() <= most && self.driven_ms < DRIVEN_CALM_MS
        };
        self.calm_ms = if calm { self.calm_ms.saturating_add(1) } else { 0 };
        PidTorque { p, i: self.load, d }
    }

    /// A load that drives the joint all by itself, against this `torque` (N·m) of spring and damper, goes; it comes back where it is missed.
    fn doubt(&mut self, velocity: f64, torque: f64) {
        let (along, has) = (velocity * self.least.signum(), self.load.abs());
        let against = -torque * self.least.signum();
        let driven = along > CREEPS && against > DRIVEN.0 * has && against < DRIVEN.1 * has;
        self.driven_ms = if driven {
            (self.driven_ms + 1).min(DRIVEN_MS + DRIVEN_CALM_MS)
        } else {
            self.driven_ms.saturating_sub(1)
        };
        if self.driven_ms > DRIVEN_MS {
            self.load *= 1.0 - DT / GOES_S;
        } else if along < -CALM && self.load != self.least {
            self.load += (self.least - self.load) * (DT / COMES_BACK_S);
        }
    }
}

/// The swing of a joint that is lighter than its inertia in the arm file: what brakes it is too hard for it, because measured speeds are late.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Swing {
    /// Highest speed in this direction, rad/s, signed, and since when the joint moves so, ms.
    peak: f32,
    half_ms: u8,
    /// Highest speed of the half before, if that was one of a swing.
    before: f32,
    /// How much softer everything is, and since when it has been, ms.
    soft: f32,
    soft_ms: u16,
}

remembered!(Swing { peak, half_ms, before, soft, soft_ms });

impl Swing {
    const NONE: Self = Self { peak: 0.0, half_ms: u8::MAX, before: 0.0, soft: 1.0, soft_ms: 0 };

    /// A tick at this velocity, rad/s. Returns the share of spring, damper and brake that acts.
    fn step(&mut self, velocity: f64) -> f64 {
        let velocity = velocity as f32;
        if velocity * self.peak < 0.0 {
            let speed = self.peak.abs();
            let swings = self.half_ms < SWINGS_MS && speed > SWINGS;
            // A shove and the return of the spring are two halves, too, but the second is slow.
            if swings && self.before > 0.0 && speed > LASTING * self.before {
                (self.soft, self.soft_ms) = ((SOFTER * self.soft).max(SOFTEST), 0);
            }
            self.before = if swings { speed } else { 0.0 };
            (self.peak, self.half_ms) = (velocity, 0);
        } else if velocity.abs() > self.peak.abs() {
            self.peak = velocity;
        }
        self.half_ms = self.half_ms.saturating_add(1);
        if self.soft < 1.0 {
            self.soft_ms += 1;
            if self.soft_ms >= HARDENS_MS.0 {
                (self.soft, self.soft_ms) = ((self.soft / SOFTER).min(1.0), HARDENS_MS.0 - HARDENS_MS.1);
            }
        }
        self.soft.into()
    }
}

/// What a brake has against a fast motion of a joint with this `inertia` (kg·m²), N·m: the measured speed is too old for the damper of a light
/// joint to stop a shove.
fn brake(joint: &Joint<'_>, inertia: f64, (from, to): (f64, f64)) -> f64 {
    let JointConfig { torque_max, velocity_max, .. } = *joint.limits;
    let slope = (torque_max / ((to - from) * velocity_max)).min(BRAKE_RATE * inertia);
    let beyond = joint.young_velocity.abs() - from * velocity_max;
    if beyond > 0.0 { -(slope * beyond).min(torque_max) * joint.young_velocity.signum() } else { 0.0 }
}

/// How often each joint has yielded in the last seconds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Yielded {
    times: [u8; JOINTS],
    /// Ticks since one did.
    since_ms: u16,
}

remembered!(Yielded { times, since_ms });

impl Yielded {
    /// A tick.
    pub fn step(&mut self) {
        self.since_ms = self.since_ms.saturating_add(1).min(AGAIN_MS);
        if self.since_ms == AGAIN_MS {
            self.times = [0; JOINTS];
        }
    }

    /// The joint yields. Returns whether it does so too often: it goes on until the host clears it.
    pub fn count(&mut self, joint: usize) -> bool {
        self.since_ms = 0;
        let Some(times) = self.times.get_mut(joint) else { return false };
        *times = times.saturating_add(1);
        *times >= TIMES
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Config;

    const INERTIA: f64 = 5.0;
    const SHARE: f64 = 0.3;

    fn limits() -> JointConfig {
        Config::avena().joints[1]
    }

    /// A joint that comes back fast, again and again, becomes softer each time, and harder again when it does not; one that a push has moved and
    /// a spring takes back does not.
    #[test]
    fn j68_what_swings_becomes_softer_for_a_while() {
        let swing = |half_ms: usize, speeds: [f64; 2]| {
            let mut swing = Swing::NONE;
            for ms in 0..6 * half_ms {
                swing.step(speeds[ms / half_ms % 2]);
            }
            swing
        };
        let mut swings = swing(20, [0.3, -0.3]);
        assert_eq!(
            swings.soft, SOFTEST,
            "of five turns the first ends no swing, and the second has none before it"
        );
        for (ms, harder) in [(300, 2.0 * SOFTEST), (100, 4.0 * SOFTEST), (100, 1.0)] {
            assert_eq!((0..ms).fold(0.0, |_, _| swings.step(0.01)), f64::from(harder));
        }
        assert_eq!(swing(20, [0.3, -0.1]).soft, 1.0, "shoves, and the spring");
        assert_eq!(swing(20, [0.1, -0.1]).soft, 1.0, "too slow to matter");
        assert_eq!(swing(100, [0.3, -0.3]).soft, 1.0, "no swing of a loop");
    }

    /// The brake is no torque in the first tick of a yield, whole soon, and against the motion.
    #[test]
    fn j68_a_fast_joint_is_braked_with_all_of_its_torque() {
        let limits = limits();
        for v in [1.2, -1.2] {
            let mut yields = Yield::begin(false, false, 0.0, 5.0, 0.0);
            let joint = Joint { young_velocity: v, ..at(&limits, 0.0, 0.0, 0.0) };
            assert_eq!(yields.step(&joint).d, 0.0);
            let torque = (0..20).fold(0.0, |_, _| yields.step(&joint).d);
            assert!((torque + limits.torque_max * v.signum()).abs() < 1e-3 * limits.torque_max, "{torque}");
            let slow = Joint { young_velocity: 0.19 * limits.velocity_max, ..joint };
            assert_eq!(yields.step(&slow).d, 0.0);
        }
    }

    /// A joint in the middle of a wide range.
    fn at<'a>(limits: &'a JointConfig, position: f64, velocity: f64, model: f64) -> Joint<'a> {
        Joint {
            position,
            velocity,
            young_velocity: 0.0,
            fresh: true,
            model,
            limits,
            range: (-2.9, 2.9),
            share: SHARE,
            lowering: 1,
        }
    }

    /// Drags the spring along, and takes a tick.
    fn tick(yields: &mut Yield, joint: &Joint<'_>) -> PidTorque {
        yields.drag(joint.position);
        yields.step(joint)
    }

    proptest! {
        /// Whatever the joint does: the spring never exceeds the share, and with the damper only where the damper alone does; the damper
        /// only takes energy out.
        #[test]
        fn j68_a_slow_push_has_the_share_against_it_and_a_shove_the_limit(
            set in -3.0..3.0f64,
            way in -0.2..0.2f64,
            velocity in prop_oneof![Just(0.0), -3.0..3.0f64],
            model in -200.0..200.0f64,
            inertia in 0.1..10.0f64,
            load in -50.0..50.0f64,
        ) {
            let limits = limits();
            let most = SHARE * limits.torque_max;
            let mut yields = Yield::begin(false, false, set, inertia, load);
            // Its damper has settled.
            let joint = at(&limits, set + way, velocity, model);
            (0..100).for_each(|_| {
                tick(&mut yields, &joint);
            });
            let torque = tick(&mut yields, &joint);
            prop_assert!(torque.p.abs() <= most + 1e-9 && torque.d.abs() <= limits.torque_max);
            prop_assert!((torque.p + torque.d).abs() <= most.max(torque.d.abs()) + 1e-9);
            prop_assert!(torque.d * velocity <= 0.0 && (velocity != 0.0 || torque.d == 0.0));
            prop_assert_eq!(torque.i, load);
            // Half of the velocity limit takes all of it, unless the joint is too light.
            let expected = (limits.torque_max - most) * velocity.abs() / (0.5 * limits.velocity_max);
            let light = DAMPING_RATE * inertia * velocity.abs();
            prop_assert!((torque.d.abs() - expected.min(light).min(limits.torque_max)).abs() < 1e-3);
        }

        /// A load that is lowered has no spring; what it learns never exceeds the limit, and is not less than at the begin.
        #[test]
        fn j70_a_load_that_is_lowered_is_damped_and_learned_within_the_limit(
            model in prop_oneof![-170.0..-20.0f64, 20.0..170.0f64],
            lowering in 1u8..4,
            velocities in prop::collection::vec(-0.4..0.4f64, 1..400),
        ) {
            let limits = limits();
            let mut yields = Yield::begin(true, false, 0.5, INERTIA, 0.0);
            for velocity in velocities {
                let before = yields.load();
                let torque = tick(&mut yields, &Joint { lowering, ..at(&limits, 0.1, velocity, model) });
                prop_assert_eq!(torque.p, 0.0);
                let most = LOWERING_RATE / f64::from(lowering) * INERTIA * velocity.abs();
                prop_assert!(torque.d.abs() <= most + 1e-9 && torque.d * velocity <= 0.0);
                prop_assert!((model + yields.load()).abs() <= limits.torque_max + 1e-9);
                prop_assert!((yields.load() - before).abs() <= most * DT / LEARNS_S + 1e-12);
                prop_assert!((yields.load() - before) * velocity <= 0.0, "it learns against the motion only");
                prop_assert!(yields.load() * model >= 0.0, "it carries no less than at the begin");
            }
        }
    }

    /// A hand lifts a joint that lowers its load, and lets go: what carried it is still there.
    #[test]
    fn j70_a_joint_that_is_lifted_keeps_what_carries_it() {
        let limits = limits();
        let mut yields = Yield::begin(true, false, 0.5, 16.0, 0.0);
        for k in 0..4_000 {
            let velocity = if k % 500 < 250 { 0.1 } else { 0.0 };
            tick(&mut yields, &at(&limits, 0.1, velocity, 150.0));
            assert!(yields.load() >= 0.0, "{k}: {} N·m", yields.load());
        }
    }

    #[test]
    fn j68_the_spring_is_dragged_along() {
        let limits = limits();
        let mut yields = Yield::begin(false, false, 1.0, INERTIA, 0.0);
        for (position, set) in [(1.0, 1.0), (1.01, 1.0), (1.05, 1.03), (1.04, 1.03), (0.5, 0.52)] {
            assert!((yields.drag(position) - set).abs() < 1e-12, "{position}");
            let torque = yields.step(&at(&limits, position, 0.0, 0.0));
            assert!((torque.p - SHARE * limits.torque_max * (set - position) / STRETCH).abs() < 1e-9);
            // A light joint has a softer one.
            let light = Yield { inertia: 0.1, ..yields }.step(&at(&limits, position, 0.0, 0.0));
            assert!((light.p - 90.0 * (set - position)).abs() < 1e-9);
        }
    }

    #[test]
    fn j68_without_answers_the_spring_fades() {
        let limits = limits();
        let mut yields = Yield::begin(false, false, 0.01, INERTIA, 0.0);
        let mut pull = |fresh: bool| tick(&mut yields, &Joint { fresh, ..at(&limits, 0.0, 0.0, 0.0) }).p;
        let whole = pull(true);
        assert_eq!((pull(false), pull(false)), (whole, whole), "two missing answers change nothing");
        let mut last = whole;
        for _ in 0..40 {
            let now = pull(false);
            assert!(now < last && last - now < 0.25 * whole, "no step");
            last = now;
        }
        assert!(last < 1e-3 * whole && pull(true) < 0.25 * whole);
    }

    #[test]
    fn j68_at_the_end_of_its_range_a_joint_is_pushed_back() {
        let limits = limits();
        let pull = |position: f64| {
            let mut yields = Yield::begin(false, false, position, INERTIA, 0.0);
            tick(&mut yields, &at(&limits, position, 0.0, 0.0)).p
        };
        let most = SHARE * limits.torque_max;
        for sign in [1.0, -1.0] {
            for (position, share) in [(2.8, 0.0), (2.85, 0.5), (2.9, 1.0), (3.0, 1.0)] {
                assert!((pull(sign * position) + sign * share * most).abs() < 1e-6, "{position}");
            }
        }
    }

    /// How many ticks of this speed (rad/s) it takes until the joint is held again.
    fn over_after(velocity: f64) -> Option<usize> {
        let limits = limits();
        let mut yields = Yield::begin(false, false, 0.0, INERTIA, 0.0);
        (1..1_000).find(|_| {
            tick(&mut yields, &at(&limits, 0.0, velocity, 0.0));
            yields.is_over()
        })
    }

    #[test]
    fn j68_a_joint_that_is_calm_for_200_ms_is_held_again() {
        assert_eq!((over_after(0.0), over_after(-0.049), over_after(0.05)), (Some(200), Some(200), None));
        let limits = limits();
        let mut stays = Yield::begin(false, true, 0.0, INERTIA, 0.0);
        for _ in 0..300 {
            tick(&mut stays, &at(&limits, 0.0, 0.0, 0.0));
        }
        assert!(stays.is_calm() && !stays.is_over(), "the host decides");
        stays.clear();
        assert!(stays.is_over());
        // A motion begins the time anew.
        tick(&mut stays, &at(&limits, 0.0, 0.2, 0.0));
        assert!(!stays.is_calm());
    }

    #[test]
    fn j68_j70_a_joint_that_sinks_for_long_enough_lowers_its_load() {
        let limits = limits();
        let lowers_after = |velocity: f64, model: f64| {
            let mut yields = Yield::begin(false, false, 0.0, INERTIA, 0.0);
            (1..10_000).find(|_| {
                tick(&mut yields, &at(&limits, 0.0, velocity, model));
                yields.lowers()
            })
        };
        // Torque of 20 N·m holds the joint up: gravity pulls it down.
        assert_eq!(lowers_after(-0.3, 20.0), Some(1_667), "0.5 rad");
        // Led down and up again it has not sunk.
        let mut led = Yield::begin(false, false, 0.0, INERTIA, 0.0);
        for k in 0..10_000 {
            let velocity = if k % 1_000 < 500 { -0.3 } else { 0.3 };
            tick(&mut led, &at(&limits, 0.0, velocity, 20.0));
        }
        assert!(!led.lowers());
        assert_eq!(lowers_after(0.1, -20.0), Some(3_001), "3 s");
        for (velocity, model) in [(0.5, 20.0), (-0.5, -20.0), (-0.5, 8.9), (-0.02, 20.0)] {
            assert_eq!(lowers_after(velocity, model), None, "{velocity} rad/s, {model} N·m");
        }
    }

    /// It comes to rest where the limit holds it, and is then held; nearly all of the limit is left to the damper.
    #[test]
    fn j70_a_load_at_rest_is_held_again_where_the_limit_leaves_something() {
        let limits = limits();
        for (load, held) in [(0.0, true), (70.0, true), (71.5, false)] {
            let mut yields = Yield::begin(true, false, 0.0, INERTIA, load);
            let over = (0..300).any(|_| {
                tick(&mut yields, &at(&limits, 0.0, 0.0, 100.0));
                yields.is_over()
            });
            assert_eq!(over, held, "{load} N·m");
            // The host may have it held all the same: it stands.
            assert!(yields.is_calm());
            yields.clear();
            assert!(yields.is_over());
        }
        let mut moves = Yield::begin(true, false, 0.0, INERTIA, 0.0);
        for _ in 0..300 {
            tick(&mut moves, &at(&limits, 0.0, -0.02, 100.0));
        }
        assert!(!moves.is_calm());
    }

    #[test]
    fn j68_the_third_time_within_ten_seconds_each_is_too_often() {
        let mut yielded = Yielded::default();
        let wait = |yielded: &mut Yielded, ms: u16| (0..ms).for_each(|_| yielded.step());
        assert!(!yielded.count(2));
        wait(&mut yielded, AGAIN_MS - 1);
        assert!(!yielded.count(2) && !yielded.count(3));
        wait(&mut yielded, AGAIN_MS - 1);
        assert!(yielded.count(2) && !yielded.count(3) && yielded.count(2));
        wait(&mut yielded, AGAIN_MS);
        assert!(!yielded.count(2));
    }

    /// The joint moves for so long at `velocity`, rad/s; its load becomes this, N·m.
    fn moves(yields: &mut Yield, velocity: f64, ms: u16) -> f64 {
        let limits = limits();
        let mut position = yields.set;
        for _ in 0..ms {
            position += velocity * DT;
            // The model is against the load: gravity does not pull where it sinks.
            tick(yields, &at(&limits, position, velocity, -40.0));
        }
        yields.load()
    }

    /// Spring and damper have 40 N·m against a joint that nobody pushes: its load does that, and was a lean. It goes within a second, and comes
    /// back where the joint sinks. A hand that leads the joint faster, or against its load, says nothing of it.
    #[test]
    fn j68_a_load_that_drives_the_joint_by_itself_goes() {
        let begun = || Yield::begin(false, false, 0.0, INERTIA, 40.0);
        for (velocity, ms) in [(0.01, DRIVEN_MS), (1.0, 1_000), (-0.01, 1_000), (-0.3, 1_000)] {
            assert_eq!(moves(&mut begun(), velocity, ms), 40.0, "{velocity} rad/s for {ms} ms");
        }
        let mut yields = begun();
        let left = moves(&mut yields, 0.01, 1_300);
        assert!((10.0..30.0).contains(&left) && yields.has_learned(), "{left} N·m");
        let led = moves(&mut yields, 1.0, 400);
        assert!((0.9 * left..=left).contains(&led), "{led} N·m");
        let back = moves(&mut yields, -0.1, 1_000);
        assert!((0.9 * 40.0..=40.0).contains(&back), "{back} N·m");
    }

    /// The position controller takes over what the spring leaves of the load, never more than the load and never the other way.
    #[test]
    fn j68_the_position_controller_takes_over_what_the_spring_leaves() {
        for (load, spring, left) in [
            (40.0, 0.0, 40.0),
            (40.0, -15.0, 25.0),
            (40.0, -54.0, 0.0),
            (40.0, 20.0, 40.0),
            (-40.0, 54.0, 0.0),
            (-40.0, -9.0, -40.0),
        ] {
            assert_eq!(
                Yield::begin(false, false, 0.0, INERTIA, load).left(spring),
                left,
                "{load}, {spring} N·m"
            );
            assert_eq!(Yield::begin(true, false, 0.0, INERTIA, load).left(spring), load, "lowered");
        }
    }
}
