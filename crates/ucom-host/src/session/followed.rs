//! Supervises the boards of a run: which boards have left their control loops, and how old the values of each board
//! are.
//!
//! A board can leave its control loop without a command from this PC: because heartbeats of this PC are missing,
//! because another PC stops the board, or because the application ends the loop. The board reports the end of its
//! control loop in a single MCA_ADMIN_DATA frame. If this frame is lost, the PC still detects that the sensor outputs
//! of the board have stopped, and the master then reads the board's status.

use std::collections::BTreeMap;

use ucom::Status;
use ucom::profile::OnLost;

use super::error::SessionError;
use crate::master::io::Snapshot;
use crate::master::{Board, Event, Life, Master, Outcome, ProcedureId, Request, Supervision};

/// Age in µs above which the last outputs of a board are considered old. Outputs of a board normally arrive every few milliseconds.
const OLD_US: u64 = 500_000;
/// Minimum time in µs between queries to a board that sends heartbeats but no outputs.
const ASK_US: u64 = 1_000_000;
/// Time in µs without any board in its control loop after which a run has ended.
const OVER_US: u64 = 3_000_000;

/// Change of a board's state during a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// A heartbeat of the board is late.
    Late,
    /// The heartbeats of the board have ended.
    Lost,
    /// The board sends heartbeats again.
    Back,
    /// The board has rebooted.
    Rebooted,
    /// The board left its control loop without a command of this PC.
    LeftLoop,
    /// The board was stopped because another board was lost.
    StoppedByPolicy,
    /// The board is in its control loop again.
    InLoop,
}

impl Change {
    /// Returns a short name of the change for JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Late => "late",
            Self::Lost => "lost",
            Self::Back => "back",
            Self::Rebooted => "rebooted",
            Self::LeftLoop => "left-loop",
            Self::StoppedByPolicy => "stopped-by-policy",
            Self::InLoop => "in-loop",
        }
    }
}

/// Change of a board's state that is shown to the user at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Notice {
    /// Board number.
    pub board: u8,
    /// Change of the board's state.
    pub change: Change,
    /// Time of the change in s.
    pub time_s: f64,
    /// Age of the board's last outputs in s; `None` if the board has sent no outputs, or if the change concerns heartbeats.
    pub age_s: Option<f64>,
}

impl Notice {
    /// Returns `true` if the notice concerns the control loop. Other notices concern heartbeats.
    pub fn is_of_loop(&self) -> bool {
        matches!(self.change, Change::LeftLoop | Change::StoppedByPolicy | Change::InLoop)
    }

    /// Returns the text of the notice; returns `None` if the driver shows the event itself.
    pub fn text(&self) -> Option<String> {
        let board = self.board;
        let age = self.age_s.map_or_else(|| "none received".to_owned(), |s| format!("{s:.1} s old"));
        let what = match self.change {
            Change::LeftLoop => {
                format!("has left its control loop by itself; its last outputs: {age}, stale")
            }
            Change::StoppedByPolicy => {
                format!("was stopped because a board was lost; its last outputs: {age}, stale")
            }
            Change::InLoop => "is in its control loop again".into(),
            _ => return None,
        };
        Some(format!("board {board} {what}"))
    }
}

/// Boards of a run, with the state of each board.
#[derive(Default)]
pub struct Followed {
    boards: BTreeMap<u8, One>,
    asking: Option<ProcedureId>,
    /// Time since which no board has been in its control loop, µs.
    nobody_since: Option<u64>,
}

#[derive(Default)]
struct One {
    last: Option<Snapshot>,
    out: bool,
    /// `true` if any board was lost or has rebooted since this board started to run. With `on_lost`, this loss or reboot may be the reason
    /// for the stop of this board.
    lost: bool,
    /// `true` if the board left its control loop before any board was lost or had rebooted.
    left: bool,
    /// `true` if the status byte of the board shows that the board has left its control loop. In this case, the PC did not receive the
    /// board's own report about the end of the loop.
    status_out: bool,
    asked_us: u64,
}

impl Followed {
    /// Creates the list of the boards that run now.
    pub fn new(boards: impl Iterator<Item = u8>, now_us: u64) -> Self {
        let mut new = Self::default();
        new.add(&boards.collect::<Vec<_>>(), now_us);
        new
    }

