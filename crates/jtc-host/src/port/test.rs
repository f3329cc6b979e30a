//! Port with a closure instead of a device. The port is used for tests and for protocol experiments.

use std::collections::VecDeque;
use std::time::Duration;

use super::{Port, PortError, line_time};

/// Port that calls `device(now, bytes)` when bytes are written. While a call waits, the port calls `device` without bytes after each
/// virtual millisecond. The bytes that `device` returns can then be read from the port.
pub struct ScriptedPort<F> {
    device: F,
    now: Duration,
    inbox: VecDeque<u8>,
    baud: Option<u32>,
    written: Vec<u8>,
}

impl<F: FnMut(Duration, &[u8]) -> Vec<u8>> ScriptedPort<F> {
    /// Creates a port to `device`. If `baud` is not `None`, writing takes virtual time.
    pub fn new(baud: Option<u32>, device: F) -> Self {
        Self { device, now: Duration::ZERO, inbox: VecDeque::new(), baud, written: Vec::new() }
    }

    /// Returns all bytes that were written so far.
    pub fn written(&self) -> &[u8] {
        &self.written
    }
}

impl<F: FnMut(Duration, &[u8]) -> Vec<u8>> Port for ScriptedPort<F> {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        let end = self.now + timeout;
        while self.inbox.is_empty() && self.now < end {
            self.now = end.min(self.now + Duration::from_millis(1));
            self.inbox.extend((self.device)(self.now, &[]));
        }
        let n = buffer.len().min(self.inbox.len());
        for (slot, byte) in buffer.iter_mut().zip(self.inbox.drain(..n)) {
            *slot = byte;
        }
        Ok(n)
    }
    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.written.extend(bytes);
        self.now += line_time(bytes.len(), self.baud);
        let answer = (self.device)(self.now, bytes);
        self.inbox.extend(answer);
        Ok(())
    }
    fn now(&self) -> Duration {
        self.now
    }
    fn baud(&self) -> Option<u32> {
        self.baud
    }
    fn name(&self) -> String {
        "script".to_owned()
    }
}
