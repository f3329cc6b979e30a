//! Damping, dry friction, friction compensation and soft ends of one joint in Teaching.
use crate::DT;
use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::config::limits::JointConfig;
use crate::interpolation::smooth;
use crate::motion::soft_end;
use crate::motion::yielding::SPRING_RATE;

/// Speeds of a joint between which the damping increases, rad/s.
const FAST: (f64, f64) = (0.4, 0.8);
/// Highest rate at which the damping reduces the speed of a joint while the other joints are free to move, 1/s. The
/// rate is limited, because measured speeds are about 8 ms old, and because the motions of the joints affect each
/// other.
pub(super) const DAMPING_RATE: f64 = 90.0;
/// Speed at which the damping of a joint balances its load, rad/s, if the inertia of the joint tolerates that damping.
const SINKS: f64 = 0.5;
/// Highest damping of a fast joint, divided by the torque limit, s/rad.
const GROWN: f64 = 1.0;
/// Speeds between which a braking torque is added to the damping, rad/s. Without this torque, a fast joint would
/// reach the over-speed threshold, and the arm would be released.
///
/// `BRAKE` is the deceleration by the braking torque, rad/s². This deceleration is so low that a joint cannot reverse
/// before the controller measures the reversal.
const BRAKES: (f64, f64) = (0.9, 1.7);
const BRAKE: f64 = 60.0;
/// Speed above which Teaching ends and the controller brings the joint to rest, in rad/s and as a share of the over-speed threshold (J-35).
/// The lower of these two speeds applies.
const TOO_FAST: (f64, f64) = (1.4, 0.75);
/// Time constant of the speed that is computed from positions, s. The speed that drives report is a mean over 10 ms.
const SPEED_S: f32 = 0.004;
/// Share of the rotor inertia that the controller uses, because the configured value may be an unmeasured proposal.
/// If no rotor inertia is configured, the controller uses the same share of the torque limit divided by `PROPOSED`
/// (rad/s²).
const ROTOR: f64 = 0.2;
const PROPOSED: f64 = 200.0;
/// Share of the modelled friction that the controller expects in every joint. The real friction may be lower than
/// modelled, but not below this share.
const CERTAIN_FRICTION: f64 = 0.7;
/// Highest share of the damping that the friction compensation may cancel, because the joint may have less friction than its model.
const USED_UP: f64 = 0.5;
/// Time constant of the dry friction when it fades in or out, s.
const GRIP_S: f64 = 0.1;
/// Lowest speed at which the dry friction may begin to fade, rad/s.
const STANDING: f64 = 0.01;
/// Highest speed at which the dry friction may begin to fade, rad/s.
const SLOW: f64 = 0.3;
/// Longest extension of the dry-friction spring that holds a joint at rest, rad.
const STRETCH: f64 = 0.005;
/// Range of speeds around zero in which the sign of the friction compensation is smoothed, rad/s.
const SIGN_WIDTH: f64 = 0.1;
/// Speeds between which the friction compensation fades to zero, rad/s.
const COMPENSATED: (f64, f64) = (0.3, 0.6);
/// Number of missing answers after which a joint loses its Teaching torques. The springs fade first, within
/// [`LETS_GO`] ticks. Damping and friction compensation then fade within the same number of ticks.
const MISSING: u8 = 2;
const LETS_GO: u8 = 5;

/// Returns the speed of a joint above which Teaching ends, rad/s. The speed that is computed from positions is
/// compared with it. From this speed, the position controller can still stop a joint before the over-speed error
/// switches the torque off.
pub(crate) fn too_fast(limits: &JointConfig, config: &Config) -> f64 {
    TOO_FAST.0.min(TOO_FAST.1 * config.overspeed_factor * limits.velocity_max)
}

/// Returns the lowest rotor inertia that the controller assumes for a joint, kg·m².
pub(super) fn rotor(limits: &JointConfig) -> f64 {
    let given = limits.rotor_inertia;
    ROTOR * if given > 0.0 { given } else { limits.torque_max / PROPOSED }
}

/// State of a joint in Teaching. The values have single precision, because the flight recorder stores them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TaughtJoint {
    /// Anchor of the spring of the dry friction, rad. `grip` is the acting share of this spring.
    anchor: f32,
    pub(super) grip: f32,
    /// Depth of the joint inside a soft end at the beginning of Teaching, rad. The spring of the soft end acts only
    /// beyond this depth, so that it does not move the joint by itself.
    begun: f32,
    /// Friction of the joint according to its parameters, N·m. `coulomb` is the Coulomb friction, and `rubs` is the whole friction at a
    /// recent speed.
    coulomb: f32,
    rubs: f32,
    /// Lowest inertia that the controller assumes for the joint, kg·m².
    inertia: f32,
    /// Torque of damping and friction against the motion in the last tick, N·m.
    against: f32,
    /// Filtered position of the joint, rad. The lag of this position is proportional to the speed.
    behind: f32,
    /// Number of consecutive missing answers. `lost` counts the steps of the fading of springs and damping because of
    /// missing answers. At 2 · [`LETS_GO`], both are zero.
    missing: u8,
    lost: u8,
}

