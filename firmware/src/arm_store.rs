//! The stored arm (J-54) is an image of bytes that survives a loss of power. A host can request operations on this
//! image.
//!
//! At program start, [`load`] finds the newest complete image and copies the image into memory, before the first tick.
//! When a host requests a store, the tick passes an image to [`begin`] and reads the result with [`progress`]. The loop
//! that serves the serial lines stores the image, one small step per pass ([`Store::step`]). No code waits for the
//! flash, and storing delays interrupts by at most a few instructions.
//!
//! `jtc_core::slots` defines the contents of the slots and the order of the steps; [`bank2`] operates the flash itself.
use core::cell::Cell;
use core::sync::atomic::{AtomicU32, Ordering};

use critical_section::Mutex;
use embassy_time::{Duration, Instant};
use jtc_core::slots::{Action, Header, IMAGE_MAX, Slots, Storing, WORD, Word};

use crate::bank2;

/// Memory for one image of an arm.
pub type Buffer = [u8; IMAGE_MAX];

/// Time limits with a margin. According to the data sheet, a sector takes at most 4 s to erase, and a word at most
/// 0.5 ms to program.
const ERASE_MAX: Duration = Duration::from_secs(8);
const PROGRAM_MAX: Duration = Duration::from_millis(50);

/// Mailbox through which the tick and the link loop exchange images. The order of its words is fixed, so that a
/// debugger can read the mailbox.
#[repr(C)]
pub struct Mailbox {
    /// State of the store: [`Mailbox::IDLE`] or another constant of this type.
    state: AtomicU32,
    /// Number of bytes of the image to be stored.
    length: AtomicU32,
    /// Sequence number of the last stored image.
    sequence: AtomicU32,
    /// Code of the last [`Failure`].
    failure: AtomicU32,
    /// Address of the buffer with the image to be stored.
    staging: AtomicU32,
    /// Image that was found at program start, as address (0 if none), number of bytes and sequence number.
    loaded: [AtomicU32; 3],
}

impl Mailbox {
    const IDLE: u32 = 0;
    const ASKED: u32 = 1;
    const BUSY: u32 = 2;
    const DONE: u32 = 3;
    const FAILED: u32 = 4;
}

/// The only mailbox of the program.
#[unsafe(no_mangle)]
#[used]
pub static ARM_STORE: Mailbox = Mailbox {
    state: AtomicU32::new(Mailbox::IDLE),
    length: AtomicU32::new(0),
    sequence: AtomicU32::new(0),
    failure: AtomicU32::new(0),
    staging: AtomicU32::new(0),
    loaded: [const { AtomicU32::new(0) }; 3],
};

/// Buffer for an image to be stored; `None` while another part of the program has taken the buffer out and owns it.
static STAGING: Mutex<Cell<Option<&'static mut Buffer>>> = Mutex::new(Cell::new(None));
/// Image that was found in flash at program start.
static LOADED: Mutex<Cell<Option<Loaded>>> = Mutex::new(Cell::new(None));

/// Image that was found in flash at program start.
#[derive(Clone, Copy)]
pub struct Loaded {
    /// Bytes of the image.
    pub image: &'static [u8],
    /// Sequence number of the image.
    pub sequence: u32,
}

/// Reason why an image is not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// The previous image is not stored yet.
    Busy,
    /// The image has more than [`IMAGE_MAX`] bytes.
    TooLong,
}

/// Progress of storing the newest image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// No image has been passed to [`begin`] since program start.
    Idle,
    /// The image is being stored.
    Busy,
    /// The image is stored, and every later program start finds it.
    Done {
        /// Sequence number of the image.
        sequence: u32,
    },
    /// The image could not be stored. The flash still contains the previous image.
    Failed(Failure),
}

/// Reason why an image could not be stored. The log contains the error flags of the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
#[repr(u8)]
pub enum Failure {
    /// The flash cannot be unlocked until the next reset.
    Locked = 1,
    /// The flash reported an error during erasing.
    Erase = 2,
    /// The flash reported an error during programming.
    Program = 3,
    /// The data that were read back differ from the programmed data, because the sector is worn out.
    Verify = 4,
    /// The flash did not become ready in time.
    Timeout = 5,
}

