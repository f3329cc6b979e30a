//! Identity of the controller and its arm. The agent reads the identity when a client needs it, and uses the same
//! answer for all clients.
use std::sync::Arc;
use std::time::Duration;

use jtc_host::Arm;
use jtc_wire::Info;
use tokio::time::{Instant, timeout};

use super::Agent;

/// Time for which the agent uses an answer before it queries the controller again.
const FRESH: Duration = Duration::from_secs(10);
/// Longest wait for the controller's answer.
const ASK_TIME: Duration = Duration::from_secs(3);
/// If the controller is silent for this time, the agent does not query the controller.
const SILENT: Duration = Duration::from_secs(1);

/// Identity of the controller that the agent knows.
#[derive(Clone)]
pub(super) struct Identity {
    asked: Option<Instant>,
    /// Identity that the controller reports; `None` if the controller has no extensions, or before its first answer.
    pub info: Option<Info>,
    /// Arm that the controller reports. If the controller cannot return its arm, the value is the agent's own arm.
    pub arm: Arc<Arm>,
    /// Hash of the controller's arm.
    hash: Option<u64>,
    /// Number of frames that were sent before the query and may have changed the arm.
    changes: u64,
}

impl Identity {
    /// Returns the identity that the agent uses before the first answer of the controller.
    pub(super) fn of(arm: &Arm) -> Self {
        let hash = arm.hash().ok().flatten();
        Self { asked: None, info: None, arm: Arc::new(arm.clone()), hash, changes: 0 }
    }

    /// Returns the identity that the controller reports. Returns `None` if no identity is known, or if the arm that
    /// the agent knows is not the arm that the controller uses.
    pub(super) fn of_controller(&self) -> Option<&Info> {
        self.info.as_ref().filter(|info| Some(info.hash) == self.hash)
    }
}

impl Agent {
    /// Returns the identity of the controller. Queries the controller if the last answer is older than 10 s, or if the
    /// arm may have changed since then.
    pub(super) async fn identity(&self) -> Identity {
        // Requests that arrive at the same time wait for the answer to the first request.
        let mut known = self.identity.lock().await;
        let changes = self.line.arm_changes();
        let old = known.asked.is_none_or(|asked| asked.elapsed() >= FRESH) || known.changes != changes;
        let there =
            self.line.with(|line, now| line.status().is_some_and(|(at, _)| now.saturating_sub(*at) < SILENT));
        if !old || !there {
            return known.clone();
        }
        (known.asked, known.changes) = (Some(Instant::now()), changes);
        let hash = known.hash;
        let asked = self.jobs.asker().call_in_turn(move |session| {
            let info = session.info().ok().flatten()?;
            let arm = if Some(info.hash) == hash { None } else { session.device_arm().ok() };
            Some((info, arm))
        });
        if let Ok(Ok(Some((info, arm)))) = timeout(ASK_TIME, asked).await {
            if let Some(arm) = arm {
                (known.arm, known.hash) = (Arc::new(arm), Some(info.hash));
            }
            known.info = Some(info);
        }
        known.clone()
    }
}
