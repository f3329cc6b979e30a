//! Mastership of the bus (D-08).
use crate::master::engine::{Core, Link, MS, Session};
use crate::master::error::{Error, MasterError};
use crate::master::procedures::exchange::numbers;
use ucom::Function;

impl Link {
    /// Makes this PC the master before the first command that changes a board (D-08). The function listens for another master, and then
    /// sends ALIVE until the session ends.
    pub(crate) async fn become_master(&self, force: bool) -> Result<(), Error> {
        self.look_for_master(force).await?;
        self.with(|core| {
            if core.session == Session::Quiet {
                core.start_session();
            }
        });
        Ok(())
    }

    /// Returns `true` if this PC is the master of the bus.
    pub(crate) fn is_master(&self) -> bool {
        self.with(|core| core.session != Session::Quiet)
    }

    /// Waits until this PC has listened to the bus for `master.listen`. The function returns an error if this PC received a frame of
    /// another PC during this time (D-08). The function does nothing if this PC is already the master or if `force` is set.
    pub(crate) async fn look_for_master(&self, force: bool) -> Result<(), Error> {
        let already = self.with(|core| core.session != Session::Quiet);
        if !already && !force {
            let (since, listen, now) =
                self.with(|core| (core.since.unwrap_or(core.now), core.times.listen, core.now));
            // The time in which this PC has already listened to the bus is part of the required listening time.
            if now < since + listen {
                self.sleep(since + listen - now).await;
            }
            self.no_competing_master(listen)?;
            self.whose_heartbeats(listen).await;
            self.no_competing_master(2 * listen)?;
        }
        Ok(())
    }

    /// Returns an error if a frame of another PC was received within the last `window` µs.
    fn no_competing_master(&self, window: u64) -> Result<(), MasterError> {
        let (now, received) = self.with(|core| (core.now, core.competing_master));
        match received.filter(|(at, ..)| now.saturating_sub(*at) <= window) {
            Some((at, function, to)) => {
                Err(MasterError::CompetingMaster { function, to, ago_ms: now.saturating_sub(at) / MS })
            }
            None => Ok(()),
        }
    }

    /// Reports heartbeats that another PC sends. A heartbeat with the number of a board can come from the board, or
    /// from another PC that sends heartbeats only to this board. A board that is not started sends no heartbeats, so
    /// the status of the board shows the sender. If the board does not answer, the PC assumes that the board sent the
    /// heartbeat.
    async fn whose_heartbeats(&self, window: u64) {
        let recent =
            |core: &Core, at: Option<u64>| at.is_some_and(|at| core.now.saturating_sub(at) <= window);
        let unknown: Vec<u8> = self.with(|core| {
            let boards = core.boards.iter().filter(|(_, b)| b.info.is_none() && recent(core, b.alive_at));
            boards.map(|(number, _)| number).collect()
        });
        for board in unknown {
            let answer = numbers(self, board).await;
            let stopped = |core: &Core| core.boards.get(board).is_some_and(|b| b.stopped_at.is_some());
            if answer.is_ok() && self.with(|core| stopped(core)) {
                self.with(|core| core.competing_master_frame(Function::Alive, board, &[]));
            }
        }
    }
}
