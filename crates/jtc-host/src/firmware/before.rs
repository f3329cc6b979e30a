//! Before a board is flashed: what its controller does, and whether it may be stopped.
//!
//! A flash resets the processor. The drives get no more frames, and an arm that is held falls. So a board whose controller
//! reports torque is never flashed; and of one that does not report all of it, or of which it is not certain that it is this controller,
//! a person has to answer for it.

use std::time::Duration;

use jtc_wire::{Code, ControllerState, Info, Joint, NodeState, Status, StoreState, can_flag};

use super::drive::{has_two_supplies, same_board};
use super::{Drive, FirmwareError, Fit, Image};
use crate::error::LinkError;
use crate::port::Port;
use crate::session::{Session, Timeouts};

/// A controller sends a status each 40 ms; one that sends none for this time does not run.
const SILENT: Duration = Duration::from_millis(1_500);

/// What the controller on a serial line reported.
#[derive(Clone, Debug, PartialEq)]
pub enum Answers {
    /// Nothing that could be read: no firmware, another one, or another rate.
    Nothing {
        /// Bytes that arrived all the same.
        bytes: u64,
    },
    /// A controller.
    Controller {
        /// Its state.
        state: Code<ControllerState>,
        /// The arm has torque.
        torque: bool,
        /// Joints that do not answer the controller: what they do is not known.
        silent: Vec<Joint>,
        /// The gripper is on: it may hold a part.
        grips: bool,
        /// Who it is; `None` where it did not report it, be it without extensions or not understood.
        info: Option<Box<Info>>,
    },
}

/// A serial line that was asked.
#[derive(Clone, Debug, PartialEq)]
pub struct Asked {
    /// Its port.
    pub port: String,
    /// Line and drive are of one USB device, so of one board; `None` where the system does not say.
    pub same_device: Option<bool>,
    /// What the controller on it reported.
    pub answers: Answers,
}

impl Asked {
    fn info(&self) -> Option<&Info> {
        match &self.answers {
            Answers::Controller { info, .. } => info.as_deref(),
            Answers::Nothing { .. } => None,
        }
    }

    /// It is the board's own line.
    fn is_own(&self) -> bool {
        self.same_device == Some(true)
    }

    /// What speaks against a flash without a question, beside whose line it is.
    fn doubts(&self) -> Option<String> {
        match &self.answers {
            Answers::Nothing { bytes: 0 } => None,
            Answers::Nothing { .. } => Some(format!(
                "{}: bytes arrive, and no status can be read: something runs at another rate (--baud).",
                self.port
            )),
            Answers::Controller { silent, grips, .. } => {
                let joints = silent.iter().map(Joint::to_string).collect::<Vec<_>>().join(", ");
                let joints = (!silent.is_empty())
                    .then(|| format!("{}: no answer from {joints}: torque is not known there.", self.port));
                let gripper = grips.then(|| {
                    format!("{}: the gripper is on, and a part that it holds is dropped.", self.port)
                });
                let doubts: Vec<String> = joints.into_iter().chain(gripper).collect();
                (!doubts.is_empty()).then(|| doubts.join(" "))
            }
        }
    }
}

/// What is known of a board before it is flashed: what was reported on each line that was asked. No line: nobody was asked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Before {
    /// The lines.
    pub lines: Vec<Asked>,
}

impl Before {
    /// Who the controllers on the board's own lines are.
    pub fn own_info(&self) -> impl Iterator<Item = &Info> {
        self.lines.iter().filter(|line| line.is_own()).filter_map(Asked::info)
    }

    /// Who the controller is: the board's own, or else another one that was asked.
    pub fn info(&self) -> Option<&Info> {
        self.own_info().next().or_else(|| self.lines.iter().find_map(Asked::info))
    }

    /// The board keeps an arm that a flash might take away.
    pub fn stored_arm(&self) -> Option<bool> {
        self.info().map(|info| info.store == StoreState::Stored)
    }

    /// What somebody has to answer for before the board is flashed with this image; `None` when its own controller reports that the arm
    /// has no torque, each of its joints answers, and the gripper is off.
    pub fn to_confirm(&self, image: &Image) -> Option<String> {
        let reports = |line: &Asked| matches!(line.answers, Answers::Controller { .. });
        let mut doubts: Vec<String> = self.lines.iter().filter_map(Asked::doubts).collect();
        if !self.lines.iter().any(|line| line.is_own() && reports(line)) {
            let who = match self.lines.iter().find(|line| reports(line)) {
                Some(line) => format!(
                    "The controller at {} reports that its arm has no torque, but not whether it is the board with this drive.",
                    line.port
                ),
                None => "No controller reports what the board does.".to_owned(),
            };
            doubts.insert(0, who);
        }
        if doubts.is_empty() {
            return None;
        }
        doubts.push("Flashing resets the board, and an arm that it holds falls.".into());
        if !image.is_whole() {
            doubts.push("That the file is not cut short cannot be proved before it is written.".into());
        }
        doubts.push(
            "No file reports how its safety wires are (PD3 in and PD4 out, or swapped): are they as on this board? Is its arm \
             supported, and are its drives without power?"
                .into(),
        );
        Some(doubts.join(" "))
    }
}

