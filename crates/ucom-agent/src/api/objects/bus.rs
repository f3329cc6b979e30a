//! The bus, and who commands.
use agent_kit::access::Role;
use utoipa::ToSchema;

use crate::picture::Picture;

/// The bus, and who commands.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct StatusObject {
    /// Nothing moves: the boards are simulated.
    pub simulated: bool,
    /// The bus.
    pub bus: String,
    /// Time of this agent when this was made: since it began, ms. Who reads that it is long ago receives late, however steadily.
    pub at_ms: u64,
    /// Why the bus is gone; missing while it is there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost: Option<String>,
    /// How old this is, ms.
    pub age_ms: u64,
    /// Boards that are known.
    pub boards: usize,
    /// Load of the bus over the last second, %.
    pub load_percent: f64,
    /// Frames that were received, and sent.
    pub received: u64,
    /// Frames that this agent has sent.
    pub sent: u64,
    /// Frames that are not of this protocol.
    pub foreign_frames: u64,
    /// This agent sends heartbeats: who has the lease has commanded something, or boards that it has started are not stopped.
    pub is_master: bool,
    /// Another PC commands on this bus.
    pub competing_master: bool,
    /// Numbers that two boards have, in words.
    pub shared_numbers: Vec<String>,
    /// What the CAN adapter reports; missing where it reports nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub controller: Option<ControllerObject>,
    /// Who commands; missing where nobody does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lease: Option<LeaseObject>,
    /// What the caller may do.
    pub role: Role,
    /// Which agent this is, by a number that it was given at its start.
    pub agent: String,
    /// Number of the last event.
    pub last_event: u64,
    /// Number of the last Stop, 0 before the first: `asked_after` of what is asked for now.
    pub last_halt: u64,
}

/// Who commands.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct LeaseObject {
    /// Its name.
    pub holder: String,
    /// Since when, ms.
    pub age_ms: u64,
    /// Until it lapses, ms.
    pub left_ms: u64,
    /// Who asks for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wanted_by: Option<String>,
}

/// How the CAN controller of this computer gets on with the bus.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub struct ControllerObject {
    /// It has left the bus.
    pub bus_off: bool,
    /// How often it has.
    pub times_bus_off: u64,
    /// It is error passive.
    pub passive: bool,
    /// Transmit error counter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tec: Option<u16>,
    /// Receive error counter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rec: Option<u16>,
}

impl StatusObject {
    /// What a picture shows; what it does not show is empty.
    pub(crate) fn of(picture: &Picture) -> Self {
        let (statistics, now_us) = (&picture.statistics, picture.now_us);
        Self {
            simulated: false,
            bus: String::new(),
            at_ms: 0,
            lost: None,
            age_ms: picture.at.elapsed().as_millis() as u64,
            boards: picture.boards.iter().count(),
            load_percent: statistics.load_percent(now_us),
            received: statistics.received,
            sent: statistics.sent,
            foreign_frames: statistics.foreign_count(),
            is_master: picture.is_master,
            competing_master: picture.competing_us.is_some(),
            shared_numbers: picture.shared.clone(),
            controller: picture.controller.map(|controller| ControllerObject {
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
