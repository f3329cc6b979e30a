//! Parameters received from the host: gains, model and friction. The controller accepts each set of parameters completely or not at all
//! (J-06).
mod floats;
mod frames;
mod payload;

pub(crate) use frames::read_pid;
use jtc_dynamics::{ArmModel, Dynamics};
use jtc_wire::{DataStatus, missing_parameter};

use crate::JOINTS;
use crate::bit_codec::bit_codec;
use crate::config::Config;
use crate::config::defaults;
use crate::gains::{FeltInertia, POSES, Trial};
use crate::host::slices::{SliceOutcome, SliceProgress};
use crate::host_parameters::payload::{BlendState, PayloadBlend};
use crate::motion::ControlParameters;
use crate::parameters::{PidGains, TableOf};

/// Number of floats in the friction table of one joint. A tick checks or copies the table of one joint.
const TABLE_FLOATS: usize = 20 + 20 + 400;

/// Placeholder for a friction table that was not received. The control law does not use the placeholder table.
const NO_TABLE: TableOf<f32> =
    TableOf { velocity: [0.0; 20], temperature: [0.0; 20], torque: [[0.0; 20]; 20] };

/// Parameters in use (the defaults if the host has sent none), and a record of the parameters that the host has sent.
#[derive(Clone, Debug)]
pub(crate) struct HostParameters {
    /// Mask of the received parameters ([`missing_parameter`]).
    received: u8,
    /// Mask of the parameters that were received since the start, including parameters that were withdrawn later.
    given: u8,
    /// Model from which `dynamics` was computed.
    model: ArmModel,
    pub dynamics: Dynamics,
    payload: PayloadBlend,
    pub pid: [PidGains; JOINTS],
    /// Effective inertia of the joints in the received model (J-71). `looked_at` is the effective inertia in the model
    /// that is being checked or was checked last.
    felt: FeltInertia,
    looked_at: FeltInertia,
    /// Trial of gains that were received under torque.
    pub trial: Trial,
    polynomial: [[f64; 6]; JOINTS],
    /// Friction tables, which contain zeros until tables are received.
    pub tables: [TableOf<f32>; JOINTS],
    pub friction_is_table: bool,
    /// `true` if friction parameters were received after the last check of the trajectory.
    pub friction_is_new: bool,
}

/// State of the parameters for a snapshot. The values of the parameters belong to the arm, so this state does not
/// contain them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HostParametersState {
    received: u8,
    given: u8,
    friction_is_table: bool,
    friction_is_new: bool,
    payload: BlendState,
    felt: FeltInertia,
    trial: Trial,
}

bit_codec!(HostParametersState { received, given, friction_is_table, friction_is_new, payload, felt, trial });

impl HostParameters {
    /// Returns the state of the parameters, without their values.
    pub(crate) fn state(&self) -> HostParametersState {
        let Self { received, given, friction_is_table, friction_is_new, felt, trial, .. } = *self;
        let payload = self.payload.state();
        HostParametersState { received, given, friction_is_table, friction_is_new, payload, felt, trial }
    }

    /// Restores the state of the parameters, with the payload in `config`.
    pub(crate) fn restore(&mut self, state: &HostParametersState, config: &Config) {
        let HostParametersState { received, given, friction_is_table, friction_is_new, payload, felt, trial } =
            *state;
        (self.felt, self.trial) = (felt, trial);
        self.set_gravity(config);
        self.payload.restore(&payload, &mut self.dynamics);
        (self.received, self.given) = (received, given);
        (self.friction_is_table, self.friction_is_new) = (friction_is_table, friction_is_new);
    }

    /// Returns three flags, which are `true` if the gains, the model and the polynomial are the built-in values.
    pub(crate) fn built_in(&self) -> [bool; 3] {
        [self.pid == defaults::PID, self.model == defaults::MODEL, self.polynomial == defaults::POLYNOMIAL]
    }