bit_codec!(TaughtJoint { anchor, grip, begun, coulomb, rubs, inertia, against, behind, missing, lost });

/// Inputs of a joint in a tick of Teaching.
pub(crate) struct LedJoint<'a> {
    /// Measured position of the joint, rad.
    pub position: f64,
    /// Measured velocity of the joint, rad/s.
    pub velocity: f64,
    pub limits: &'a JointConfig,
    /// Lowest and highest position of the joint, rad.
    pub range: (f64, f64),
}

/// Torque that Teaching adds to a joint, N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TaughtTorque {
    /// Torque of the load that Teaching holds.
    pub load: f64,
    /// Torque of damping, dry friction and soft ends.
    pub brake: f64,
    /// Torque that compensates the friction of the joint.
    pub friction: f64,
}

/// Data about the joint that the computation of its load needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bears {
    /// Share of the load that the damping balances at [`SINKS`].
    pub balanced: f64,
    /// Compression of the soft end beyond its compression at the beginning of Teaching, rad. The sign is that of
    /// [`soft_end::depth`].
    pub compressed: f64,
}

impl TaughtJoint {
    /// Begins Teaching of a joint at rest at `position` (rad).
    pub(super) fn begin(position: f64, limits: &JointConfig, range: (f64, f64)) -> Self {
        let begun = soft_end::depth(position, range).abs() as f32;
        let (anchor, inertia) = (position as f32, rotor(limits) as f32);
        Self { anchor, behind: anchor, grip: 1.0, begun, inertia, ..Self::default() }
    }

    /// Sets the lowest inertia that the controller assumes for the joint, kg·m². A value that is not finite is ignored.
    pub(super) fn set_inertia(&mut self, inertia: f64) {
        if inertia.is_finite() {
            self.inertia = inertia as f32;
        }
    }

    /// Evaluates the answer of the joint in each tick of Teaching. `fresh` is `true` if the joint has answered with
    /// this `position`, rad. `late` is the delay of this tick in ms. Returns the speed computed from the joint
    /// positions, rad/s, or 0 without an answer.
    ///
    /// After several missing answers, the torques of Teaching fade, because speed and positions are too old.
    #[inline(always)]
    pub(super) fn hear(&mut self, fresh: bool, position: f64, late: u16) -> f32 {
        // A late tick has the same effect as a missing answer.
        let missed = self.missing.saturating_add(late.min(u8::MAX.into()) as u8);
        if !fresh {
            self.missing = missed.saturating_add(1);
            if self.missing > MISSING {
                self.lost = (self.lost + 1).min(2 * LETS_GO);
            }
            return 0.0;
        }
        (self.missing, self.lost) = (0, self.lost.saturating_sub(1));
        let way = position as f32 - self.behind;
        // In the normal case, no answer is missing, and the two values are constants.
        let (time, part) = if missed == 0 {
            (SPEED_S, DT as f32 / SPEED_S)
        } else {
            let missed = f32::from(missed) * DT as f32;
            (SPEED_S + missed, (missed + DT as f32) / (SPEED_S + missed))
        };
        self.behind += way * part;
        way / time
    }

    /// Returns the acting share of the springs, and the acting share of damping and friction compensation. Both are 1
    /// if nothing has faded.
    fn heard(&self) -> (f64, f64) {
        if self.lost == 0 {
            return (1.0, 1.0);
        }
        let share = |lost: u8| 1.0 - f64::from(lost) / f64::from(LETS_GO);
        (share(self.lost.min(LETS_GO)), share(self.lost.saturating_sub(LETS_GO)))
    }

    /// Sets the Coulomb friction, and the friction at the present speed, N·m.
    pub(super) fn set_friction(&mut self, coulomb: f64, moving: f64) {
        (self.coulomb, self.rubs) = (coulomb as f32, (moving.abs() as f32).max(coulomb as f32));
    }

    /// Returns the torque of damping and friction against the motion in the last tick, N·m.
    pub(super) fn against(&self) -> f64 {
        self.against.into()
    }

    #[cfg(test)]
    pub(super) fn set_against(&mut self, torque: f64) {
        self.against = torque as f32;
    }

    /// Returns the damping of a slow joint and the highest damping, N·m·s/rad.
    fn dampings(&self, load: f64, limits: &JointConfig) -> (f64, f64) {
        let most = DAMPING_RATE * f64::from(self.inertia);
        let damping = limits.teach_damping.max(load.abs() / SINKS).min(most);
        (damping, damping.max(most.min(GROWN * limits.torque_max)))
    }

