//! Host supervision (J-59). The session repeats GetInfo while the arm follows a path, or is in teaching, because of a
//! command of this session. The requests show the controller that its host is alive.
//!
//! A session that only observes the arm sends no frames. A GetInfo also shows the controller that its host supports
//! all data status codes (J-51).

use std::time::Duration;

use jtc_core::settings;
use jtc_wire::{Answer, ControllerState, SettingValue, Status, fixed};

use super::Session;
use super::extension::{ASK_AGAIN, Extensions};
use crate::error::LinkError;
use crate::port::Port;

/// Maximum time until the statuses show the effect of a command.
const SHOWS: Duration = Duration::from_secs(1);
/// Minimum time between two GetInfo requests. A status is sent every 40 ms, and an answer takes 13 ms at 115,200 Bd.
const SHORTEST: Duration = Duration::from_millis(20);

/// State of host supervision in the session.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Presence {
    /// Time at which this session commanded the current motion or teaching.
    commanded: Option<Duration>,
    /// `true` while the session waits for the beginning of teaching.
    waits: bool,
    /// `true` if the last status shows that the arm moves or can be guided by hand.
    moves: bool,
    /// Last known `host_timeout_ms` of the controller, ms. 0 means no supervision. While the controller has no torque, the session discards
    /// this value, because the setting may change.
    host_timeout_ms: Option<f64>,
    /// `true` if the controller has accepted an extension request.
    answered: bool,
    /// Time of the last GetInfo.
    asked_at: Duration,
    /// Number of requests without an answer.
    unanswered: u8,
}

impl Presence {
    /// Records that the session commands a motion or teaching.
    pub(super) fn command(&mut self, now: Duration) {
        self.commanded = Some(now);
    }

    /// Sets or clears the wait for teaching.
    pub(super) fn wait_for_teaching(&mut self, waits: bool) {
        self.waits = waits;
    }

    /// Records that the controller has accepted an extension request.
    pub(super) fn accepted(&mut self) {
        self.answered = true;
    }

    /// Evaluates a status.
    pub(super) fn take_status(&mut self, status: &Status, now: Duration) {
        self.moves = status.state.is_in(&[ControllerState::Operate, ControllerState::Teaching]);
        if !self.moves && !self.waits {
            self.commanded.take_if(|at| now.saturating_sub(*at) > SHOWS);
        }
        if status.state.is_in(&[ControllerState::Start, ControllerState::Init]) {
            self.host_timeout_ms = None;
        }
    }

    /// Returns `true` if the arm moves, or teaching is about to begin, because of a command of this session.
    fn is_shown(&self) -> bool {
        self.commanded.is_some() && (self.moves || self.waits)
    }

    /// Returns the time between two GetInfo requests. At least three requests fit into the controller's timeout.
    fn period(&self) -> Duration {
        match self.host_timeout_ms {
            Some(ms) if ms > 0.0 => Duration::from_secs_f64(ms / 3000.0).clamp(SHORTEST, ASK_AGAIN),
            _ => ASK_AGAIN,
        }
    }

    /// Evaluates an answer. If the answer belongs to a GetInfo, returns the time at which that GetInfo was sent.
    pub(super) fn take_answer(&mut self, answer: &Answer<'_>) -> Option<Duration> {
        match answer {
            Answer::Info(_) => {
                self.unanswered = self.unanswered.checked_sub(1)?;
                return Some(self.asked_at);
            }
            Answer::Settings { values, .. } => self.take(values.iter()),
            _ => {}
        }
        None
    }

    /// Stores the host timeout from settings that were read or set.
    fn take(&mut self, values: impl Iterator<Item = SettingValue>) {
        if let Some(ms) = host_timeout_ms(values) {
            self.host_timeout_ms = Some(ms);
        }
    }
}

/// Returns the value of the setting `host_timeout_ms` (ms) in `values`.
pub fn host_timeout_ms(mut values: impl Iterator<Item = SettingValue>) -> Option<f64> {
    let setting = settings::named("host_timeout_ms")?;
    values.find(|value| value.setting == setting.number).map(|value| value.value)
}

impl<P: Port> Session<P> {
    /// Sends a GetInfo if the time for the next GetInfo has been reached. Returns the time until the next GetInfo.
    pub(super) fn show_presence(&mut self) -> Result<Duration, LinkError> {
        let Extensions::Asked(at) = self.extensions else { return Ok(Duration::MAX) };
        if !self.presence.is_shown() {
            return Ok(Duration::MAX);
        }
        let (now, period) = (self.port.now(), self.presence.period());
        let due = self.presence.asked_at.max(at) + period;
        if now < due {
            return Ok(due - now);
        }
        self.write(&fixed::GET_INFO)?;
        self.presence.asked_at = now;
        self.presence.unanswered = self.presence.unanswered.saturating_add(1);
        Ok(period)
    }

    /// Stores the host timeout from settings that the device has accepted.
    pub(super) fn set_presence(&mut self, values: &[SettingValue]) {
        self.presence.take(values.iter().copied());
    }

    /// Waits for the answers to the requests of [`show_presence`](Self::show_presence). Until these answers arrive, the device would reject
    /// another request (J-50).
    pub(super) fn await_presence(&mut self) -> Result<(), LinkError> {
        let end = self.presence.asked_at + self.confirmation_time(jtc_wire::ANSWER_MAX);
        while self.presence.unanswered > 0 && self.port.now() < end {
            self.read(end.saturating_sub(self.port.now()))?;
        }
        self.presence.unanswered = 0;
        Ok(())
    }

    /// Reads the host timeout before a motion begins, if the timeout is not yet known.
    pub(super) fn read_host_timeout(&mut self) -> Result<(), LinkError> {
        if self.presence.host_timeout_ms.is_some() || !self.presence.answered {
            return Ok(());
        }
        match self.settings() {
            // If the timeout cannot be read, the default period of GetInfo is used. If the line is lost, the next
            // command returns the error.
            Err(
                LinkError::NotConfirmed { .. } | LinkError::Refused { .. } | LinkError::NoExtension { .. },
            ) => Ok(()),
            read => read.map(drop),
        }
    }
}
