//! Execution of the host's commands, with one response record for each command (J-04, J-06). A long command is
//! divided into slices. Each tick executes one slice.
pub(crate) mod line_upload;
pub(crate) mod priority;
pub(crate) mod slices;
mod upload;

use jtc_wire::{
    Command, DataStatus, EVENTS_MAX, ExecCommand, FrameType, FrictionImage, LinkEvent, RawPoint, Response,
    UrgentCommand,
};

use crate::config::defaults;
use crate::controller::Controller;
use crate::errors::Errors;
use crate::friction::celsius;
use crate::host_parameters::{HostParameters, read_pid};
use crate::io::{HostEvent, Inputs};
use crate::last_stop::LastStop;
use crate::nodes::GRIPPER;
use crate::parameters::PidGains;
use crate::trajectory::check;
use crate::{Config, ControllerState, JOINTS, TrajectoryState};
use line_upload::LineUpload;
use priority::Priority;
use slices::{SliceOutcome, SliceProgress};

/// Bits of the joints and of the gripper in a mask of nodes.
const JOINTS_MASK: u8 = (1 << JOINTS) - 1;
const GRIPPER_MASK: u8 = 1 << GRIPPER;

/// Returns the data status for hosts that do not use the extensions. Such hosts do not know data statuses above 6
/// (J-51).
pub(crate) fn in_plain_words(data: DataStatus) -> DataStatus {
    match data {
        DataStatus::NotAllowed | DataStatus::StartPositionMismatch => DataStatus::IncorrectValue,
        known => known,
    }
}

/// Share of a tick's time that the execution of an event has used.
enum Served {
    /// The event took a few instructions, so the tick has time for another event.
    Quickly,
    /// The event took all the time that a tick has for events.
    Fully,
    /// Only a part of the event was executed. The remainder of the event needs more ticks.
    Partly,
}

impl<M: AsRef<[RawPoint]> + AsMut<[RawPoint]>> Controller<M> {
    /// Executes urgent commands (Stop and Pause) first, then the oldest events of the host link. A tick executes all
    /// short events before the next long event. If the oldest event is long, a tick executes one slice of it. Returns
    /// the number of completed events.
    pub(crate) fn serve_host(&mut self, inputs: &Inputs<'_>) -> usize {
        for (line, commands) in inputs.urgent.iter().enumerate() {
            for (command, count) in commands.iter() {
                self.overtake(line, command, count);
            }
        }
        if inputs.host.is_empty() {
            // Most ticks have no host event. The early return skips the preparation of the loop, which takes many
            // instructions.
            return 0;
        }
        let mut done = 0;
        for event in inputs.host.iter().take(EVENTS_MAX) {
            match self.serve(event) {
                Served::Quickly => done += 1,
                Served::Fully => return done + 1,
                Served::Partly => break,
            }
        }
        done
    }

    /// Executes Stop and Pause at once, before frames that arrived earlier (J-04). Their response records are sent
    /// when their own frames are processed.
    fn overtake(&mut self, line: usize, command: UrgentCommand, count: u8) {
        let stops = command == UrgentCommand::Stop;
        self.priorities.iter_mut().for_each(|priority| priority.stopped |= stops);
        if self.execute(command.into()).is_ok()
            && let Some(priority) = self.priorities.get_mut(line)
        {
            priority.accept(command, count);
        }
    }

    /// Executes one event or a slice of the event. When the event is completed, its response record is put in the queue.
    fn serve(&mut self, received: &HostEvent<'_>) -> Served {
        let Some(priority) = self.priorities.get_mut(received.line) else { return Served::Quickly };
        let mut plain = received.plain;
        if !received.overtaken {
            *priority = Priority::default();
        }
        let (response, noise, served) = match received.event {
            LinkEvent::Bad(response) => (response, false, Served::Quickly),
            LinkEvent::Noise(response) => (response, true, Served::Quickly),
            LinkEvent::Frame(frame) => {
                let (data, served) = match Command::parse(frame) {
                    Err(status) => (status, Served::Quickly),
                    Ok(command) => {
                        if let Some(upload) = self.uploads.get_mut(received.line) {
                            plain = upload.in_plain_words(&command, plain);
                        }
                        let mut computes = false;
                        let (progress, served) = match command {
                            Command::TrajSetExecStatus(exec) if received.overtaken => {
                                (priority.overtaken(exec, self.trajectory).into(), Served::Quickly)
                            }
                            // This Jog arrived before a Stop or a Pause that has already taken effect, so it is
                            // refused.
                            Command::Jog(_) if received.overtaken => {
                                (SliceOutcome::Refused(DataStatus::NotAllowed), Served::Quickly)
                            }
                            command => {
                                let quick = self.is_quick(&command);
                                computes = matches!(command, Command::Jog(_));
                                (
                                    self.carry_out(received, command),
                                    if quick { Served::Quickly } else { Served::Fully },
                                )
                            }
                        };
                        match progress {
                            SliceOutcome::Done => (DataStatus::NoError, served),
                            // If the state does not allow a command, the refusal takes no time, so the tick can
                            // process another event. A Jog is an exception, because the controller may have computed
                            // its motion before the refusal.
                            SliceOutcome::Refused(DataStatus::NotAllowed) if !computes => {
                                (DataStatus::NotAllowed, Served::Quickly)
                            }
                            SliceOutcome::Refused(status) => (status, served),
                            SliceOutcome::Unfinished(next) => {
                                self.slice_progress = next;
                                return Served::Partly;
                            }
                        }
                    }
                };
                let data = if plain { in_plain_words(data) } else { data };
                (Response::good(frame.frame_type, data, frame.bytes.len() as u16), false, served)
            }
        };
        self.slice_progress = SliceProgress::Begin;
        self.records.push(received.line, response, noise);
        served
    }

