//! Which boards this agent has started. In doubt one counts: being stopped once more costs nothing.
use ucom_host::master::InitReport;
use ucom_host::master::update::{UpdateOutcome, UpdateReport};

use ucom::Status;
use ucom_host::session::SessionError;

use super::Hands;

impl Hands {
    /// Does what starts these boards or moves them. They count before anything is sent: a Stop or a lapse may come at any time. When
    /// it fails those count no more that it was not sent to, or that answer that they are stopped.
    pub fn starting<T>(
        &mut self,
        boards: &[u8],
        act: impl FnOnce(&mut Self) -> Result<T, SessionError>,
    ) -> Result<T, SessionError> {
        // Nothing is sent to any where one does not answer.
        for board in boards {
            self.driver.seen(*board)?;
        }
        let counted = self.started();
        boards.iter().for_each(|board| self.has_started(*board));
        let done = act(self);
        if done.is_err() {
            for board in boards.iter().filter(|board| !counted.contains(board)) {
                // Who is no master has only asked.
                let stopped = !self.driver.master.is_master() || self.is_stopped(*board);
                if stopped {
                    self.runs_no_more(Some(*board));
                }
            }
        }
        done
    }

    /// The board answers that its application does not run; it is asked also where what was begun was cancelled.
    fn is_stopped(&mut self, board: u8) -> bool {
        self.driver.seen_for_certain(board).is_ok_and(|seen| !seen.info.status.has(Status::MSTART))
    }

    /// What an update leaves of the boards: those that were written do not run any more, and may have been started anew.
    pub fn updated(&mut self, report: &UpdateReport, start: bool) {
        for result in report.boards.iter().filter(|_| !report.dry_run) {
            match result.outcome {
                // It runs on if it ran, or nobody knows.
                UpdateOutcome::NotStarted
                | UpdateOutcome::Cancelled
                | UpdateOutcome::UpToDate
                | UpdateOutcome::Unknown => {}
                UpdateOutcome::Incomplete
                | UpdateOutcome::Written
                | UpdateOutcome::Verified
                | UpdateOutcome::Running => self.forget(result.board),
            }
            let untouched = matches!(result.outcome, UpdateOutcome::NotStarted | UpdateOutcome::Cancelled);
            if start && !untouched {
                self.has_started(result.board);
            }
        }
    }

    /// Boards have new numbers, and names are of others from now on. Where not all is well, who has none now may run under the one it had,
    /// and who shows that it is started may have missed the reset.
    pub fn renumbered(&mut self, report: Option<&InitReport>) {
        match report {
            Some(report) if report.is_ok() => self.runs_no_more(None),
            Some(report) => {
                for board in &report.boards {
                    self.runs_no_more(Some(board.number));
                    if board.info.status.has(Status::MSTART) {
                        self.has_started(board.number);
                    }
                }
            }
            None => {}
        }
        self.forget_names();
    }
}
