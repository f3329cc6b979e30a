//! Connection of the simulated joint bus to another bus. The nodes on the other bus receive every frame, and their
//! frames take part in the simulation.
use core::time::Duration;

use can_link::{CanBus, CanError, CanFrame, Id};
use jtc_bus::Frame;

use crate::world::World;

/// Largest number of frames that are taken from the other bus per millisecond.
const MOST: usize = 32;

/// Tap on the joint bus of a simulation.
pub struct BusTap<B> {
    bus: B,
    /// Number of frames sent to the other bus.
    pub sent: u64,
    /// Number of frames taken from the other bus.
    pub taken: u64,
    /// Number of frames from the other bus that the tap rejected. A rejected frame is not valid on the joint
    /// bus, or arrived while the queue of the joint bus was full.
    pub refused: u64,
}

impl<B: CanBus> BusTap<B> {
    /// Connects `bus` to the joint bus of a simulation.
    pub fn new(bus: B) -> Self {
        Self { bus, sent: 0, taken: 0, refused: 0 }
    }

    /// Sends the frames of the simulated bus to the other bus, and takes frames of nodes on the other bus. The
    /// simulation transmits these frames in the next millisecond. The caller must call this function after each
    /// `World::step`.
    pub fn exchange(&mut self, world: &mut World) -> Result<(), CanError> {
        for timed in world.bus_frames() {
            let frame = &timed.frame;
            let converted =
                Id::standard(u32::from(frame.id)).and_then(|id| CanFrame::fd_padded(id, frame.data()));
            // The conversion succeeds for every frame of the joint bus, because its identifier and length are valid.
            let Ok(converted) = converted else { continue };
            self.bus.send(&converted)?;
            self.sent += 1;
        }
        for _ in 0..MOST {
            let Some(frame) = self.bus.receive(Duration::ZERO)? else { break };
            let ours = u16::try_from(frame.id().value())
                .ok()
                .filter(|_| !frame.id().is_extended() && !frame.is_remote());
            match ours.and_then(|id| Frame::new(id, frame.data())) {
                Some(frame) if world.put_bus_frame(frame) => self.taken += 1,
                _ => self.refused += 1,
            }
        }
        Ok(())
    }
}
