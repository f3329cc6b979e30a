//! Host supervision (J-59): while the arm moves for this session, the session repeats GetInfo, so that the controller knows that its host is there.
//!
//! A session that only watches sends nothing. The request also tells the controller that its host knows every data status (J-51).

use std::time::Duration;

use jtc_core::settings;
use jtc_wire::{Answer, ControllerState, SettingValue, Status, fixed};

use super::Session;
use super::extension::{ASK_AGAIN, Extensions};
use crate::error::LinkError;
use crate::port::Port;

/// A command shows in the statuses within this time.
const SHOWS: Duration = Duration::from_secs(1);
/// Shortest time between two requests: a status is sent every 40 ms, and an answer takes 13 ms at 115,200 Bd.
const SHORTEST: Duration = Duration::from_millis(20);

/// What the session knows of host supervision, and what it has sent for it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Presence {
    /// When this session commanded the motion or the teaching that goes on.
    commanded: Option<Duration>,
    /// The session waits for teaching to begin.
    waits: bool,
    /// The arm moves, or can be led, by the last status.
    moves: bool,
    /// The controller's `host_timeout_ms` as it was last read or set, ms; 0: no supervision. A controller without torque may get another.
    host_timeout_ms: Option<f64>,
    /// The controller has accepted an extension request.
    answered: bool,
    /// When GetInfo was sent last.
    asked_at: Duration,
    /// Requests whose answers have not arrived.
    unanswered: u8,
}

impl Presence {
    /// The session commands a motion or teaching.
    pub fn command(&mut self, now: Duration) {
        self.commanded = Some(now);
    }

    /// The session waits for teaching to begin, or no longer.
    pub fn wait_for_teaching(&mut self, waits: bool) {
        self.waits = waits;
    }

    /// The controller has accepted an extension request.
    pub fn accepted(&mut self) {
        self.answered = true;
    }

    /// Takes a status.
    pub fn take_status(&mut self, status: &Status, now: Duration) {
        self.moves = status.state.is_in(&[ControllerState::Operate, ControllerState::Teaching]);
        if !self.moves && !self.waits {
            self.commanded.take_if(|at| now.saturating_sub(*at) > SHOWS);
        }
        if status.state.is_in(&[ControllerState::Start, ControllerState::Init]) {
            self.host_timeout_ms = None;
        }
    }

    /// The arm moves for this session.
    fn is_shown(&self) -> bool {
        self.commanded.is_some() && (self.moves || self.waits)
    }

    /// Time between two requests: at least three within the controller's timeout.
    fn period(&self) -> Duration {
        match self.host_timeout_ms {
            Some(ms) if ms > 0.0 => Duration::from_secs_f64(ms / 3000.0).clamp(SHORTEST, ASK_AGAIN),
            _ => ASK_AGAIN,
        }
    }

    /// Takes what an answer shows; returns when a GetInfo that it answers was sent.
    pub fn take_answer(&mut self, answer: &Answer<'_>) -> Option<Duration> {
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

    /// Takes the timeout from settings that were read or set.
    fn take(&mut self, values: impl Iterator<Item = SettingValue>) {
        if let Some(ms) = host_timeout_ms(values) {
            self.host_timeout_ms = Some(ms);
        }
    }
}

/// The setting `host_timeout_ms` among these values, ms.
pub fn host_timeout_ms(mut values: impl Iterator<Item = SettingValue>) -> Option<f64> {
    let setting = settings::named("host_timeout_ms")?;
    values.find(|value| value.setting == setting.number).map(|value| value.value)
}

impl<P: Port> Session<P> {
    /// Sends GetInfo when it is due; returns the time until it is due again.
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

    /// Notes settings that the device has accepted.
    pub(super) fn set_presence(&mut self, values: &[SettingValue]) {
        self.presence.take(values.iter().copied());
    }

    /// Waits for the answers to what [`show_presence`](Self::show_presence) has sent: a device refuses a request meanwhile (J-50).
    pub(super) fn await_presence(&mut self) -> Result<(), LinkError> {
        let end = self.presence.asked_at + self.confirmation_time(jtc_wire::ANSWER_MAX);
        while self.presence.unanswered > 0 && self.port.now() < end {
            self.read(end.saturating_sub(self.port.now()))?;
        }
        self.presence.unanswered = 0;
        Ok(())
    }

    /// Reads the timeout before a motion begins, unless it is known.
    pub(super) fn read_host_timeout(&mut self) -> Result<(), LinkError> {
        if self.presence.host_timeout_ms.is_some() || !self.presence.answered {
            return Ok(());
        }
        match self.settings() {
            // Without it the usual period counts; a line that is lost is found by the command that follows.
            Err(
                LinkError::NotConfirmed { .. } | LinkError::Refused { .. } | LinkError::NoExtension { .. },
            ) => Ok(()),
            read => read.map(drop),
        }
    }
}
