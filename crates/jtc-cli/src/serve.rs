//! Simulated controller on a pseudo-terminal. A single loop advances the simulated world, the terminal and the clock.

mod frames;
mod pty;
mod typed;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use can_link::CanBus;
use cli_kit::Stop;
use jtc_host::Sample;
use jtc_host::recording::SampleSink;
use jtc_sim::{BusTap, World};

use crate::args::SimSpeed;
use frames::{Frames, Incoming};
pub(crate) use pty::{Pty, PtyError};
pub(crate) use typed::{Typed, hand};

/// Largest number of host bytes that the simulator buffers for transmission, like a serial adapter. When this buffer
/// is full, writes of the host block.
const WAITING_MAX: usize = 4096;
/// Longest wait for a host that does not read, if virtual time does not follow the real-time clock. After this wait,
/// statuses are lost.
const READER_WAIT: Duration = Duration::from_millis(100);
/// Largest delay for which virtual time catches up, µs. After a longer delay (for example a suspended computer), the simulator skips the
/// missed time.
const CATCH_UP_US: u64 = 2_000_000;
/// Duration of a tick, µs.
const TICK_US: u64 = 1000;

/// Joint bus that is connected to a CAN bus, so that other programs can use the joint bus.
pub(crate) type Tap = BusTap<Box<dyn CanBus + Send>>;

/// State of the main loop.
pub(crate) struct Server {
    world: World,
    pty: Pty,
    tap: Option<Tap>,
    typed: Typed,
    frames: Frames,
    incoming: Incoming,
    /// Remaining bytes of a frame that the terminal did not accept at once.
    rest: Vec<u8>,
    connected: bool,
    /// `true` if the host has not read for a long time. Statuses are lost until the host reads again.
    stalled: bool,
    /// `true` after the first status of the controller.
    answers: bool,
    /// Sink for the samples of every tick.
    sink: Option<SampleSink>,
    /// File of the stored arm, and the sequence number of the arm in the file.
    keeps: Option<(PathBuf, u32)>,
}

impl Server {
    /// Creates a server for a simulated world on a pseudo-terminal. `tap` is the joint bus of the world, and `typed` contains the events
    /// that the user types.
    pub(crate) fn new(world: World, pty: Pty, tap: Option<Tap>, typed: Typed) -> Self {
        Self {
            world,
            pty,
            tap,
            typed,
            frames: Frames::default(),
            incoming: Incoming::new(Instant::now()),
            rest: Vec::new(),
            connected: false,
            stalled: false,
            answers: false,
            sink: None,
            keeps: None,
        }
    }

    /// Passes the results of each tick of the controller to `sink`.
    pub(crate) fn recorded(self, sink: Option<SampleSink>) -> Self {
        Self { sink, ..self }
    }

    /// Sets the file in which the simulator stores the stored arm of the controller.
    pub(crate) fn keeping(self, file: Option<PathBuf>) -> Self {
        let number = self.world.stored_arm().map_or(0, |(_, number)| number);
        Self { keeps: file.map(|file| (file, number)), ..self }
    }

    /// If the controller has just stored an arm, writes this arm to the file.
    fn keep(&mut self) {
        if let (Some((file, kept)), Some((image, number))) = (&mut self.keeps, self.world.stored_arm())
            && *kept != number
        {
            *kept = number;
            match host_kit::write_atomically(file, image) {
                Ok(()) => eprintln!("jtc: arm number {number} is stored in {}", file.display()),
                Err(e) => {
                    eprintln!("jtc: {}: {e}; the stored arm is lost when this simulator ends", file.display())
                }
            }
        }
    }

