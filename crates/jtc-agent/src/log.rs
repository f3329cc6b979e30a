//! Command log entries for the events of a serial line.
use std::sync::{Arc, Mutex, PoisonError};

use serde_json::{Value, json};

pub use agent_kit::log::{CommandLog, LIMIT};

use crate::line::LineEvent;
use crate::owner::Observer;

/// Returns an observer that writes the events of a serial line to a command log.
pub fn observer(log: Arc<Mutex<CommandLog>>) -> Observer {
    Box::new(move |_, event| {
        let Some((what, facts)) = logged(event) else { return };
        let mut log = log.lock().unwrap_or_else(PoisonError::into_inner);
        match event {
            // Clients with read-only access can cause such events without limit, so repetitions are only
            // counted.
            LineEvent::Denied { client, .. } => {
                log.write_repeated(what, &format!("client {}", client.0), facts)
            }
            LineEvent::PutOut { .. } => log.write_repeated(what, "clients", facts),
            _ => log.write(what, facts),
        }
    })
}

/// Returns the log entry for an event: its name and data. Returns `None` if another part of the agent logs
/// the event.
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
