//! Recovery from any state to HoldPos. The recovery reports each step.

mod parameters;
mod source;
mod step;

use std::time::Duration;

use jtc_bus::NODES;
use jtc_wire::{ControllerState, Status, error};

pub use parameters::RecoverParameters;
pub use source::ParameterSource;
pub use step::RecoverStep;

use super::Session;
use crate::error::{Error, LinkError, StateError};
use crate::labels;
use crate::port::Port;

/// Maximum time until a node is ready. The first enable of a drive takes 4 s, and longer after a reset.
const NODE_TIME: Duration = Duration::from_secs(15);
/// Maximum time from a reset of the nodes until the controller is in Init.
const START_TIME: Duration = Duration::from_secs(3);
/// Maximum time from a Stop to standstill, including a reserve.
const STOP_TIME: Duration = Duration::from_secs(5);
/// Time from the reset of a node until it answers.
const BOOT: Duration = Duration::from_secs(1);
/// Maximum time from the confirmation of a parameter until a status shows that the controller has the parameter.
const TAKEN_IN: Duration = Duration::from_millis(60);
/// Maximum number of steps before the recovery fails.
const ACTS_MAX: u8 = 24;
/// Maximum number of times that a held stop is cleared. In the time between two attempts, a compliant joint can come
/// to rest, or an operator can free the joint.
const HELD_CLEARS: u8 = 6;
/// Maximum number of times that errors are cleared.
const CLEARS_MAX: u8 = 6;
/// Time after which a command has taken effect.
const EFFECT: Duration = Duration::from_millis(500);
/// Interval at which the recovery checks whether the user cancels.
const LOOK: Duration = Duration::from_millis(100);
/// Maximum time until the operator releases the emergency stop.
const PERSON_TIME: Duration = Duration::from_secs(60);

impl<P: Port> Session<P> {
    /// Brings the controller to HoldPos without errors. If the controller lacks friction, gains or arm model, `parameters` supplies them.
    /// If `parameters` is missing or incomplete, the function returns an error before it sends a frame. The recovery never resumes a
    /// trajectory.
    ///
    /// # Errors
    ///
    /// Returns [`NoSource`](crate::ParametersError::NoSource) and [`IncompleteArm`](crate::ParametersError::IncompleteArm), before a frame
    /// is sent, if parameters are not available. Returns [`StateError::Device`] and [`StateError::Timeout`] if an error persists. Also
    /// returns communication errors.
    pub fn recover(
        &mut self,
        parameters: ParameterSource<'_>,
        report: impl FnMut(&RecoverStep),
    ) -> Result<Status, Error> {
        self.recover_until(parameters, || false, report)
    }

