//! Last will of a killed agent, applied by the next one at its start.
use std::time::{Duration, Instant};

use jtc_host::Session;
use jtc_wire::ExecCommand;
use serde_json::json;

use super::file::{Found, Stored};
use super::keeper::Keeper;
use crate::line::{Applied, Introduction, Policy, Role, SharedLine};
use crate::owner::Line;
use crate::record::Notice;

/// Time within which a connected controller reports.
const REPORTS: Duration = Duration::from_secs(1);
/// Longest wait for the confirmation of a Stop. The line repeats the Stop even after this time.
const TAKES: Duration = Duration::from_secs(1);
/// Interval of checks.
const LOOK: Duration = Duration::from_millis(10);

/// Applies the policy in the file to the controller's motion. Returns a notice about the file and the result; `None` without a file.
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

/// Reads the controller's `host_timeout_ms` for the line. A motion of a killed program may still run. With the timeout,
/// the line can refuse questions of other clients that the controller would take for a sign of life of that program
/// (J-59). Has no effect if the controller has no such setting or does not answer.
pub fn read_host_timeout(line: &Line) {
    let introduction = Introduction { name: "agent".into(), role: Role::Viewer, policy: Policy::Continue };
    // The result is not used, because the line itself reads the value from the answer.
    let _ = Session::new(line.connect(introduction)).settings();
}

/// Waits for a condition on the line; returns `true` if it was met.
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

/// Returns the result in words. `reports`: statuses of the controller arrive. `taken`: the controller has confirmed the
/// command.
fn in_words(applied: Applied, reports: bool, taken: bool) -> String {
    let sent = match applied {
        Applied::Rests => return "nothing moves any more".into(),
        Applied::GoesOn if !reports => return "nothing is received from the controller".into(),
        Applied::GoesOn => return "it goes on".into(),
        Applied::Paused => return "it stays paused".into(),
        Applied::Sent(ExecCommand::Pause) => "a Pause",
        Applied::Sent(_) => "a Stop",
    };
    match (reports, taken) {
        (true, true) => format!("{sent} was sent, and the controller has taken it"),
        (true, false) => format!("{sent} was sent, and is sent until the controller has taken it"),
        (false, _) => {
            format!("nothing is received from the controller: {sent} is sent until it has taken it")
        }
    }
}

fn notice(found: &Found, moves: bool, done: &str) -> Notice {
    match found {
        Found::Left(Stored { client, policy, what, since_unix_s, .. }) => Notice {
            what: "policy-found",
            warning: Some(format!(
                "the agent before ended in {} of {client}, policy {}: {done}",
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
                    "what the agent before has left cannot be read ({why}), and in doubt the arm is stopped: {done}"
                )),
                facts: json!({ "why": why, "moves": moves, "done": done }),
            }
        }
    }
}
