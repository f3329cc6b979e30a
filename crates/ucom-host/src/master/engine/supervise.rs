//! Background tasks of the master: receiving and sending heartbeats, reactions to lost boards (`on_lost`), and
//! repeated inputs.
use crate::master::engine::boards::Life;
use crate::master::engine::event::{Event, Supervision};
use crate::master::engine::shared::{Core, Session};
use crate::master::io::Snapshot;
use ucom::profile::{AliveMode, OnLost};
use ucom::{Admin, BoardInfo, Foreign, Frame, FromBoard, Function, Report, Sequence, Status, ToBoard};

/// Time between a stop command and its repetition, µs.
const STOP_AGAIN: u64 = 30_000;

impl Core {
    /// Makes the master begin to send heartbeats.
    pub(crate) fn start_session(&mut self) {
        if self.session == Session::Quiet {
            self.session = Session::Master { next_alive: self.now };
        }
    }

    /// Performs the tasks that are due at `now`, with or without a running procedure.
    pub(crate) fn duties(&mut self) {
        let now = self.now;
        if let Session::Master { next_alive } = self.session
            && now >= next_alive
        {
            self.send_alive();
            let period = self.times.alive_pc;
            // If the caller paused for a long time, a new period begins; missed heartbeats are not sent.
            let next = if now - next_alive >= period { now + period } else { next_alive + period };
            self.session = Session::Master { next_alive: next };
        }
        let mut lost = Vec::new();
        let mut events = Vec::new();
        for (number, board) in self.boards.iter_mut() {
            let Some(at) = board.alive_at.filter(|_| board.life != Life::Unarmed) else { continue };
            // The age is computed up to `fired` and not up to `now`, because a heartbeat that was received after
            // `fired` may not be delivered yet.
            let age = self.fired.saturating_sub(at);
            if age >= self.times.alive_lost && board.life != Life::Lost {
                board.life = Life::Lost;
                events.push((number, Supervision::Lost));
                lost.push(number);
            } else if age > self.times.alive_late && board.life == Life::Alive {
                board.life = Life::Late;
                events.push((number, Supervision::Late));
            }
        }
        for (board, change) in events {
            self.event(Event::Supervision { board, change });
        }
        if !lost.is_empty() {
            self.on_lost(&lost);
        }
        self.stop_again();
        self.repeat_inputs();
    }

    fn send_alive(&mut self) {
        let mode = self.profile.alive_mode;
        let broadcast = self.profile.broadcast_number();
        if mode != AliveMode::Unicast
            && let Some(broadcast) = broadcast
        {
            self.urgent(broadcast, ToBoard::Alive);
        }
        if mode != AliveMode::Broadcast || broadcast.is_none() {
            let known: Vec<u8> =
                self.boards.iter().filter(|(_, b)| b.info.is_some()).map(|(n, _)| n).collect();
            for number in known.into_iter().filter_map(Sequence::new) {
                self.urgent(number, ToBoard::Alive);
            }
        }
    }

    /// Performs the action of the profile key `on_lost` for boards whose heartbeats have stopped. The PC stops boards
    /// only if it is the master.
    fn on_lost(&mut self, lost: &[u8]) {
        lost.iter().for_each(|board| self.stop_inputs(*board));
        if self.session == Session::Quiet {
            return;
        }
        let stopped: Vec<Sequence> = match (self.profile.on_lost, self.profile.broadcast_number()) {
            (OnLost::Report, _) => return,
            (OnLost::StopBoard, _) => lost.iter().filter_map(|n| Sequence::new(*n)).collect(),
            (OnLost::StopAll, Some(broadcast)) => vec![broadcast],
            (OnLost::StopAll, None) => self.boards.iter().filter_map(|(n, _)| Sequence::new(n)).collect(),
        };
        stopped.into_iter().for_each(|to| self.stop_running(to));
        if self.profile.on_lost == OnLost::StopAll {
            self.stop_all_inputs();
        }
    }

    /// Sends the stop command (`run = 0`) at once, and then two more times, because a single frame can be lost. A
    /// repeated stop command has no further effect.
    pub(crate) fn stop_running(&mut self, to: Sequence) {
        self.urgent(to, ToBoard::Admin(Admin::default()));
        self.stops.extend([(self.now + STOP_AGAIN, to), (self.now + 2 * STOP_AGAIN, to)]);
    }

    fn stop_again(&mut self) {
        let now = self.now;
        let due: Vec<Sequence> = self.stops.iter().filter(|(at, _)| *at <= now).map(|(_, to)| *to).collect();
        self.stops.retain(|(at, _)| *at > now);
        due.into_iter().for_each(|to| self.urgent(to, ToBoard::Admin(Admin::default())));
    }

    /// Returns the time of the next background task.
    pub(crate) fn duties_deadline(&self) -> Option<u64> {
        let alive = match self.session {
            Session::Quiet => None,
            Session::Master { next_alive } => Some(next_alive),
        };
        let supervised = self.boards.iter().filter_map(|(_, board)| {
            let at = board.alive_at?;
            match board.life {
                Life::Alive => Some(at + self.times.alive_late + 1),
                Life::Late => Some(at + self.times.alive_lost),
                Life::Unarmed | Life::Lost => None,
            }
        });
        let quiet = self.session == Session::Quiet;
        let repeats = self.data.values().filter_map(|data| data.repeat.filter(|_| !quiet));
        let inputs = repeats.map(|at| at.max(self.inputs_from));
        let stops = self.stops.iter().map(|(at, _)| *at);
        alive.into_iter().chain(supervised).chain(inputs).chain(stops).min()
    }

