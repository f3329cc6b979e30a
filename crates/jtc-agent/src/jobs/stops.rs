//! Current held stop of the arm (J-69). The status does not contain the cause of a held stop. The agent therefore
//! requests the cause from the controller once, when the stop begins.
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use jtc_host::{Port as _, labels};
use jtc_wire::{Reactions, Status, StopCause};

use super::HttpSession;

/// Time after which the agent repeats a query that was not answered.
const AGAIN: Duration = Duration::from_secs(2);

#[derive(Default)]
struct State {
    /// Number of held stops that have ended. If the stop has ended before the controller's answer arrives, the answer
    /// is dropped.
    ended: u64,
    held: bool,
    asked: Option<Instant>,
    /// Answer of the controller, and the time of this answer. The inner `None` means that the controller does not
    /// report its reactions.
    told: Option<(Duration, Option<Reactions>)>,
    /// Joints with an encoder jump, one bit per joint. The bits are valid until the torque is off, because the drives
    /// are then configured again.
    jumped: u8,
}

/// Data that the agent knows about the current held stop.
#[derive(Clone, Default)]
pub struct Stops(Arc<Mutex<State>>);

impl Stops {
    /// Returns the cause of the current held stop. Also returns the age of the held stop in ms at the time `now` of
    /// the serial line. Returns `None` if no held stop is active, or if the agent does not know its cause.
    pub fn cause(&self, status: &Status, now: Duration) -> Option<(StopCause, u32)> {
        let state = self.lock();
        let (at, reactions) = state.told.as_ref().filter(|_| status.is_held_stop())?;
        let (cause, ago_ms) = reactions.as_ref()?.stop?;
        let since = u32::try_from(now.saturating_sub(*at).as_millis()).unwrap_or(u32::MAX);
        Some((cause, ago_ms.saturating_add(since)))
    }

    /// Returns the joints with an encoder jump, one bit per joint.
    pub fn jumped(&self, status: &Status) -> u8 {
        if labels::has_torque(status) { self.lock().jumped } else { 0 }
    }

    /// Processes a status of the controller. If the status shows a new held stop, requests the cause from the
    /// controller.
    pub(super) fn see(&self, status: &Status, asker: &HttpSession) {
        let Some(stop) = self.begins(status) else { return };
        // The session is busy, so the cause is requested after a later status.
        let Ok(turn) = asker.turn() else { return };
        self.lock().asked = Some(Instant::now());
        let own = self.clone();
        asker.tell(turn, move |session| {
            if let Ok(info) = session.info() {
                own.told(stop, session.port().now(), info.and_then(|info| info.reactions));
            }
        });
    }

    /// Returns the number of the held stop whose cause must be requested, or `None` if no request is needed.
    fn begins(&self, status: &Status) -> Option<u64> {
        let mut state = self.lock();
        if !labels::has_torque(status) {
            state.jumped = 0;
        }
        let ended = state.held && !status.is_held_stop();
        state.held = status.is_held_stop();
        if ended {
            (state.asked, state.told) = (None, None);
            state.ended += 1;
        }
        let waits = state.asked.is_some_and(|asked| asked.elapsed() < AGAIN);
        (state.held && state.told.is_none() && !waits).then_some(state.ended)
    }

    fn told(&self, stop: u64, at: Duration, reactions: Option<Reactions>) {
        let mut state = self.lock();
        if state.ended == stop {
            state.jumped = reactions.as_ref().map_or(0, |reactions| reactions.jumped);
            state.told = Some((at, reactions));
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use jtc_wire::{ControllerState, StopKind, error};

    use super::*;

    fn status(state: ControllerState, errors: u16) -> Status {
        Status { state: state.into(), errors, ..Status::default() }
    }

    #[test]
    fn j69_an_answer_about_an_earlier_stop_is_void() {
        let held = status(ControllerState::HoldPos, error::INTERNAL_JOINTS);
        let free = status(ControllerState::HoldPos, 0);
        let cause = StopCause { kind: StopKind::EncoderJump, joint: 3, value: 0.02, limit: 0.0 };
        let reactions = Reactions { stop: Some((cause, 500)), jumped: 0b100, ..Reactions::default() };
        let (stops, second) = (Stops::default(), Duration::from_secs);
        let first = stops.begins(&held).expect("it is asked about");
        assert_eq!(stops.begins(&free), None);
        stops.told(first, second(1), Some(reactions));
        assert_eq!((stops.cause(&held, second(2)), stops.jumped(&held)), (None, 0));
        let next = stops.begins(&held).expect("it is another one");
        stops.told(next, second(3), Some(reactions));
        assert_eq!(stops.begins(&held), None, "its cause is known");
        assert_eq!(stops.cause(&held, second(4)), Some((cause, 1500)));
        // `begins` has not processed the new status yet, so the old cause is still stored. `cause` nevertheless
        // returns no cause, because the status shows no held stop.
        assert_eq!(stops.cause(&free, second(4)), None);
        assert_eq!(stops.begins(&free), None);
        assert_eq!(stops.jumped(&free), 0b100, "it lasts beyond the held stop");
        assert_eq!(stops.begins(&status(ControllerState::Init, 0)), None);
        assert_eq!(stops.jumped(&free), 0);
    }
}
