//! Replay of a recording on a bus, and detection of frames that change boards.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use super::driver::Operator;
use super::error::SessionError;
use super::link::{Link, protocol_frame, replayed};
use crate::files::recording::{FrameKind, Record, RecordedFrame};

/// Reasons why a replay does not send a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Unsent {
    /// The frame changes boards or keeps them running.
    Intrusive,
    /// The record is an error that a CAN controller reported. No program can send an error frame.
    Error,
    /// The bus cannot carry remote frames.
    Remote,
    /// The bus cannot carry CAN FD frames.
    Fd,
    /// The record is not a valid frame.
    Invalid,
}

impl Unsent {
    /// Returns the name of the reason in the JSON output.
    pub fn name(self) -> &'static str {
        match self {
            Self::Intrusive => "intrusive",
            Self::Error => "error",
            Self::Remote => "remote",
            Self::Fd => "fd",
            Self::Invalid => "invalid",
        }
    }
}

/// Frames of a recording that a replay sends, and the numbers of frames that it does not send.
#[derive(Debug, Default)]
pub struct ReplayPlan<'a> {
    /// Records with frames that the replay sends.
    pub due: Vec<&'a Record>,
    /// Number of frames that the replay does not send, by reason.
    pub unsent: BTreeMap<Unsent, usize>,
}

impl<'a> ReplayPlan<'a> {
    /// Examines all frames of a recording before the first frame is sent. `intrusive` permits frames that change boards.
    pub fn new(records: impl IntoIterator<Item = &'a Record>, intrusive: bool, bus: &Link) -> Self {
        let mut plan = Self::default();
        for record in records {
            match unsent(&record.frame, intrusive, bus) {
                None => plan.due.push(record),
                Some(why) => *plan.unsent.entry(why).or_default() += 1,
            }
        }
        plan
    }
}

fn unsent(frame: &RecordedFrame, intrusive: bool, bus: &Link) -> Option<Unsent> {
    if frame.kind == FrameKind::Error {
        return Some(Unsent::Error);
    }
    let Some(wire) = replayed(frame) else { return Some(Unsent::Invalid) };
    if bus.carries(&wire).is_err() {
        return Some(match frame.kind {
            FrameKind::Remote { .. } => Unsent::Remote,
            FrameKind::Fd { .. } => Unsent::Fd,
            FrameKind::Data | FrameKind::Error => Unsent::Invalid,
        });
    }
    (!intrusive && is_intrusive(frame)).then_some(Unsent::Intrusive)
}

/// Sends the frames of a recording at their times, `speed` times as fast as recorded, until the operator requests an end. The function
/// calls `done` after each frame. The function returns the number of frames that it sent.
///
/// # Errors
/// Returns an error if the bus failed.
pub fn replay(
    records: &[&Record],
    speed: f64,
    bus: &mut Link,
    operator: &dyn Operator,
    mut done: impl FnMut(),
) -> Result<u64, SessionError> {
    let first = records.first().map_or(0, |r| r.time_ns);
    let start = Instant::now();
    let mut sent = 0;
    for record in records {
        let due_s = record.time_ns.saturating_sub(first) as f64 * 1e-9 / speed;
        let due = Duration::try_from_secs_f64(due_s).unwrap_or(Duration::MAX);
        while !operator.stop_asked() {
            let rest = due.saturating_sub(start.elapsed());
            if rest.is_zero() {
                break;
            }
            // The replay discards received frames so that they do not fill the memory.
            bus.receive(rest.min(Duration::from_millis(100)))?;
            bus.news().into_iter().for_each(|news| operator.note(news));
        }
        if operator.stop_asked() {
            break;
        }
        if let Some(frame) = replayed(&record.frame) {
            bus.send_wire(&frame)?;
            sent += 1;
        }
        done();
    }
    Ok(sent)
}

/// Returns `true` for a frame of this protocol that changes boards or keeps them running.
pub fn is_intrusive(frame: &RecordedFrame) -> bool {
    let function = protocol_frame(frame).ok().and_then(|f| f.address().ok()).map(|(f, _)| f);
    function.is_some_and(intrusive_function)
}

/// Returns `true` for functions that change boards or keep them running; returns `false` for queries and frames of boards.
fn intrusive_function(function: ucom::Function) -> bool {
    use ucom::Function;
    let asks = matches!(function, Function::Info | Function::AskReport | Function::DumpIo | Function::DumpCi);
    function.from_pc() && !asks
}