    /// Adds boards to the supervision that run now or have been restarted. The state of other boards does not change.
    pub fn add(&mut self, boards: &[u8], now_us: u64) {
        for board in boards {
            let one = self.boards.entry(*board).or_default();
            *one = One { last: one.last.take(), asked_us: now_us, ..One::default() };
        }
        self.nobody_since = None;
    }

    /// Removes a board from the supervision.
    pub fn remove(&mut self, board: u8) {
        self.boards.remove(&board);
    }

    /// Handles an event of the bus. The function returns a notice if the state of a board changed; the driver shows the event's own text.
    pub fn see(&mut self, event: &Event, now_us: u64) -> Option<Notice> {
        match event {
            Event::Snapshot { board, snapshot } => {
                let one = self.boards.get_mut(board)?;
                one.last = Some(snapshot.clone());
                one.status_out = false;
            }
            Event::Done { id, result } if self.asking == Some(*id) => {
                self.asking = None;
                if let Ok(Outcome::Info(seen)) = result
                    && let Some(one) = self.boards.get_mut(&seen.number)
                {
                    one.status_out = !seen.info.status.has(Status::MCARUN);
                }
            }
            Event::Supervision { board, change } => {
                let change = match change {
                    Supervision::Late => Change::Late,
                    Supervision::Lost => Change::Lost,
                    Supervision::Back => Change::Back,
                    Supervision::Rebooted { .. } | Supervision::UnknownRebooted { .. } => Change::Rebooted,
                };
                let followed = self.boards.contains_key(board);
                if change == Change::Lost || (change == Change::Rebooted && followed) {
                    self.boards.values_mut().for_each(|one| one.lost = true);
                }
                return Some(Notice { board: *board, change, time_s: seconds(now_us), age_s: None });
            }
            _ => {}
        }
        None
    }

    /// Returns the boards that have left or re-entered their control loops since the last call. The function reads the status of boards
    /// that send no outputs.
    pub fn look(&mut self, master: &mut Master, now_us: u64) -> Vec<Notice> {
        let boards = master.boards();
        let (mut notices, mut silent) = (Vec::new(), None);
        for (number, one) in &mut self.boards {
            let Some(board) = boards.get(*number) else { continue };
            let out = board.admin.is_some_and(|admin| !admin.run) || one.status_out;
            if out != one.out {
                one.out = out;
                one.left |= out && !one.lost;
                let age_s = one.last.as_ref().map(|last| age_s(last, now_us));
                let change = match (out, one.lost) {
                    (true, false) => Change::LeftLoop,
                    (true, true) => Change::StoppedByPolicy,
                    (false, _) => Change::InLoop,
                };
                notices.push(Notice { board: *number, change, time_s: seconds(now_us), age_s });
            }
            let quiet = board.so_at.is_some_and(|at| now_us.saturating_sub(at) > OLD_US);
            if quiet && !out && board.life == Life::Alive && now_us.saturating_sub(one.asked_us) > ASK_US {
                silent = silent.or(Some(*number));
            }
        }
        if let Some(board) = silent.filter(|_| self.asking.is_none() && !master.is_busy()) {
            self.asking = master.start(now_us, Request::Info { board }).ok();
            if let Some(one) = self.boards.get_mut(&board) {
                one.asked_us = now_us;
            }
        }
        notices
    }

    /// Returns `true` if the run has ended: every board has left its control loop, has rebooted, or was lost and
    /// stopped by `on_lost`. Only a new run can start the control loop of such a board again. With `on_lost =
    /// report`, the run does not end because of a lost board, which may still be in its control loop.
    pub fn is_over(&mut self, master: &Master, now_us: u64) -> bool {
        let boards = master.boards();
        let waits_for_lost = master.profile().on_lost == OnLost::Report;
        let ended = |(number, one): (&u8, &One)| {
            let gone = |board: &Board| board.rebooted || (board.life == Life::Lost && !waits_for_lost);
            one.out || boards.get(*number).is_some_and(gone)
        };
        if !self.boards.iter().all(ended) {
            self.nobody_since = None;
            return false;
        }
        now_us.saturating_sub(*self.nobody_since.get_or_insert(now_us)) >= OVER_US
    }

    /// Cancels the status query in progress, so that the next request does not find the board busy.
    pub fn ask_no_more(&mut self, master: &mut Master) {
        if let Some(id) = self.asking.take() {
            master.cancel(id);
        }
    }

