//! The simulated controller, drives and arm in this process, as a port in virtual time.

use std::time::Duration;

use jtc_sim::World;

use super::{Port, PortError};

/// Bytes that wait for the line before a write blocks, as in an operating system.
const WRITE_BUFFER: usize = 4096;

/// Called after each simulated millisecond.
type Observer = Box<dyn FnMut(&World)>;

/// A world as a port: waiting lets virtual time pass.
pub struct SimPort {
    world: World,
    observer: Option<Observer>,
}

impl SimPort {
    /// A port of `world`.
    pub fn new(world: World) -> Self {
        Self { world, observer: None }
    }

    /// Calls `observer` after each simulated millisecond, for recordings at 1 kHz.
    pub fn observe(&mut self, observer: impl FnMut(&World) + 'static) {
        self.observer = Some(Box::new(observer));
    }

    /// The world.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// The world, to do something to it.
    pub fn world_mut(&mut self) -> &mut World {
        &mut self.world
    }

    /// One millisecond.
    pub fn step(&mut self) {
        self.world.step();
        if let Some(observer) = &mut self.observer {
            observer(&self.world);
        }
    }
}

impl Port for SimPort {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        let end = self.now() + timeout;
        loop {
            let n = self.world.host_read(buffer);
            if n > 0 || self.now() >= end {
                return Ok(n);
            }
            self.step();
        }
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.world.host_write(bytes);
        while self.world.host_write_pending() > WRITE_BUFFER {
            self.step();
        }
        Ok(())
    }

    fn now(&self) -> Duration {
        Duration::from_micros(self.world.now_us())
    }

    fn baud(&self) -> Option<u32> {
        self.world.config().baud
    }

    fn name(&self) -> String {
        "simulator".to_owned()
    }
}
