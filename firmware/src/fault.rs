//! Handling of a program failure. The safety output becomes 0, the drives get a last frame with zero torque, the module
//! records the cause, and the processor is reset. After a reset, this module also reads the data that the program
//! recorded before the reset.
use core::arch::naked_asm;
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use embassy_stm32::pac;
use openjtc_firmware::flight::Flight;
use openjtc_firmware::reset::{self, Cause, Failure};

use crate::{board, fdcan};

/// Memory whose contents survive a reset. The memory is tightly coupled, so that writes bypass the cache.
#[repr(transparent)]
pub struct Kept<T>(UnsafeCell<MaybeUninit<T>>);

// SAFETY: `boot` creates the only reference. A fault handler writes through a pointer, and no other code runs after the
// handler.
unsafe impl<T: Send> Sync for Kept<T> {}

/// Inputs and outputs of the last tick; [`openjtc_firmware::flight`] defines the layout.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".uninit.FLIGHT")]
#[used]
pub static FLIGHT: Kept<Flight> = Kept(UnsafeCell::new(MaybeUninit::uninit()));

/// Record of the failure that ended the previous program run.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".uninit.LAST_WORDS")]
#[used]
pub static LAST_WORDS: Kept<LastWords> = Kept(UnsafeCell::new(MaybeUninit::uninit()));

/// Number of starts since power-on.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".uninit.BOOTS")]
#[used]
pub static BOOTS: Kept<u32> = Kept(UnsafeCell::new(MaybeUninit::uninit()));

/// Position in the source code or in program memory at which the previous program run failed.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct LastWords {
    /// [`LastWords::HARD_FAULT`] or [`LastWords::PANIC`]; any other value means no failure.
    magic: u32,
    /// Line of the source code at which the program panicked.
    line: u32,
    /// Program counter and return address of a hard fault; 0 if unknown.
    pc: u32,
    lr: u32,
    /// Registers CFSR and HFSR of a hard fault, and the fault address if the processor marks it as valid.
    cfsr: u32,
    hfsr: u32,
    address: u32,
    /// Name of the source file of a panic, truncated at its beginning and padded with zeros.
    file: [u8; 32],
}

impl LastWords {
    const HARD_FAULT: u32 = u32::from_le_bytes(*b"HFLT");
    const PANIC: u32 = u32::from_le_bytes(*b"PANC");
    const NONE: Self = Self { magic: 0, line: 0, pc: 0, lr: 0, cfsr: 0, hfsr: 0, address: 0, file: [0; 32] };

    fn failure(&self) -> Option<Failure> {
        match self.magic {
            Self::HARD_FAULT => Some(Failure::HardFault),
            Self::PANIC => Some(Failure::Panic),
            _ => None,
        }
    }

    fn file(&self) -> &str {
        let end = self.file.iter().position(|byte| *byte == 0).unwrap_or(self.file.len());
        core::str::from_utf8(&self.file[..end]).unwrap_or("?")
    }
}

/// Cause of this program start, and data of the previous program run.
pub struct Boot {
    /// Cause of this program start.
    pub cause: Cause,
    /// Number of this program start, counted since power-on.
    pub boots: u32,
    /// `true` if the power was off before this start.
    pub lost_power: bool,
    /// Record of the failure that ended the previous program run.
    last_words: LastWords,
    /// Last tick of the previous program run: its number, phase and state. `None` if the flight record is not valid.
    last_flight: Option<(u64, u32, u8)>,
    /// Flight record that this program run writes.
    pub flight: &'static mut Flight,
}

/// Reads the data that the previous program run recorded. This function must be called once, as the first call in the
/// program.
pub fn boot() -> Boot {
    let rsr = pac::RCC.rsr().read().0;
    pac::RCC.rsr().modify(|w| w.set_rmvf(true));
    let lost_power = reset::lost_power(rsr);
    // SAFETY: no other reference to these three statics exists yet, and this function is called once. After power-on
    // the contents of the statics are random, with wrong check bits, so this function writes the statics before it
    // reads them. Otherwise the statics contain integers and floats, for which all bit patterns are valid.
    let (words, flight, boots) = unsafe {
        let (words, flight) = (&mut *LAST_WORDS.0.get(), &mut *FLIGHT.0.get());
        let boots = &mut *BOOTS.0.get();
        if lost_power {
            words.write(LastWords::NONE);
            flight.write(Flight::new(0));
            boots.write(0);
        }
        (words.assume_init_mut(), flight.assume_init_mut(), boots.assume_init_mut())
    };
    *boots = boots.saturating_add(1);
    let last_words = core::mem::replace(words, LastWords::NONE);
    let cause = reset::cause(rsr, last_words.failure());
    let last_flight = flight.valid().then_some((flight.tick, flight.phase, flight.state));
    *flight = Flight::new(cause as u32);
    Boot { cause, boots: *boots, lost_power, last_words, last_flight, flight }
}