    /// Uses the built-in gains, model or polynomial if its flag is `true`.
    pub(crate) fn use_built_in(&mut self, [pid, model, polynomial]: [bool; 3]) {
        if pid {
            self.pid = defaults::PID;
        }
        if model {
            self.model = defaults::MODEL;
        }
        if polynomial {
            self.polynomial = defaults::POLYNOMIAL;
        }
    }

    /// Creates the parameters as they are before a host has sent any parameter.
    pub(crate) fn new(config: &Config) -> Self {
        let dynamics = dynamics(&defaults::MODEL, config);
        Self {
            received: 0,
            given: 0,
            model: defaults::MODEL,
            payload: PayloadBlend::none(&dynamics),
            dynamics,
            pid: defaults::PID,
            felt: FeltInertia::NONE,
            looked_at: FeltInertia::NONE,
            trial: Trial::default(),
            polynomial: defaults::POLYNOMIAL,
            tables: [NO_TABLE; JOINTS],
            friction_is_table: false,
            friction_is_new: false,
        }
    }

    /// Resets the parameters in place to their state before a host has sent any parameter.
    pub(crate) fn begin(&mut self, config: &Config) {
        self.model = defaults::MODEL;
        self.set_gravity(config);
        self.pid = defaults::PID;
        self.polynomial = defaults::POLYNOMIAL;
        self.tables.iter_mut().for_each(|table| *table = NO_TABLE);
        self.forget();
    }

    /// Marks all parameters as not received, because they were loaded from storage. A host must still send or request them.
    pub(crate) fn forget(&mut self) {
        (self.received, self.given) = (0, 0);
        (self.friction_is_table, self.friction_is_new) = (false, false);
    }

    /// Returns the status byte in which the bit of each missing parameter is 1.
    pub(crate) fn missing(&self) -> u8 {
        !self.received & (missing_parameter::FRICTION | missing_parameter::PID | missing_parameter::MODEL)
    }

    /// Returns `true` if gains, model and friction were all received since the start. The controller then uses a
    /// built-in value only if a host has requested it.
    pub(crate) fn all_given(&self) -> bool {
        self.given == missing_parameter::FRICTION | missing_parameter::PID | missing_parameter::MODEL
    }

    fn receive(&mut self, part: u8) {
        self.received |= part;
        self.given |= part;
    }

    /// Returns the friction tables, or `None` if polynomials are in use.
    pub(crate) fn tables_in_use(&self) -> Option<&[TableOf<f32>; JOINTS]> {
        self.friction_is_table.then_some(&self.tables)
    }

