//! Entries for the events of a serial line in the command log.
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::{Value, json};

pub use agent_kit::log::{CommandLog, LIMIT};

use crate::line::LineEvent;
use crate::owner::Observer;

/// Returns an observer that writes the events of a line to a command log.
pub fn observer(log: Arc<Mutex<CommandLog>>) -> Observer {
    Box::new(move |_, event| {
        let Some((what, facts)) = logged(event) else { return };
        let mut log = log.lock().unwrap_or_else(PoisonError::into_inner);
        match event {
            // Refused frames of clients with read-only access are included.
            LineEvent::Denied { client, .. } => {
                log.write_repeated(what, &format!("client {}", client.0), facts)
            }
            LineEvent::PutOut { .. } => log.write_repeated(what, "clients", facts),
            _ => log.write(what, facts),
        }
    })
}

/// Returns the log entry for an event, with name and data. Returns `None` if the event is logged elsewhere.
fn logged(event: &LineEvent) -> Option<(&'static str, Value)> {
    Some(match event {
        LineEvent::Sent { client, frame_type, .. } => {
            ("sent", json!({ "client": client.0, "frame": frame_type.name() }))
        }
        LineEvent::Answered { client, response } => {
            ("answered", json!({ "client": client.0, "response": response.to_string() }))
        }
        LineEvent::Denied { client, frame_type, denied } => {
            ("denied", json!({ "client": client.0, "frame": frame_type.name(), "why": denied.to_string() }))
        }
        LineEvent::Lease(lease) => ("lease", json!({ "client": lease.as_ref().map(|lease| lease.holder.0) })),
        LineEvent::PolicyApplied { client, policy } => {
            ("policy", json!({ "client": client.0, "policy": policy }))
        }
        LineEvent::NotTaken => ("not-taken", json!({ "frame": "TrajSetExecStatus" })),
        LineEvent::PutOut { client, reason } => {
            ("put-out", json!({ "client": client.0, "why": reason.to_string() }))
        }
        LineEvent::Will(_) => return None,
    })
}
