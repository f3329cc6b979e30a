//! What the policy of a client is to act on, should the agent be killed: a last will, as that of MQTT, that somebody else reads.
use std::time::Duration;

use jtc_wire::{ControllerState, ExecCommand, TrajectoryState};

use super::{LineEvent, POLICY, Policy, SharedLine};

/// What moves the arm, or is about to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Moves {
    /// Nothing yet: a trajectory is uploaded, and a motion follows as a rule.
    Upload,
    /// A motion, also one that is paused.
    Motion,
    /// Somebody leads it by hand, or may soon.
    Teaching,
}

impl Moves {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            Self::Upload => "an upload",
            Self::Motion => "a motion",
            Self::Teaching => "teaching",
        }
    }
}

/// Whose policy acts on what moves when nobody is there any more.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Will {
    /// What people call the client.
    pub client: String,
    /// Its policy.
    pub policy: Policy,
    /// What moves.
    pub what: Moves,
}

/// What was done with what a client has left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Applied {
    /// Nothing moves any more.
    Rests,
    /// It goes on.
    GoesOn,
    /// It was paused before, and stays so.
    Paused,
    /// This was sent.
    Sent(ExecCommand),
}

impl SharedLine {
    /// From now on this policy acts on what moves while nobody commands.
    pub(super) fn bequeath(&mut self, client: String, policy: Policy) {
        self.left = (client, policy);
    }

    /// Does what a client has left to an agent that was killed before it could. Where nothing seems to move it is sent as well, as a status
    /// is older than the last command.
    pub fn apply_left(&mut self, client: &str, policy: Policy, now: Duration) -> Applied {
        self.bequeath(client.to_owned(), policy);
        if self.status.is_none() {
            // Nobody knows what moves: what was left is in force until the device reports that nothing does.
            self.will = Some(self.will_of(Moves::Motion));
        }
        let moves = self.moving.may_move(self.status.as_ref(), now);
        let stands = self.status.as_ref().is_some_and(|(_, status)| {
            status.trajectory == TrajectoryState::Pause && status.state == ControllerState::HoldPos
        });
        match policy.command() {
            // It is so already; another Pause would hold up whoever comes.
            Some(ExecCommand::Pause) if stands => Applied::Paused,
            Some(command) if self.hold(POLICY, command, now) => Applied::Sent(command),
            None if moves => Applied::GoesOn,
            None | Some(_) => Applied::Rests,
        }
    }

    /// What is in force now, should the agent be killed.
    pub fn will(&self) -> Option<&Will> {
        self.will.as_ref()
    }

    /// Reports another will when it has changed.
    pub(super) fn look_what_moves(&mut self, now: Duration) {
        let before = self.will.as_ref().map(|will| will.what);
        let will = self.moving.what(self.status.as_ref(), now, before).map(|what| self.will_of(what));
        if will != self.will {
            self.will.clone_from(&will);
            self.events.push_back(LineEvent::Will(will));
        }
    }

    /// That of who commands, or of the last who did; more than that where somebody has asked for more and the device does not take it.
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
