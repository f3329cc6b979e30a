//! Host supervision (J-59) on a shared line: for the controller all clients are one host, so questions of others must not stand for the client
//! that commands.
use std::time::Duration;

use jtc_host::session::host_timeout_ms;
use jtc_wire::{Answer, Command, FrameRef};

use super::{ClientId, Denied, SharedLine};

/// What is known of the controller's supervision of its host.
#[derive(Debug, Default)]
pub(super) struct Supervision {
    /// Its `host_timeout_ms`, as it was last read or set on this line; none without supervision.
    timeout: Option<Duration>,
}

impl Supervision {
    fn set(&mut self, ms: Option<f64>) {
        if let Some(ms) = ms {
            self.timeout = (ms > 0.0).then(|| Duration::from_secs_f64(ms / 1000.0));
        }
    }

    /// Takes the timeout from settings that the device returns.
    pub fn take_answer(&mut self, answer: &Answer<'_>) {
        if let Answer::Settings { values, .. } = answer {
            self.set(host_timeout_ms(values.iter()));
        }
    }

    /// Takes the timeout from a SetSettings that was written. Where the device refuses it, the next read corrects it.
    pub fn take_set(&mut self, frame: &[u8]) {
        if let Some(Ok(Command::SetSettings(values))) = FrameRef::new_checked(frame).map(Command::parse) {
            self.set(host_timeout_ms(values.iter()));
        }
    }
}

impl SharedLine {
    /// This client may ask the controller. While the arm moves under host supervision, others may ask only as long as frames of the client
    /// that commands arrive within the timeout.
    pub(super) fn may_ask(&mut self, id: ClientId, now: Duration) -> Result<(), Denied> {
        let Some(timeout) = self.supervision.timeout else { return Ok(()) };
        self.end_lapsed(now);
        if !self.moving.is_supervised(self.status.as_ref(), now) {
            return Ok(());
        }
        let Some(lease) = &self.lease else {
            return Err(Denied::Unattended { who: self.left.0.clone() });
        };
        let heard = self
            .clients
            .get(&lease.holder)
            .is_some_and(|holder| now.saturating_sub(holder.heard_at) < timeout);
        if heard || lease.holder == id {
            Ok(())
        } else {
            Err(Denied::Unattended { who: self.name(lease.holder) })
        }
    }
}
