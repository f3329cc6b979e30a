//! `ucom send`: single frames as they are.

use cli_kit::Output;
use serde_json::json;
use ucom::files::recording::RecordedFrame;

use super::decode::parsed;
use super::record::is_intrusive;
use crate::args::{LinkArgs, SendArgs};
use crate::failure::{Failure, REFUSED};
use crate::link::replayed;

/// Sends frames in the order given; all are looked at before the first one leaves.
pub fn send(args: &SendArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let frame = |(i, text): (usize, &String)| {
        let record = parsed(text.trim(), i + 1).unwrap_or_else(|| Err(Failure::usage("an empty frame")))?;
        Ok::<_, Failure>(record.frame)
    };
    let frames: Vec<RecordedFrame> = args.frames.iter().enumerate().map(frame).collect::<Result<_, _>>()?;
    if let Some(frame) = frames.iter().find(|frame| !args.intrusive && is_intrusive(frame)) {
        let what = format!("{frame} would reset, number, program, start or move boards; nothing was sent");
        return Err(Failure::new(REFUSED, "intrusive", what).hint("--intrusive sends it"));
    }
    let wire = |frame: &RecordedFrame| {
        replayed(frame).ok_or_else(|| Failure::usage(format!("{frame} is no frame that can be sent")))
    };
    let wire = frames.iter().map(wire).collect::<Result<Vec<_>, _>>()?;
    let mut bus = link.open()?;
    for frame in &wire {
        bus.send_wire(frame)?;
    }
    let texts: Vec<String> = frames.iter().map(ToString::to_string).collect();
    out.result(&json!({ "sent": texts }), || format!("sent: {}", texts.join(" ")));
    Ok(())
}
