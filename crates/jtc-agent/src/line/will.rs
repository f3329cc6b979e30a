//! Last will of a client, as in MQTT: the client's policy for the current motion. If this agent is killed, the next
//! agent applies the policy.
use std::time::Duration;

use jtc_wire::{ControllerState, ExecCommand, TrajectoryState};

use super::{LineEvent, POLICY, Policy, SharedLine};

/// Cause of a motion that is in progress or expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Moves {
    /// Upload of a trajectory. The arm is at rest, and a motion usually follows.
    Upload,
    /// Motion in progress, including a paused motion.
    Motion,
    /// Teaching mode. A person moves the arm by hand, or may soon do so.
    Teaching,
}

impl Moves {
    /// Returns a text for the cause of the motion.
    pub fn text(self) -> &'static str {
        match self {
            Self::Upload => "an upload",
            Self::Motion => "a motion",
            Self::Teaching => "teaching",
        }
    }
}

/// Client whose policy applies to the motion if the agent is killed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Will {
    /// Name of the client, which users see.
    pub client: String,
    /// Policy of the client.
    pub policy: Policy,
    /// Cause of the motion.
    pub what: Moves,
}

/// Result of applying a last will.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Applied {
    /// The arm is at rest.
    Rests,
    /// The motion continues.
    GoesOn,
    /// The motion was paused before, and the last will leaves it paused.
    Paused,
    /// The agent sent the command in this variant.
    Sent(ExecCommand),
}

impl SharedLine {
    /// Sets the policy that applies to the motion while no client holds the lease.
    pub(super) fn bequeath(&mut self, client: String, policy: Policy) {
        self.left = (client, policy);
    }

    /// Applies the last will of a client whose agent was killed. Sends the command of the policy even if the arm seems
    /// to be at rest, because the status may be older than the last command.
    pub fn apply_left(&mut self, client: &str, policy: Policy, now: Duration) -> Applied {
        self.bequeath(client.to_owned(), policy);
        if self.status.is_none() {
            // Without a status, the agent does not know the cause of the motion. The last will applies until the
            // controller reports that the arm is at rest.
            self.will = Some(self.will_of(Moves::Motion));
        }
        let moves = self.motion_tracker.may_move(self.status.as_ref(), now);
        let stands = self.status.as_ref().is_some_and(|(_, status)| {
            status.trajectory == TrajectoryState::Pause && status.state == ControllerState::HoldPos
        });
        match policy.command() {
            // The motion is already paused; a second Pause would only cause a hold-off for new clients.
            Some(ExecCommand::Pause) if stands => Applied::Paused,
            Some(command) if self.hold(POLICY, command, now) => Applied::Sent(command),
            None if moves => Applied::GoesOn,
            None | Some(_) => Applied::Rests,
        }
    }

    /// Returns the last will that the next agent applies if this agent is killed now.
    pub fn will(&self) -> Option<&Will> {
        self.will.as_ref()
    }

    /// Reports the last will if it has changed.
    pub(super) fn look_what_moves(&mut self, now: Duration) {
        let before = self.will.as_ref().map(|will| will.what);
        let will = self.motion_tracker.what(self.status.as_ref(), now, before).map(|what| self.will_of(what));
        if will != self.will {
            self.will.clone_from(&will);
            self.events.push_back(LineEvent::Will(will));
        }
    }

    /// Returns the last will, with the policy of the present or last lease holder. If the controller has not yet
    /// confirmed a Stop or Pause that is stronger than this policy, the last will contains that command instead.
    fn will_of(&self, what: Moves) -> Will {
        let holder = self.lease.as_ref().and_then(|lease| self.introduction(lease.holder));
        let (client, policy) =
            holder.map_or_else(|| self.left.clone(), |holder| (holder.name.clone(), holder.policy));
        let asked = match self.halts.untaken() {
            Some(ExecCommand::Stop) if policy != Policy::Stop => Policy::Stop,
            Some(_) if policy == Policy::Continue => Policy::Pause,
            _ => return Will { client, policy, what },
        };
        Will { client: self.halted.1.clone(), policy: asked, what }
    }
}
