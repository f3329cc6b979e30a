//! Host supervision (J-59) on a shared line: the controller treats all clients as one host. Queries of other clients
//! must therefore not prevent the controller from detecting a silent lease holder.
use std::time::Duration;

use jtc_host::session::host_timeout_ms;
use jtc_wire::{Answer, Command, ControllerState, FrameRef, Response, Status};

use super::{ClientId, Denied, SharedLine};

/// State of the controller's host supervision, as far as the agent knows it.
#[derive(Debug, Default)]
pub(super) struct Supervision {
    /// Timeout: the value of `host_timeout_ms` that was last read or set on this line. `None` if host supervision is
    /// off or its timeout is not known.
    timeout: Option<Duration>,
    /// Timeout in a SetSettings frame whose response record has not arrived, ms.
    written_ms: Option<f64>,
}

impl Supervision {
    fn set(&mut self, ms: Option<f64>) {
        if let Some(ms) = ms {
            self.timeout = (ms > 0.0).then(|| Duration::from_secs_f64(ms / 1000.0));
        }
    }

    /// Stores the timeout from the settings that the controller returns.
    pub(super) fn take_answer(&mut self, answer: &Answer<'_>) {
        if let Answer::Settings { values, .. } = answer {
            self.set(host_timeout_ms(values.iter()));
        }
    }

    /// Stores the timeout in a SetSettings frame that was written.
    pub(super) fn note_written(&mut self, frame: &[u8]) {
        if let Some(Ok(Command::SetSettings(values))) = FrameRef::new_checked(frame).map(Command::parse) {
            self.written_ms = host_timeout_ms(values.iter());
        }
    }

    /// Processes the response record of a SetSettings frame.
    pub(super) fn take_record(&mut self, response: &Response) {
        let written = self.written_ms.take();
        if response.accepted() {
            self.set(written);
        }
    }

    /// Processes a status of the controller. In Start and Init, the stored timeout is not valid any more, because the
    /// controller may have restarted with other settings.
    pub(super) fn take_status(&mut self, status: &Status) {
        if status.state.is_in(&[ControllerState::Start, ControllerState::Init]) {
            self.timeout = None;
        }
    }
}

impl SharedLine {
    /// Checks that this client may send a query to the controller at `now`. During a supervised motion, the query of
    /// another client is refused if the lease holder has sent no frame for half of the timeout. The project's own
    /// clients send a frame within each third of the timeout.
    pub(super) fn may_ask(&mut self, id: ClientId, now: Duration) -> Result<(), Denied> {
        let Some(timeout) = self.supervision.timeout else { return Ok(()) };
        self.end_lapsed(now);
        if !self.motion_tracker.is_supervised(self.status.as_ref(), now) {
            return Ok(());
        }
        let Some(lease) = &self.lease else {
            return Err(Denied::Unattended { who: self.left.0.clone() });
        };
        let heard = self
            .clients
            .get(&lease.holder)
            .is_some_and(|holder| now.saturating_sub(holder.heard_at) < timeout / 2);
        if heard || lease.holder == id {
            Ok(())
        } else {
            Err(Denied::Unattended { who: self.name(lease.holder) })
        }
    }
}
