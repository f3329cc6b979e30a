//! Memory of the firmware: protection, caches, and the large buffers outside the fast memory.
use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use cortex_m::Peripherals;
use cortex_m::peripheral::MPU;
use embassy_stm32::pac;
use jtc_core::POINTS_MAX;
use jtc_core::recorder::Block;
use jtc_wire::{ANSWER_MAX, EventBatch, FRAME_MAX, RawPoint};

use crate::arm_store;
use crate::uart::RING;

/// A static value outside of .data and .bss, which is not initialised before [`take`] is called.
#[repr(C, align(32))]
struct Place<T>(UnsafeCell<MaybeUninit<T>>);

// SAFETY: the value is accessed only through one call of either `Place::take` or `Place::keep`.
unsafe impl<T: Send> Sync for Place<T> {}

impl<T> Place<T> {
    const fn new() -> Self {
        Self(UnsafeCell::new(MaybeUninit::uninit()))
    }

    /// Returns the value after setting all of its bytes to zero.
    ///
    /// # Safety
    /// This function must be called once, and zero bytes must be a valid value of `T`.
    #[allow(clippy::mut_from_ref, reason = "the only reference, by the contract")]
    unsafe fn take(&'static self) -> &'static mut T {
        // SAFETY: according to the safety contract of this function, no other reference ever exists.
        let place = unsafe { &mut *self.0.get() };
        *place = MaybeUninit::zeroed();
        // SAFETY: according to the safety contract of this function, zero bytes are a valid value.
        unsafe { place.assume_init_mut() }
    }

    /// Returns the value that the previous program run wrote. After a loss of power, the memory and its check bits
    /// are random, so all bytes of the value are set to zero.
    ///
    /// # Safety
    /// This function must be called once. Any bytes must be a valid value of `T`, and the linker must not put the value
    /// into an initialised section.
    #[allow(clippy::mut_from_ref, reason = "the only reference, by the contract")]
    unsafe fn keep(&'static self, lost_power: bool) -> &'static mut T {
        if lost_power {
            // SAFETY: any bytes are a valid value of `T`, so zero bytes are a valid value.
            return unsafe { self.take() };
        }
        // SAFETY: according to the safety contract of this function, no other reference ever exists. The memory was
        // written since power-on.
        unsafe { (*self.0.get()).assume_init_mut() }
    }
}

/// Number of blocks in each of the three memories of the flight recorder.
const RECORDER_BLOCKS: [usize; 3] = [63, 31, 63];

/// Memory of the flight recorder (J-56): the part of SRAM1 that DMA does not use, SRAM3, and SRAM4. This memory is not
/// cached: written data are in memory before the next instruction and survive any reset. The values are statics with
/// symbols, so the compiler cannot make assumptions about their contents.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".sram1")]
#[used]
static RECORDER_SRAM1: Place<[Block; RECORDER_BLOCKS[0]]> = Place::new();
#[unsafe(no_mangle)]
#[unsafe(link_section = ".sram3")]
#[used]
static RECORDER_SRAM3: Place<[Block; RECORDER_BLOCKS[1]]> = Place::new();
#[unsafe(no_mangle)]
#[unsafe(link_section = ".sram4")]
#[used]
static RECORDER_SRAM4: Place<[Block; RECORDER_BLOCKS[2]]> = Place::new();

/// Memory for the points of the trajectory.
#[unsafe(link_section = ".axisram")]
static POINTS: Place<[RawPoint; POINTS_MAX]> = Place::new();
/// Memory for the frames that the controller executes.
#[unsafe(link_section = ".axisram")]
static BATCH: Place<EventBatch> = Place::new();
/// Memory for the stored arm, and for the next arm to be stored.
#[unsafe(link_section = ".axisram")]
static ARMS: Place<[arm_store::Buffer; 2]> = Place::new();
/// DMA buffers for the bytes that the serial lines receive; not cached.
#[unsafe(link_section = ".sram1")]
static RINGS: Place<[[u8; RING]; 2]> = Place::new();
/// DMA buffers for the statuses that the serial lines send; not cached.
#[unsafe(link_section = ".sram1")]
static STATUSES: Place<[[u8; ANSWER_MAX]; 2]> = Place::new();
/// Buffers in which frames are assembled, one for each line.
#[unsafe(link_section = ".sram2")]
static RECEIVE: Place<[[u8; FRAME_MAX]; 2]> = Place::new();

/// The large buffers of the firmware.
pub struct Memory {
    /// Memory for the points of the trajectory.
    pub points: &'static mut [RawPoint],
    /// DMA rings of the serial lines.
    pub rings: [&'static mut [u8; RING]; 2],
    /// DMA buffers of the serial lines for transmission.
    pub statuses: [&'static mut [u8; ANSWER_MAX]; 2],
    /// Receive buffers of the serial lines.
    pub receive: [&'static mut [u8; FRAME_MAX]; 2],
    /// Slot through which the links and the tick exchange events.
    pub batch: &'static mut EventBatch,
    /// Buffers for the stored arm and for the next arm to be stored.
    pub arms: [&'static mut arm_store::Buffer; 2],
    /// Memory of the flight recorder, including the records of the previous program run.
    pub recorder: [&'static mut [Block]; 3],
}

/// Returns the large buffers, filled with zeros. The memory of the flight recorder is filled with zeros only if the
/// device has `lost_power`. This function must be called once, after [`init`].
pub fn take(lost_power: bool) -> Memory {
    // SAFETY: `main` calls this function once. Zero bytes are a valid value of arrays of integers and of `EventBatch`,
    // which consists of integers.
    let (points, rings, statuses, receive, batch, arms) =
        unsafe { (POINTS.take(), RINGS.take(), STATUSES.take(), RECEIVE.take(), BATCH.take(), ARMS.take()) };
    // SAFETY: `main` calls this function once. All three memories are in sections that are neither loaded nor cleared,
    // and any bytes are valid integers.
    let recorder: [&mut [Block]; 3] = unsafe {
        [RECORDER_SRAM1.keep(lost_power), RECORDER_SRAM3.keep(lost_power), RECORDER_SRAM4.keep(lost_power)]
    };
    Memory {
        points,
        rings: rings.each_mut(),
        statuses: statuses.each_mut(),
        receive: receive.each_mut(),
        batch,
        arms: arms.each_mut(),
        recorder,
    }
}

/// Regions of the memory protection unit, as base address, log2 of the size, and attributes.
const REGIONS: [(u32, u32, u32); 7] = [
    // Addresses of external memory, which does not exist on the board. Without this region, the core may read these
    // addresses speculatively and hang. The region excludes the lowest three eighths and the highest eighth of the 4
    // GB.
    (0x0000_0000, 32, NO_ACCESS | 0x87 << 8),
    // The instruction memory at address 0 is not used, so that an access through a null pointer causes a fault.
    (0x0000_0000, 16, NO_ACCESS),
    // Memory below the stack is blocked, so that a stack overflow causes a fault at the store that overflows.
    (0x1FFC_0000, 18, NO_ACCESS),
    // Memory that DMA reads and writes; the region is normal memory and not cached.
    (0x3000_0000, 17, FULL_ACCESS | NO_EXECUTE | NORMAL_UNCACHED),
    // Memory that the flight recorder writes.
    (0x3004_0000, 15, FULL_ACCESS | NO_EXECUTE | NORMAL_UNCACHED),
    (0x3800_0000, 16, FULL_ACCESS | NO_EXECUTE | NORMAL_UNCACHED),
    // Flash bank 2 is blocked, because a read of this bank while it is busy would stall the processor. Only [`bank2`]
    // permits accesses to the bank.
    (BANK2, 20, NO_ACCESS),
];
/// Address of flash bank 2.
pub const BANK2: u32 = 0x0810_0000;
/// Region number of flash bank 2 in the memory protection unit.
const BANK2_REGION: u32 = 6;
const NO_ACCESS: u32 = NO_EXECUTE;
const FULL_ACCESS: u32 = 0b011 << 24;
const NO_EXECUTE: u32 = 1 << 28;
/// Attributes TEX 1, C 0, B 0 and shareable.
const NORMAL_UNCACHED: u32 = 1 << 19 | 1 << 18;

/// Enables the memories, the memory protection and the caches.
pub fn init() {
    // The HAL does not enable the clocks of the memories in domain D2, so this code enables them.
    pac::RCC.ahb2enr().modify(|w| {
        w.set_sram1en(true);
        w.set_sram2en(true);
        w.set_sram3en(true);
    });
    // The read of the clock enable register ensures that the clocks of the memories are running.
    pac::RCC.ahb2enr().read();

    // SAFETY: only the HAL has used the peripherals of the core so far, and the HAL does not use these three
    // peripherals.
    let mut core = unsafe { Peripherals::steal() };
    protect(&core.MPU);
    core.SCB.enable_icache();
    core.SCB.enable_dcache(&mut core.CPUID);
}

fn protect(mpu: &MPU) {
    cortex_m::asm::dmb();
    for (number, (base, size, attributes)) in REGIONS.iter().enumerate() {
        // SAFETY: no access of this program violates a region. Only the module `bank2` uses flash bank 2, and permits
        // its accesses before it makes them.
        unsafe {
            mpu.rnr.write(number as u32);
            mpu.rbar.write(*base);
            mpu.rasr.write(attributes | (size - 1) << 1 | 1);
        }
    }
    const ENABLE: u32 = 1 << 0;
    // Bit HFNMIENA of MPU_CTRL. Without this bit, bank 2 would be cached memory for the loads in `bank2`, which run
    // with faults masked.
    const WITH_FAULTS_MASKED: u32 = 1 << 1;
    const DEFAULT_MAP_ELSEWHERE: u32 = 1 << 2;
    // SAFETY: no access of this program violates a region. All other addresses keep the default attributes of the
    // processor.
    unsafe { mpu.ctrl.write(ENABLE | WITH_FAULTS_MASKED | DEFAULT_MAP_ELSEWHERE) };
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// Permits loads and stores in flash bank 2, or blocks them. While accesses are permitted, the bank is strongly ordered
/// memory, which is not cached and never read speculatively. Only the main program may call this function, not an
/// interrupt handler.
pub fn bank2(open: bool) {
    let (_, size, closed) = REGIONS[BANK2_REGION as usize];
    let attributes = if open { FULL_ACCESS | NO_EXECUTE } else { closed };
    // The barrier waits for accesses that began before the change.
    cortex_m::asm::dsb();
    // SAFETY: this program accesses the region only in the module `bank2`, while the region is open. Interrupt handlers
    // use neither the bank nor these registers.
    unsafe {
        (*MPU::PTR).rnr.write(BANK2_REGION);
        (*MPU::PTR).rasr.write(attributes | (size - 1) << 1 | 1);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}
