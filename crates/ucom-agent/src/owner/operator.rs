//! Functions that the bus session calls for the agent. These functions publish snapshots and events of the bus even
//! while a procedure runs.
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use agent_kit::api::Problem;
use ucom_host::master::io::DescriptionKey;
use ucom_host::master::{Event, Master, Supervision};
use ucom_host::session::{Held, Known, Link, Operator};

use super::shared::Shared;
use crate::event::ChainEvent;
use crate::snapshot::{BusSnapshot, Values};

/// Interval between two snapshots of the bus.
const PICTURE: Duration = Duration::from_millis(40);
/// Time without a frame from another PC after which the other PC counts as disconnected, in µs.
const COMPETING_US: u64 = 3_000_000;

/// Time for which the frames of a Stop are repeated, in µs.
const SERIES_US: u64 = 60_000;
/// Interval between progress events within one cycle of an update, in µs.
const PROGRESS_US: u64 = 200_000;

/// Job, boards, attempt and cycle of a firmware update.
type Step = (u64, Vec<u8>, u32, u32);

/// State of the owner's thread that is also accessible during a procedure.
#[derive(Default)]
pub(super) struct Local {
    /// Boards that did not return the names of their values to a request without the lease. Each entry contains the
    /// time and the reason.
    pub nameless: BTreeMap<u8, (Instant, Problem)>,
    pub states: BTreeMap<u8, &'static str>,
    /// Number of Stops whose frames were sent. `halted_us` is the time of the last of them.
    pub halts_sent: u64,
    pub halted_us: Option<u64>,
    /// Update step of the last progress event, and the time of this event in µs.
    pub progress: Option<(Step, u64)>,
    /// `true` if the agent has sent its last Stop, which it sends when it ends.
    pub end_sent: bool,
    pub job: Option<u64>,
    /// Time of the last event about another PC, in µs.
    pub competing_us: Option<u64>,
    pub now_us: u64,
    /// Time of the last snapshot; if `None`, the next cycle of the bus loop publishes a new snapshot.
    pub published: Option<Instant>,
    /// Events that are written after the next snapshot. A client that reads an event therefore finds the new state in
    /// the snapshot.
    pub happened: Vec<ChainEvent>,
}

/// Implementation of [`Operator`] for the agent: the bus session calls its functions.
pub(super) struct Hand {
    pub shared: Arc<Shared>,
    pub held: Rc<RefCell<Held>>,
    pub local: Rc<RefCell<Local>>,
}

impl Operator for Hand {
    fn stop_asked(&self) -> bool {
        self.shared.is_cancelled()
    }

    fn note(&self, text: String) {
        let mut local = self.local.borrow_mut();
        let note = match local.job {
            Some(job) => ChainEvent::JobNote { job, text },
            None => ChainEvent::Note { text },
        };
        local.happened.push(note);
    }

    fn happened(&self, event: &Event, text: Option<String>) {
        let mut local = self.local.borrow_mut();
        let now_us = local.now_us;
        // The returned change of the supervision is ignored, because the code below writes an event for it.
        let _ = self.held.borrow_mut().see(event, now_us);
        let job = local.job;
        let mut write = Vec::new();
        match event {
            // The published snapshot already contains the outputs of this event.
            Event::Snapshot { .. } => {}
            Event::Supervision { board, change } => {
                let (board, change) = match change {
                    Supervision::Late => (Some(*board), "late"),
                    Supervision::Lost => (Some(*board), "lost"),
                    Supervision::Back => (Some(*board), "back"),
                    Supervision::Rebooted { .. } => (Some(*board), "rebooted"),
                    Supervision::UnknownRebooted { .. } => (None, "rebooted"),
                };
                write.push(ChainEvent::Heartbeat { board, change: change.into() });
            }
            Event::BoardError { board, code, .. } => write.push(ChainEvent::BoardError {
                board: *board,
                code: code.number(),
                name: code.name().into(),
                meaning: code.meaning().into(),
            }),
            Event::Debug { board, text } => {
                write.push(ChainEvent::Text { board: *board, text: text.clone() })
            }
            Event::Progress { progress, .. } => {
                if let Some(job) = job {
                    let (boards, attempt, cycle) =
                        (progress.boards.clone(), progress.attempt, progress.cycle);
                    let (bytes, total) = (progress.bytes, progress.total);
                    let step = (job, boards.clone(), attempt, cycle);
                    let soon = |(last, at): &(Step, u64)| {
                        *last == step && now_us.saturating_sub(*at) < PROGRESS_US && bytes < total
                    };
                    if !local.progress.as_ref().is_some_and(soon) {
                        local.progress = Some((step, now_us));
                        write.push(ChainEvent::Progress { job, boards, attempt, cycle, bytes, total });
                    }
                }
            }
            Event::CompetingMaster { .. } => {
                let new = local.competing_us.is_none_or(|at| now_us.saturating_sub(at) > COMPETING_US);
                local.competing_us = Some(now_us);
                if let Some(text) = text.filter(|_| new) {
                    write.push(ChainEvent::Note { text });
                }
            }
            _ => write.extend(text.map(|text| match job {
                Some(job) => ChainEvent::JobNote { job, text },
                None => ChainEvent::Note { text },
            })),
        }
        local.happened.extend(write);
    }