    /// Runs the simulation until `stop`. Calls `ready` when the controller has sent its first status. Returns the elapsed virtual time, s.
    pub(crate) fn run(
        &mut self,
        speed: SimSpeed,
        stop: &Stop,
        ready: impl FnOnce(),
    ) -> Result<f64, PtyError> {
        let mut ready = Some(ready);
        let mut start = Instant::now();
        let mut start_us = self.world.now_us();
        while !stop.asked() {
            self.take_input()?;
            if speed == SimSpeed::Realtime {
                let virtual_us = self.world.now_us() - start_us;
                let due_us = (start.elapsed().as_micros() as u64).saturating_sub(virtual_us);
                if due_us < TICK_US {
                    let rest = Duration::from_micros(TICK_US - due_us);
                    if self.world.host_write_pending() >= WAITING_MAX {
                        std::thread::sleep(rest); // the simulated line would not accept more input now
                    } else {
                        self.pty.wait_input(rest)?;
                    }
                    continue;
                }
                if due_us > CATCH_UP_US {
                    (start, start_us) = (Instant::now(), self.world.now_us());
                }
            }
            self.note_silence();
            self.typed.act(&mut self.world);
            self.world.step();
            self.keep();
            if let Some(sink) = &self.sink
                && self.world.ticked()
            {
                sink.write(&Sample::from(self.world.telemetry()));
            }
            if let Some(tap) = &mut self.tap
                && let Err(e) = tap.exchange(&mut self.world)
            {
                // Other devices on the CAN bus are optional, so the simulation continues without them.
                eprintln!("jtc: CAN: {e}; the joint bus is no longer shared");
                self.tap = None;
            }
            self.give_output(speed)?;
            if self.answers
                && let Some(ready) = ready.take()
            {
                ready();
            }
        }
        Ok(self.world.now_us() as f64 * 1e-6)
    }

    /// Passes bytes of the host to the simulated line, up to the buffer size of a serial adapter.
    fn take_input(&mut self) -> Result<(), PtyError> {
        let mut buffer = [0; WAITING_MAX];
        loop {
            let room = WAITING_MAX.saturating_sub(self.world.host_write_pending());
            if room == 0 {
                return Ok(());
            }
            let n = self.pty.read(&mut buffer[..room])?;
            if n == 0 {
                return Ok(());
            }
            self.incoming.push(&buffer[..n], Instant::now());
            self.world.host_write(&buffer[..n]);
        }
    }

    /// Passes the duration of the host's silence within a frame to the simulated world; see [`Incoming`].
    fn note_silence(&mut self) {
        let now = Instant::now();
        if self.world.host_write_pending() > 0 {
            self.incoming.carries(now);
        }
        let silence = self.incoming.silence(now);
        self.world.limit_host_silence(silence.map(|silence| silence.as_micros() as u64));
    }

    /// Passes statuses to the host. Without a host, the statuses are lost, as on a serial line without a receiver.
    fn give_output(&mut self, speed: SimSpeed) -> Result<(), PtyError> {
        let mut buffer = [0; 1024];
        loop {
            let n = self.world.host_read(&mut buffer);
            if n == 0 {
                break;
            }
            self.frames.push(&buffer[..n]);
        }
        if self.frames.is_empty() {
            return Ok(());
        }
        self.answers = true;
        let connected = self.pty.host_is_there()?;
        if self.connected && !connected {
            self.rest.clear();
            self.pty.renew()?;
        }
        if !self.connected && connected {
            self.stalled = false;
        }
        self.connected = connected;
        while let Some(frame) = self.frames.pop() {
            if !connected {
                continue;
            }
            self.write_rest(speed)?;
            if self.rest.is_empty() {
                self.rest = frame;
                self.write_rest(speed)?;
            }
        }
        Ok(())
    }

    /// Writes the remaining bytes of a frame. A host that does not read must not delay the arm, so the simulator does not wait in real
    /// time. If virtual time does not follow the real-time clock, the simulator waits only for a limited time.
    fn write_rest(&mut self, speed: SimSpeed) -> Result<(), PtyError> {
        let end = Instant::now() + READER_WAIT;
        while !self.rest.is_empty() {
            let n = self.pty.write(&self.rest)?;
            self.rest.drain(..n);
            if n > 0 {
                self.stalled = false;
                continue;
            }
            let now = Instant::now();
            if speed == SimSpeed::Realtime || self.stalled || now >= end {
                self.stalled = true;
                break;
            }
            self.pty.wait_room(end - now)?;
        }
        Ok(())
    }
}
