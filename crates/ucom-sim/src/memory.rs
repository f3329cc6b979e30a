//! Simulated parts of a board in memory, for tests, examples and simulations: flash with operation times and faults,
//! init pins on a wire, a store, and an application that records its calls.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use ucom::node::{Application, Area, Flash, FlashError, FlashState, Pins, RECORD_LEN, Store, Text};
use ucom::{Dimensions, Memory};

use crate::texts::Texts;

/// Program flash, data flash and exloader RAM in memory.
///
/// A write can only clear bits, as in a real flash. The field `fail_after` makes operations fail. The field `cut_after` cuts the power
/// during one operation. Half of that operation is performed, and all later operations fail until [`MemoryFlash::power_up`].
#[derive(Clone, Debug)]
pub struct MemoryFlash {
    /// Application area of the program flash.
    pub program: Area,
    /// Area of the data flash.
    pub data: Area,
    /// Area of the exloader RAM.
    pub ram: Area,
    /// Duration of an erase, µs.
    pub erase_us: u64,
    /// Duration of a write of one block, µs.
    pub write_us: u64,
    /// Number of the first operation that fails, counted from 0. All operations after this operation also fail.
    pub fail_after: Option<u64>,
    /// Number of the operation during which the power is lost, counted from 0.
    pub cut_after: Option<u64>,
    /// Byte of the program flash that stays erased after every write. Only a read-back of the flash detects this fault.
    pub stuck_byte: Option<usize>,
    /// Number of flash operations that were started so far.
    pub operations: u64,
    cells: [Vec<u8>; 3],
    record: [u8; RECORD_LEN],
    busy_until: u64,
    failed: bool,
    dark: bool,
}

impl Default for MemoryFlash {
    /// Returns a memory with 32 Ki words of program flash from word 0, 4 Ki words of data flash, and 2 Ki words of RAM.
    fn default() -> Self {
        let area = |words| Area { start: 0, words };
        Self::new(area(0x8000), area(0x1000), area(0x800))
    }
}

impl MemoryFlash {
    /// Creates an erased flash with the given areas.
    pub fn new(program: Area, data: Area, ram: Area) -> Self {
        let cells = [program, data, ram].map(|area| vec![0xFF; 2 * area.words as usize]);
        Self {
            program,
            data,
            ram,
            erase_us: 50_000,
            write_us: 500,
            fail_after: None,
            cut_after: None,
            stuck_byte: None,
            operations: 0,
            cells,
            record: [0xFF; RECORD_LEN],
            busy_until: 0,
            failed: false,
            dark: false,
        }
    }

    /// Returns `true` if the power was lost during a flash operation.
    pub const fn is_dark(&self) -> bool {
        self.dark
    }

    /// Restores the power of the flash, which keeps its contents.
    pub fn power_up(&mut self) {
        self.dark = false;
        self.failed = false;
        self.cut_after = None;
        self.busy_until = 0;
    }

    /// Returns the bytes of a memory in the order in which an update sends them.
    pub fn bytes(&self, memory: Memory) -> &[u8] {
        &self.cells[slot(memory)]
    }

    /// Stores an application in the flash without the programming protocol.
    pub fn install(&mut self, record: ucom::node::Record, image: &[u8]) {
        let start = 2 * record.address.saturating_sub(self.program.start) as usize;
        if let Some(place) = self.cells[0].get_mut(start..start + image.len()) {
            place.copy_from_slice(image);
            self.record = record.build();
        }
    }

    /// Starts a flash operation. The function returns how much of the operation is performed: 2 for all, 1 for half,
    /// 0 for nothing.
    fn begin(&mut self, now_us: u64, duration: u64) -> Result<usize, FlashError> {
        if self.dark {
            return Err(FlashError);
        }
        let number = self.operations;
        self.operations += 1;
        self.failed = self.fail_after.is_some_and(|at| number >= at);
        self.busy_until = now_us + duration;
        if self.cut_after == Some(number) {
            self.dark = true;
            return Ok(1);
        }
        Ok(if self.failed { 0 } else { 2 })
    }