/// Accepts an image to be stored. The tick calls this function, which copies the bytes and returns at once.
pub fn begin(image: &[u8]) -> Result<(), Refused> {
    if matches!(ARM_STORE.state.load(Ordering::Acquire), Mailbox::ASKED | Mailbox::BUSY) {
        return Err(Refused::Busy);
    }
    let buffer = critical_section::with(|cs| STAGING.borrow(cs).take()).ok_or(Refused::Busy)?;
    let place = buffer.get_mut(..image.len());
    let fits = place.map(|place| place.copy_from_slice(image));
    critical_section::with(|cs| STAGING.borrow(cs).set(Some(buffer)));
    fits.ok_or(Refused::TooLong)?;
    ARM_STORE.length.store(image.len() as u32, Ordering::Relaxed);
    ARM_STORE.state.store(Mailbox::ASKED, Ordering::Release);
    Ok(())
}

/// Returns the progress of storing the newest image.
pub fn progress() -> Progress {
    match ARM_STORE.state.load(Ordering::Acquire) {
        Mailbox::ASKED | Mailbox::BUSY => Progress::Busy,
        Mailbox::DONE => Progress::Done { sequence: ARM_STORE.sequence.load(Ordering::Relaxed) },
        Mailbox::FAILED => Progress::Failed(match ARM_STORE.failure.load(Ordering::Relaxed) {
            1 => Failure::Locked,
            2 => Failure::Erase,
            3 => Failure::Program,
            4 => Failure::Verify,
            _ => Failure::Timeout,
        }),
        _ => Progress::Idle,
    }
}

/// Returns the image that was found at program start. The image does not change until the next program start.
pub fn loaded() -> Option<Loaded> {
    critical_section::with(|cs| LOADED.borrow(cs).get())
}

/// Reads a slot and returns its header if the image in the slot is complete.
fn read(slot: usize, buffer: &mut Buffer) -> Option<Header> {
    let first = bank2::read(slot, 0);
    if first == Some([0xFF; WORD]) {
        return None;
    }
    let header = first.and_then(|word| Header::parse(&word)).filter(|header| {
        let (words, _) = buffer.as_chunks_mut::<WORD>();
        let rest = words.iter_mut().take(header.words() - 1).enumerate();
        let mut readable = rest.map(|(n, word)| bank2::read(slot, n + 1).map(|bytes| *word = bytes));
        readable.all(|word| word.is_some()) && header.accepts(buffer).is_some()
    });
    if header.is_none() {
        defmt::warn!("arm slot {=usize} is not whole", slot);
    }
    header
}

