//! Extensions of the protocol (J-50 to J-59): identity and settings of the device, storage of a complete arm, and jogging.
mod answers;
mod arm;
mod image;
mod log;
pub(crate) mod state;

use jtc_wire::{
    Answer, Command, DataStatus, Floats, Info, LogState, Name, PAGE_VALUES, Program, RawPoint, StoreState,
    VALUE_LEN, Values, capability,
};

use crate::controller::Controller;
use crate::host::slices::{SliceOutcome, SliceProgress};
use crate::motion::{ControlMode, LawInputs};
use crate::settings::{self, Live};
use crate::{Config, ControllerState, JOINTS, TrajectoryState};
use state::{Extensions, LogRequest};
pub use state::{Identity, firmware_hash};

/// Highest number of values in a SetSettings frame that the controller accepts in every state.
const LIVE_MAX: usize = 4;

/// Highest number of values in a SetSettings frame while the arm is held or in Teaching. A payload has ten values.
const STANDING_MAX: usize = 16;

/// Highest velocity of a jog, rad/s, while the two encoders of a joint disagree (J-35). The type is f32, because hosts send velocities as
/// f32.
const UNTRUSTED_MAX: f32 = 0.1;

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Sets the identity of the controller. The board calls this function before the first tick.
    pub fn set_identity(&mut self, identity: Identity) {
        self.extensions.firmware_hash = firmware_hash(identity.firmware, identity.revision);
        self.extensions.identity = identity;
    }

    /// Sets the identification of the program in the flash. Boards that read their program after the start call this function (J-67).
    pub fn set_program(&mut self, program: Option<Program>) {
        self.extensions.identity.program = program;
    }

    /// Returns the frame with the answer to an extension request. The board must send this frame if the outputs of the last tick had
    /// [`crate::Outputs::answer_line`] set.
    pub fn answer_frame(&self) -> &[u8] {
        self.extensions.answers.frame()
    }

    /// Executes an extension request.
    pub(crate) fn carry_out_extension(&mut self, line: usize, command: Command<'_>) -> SliceOutcome {
        match command {
            command if self.asked_twice(line, &command) => SliceOutcome::Refused(DataStatus::NotAllowed),
            Command::GetInfo => self.get_info(line),
            Command::GetSettings { first } => {
                self.get_settings(line, first);
                SliceOutcome::Done
            }
            Command::SetSettings(values) => self.set_settings(values),
            Command::SetName(name) if self.settable() => {
                self.extensions.name = name;
                SliceOutcome::Done
            }
            Command::GetArm { offset } => {
                self.get_arm(line, offset);
                SliceOutcome::Done
            }
            Command::StoreArm => self.store_arm(),
            Command::Disable if self.settable() || self.holds_at_rest() => {
                // J-53: the parameters are withdrawn, so the controller changes to Init, without torque, and stays in
                // Init. In Init and Error, a host can then send another arm. The parameters of this arm are not
                // compared with the parameters of the last arm (J-71).
                self.parameters.withdraw_all();
                SliceOutcome::Done
            }
            Command::Jog(velocities) => self.jog(&velocities).into(),
            Command::GetLog { block, offset } if self.extensions.log != LogState::Absent => {
                self.extensions.log_request = Some(LogRequest::Page { line, block, offset });
                SliceOutcome::Done
            }
            Command::ClearLog if self.extensions.log != LogState::Absent => {
                self.extensions.log_request = Some(LogRequest::Clear);
                SliceOutcome::Done
            }
            Command::GetPoints { first } => {
                self.get_points(line, first);
                SliceOutcome::Done
            }
            _ => SliceOutcome::Refused(DataStatus::NotAllowed),
        }
    }

    /// Moves the arm with the joint velocities of a Jog (J-58). A jog is possible only in HoldPos and without a paused path.
    fn jog(&mut self, velocities: &Floats<'_>) -> Result<(), DataStatus> {
        let set = &self.motion.set;
        let free = self.state == ControllerState::HoldPos
            && !self.teaching
            && self.trajectory != TrajectoryState::Pause
            && self.trajectory != TrajectoryState::Execute
            && self.parameters.blend_left_ms() == 0
            && !self.stops_held()
            && (set.jogging() || set.all_holding());
        if !free {
            // An operator may still hold a jog key down when the host clears a held stop. Therefore the controller
            // refuses the Jogs of a key that was pressed during the held stop.
            if self.stops_held() && velocities.iter().any(|velocity| velocity != 0.0) {
                self.extensions.refuse_jogs();
            }
            return Err(DataStatus::NotAllowed);
        }
        let mut wanted = [0.0; JOINTS];
        let untrusted = self.nodes.untrusted() != 0;
        for (j, (wanted, joint)) in wanted.iter_mut().zip(&self.config.joints).enumerate() {
            let velocity = f64::from(velocities.get(j).unwrap_or(f32::NAN));
            // A host may round a velocity at the limit up to the next f32 number, because the wire format uses f32.
            // Such a velocity is accepted. The comparison also rejects NaN.
            let taken = velocity.abs() <= f64::from(joint.velocity_max as f32).max(joint.velocity_max);
            *wanted = taken.then_some(velocity).ok_or(DataStatus::IncorrectValue)?;
            // J-53: an absent joint does not move.
            let absent = self.config.absent.get(j) == Some(&true);
            if absent && velocity != 0.0 || untrusted && velocity.abs() > f64::from(UNTRUSTED_MAX) {
                return Err(DataStatus::NotAllowed);
            }
        }
        if wanted != [0.0; JOINTS] {
            if self.extensions.jogs_refused_ms > 0 {
                self.extensions.refuse_jogs();
                return Err(DataStatus::NotAllowed);
            }
        } else if !set.jogging() {
            // If no jog is active, a Jog with zero velocity has no effect.
            return Ok(());
        }
        let jogging = set.jogging();
        if wanted == [0.0; JOINTS] {
            self.motion.set.end_jog();
            return Ok(());
        }
        let (nodes, config, parameters) = (&self.nodes, &self.config, self.parameters.control());
        self.motion.ramp.begin(nodes, config, parameters.dynamics);
        let inputs = LawInputs { mode: ControlMode::Approach, braking: false, nodes, config, parameters };
        match self.motion.jog_room(&wanted, &inputs) {
            Some(room) => {
                if !jogging {
                    self.motion.law.change_mode();
                }
                self.motion.set.jog(&room.velocity, &room.acceleration, config);
                Ok(())
            }
            // No torque is available for the jog, so the controller brings the joints to rest.
            None if jogging => {
                self.motion.set.end_jog();
                Ok(())
            }
            None => Err(DataStatus::NotAllowed),
        }
    }

    /// Stops a jog, and refuses the Jogs that follow. Returns `true` if a jog was active.
    pub(crate) fn stop_jog(&mut self) -> bool {
        let jogging = self.motion.set.jogging();
        if jogging {
            self.motion.set.end_jog();
            self.extensions.refuse_jogs();
        }
        jogging
    }

    fn holds_at_rest(&self) -> bool {
        self.state == ControllerState::HoldPos && self.at_rest()
    }

    /// Returns `true` if the arm is at rest and no motion is commanded. The result does not depend on whether the drives are enabled.
    fn at_rest(&self) -> bool {
        !self.motion.set.coming_to_rest() && self.motion.set.moving(&self.nodes) == [false; JOINTS]
    }

    /// Returns `true` while the torque is off. The settings of the arm can change only while the torque is off (J-53).
    fn settable(&self) -> bool {
        matches!(self.state, ControllerState::Init | ControllerState::Error)
    }

    /// Returns `true` if the arm is held or in Teaching and no motion is commanded. In this state, a host may change live settings that
    /// affect the torque.
    fn stands(&self) -> bool {
        match self.state {
            ControllerState::Teaching => true,
            ControllerState::HoldPos => {
                self.trajectory != TrajectoryState::Execute
                    && !self.motion.set.jogging()
                    && !self.motion.set.is_led()
                    && !self.motion.law.is_yielding()
            }
            _ => false,
        }
    }

    /// Returns `true` if the answer to an earlier request on this line has not been sent yet (J-50).
    fn asked_twice(&self, line: usize, command: &Command<'_>) -> bool {
        let returns = matches!(
            command,
            Command::GetInfo
                | Command::GetSettings { .. }
                | Command::GetArm { .. }
                | Command::GetLog { .. }
                | Command::GetPoints { .. }
        );
        returns && self.extensions.answers.waits(line)
    }

    fn get_info(&mut self, line: usize) -> SliceOutcome {
        self.hash_arm();
        let Some(hash) = self.extensions.hash else { return SliceOutcome::Unfinished(SliceProgress::Begin) };
        let info = self.info(hash);
        self.extensions.answers.put(line, &Answer::Info(info));
        SliceOutcome::Done
    }

    fn info(&self, hash: u64) -> Info {
        let Extensions { identity, name, store, sequence, log, .. } = &self.extensions;
        let mut capabilities = capability::SETTINGS
            | capability::SPEED
            | capability::JOG
            | capability::PAYLOAD
            | capability::STOP_CAUSE;
        if *store != StoreState::Absent {
            capabilities |= capability::STORE;
        }
        if *log != LogState::Absent {
            capabilities |= capability::RECORDER;
        }
        Info {
            missing: self.parameters.missing(),
            nodes_missing: self.nodes.init_word(&self.config),
            boot_cause: identity.boot_cause,
            boots: identity.boots,
            uptime_ms: self.observed.tick,
            lost_records: self.records.lost(),
            hash,
            capabilities,
            defaults_stored: self.extensions.stored.is_there(),
            store: *store,
            sequence: *sequence,
            log: *log,
            arm: *name,
            board: Name::cut(identity.board),
            program: identity.program,
            reactions: Some(self.reactions()),
            ..Info::default()
        }
        .with_firmware(identity.firmware, identity.revision)
    }

    fn get_settings(&mut self, line: usize, first: u16) {
        let mut bytes = [[0; VALUE_LEN]; PAGE_VALUES];
        let mut count = 0;
        for (slot, value) in bytes.iter_mut().zip(settings::values(&self.config, first.into(), false)) {
            *slot = value.emit();
            count += 1;
        }
        let page = bytes.get(..count).unwrap_or(&[]);
        if let Some(values) = Values::parse(page.as_flattened()) {
            let total = settings::count(false) as u16;
            self.extensions.answers.put(line, &Answer::Settings { first, total, values });
        }
    }

    /// Applies all received settings, or none of them (J-53). If the controller uses friction tables, it checks the table of one joint per
    /// tick.
    fn set_settings(&mut self, values: Values<'_>) -> SliceOutcome {
        let all = |taken: fn(Live) -> bool| {
            values.iter().all(|value| settings::setting(value.setting).is_some_and(|row| taken(row.live)))
        };
        // A tick always has time to apply a few settings in addition to its normal computation, so these settings are
        // accepted in every state.
        let all_live = values.len() <= LIVE_MAX && all(|live| live == Live::Always);
        let standing = self.stands()
            && values.len() <= STANDING_MAX
            && all(|live| matches!(live, Live::Standing | Live::Always));
        if !all_live && !standing && !self.settable() {
            return SliceOutcome::Refused(DataStatus::NotAllowed);
        }
        let Ok(config) = settings::with_values(&self.config, values.iter()) else {
            return SliceOutcome::Refused(DataStatus::IncorrectValue);
        };
        if all_live {
            self.set_speed(config.speed);
            return SliceOutcome::Done;
        }
        let reloaded = config.payload != self.config.payload;
        if reloaded && !self.parameters.carries(self.nodes.known_positions(), &config) {
            return SliceOutcome::Refused(DataStatus::IncorrectValue);
        }
        if standing {
            if reloaded {
                // If both the old and the new payload are empty, the payload counts as unchanged, even if its position changes.
                if config.payload.is_there() || self.config.payload.is_there() {
                    let heavier = config.payload.mass - self.config.payload.mass;
                    self.parameters.change_payload(&config, heavier);
                }
                self.config.payload = config.payload;
            }
            self.set_speed(config.speed);
            return SliceOutcome::Done;
        }
        if !matches!(self.slice_progress, SliceProgress::Pose(_)) {
            let table = if let SliceProgress::TableCheck(j) = self.slice_progress { j } else { 0 };
            let fits = if table == 0 { self.parameters.fits(&config) } else { true };
            if !fits || !self.parameters.table_fits(table, &config) {
                return SliceOutcome::Refused(DataStatus::IncorrectValue);
            }
            if self.parameters.tables_in_use().is_some() && table + 1 < JOINTS {
                return SliceOutcome::Unfinished(SliceProgress::TableCheck(table + 1));
            }
        }
        match self.parameters.look_again(self.slice_progress, &config, &self.config) {
            SliceOutcome::Done => self.use_settings(config),
            outcome => return outcome,
        }
        SliceOutcome::Done
    }

    /// Replaces the settings of the controller by `config`. The controller must be in a state without torque.
    fn use_settings(&mut self, config: Config) {
        if self.nodes.use_settings(&config, &self.config) {
            // The pump does not start again without a command of the host (J-23).
            self.pump = false;
        }
        self.config = config;
        self.parameters.set_gravity(&self.config);
        self.extensions.forget_hash();
    }

    /// Pauses the path, ends a jog and ends Teaching if no host has sent a valid frame within the timeout (J-59). `done` is the number of
    /// host events that were processed in this tick.
    pub(crate) fn watch_hosts(&mut self, inputs: &crate::Inputs<'_>, done: usize) {
        let received = inputs.urgent.iter().any(|commands| !commands.is_empty())
            || inputs.host.iter().take(done).any(|host| matches!(host.event, jtc_wire::LinkEvent::Frame(_)));
        self.extensions.jogs_refused_ms = self.extensions.jogs_refused_ms.saturating_sub(1);
        let silent = &mut self.extensions.hosts_silent_ms;
        *silent = if received { 0 } else { silent.saturating_add(1) };
        let limit = u32::from(self.config.host_timeout_ms);
        if limit == 0 || *silent < limit {
            return;
        }
        self.teaching = false;
        self.motion.set.end_jog();
        if self.trajectory == TrajectoryState::Execute && self.phase.leave().is_none() {
            self.leave_path(jtc_wire::ExecCommand::Pause);
        }
    }
}

#[cfg(test)]
mod tests;
