//! Check of a board before flashing. The check reads the state of the controller and decides if the controller can be
//! stopped safely.
//!
//! Flashing resets the processor of the board. The drives then receive no more frames and switch off their torque,
//! and a held arm falls. Therefore a board is never flashed while its controller reports torque. If the report is
//! incomplete, or may come from another controller, an operator must confirm the flashing.

use std::time::Duration;

use jtc_wire::{Code, ControllerState, Info, Joint, NodeState, Status, StoreState, can_flag};

use super::drive::{has_two_supplies, same_board};
use super::{Drive, FirmwareError, Fit, Image};
use crate::error::LinkError;
use crate::port::Port;
use crate::session::{Session, Timeouts};

/// Time without a status after which the program assumes that no controller is on the line. A controller sends a status every 40 ms.
const SILENT: Duration = Duration::from_millis(1_500);

/// Report of the controller on a serial line.
#[derive(Clone, Debug, PartialEq)]
pub enum Answers {
    /// No status frame was received on the line. The board may have no firmware, another firmware or another bit rate.
    Nothing {
        /// Number of bytes received on the line.
        bytes: u64,
    },
    /// A controller answers on the line.
    Controller {
        /// State of the controller.
        state: Code<ControllerState>,
        /// `true` if the arm is or may be under torque.
        torque: bool,
        /// Joints that do not answer the controller. The torque of these joints is unknown.
        silent: Vec<Joint>,
        /// `true` if the gripper is on and may hold an object.
        grips: bool,
        /// Identity of the controller; `None` if the controller has no extensions, or if the program cannot read its answer.
        info: Option<Box<Info>>,
    },
}

/// Serial line on which the board was queried.
#[derive(Clone, Debug, PartialEq)]
pub struct Asked {
    /// Name of the serial port.
    pub port: String,
    /// `true` if the serial line and the drive belong to the same USB device, and therefore to the same board. `None` if the operating
    /// system does not report the USB devices.
    pub same_device: Option<bool>,
    /// Report of the controller on this serial line.
    pub answers: Answers,
}

impl Asked {
    fn info(&self) -> Option<&Info> {
        match &self.answers {
            Answers::Controller { info, .. } => info.as_deref(),
            Answers::Nothing { .. } => None,
        }
    }

    /// Returns `true` if the serial line belongs to the board of the drive.
    fn is_own(&self) -> bool {
        self.same_device == Some(true)
    }

    /// Returns the reasons why the operator must confirm the flashing. This function does not check if the serial line belongs to the
    /// board.
    fn doubts(&self) -> Option<String> {
        match &self.answers {
            Answers::Nothing { bytes: 0 } => None,
            Answers::Nothing { .. } => Some(format!(
                "{}: bytes arrive, but contain no status: the device may use another rate (--baud).",
                self.port
            )),
            Answers::Controller { silent, grips, .. } => {
                let joints = silent.iter().map(Joint::to_string).collect::<Vec<_>>().join(", ");
                let joints = (!silent.is_empty()).then(|| {
                    format!("{}: no answer from {joints}: the torque of these joints is unknown.", self.port)
                });
                let gripper = grips
                    .then(|| format!("{}: the gripper is on and drops the part that it holds.", self.port));
                let doubts: Vec<String> = joints.into_iter().chain(gripper).collect();
                (!doubts.is_empty()).then(|| doubts.join(" "))
            }
        }
    }
}

/// Facts about a board before flashing: the controller's report on each queried serial line. If the list of lines is empty, no controller
/// was queried.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Preflight {
    /// Serial lines that were queried, each with the report of its controller.
    pub lines: Vec<Asked>,
}

impl Preflight {
    /// Returns the identities of the controllers on the serial lines of the drive's board.
    pub fn own_info(&self) -> impl Iterator<Item = &Info> {
        self.lines.iter().filter(|line| line.is_own()).filter_map(Asked::info)
    }

    /// Returns the identity of the controller on the drive's board. If this identity is unknown, returns the identity of another queried
    /// controller.
    pub fn info(&self) -> Option<&Info> {
        self.own_info().next().or_else(|| self.lines.iter().find_map(Asked::info))
    }

    /// Returns `true` if the board stores an arm. Flashing may delete this arm. Returns `None` if no controller reported its identity.
    pub fn stored_arm(&self) -> Option<bool> {
        self.info().map(|info| info.store == StoreState::Stored)
    }

