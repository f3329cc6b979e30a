//! Port to a simulated controller with drives and an arm. The simulation runs in this process, in virtual time.

use std::time::{Duration, Instant};

use jtc_sim::World;

use super::{Port, PortError};

/// Size of the write buffer of the line, bytes. A write to a full buffer blocks, as in a real operating system.
const WRITE_BUFFER: usize = 4096;

/// Callback that is called after each simulated millisecond.
type Observer = Box<dyn FnMut(&World)>;

/// Port to a simulated world. The virtual time advances while a call waits.
pub struct SimPort {
    world: World,
    observer: Option<Observer>,
}

impl SimPort {
    /// Creates a port to `world`.
    pub fn new(world: World) -> Self {
        Self { world, observer: None }
    }

    /// Sets `observer`, which is called after each simulated millisecond. The observer is used for recordings at 1 kHz.
    pub fn observe(&mut self, observer: impl FnMut(&World) + 'static) {
        self.observer = Some(Box::new(observer));
    }

    /// Returns the simulated world.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Returns the simulated world, which the caller may modify.
    pub fn world_mut(&mut self) -> &mut World {
        &mut self.world
    }

    /// Simulates one millisecond.
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

/// Longest delay relative to real time that the simulation makes up for. A longer delay, for example after the computer
/// was suspended, is skipped completely.
const CATCH_UP: Duration = Duration::from_secs(2);

/// Port to a simulated world that runs in real time, like a real controller.
pub struct LivePort {
    world: World,
    start: Instant,
    /// Real time that the simulation has skipped.
    left_out: Duration,
}

impl LivePort {
    /// Creates a port to `world`. The simulated time begins when the port is created.
    pub fn new(world: World) -> Self {
        Self { world, start: Instant::now(), left_out: Duration::ZERO }
    }

    /// Advances the world to the current time.
    fn catch_up(&mut self) {
        let world = Duration::from_micros(self.world.now_us());
        let behind = self.now().saturating_sub(world);
        if behind > CATCH_UP {
            self.left_out += behind;
        }
        // The clock is read only once, before the loop. Otherwise the loop would never end on a computer that
        // simulates more slowly than real time.
        let now = self.now();
        while Duration::from_micros(self.world.now_us()) < now {
            self.world.step();
        }
    }
}

impl Port for LivePort {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        let end = Instant::now() + timeout;
        loop {
            self.catch_up();
            let n = self.world.host_read(buffer);
            let left = end.saturating_duration_since(Instant::now());
            if n > 0 || left.is_zero() {
                return Ok(n);
            }
            std::thread::sleep(left.min(Duration::from_millis(1)));
        }
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.catch_up();
        self.world.host_write(bytes);
        Ok(())
    }

    fn now(&self) -> Duration {
        self.start.elapsed().saturating_sub(self.left_out)
    }

    fn baud(&self) -> Option<u32> {
        self.world.config().baud
    }

    fn name(&self) -> String {
        "simulated controller".to_owned()
    }
}