/// Logs the cause of this program start.
pub fn log(boot: &Boot) {
    let words = &boot.last_words;
    match boot.cause {
        Cause::HardFault => defmt::error!(
            "started after a hard fault at {=u32:#010x}, called from {=u32:#010x}: CFSR {=u32:#x}, HFSR {=u32:#x}, \
             address {=u32:#010x}",
            words.pc,
            words.lr,
            words.cfsr,
            words.hfsr,
            words.address
        ),
        Cause::Panic => {
            defmt::error!("started after a panic in {=str} line {=u32}", words.file(), words.line)
        }
        Cause::Watchdog => defmt::error!("started by the watchdog: a tick did not complete in time"),
        cause => defmt::info!("started by {=str}", cause.name()),
    }
    if let (true, Some((tick, phase, state))) = (boot.cause.failed(), boot.last_flight) {
        let done = if phase == Flight::PHASE_COMPLETE { "completed" } else { "did not complete" };
        defmt::error!("its last tick, {=u64}, in state {=u8}, {=str}", tick, state, done);
    }
}

/// Drives the safety output to 0, writes the failure record, and resets the processor. Before the reset, the function
/// sends zero torque to the drives if the joint bus still works. Interrupts stay disabled.
fn end(words: LastWords) -> ! {
    cortex_m::interrupt::disable();
    board::safety_output_low();
    // SAFETY: no other code runs any more.
    unsafe { LAST_WORDS.0.get().write(MaybeUninit::new(words)) };
    fdcan::last_frame();
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    let mut words = LastWords { magic: LastWords::PANIC, ..LastWords::NONE };
    if let Some(place) = info.location() {
        words.line = place.line();
        // If the file name is too long, the record contains the end of the name, because the end is the most useful
        // part.
        let name = place.file().as_bytes();
        let name = &name[name.len().saturating_sub(words.file.len())..];
        for (to, from) in words.file.iter_mut().zip(name) {
            *to = *from;
        }
    }
    end(words)
}

/// Handles every unexpected interrupt, including the non-maskable interrupt.
///
/// # Safety
/// Only the processor may call this handler.
#[cortex_m_rt::exception]
unsafe fn DefaultHandler(number: i16) {
    let mut words =
        LastWords { magic: LastWords::PANIC, line: number.cast_unsigned().into(), ..LastWords::NONE };
    for (to, from) in words.file.iter_mut().zip(b"unexpected interrupt") {
        *to = *from;
    }
    end(words)
}

/// Entry of the hard fault, to which all other faults are escalated. The stack may be the cause of the failure, so this
/// function resets the stack pointer. The function passes the address of the old stack to `hard_fault_with_stack`.
#[unsafe(naked)]
#[unsafe(export_name = "HardFault")]
unsafe extern "C" fn hard_fault() -> ! {
    naked_asm!(
        "mrs r0, msp",
        "ldr r1, =_stack_start",
        "mov sp, r1",
        "b {handler}",
        handler = sym hard_fault_with_stack,
    )
}

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

extern "C" fn hard_fault_with_stack(frame: usize) -> ! {
    // Word indices in the stack frame that the processor pushed. The frame contains r0..r3, r12, lr, pc and xpsr.
    const LR: usize = 5;
    const PC: usize = 6;
    let (bottom, top) = (&raw const _stack_end as usize, &raw const _stack_start as usize);
    let word = |n: usize| {
        let at = frame + 4 * n;
        if at < bottom || at + 4 > top || !at.is_multiple_of(4) {
            return 0;
        }
        // SAFETY: the address is within the stack and aligned. If the old stack was nearly empty, the new stack may
        // have overwritten the old stack frame. The value read is then wrong, but harmless.
        unsafe { (at as *const u32).read_volatile() }
    };
    let (pc, lr) = (word(PC), word(LR));
    // SAFETY: the registers are only read.
    let scb = unsafe { &*SCB::PTR };
    let cfsr = scb.cfsr.read();
    const MEMORY_ADDRESS: u32 = 1 << 7;
    const BUS_ADDRESS: u32 = 1 << 15;
    let address = match cfsr {
        _ if cfsr & MEMORY_ADDRESS != 0 => scb.mmfar.read(),
        _ if cfsr & BUS_ADDRESS != 0 => scb.bfar.read(),
        _ => 0,
    };
    end(LastWords {
        magic: LastWords::HARD_FAULT,
        pc,
        lr,
        cfsr,
        hfsr: scb.hfsr.read(),
        address,
        ..LastWords::NONE
    })
}
