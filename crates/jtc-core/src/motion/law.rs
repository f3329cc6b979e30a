//! Control law of each joint, computed in each tick: τ = τ_id + τ_pid + τ_fric (J-40 to J-44).
use jtc_dynamics::Dynamics;

use super::set_values::{Latched, SetValues};
use super::torque::JointTorque;
use super::transfer::Transfer;
use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::config::limits::{JointConfig, within};
use crate::motion::load::Load;
use crate::motion::pid::{Pid, PidTorque};
use crate::motion::teach::{LedJoint, Taught};
use crate::motion::yielding::{Joint, Yield, Yielded};
use crate::nodes::Nodes;
use crate::parameters::{PidGains, TableOf};
use crate::{JOINTS, friction, gains, joint_error};

/// Speed, rad/s. A joint that moves more slowly than this speed creeps. The integral of a creeping joint can contain
/// an error of the friction model, so the controller does not learn a load from it.
const CREEPS: f64 = 0.05;

/// Limit for the torque that a joint needs in addition to its learned load, as a share of the torque limit. Friction
/// alone can hold such a torque. If the additional torque is below the limit, the load counts as known.
const LITTLE: f64 = 0.04;

/// Control mode, which determines the active parts of the control law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ControlMode {
    /// Mode for an arm that is held. Gravity and PID are active.
    Hold,
    /// Mode for a motion on the path. Gravity, PID, friction compensation, and inertia at the commanded velocity and
    /// acceleration are active.
    Follow,
    /// Mode for the approach to the path. This mode is like `Follow`, but the limits of the path do not apply, because
    /// the approach begins at the measured position.
    Approach,
    /// Mode for an arm that a hand has moved and that comes to rest before it is held. This mode is like `Hold`, with
    /// additional friction compensation and inertia at the commanded velocity and acceleration.
    Rest,
    /// Gravity and the torques for hand guiding are active (J-25).
    Teach,
}

impl ControlMode {
    /// Returns `true` if the arm is held, or comes to rest to be held.
    pub(crate) fn holds(self) -> bool {
        matches!(self, Self::Hold | Self::Rest)
    }

    /// Returns `true` if the torque depends on the commanded velocity and acceleration.
    pub(crate) fn commands_motion(self) -> bool {
        self.moves() || self == Self::Rest
    }

    /// Returns `true` if the mode is used for a commanded motion.
    pub(crate) fn moves(self) -> bool {
        matches!(self, Self::Follow | Self::Approach)
    }
}

/// Longest time, ms, in which the integral releases the torque that it contained for a payload. The release begins
/// when the host configures this payload.
const UNWINDS_MS: u16 = 3_000;

/// Inputs of a tick of the control law.
pub(crate) struct LawInputs<'a> {
    pub mode: ControlMode,
    /// `true` if the arm brakes with all available torque (J-33).
    pub braking: bool,
    pub nodes: &'a Nodes,
    pub config: &'a Config,
    pub parameters: ControlParameters<'a>,
}

/// Parameters of the control law: model, gains and friction.
pub(crate) struct ControlParameters<'a> {
    pub dynamics: &'a Dynamics,
    pub pid: &'a [PidGains; JOINTS],
    pub polynomial: &'a [[f64; 6]; JOINTS],
    pub table: Option<&'a [TableOf<f32>; JOINTS]>,
    /// `true` if the gains are on trial, so that the control law checks the joints for swings (J-71).
    pub on_trial: bool,
}

/// State of the control law.
#[derive(Clone, Debug, Default)]
pub(crate) struct ControlLaw {
    pid: [Pid; JOINTS],
    /// Torque of each joint in the last tick, by parts.
    pub torque: [JointTorque; JOINTS],
    /// State of Teaching. This state exists only during Teaching, and the flight recorder does not store it.
    pub(super) taught: Option<Taught>,
    transfer: Transfer,
    /// State of the joints that yield or lower a load (J-68, J-70).
    yields: [Option<Yield>; JOINTS],
    yielded: Yielded,
    /// Unmodelled load that each joint carries.
    loads: [Load; JOINTS],
    /// Index of the joint whose load is observed in this tick.
    observed: u8,
    /// Remaining time in which the integral releases the torque of a payload that the model now contains, ms (J-60).
    pub(super) unwinds_ms: u16,
}

