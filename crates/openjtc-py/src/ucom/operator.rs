//! Operator of the session: converts bus activity to events, samples and alarms, even during a procedure.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use serde_json::json;
use ucom_host::master::{Event, Master, Supervision};
use ucom_host::session::{Held, Link, Notice, Operator};

use super::shared::{Halt, Shared};

/// State that the thread of the session keeps between two passes of its main loop.
#[derive(Default)]
struct Local {
    /// `true` after the Stop at the end of the session was sent.
    end_sent: bool,
    now_us: u64,
}

/// Operator of the session, which passes events, samples and alarms from the bus to the Python threads.
pub(super) struct Hand {
    shared: Arc<Shared>,
    held: Rc<RefCell<Held>>,
    local: RefCell<Local>,
}

impl Hand {
    /// Makes the operator of a session.
    pub(super) fn new(shared: Arc<Shared>, held: Rc<RefCell<Held>>) -> Self {
        Self { shared, held, local: RefCell::default() }
    }

    /// Reports a change of a running board as an event. Raises an alarm if the board was lost, or if it left its control loop
    /// without a command.
    pub(super) fn noticed(shared: &Shared, held: &Held, notice: &Notice, text: Option<&String>) {
        let Notice { board, change, time_s, .. } = *notice;
        let text = notice.text().or_else(|| text.cloned());
        let text = text.unwrap_or_else(|| format!("board {board}: {}", change.name()));
        shared.event(time_s, change.name(), Some(board), text);
        shared.alarms.changed(change, board, (held.running().contains(&board), !held.started().is_empty()));
    }
}

impl Operator for Hand {
    fn stop_asked(&self) -> bool {
        self.shared.is_cancelled()
    }

    fn note(&self, text: String) {
        let time_s = self.local.borrow().now_us as f64 * 1e-6;
        self.shared.event(time_s, "note", None, text);
    }

    fn happened(&self, event: &Event, text: Option<String>) {
        let mut held = self.held.borrow_mut();
        let now_us = self.local.borrow().now_us;
        let time_s = now_us as f64 * 1e-6;
        if let Some(notice) = held.see(event, now_us) {
            Self::noticed(&self.shared, &held, &notice, text.as_ref());
        }
        let (kind, board) = match event {
            Event::Snapshot { board, snapshot } => {
                if let Some(known) = held.known.get(board) {
                    self.shared.sampled(known, snapshot);
                }
                return;
            }
            // Another event already reports reboots of running boards.
            Event::Supervision { change: Supervision::UnknownRebooted { .. }, .. } => ("rebooted", None),
            Event::Supervision { .. } => return,
            Event::BoardError { board, .. } => ("error", Some(*board)),
            Event::Debug { board, text } => {
                self.shared.event(time_s, "text", Some(*board), text.clone());
                return;
            }
            Event::CompetingMaster { .. } => ("competing-master", None),
            Event::Foreign(_) => ("foreign", None),
            Event::NumberShared { board, found } => {
                if held.running().contains(board) {
                    self.shared.alarms.number_shared(*board, found);
                }
                ("number-shared", Some(*board))
            }
            _ => ("note", None),
        };
        if let Some(text) = text {
            self.shared.event(time_s, kind, board, text);
        }
    }

    fn turned(&self, master: &mut Master, link: &mut Link) {
        let mut local = self.local.borrow_mut();
        local.now_us = link.now_us();
        let started: Vec<u8> = self.held.borrow().started().iter().copied().collect();
        let mut halts = self.shared.halts();
        if self.shared.has_ended() && !local.end_sent {
            // The session ends, but the running request must first undo its changes, possibly on boards that do not
            // answer. The Stop is sent before that, so that no board runs in the meantime.
            local.end_sent = true;
            halts.push(Halt::Started);
        }
        for halt in halts {
            match halt {
                Halt::All => master.stop_at_once(local.now_us, None),
                Halt::Boards(boards) => master.stop_at_once(local.now_us, Some(&boards)),
                Halt::Started if started.is_empty() => {}
                Halt::Started => master.stop_at_once(local.now_us, Some(&started)),
            }
        }
        self.shared.has_started(started);
        self.shared.seen(json!({
            "load_percent": master.statistics().load_percent(local.now_us),
            "received": master.statistics().received,
            "is_master": master.is_master(),
            "time_s": local.now_us as f64 * 1e-6,
        }));
    }
}