    /// Returns the parameters that the control law needs.
    pub(crate) fn control(&self) -> ControlParameters<'_> {
        let (dynamics, pid, polynomial) = (&self.dynamics, &self.pid, &self.polynomial);
        let on_trial = self.trial.is_on();
        ControlParameters { dynamics, pid, polynomial, table: self.tables_in_use(), on_trial }
    }

    /// Returns `true` if the torque limits suffice to hold the arm at `position` (rad) (J-06).
    pub(crate) fn holdable(&self, position: &[f64; JOINTS], config: &Config) -> bool {
        holdable(&self.dynamics, position, config)
    }

    /// Withdraws the model, so that the host must send the model again.
    pub(crate) fn withdraw_model(&mut self) {
        self.received &= !missing_parameter::MODEL;
    }

    /// Withdraws all parameters, so that the host must send all parameters again.
    pub(crate) fn withdraw_all(&mut self) {
        self.received = 0;
    }

    /// Uses the gravity and the payload in `config` from now on.
    pub(crate) fn set_gravity(&mut self, config: &Config) {
        self.dynamics = dynamics(&self.model, config);
        self.payload.forget();
    }

    /// Returns `true` if every joint can hold the payload in `config` at `at` (rad), or if it needs less torque than
    /// with the present payload (J-60). Also returns `true` if a position is unknown or the model is missing, because
    /// the controller then checks the payload when Init ends.
    pub(crate) fn carries(&self, at: Option<&[f64; JOINTS]>, config: &Config) -> bool {
        let Some(at) = at.filter(|_| self.missing() & missing_parameter::MODEL == 0) else { return true };
        let next = dynamics(&self.model, config).gravity_torque(at);
        let now = self.dynamics.gravity_torque(at);
        // With this comparison, a holding torque of NaN counts as too high. An absent joint holds no load (J-53).
        let held =
            |j: usize| config.absent[j] || next[j].abs() <= config.joints[j].torque_max.max(now[j].abs());
        (0..JOINTS).all(held)
    }

    /// Begins to blend the payload in `config` into the model, over half a second (J-60). `heavier` is the mass of this payload minus the
    /// mass of the last payload, kg.
    pub(crate) fn change_payload(&mut self, config: &Config, heavier: f64) {
        self.payload.begin(&self.dynamics, &dynamics(&self.model, config), heavier);
    }

    /// Executes one tick of the payload blend. The blend runs while the arm is held or in Teaching.
    pub(crate) fn blend_payload(&mut self) {
        self.payload.step(&mut self.dynamics);
    }

    /// Ends the payload blend in a tick without torque. The model then contains the whole payload.
    pub(crate) fn end_blend(&mut self) {
        self.payload.end(&mut self.dynamics);
    }

    /// Returns the mass that the next call of [`blend_payload`](Self::blend_payload) adds, kg.
    pub(crate) fn next_mass(&self) -> f64 {
        self.payload.next_mass()
    }

    /// Returns the remaining time until the model contains the whole payload, ms. Returns 0 if the model already contains the whole
    /// payload.
    pub(crate) fn blend_left_ms(&self) -> u16 {
        self.payload.left_ms()
    }

    /// Returns `true` if the parameters that were received since the start are also within the bounds in `config` (J-06). For friction
    /// tables, use [`table_fits`](Self::table_fits).
    pub(crate) fn fits(&self, config: &Config) -> bool {
        let bounds = &config.parameter_bounds;
        let has = |part: u8| self.given & part != 0;
        let joints = || config.joints.iter();
        let gains =
            || self.pid.iter().zip(joints()).all(|(gains, joint)| bounds.check_gains(gains, joint).is_ok());
        let friction = || self.friction_is_table || check_polynomials(&self.polynomial, config).is_ok();
        (!has(missing_parameter::PID) || gains())
            && (!has(missing_parameter::FRICTION) || friction())
            && (!has(missing_parameter::MODEL) || bounds.check_masses(&self.model).is_ok())
    }

    /// Returns `true` if the friction table of the joint with index `j` is within the bounds. Also returns `true` if the controller does
    /// not use friction tables.
    pub(crate) fn table_fits(&self, j: usize, config: &Config) -> bool {
        let table = self.tables_in_use().and_then(|tables| tables.get(j)).zip(config.joints.get(j));
        table.is_none_or(|(table, joint)| config.parameter_bounds.check_table(table, joint).is_ok())
    }

    /// Checks gains against their bounds and, if the model is known, against the inertia of the joints (J-71).
    pub(crate) fn check_pid(&self, gains: &[PidGains; JOINTS], config: &Config) -> Result<(), DataStatus> {
        for (gains, joint) in gains.iter().zip(&config.joints) {
            config.parameter_bounds.check_gains(gains, joint)?;
        }
        let borne = self.missing() & missing_parameter::MODEL != 0 || self.felt.bears(gains, config);
        borne.then_some(()).ok_or(DataStatus::IncorrectValue)
    }

    /// Executes one tick with torque after gains were received. During a blend to new gains, returns the gains of this tick. `held` is
    /// `true` if all joints have settled and no joint yields.
    #[inline(never)]
    pub(crate) fn try_gains(&mut self, held: bool) -> Option<[PidGains; JOINTS]> {
        self.trial.step(held);
        self.trial.blended(&self.pid)
    }

    /// Returns `true` if the joints of the present model have enough inertia for the present gains, with the settings in `config`.
    pub(crate) fn gains_are_borne(&self, config: &Config) -> bool {
        self.felt.is_known() && self.felt.bears(&self.pid, config)
    }

    /// Returns `true` if the joints of the last checked model have too little inertia for the gains, even if the
    /// controller refused this model.
    #[cfg(test)]
    pub(crate) fn gains_were_too_much(&self, config: &Config) -> bool {
        self.looked_at.is_known() && !self.looked_at.bears(&self.pid, config)
    }

    /// Uses `gains`, which have passed [`check_pid`](Self::check_pid).
    pub(crate) fn put_pid(&mut self, gains: &[PidGains; JOINTS]) {
        self.pid = *gains;
        self.receive(missing_parameter::PID);
    }

    /// Computes the effective inertia of the joints of a model, with the settings in `config`, one pose per slice
    /// (J-71). After the last pose, the function compares the inertia with the inertia that the received gains need.
    /// If it is too low, the model is refused. Otherwise, the function calls `used`.
    fn look_at(
        &mut self,
        model: &ArmModel,
        progress: SliceProgress,
        config: &Config,
        used: impl FnOnce(&mut Self) -> Result<(), DataStatus>,
    ) -> SliceOutcome {
        let number = if let SliceProgress::Pose(number) = progress { number } else { 0 };
        if number == 0 {
            self.looked_at = FeltInertia::NONE;
        }
        if number < POSES {
            self.looked_at.look(number, model, config);
            return SliceOutcome::Unfinished(SliceProgress::Pose(number + 1));
        }
        let given = self.missing() & missing_parameter::PID == 0;
        if given && !self.looked_at.bears(&self.pid, config) {
            return SliceOutcome::Refused(DataStatus::IncorrectValue);
        }
        let looked_at = self.looked_at;
        let outcome = used(self);
        if outcome.is_ok() {
            self.felt = looked_at;
            self.trial.keep_if(|gains| looked_at.bears(gains, config));
        }
        outcome.into()
    }

    /// Computes the inertia of the model in use again if the settings that affect this inertia have changed (J-71).
    pub(crate) fn look_again(
        &mut self,
        progress: SliceProgress,
        config: &Config,
        before: &Config,
    ) -> SliceOutcome {
        let same = |j: usize| {
            config.joints[j].rotor_inertia == before.joints[j].rotor_inertia
                && config.position_range(j) == before.position_range(j)
        };
        if config.delay_ticks == before.delay_ticks && (0..JOINTS).all(same) {
            return SliceOutcome::Done;
        }
        if self.missing() & missing_parameter::MODEL != 0 {
            // The inertia is unknown without a model. The controller computes it when the host sends the model again.
            self.felt = FeltInertia::NONE;
            return SliceOutcome::Done;
        }
        let model = self.model;
        self.look_at(&model, progress, config, |_| Ok(()))
    }

    /// Checks and copies an arm model in slices. `at` contains the measured positions (rad) if the positions of all joints are known.
    pub(crate) fn set_model(
        &mut self,
        model: &ArmModel,
        progress: SliceProgress,
        at: Option<&[f64; JOINTS]>,
        config: &Config,
    ) -> SliceOutcome {
        if let SliceProgress::Pose(_) = progress {
            return self.look_at(model, progress, config, |own| own.put_model(model, at, config));
        }
        match check_model(model, config) {
            Ok(()) => SliceOutcome::Unfinished(SliceProgress::Pose(0)),
            Err(status) => SliceOutcome::Refused(status),
        }
    }

    /// Uses a model that has passed [`check_model`].
    fn put_model(
        &mut self,
        model: &ArmModel,
        at: Option<&[f64; JOINTS]>,
        config: &Config,
    ) -> Result<(), DataStatus> {
        let dynamics = dynamics(model, config);
        // Before all positions are known, the controller cannot check the torque that holds the arm. The controller checks the model again
        // when Init ends.
        if at.is_some_and(|position| !holdable(&dynamics, position, config)) {
            return Err(DataStatus::IncorrectValue);
        }
        (self.model, self.dynamics) = (*model, dynamics);
        self.payload.forget();
        self.receive(missing_parameter::MODEL);
        Ok(())
    }

    pub(crate) fn take_default_polynomial(&mut self, config: &Config) -> Result<(), DataStatus> {
        self.set_polynomial(&defaults::POLYNOMIAL, config)
    }

    fn set_polynomial(&mut self, polynomial: &[[f64; 6]; JOINTS], config: &Config) -> Result<(), DataStatus> {
        check_polynomials(polynomial, config)?;
        self.polynomial = *polynomial;
        self.friction_received(false);
        Ok(())
    }

    /// Checks and copies the default friction tables, like received tables.
    pub(crate) fn take_default_tables(&mut self, progress: SliceProgress, config: &Config) -> SliceOutcome {
        self.take_tables(|j| Ok(*defaults::friction_table(j)), progress, config)
    }

    /// Checks or copies the friction table of one joint per tick. The controller checks all tables before it copies the first table, so a
    /// refused table does not change the parameters.
    fn take_tables(
        &mut self,
        table: impl Fn(usize) -> Result<TableOf<f32>, DataStatus>,
        progress: SliceProgress,
        config: &Config,
    ) -> SliceOutcome {
        match progress {
            SliceProgress::TableCopy(j) => {
                if let (Some(slot), Ok(table)) = (self.tables.get_mut(j), table(j)) {
                    *slot = table;
                }
                if j + 1 < JOINTS {
                    return SliceOutcome::Unfinished(SliceProgress::TableCopy(j + 1));
                }
                self.friction_received(true);
                SliceOutcome::Done
            }
            progress => {
                let j = if let SliceProgress::TableCheck(j) = progress { j } else { 0 };
                let table = table(j).and_then(|table| {
                    let joint = config.joints.get(j).ok_or(DataStatus::IncorrectValue)?;
                    config.parameter_bounds.check_table(&table, joint).map_err(DataStatus::from)
                });
                match table {
                    Err(status) => SliceOutcome::Refused(status),
                    Ok(()) if j + 1 < JOINTS => SliceOutcome::Unfinished(SliceProgress::TableCheck(j + 1)),
                    Ok(()) => SliceOutcome::Unfinished(SliceProgress::TableCopy(0)),
                }
            }
        }
    }

    fn friction_received(&mut self, table: bool) {
        self.friction_is_table = table;
        self.friction_is_new = true;
        self.receive(missing_parameter::FRICTION);
    }
}

