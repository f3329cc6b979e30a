//! Who the controller is and what its arm is, asked once in a while for all who look.
use std::sync::Arc;
use std::time::Duration;

use jtc_host::Arm;
use jtc_wire::Info;
use tokio::time::{Instant, timeout};

use super::Agent;

/// What was asked is taken to be so for this time.
const FRESH: Duration = Duration::from_secs(10);
/// Longest that is waited for the controller.
const ASK_TIME: Duration = Duration::from_secs(3);
/// A controller that has been silent for so long is not asked.
const SILENT: Duration = Duration::from_secs(1);

/// What is known of the controller.
#[derive(Clone)]
pub(super) struct Identity {
    asked: Option<Instant>,
    /// What it says of itself; `None` where it has no extensions, or has not answered yet.
    pub info: Option<Info>,
    /// Its arm; the agent's where it cannot be asked.
    pub arm: Arc<Arm>,
    /// That of its arm.
    hash: Option<u64>,
    /// Frames that may have changed the arm, as far as they had gone to the controller when it was asked.
    changes: u64,
}

impl Identity {
    /// Before it was asked.
    pub fn of(arm: &Arm) -> Self {
        let hash = arm.hash().ok().flatten();
        Self { asked: None, info: None, arm: Arc::new(arm.clone()), hash, changes: 0 }
    }

    /// What the controller says of itself, where the arm is the one that it has in use.
    pub fn of_controller(&self) -> Option<&Info> {
        self.info.as_ref().filter(|info| Some(info.hash) == self.hash)
    }
}

impl Agent {
    /// What is known of the controller: it is asked where that is not of the last seconds, or its arm may have changed since.
    pub(super) async fn identity(&self) -> Identity {
        // Whoever comes meanwhile waits for what the first one asks.
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