bit_codec!(ControlLaw { pid, torque, taught, transfer, yields, yielded, loads, observed, unwinds_ms });

impl ControlLaw {
    /// Clears all torques.
    pub(crate) fn release(&mut self) {
        let Self { pid, torque, taught, transfer, yields, yielded, loads, observed, unwinds_ms } = self;
        (*unwinds_ms, *observed) = (0, 0);
        *pid = Default::default();
        *torque = Default::default();
        *taught = None;
        *transfer = Transfer::default();
        forget_yields(yields);
        *yielded = Yielded::default();
        *loads = Default::default();
    }

    /// Prepares a change of the control mode between HoldPos, Operate and Teaching. Only the model torque changes at
    /// once. The other parts of the torque are blended to their new values (J-44).
    pub(crate) fn change_mode(&mut self) {
        self.transfer.change_mode();
    }

    /// Like [`Self::change_mode`], but no part of the torque may step, because the model torque then also contains the
    /// torque that decelerates the arm.
    pub(crate) fn change_whole_torque(&mut self) {
        self.transfer.change_model();
    }

    /// Prepares a change of the arm model while the arm is held. The whole torque is blended, so it has no step.
    pub(crate) fn change_model(&mut self) {
        // The integral contains torque that the last model did not contain. The new model contains this torque, so
        // the integral must release it.
        self.payload_comes();
        self.transfer.change_model();
    }

    /// Changes the gains of the joints. The integral keeps as much of its torque as the new gains allow. The remaining torque is blended
    /// out.
    pub(crate) fn change_gains(&mut self, gains: &[PidGains; JOINTS]) {
        for j in 0..JOINTS {
            if !self.yields(j) {
                self.pid[j].keep(&gains[j], self.torque[j].pid.i);
            }
        }
        self.transfer.change_mode();
    }

    /// Returns `true` if these gains can hold the present torque (J-71).
    pub(crate) fn hold_on(&self, gains: &[PidGains; JOINTS], config: &Config) -> bool {
        let holds = |j: usize| {
            let PidTorque { p, i, .. } = self.torque[j].pid;
            config.absent[j] || gains::hold_on(&gains[j], p, i, &config.joints[j])
        };
        (0..JOINTS).all(holds)
    }

    /// Clears the loads, so that the controller must learn the load of each joint again.
    fn forget_loads(&mut self) {
        self.loads.iter_mut().for_each(Load::forget);
    }

    /// Resets the control law of joints whose position hold has ended or has not begun.
    pub(crate) fn latch(&mut self, latched: &Latched) {
        for j in 0..JOINTS {
            if !latched.held[j] {
                self.pid[j].reset(0.0);
                self.loads[j].forget();
                self.yields[j] = None;
                // Joints that were just enabled have no integral from which torque must be released.
                self.unwinds_ms = 0;
            }
        }
        self.transfer.set_just_enabled(latched.just_enabled);
    }