    fn turned(&self, master: &mut Master, link: &mut Link) {
        // `leases` ends a lapsed lease. The agent calls it in each cycle of the bus loop, so that a running or queued
        // request cannot delay the end of a lease.
        drop(self.shared.leases());
        let mut local = self.local.borrow_mut();
        local.now_us = link.now_us();
        self.shared.show_halts();
        let halts = self.shared.halts();
        // If a Stop arrives while the frames of an earlier Stop are repeated, the new frames are sent after these
        // repetitions. Many Stops therefore do not fill the bus.
        let repeated = local.halted_us.is_some_and(|at| local.now_us.saturating_sub(at) < SERIES_US);
        if local.halts_sent < halts && !repeated {
            (local.halts_sent, local.halted_us) = (halts, Some(local.now_us));
            master.stop_at_once(local.now_us, None);
        }
        if self.shared.has_ended() && !local.end_sent {
            // The started boards are stopped at once. A running request may need longer, because it may undo steps on
            // boards that do not answer.
            local.end_sent = true;
            let started: Vec<u8> = self.held.borrow().started().iter().copied().collect();
            master.stop_at_once(local.now_us, Some(&started));
        }
        if !local.happened.is_empty() || local.published.is_none_or(|at| at.elapsed() >= PICTURE) {
            local.published = Some(Instant::now());
            self.publish(&mut local, master, link);
        }
    }
}

impl Hand {
    fn publish(&self, local: &mut Local, master: &Master, link: &mut Link) {
        let boards = master.boards();
        let states: BTreeMap<u8, &'static str> =
            boards.iter().map(|(number, board)| (number, board.state_name(local.now_us))).collect();
        for (number, state) in &states {
            if local.states.get(number) != Some(state) {
                let state = (*state).to_owned();
                local.happened.push(ChainEvent::State { board: *number, state });
            }
        }
        local.states = states;
        let held = self.held.borrow();
        // If a board has another application than before, its stored names are invalid and are not published.
        let is_its = |(number, known): &(&u8, &Arc<Known>)| {
            let info = boards.get(**number).and_then(|board| board.info);
            info.is_none_or(|info| DescriptionKey::of(&info) == DescriptionKey::of(&known.info))
        };
        let values = |(number, known): (&u8, &Arc<Known>)| {
            let outputs = held.snapshots.get(number).cloned();
            let (inputs, parameters) = (master.inputs(*number), master.parameters(*number));
            (*number, Values { known: known.clone(), outputs, inputs, parameters })
        };
        let values = held.known.iter().filter(is_its).map(values).collect();
        let competing_us = master.competing_master().map(|(at, ..)| at);
        let snapshot = BusSnapshot {
            now_us: local.now_us,
            at: Instant::now(),
            profile: master.profile(),
            boards,
            statistics: master.statistics(),
            controller: link.controller(),
            is_master: master.is_master(),
            competing_us: competing_us.filter(|at| local.now_us.saturating_sub(*at) <= COMPETING_US),
            shared: master.shared_numbers().iter().map(ToString::to_string).collect(),
            values,
        };
        self.shared.publish(snapshot, std::mem::take(&mut local.happened));
    }
}
