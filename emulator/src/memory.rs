//! The memory map of the STM32H745 and H743 for the Cortex-M7 (RM0399 chapter 2).
use unicorn_engine::unicorn_const::Prot;
use unicorn_engine::{RegisterARM, Unicorn};

use crate::chip::Chip;
use crate::dma::Memory;
use crate::flash::{BANK2, BANK2_SIZE};
use crate::nvic::exception;
use crate::rcc::Gate;

/// Memory that the peripherals access.
pub(crate) struct Ram<'a>(pub Unicorn<'a, Chip>);

impl Memory for Ram<'_> {
    fn read(&mut self, address: u32, bytes: &mut [u8]) -> bool {
        self.0.mem_read(u64::from(address), bytes).is_ok()
    }
    fn write(&mut self, address: u32, bytes: &[u8]) -> bool {
        self.0.mem_write(u64::from(address), bytes).is_ok()
    }
}

/// Start address of flash bank 1; bank 2 starts 1 MiB after it.
pub const FLASH: u32 = 0x0800_0000;

/// Size of flash bank 1.
const FLASH_SIZE: u64 = 0x10_0000;
const SYSTEM: u64 = 0x1FF0_0000;
const SYSTEM_SIZE: u64 = 0x2_0000;
/// Address range of the peripherals of all domains.
const PERIPHERALS: u64 = 0x4000_0000;
const PERIPHERALS_SIZE: u64 = 0x2000_0000;
/// Address range of the private peripherals of the core.
const PRIVATE: u64 = 0xE000_0000;
const PRIVATE_SIZE: u64 = 0x10_0000;

/// RAM that is always accessible: ITCM, DTCM, AXI SRAM, SRAM4, backup SRAM.
const RAM: [(u64, u64); 5] = [
    (0x0000_0000, 0x1_0000),
    (0x2000_0000, 0x2_0000),
    (0x2400_0000, 0x8_0000),
    (0x3800_0000, 0x1_0000),
    (0x3880_0000, 0x1000),
];

/// SRAM1..3 of domain D2, each with its own clock enable.
const D2: [(u64, u64); 3] = [(0x3000_0000, 0x2_0000), (0x3002_0000, 0x2_0000), (0x3004_0000, 0x8000)];

/// Address ranges that are unmapped or read-only, as first and last address.
pub const FORBIDDEN: [(u64, u64); 11] = [
    (0x0001_0000, 0x07FF_FFFF),
    (0x0800_0000, 0x081F_FFFF),
    (0x0820_0000, 0x1FFF_FFFF),
    (0x2002_0000, 0x23FF_FFFF),
    (0x2408_0000, 0x2FFF_FFFF),
    (0x3004_8000, 0x37FF_FFFF),
    (0x3801_0000, 0x387F_FFFF),
    (0x3880_1000, 0x3FFF_FFFF),
    (0x6000_0000, 0xDFFF_FFFF),
    (0xE010_0000, 0xFFFF_FFDF),
    (0xFFFF_FFE0, 0xFFFF_FFFF),
];

/// Returns the access rights of data memory. Code is expected only in ITCM and flash. After every store to memory that
/// may contain code, Unicorn searches for translated code, which makes the store slow. At the first jump to code in
/// other memory, the machine calls [`allow_code`].
fn data() -> Prot {
    Prot::READ | Prot::WRITE
}

/// Permits code in the RAM region that contains an address. Returns `false` if the address is not in RAM, or if code is
/// already permitted.
pub fn allow_code(uc: &mut Unicorn<'static, Chip>, address: u32) -> bool {
    let regions = uc.mem_regions().unwrap_or_default();
    let holds = |begin: u64, end: u64| (begin..=end).contains(&u64::from(address));
    let Some(region) = regions.iter().find(|r| holds(r.begin, r.end) && r.perms == data().0) else {
        return false;
    };
    uc.mem_protect(region.begin, region.end - region.begin + 1, Prot::ALL).is_ok()
}

/// Maps all memory of the chip. RAM is filled with random data generated from `seed`.
pub fn map(uc: &mut Unicorn<'static, Chip>, seed: u64) {
    let mut rng = fastrand::Rng::with_seed(seed ^ 0x7261_6D00);
    for (address, size) in RAM.into_iter().chain(D2) {
        uc.mem_map(address, size, if address == 0 { Prot::ALL } else { data() }).expect("RAM");
        let bytes: Vec<u8> = core::iter::repeat_with(|| rng.u8(..)).take(size as usize).collect();
        uc.mem_write(address, &bytes).expect("RAM");
    }
    uc.mem_map(u64::from(FLASH), FLASH_SIZE, Prot::READ | Prot::EXEC).expect("flash");
    uc.mem_write(u64::from(FLASH), &vec![0xFF; FLASH_SIZE as usize]).expect("flash");
    uc.mem_map(SYSTEM, SYSTEM_SIZE, Prot::READ).expect("system memory");
    map_bank2(uc);
    for (start, size) in [(PERIPHERALS, PERIPHERALS_SIZE), (PRIVATE, PRIVATE_SIZE)] {
        uc.mmio_map(
            start,
            size,
            Some(move |uc: &mut Unicorn<'_, Chip>, offset: u64, size: usize| {
                let mut ram = Ram(uc.clone());
                u64::from(uc.get_data_mut().load((start + offset) as u32, size, &mut ram))
            }),
            Some(move |uc: &mut Unicorn<'_, Chip>, offset: u64, size: usize, value: u64| {
                let mut ram = Ram(uc.clone());
                uc.get_data_mut().store((start + offset) as u32, size, value as u32, &mut ram);
            }),
        )
        .expect("registers");
    }
}

/// Maps flash bank 2 into the address space. The core accesses bank 2 through the flash interface.
fn map_bank2(uc: &mut Unicorn<'static, Chip>) {
    let faults_masked = |uc: &Unicorn<'_, Chip>| {
        let mask = uc.reg_read(RegisterARM::FAULTMASK).unwrap_or(0) & 1 == 1;
        let nvic = &uc.get_data().nvic;
        mask || nvic.is_active(exception::HARD_FAULT) || nvic.is_active(exception::NMI)
    };
    uc.mmio_map(
        u64::from(BANK2),
        u64::from(BANK2_SIZE),
        Some(move |uc: &mut Unicorn<'_, Chip>, offset: u64, size: usize| {
            let masked = faults_masked(uc);
            u64::from(uc.get_data_mut().load_bank2(BANK2 + offset as u32, size, masked))
        }),
        Some(move |uc: &mut Unicorn<'_, Chip>, offset: u64, size: usize, value: u64| {
            let masked = faults_masked(uc);
            uc.get_data_mut().store_bank2(BANK2 + offset as u32, size, value as u32, masked);
        }),
    )
    .expect("bank 2");
}

/// Permits access to the SRAM blocks of domain D2 whose clocks are enabled.
pub fn protect(uc: &mut Unicorn<'static, Chip>) {
    for (n, (address, size)) in D2.into_iter().enumerate() {
        let on = uc.get_data().rcc.enabled(Gate::Sram(n as u32 + 1));
        let _ = uc.mem_protect(address, size, if on { data() } else { Prot::NONE });
    }
}