    /// Makes a joint yield, or lower its load, from the next tick on (J-68, J-70). `set` is the commanded position of the joint, rad.
    /// `inertia` is the effective inertia of the joint, kg·m². `led` is `true` if the joint comes to rest after a hand has moved it in
    /// Teaching.
    // The function is inlined, so that the compiler knows that the index is in range.
    #[inline(always)]
    pub(crate) fn begin_yield(
        &mut self,
        joint: usize,
        (lowers, led): (bool, bool),
        set: f64,
        inertia: f64,
        limits: &JointConfig,
    ) {
        let (torque, limit) = (&mut self.torque[joint], limits.torque_max);
        if let Some(yields) = &mut self.yields[joint] {
            if lowers {
                yields.lower(0.0);
            }
            return;
        }
        // A yielding joint starts from the commanded torque, which is within the limit. The computed torque can be
        // above the limit.
        torque.blend += torque.sum().max(-limit).min(limit) - torque.sum();
        self.transfer.begin_yield(joint);
        let load = &self.loads[joint];
        // If the load of a pushed joint is unknown, the integral may contain the torque of the push, so the yield
        // begins without a load. If the joint was guided by hand before, the integral contains the load torque of
        // Teaching, so it is used as the load.
        let load = if lowers {
            Load::bounded(load.torque(torque.pid.i), limits)
        } else if led {
            load.torque(torque.pid.i)
        } else {
            load.known_torque()
        };
        let stays = self.yielded.count(joint);
        self.yields[joint] = Some(Yield::begin(lowers, stays, set, inertia, load));
    }

    /// Returns `true` if the joint yields, or lowers a load.
    pub(crate) fn yields(&self, joint: usize) -> bool {
        self.yields[joint].is_some()
    }

    /// Returns `true` if any joint yields, or lowers a load.
    pub(crate) fn any_yields(&self) -> bool {
        self.yields.iter().any(Option::is_some)
    }

    /// Returns `true` if a joint yields and has not calmed down yet.
    pub(crate) fn is_yielding(&self) -> bool {
        self.yields.iter().flatten().any(|yields| !yields.is_calm())
    }

    /// Allows all yields to end, because the host requests this. Each joint is held again as soon as it has calmed down.
    pub(crate) fn end_yields(&mut self) {
        self.yields.iter_mut().flatten().for_each(Yield::clear);
    }

    /// Moves the free end of the spring of a yielding joint along with the joint. Returns the position to which the
    /// spring pulls, rad. Returns `None` if the joint does not yield.
    pub(crate) fn drag(&mut self, joint: usize, position: f64) -> Option<f64> {
        self.yields[joint].as_mut().map(|yields| yields.drag(position))
    }

    /// Returns the torque of the unmodelled load of the joint, N·m.
    pub(crate) fn load(&self, joint: usize) -> f64 {
        self.loads[joint].torque(self.torque[joint].pid.i)
    }

    /// Returns the feedback torque of the position controller, N·m. This is the part of its torque that does not hold
    /// the load, so it shows a push.
    pub(crate) fn feedback(&self, joint: usize) -> f64 {
        let pid = &self.torque[joint].pid;
        pid.p + pid.d + (pid.i - self.load(joint))
    }

    /// Ends the yield of the joints that have calmed down. Returns `true` for each joint whose yield has ended. The controller then holds
    /// these joints at their present positions.
    pub(crate) fn end_of_yields(&mut self, gains: &[PidGains; JOINTS]) -> [bool; JOINTS] {
        let mut ended = [false; JOINTS];
        for j in 0..JOINTS {
            let Some(yields) = self.yields[j].as_ref().filter(|yields| yields.is_over()) else { continue };
            let (load, left) = (yields.load(), yields.left(self.torque[j].pid.p));
            self.pid[j].take_over(&gains[j], left);
            if yields.has_learned() {
                self.loads[j].set(if left.abs() > load.abs() { left } else { load });
            }
            self.yields[j] = None;
            self.transfer.change_mode();
            ended[j] = true;
        }
        ended
    }

    /// Returns `true` if Teaching can hold the load of every held joint: each load is known, and each feedback torque
    /// is small. A high feedback torque may come from a person who leans on the arm and may let go at any time. Loads
    /// are not known while the integral releases torque that the model now contains.
    ///
    /// During a `contact`, only the loads must be known. The feedback torque and the release of integral torque do
    /// not matter.
    pub(crate) fn knows_loads(&self, held: &[bool; JOINTS], config: &Config, contact: bool) -> bool {
        let known = |j: usize| {
            let little = LITTLE * config.joints[j].torque_max;
            self.loads[j].is_known() && (contact || self.feedback(j).abs() <= little)
        };
        (contact || self.unwinds_ms == 0) && (0..JOINTS).all(|j| !held[j] || known(j))
    }