    /// Returns `true` if the command takes only a few instructions and does not change the controller state, on which the next command may
    /// depend.
    fn is_quick(&self, command: &Command<'_>) -> bool {
        match command {
            Command::ClearCurrentErrors { .. } | Command::ClearOccurredErrors => {
                self.state != ControllerState::Error
            }
            Command::TeachingModeDisable => !self.teaching,
            Command::GripperControl { .. } => true,
            _ => false,
        }
    }

    pub(crate) fn carry_out(&mut self, received: &HostEvent<'_>, command: Command<'_>) -> SliceOutcome {
        // New parameters are refused during a jog, because they would change the torque of a moving arm.
        let jogging = self.motion.set.jogging();
        let settable =
            matches!(self.state, ControllerState::Init | ControllerState::HoldPos | ControllerState::Error)
                && !jogging
                && !self.motion.set.is_led()
                && !self.motion.law.is_yielding();
        match command {
            // J-69: while the controller still reacts to a push, an overload or another cause of a held stop, the
            // host cannot clear this cause.
            Command::ClearCurrentErrors { jtc: true, .. } | Command::ClearOccurredErrors
                if self.is_reacting() =>
            {
                SliceOutcome::Refused(DataStatus::NotAllowed)
            }
            Command::ClearCurrentErrors { jtc, nodes } => {
                if jtc {
                    self.motion.law.end_yields();
                }
                let ordered = self.nodes.clear(nodes, !self.powered());
                if ordered && jtc {
                    self.errors.clear_current();
                } else if jtc {
                    return self.clear_errors(Errors::clear_current).into();
                }
                SliceOutcome::Done
            }
            Command::ClearOccurredErrors => {
                self.motion.law.end_yields();
                let cleared = self.clear_errors(Errors::clear_occurred);
                if cleared.is_ok() {
                    self.last_stop = LastStop::default();
                }
                cleared.into()
            }
            Command::Trajectory(segment) => self.take_segment(&segment, received),
            Command::TrajSetExecStatus(exec) => self.execute(exec).into(),
            // J-53: if joints are absent, the drives on the bench do not carry the load that the model assumes.
            Command::TeachingModeEnable
                if self.state == ControllerState::HoldPos
                    && !self.joints_absent()
                    && !received.overtaken
                    && self.safety_stop_ms.is_none() =>
            {
                self.teaching = true;
                SliceOutcome::Done
            }
            Command::TeachingModeEnable => SliceOutcome::Refused(DataStatus::NotAllowed),
            Command::TeachingModeDisable => {
                self.teaching = false;
                SliceOutcome::Done
            }
            // J-23: joints are not reset in Operate, in Teaching or during a jog, because the reset would remove the
            // torque from a moving arm.
            Command::ResetCanDevices { nodes }
                if nodes & JOINTS_MASK != 0
                    && (jogging
                        || matches!(self.state, ControllerState::Operate | ControllerState::Teaching)) =>
            {
                SliceOutcome::Refused(DataStatus::NotAllowed)
            }
            Command::ResetCanDevices { nodes } => {
                self.nodes.reset(nodes);
                // The pump must not start without a command when the gripper is ready again.
                self.pump &= nodes & GRIPPER_MASK == 0;
                SliceOutcome::Done
            }
            Command::GripperControl { pump }
                if self.config.gripper && (self.state != ControllerState::Error || !pump) =>
            {
                self.pump = pump;
                SliceOutcome::Done
            }
            Command::GripperControl { .. } => SliceOutcome::Refused(DataStatus::NotAllowed),
            command if command.frame_type().is_extension() => {
                self.carry_out_extension(received.line, command)
            }
            command if settable => self.take_parameters(&command),
            _ => SliceOutcome::Refused(DataStatus::NotAllowed),
        }
    }

