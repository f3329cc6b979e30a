//! Firmware images of the controller's boards: reading a file, writing it to a board through the drive of the ST-LINK, and
//! verifying that the board runs it (J-67).
//!
//! The debugger on a Nucleo board presents a *drive* on USB. If a binary file is copied to the drive, the ST-LINK writes it
//! to the flash of the processor, beginning at the first byte, and then resets the processor. The drive is not a real
//! memory. The drive contains two small files about itself, and `FAIL.TXT` after a failure. A missing `FAIL.TXT` does not
//! prove success: if the bytes arrive in an unexpected order, parts of the flash stay empty without a report. So the
//! controller itself must report the content of its flash over its serial line.
//!
//! A flash uses, in this order: [`Image`], [`Drive`], [`Lines::look`] (does the board hold an arm?), [`may_flash`], [`put`],
//! [`prove`]. If the operator is asked in between, [`Places::still_there`], [`Lines::look`] and [`may_flash`] are repeated
//! directly before [`put`].

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