    /// Executes one tick of Teaching for a joint with this `load`, N·m. `haste` is 0 if the flange is not faster than
    /// the tool speed limit, and rises to 1 at twice this limit.
    #[inline(always)]
    pub(super) fn step(
        &mut self,
        joint: &LedJoint<'_>,
        load: f64,
        haste: f32,
        config: &Config,
    ) -> (TaughtTorque, Bears) {
        let LedJoint { position, velocity, limits, range } = *joint;
        let (springs, damps) = self.heard();
        let (damping, most) = self.dampings(load, limits);
        let depth = soft_end::depth(position, range);
        let begun = f64::from(self.begun).min(depth.abs());
        self.begun = begun as f32;
        // The damping increases with the speed of the joint and of the flange, and towards a position limit.
        let fast =
            if velocity.abs() > FAST.0 { smooth((velocity.abs() - FAST.0) / (FAST.1 - FAST.0)) } else { 0.0 };
        let compressed = depth - begun.copysign(depth);
        let outward = if depth * velocity > 0.0 { compressed.abs() / soft_end::SOFT_END } else { 0.0 };
        let grown = (most - damping) * fast.max(f64::from(haste)).max(outward.min(1.0));
        let mut damper = -(damping + grown) * velocity;
        if velocity.abs() > BRAKES.0 {
            let braked = smooth((velocity.abs() - BRAKES.0) / (BRAKES.1 - BRAKES.0));
            damper -= (BRAKE * f64::from(self.inertia) * braked).copysign(velocity);
        }
        let share = config.yield_torque_share * limits.torque_max;
        let end = soft_end::spring(compressed, share).max(-share).min(share);
        let dry = self.dry_friction(position, velocity, damping, limits, config);
        let friction = damps * self.compensation(velocity, damping, config);
        self.against = ((damping + grown) * velocity.abs() + f64::from(self.rubs) - friction.abs()) as f32;
        let balances = SINKS * damping;
        let balanced = if balances < load.abs() { balances / load.abs() } else { 1.0 };
        let torque = TaughtTorque { load: 0.0, brake: damper * damps + (end + dry) * springs, friction };
        (torque, Bears { balanced, compressed })
    }

    /// Returns the highest torque of the dry friction, N·m. A joint with more friction of its own needs less dry
    /// friction.
    fn breakaway(&self, limits: &JointConfig, config: &Config) -> f64 {
        (config.teach_stiction * limits.torque_max - CERTAIN_FRICTION * f64::from(self.coulomb)).max(0.0)
    }

    /// Returns the dry friction torque of a slow joint, N·m. The *first speed* of a joint is the speed at which its
    /// damping torque equals its dry friction. From the first speed to four times this speed, the dry friction fades
    /// to zero. A joint therefore stops against any torque that is lower than the dry friction. If the first speed is
    /// at most [`SLOW`], the dry friction falls at most half as fast as the damping torque rises. The total torque
    /// against the motion then never falls with the speed, even with the friction compensation.
    fn dry_friction(
        &mut self,
        position: f64,
        velocity: f64,
        damping: f64,
        limits: &JointConfig,
        config: &Config,
    ) -> f64 {
        let breakaway = self.breakaway(limits, config);
        if breakaway == 0.0 {
            self.anchor = position as f32;
            return 0.0;
        }
        let slow = (breakaway / damping.max(f64::MIN_POSITIVE)).clamp(STANDING, SLOW);
        let gripped =
            if velocity.abs() > slow { 1.0 - smooth((velocity.abs() - slow) / (3.0 * slow)) } else { 1.0 };
        let grip = f64::from(self.grip);
        self.grip = (grip + (gripped - grip) * (DT / GRIP_S)) as f32;
        // At its highest torque, the spring slips, so its anchor follows the joint. For a fast joint, the anchor
        // moves with the joint.
        let stretch = if gripped > 0.0 { self.stretch(breakaway) } else { 0.0 };
        self.anchor = f64::from(self.anchor).max(position - stretch).min(position + stretch) as f32;
        self.dry_spring(position, limits, config)
    }

    /// Returns the extension at which the spring of the dry friction slips, rad.
    fn stretch(&self, breakaway: f64) -> f64 {
        STRETCH.max(breakaway / (SPRING_RATE * SPRING_RATE * f64::from(self.inertia)).max(f64::MIN_POSITIVE))
    }

    /// Returns the torque of the dry-friction spring at `position` (rad), N·m.
    pub(super) fn dry_spring(&self, position: f64, limits: &JointConfig, config: &Config) -> f64 {
        let breakaway = self.breakaway(limits, config);
        let way = f64::from(self.anchor) - position;
        f64::from(self.grip) * (breakaway / self.stretch(breakaway) * way).max(-breakaway).min(breakaway)
    }

    /// Returns the torque that compensates the friction of the joint, N·m. Near standstill, this torque increases with the speed at most
    /// half as fast as the damping.
    fn compensation(&self, velocity: f64, damping: f64, config: &Config) -> f64 {
        let torque = config.teach_friction * f64::from(self.coulomb);
        let slope = (torque / SIGN_WIDTH).min(USED_UP * damping);
        let (from, to) = COMPENSATED;
        let left =
            if velocity.abs() > from { 1.0 - smooth((velocity.abs() - from) / (to - from)) } else { 1.0 };
        (slope * velocity).max(-torque).min(torque) * left
    }
}

#[cfg(test)]
mod tests;