    fn range(&self, memory: Memory, address: u32, bytes: usize) -> Option<core::ops::Range<usize>> {
        let area = self.area(memory)?;
        area.holds(Area { start: address, words: bytes.div_ceil(2) as u32 }).then(|| {
            let start = 2 * (address - area.start) as usize;
            start..start + bytes
        })
    }
}

const fn slot(memory: Memory) -> usize {
    match memory {
        Memory::Program => 0,
        Memory::Data => 1,
        Memory::Ram => 2,
    }
}

impl Flash for MemoryFlash {
    fn area(&self, memory: Memory) -> Option<Area> {
        Some([self.program, self.data, self.ram][slot(memory)]).filter(|area| area.words > 0)
    }

    fn state(&mut self, now_us: u64) -> FlashState {
        if now_us < self.busy_until {
            FlashState::Busy
        } else if self.failed || self.dark {
            FlashState::Failed
        } else {
            FlashState::Ready
        }
    }

    fn erase(&mut self, now_us: u64, memory: Memory, area: Area) -> Result<(), FlashError> {
        let range = self.range(memory, area.start, 2 * area.words as usize).ok_or(FlashError)?;
        let halves = self.begin(now_us, self.erase_us)?;
        let end = range.start + range.len() * halves / 2;
        self.cells[slot(memory)][range.start..end].fill(0xFF);
        Ok(())
    }

    fn write(&mut self, now_us: u64, memory: Memory, address: u32, data: &[u8]) -> Result<(), FlashError> {
        let range = self.range(memory, address, data.len()).ok_or(FlashError)?;
        let halves = self.begin(now_us, self.write_us)?;
        let cells = &mut self.cells[slot(memory)][range];
        let len = data.len() * halves / 2;
        for (cell, byte) in cells.iter_mut().zip(data).take(len) {
            *cell = if memory == Memory::Ram { *byte } else { *cell & *byte };
        }
        if let Some(cell) = self.stuck_byte.and_then(|at| self.cells[slot(Memory::Program)].get_mut(at)) {
            *cell = 0xFF;
        }
        Ok(())
    }

    fn read(&self, memory: Memory, address: u32, data: &mut [u8]) -> Result<(), FlashError> {
        let range = self.range(memory, address, data.len()).ok_or(FlashError)?;
        data.copy_from_slice(&self.cells[slot(memory)][range]);
        Ok(())
    }

    fn record(&self) -> [u8; RECORD_LEN] {
        self.record
    }

    fn erase_record(&mut self, now_us: u64) -> Result<(), FlashError> {
        let halves = self.begin(now_us, self.write_us)?;
        self.record[..RECORD_LEN * halves / 2].fill(0xFF);
        Ok(())
    }

    fn write_record(&mut self, now_us: u64, record: &[u8; RECORD_LEN]) -> Result<(), FlashError> {
        let halves = self.begin(now_us, self.write_us)?;
        for (cell, byte) in self.record.iter_mut().zip(record).take(RECORD_LEN * halves / 2) {
            *cell &= *byte;
        }
        Ok(())
    }
}

/// Init pins of a board, connected by wires. The outgoing pin of one board is the incoming pin of the next board.
#[derive(Clone, Debug, Default)]
pub struct WirePins {
    /// Level of the wire from the previous board.
    pub input: Arc<AtomicBool>,
    /// Level of the wire to the next board.
    pub output: Arc<AtomicBool>,
}

impl WirePins {
    /// Returns the pins of the boards in a chain; the incoming pin of the first board is strapped active.
    pub fn chain(boards: usize) -> Vec<Self> {
        let mut input = Arc::new(AtomicBool::new(true));
        let next = |_| {
            let output = Arc::new(AtomicBool::new(false));
            let pins = Self { input: input.clone(), output: output.clone() };
            input = output;
            pins
        };
        (0..boards).map(next).collect()
    }
}

impl Pins for WirePins {
    fn init_in(&self) -> bool {
        self.input.load(Ordering::SeqCst)
    }

    fn set_init_out(&mut self, active: bool) {
        self.output.store(active, Ordering::SeqCst);
    }
}