fn check_model(model: &ArmModel, config: &Config) -> Result<(), DataStatus> {
    model.check().map_err(|_| DataStatus::IncorrectValue)?;
    Ok(config.parameter_bounds.check_masses(model)?)
}

fn check_polynomials(polynomial: &[[f64; 6]; JOINTS], config: &Config) -> Result<(), DataStatus> {
    for (coefficients, joint) in polynomial.iter().zip(&config.joints) {
        config.parameter_bounds.check_polynomial(coefficients, joint)?;
    }
    Ok(())
}

/// Returns the dynamics of a model with the gravity and the payload in `config`.
#[inline(never)]
fn dynamics(model: &ArmModel, config: &Config) -> Dynamics {
    Dynamics::with_payload(model, config.gravity, &config.payload)
}

/// Returns `true` if the torque limits suffice to hold an arm with these dynamics at `position` (rad) (J-06).
fn holdable(dynamics: &Dynamics, position: &[f64; JOINTS], config: &Config) -> bool {
    let gravity = dynamics.gravity_torque(position);
    // With this comparison, a holding torque of NaN counts as too high. An absent joint holds no load (J-53).
    (0..JOINTS).all(|j| config.absent[j] || gravity[j].abs() <= config.joints[j].torque_max)
}

#[cfg(test)]
mod tests;
