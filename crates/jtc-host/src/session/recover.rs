//! The whole way back to HoldPos, whatever the state is, with each step said.

use std::time::Duration;

use jtc_wire::Status;

use super::Session;
use crate::arm::ParameterSet;
use crate::port::Port;
use crate::{Error, words};

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
    /// Parameters are given: these names.
    Parameters(Vec<&'static str>),
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
            RecoverStep::Parameters(names) => write!(f, "giving {}", names.join(", ")),
            RecoverStep::WaitNodes(nodes) => write!(f, "waiting for {}", nodes.join(", ")),
            RecoverStep::HoldPos => write!(f, "HoldPos, no errors"),
        }
    }
}

/// First enable of a drive takes 4 s, after a reset some more.
const NODE_TIME: Duration = Duration::from_secs(15);
/// Effect of a command.
const EFFECT: Duration = Duration::from_millis(500);
/// How long a person may take to release the emergency stop.
const PERSON_TIME: Duration = Duration::from_secs(60);

impl<P: Port> Session<P> {
    /// Leads the controller to HoldPos without errors. Missing parameters are taken from `parameters`, else the controller's
    /// defaults are used. No trajectory is resumed.
    pub fn recover(
        &mut self,
        parameters: Option<&ParameterSet>,
        mut say: impl FnMut(&RecoverStep),
    ) -> Result<Status, Error> {
        let mut status = self.fresh_status()?;
        say(&RecoverStep::Found(words::waiting_for(&status)));
        let (mut resets, mut clears, mut waited) = (0u8, 0, false);
        let mut asked: Option<Duration> = None;
        let mut rounds = 0;
        while rounds < 24 {
            rounds += 1;
            match status.fsm {
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
                    self.pause_for(EFFECT)?;
                }
                5 => {
                    let silent = (status.can_current >> 8 & 0x7F) as u8 & !resets;
                    if silent != 0 && clears > 0 {
                        resets |= silent;
                        say(&RecoverStep::Reset(names(silent)));
                        self.reset(silent)?;
                        self.pause_for(Duration::from_secs(1))?;
                    }
                    let nodes = faulty(&status);
                    say(&RecoverStep::Clear(names(nodes)));
                    self.clear(true, nodes)?;
                    clears += 1;
                    self.pause_for(EFFECT)?;
                    if clears > 6 {
                        return Err(Error::Device { status: Box::new(self.fresh_status()?) });
                    }
                }
                0 | 1 if status.jtc_init != 0 => {
                    let missing = words::missing_parameters(status.jtc_init);
                    say(&RecoverStep::Parameters(missing));
                    self.give(status.jtc_init, parameters)?;
                    self.pause_for(Duration::from_millis(60))?;
                }
                0 | 1 => {
                    say(&RecoverStep::WaitNodes(words::missing_nodes(status.node_init)));
                    let reached = self.wait_for("nodes ready", NODE_TIME, |s| s.fsm != 0 && s.fsm != 1);
                    match reached {
                        Ok(_) => {}
                        Err(Error::StateTimeout { status: s, .. }) if !waited => {
                            waited = true;
                            say(&RecoverStep::Reset(names(s.node_init)));
                            self.reset(s.node_init)?;
                            self.pause_for(Duration::from_secs(1))?;
                        }
                        Err(e) => return Err(e),
                    }
                }
                4 => {
                    say(&RecoverStep::TeachOff);
                    self.teach(false)?;
                    self.wait_for("teaching off", Duration::from_secs(3), |s| s.fsm != 4)?;
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
                    self.pause_for(EFFECT)?;
                }
            }
            status = self.fresh_status()?;
        }
        Err(Error::Device { status: Box::new(status) })
    }

    fn give(&mut self, missing: u8, parameters: Option<&ParameterSet>) -> Result<(), Error> {
        use super::Parameter::{ArmModel, FrictionPolynomial, Pid};
        let given = parameters.cloned().unwrap_or_default();
        let wanted = |bit: u8| missing >> bit & 1 == 1;
        let set = ParameterSet {
            friction: given.friction.filter(|_| wanted(0)),
            pid: given.pid.filter(|_| wanted(1)),
            model: given.model.filter(|_| wanted(2)),
        };
        let defaults = [
            (wanted(0) && set.friction.is_none(), FrictionPolynomial),
            (wanted(1) && set.pid.is_none(), Pid),
            (wanted(2) && set.model.is_none(), ArmModel),
        ];
        self.push(&set, |_| {})?;
        for (needed, parameter) in defaults {
            if needed {
                self.use_default(parameter)?;
            }
        }
        Ok(())
    }

    /// Lets time pass while statuses are taken in.
    fn pause_for(&mut self, time: Duration) -> Result<(), Error> {
        let end = self.port.now() + time;
        loop {
            let now = self.port.now();
            if now >= end {
                return Ok(());
            }
            self.poll(end - now)?;
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
