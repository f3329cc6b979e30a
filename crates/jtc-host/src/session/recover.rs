//! The whole way back to HoldPos, whatever the state is, with each step said.

use std::time::Duration;

use jtc_wire::Status;

use super::Session;
use crate::arm::ParameterSet;
use crate::port::Port;
use crate::{Error, words};

/// Whose friction, gains and arm model a controller is given that misses some (J-55).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum ParameterSource<'a> {
    /// Nobody's: a controller that misses some is refused.
    #[default]
    None,
    /// The defaults that are built into the controller, by name.
    ControllerDefaults,
    /// Those of an arm, all of them: a controller without torque is given them whatever it has.
    Arm {
        /// Name of the arm or its file.
        name: &'a str,
        /// All three parts.
        set: &'a ParameterSet,
    },
}

/// One step of the way back.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum RecoverStep {
    /// Where the controller is.
    Found(String),
    /// A person has to act: the safety input is low.
    SafetyInput,
    /// The motion is stopped.
    Stop,
    /// Teaching is switched off.
    TeachOff,
    /// Errors are cleared: the controller's, and those of these nodes.
    Clear(Vec<String>),
    /// Nodes are reset.
    Reset(Vec<String>),
    /// Friction, gains and arm model are given, all three: those of the controller's own defaults, or of the arm of this name.
    Give(Option<String>),
    /// Nothing is given: the controller goes on with the parameters that it has.
    Keep,
    /// Nothing is given although an arm is named: the controller holds an arm with the parameters that it has.
    KeepHolding(String),
    /// Nodes come up.
    WaitNodes(Vec<String>),
    /// Done: HoldPos without errors.
    HoldPos,
}

impl std::fmt::Display for RecoverStep {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            RecoverStep::Found(line) => write!(f, "found: {line}"),
            RecoverStep::SafetyInput => {
                write!(f, "the safety input is low: release the emergency stop (waiting)")
            }
            RecoverStep::Stop => write!(f, "stopping the motion"),
            RecoverStep::TeachOff => write!(f, "switching teaching off"),
            RecoverStep::Clear(nodes) if nodes.is_empty() => write!(f, "clearing the controller's errors"),
            RecoverStep::Clear(nodes) => {
                write!(f, "clearing the errors of the controller and of {}", nodes.join(", "))
            }
            RecoverStep::Reset(nodes) => write!(f, "resetting {}", nodes.join(", ")),
            RecoverStep::Give(None) => write!(
                f,
                "friction, gains and arm model: the controller's own defaults, those of its built-in arm"
            ),
            RecoverStep::Give(Some(arm)) => write!(f, "friction, gains and arm model: those of {arm}"),
            RecoverStep::Keep => {
                write!(f, "friction, gains and arm model: those that the controller was given before")
            }
            RecoverStep::KeepHolding(arm) => write!(
                f,
                "the arm is held with the friction, gains and arm model that the controller was given before, not with those of \
                 {arm}: `jtc params push` gives them"
            ),
            RecoverStep::WaitNodes(nodes) => write!(f, "waiting for {}", nodes.join(", ")),
            RecoverStep::HoldPos => write!(f, "HoldPos, no errors"),
        }
    }
}

/// First enable of a drive takes 4 s, after a reset some more.
const NODE_TIME: Duration = Duration::from_secs(15);
/// From reset to Init.
const START_TIME: Duration = Duration::from_secs(3);
/// Effect of a command.
const EFFECT: Duration = Duration::from_millis(500);
/// How often it is looked whether a person wants it to end.
const LOOK: Duration = Duration::from_millis(100);
/// How long a person may take to release the emergency stop.
const PERSON_TIME: Duration = Duration::from_secs(60);

impl<P: Port> Session<P> {
    /// Leads the controller to HoldPos without errors. Where it misses friction, gains or arm model, `parameters` says whose it is
    /// given; no source, or one that lacks a part, is an error before anything is sent. No trajectory is resumed.
    ///
    /// # Errors
    ///
    /// [`Error::NoParameters`] and [`Error::IncompleteArm`], before anything is sent, when there is nothing to give the
    /// controller; [`Error::Device`] and [`Error::StateTimeout`] when an error does not go away; those of the line.
    pub fn recover(
        &mut self,
        parameters: ParameterSource<'_>,
        say: impl FnMut(&RecoverStep),
    ) -> Result<Status, Error> {
        self.recover_until(parameters, || false, say)
    }

