//! Firmware images of the controller's boards: what a file holds, how it gets onto a board by the drive of its ST-LINK, and how the
//! program that runs there proves that it is that file (J-67).
//!
//! The debugger on a Nucleo board shows a *drive* on USB. A binary file that is copied there is written to the flash of the
//! processor from its first byte on, and the processor is reset. The drive is no real memory: it shows two small files about itself, and
//! `FAIL.TXT` when it could not do it. That it shows none is no proof: where the bytes arrive in another order than it expects, parts of the
//! flash stay empty and nothing is reported. So what is in flash is asked of the controller itself, over its serial line.
//!
//! The order of a flash is [`Image`], [`Drive`], [`Lines::look`] (does the board hold an arm?), [`may_flash`], [`put`], [`prove`]. Where a
//! person is asked in between, [`Places::still_there`], [`Lines::look`] and [`may_flash`] come once more, directly before [`put`].

mod before;
mod catalogue;
mod diagnosis;
mod drive;
mod elf;
mod error;
mod image;
mod lines;
mod mounts;
mod proof;
mod put;

pub use before::{Answers, Asked, Before, Permissions, look, may_flash};
pub use catalogue::{Catalogue, CatalogueImage};
pub use drive::{Drive, Fit, UsbDevice};
pub use error::FirmwareError;
pub use image::{FLASH, Image, Record};
pub use lines::{Lines, OpenLine};
pub use mounts::Places;
pub use proof::{DriveAfter, Limits, OpenPort, Proof, compare, info_with_program, prove, wait_for_drive};
pub use put::{Written, put};

#[cfg(test)]
mod fake;
#[cfg(test)]
mod tests;
