//! Connects the simulated joint bus to a bus that others can join: they see every frame, and their frames take part.
use core::time::Duration;

use can_link::{CanBus, CanError, CanFrame, Id};
use jtc_bus::Frame;

use crate::world::World;

/// Frames taken from the other side in one millisecond.
const MOST: usize = 32;

/// A tap on the joint bus of a world.
pub struct BusTap<B> {
    bus: B,
    /// Frames given to the other side.
    pub sent: u64,
    /// Frames taken from the other side.
    pub taken: u64,
    /// Frames of the other side that cannot be on this bus, or found no room.
    pub refused: u64,
}

impl<B: CanBus> BusTap<B> {
    /// Tie `bus` to a world.
    pub fn new(bus: B) -> Self {
        Self { bus, sent: 0, taken: 0, refused: 0 }
    }

    /// Call after each `World::step`: sends the frames of the simulated bus, and takes frames of others, which are
    /// carried in the next millisecond.
    pub fn exchange(&mut self, world: &mut World) -> Result<(), CanError> {
        for timed in world.bus_frames() {
            let frame = &timed.frame;
            let converted =
                Id::standard(u32::from(frame.id)).and_then(|id| CanFrame::fd_padded(id, frame.data()));
            // Every frame of the joint bus has such an id and length.
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