    /// Returns the last outputs of each board, their age in s, and `true` if the outputs may be outdated.
    pub fn outputs(&self, master: &Master, now_us: u64) -> Vec<(u8, &Snapshot, f64, bool)> {
        let boards = master.boards();
        let rows = self.boards.iter().filter_map(|(number, one)| Some((number, one, one.last.as_ref()?)));
        rows.map(|(number, one, last)| {
            let doubtful = one.out || boards.get(*number).is_none_or(in_doubt);
            let old = now_us.saturating_sub(last.time_us) > OLD_US;
            (*number, last, age_s(last, now_us), doubtful || old)
        })
        .collect()
    }

    /// Returns an error if a board has left its control loop without a command of this PC.
    pub fn nobody_left(&self) -> Result<(), SessionError> {
        let boards: Vec<u8> = self.boards.iter().filter(|(_, one)| one.left).map(|(n, _)| *n).collect();
        if boards.is_empty() { Ok(()) } else { Err(SessionError::LeftLoop { boards }) }
    }
}

/// Returns `true` if the board's values are doubtful because heartbeats are missing or because the board has
/// rebooted.
fn in_doubt(board: &Board) -> bool {
    board.rebooted || matches!(board.life, Life::Late | Life::Lost)
}

fn seconds(us: u64) -> f64 {
    us as f64 * 1e-6
}

fn age_s(last: &Snapshot, now_us: u64) -> f64 {
    seconds(now_us.saturating_sub(last.time_us))
}

#[cfg(test)]
mod tests {
    use host_kit::Diagnose;
    use ucom::Profile;

    use super::*;

    /// Delivers frames of board 1 at the given time, and returns the notices.
    fn receive(master: &mut Master, followed: &mut Followed, at_us: u64, frames: &[&str]) -> Vec<String> {
        frames.iter().for_each(|text| master.handle(at_us, Ok(text.parse().unwrap())));
        let mut sent = Vec::new();
        while let Some(frame) = master.poll(at_us) {
            sent.push(frame.to_string());
        }
        let mut notices: Vec<Notice> = Vec::new();
        while let Some(event) = master.take_event() {
            notices.extend(followed.see(&event, at_us));
        }
        notices.extend(followed.look(master, at_us));
        let event = |notice: Notice| notice.change.name().to_owned();
        sent.into_iter().filter(|f| f != "680#").chain(notices.into_iter().map(event)).collect()
    }

    /// Returns a state in which board 1 runs and has sent its outputs.
    fn running() -> (Master, Followed) {
        running_with(Profile::default().on_lost)
    }

    fn running_with(on_lost: OnLost) -> (Master, Followed) {
        let profile = Profile { on_lost, ..Profile::default() };
        let (mut master, mut followed) = (Master::new(profile), Followed::new([1].into_iter(), 0));
        master.watch(1, Some(3), true);
        let first = ["681#", "601#01000000", "381#0000640065006600"];
        assert!(receive(&mut master, &mut followed, 0, &first).is_empty());
        (master, followed)
    }

    fn stale(master: &Master, followed: &Followed, now_us: u64) -> Vec<bool> {
        followed.outputs(master, now_us).into_iter().map(|(.., stale)| stale).collect()
    }

    #[test]
    fn d37_a_board_that_leaves_its_loop_is_named_at_once_and_its_values_are_stale() {
        let (mut master, mut followed) = running();
        assert_eq!(stale(&master, &followed, 10_000), [false]);
        assert!(followed.nobody_left().is_ok());
        assert_eq!(receive(&mut master, &mut followed, 20_000, &["601#00000000"]), ["left-loop"]);
        assert!(receive(&mut master, &mut followed, 30_000, &["601#00000000"]).is_empty(), "reported once");
        assert_eq!(stale(&master, &followed, 30_000), [true]);
        // Another PC starts the control loop of the board again. The run is still reported as interrupted.
        let again = ["601#01000000", "381#0000640065006600"];
        assert_eq!(receive(&mut master, &mut followed, 40_000, &again), ["in-loop"]);
        assert_eq!(stale(&master, &followed, 40_000), [false]);
        assert_eq!(followed.nobody_left().unwrap_err().kind(), host_kit::ErrorKind::Fault);
    }