    /// Returns the statement that an operator must confirm before the board is flashed with this image. Returns
    /// `None` if no confirmation is necessary. Then the controller on the drive's board reports that the torque and
    /// the gripper are off, and that each joint answers.
    pub fn to_confirm(&self, image: &Image) -> Option<String> {
        let reports = |line: &Asked| matches!(line.answers, Answers::Controller { .. });
        let mut doubts: Vec<String> = self.lines.iter().filter_map(Asked::doubts).collect();
        if !self.lines.iter().any(|line| line.is_own() && reports(line)) {
            let who = match self.lines.iter().find(|line| reports(line)) {
                Some(line) => format!(
                    "The controller at {} reports that its arm has no torque, but it may not be the board with this drive.",
                    line.port
                ),
                None => "No controller reports the state of the board.".to_owned(),
            };
            doubts.insert(0, who);
        }
        if doubts.is_empty() {
            return None;
        }
        doubts.push("Flashing resets the board, and an arm that it holds falls.".into());
        if !image.is_whole() {
            doubts.push("The program cannot verify that the file is complete before it is written.".into());
        }
        doubts.push(
            "The file does not state its safety wires (PD3 in and PD4 out, or swapped): do they match this board? Is the arm supported, and are \
             its drives without power?"
                .into(),
        );
        Some(doubts.join(" "))
    }
}

/// Statements that the operator has already confirmed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Permissions {
    /// `true` if the operator confirmed that a drive with an unknown board belongs to the board of the image.
    pub assume_board: bool,
    /// `true` if the operator confirmed that the solder bridges of the board match the core supply that the image needs.
    pub accept_supply: bool,
}

/// Requests the current state from the controller on a serial line.
///
/// # Errors
///
/// Returns [`FirmwareError::Port`] if the port is lost.
pub fn look<P: Port>(session: &mut Session<P>) -> Result<Answers, FirmwareError> {
    session.timeouts = Timeouts { status: SILENT, confirmation: Duration::from_millis(300), tries: 3 };
    let before = session.statistics().bytes_received;
    let silent =
        |session: &Session<P>| Ok(Answers::Nothing { bytes: session.statistics().bytes_received - before });
    if answered(session.poll(SILENT))?.flatten().is_none() {
        return silent(session);
    }
    // While the program waited for the operator, old status frames may have accumulated in the receive buffer. The
    // answer to this request arrives after these frames, so the next status is current.
    let info = answered(session.info())?.flatten().map(Box::new);
    match answered(session.fresh_status())? {
        Some(status) => Ok(controller(&status, info)),
        None => silent(session),
    }
}

/// Returns the result of a request, or `None` if no usable answer was received. If the port is lost, returns an error.
fn answered<T>(result: Result<T, LinkError>) -> Result<Option<T>, FirmwareError> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(LinkError::Port(e)) => Err(FirmwareError::Port(e)),
        Err(_) => Ok(None),
    }
}

fn controller(status: &Status, info: Option<Box<Info>>) -> Answers {
    let flag = |joint: &Joint| status.can_current & can_flag::no_answer(joint.index()) != 0;
    // After the start of the controller, all joints are in the state Start. A joint that is still in Start has not answered.
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

/// Returns `true` if the arm is or may be under torque. The function uses the states of the controller and of the drives.
fn has_torque(status: &Status) -> bool {
    let idle = [ControllerState::Init, ControllerState::Error].into_iter().any(|idle| status.state == idle);
    !idle || status.joints.iter().any(|joint| !is_idle(joint.state))
}

/// Returns `true` if the motor of this node is off. Returns `false` in the transitions to and from *enabled*, in the reaction to a fault,
/// and in unknown states of later drives. In these states the motor may hold, align or calibrate.
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

/// Checks that the image may be written to the board of the drive.
///
/// # Errors
///
/// Returns [`FirmwareError::HasTorque`], [`FirmwareError::OtherBoard`], [`FirmwareError::OtherController`], [`FirmwareError::UnnamedBoard`]
/// or [`FirmwareError::Supply`] if the image must not be written. If one of these errors is returned, no byte was written.
pub fn may_flash(
    image: &Image,
    drive: &Drive,
    before: &Preflight,
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
    // If the drive does not name its board, a controller on the USB device of the drive can also identify the board.
    let named = fit == Fit::Same || before.own_info().next().is_some();
    if !named && !permissions.assume_board {
        return Err(FirmwareError::UnnamedBoard {
            drive: drive.path.clone(),
            label: drive.label.clone(),
            board: board.clone(),
        });
    }
    // A program that already runs on the board proves that the board has the core supply of this program. Software
    // cannot read the solder bridges that select the supply.
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