    /// Handles a frame from the bus.
    pub(crate) fn received(&mut self, received: Result<Frame, Foreign>) {
        self.mark_time();
        if let Ok(frame) = &received {
            self.deliver_raw(frame);
        }
        let frame = match received.and_then(|frame| frame.address().map(|address| (frame, address))) {
            Ok((frame, (function, number))) => {
                self.statistics.received(self.now, &frame);
                if self.is_pc(function, number, &frame) {
                    return self.competing_master_frame(function, number.number(), frame.data());
                }
                frame
            }
            Err(foreign) => return self.foreign(foreign),
        };
        match FromBoard::decode(&frame, &self.profile) {
            Ok((from, FromBoard::Report(report))) => self.report(from, report),
            Ok((from, message)) => self.board_message(from.number(), message),
            Err(_) => self.statistics.undecodable += 1,
        }
    }

    /// Returns `true` if only a PC can have sent this frame (D-08, D-12).
    fn is_pc(&self, function: Function, number: Sequence, frame: &Frame) -> bool {
        let broadcast = number == self.profile.unnumbered();
        match function {
            Function::DumpIo => frame.dlc() == 0,
            Function::Alive => {
                broadcast || self.boards.get(number.number()).is_some_and(|b| b.cannot_be_alive(self.now))
            }
            Function::Admin => broadcast,
            _ => !function.from_board(),
        }
    }

    fn report(&mut self, from: Sequence, report: Report) {
        let message = FromBoard::Report(report);
        let asked = self.now <= self.report_until;
        self.deliver(from.number(), message);
        if asked {
            return;
        }
        let ucom_id = report.ucom_id;
        match self.boards.with_ucom_id(ucom_id) {
            Some(board) => {
                let was_running =
                    self.boards.get(board).is_some_and(|b| b.life != Life::Unarmed || b.running(self.now));
                self.holders.forget(board);
                let known = self.boards.of(board);
                if core::mem::replace(&mut known.rebooted, true) && !was_running {
                    return;
                }
                known.application_ended();
                known.info = known.info.map(|info| BoardInfo { status: Status(0), ..info });
                self.forget_parameters(board);
                self.event(Event::Supervision { board, change: Supervision::Rebooted { ucom_id } });
                if was_running {
                    self.on_lost(&[board]);
                }
            }
            None => {
                let board = self.profile.unnumbered().number();
                self.event(Event::Supervision { board, change: Supervision::UnknownRebooted { ucom_id } });
            }
        }
    }

    /// Handles a frame of a board without a number. A board without a number can only report errors (D-06).
    fn unnumbered_message(&mut self, from: u8, message: FromBoard) {
        if let FromBoard::Error(code) = message {
            let during = self.mailboxes.keys().next().copied();
            self.event(Event::BoardError { board: from, code, during });
        } else {
            self.statistics.undecodable += 1;
        }
        // Procedures also receive the frame, because a probe must detect a board that uses the number that the
        // profile reserves for boards without a number.
        self.deliver(from, message);
    }

    fn board_message(&mut self, from: u8, message: FromBoard) {
        let now = self.now;
        if from == self.profile.unnumbered().number() {
            return self.unnumbered_message(from, message);
        }
        self.boards.of(from).last = Some((now, message.function()));
        if let FromBoard::Info(payload) = &message
            && let Some(found) = self.holders.received(from, payload, &self.profile)
        {
            self.event(Event::NumberShared { board: from, found });
        }
        match message {
            FromBoard::Alive => {
                let board = self.boards.of(from);
                board.alive_at = Some(now);
                if core::mem::replace(&mut board.life, Life::Alive) == Life::Lost {
                    self.event(Event::Supervision { board: from, change: Supervision::Back });
                }
            }
            FromBoard::Error(code) => {
                self.boards.of(from).error(now, code);
                let during = self.owner(from);
                self.event(Event::BoardError { board: from, code, during });
            }
            FromBoard::Admin(admin) => {
                let board = self.boards.of(from);
                board.stopped_at = None;
                if board.admin.replace(admin) != Some(admin) {
                    self.event(Event::Admin { board: from, admin });
                }
                if !admin.run {
                    self.stop_inputs(from);
                }
            }
            FromBoard::So(package) => {
                let board = self.boards.of(from);
                (board.so_at, board.stopped_at) = (Some(now), None);
                let snapshot = self.data.get_mut(&from).and_then(|data| data.so.push(now, &package));
                if let Some(snapshot) = snapshot.filter(|_| self.data.get(&from).is_some_and(|d| d.watched)) {
                    let snapshot: Snapshot = snapshot;
                    self.event(Event::Snapshot { board: from, snapshot });
                }
            }
            FromBoard::Debug(payload) => {
                let text = self.boards.of(from).debug_text(self.passed, &payload, &self.profile);
                if let Some(text) = text {
                    self.event(Event::Debug { board: from, text });
                }
            }
            // After PC_START, MCA_DSP_READY is the answer of the board. At other times, MCA_DSP_READY has no meaning (D-30).
            FromBoard::McaReady => {
                let board = self.boards.of(from);
                board.ready_count += 1;
                board.stopped_at = None;
            }
            _ => {}
        }
        self.deliver(from, message);
    }
}