/// What a person has answered for beforehand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Permissions {
    /// The drive that does not name its board is that of the image's board.
    pub assume_board: bool,
    /// The board's solder bridges are set to the core supply of the image.
    pub accept_supply: bool,
}

/// Asks the controller on a line what it does now.
///
/// # Errors
///
/// [`FirmwareError::Port`] when the port is gone.
pub fn look<P: Port>(session: &mut Session<P>) -> Result<Answers, FirmwareError> {
    session.timeouts = Timeouts { status: SILENT, confirmation: Duration::from_millis(300), tries: 3 };
    let before = session.statistics().bytes_received;
    let silent =
        |session: &Session<P>| Ok(Answers::Nothing { bytes: session.statistics().bytes_received - before });
    if answered(session.poll(SILENT))?.flatten().is_none() {
        return silent(session);
    }
    // Waiting for the answer passes over all that had arrived while nobody read, which may be minutes of a question.
    let info = answered(session.info())?.flatten().map(Box::new);
    match answered(session.fresh_status())? {
        Some(status) => Ok(controller(&status, info)),
        None => silent(session),
    }
}

/// What the line returned; `None` where it was not understood. A port that has gone is an error.
fn answered<T>(result: Result<T, LinkError>) -> Result<Option<T>, FirmwareError> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(LinkError::Port(e)) => Err(FirmwareError::Port(e)),
        Err(_) => Ok(None),
    }
}

fn controller(status: &Status, info: Option<Box<Info>>) -> Answers {
    let flag = |joint: &Joint| status.can_current & can_flag::no_answer(joint.index()) != 0;
    // One that has not answered yet has the state with which all begin.
    let begins = |joint: &Joint| status.joints[joint.index()].state == NodeState::START;
    let grips = status.gripper.is_some_and(|gripper| gripper.pump != 0 || !is_idle(gripper.state));
    Answers::Controller {
        state: status.state,
        torque: has_torque(status),
        silent: Joint::ALL.into_iter().filter(|joint| flag(joint) || begins(joint)).collect(),
        grips,
        info,
    }
}

/// The arm has torque, or may have: by the state of the controller, or of a drive.
fn has_torque(status: &Status) -> bool {
    let idle = [ControllerState::Init, ControllerState::Error].into_iter().any(|idle| status.state == idle);
    !idle || status.joints.iter().any(|joint| !is_idle(joint.state))
}

/// The motor of this node is off. Not so on the way to and from *enabled*, in the reaction to a fault, and in all that later drives may
/// report: they may hold, align or calibrate.
fn is_idle(state: NodeState) -> bool {
    [
        NodeState::START,
        NodeState::START_TO_INIT,
        NodeState::INIT,
        NodeState::INIT_TO_READY,
        NodeState::READY,
        NodeState::FAULT,
    ]
    .contains(&state)
}

/// Whether this image may go onto this drive's board.
///
/// # Errors
///
/// [`FirmwareError::HasTorque`], [`FirmwareError::OtherBoard`], [`FirmwareError::OtherController`],
/// [`FirmwareError::UnnamedBoard`] and [`FirmwareError::Supply`]: nothing was written.
pub fn may_flash(
    image: &Image,
    drive: &Drive,
    before: &Before,
    permissions: Permissions,
) -> Result<(), FirmwareError> {
    let board = &image.record().board;
    for line in &before.lines {
        if let Answers::Controller { state, torque: true, .. } = line.answers {
            return Err(FirmwareError::HasTorque { port: line.port.clone(), state });
        }
    }
    for line in &before.lines {
        if let Some(info) = line.info().filter(|info| same_board(info.board.as_str()) != same_board(board)) {
            let (port, runs) = (line.port.clone(), info.board.as_str().to_owned());
            return Err(FirmwareError::OtherController { port, runs, board: board.clone() });
        }
    }
    let fit = drive.fit(board);
    if fit == Fit::Other {
        let named = drive.board().map(|(name, _)| name.to_owned()).unwrap_or_default();
        return Err(FirmwareError::OtherBoard { drive: drive.path.clone(), named, board: board.clone() });
    }
    // A controller on the drive's own USB device names the board, too.
    let named = fit == Fit::Same || before.own_info().next().is_some();
    if !named && !permissions.assume_board {
        return Err(FirmwareError::UnnamedBoard {
            drive: drive.path.clone(),
            label: drive.label.clone(),
            board: board.clone(),
        });
    }
    // What runs on the board has its supply; nothing else says how its solder bridges are.
    let mut runs = before.own_info().map(|info| info.board.as_str());
    let runs_this = runs.next().is_some_and(|runs| runs == board) && runs.all(|runs| runs == board);
    let supply_known = !has_two_supplies(board) || runs_this;
    if !supply_known && !permissions.accept_supply {
        let runs = before.own_info().find(|info| info.board.as_str() != board);
        let runs = runs.map(|info| info.board.as_str().to_owned());
        return Err(FirmwareError::Supply { board: board.clone(), runs });
    }
    Ok(())
}