    /// Clears errors (J-21). If a joint still reports a fault, the controller raises this error again in the same
    /// tick. If nothing else would be cleared, the command is refused. A refused command is not repeated later, when
    /// the fault has ended.
    fn clear_errors(&mut self, clear: fn(&mut Errors)) -> Result<(), DataStatus> {
        let mut after = self.errors;
        clear(&mut after);
        let cleared = after;
        after.raise_external_joints();
        if self.nodes.fault_stays() && after == self.errors {
            return Err(DataStatus::NotAllowed);
        }
        self.errors = cleared;
        Ok(())
    }

    /// Accepts or refuses a frame with friction parameters, gains or a model.
    fn take_parameters(&mut self, command: &Command<'_>) -> SliceOutcome {
        self.extensions.forget_hash();
        if command.frame_type().is_default() {
            if self.extensions.unusable {
                // The stored arm could not be loaded or written. The built-in arm is a different arm, so the controller
                // must not use it instead (J-54).
                return SliceOutcome::Refused(DataStatus::NotAllowed);
            }
            if self.extensions.stored.is_there() {
                return self.use_stored(command.frame_type());
            }
        }
        match *command {
            Command::PidParam(floats) => read_pid(&floats).and_then(|gains| self.take_gains(&gains)).into(),
            Command::PidParamUseDefault => self.take_gains(&defaults::PID).into(),
            Command::ArmModel(floats) => {
                self.take_model(|own, progress, at, config| own.take_model(&floats, progress, at, config))
            }
            Command::ArmModelUseDefault => self.take_model(|own, progress, at, config| {
                own.set_model(&defaults::MODEL, progress, at, config)
            }),
            _ => self.take_friction(command),
        }
    }

    /// Checks and copies friction parameters in slices.
    fn take_friction(&mut self, command: &Command<'_>) -> SliceOutcome {
        let (parameters, config) = (&mut self.parameters, &self.config);
        match *command {
            Command::FrictionPolynomial(floats) => parameters.take_polynomial(&floats, config).into(),
            Command::FrictionTable(floats) => parameters.take_table(&floats, self.slice_progress, config),
            Command::FrictionPolynomialUseDefault => parameters.take_default_polynomial(config).into(),
            Command::FrictionTableUseDefault => parameters.take_default_tables(self.slice_progress, config),
            _ => SliceOutcome::Refused(DataStatus::NotAllowed),
        }
    }

    /// Checks and copies an arm model in slices. `taken` checks or copies one slice of the model.
    fn take_model(
        &mut self,
        taken: impl FnOnce(&mut HostParameters, SliceProgress, Option<&[f64; JOINTS]>, &Config) -> SliceOutcome,
    ) -> SliceOutcome {
        let at = self.nodes.known_positions();
        let outcome = taken(&mut self.parameters, self.slice_progress, at, &self.config);
        self.model_taken(outcome)
    }

    /// Tells the control law that a model was accepted while the torque was on.
    fn model_taken(&mut self, outcome: SliceOutcome) -> SliceOutcome {
        if self.powered() && matches!(outcome, SliceOutcome::Done) {
            self.motion.law.change_model();
        }
        outcome
    }

    /// Accepts or refuses gains from a host. If the torque is on, new gains must hold the present torque, and a trial of these gains begins
    /// (J-71).
    #[inline(never)]
    fn take_gains(&mut self, gains: &[PidGains; JOINTS]) -> Result<(), DataStatus> {
        self.parameters.check_pid(gains, &self.config)?;
        if self.powered() && *gains != self.parameters.pid {
            if !self.motion.law.hold_on(gains, &self.config) {
                return Err(DataStatus::IncorrectValue);
            }
            let before = self.parameters.pid;
            self.parameters.trial.begin(&before, gains);
            self.motion.change_gains(gains);
        }
        self.parameters.put_pid(gains);
        Ok(())
    }

    /// Executes a UseDefault frame with the parameters of the stored arm, if an arm is stored (J-54).
    #[inline(never)]
    fn use_stored(&mut self, frame_type: FrameType) -> SliceOutcome {
        let Self { extensions, parameters, config, nodes, .. } = self;
        let Some(arm) = extensions.stored.arm() else {
            return SliceOutcome::Refused(DataStatus::NotAllowed);
        };
        match frame_type {
            FrameType::PidParamUseDefault => {
                read_pid(&arm.pid).and_then(|gains| self.take_gains(&gains)).into()
            }
            FrameType::ArmModelUseDefault => {
                let at = nodes.known_positions();
                let outcome = parameters.take_model(&arm.model, self.slice_progress, at, config);
                self.model_taken(outcome)
            }
            // The stored arm contains one kind of friction, which is used for both friction requests of a host.
            _ => match arm.friction {
                FrictionImage::Polynomial(floats) => parameters.take_polynomial(&floats, config).into(),
                FrictionImage::Table(floats) => parameters.take_table(&floats, self.slice_progress, config),
            },
        }
    }

