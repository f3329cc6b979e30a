//! What has happened to boards that run, and is raised as an error, once.

use std::collections::VecDeque;
use std::sync::Mutex;

use host_kit::ErrorKind;
use ucom_host::master::{Error, IdentityError};
use ucom_host::session::{Change, SessionError};

use super::shared::lock;
use crate::error::Failure;

/// Boards that were lost or have left their loops, and what else was not reported as an error yet.
#[derive(Default)]
pub struct Alarms(Mutex<Waiting>);

#[derive(Default)]
struct Waiting {
    lost: Vec<u8>,
    rebooted: Vec<u8>,
    left: Vec<u8>,
    /// What is reported as it is.
    others: VecDeque<Failure>,
}

impl Alarms {
    /// A board changed. `runs`: this session has started its control loop; `master`: that or another board's application.
    pub fn changed(&self, change: Change, board: u8, (runs, master): (bool, bool)) {
        let mut waiting = lock(&self.0);
        match change {
            Change::Lost if master => waiting.lost.push(board),
            Change::Rebooted if runs => waiting.rebooted.push(board),
            Change::LeftLoop => waiting.left.push(board),
            _ => {}
        }
    }

    /// Another board has the number of one that runs: what is commanded to one moves both.
    pub fn number_shared(&self, board: u8, found: &[u16]) {
        let error = IdentityError::NumberShared { board, found: found.to_vec(), given_back: false };
        let mut own = Failure::from(SessionError::from(Error::from(error)));
        // What was found while it runs is no refusal.
        own.kind = ErrorKind::Fault;
        self.add(own);
    }

    /// Something that is reported as it is.
    pub fn add(&self, failure: Failure) {
        lock(&self.0).others.push_back(failure);
    }

    /// Reports, once, that boards were lost or have left their loops, then what else there is, one after the other.
    pub fn check(&self) -> Result<(), Failure> {
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
