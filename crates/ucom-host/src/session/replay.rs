//! Replay of a recording on a bus, and detection of frames that change boards.

use std::time::{Duration, Instant};

use super::driver::Operator;
use super::error::SessionError;
use super::link::{Link, protocol_frame, replayed};
use crate::files::recording::{Record, RecordedFrame};

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
