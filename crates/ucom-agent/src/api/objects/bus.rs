//! Status of the bus, and the lease of the agent.
use agent_kit::access::Role;
use utoipa::ToSchema;

use crate::snapshot::BusSnapshot;

/// Status of the bus, and the lease.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct StatusObject {
    /// `true` if the boards are simulated: nothing moves.
    pub simulated: bool,
    /// Name of the bus.
    pub bus: String,
    /// Time of this object since the start of the agent, ms. A client can use this time to detect that statuses arrive
    /// late, even if they arrive at a steady rate.
    pub at_ms: u64,
    /// Reason why the bus was lost; missing while it is available.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost: Option<String>,
    /// Age of this status, ms.
    pub age_ms: u64,
    /// Number of known boards.
    pub boards: usize,
    /// Load of the bus over the last second, %.
    pub load_percent: f64,
    /// Number of received frames, without frames of other protocols.
    pub received: u64,
    /// Number of frames that this agent has sent.
    pub sent: u64,
    /// Number of frames that do not belong to this protocol.
    pub foreign_frames: u64,
    /// `true` if this agent sends heartbeats. The agent sends them after a command of the lease holder, and as long as
    /// a board that it has started is not stopped.
    pub is_master: bool,
    /// `true` if another PC sends commands on this bus.
    pub competing_master: bool,
    /// Board numbers that two boards share, in words.
    pub shared_numbers: Vec<String>,
    /// State of the CAN controller; missing if the CAN adapter does not report it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controller: Option<ControllerObject>,
    /// Lease; missing if no client holds it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lease: Option<LeaseObject>,
    /// Role of the caller.
    pub role: Role,
    /// Number that identifies this run of the agent.
    pub agent: String,
    /// Number of the last event.
    pub last_event: u64,
    /// Number of the last Stop, 0 before the first: value of `asked_after` for new requests.
    pub last_halt: u64,
}

/// Lease, and its holder.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct LeaseObject {
    /// Name of the holder.
    pub holder: String,
    /// Time since the holder took the lease, ms.
    pub age_ms: u64,
    /// Time until the lease lapses without renewal, ms.
    pub left_ms: u64,
    /// Name of the client that waits for the lease.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wanted_by: Option<String>,
}

/// State of this computer's CAN controller.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(crate) struct ControllerObject {
    /// `true` if the CAN controller is bus-off.
    pub bus_off: bool,
    /// Number of bus-off events.
    pub times_bus_off: u64,
    /// `true` if the CAN controller is error passive.
    pub passive: bool,
    /// Transmit error counter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tec: Option<u16>,
    /// Receive error counter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rec: Option<u16>,
}

impl StatusObject {
    /// Returns the bus status for a snapshot; values that are not in the snapshot are empty.
    pub(crate) fn of(snapshot: &BusSnapshot) -> Self {
        let (statistics, now_us) = (&snapshot.statistics, snapshot.now_us);
        Self {
            simulated: false,
            bus: String::new(),
            at_ms: 0,
            lost: None,
            age_ms: snapshot.at.elapsed().as_millis() as u64,
            boards: snapshot.boards.iter().count(),
            load_percent: statistics.load_percent(now_us),
            received: statistics.received,
            sent: statistics.sent,
            foreign_frames: statistics.foreign_count(),
            is_master: snapshot.is_master,
            competing_master: snapshot.competing_us.is_some(),
            shared_numbers: snapshot.shared.clone(),
            controller: snapshot.controller.map(|controller| ControllerObject {
                bus_off: controller.bus_off,
                times_bus_off: controller.times_bus_off,
                passive: controller.passive,
                tec: controller.tec,
                rec: controller.rec,
            }),
            lease: None,
            role: Role::Viewer,
            agent: String::new(),
            last_event: 0,
            last_halt: 0,
        }
    }
}