    /// The same, until `ended` says that a person wants it to end: nothing more is sent then and the error is
    /// [`Error::Cancelled`], but a motion is stopped and followed to its standstill first.
    ///
    /// # Errors
    ///
    /// Those of [`Session::recover`], and [`Error::Cancelled`] once `ended` says so.
    pub fn recover_until(
        &mut self,
        parameters: ParameterSource<'_>,
        ended: impl Fn() -> bool,
        mut say: impl FnMut(&RecoverStep),
    ) -> Result<Status, Error> {
        parameters.check()?;
        let mut status = self.fresh_status()?;
        parameters.enough_for(&status)?;
        say(&RecoverStep::Found(words::waiting_for(&status)));
        if let Some(step) = parameters.kept(&status) {
            say(&step);
        }
        let mut given = false;
        let (mut resets, mut clears, mut waited) = (0u8, 0, false);
        let mut asked: Option<Duration> = None;
        let mut rounds = 0;
        while rounds < 24 {
            rounds += 1;
            if ended() && status.fsm != 3 {
                return Err(Error::Cancelled);
            }
            parameters.enough_for(&status)?;
            match status.fsm {
                1 | 5 if parameters.due(&status, given) => {
                    say(&RecoverStep::Give(parameters.arm_name()));
                    self.give(parameters)?;
                    given = true;
                    self.pause_for(Duration::from_millis(60), &ended)?;
                }
                // Errors latch: only clearing tells whether the safety input is high again.
                5 if status.errors & 1 != 0
                    && clears > 0
                    && faulty(&status) == 0
                    && status.can_current == 0 =>
                {
                    let since = *asked.get_or_insert_with(|| {
                        say(&RecoverStep::SafetyInput);
                        self.port.now()
                    });
                    if self.port.now() - since > PERSON_TIME {
                        return Err(Error::Device { status: Box::new(status) });
                    }
                    rounds -= 1;
                    self.clear(true, 0)?;
                    self.pause_for(EFFECT, &ended)?;
                }
                5 => {
                    let silent = (status.can_current >> 8 & 0x7F) as u8 & !resets;
                    if silent != 0 && clears > 0 {
                        resets |= silent;
                        say(&RecoverStep::Reset(names(silent)));
                        self.reset(silent)?;
                        self.pause_for(Duration::from_secs(1), &ended)?;
                    }
                    let nodes = faulty(&status);
                    say(&RecoverStep::Clear(names(nodes)));
                    self.clear(true, nodes)?;
                    clears += 1;
                    self.pause_for(EFFECT, &ended)?;
                    if clears > 6 {
                        return Err(Error::Device { status: Box::new(self.fresh_status()?) });
                    }
                }
                0 => {
                    self.wait_for("the end of the start-up", START_TIME, |s| s.fsm != 0 || ended())?;
                }
                1 => {
                    say(&RecoverStep::WaitNodes(words::missing_nodes(status.node_init)));
                    let reached = self.wait_for("nodes ready", NODE_TIME, |s| s.fsm > 1 || ended());
                    match reached {
                        Ok(_) => {}
                        Err(Error::StateTimeout { status: s, .. }) if !waited => {
                            waited = true;
                            say(&RecoverStep::Reset(names(s.node_init)));
                            self.reset(s.node_init)?;
                            self.pause_for(Duration::from_secs(1), &ended)?;
                        }
                        Err(e) => return Err(e),
                    }
                }
                4 => {
                    say(&RecoverStep::TeachOff);
                    self.teach(false)?;
                    self.wait_for("teaching off", Duration::from_secs(3), |s| s.fsm != 4 || ended())?;
                }
                3 => {
                    say(&RecoverStep::Stop);
                    match self.stop() {
                        Ok(()) | Err(Error::Refused { .. }) => {}
                        Err(e) => return Err(e),
                    }
                    self.wait_for("standstill", Duration::from_secs(5), |s| s.fsm != 3)?;
                }
                _ if status.errors == 0 => {
                    say(&RecoverStep::HoldPos);
                    return Ok(status);
                }
                _ => {
                    self.clear(true, 0)?;
                    self.pause_for(EFFECT, &ended)?;
                }
            }
            status = self.fresh_status()?;
        }
        Err(Error::Device { status: Box::new(status) })
    }

    fn give(&mut self, parameters: ParameterSource<'_>) -> Result<(), Error> {
        match parameters {
            ParameterSource::None => Ok(()),
            ParameterSource::ControllerDefaults => self.use_defaults(),
            ParameterSource::Arm { set, .. } => self.push(set, |_| {}).map(|_| ()),
        }
    }

    /// Lets time pass while statuses are taken in; not longer than until it is `ended`.
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

impl ParameterSource<'_> {
    /// An arm must be whole: friction, gains and arm model.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] or [`Error::IncompleteArm`] for a set that cannot be given whole.
    pub fn check(&self) -> Result<(), Error> {
        match self {
            ParameterSource::Arm { name, set } if !set.missing().is_empty() => {
                Err(Error::IncompleteArm { arm: (*name).to_owned(), missing: set.missing() })
            }
            _ => Ok(()),
        }
    }

    /// A controller that misses parameters needs a source.
    fn enough_for(&self, status: &Status) -> Result<(), Error> {
        match self {
            ParameterSource::None if status.jtc_init != 0 => {
                Err(Error::NoParameters { missing: words::missing_parameters(status.jtc_init) })
            }
            _ => Ok(()),
        }
    }

    /// An arm's parameters are given once to any controller, the defaults to one that misses some; always all three, so that those
    /// of two arms are never mixed.
    fn due(&self, status: &Status, given: bool) -> bool {
        match self {
            ParameterSource::None => false,
            ParameterSource::ControllerDefaults => status.jtc_init != 0,
            ParameterSource::Arm { .. } => status.jtc_init != 0 || !given,
        }
    }

    /// The step to report when nothing will be given.
    fn kept(&self, status: &Status) -> Option<RecoverStep> {
        match self {
            _ if status.jtc_init != 0 => None,
            ParameterSource::Arm { name, .. } => {
                matches!(status.fsm, 2..=4).then(|| RecoverStep::KeepHolding((*name).to_owned()))
            }
            ParameterSource::None | ParameterSource::ControllerDefaults => Some(RecoverStep::Keep),
        }
    }

    fn arm_name(&self) -> Option<String> {
        match self {
            ParameterSource::Arm { name, .. } => Some((*name).to_owned()),
            _ => None,
        }
    }
}

/// Nodes that report a fault of their own.
fn faulty(s: &Status) -> u8 {
    let joints = s
        .joints
        .iter()
        .enumerate()
        .filter(|(_, j)| j.errors != 0 || j.mc_current != 0 || j.mc_occurred != 0 || j.fsm >= 254);
    let mut mask = joints.fold(0, |m, (i, _)| m | 1 << i);
    if s.gripper.is_some_and(|g| g.errors != 0 || g.fsm >= 254) {
        mask |= 1 << 6;
    }
    mask
}

fn names(mask: u8) -> Vec<String> {
    words::missing_nodes(mask)
}
