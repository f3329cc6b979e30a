//! The held stop that the arm is in (J-69): its cause stands in no status, so the controller is asked once when it begins.
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use jtc_host::{Port as _, words};
use jtc_wire::{Reactions, Status, StopCause};

use super::Commander;

/// A question without an answer is repeated after this time.
const AGAIN: Duration = Duration::from_secs(2);

#[derive(Default)]
struct State {
    /// Held stops that have ended: an answer about an earlier one is void.
    ended: u64,
    held: bool,
    asked: Option<Instant>,
    /// When the controller answered, by the line's time; the answer is `None` where it does not tell.
    told: Option<(Duration, Option<Reactions>)>,
    /// Joints whose encoder had jumped, a bit for each: until the arm is without torque, when drives are configured again.
    jumped: u8,
}

/// What is known of the held stop that the arm is in.
#[derive(Clone, Default)]
pub struct Stops(Arc<Mutex<State>>);

impl Stops {
    /// Cause of the held stop that the arm is in, and its age at this time of the line, ms; `None`: there is none, or it is not known.
    pub fn cause(&self, status: &Status, now: Duration) -> Option<(StopCause, u32)> {
        let state = self.lock();
        let (at, reactions) = state.told.as_ref().filter(|_| status.is_held_stop())?;
        let (cause, ago_ms) = reactions.as_ref()?.stop?;
        let since = u32::try_from(now.saturating_sub(*at).as_millis()).unwrap_or(u32::MAX);
        Some((cause, ago_ms.saturating_add(since)))
    }

    /// Joints whose encoder has jumped, a bit for each.
    pub fn jumped(&self, status: &Status) -> u8 {
        if words::has_torque(status) { self.lock().jumped } else { 0 }
    }

    /// Looks at a status: asks where a held stop has begun.
    pub(super) fn see(&self, status: &Status, asker: &Commander) {
        let Some(stop) = self.begins(status) else { return };
        // Somebody else's question goes on: this one has its turn at the next look.
        let Ok(turn) = asker.turn() else { return };
        self.lock().asked = Some(Instant::now());
        let own = self.clone();
        asker.tell(turn, move |session| {
            if let Ok(info) = session.info() {
                own.told(stop, session.port().now(), info.and_then(|info| info.reactions));
            }
        });
    }

    /// Number of the held stop that is to be asked about, if any.
    fn begins(&self, status: &Status) -> Option<u64> {
        let mut state = self.lock();
        if !words::has_torque(status) {
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
        // A status that is newer than the last look.
        assert_eq!(stops.cause(&free, second(4)), None);
        assert_eq!(stops.begins(&free), None);
        assert_eq!(stops.jumped(&free), 0b100, "it lasts beyond the held stop");
        assert_eq!(stops.begins(&status(ControllerState::Init, 0)), None);
        assert_eq!(stops.jumped(&free), 0);
    }
}
