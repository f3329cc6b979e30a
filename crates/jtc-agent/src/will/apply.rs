//! Applies the last will of a killed agent when the next agent starts.
use std::time::{Duration, Instant};

use jtc_host::Session;
use jtc_wire::ExecCommand;
use serde_json::json;

use super::file::{Found, Stored};
use super::keeper::Keeper;
use crate::line::{Applied, Introduction, Policy, Role, SharedLine};
use crate::owner::Line;
use crate::record::Notice;

/// Time within which a connected controller sends a status.
const REPORTS: Duration = Duration::from_secs(1);
/// Longest wait until the controller confirms a Stop. The Stop is repeated even after this time.
const TAKES: Duration = Duration::from_secs(1);
/// Interval at which a condition on the line is checked.
const LOOK: Duration = Duration::from_millis(10);

/// Applies the policy in the file of the last will to the motion that the controller executes. Returns a notice about the last will and
/// the result; `None` if no file exists.
pub fn apply(line: &Line, keeper: &Keeper, found: &Found) -> Option<Notice> {
    let (client, policy) = match found {
        Found::Nothing => {
            keeper.settle(None, None);
            return None;
        }
        Found::Left(stored) => (stored.client.as_str(), stored.policy),
        Found::Doubtful(_) => ("an unknown client", Policy::Stop),
    };
    until(line, REPORTS, |line| line.status().is_some());
    let reports = line.with(|line, _| line.status().is_some());
    let applied = line.with(|line, now| line.apply_left(client, policy, now));
    let taken = until(line, TAKES, SharedLine::is_idle);
    let since = match found {
        Found::Left(stored) => Some(stored.since_unix_s),
        _ => None,
    };
    keeper.settle(line.with(|line, _| line.will().cloned()), since);
    Some(notice(found, applied != Applied::Rests, &in_words(applied, reports, taken)))
}

/// Reads `host_timeout_ms` from the controller, so that the line knows this value. The motion of a killed program may
/// still be in progress. The controller would take requests of other clients as signs that the killed program still
/// runs (J-59). The line therefore uses the timeout to refuse these requests. Has no effect if the controller does
/// not have the setting or does not answer.
pub fn read_host_timeout(line: &Line) {
    let introduction = Introduction { name: "agent".into(), role: Role::Viewer, policy: Policy::Continue };
    // The result is not used, because the shared line itself reads the setting in the controller's answer.
    let _ = Session::new(line.connect(introduction)).settings();
}

/// Waits until a condition on the line is met; returns `true` if it was met within `time`.
fn until(line: &Line, time: Duration, came: impl Fn(&SharedLine) -> bool) -> bool {
    let end = Instant::now() + time;
    loop {
        if line.with(|line, _| came(line)) {
            return true;
        }
        if Instant::now() >= end || line.lost().is_some() {
            return false;
        }
        line.wait(LOOK);
    }
}

/// Returns a text about the result of applying the last will. `reports` is true if the controller sends statuses. `taken` is true if the
/// controller has confirmed the command.
fn in_words(applied: Applied, reports: bool, taken: bool) -> String {
    let sent = match applied {
        Applied::Rests => return "the arm no longer moves".into(),
        Applied::GoesOn if !reports => return "the controller is silent".into(),
        Applied::GoesOn => return "the motion continues".into(),
        Applied::Paused => return "the motion stays paused".into(),
        Applied::Sent(ExecCommand::Pause) => "a Pause",
        Applied::Sent(_) => "a Stop",
    };
    match (reports, taken) {
        (true, true) => format!("{sent} was sent, and the controller confirmed it"),
        (true, false) => {
            format!("{sent} was sent, and the agent repeats it until the controller confirms it")
        }
        (false, _) => {
            format!("the controller is silent: the agent repeats {sent} until the controller confirms it")
        }
    }
}

fn notice(found: &Found, moves: bool, done: &str) -> Notice {
    match found {
        Found::Left(Stored { client, policy, what, since_unix_s, .. }) => Notice {
            what: "policy-found",
            warning: Some(format!(
                "the previous agent ended during {} of {client}, policy {}: {done}",
                what.text(),
                policy.name()
            )),
            facts: json!({
                "by": client, "policy": policy, "of": what, "since_unix_s": since_unix_s, "moves": moves, "done": done,
            }),
        },
        Found::Nothing | Found::Doubtful(_) => {
            let why = if let Found::Doubtful(why) = found { why.as_str() } else { "" };
            Notice {
                what: "policy-in-doubt",
                warning: Some(format!(
                    "the policy file of the previous agent cannot be used ({why}), so the agent stops the \
                     arm: {done}"
                )),
                facts: json!({ "why": why, "moves": moves, "done": done }),
            }
        }
    }
}
