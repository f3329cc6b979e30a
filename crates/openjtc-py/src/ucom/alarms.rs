//! Alarms that report problems of running boards. Each alarm is raised once, as a Python exception.

use std::collections::VecDeque;
use std::sync::Mutex;

use host_kit::ErrorKind;
use ucom_host::master::{Error, IdentityError};
use ucom_host::session::{Change, SessionError};

use crate::error::Failure;
use crate::threads::lock;

/// Alarms that were not raised yet. The alarms report boards that were lost or have left their control loops, and other failures.
#[derive(Default)]
pub(super) struct Alarms(Mutex<Waiting>);

#[derive(Default)]
struct Waiting {
    lost: Vec<u8>,
    rebooted: Vec<u8>,
    left: Vec<u8>,
    /// Failures that are reported unchanged.
    others: VecDeque<Failure>,
}

impl Alarms {
    /// Records a change of a board. `runs` is `true` if this session has started the control loop of the board. `master` is `true` if
    /// this session has started an application.
    pub(super) fn changed(&self, change: Change, board: u8, (runs, master): (bool, bool)) {
        let mut waiting = lock(&self.0);
        match change {
            Change::Lost if master => waiting.lost.push(board),
            Change::Rebooted if runs => waiting.rebooted.push(board),
            Change::LeftLoop => waiting.left.push(board),
            _ => {}
        }
    }

    /// Records that another board has the number of a running board. A command to this number moves both boards.
    pub(super) fn number_shared(&self, board: u8, found: &[u16]) {
        let error = IdentityError::NumberShared { board, found: found.to_vec(), given_back: false };
        let mut own = Failure::from(SessionError::from(Error::from(error)));
        // The board already runs when the conflict is found, so this is a fault and not a refusal.
        own.kind = ErrorKind::Fault;
        self.add(own);
    }

    /// Adds a failure that is reported unchanged.
    pub(super) fn add(&self, failure: Failure) {
        lock(&self.0).others.push_back(failure);
    }

    /// Reports lost boards, and boards that have left their control loops. Each board is reported once. Later calls report the other
    /// failures, one failure per call.
    pub(super) fn check(&self) -> Result<(), Failure> {
        let (lost, rebooted, left) = {
            let mut waiting = lock(&self.0);
            let Waiting { lost, rebooted, left, .. } = &mut *waiting;
            (std::mem::take(lost), std::mem::take(rebooted), std::mem::take(left))
        };
        let all = [lost.as_slice(), &rebooted].concat();
        let error = match (all.is_empty(), left.is_empty()) {
            (true, true) => return lock(&self.0).others.pop_front().map_or(Ok(()), Err),
            (true, false) => return Err(SessionError::LeftLoop { boards: left }.into()),
            (false, _) => SessionError::Lost { lost: lost.len(), rebooted: rebooted.len() },
        };
        let list: Vec<String> = all.iter().map(u8::to_string).collect();
        let mut own = Failure::from(error);
        own.message += &format!(": board {}", list.join(", "));
        own.facts.board = all.first().copied().filter(|first| all.iter().all(|other| other == first));
        Err(own)
    }
}