/// Finds the stored image. This function must be called once, before the first tick and before the watchdog starts.
pub fn load(buffers: [&'static mut Buffer; 2]) -> Store {
    let [first, second] = buffers;
    let headers = [read(0, first), read(1, second)];
    let slots = Slots::new(headers.map(|header| header.map(|header| header.sequence())));
    let current = slots.current();
    let (used, staging) =
        if current.is_some_and(|(slot, _)| slot == 1) { (second, first) } else { (first, second) };
    ARM_STORE.staging.store(staging.as_ptr() as u32, Ordering::Relaxed);
    critical_section::with(|cs| STAGING.borrow(cs).set(Some(staging)));
    let used: &'static Buffer = used;
    let header = current.and_then(|(slot, _)| headers.get(slot).copied().flatten());
    if let Some((header, image)) = header.and_then(|header| Some((header, used.get(..header.length())?))) {
        let sequence = header.sequence();
        defmt::info!("stored arm: {=usize} bytes, sequence number {=u32}", image.len(), sequence);
        let facts = [image.as_ptr() as u32, image.len() as u32, sequence];
        ARM_STORE.loaded.iter().zip(facts).for_each(|(to, from)| to.store(from, Ordering::Relaxed));
        critical_section::with(|cs| LOADED.borrow(cs).set(Some(Loaded { image, sequence })));
    }
    Store { slots, job: None }
}

/// The part of the store that the link loop executes.
pub struct Store {
    slots: Slots,
    job: Option<Job>,
}

/// An image that is being stored.
struct Job {
    image: &'static mut Buffer,
    length: usize,
    storing: Storing,
    /// Time at which the current operation of the flash began.
    begun: Option<Instant>,
}

impl Store {
    /// Executes one step of storing, if an image is being stored. The step takes a few microseconds.
    pub fn step(&mut self) {
        let Some(job) = &mut self.job else {
            if ARM_STORE.state.load(Ordering::Acquire) == Mailbox::ASKED {
                self.start();
            }
            return;
        };
        match job.step() {
            Ok(false) => {}
            Ok(true) => self.end(Ok(())),
            Err(failure) => self.end(Err(failure)),
        }
    }

    /// Takes the image to be stored out of the mailbox.
    fn start(&mut self) {
        let Some(image) = critical_section::with(|cs| STAGING.borrow(cs).take()) else { return };
        ARM_STORE.state.store(Mailbox::BUSY, Ordering::Relaxed);
        let length = (ARM_STORE.length.load(Ordering::Relaxed) as usize).min(IMAGE_MAX);
        // `begin` has checked the length, so `Storing::begin` always finds a slot.
        let Some(storing) = Storing::begin(&mut self.slots, &image[..length]) else { return };
        self.job = Some(Job { image, length, storing, begun: None });
        if bank2::busy() {
            self.end(Err(Failure::Timeout));
        } else if !bank2::unlock() {
            self.end(Err(Failure::Locked));
        }
    }

    fn end(&mut self, result: Result<(), Failure>) {
        let Some(Job { image, length, storing, .. }) = self.job.take() else { return };
        let flags = bank2::errors();
        // If flash bank 2 is still busy, this code does not access it, and the memory protection still blocks reads of
        // the bank. The next attempt to store an image checks the bank again.
        if !bank2::busy() {
            bank2::lock();
        }
        let (slot, sequence) = storing.target();
        storing.finish(&mut self.slots);
        critical_section::with(|cs| STAGING.borrow(cs).set(Some(image)));
        let state = match result {
            Ok(()) => {
                defmt::info!("arm stored: {=usize} bytes, sequence number {=u32}", length, sequence);
                ARM_STORE.sequence.store(sequence, Ordering::Relaxed);
                Mailbox::DONE
            }
            Err(failure) => {
                defmt::error!("arm not stored in slot {=usize}: {}, flags {=u32:#x}", slot, failure, flags);
                ARM_STORE.failure.store(failure as u32, Ordering::Relaxed);
                Mailbox::FAILED
            }
        };
        ARM_STORE.state.store(state, Ordering::Release);
    }
}

impl Job {
    /// Returns the next action on the flash.
    fn action(&self) -> Action {
        self.storing.action(self.image.get(..self.length).unwrap_or(&[]))
    }

    /// Checks if the flash has finished its operation, and begins the next action. Returns `true` when the complete
    /// image is stored.
    fn step(&mut self) -> Result<bool, Failure> {
        if let Some(begun) = self.begun {
            let limit = if matches!(self.action(), Action::Erase { .. }) { ERASE_MAX } else { PROGRAM_MAX };
            if bank2::busy() {
                return if begun.elapsed() > limit { Err(Failure::Timeout) } else { Ok(false) };
            }
            bank2::end();
            self.check()?;
            self.storing.done();
            self.begun = None;
        }
        match self.action() {
            Action::Erase { slot } => bank2::erase(slot),
            Action::Program { slot, word, bytes } => bank2::program(slot, word, &bytes),
            Action::Stored => return Ok(true),
        }
        self.begun = Some(Instant::now());
        Ok(false)
    }

    /// Checks that the flash has executed the last action.
    fn check(&self) -> Result<(), Failure> {
        let failed = bank2::errors() != 0;
        match self.action() {
            Action::Erase { .. } if failed => Err(Failure::Erase),
            Action::Program { .. } if failed => Err(Failure::Program),
            Action::Program { slot, word, bytes } => same(bank2::read(slot, word), &bytes),
            Action::Erase { .. } | Action::Stored => Ok(()),
        }
    }
}

fn same(read: Option<Word>, expected: &Word) -> Result<(), Failure> {
    if read.as_ref() == Some(expected) { Ok(()) } else { Err(Failure::Verify) }
}