/// Store of the status bit ASTART and of the description, in memory.
#[derive(Clone, Debug, Default)]
pub struct MemoryStore {
    /// Stored value of the status bit ASTART.
    pub autostart: bool,
    /// Description of the board, in Latin-1.
    pub description: Vec<u8>,
}

impl Store for MemoryStore {
    fn autostart(&self) -> bool {
        self.autostart
    }

    fn set_autostart(&mut self, on: bool) {
        self.autostart = on;
    }

    fn description(&self) -> &[u8] {
        &self.description
    }
}

/// Application without a controlled process: buffers, texts, and a record of the calls.
#[derive(Clone, Debug, Default)]
pub struct MemoryApplication {
    /// Time from the start until the application runs, µs.
    pub start_us: u64,
    /// Description of the application, and the names of its inputs, outputs and parameters.
    pub texts: Texts,
    /// Initial values of the controller inputs.
    pub initial_ci: Vec<u16>,
    /// Received controller inputs.
    pub ci: Vec<u16>,
    /// Controller inputs that have taken effect.
    pub latched_ci: Vec<u16>,
    /// Sensor outputs; the caller changes their values.
    pub so: Vec<u16>,
    /// Sensor outputs of the last snapshot.
    pub sampled_so: Vec<u16>,
    /// Parameters of the application.
    pub par: Vec<u16>,
    /// Debug texts that wait for transmission.
    pub debug: Vec<Vec<u8>>,
    /// `true` if the control loop runs.
    pub running: bool,
    /// `true` if the outputs are enabled.
    pub active: bool,
    /// Number of control cycles that were run so far.
    pub steps: u64,
    /// Time at which the application was started; `None` if the application does not run.
    pub started_us: Option<u64>,
}

impl MemoryApplication {
    /// Creates an application with one input, output or parameter for each text. All values of the new application are 0.
    pub fn new(text: &str, ci: &[&str], so: &[&str], par: &[&str]) -> Self {
        Self {
            start_us: 10_000,
            texts: Texts::new(text, ci, so, par),
            initial_ci: vec![0; ci.len()],
            ci: vec![0; ci.len()],
            latched_ci: vec![0; ci.len()],
            so: vec![0; so.len()],
            sampled_so: vec![0; so.len()],
            par: vec![0; par.len()],
            ..Self::default()
        }
    }
}

impl Application for MemoryApplication {
    fn start(&mut self, now_us: u64) {
        self.started_us = Some(now_us);
        self.par.fill(0);
    }

    fn stop(&mut self) {
        self.started_us = None;
        self.running = false;
        self.active = false;
    }

    fn is_up(&mut self, now_us: u64) -> bool {
        self.started_us.is_some_and(|start| now_us >= start + self.start_us)
    }

    fn dimensions(&self) -> Dimensions {
        let len = |words: &Vec<u16>| u16::try_from(words.len()).unwrap_or(u16::MAX);
        Dimensions { ci: len(&self.ci), so: len(&self.so), par: len(&self.par) }
    }

    fn text(&self, text: Text) -> &[u8] {
        self.texts.get(text)
    }

    fn initial_ci(&self, index: u16) -> u16 {
        self.initial_ci.get(usize::from(index)).copied().unwrap_or(0)
    }

    fn ci(&mut self) -> &mut [u16] {
        &mut self.ci
    }

    fn latch_ci(&mut self) {
        self.latched_ci.clone_from(&self.ci);
    }

    fn par(&mut self) -> &mut [u16] {
        &mut self.par
    }

    fn sample_so(&mut self) {
        self.sampled_so.clone_from(&self.so);
    }

    // In the trait `Application`, `so` returns the outputs of the last snapshot, not the present outputs.
    #[allow(clippy::misnamed_getters)]
    fn so(&self) -> &[u16] {
        &self.sampled_so
    }

    fn run(&mut self, _: u64, running: bool) {
        self.running = running;
    }

    fn step(&mut self, _: u64) {
        self.steps += 1;
    }

    fn outputs(&mut self, active: bool) {
        self.active = active;
    }

    fn debug_text(&self) -> Option<&[u8]> {
        self.debug.first().map(Vec::as_slice)
    }

    fn debug_done(&mut self) {
        if !self.debug.is_empty() {
            self.debug.remove(0);
        }
    }
}