    /// Sets the loads as if the controller had learned a load of zero for every joint.
    #[cfg(test)]
    pub(crate) fn find_loads_for_test(&mut self) {
        self.loads.iter_mut().for_each(|load| load.set(0.0));
    }

    /// Begins Teaching with the learned loads (J-25). A torque that may come from a contact is not held.
    pub(crate) fn begin_teaching(&mut self, nodes: &Nodes, config: &Config) {
        let mut loads = [0.0; JOINTS];
        for j in 0..JOINTS {
            loads[j] = match &self.yields[j] {
                Some(yields) => yields.taught_load(self.torque[j].pid.p),
                None => self.loads[j].known_torque(),
            };
        }
        self.taught = Some(Taught::begin(nodes.positions(), &loads, config));
        forget_yields(&mut self.yields);
    }

    /// Records that a payload is added to the model while the arm is held. The integral still contains the torque for
    /// this payload and must release it. Until then, the controller learns no load (J-60).
    pub(crate) fn payload_comes(&mut self) {
        self.unwinds_ms = UNWINDS_MS;
        self.forget_loads();
    }

    /// Reduces the mass that Teaching has estimated by `mass` (kg). The host has configured a payload during
    /// Teaching, and from this tick on, the model contains this part of it (J-60).
    pub(crate) fn give_way_to_payload(&mut self, mass: f64) {
        if let Some(taught) = &mut self.taught {
            taught.give_way(mass);
        }
    }

    /// Evaluates the answers of the joints in each tick of Teaching. Returns the speeds computed from the joint positions, rad/s. `late` is
    /// the delay of this tick in ms.
    pub(crate) fn hear_led_joints(&mut self, nodes: &Nodes, late: u16) -> [f32; JOINTS] {
        let (q, mut speeds) = (nodes.positions(), [0.0; JOINTS]);
        let Some(taught) = &mut self.taught else { return speeds };
        for j in 0..JOINTS {
            speeds[j] = taught.hear(j, nodes.node(j).fresh(), q[j], late);
        }
        speeds
    }

    /// Ends Teaching. The integral takes over the torque that held each joint.
    pub(crate) fn end_teaching(&mut self, nodes: &Nodes, config: &Config, gains: &[PidGains; JOINTS]) {
        let q = nodes.positions();
        if let Some(taught) = &self.taught {
            for j in 0..JOINTS {
                self.pid[j].take_over(&gains[j], taught.held(j, q[j], &config.joints[j], config));
            }
        }
        self.taught = None;
        self.forget_loads();
    }

    /// Shifts the position controllers by the sag of the set positions, rad, so that a sag does not act as a motion
    /// on the derivative.
    pub(crate) fn sag(&mut self, sag: &[f64; JOINTS]) {
        for (pid, way) in self.pid.iter_mut().zip(sag) {
            pid.shift(*way);
        }
    }

