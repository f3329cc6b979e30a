//! Before a board is flashed: what its controller does, and whether it may be stopped.
//!
//! A flash resets the processor. The drives get no more frames, and an arm that is held falls. So a board whose controller
//! reports torque is never flashed; and of one that does not report, or of which it is not certain that it is this controller, a
//! person has to answer for it.

use std::time::Duration;

use jtc_wire::{Code, ControllerState, Info, NodeState, Status, StoreState};

use super::drive::same_board;
use super::{Drive, FirmwareError, Fit, Image};
use crate::port::Port;
use crate::session::{Session, Timeouts};

/// A controller sends a status each 40 ms; one that sends none for this time does not run.
const SILENT: Duration = Duration::from_millis(1_500);

/// What the controller on the serial line reported.
#[derive(Clone, Debug, PartialEq)]
pub enum Answers {
    /// Nobody was asked: no port.
    NoPort,
    /// Nothing that could be read: no firmware, another one, or another rate.
    Nothing,
    /// A controller.
    Controller {
        /// Its state.
        state: Code<ControllerState>,
        /// The arm has torque.
        torque: bool,
        /// Who it is; `None` for a device without extensions.
        info: Option<Box<Info>>,
    },
}

/// What is known of a board before it is flashed.
#[derive(Clone, Debug, PartialEq)]
pub struct Before {
    /// What the controller on the line reported.
    pub answers: Answers,
    /// Line and drive are of one board; `None` where the system does not say.
    pub same_device: Option<bool>,
}

impl Before {
    /// Who the controller is.
    pub fn info(&self) -> Option<&Info> {
        match &self.answers {
            Answers::Controller { info, .. } => info.as_deref(),
            _ => None,
        }
    }

    /// The board keeps an arm that a flash might take away.
    pub fn stored_arm(&self) -> Option<bool> {
        self.info().map(|info| info.store == StoreState::Stored)
    }

    /// What somebody has to answer for before the board is flashed; `None` when its own controller reports that the arm has no torque.
    pub fn to_confirm(&self) -> Option<&'static str> {
        match (&self.answers, self.same_device) {
            (Answers::Controller { torque: false, .. }, Some(true)) => None,
            (Answers::Controller { .. }, _) => Some(
                "a controller reports that its arm has no torque, but not whether it is the board with this drive. Flashing \
                 resets the board, and an arm that it holds falls. Is its arm supported, and are its drives without power?",
            ),
            _ => Some(
                "no controller reports what the board does. Flashing resets it, and an arm that it holds falls. Is its arm \
                 supported, and are its drives without power?",
            ),
        }
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

/// Asks the controller on the line what it does.
///
/// # Errors
///
/// [`FirmwareError::Port`] when the port is gone.
pub fn look<P: Port>(session: &mut Session<P>) -> Result<Answers, FirmwareError> {
    session.timeouts = Timeouts { status: SILENT, confirmation: Duration::from_millis(300), tries: 3 };
    let status = match session.poll(SILENT) {
        Ok(Some(status)) => status,
        Ok(None) => return Ok(Answers::Nothing),
        Err(crate::LinkError::Port(e)) => return Err(FirmwareError::Port(e)),
        Err(_) => return Ok(Answers::Nothing),
    };
    // One that sends statuses and answers nothing is as good as one without extensions.
    let info = session.info().ok().flatten().map(Box::new);
    let status = session.fresh_status().unwrap_or(status);
    Ok(Answers::Controller { state: status.state, torque: has_torque(&status), info })
}

/// The arm has torque: by the state of the controller, or of a drive.
fn has_torque(status: &Status) -> bool {
    let state = [ControllerState::Init, ControllerState::Error].into_iter().all(|idle| status.state != idle);
    state || status.joints.iter().any(|joint| joint.state == NodeState::ENABLED)
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
    if let Answers::Controller { state, torque: true, .. } = before.answers {
        return Err(FirmwareError::HasTorque { state });
    }
    let runs = before.info().map(|info| info.board.as_str().to_owned());
    if let Some(runs) = runs.as_ref().filter(|runs| same_board(runs) != same_board(board)) {
        return Err(FirmwareError::OtherController { runs: runs.clone(), board: board.clone() });
    }
    let fit = drive.fit(board);
    if fit == Fit::Other {
        let named = drive.board().map(|(name, _)| name.to_owned()).unwrap_or_default();
        return Err(FirmwareError::OtherBoard { drive: drive.path.clone(), named, board: board.clone() });
    }
    // A controller on the drive's own USB device names the board, too.
    let named = fit == Fit::Same || (runs.is_some() && before.same_device == Some(true));
    if !named && !permissions.assume_board {
        return Err(FirmwareError::UnnamedBoard {
            drive: drive.path.clone(),
            label: drive.label.clone(),
            board: board.clone(),
        });
    }
    let supply_known = match &runs {
        Some(runs) => runs == board,
        None => !board.ends_with("-ldo"),
    };
    if !supply_known && !permissions.accept_supply {
        return Err(FirmwareError::Supply { board: board.clone(), runs });
    }
    Ok(())
}
