//! Identity of the controller and its arm. The agent reads it when needed, and all clients share the answer.
use std::sync::Arc;
use std::time::Duration;

use jtc_host::Arm;
use jtc_wire::Info;
use tokio::time::{Instant, timeout};

use super::Agent;

/// Time for which an answer is used before the controller is asked again.
const FRESH: Duration = Duration::from_secs(10);
/// Longest wait for the controller.
const ASK_TIME: Duration = Duration::from_secs(3);
/// Silence after which the controller is not asked.
const SILENT: Duration = Duration::from_secs(1);

/// Known identity of the controller.
#[derive(Clone)]
pub(super) struct Identity {
    asked: Option<Instant>,
    /// Identity as the controller reports it; `None` without extensions, or before its first answer.
    pub info: Option<Info>,
    /// Arm of the controller, or the agent's arm if the controller cannot return its own.
    pub arm: Arc<Arm>,
    /// Hash of the controller's arm.
    hash: Option<u64>,
    /// Number of frames that may have changed the arm and were sent before the controller was asked.
    changes: u64,
}

impl Identity {
    /// Returns the identity that is used before the first answer of the controller.
    pub(super) fn of(arm: &Arm) -> Self {
        let hash = arm.hash().ok().flatten();
        Self { asked: None, info: None, arm: Arc::new(arm.clone()), hash, changes: 0 }
    }

    /// Returns the identity that the controller reports, if the known arm is its arm in use.
    pub(super) fn of_controller(&self) -> Option<&Info> {
        self.info.as_ref().filter(|info| Some(info.hash) == self.hash)
    }
}

impl Agent {
    /// Returns the identity of the controller. Asks the controller if the last answer is older than 10 s, or if its arm
    /// may have changed since.
    pub(super) async fn identity(&self) -> Identity {
        // Concurrent requests wait for the answer to the first one.
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
