#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod board;
mod chip;
pub mod clock;
mod code;
mod cpu;
pub mod dma;
mod elf;
mod exception;
mod exti;
pub mod fdcan;
pub mod flash;
mod gpio;
mod iwdg;
mod machine;
mod memory;
mod nvic;
pub mod observe;
mod plain;
mod rcc;
mod scs;
mod timer;
mod usart;
mod watch;

pub use board::{Board, BoardConfig, Port};
pub use chip::{Access, Chip};
pub use elf::{Elf, ElfError, Symbol};
pub use gpio::{Gpio, Pin, PinChange};
pub use jtc_sim::{FaultKind, SimConfig};
pub use machine::Machine;
pub use nvic::{FIRST_LINE, LINES};
pub use observe::ResetCause;
pub use rcc::Clocks;
pub use unicorn_engine::RegisterARM;
pub use usart::{Usart, WireByte};
pub use watch::Counter;