    /// Like [`Session::recover`], but ends once `ended` returns `true` because the user cancels. If the arm is in motion, the recovery
    /// first stops the motion and follows the arm until it is at rest. The recovery then sends no more frames and returns
    /// [`Error::Cancelled`].
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::recover`], and [`Error::Cancelled`] once `ended` returns `true`.
    pub fn recover_until(
        &mut self,
        parameters: ParameterSource<'_>,
        ended: impl Fn() -> bool,
        mut report: impl FnMut(&RecoverStep),
    ) -> Result<Status, Error> {
        parameters.check()?;
        let status = self.fresh_status()?;
        parameters.enough_for(&status)?;
        report(&RecoverStep::Found(labels::waiting_for(&status)));
        if let Some(step) = parameters.kept(&status) {
            report(&step);
        }
        Recovery::new(self, parameters, ended, report).from(status)
    }

    fn give(&mut self, parameters: ParameterSource<'_>, ended: impl Fn() -> bool) -> Result<(), Error> {
        match parameters {
            ParameterSource::None => Ok(()),
            ParameterSource::ControllerDefaults => Ok(self.use_defaults()?),
            ParameterSource::Arm { set, .. } => self.push_until(set, ended, |_| {}).map(|_| ()),
        }
    }

    /// Receives statuses for the given time, or until `ended` returns `true`.
    fn pause_for(&mut self, time: Duration, ended: impl Fn() -> bool) -> Result<(), Error> {
        let end = self.port.now() + time;
        loop {
            let now = self.port.now();
            if now >= end || ended() {
                return Ok(());
            }
            self.poll((end - now).min(LOOK))?;
        }
    }
}

/// Recovery in progress, with the steps done so far.
struct Recovery<'a, P, Ended, Report> {
    session: &'a mut Session<P>,
    parameters: ParameterSource<'a>,
    ended: Ended,
    report: Report,
    /// `true` if parameters were sent.
    given: bool,
    /// Nodes that were reset because they were silent.
    reset: u8,
    /// Number of times that errors were cleared.
    clears: u8,
    /// Number of times that a held stop was cleared.
    held_clears: u8,
    /// `true` if nodes were reset because they were too slow to start up.
    reset_slow: bool,
    /// Time of the first message that asks the operator to release the emergency stop.
    asked: Option<Duration>,
    /// Number of steps left before the recovery fails.
    acts_left: u8,
    /// Number of Stops of other programs before the start of the recovery. If the number increases, the recovery
    /// ends.
    stops: u64,
}

impl<'a, P: Port, Ended: Fn() -> bool, Report: FnMut(&RecoverStep)> Recovery<'a, P, Ended, Report> {
    fn new(
        session: &'a mut Session<P>,
        parameters: ParameterSource<'a>,
        ended: Ended,
        report: Report,
    ) -> Self {
        let (given, reset_slow) = (false, false);
        let stops = session.port.halts().stops;
        Self {
            session,
            parameters,
            ended,
            report,
            given,
            reset: 0,
            clears: 0,
            held_clears: 0,
            reset_slow,
            asked: None,
            acts_left: ACTS_MAX,
            stops,
        }
    }

    /// Brings the controller from the state in `status` to HoldPos without errors. Executes one step for each state that the controller
    /// reports.
    fn from(&mut self, mut status: Status) -> Result<Status, Error> {
        while self.acts_left > 0 {
            self.acts_left -= 1;
            let stopped = self.session.port.halts().stops != self.stops;
            if ((self.ended)() || stopped) && status.state != ControllerState::Operate {
                return Err(Error::Cancelled);
            }
            self.parameters.enough_for(&status)?;
            match status.state.known() {
                Some(ControllerState::Start) => self.start_up()?,
                Some(ControllerState::Init | ControllerState::Error)
                    if self.parameters.due(&status, self.given) =>
                {
                    self.give()?;
                }
                Some(ControllerState::Init) => self.bring_up(&status)?,
                Some(ControllerState::HoldPos) if status.errors == 0 => {
                    (self.report)(&RecoverStep::HoldPos);
                    return Ok(status);
                }
                Some(ControllerState::HoldPos) => {
                    if self.held_clears >= HELD_CLEARS {
                        self.session.without_held_stop(&status)?;
                    }
                    self.held_clears += 1;
                    self.clear(0)?;
                }
                Some(ControllerState::Operate) => self.end_motion()?,
                Some(ControllerState::Teaching) => self.end_teaching()?,
                Some(ControllerState::Error) => self.leave_error(&status)?,
                // The controller is in a state that this program does not know, so the recovery ends.
                None => break,
            }
            status = self.session.fresh_status()?;
        }
        Err(StateError::Device { status: Box::new(status) }.into())
    }

    fn start_up(&mut self) -> Result<(), Error> {
        let begun = |s: &Status| s.state != ControllerState::Start || (self.ended)();
        self.session.wait_for("the end of the start-up", START_TIME, begun).map(drop)
    }

    fn give(&mut self) -> Result<(), Error> {
        let stored = match self.parameters {
            ParameterSource::ControllerDefaults => self.session.info()?.filter(|info| info.defaults_stored),
            _ => None,
        };
        let stored = stored.map(|info| format!("{}, the stored arm of the controller", info.arm));
        (self.report)(&RecoverStep::Give(self.parameters.arm_name().or(stored)));
        self.session.give(self.parameters, &self.ended)?;
        self.given = true;
        self.session.pause_for(TAKEN_IN, &self.ended)
    }

    fn bring_up(&mut self, status: &Status) -> Result<(), Error> {
        (self.report)(&RecoverStep::WaitNodes(labels::node_names(status.node_init)));
        let up = |s: &Status| !s.is_coming_up() || (self.ended)();
        match self.session.wait_for("nodes ready", NODE_TIME, up) {
            Err(Error::State(StateError::Timeout { status, .. })) if !self.reset_slow => {
                self.reset_slow = true;
                self.reset_nodes(status.node_init)
            }
            other => other.map(drop),
        }
    }

    fn end_motion(&mut self) -> Result<(), Error> {
        (self.report)(&RecoverStep::Stop);
        match self.session.stop() {
            Ok(()) | Err(Error::Link(LinkError::Refused { .. })) => {}
            Err(e) => return Err(e),
        }
        let stands = |s: &Status| s.state != ControllerState::Operate;
        self.session.wait_for("standstill", STOP_TIME, stands).map(drop)
    }

    fn end_teaching(&mut self) -> Result<(), Error> {
        (self.report)(&RecoverStep::TeachOff);
        self.session.teach(false)?;
        let off = |s: &Status| s.state != ControllerState::Teaching || (self.ended)();
        self.session.wait_for("teaching off", START_TIME, off).map(drop)
    }

    fn leave_error(&mut self, status: &Status) -> Result<(), Error> {
        let nodes = faulty(status);
        // Errors are latched, so the status cannot show that the safety input is high again. Only an attempt to clear
        // the errors shows it.
        let safety_input = status.errors & error::EMERGENCY_INPUT != 0;
        if safety_input && self.clears > 0 && nodes == 0 && status.can_current == 0 {
            return self.wait_for_a_person(status);
        }
        let silent = (0..NODES).filter(|n| labels::is_silent(status, *n)).fold(0, |mask, n| mask | 1 << n)
            & !self.reset;
        if silent != 0 && self.clears > 0 {
            self.reset |= silent;
            self.reset_nodes(silent)?;
        }
        (self.report)(&RecoverStep::Clear(labels::node_names(nodes)));
        self.clear(nodes)?;
        self.clears += 1;
        if self.clears > CLEARS_MAX {
            return Err(StateError::Device { status: Box::new(self.session.fresh_status()?) }.into());
        }
        Ok(())
    }

    /// Repeats the clearing of errors until the safety input is high again, for at most 60 s.
    fn wait_for_a_person(&mut self, status: &Status) -> Result<(), Error> {
        let since = *self.asked.get_or_insert_with(|| {
            (self.report)(&RecoverStep::SafetyInput);
            self.session.port.now()
        });
        if self.session.port.now() - since > PERSON_TIME {
            return Err(StateError::Device { status: Box::new(*status) }.into());
        }
        self.acts_left += 1;
        self.clear(0)
    }

    fn clear(&mut self, nodes: u8) -> Result<(), Error> {
        // If the fault persists, the caller sees it in the next status.
        self.session.clear_if_possible(true, nodes)?;
        self.session.pause_for(EFFECT, &self.ended)
    }

    fn reset_nodes(&mut self, nodes: u8) -> Result<(), Error> {
        (self.report)(&RecoverStep::Reset(labels::node_names(nodes)));
        self.session.reset(nodes)?;
        self.session.pause_for(BOOT, &self.ended)
    }
}

/// Returns the nodes that report a fault of their own.
fn faulty(s: &Status) -> u8 {
    let joints = s
        .joints
        .iter()
        .enumerate()
        .filter(|(_, j)| j.errors != 0 || j.mc_current != 0 || j.mc_occurred != 0 || j.state.is_fault());
    let mut mask = joints.fold(0, |m, (i, _)| m | 1 << i);
    if s.gripper.is_some_and(|g| g.errors != 0 || g.state.is_fault()) {
        mask |= 1 << 6;
    }
    mask
}
