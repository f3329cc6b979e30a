//! Address map of the peripherals.
use crate::plain::Plain;
use crate::rcc::Gate;

pub const FLASH: u32 = 0x5200_2000;
pub const FLASH_END: u32 = 0x5200_2400;
pub const RCC: u32 = 0x5802_4400;
pub const RCC_END: u32 = 0x5802_4800;
pub const PWR: u32 = 0x5802_4800;
pub const IWDG1: u32 = 0x5800_4800;
pub const IWDG1_END: u32 = 0x5800_4C00;
pub const EXTI: u32 = 0x5800_0000;
pub const EXTI_END: u32 = 0x5800_0400;
/// Addresses of the registers SYSCFG_EXTICR1..4.
pub const EXTICR: u32 = 0x5800_0408;
pub const EXTICR_END: u32 = 0x5800_0418;
/// Registers of the protection unit.
pub const MPU: core::ops::Range<u32> = 0xE000_ED90..0xE000_EDC0;
const HSEM: u32 = 0x5802_6400;

/// Register of a peripheral that the emulator models and that has its own clock enable bit.
pub enum Place {
    Timer(usize, u32),
    Usart(usize, u32),
    Dma(usize, u32),
    Mux(u32),
    Gpio(usize, u32),
    Fdcan(u32),
    MessageRam(u32),
}

pub fn place(address: u32) -> Option<(Gate, Place)> {
    let block = address & !0x3FF;
    let offset = address & 0x3FF;
    Some(match block {
        0x4000_0000..=0x4000_1400 => {
            let n = ((block - 0x4000_0000) >> 10) as usize;
            (Gate::Timer(n as u32 + 2), Place::Timer(n, offset))
        }
        0x4000_4400 | 0x4000_4800 => {
            let n = ((block - 0x4000_4400) >> 10) as usize;
            (Gate::Usart(n as u32 + 2), Place::Usart(n, offset))
        }
        0x4000_A000 => (Gate::Fdcan, Place::Fdcan(offset)),
        0x4000_AC00..0x4000_D400 => (Gate::Fdcan, Place::MessageRam(address - 0x4000_AC00)),
        0x4002_0000 | 0x4002_0400 => {
            let n = ((block - 0x4002_0000) >> 10) as usize;
            (Gate::Dma(n as u32), Place::Dma(n, offset))
        }
        0x4002_0800 => (Gate::Dma(0), Place::Mux(offset)),
        0x5802_0000..0x5802_2C00 => {
            let n = (block - 0x5802_0000) >> 10;
            (Gate::Gpio(n), Place::Gpio(n as usize, offset))
        }
        _ => return None,
    })
}

/// Returns `true` for blocks of registers that are plain memory for the firmware: CRS, SYSCFG (except EXTICR1..4),
/// RTC, PWR, HSEM, DBGMCU.
pub fn is_plain(address: u32) -> bool {
    matches!(
        address & !0x3FF,
        0x4000_8400 | 0x5800_0400 | 0x5800_4000 | PWR | HSEM | 0x5C00_1000 | 0x4000_A800
    )
}

/// Returns the bits that read as "ready" in blocks of registers that are otherwise plain memory.
pub fn ready_bits(address: u32, plain: &Plain) -> u32 {
    let vos = plain.read(PWR + 0x18) & 0xC000;
    match address {
        // The registers in this list are CSR1 (ACTVOSRDY and the active voltage scale), CR3 (SDEXTRDY), D3CR (VOSRDY)
        // and CCCSR (ready bit).
        0x5802_4804 => 1 << 13 | vos,
        0x5802_480C => 1 << 16,
        0x5802_4818 => 1 << 13,
        0x5800_0420 => 1 << 8,
        // Every register HSEM_RLR reads as "locked by core 1" (ID 3), so every read-lock succeeds.
        0x5802_6480..0x5802_6500 => 0x8000_0300,
        _ => 0,
    }
}
