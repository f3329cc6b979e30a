//! Check after a Stop: after the frames of the Stop were sent, the agent queries each board.
use std::collections::BTreeSet;

use ucom::Status;
use ucom_host::master::StopLevel;
use ucom_host::session::{Boards, SessionError};

use super::Worker;
use crate::event::ChainEvent;

impl Worker {
    /// After a Stop, queries each board and stops its application. The check includes all boards that answer, and
    /// also boards that do not answer but possibly run.
    pub(super) fn see_to_stop(&mut self) {
        let was_master = self.driver.master.is_master();
        let mut wanted = self.may_run();
        let mut not_stopped = Vec::new();
        match self.driver.numbers_to_stop(&Boards::All) {
            Ok(found) => wanted.extend(found),
            // A board without a number cannot run.
            Err(SessionError::NoBoards | SessionError::NoNumbers { .. }) => {}
            Err(error) => not_stopped.push(error.to_string()),
        }
        let all = Boards::Some(wanted.iter().copied().collect());
        let mut confirmed = BTreeSet::new();
        match self.driver.stop_each(&all, StopLevel::Application) {
            Ok(stopped) => {
                confirmed.extend(stopped.boards.iter().map(|(board, _)| *board));
                not_stopped
                    .extend(stopped.failed.iter().map(|(board, error)| format!("board {board}: {error}")));
                let failed: BTreeSet<u8> = stopped.failed.iter().map(|(board, _)| *board).collect();
                let rest =
                    wanted.iter().filter(|board| !confirmed.contains(board) && !failed.contains(board));
                not_stopped.extend(
                    rest.map(|board| format!("board {board}: the board was not asked to confirm the Stop")),
                );
            }
            Err(error) => not_stopped.push(error.to_string()),
        }
        // A board that did not confirm the Stop is still listed as started until it has been stopped.
        confirmed.iter().for_each(|board| self.runs_no_more(Some(*board)));
        if !was_master {
            // A Stop does not make the agent the master of the bus. A board that has not confirmed the Stop becomes
            // safe because it receives no heartbeats, unless another master sends them.
            self.driver.master.end_session();
        }
        let boards = confirmed.into_iter().collect();
        self.local.borrow_mut().happened.push(ChainEvent::Stopped { boards, not_stopped });
        self.settle();
    }

    /// Returns the boards that possibly run: boards that this agent has started, and boards whose last known state
    /// was started or running. A board does not run after a reboot.
    fn may_run(&mut self) -> BTreeSet<u8> {
        let (boards, now_us) = (self.driver.master.boards(), self.driver.now_us());
        for (number, _) in boards.iter().filter(|(_, board)| board.rebooted) {
            self.runs_no_more(Some(number));
        }
        let seen = boards.iter().filter(|(_, board)| {
            let started = board.status().is_some_and(|status| status.has(Status::MSTART));
            started || ["started", "running"].contains(&board.state_name(now_us))
        });
        seen.map(|(number, _)| number).chain(self.started()).collect()
    }
}