    #[test]
    fn d37_where_its_word_is_lost_its_status_is_asked_for() {
        let (mut master, mut followed) = running();
        receive(&mut master, &mut followed, 1_000_000, &["681#"]);
        let asked = receive(&mut master, &mut followed, 1_010_000, &[]);
        assert_eq!(stale(&master, &followed, 1_010_000), [true], "no outputs for a second");
        let asked = [asked, receive(&mut master, &mut followed, 1_020_000, &[])].concat();
        assert_eq!(asked, ["201#"]);
        let answer = ["141#2100018B34126E38", "141#0100", "141#78"];
        receive(&mut master, &mut followed, 1_030_000, &answer);
        assert_eq!(receive(&mut master, &mut followed, 1_200_000, &[]), ["left-loop"]);
        assert!(followed.nobody_left().is_err());
    }

    #[test]
    fn d51_values_of_a_late_board_are_stale_and_a_stop_by_policy_is_not_its_own() {
        let (mut master, mut followed) = running();
        let events = receive(&mut master, &mut followed, 1_600_000, &["381#0000640065006600"]);
        assert_eq!(events, ["late"]);
        assert_eq!(stale(&master, &followed, 1_600_000), [true]);
        assert_eq!(receive(&mut master, &mut followed, 3_100_000, &[]), ["lost"]);
        assert_eq!(receive(&mut master, &mut followed, 3_110_000, &["601#00000000"]), ["stopped-by-policy"]);
        assert!(followed.nobody_left().is_ok(), "the loss is what failed");
    }

    /// Starting or stopping a board does not change the state of the other boards.
    #[test]
    fn d37_boards_that_come_and_go_leave_the_others_as_they_were() {
        let (mut master, mut followed) = running();
        assert_eq!(receive(&mut master, &mut followed, 20_000, &["601#00000000"]), ["left-loop"]);
        for act in [|all: &mut Followed| all.add(&[2], 25_000), |all: &mut Followed| all.remove(2)] {
            act(&mut followed);
            assert!(
                receive(&mut master, &mut followed, 30_000, &["601#00000000"]).is_empty(),
                "reported once"
            );
            assert_eq!(stale(&master, &followed, 30_000), [true]);
            assert!(followed.nobody_left().is_err());
        }
        // After a restart of the board's control loop, earlier losses do not count. If the board then leaves its
        // control loop, the loss is not reported as the reason.
        assert_eq!(receive(&mut master, &mut followed, 3_100_000, &[]), ["lost"]);
        receive(&mut master, &mut followed, 3_200_000, &["681#", "601#01000000", "381#0000640065006600"]);
        followed.add(&[1], 3_200_000);
        assert_eq!(stale(&master, &followed, 3_210_000), [false]);
        assert_eq!(receive(&mut master, &mut followed, 3_220_000, &["601#00000000"]), ["left-loop"]);
        followed.remove(1);
        assert!(receive(&mut master, &mut followed, 3_230_000, &["601#01000000"]).is_empty());
    }

    #[test]
    fn d37_a_run_is_over_some_time_after_its_last_board_has_left() {
        let (mut master, mut followed) = running();
        assert!(!followed.is_over(&master, 10_000));
        receive(&mut master, &mut followed, 20_000, &["601#00000000"]);
        assert!(!followed.is_over(&master, 20_000), "it may be in it again at once");
        receive(&mut master, &mut followed, 2_000_000, &["681#", "601#01000000", "381#0000640065006600"]);
        assert!(!followed.is_over(&master, 2_000_000));
        receive(&mut master, &mut followed, 2_100_000, &["601#00000000"]);
        assert!(!followed.is_over(&master, 2_100_000) && !followed.is_over(&master, 5_000_000));
        assert!(followed.is_over(&master, 5_100_000));
    }

    /// D-51: if `on_lost` requires that a lost board is stopped, the run ends. With `on_lost = report`, the lost
    /// board may still be in its control loop, so the run does not end.
    #[test]
    fn d51_a_lost_board_is_waited_for_only_where_nobody_stops_it() {
        for on_lost in [OnLost::StopAll, OnLost::StopBoard, OnLost::Report] {
            let (mut master, mut followed) = running_with(on_lost);
            for now_us in [1_600_000, 3_100_000] {
                receive(&mut master, &mut followed, now_us, &[]);
                assert!(!followed.is_over(&master, now_us), "{on_lost:?}");
            }
            assert_eq!(followed.is_over(&master, 6_100_000), on_lost != OnLost::Report, "{on_lost:?}");
        }
    }
}
