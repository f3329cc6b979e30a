//! `jtc doctor`: finds faults of the link, the joint bus and the set-up, and suggests the next command.

use std::time::Duration;

use cli_kit::{ErrorKind, Failure, Output};
use jtc_host::Session;
use jtc_host::doctor::{Observation, RATES, Severity, findings};
use jtc_host::port::SerialPort;
use jtc_wire::Joint;
use serde_json::json;

use super::status;
use crate::args::LinkArgs;

/// Listening time at the requested bit rate. In this time, 50 statuses arrive.
const LISTEN: Duration = Duration::from_secs(2);
/// Listening time at each of the other bit rates.
const TRY: Duration = Duration::from_millis(300);

/// Checks the link, the joint bus and the set-up. The exit code is 0 without problems, 3 without a link, and 1 for other
/// problems.
pub(super) fn doctor(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let name = link.name()?;
    out.note(format!("listening on {name} at {} Bd", link.baud));
    let mut session = link.session()?;
    let mut seen = session.examine(LISTEN)?;
    // The error bit `EXTERNAL_JOINTS` has several causes. For example, a drive answers although its joint is
    // declared absent (J-53). Therefore the command asks the controller which joints are declared absent.
    let external = seen.status.is_some_and(|status| status.errors & jtc_wire::error::EXTERNAL_JOINTS != 0);
    seen.absent = match &seen.status {
        Some(_) if external => absent(session.absent().unwrap_or_default()),
        Some(status) => jtc_host::labels::absent(status),
        None => Vec::new(),
    };
    // The command asks for a held stop and an encoder jump only if the arm has torque, because they cannot occur
    // without torque.
    if seen.status.as_ref().is_some_and(jtc_host::labels::has_torque) {
        seen.reactions = session.reactions();
    }
    drop(session);
    if seen.bytes > 0 && seen.statuses == 0 {
        seen.other_baud = other_rate(&name, link.baud, out);
    }
    let all = findings(&seen);
    let bad = all.iter().any(|f| f.severity == Severity::Problem);
    let value = json!({
        "port": name,
        "baud": link.baud,
        "listened_s": seen.time_s,
        "bytes": seen.bytes,
        "statuses": seen.statuses,
        "other_baud": seen.other_baud,
        "healthy": !bad,
        "findings": all,
        "status": seen.status.as_ref().map(status::as_json),
    });
    out.result(&value, || {
        let line = |f: &jtc_host::doctor::Finding| {
            format!("{} {}\n", f.severity.mark(), f.to_string().replace('`', ""))
        };
        all.iter().map(line).collect()
    });
    match (bad, no_link(&seen)) {
        (false, _) => Ok(()),
        (true, true) => Err(Failure::shown(ErrorKind::NoLink)),
        (true, false) => Err(Failure::shown(ErrorKind::Device)),
    }
}

fn absent(positions: [Option<f64>; jtc_wire::JOINTS]) -> Vec<Joint> {
    Joint::ALL.into_iter().filter(|joint| positions[joint.index()].is_some()).collect()
}

fn no_link(seen: &Observation) -> bool {
    seen.statuses == 0
}

fn other_rate(name: &str, own: u32, out: &Output) -> Option<u32> {
    RATES.into_iter().filter(|r| *r != own).find(|rate| {
        out.note(format!("no frame in the received bytes; trying {rate} Bd"));
        // The command opens the port without a socket for Stops, because a Stop at a wrong bit rate would not reach the
        // controller.
        let port = SerialPort::open_without_door(name, *rate).ok();
        port.and_then(|p| Session::new(p).examine(TRY).ok()).is_some_and(|seen| seen.statuses > 0)
    })
}