    /// Executes one tick of the control law, which computes the torques before any limit. `is_saturated` returns `true` for a joint whose
    /// last torque was above its limit. Returns the joint errors that the friction table causes.
    #[inline(always)]
    pub(crate) fn step(
        &mut self,
        inputs: &LawInputs<'_>,
        set: &SetValues,
        is_saturated: impl Fn(usize) -> bool,
    ) -> [u16; JOINTS] {
        let LawInputs { mode, nodes, config, ref parameters, .. } = *inputs;
        self.unwinds_ms = self.unwinds_ms.saturating_sub(1);
        self.yielded.step();
        let before = self.transfer.begin(&self.torque);
        if before.is_some() && mode != ControlMode::Teach {
            // Load and brake torques exist only in Teaching.
            self.torque.iter_mut().for_each(|torque| (torque.load, torque.brake) = (0.0, 0.0));
        }
        let q = nodes.positions();
        let v = nodes.velocities();
        // J-62: a measurement is compared with the set position at the time of the measurement.
        let due = set.due(config);
        // J-40: the model uses the measured position. In Operate, in a jog, and while the arm comes to rest after
        // Teaching, it also uses the commanded velocity and acceleration. Otherwise, velocity and acceleration are
        // zero in the model. The model torque takes effect later than the measurement, so the motion that was
        // commanded since the measurement is added to the measured position.
        let now = core::array::from_fn(|j| q[j] + (set.point.position[j] - due[j]));
        let any_yields = self.any_yields();
        let lowering = if any_yields {
            self.yields.iter().flatten().filter(|yields| yields.lowers()).count() as u8
        } else {
            0
        };
        let zero = [0.0; JOINTS];
        let (qd, qdd) =
            if mode.commands_motion() { (set.point.velocity, set.point.acceleration) } else { (zero, zero) };
        let model = if mode == ControlMode::Teach {
            parameters.dynamics.gravity_torque(&now)
        } else {
            parameters.dynamics.inverse(&now, &qd, &qdd)
        };
        let (friction, errors) =
            if mode.commands_motion() { compensation(inputs, &qd) } else { ([0.0; JOINTS], [0; JOINTS]) };
        for j in 0..JOINTS {
            let limit = &config.joints[j];
            let model = model[j] + limit.rotor_inertia * qdd[j];
            let pid = if any_yields && let Some(yields) = &mut self.yields[j] {
                yields.step(&Joint {
                    position: q[j],
                    velocity: v[j],
                    young_velocity: nodes.node(j).young_velocity(0.0),
                    fresh: nodes.node(j).fresh(),
                    model,
                    limits: limit,
                    range: config.position_range(j),
                    share: config.yield_torque_share,
                    lowering,
                })
            } else if mode != ControlMode::Teach {
                let error = due[j] - q[j];
                let at_rest = set.point.velocity[j] == 0.0 && set.point.acceleration[j] == 0.0;
                let encoder_step = at_rest.then_some(config.encoder_step);
                self.pid[j].step(&parameters.pid[j], error, is_saturated(j), encoder_step)
            } else {
                PidTorque::default()
            };
            let torque = &mut self.torque[j];
            (torque.model, torque.pid, torque.blend) = (model, pid, 0.0);
            if mode != ControlMode::Teach {
                torque.friction = friction[j];
            }
        }
        let computed = mode == ControlMode::Teach && self.teach(nodes, config, parameters);
        self.transfer.blend(before, &mut self.torque, nodes, config);
        if mode != ControlMode::Teach {
            self.observe_load(set, config);
        }
        if computed {
            self.bound_brakes(nodes, config);
        }
        errors
    }

    /// Observes the load of one joint. The next tick observes the next joint.
    fn observe_load(&mut self, set: &SetValues, config: &Config) {
        let j = usize::from(self.observed) % JOINTS;
        self.observed = (j as u8 + 1) % JOINTS as u8;
        let speed = set.point.velocity[j].abs();
        let creeps = speed > 0.0 && speed < CREEPS;
        // While the integral releases torque that the model now contains, it does not show the load of the joint.
        if self.yields[j].is_none() && self.unwinds_ms == 0 && !creeps {
            let (load, pid, limits) = (&mut self.loads[j], &self.torque[j].pid, &config.joints[j]);
            // The load is unknown until the integral alone holds the joint. The other parts of the PID torque are then
            // small.
            let found = load.is_known() || (pid.p + pid.d).abs() <= LITTLE * limits.torque_max;
            load.observe(pid.i, found && set.settled(j), limits);
        }
    }