    /// Returns `true` if a held stop is latched, a joint yields (J-69), or the safety input stops the arm (J-22).
    pub(crate) fn stops_held(&self) -> bool {
        self.errors.held_stop() || self.motion.law.any_yields() || self.safety_stop_ms.is_some()
    }

    /// Returns `true` if joints are marked as absent (J-53).
    fn joints_absent(&self) -> bool {
        self.config.absent.contains(&true)
    }

    /// Executes Execute, Pause or Stop (J-34).
    fn execute(&mut self, command: ExecCommand) -> Result<(), DataStatus> {
        // J-30: a Stop during a jog also drops the upload.
        let dropped = command == ExecCommand::Stop && self.store.drop_upload();
        // A Stop or a Pause makes the controller hold the arm. Therefore both commands also end Teaching, or cancel a request for Teaching.
        let taught = command != ExecCommand::Execute && core::mem::take(&mut self.teaching);
        if command != ExecCommand::Execute && self.stop_jog() {
            return Ok(());
        }
        match (self.trajectory, command) {
            // J-33: while the arm stops on the path, a Pause is refused, because it must not turn the Stop into a
            // Pause.
            (TrajectoryState::Execute, ExecCommand::Pause)
                if self.phase.leave() == Some(TrajectoryState::Stop) =>
            {
                Err(DataStatus::NotAllowed)
            }
            // Execute is refused after a request for Teaching was accepted, during a jog or a held stop, and while
            // joints are absent (J-53). Execute is also refused until an arm that a hand has moved is at rest.
            (_, ExecCommand::Execute)
                if self.teaching
                    || self.motion.set.is_led()
                    || self.motion.set.jogging()
                    || self.joints_absent()
                    || self.stops_held() =>
            {
                Err(DataStatus::NotAllowed)
            }
            // J-30: a Stop arrived during the upload of this trajectory, so Execute is refused.
            (TrajectoryState::Stop | TrajectoryState::Finish, ExecCommand::Execute)
                if self.store.stopped() =>
            {
                self.check_verdict()?;
                Err(DataStatus::NotAllowed)
            }
            (TrajectoryState::Stop | TrajectoryState::Finish, ExecCommand::Execute) => {
                self.check_verdict()?;
                self.check_trust()?;
                self.check_friction()?;
                self.start_path()?;
                self.uploads.iter_mut().for_each(LineUpload::executed);
                Ok(())
            }
            (TrajectoryState::Pause, ExecCommand::Execute) => {
                self.check_trust()?;
                self.check_friction()?;
                self.resume_path()?;
                self.uploads.iter_mut().for_each(LineUpload::executed);
                Ok(())
            }
            (TrajectoryState::Execute, ExecCommand::Pause | ExecCommand::Stop) => {
                self.leave_path(command);
                Ok(())
            }
            (TrajectoryState::Pause | TrajectoryState::Finish, ExecCommand::Stop) => {
                self.set_trajectory(TrajectoryState::Stop);
                Ok(())
            }
            _ if dropped || taught => Ok(()),
            _ => Err(DataStatus::NotAllowed),
        }
    }

    /// Refuses to execute a trajectory in which the check has found a violation (J-36). The violation is recorded as an occurred error.
    fn check_verdict(&mut self) -> Result<(), DataStatus> {
        let Some(violation) = self.store.refused() else { return Ok(()) };
        let error = |j: usize| if j == violation.joint { violation.joint_error() } else { 0 };
        self.errors.occur_joints(&core::array::from_fn(error));
        self.violation = Some(violation);
        Err(DataStatus::IncorrectValue)
    }

    /// Checks that the bearing temperatures are inside the friction table (J-36). If friction parameters have arrived
    /// after the trajectory, the velocities of the path must also be inside the table. No other parameter that is
    /// accepted in HoldPos affects this check.
    fn check_friction(&mut self) -> Result<(), DataStatus> {
        let Some(tables) = self.parameters.tables_in_use() else { return Ok(()) };
        let temperatures = core::array::from_fn(|j| celsius(self.nodes.node(j).report.temperature));
        let mut verdict = check::temperatures_inside(&temperatures, tables);
        if self.parameters.friction_is_new {
            verdict = verdict.and(check::inside_tables(self.store.speeds(), tables));
        }
        verdict.map_err(|violation| {
            self.violation = Some(violation);
            DataStatus::IncorrectValue
        })
    }
}

#[cfg(test)]
mod tests;
