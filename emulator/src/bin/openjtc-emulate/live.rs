//! Main loop of `openjtc-emulate`, which connects the board, the terminal and the real-time clock.
use std::error::Error;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use openjtc_emulator::flash::Bank2;
use openjtc_emulator::observe::ResetCause;
use openjtc_emulator::{Board, Port};

use crate::frames::{Frames, GAP, Incoming};
use crate::log::DefmtLog;
use crate::pty::{Pty, PtyError};

/// Largest number of host bytes that may wait for transmission on the serial line.
const WAITING_MAX: usize = 4096;
/// Longest time for which the loop waits until the host reads bytes. The loop waits only if virtual time runs as fast
/// as possible.
const READER_WAIT: Duration = Duration::from_millis(100);
/// Largest delay of virtual time, relative to the real-time clock, that the loop makes up. After a larger delay,
/// virtual time stays late.
const CATCH_UP: Duration = Duration::from_secs(2);
const TICK: Duration = Duration::from_millis(1);

/// Speed of virtual time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Speed {
    /// Virtual time follows the real-time clock.
    Realtime,
    /// Virtual time runs as fast as possible.
    Max,
}

/// State of the main loop.
pub struct Live {
    board: Board,
    port: Port,
    /// Bit rate of the host, bit/s; `None` means the rate of the firmware.
    baud: Option<u32>,
    pty: Pty,
    speed: Speed,
    log: Option<DefmtLog>,
    frames: Frames,
    incoming: Incoming,
    /// Bytes of the board that the terminal has not accepted yet.
    rest: Vec<u8>,
    connected: bool,
    ready: bool,
    resets: usize,
    faults: usize,
}

impl Live {
    /// Creates the state of the main loop for a board that has just been switched on and is connected to this terminal.
    pub fn new(
        board: Board,
        port: Port,
        baud: Option<u32>,
        pty: Pty,
        speed: Speed,
        log: Option<DefmtLog>,
    ) -> Self {
        Self {
            board,
            port,
            baud,
            pty,
            speed,
            log,
            frames: Frames::default(),
            incoming: Incoming::new(Instant::now()),
            rest: Vec::new(),
            connected: false,
            ready: false,
            resets: 1,
            faults: 0,
        }
    }

    /// Returns the contents of flash bank 2 after a power failure at the current virtual time.
    pub fn cut_power(&self, seed: u64) -> Bank2 {
        self.board.machine.cut_power(seed)
    }

    /// Runs the main loop until `stop` is set.
    pub fn run(&mut self, stop: &AtomicBool) -> Result<(), Box<dyn Error>> {
        let (mut start, mut start_ms) = (Instant::now(), self.board.now_ms());
        while !stop.load(Ordering::Relaxed) {
            self.take_input()?;
            if self.speed == Speed::Realtime {
                let passed = TICK * (self.board.now_ms() - start_ms) as u32;
                let due = start.elapsed().saturating_sub(passed);
                if due < TICK {
                    self.wait(TICK - due)?;
                    continue;
                }
                if due > CATCH_UP {
                    // Virtual time is more than `CATCH_UP` late. The loop accepts this delay, and continues at normal
                    // speed from this moment.
                    (start, start_ms) = (Instant::now(), self.board.now_ms());
                }
            }
            if self.stands_still()? {
                continue;
            }
            let own = self.board.firmware_baud(self.port);
            if let Some(baud) = self.baud.or((own != 0).then_some(own)) {
                self.board.set_baud(self.port, baud);
            }
            self.board.step();
            self.report()?;
            self.give_output()?;
        }
        Ok(())
    }

    fn wait(&self, time: Duration) -> Result<(), PtyError> {
        if self.incoming_room() == 0 {
            std::thread::sleep(time);
            return Ok(());
        }
        self.pty.wait_input(time)
    }

    fn incoming_room(&self) -> usize {
        WAITING_MAX.saturating_sub(self.board.pending(self.port))
    }

    fn take_input(&mut self) -> Result<(), PtyError> {
        let mut buffer = [0; WAITING_MAX];
        loop {
            let room = self.incoming_room();
            let n = if room == 0 { 0 } else { self.pty.read(&mut buffer[..room])? };
            if n == 0 {
                return Ok(());
            }
            self.incoming.push(&buffer[..n], Instant::now());
            self.incoming.carries(Instant::now());
            self.board.write(self.port, &buffer[..n]);
        }
    }

    /// Pauses virtual time briefly while the operating system could still deliver more bytes of a frame. Without the
    /// pause, the board would measure this delay as a gap in the frame. The function does not pause while bytes of
    /// the host still wait for transmission on the serial line. Returns `true` after a pause.
    fn stands_still(&mut self) -> Result<bool, PtyError> {
        if self.board.pending(self.port) > 0 || !self.incoming.mid_frame() {
            return Ok(false);
        }
        let Some(silence) = self.incoming.silence(Instant::now()) else { return Ok(false) };
        self.pty.wait_input(GAP.saturating_sub(silence))?;
        Ok(true)
    }

    /// Prints the log of the firmware, and resets and faults of the machine.
    fn report(&mut self) -> Result<(), Box<dyn Error>> {
        let ms = self.board.now_ms();
        if let Some(log) = &mut self.log {
            log.print(&self.board.machine.defmt())?;
        }
        let observers = &self.board.machine.chip().observers;
        for fault in &observers.faults[self.faults..] {
            eprintln!("{ms} ms: {:?} at 0x{:08X}, address 0x{:08X}", fault.kind, fault.pc, fault.address);
        }
        for reset in observers.resets.iter().skip(self.resets).filter(|r| r.cause != ResetCause::PowerOn) {
            eprintln!("{ms} ms: reset, {:?}, at 0x{:08X}", reset.cause, reset.pc);
        }
        (self.faults, self.resets) = (observers.faults.len(), observers.resets.len());
        Ok(())
    }

    fn give_output(&mut self) -> Result<(), PtyError> {
        let bytes = self.board.read(self.port);
        self.frames.push(&bytes);
        if self.frames.is_empty() {
            return Ok(());
        }
        if !self.ready {
            println!("ready: {}", self.pty.name().display());
            self.ready = true;
        }
        let connected = self.pty.host_is_there()?;
        if self.connected && !connected {
            self.rest.clear();
            self.pty.renew()?;
        }
        self.connected = connected;
        while let Some(frame) = self.frames.pop() {
            if connected {
                self.write_rest()?;
                if self.rest.is_empty() {
                    self.rest = frame;
                    self.write_rest()?;
                }
            }
        }
        Ok(())
    }

    /// Writes the remaining bytes of the board to the terminal. In real time the function never waits, because a host
    /// that does not read must not delay the arm.
    fn write_rest(&mut self) -> Result<(), PtyError> {
        let end = Instant::now() + READER_WAIT;
        while !self.rest.is_empty() {
            let n = self.pty.write(&self.rest)?;
            self.rest.drain(..n);
            let now = Instant::now();
            if n == 0 && (self.speed == Speed::Realtime || now >= end) {
                break;
            }
            if n == 0 {
                self.pty.wait_room(end - now)?;
            }
        }
        Ok(())
    }
}