    /// Computes the torque that Teaching adds to the torque of the model (J-25). Some ticks compute only a slowly
    /// changing value, and leave the torques of Teaching unchanged. Returns `true` if this tick computed the torques
    /// of Teaching.
    #[inline(never)]
    fn teach(&mut self, nodes: &Nodes, config: &Config, parameters: &ControlParameters<'_>) -> bool {
        let (q, v) = (nodes.positions(), nodes.velocities());
        let friction = |j: usize, v: f64| {
            let celsius = friction::celsius(nodes.node(j).report.temperature);
            let of = match parameters.table {
                Some(tables) => tables.get(j).map(|table| {
                    let moving = friction::table(table, v, celsius);
                    (friction::coulomb_of_table(table, celsius), moving.unwrap_or(0.0))
                }),
                None => parameters.polynomial.get(j).map(|c| {
                    let moving = friction::polynomial(c, v, celsius, config.friction_sign_width);
                    (friction::coulomb_of_polynomial(c, celsius), moving)
                }),
            };
            of.unwrap_or_default()
        };
        let Some(taught) = &mut self.taught else { return false };
        let begins = taught.begins();
        if taught.look(q, v, parameters.dynamics, config, friction) {
            if begins {
                for j in 0..JOINTS {
                    self.torque[j].load = taught.first_load(j);
                }
            }
            return false;
        }
        for j in 0..JOINTS {
            let torque = &mut self.torque[j];
            let led = LedJoint {
                position: q[j],
                velocity: v[j],
                limits: &config.joints[j],
                range: config.position_range(j),
            };
            let added = taught.step(j, &led, config);
            (torque.load, torque.brake, torque.friction) = (added.load, added.brake, added.friction);
        }
        true
    }

    /// Limits the braking torques of Teaching to the torque that remains within the torque limits, so that braking does not overload a
    /// joint.
    #[inline(never)]
    fn bound_brakes(&mut self, nodes: &Nodes, config: &Config) {
        for (j, torque) in self.torque.iter_mut().enumerate() {
            let brake = core::mem::take(&mut torque.brake);
            if nodes.node(j).enabled() {
                torque.brake = within(brake, torque.sum(), config.joints[j].torque_max);
            }
        }
    }
}

/// Ends all yields in place. An assignment of a new array of `None` would build and copy the whole array.
fn forget_yields(yields: &mut [Option<Yield>; JOINTS]) {
    for yields in yields {
        *yields = None;
    }
}

/// Returns the torques that compensate friction at the commanded velocities, N·m, and the joint errors for velocities outside the friction
/// table (J-42).
#[inline]
pub(super) fn compensation(
    inputs: &LawInputs<'_>,
    velocity: &[f64; JOINTS],
) -> ([f64; JOINTS], [u16; JOINTS]) {
    let LawInputs { mode, nodes, config, ref parameters, .. } = *inputs;
    let (mut torque, mut errors) = ([0.0; JOINTS], [0; JOINTS]);
    let celsius = |j: usize| friction::celsius(nodes.node(j).report.temperature);
    let Some(tables) = parameters.table else {
        let sign_slope = 1.0 / config.friction_sign_width;
        for j in 0..JOINTS {
            torque[j] =
                friction::polynomial_by_slope(&parameters.polynomial[j], velocity[j], celsius(j), sign_slope);
        }
        return (torque, errors);
    };
    for j in 0..JOINTS {
        let (slowest, fastest) = friction::velocities(&tables[j]);
        let nearest = velocity[j].max(slowest).min(fastest);
        let v = if mode != ControlMode::Follow { nearest } else { velocity[j] };
        torque[j] = friction::table(&tables[j], v, celsius(j)).unwrap_or_else(|| {
            errors[j] |= joint_error::FRICTION_TABLE;
            0.0
        });
    }
    (torque, errors)
}

#[cfg(test)]
mod tests;
