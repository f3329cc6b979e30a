//! Command `ucom send`: sends single frames unchanged.

use std::time::{Duration, Instant};

use cli_kit::{ErrorKind, Failure, Output};
use serde_json::json;
use ucom_host::files::recording::RecordedFrame;
use ucom_host::session::bus_off::{WHY, next};
use ucom_host::session::{is_intrusive, replayed};

use super::decode::parsed;
use crate::args::{LinkArgs, SendArgs};

/// Time for which the command listens after it has sent its last frame. The time is sufficient for the up to about 32
/// attempts that a CAN controller makes to send a frame before it is bus-off.
const SENT: Duration = Duration::from_millis(50);

/// Sends frames in the order of the command line. The command checks all frames before it sends the first frame.
pub(super) fn send(args: &SendArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let frame = |(i, text): (usize, &String)| {
        let record = parsed(text.trim(), i + 1).unwrap_or_else(|| Err(Failure::usage("an empty frame")))?;
        Ok::<_, Failure>(record.frame)
    };
    let frames: Vec<RecordedFrame> = args.frames.iter().enumerate().map(frame).collect::<Result<_, _>>()?;
    if let Some(frame) = frames.iter().find(|frame| !args.intrusive && is_intrusive(frame)) {
        let what = format!("{frame} would reset, number, program, start or move boards; nothing was sent");
        return Err(Failure::new(ErrorKind::Refused, "intrusive", what).next("--intrusive sends it"));
    }
    let wire = |frame: &RecordedFrame| {
        replayed(frame).ok_or_else(|| Failure::usage(format!("{frame} is not a frame that can be sent")))
    };
    let wire = frames.iter().map(wire).collect::<Result<Vec<_>, _>>()?;
    let mut bus = link.open()?;
    for frame in &wire {
        bus.carries(frame).map_err(Failure::nothing_sent)?;
    }
    for frame in &wire {
        bus.send_wire(frame)?;
    }
    let end = Instant::now() + SENT;
    while Instant::now() < end {
        bus.receive(end.saturating_duration_since(Instant::now()))?;
    }
    if bus.times_bus_off() > 0 {
        let what =
            format!("the CAN controller of this computer went bus-off: {WHY}; not all frames were sent");
        return Err(Failure::new(ErrorKind::NoLink, "bus-off", what).next(next(bus.url())));
    }
    let texts: Vec<String> = frames.iter().map(ToString::to_string).collect();
    out.result(&json!({ "sent": texts }), || format!("sent: {}", texts.join(" ")));
    Ok(())
}
