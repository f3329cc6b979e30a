//! Last will of a client, as in MQTT: the client's policy for the current motion. If this agent is killed, the next
//! agent applies the policy.
use std::time::Duration;

use jtc_wire::{ControllerState, ExecCommand, TrajectoryState};

use super::{LineEvent, POLICY, Policy, SharedLine};

/// Cause of a present or expected motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Moves {
    /// Upload of a trajectory. The arm is at rest, and a motion usually follows.
    Upload,
    /// Motion, including a paused motion.
    Motion,
    /// Teaching. The arm is moved by hand, or may soon be moved by hand.
    Teaching,
}

impl Moves {
    /// Returns a text for the cause.
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
    /// Name of the client that users see.
    pub client: String,
    /// Policy of this client.
    pub policy: Policy,
    /// Cause of the motion.
    pub what: Moves,
}

/// Result of the application of a last will.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Applied {
    /// The arm is at rest.
    Rests,
    /// The motion continues.
    GoesOn,
    /// The motion was paused before, and the will leaves it paused.
    Paused,
    /// The command in this variant was sent.
    Sent(ExecCommand),
}

impl SharedLine {
    /// Sets the policy that applies to the motion while no client holds the lease.
    pub(super) fn bequeath(&mut self, client: String, policy: Policy) {
        self.left = (client, policy);
    }

    /// Applies the will of a client whose agent was killed. Sends the command even if the arm seems to be at rest,
    /// because a status is older than the last command.
    pub fn apply_left(&mut self, client: &str, policy: Policy, now: Duration) -> Applied {
        self.bequeath(client.to_owned(), policy);
        if self.status.is_none() {
            // The cause of the motion is not known. The will applies until the controller reports that the arm is at
            // rest.
            self.will = Some(self.will_of(Moves::Motion));
        }
        let moves = self.motion_tracker.may_move(self.status.as_ref(), now);
        let stands = self.status.as_ref().is_some_and(|(_, status)| {
            status.trajectory == TrajectoryState::Pause && status.state == ControllerState::HoldPos
        });
        match policy.command() {
            // The motion is already paused; a second Pause would only delay new clients.
            Some(ExecCommand::Pause) if stands => Applied::Paused,
            Some(command) if self.hold(POLICY, command, now) => Applied::Sent(command),
            None if moves => Applied::GoesOn,
            None | Some(_) => Applied::Rests,
        }
    }

    /// Returns the will that applies if the agent is killed now.
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

    /// Returns the will with the policy of the present or last lease holder. A stronger command that the controller has
    /// not confirmed yet has priority.
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
