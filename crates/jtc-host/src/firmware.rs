//! Firmware images of the controller's boards: reading a file, writing it to a board through the drive of the ST-LINK, and
//! verifying that the board runs it (J-67).
//!
//! The debugger on a Nucleo board presents a *drive* on USB. If a binary file is copied to the drive, the ST-LINK writes it
//! to the flash of the processor, beginning at the first byte, and then resets the processor. The drive is not a real
//! memory. The drive contains two small files about itself, and `FAIL.TXT` after a failure. A missing `FAIL.TXT` does not
//! prove success: if the bytes arrive in an unexpected order, parts of the flash stay empty without a report. So the
//! controller itself must report the content of its flash over its serial line.
//!
//! A flash uses, in this order: [`Image`], [`Drive`], [`Lines::look`] (does the board hold an arm?), [`may_flash`], [`write_image`],
//! [`verify_program`]. If the operator is asked in between, [`Places::still_there`], [`Lines::look`] and [`may_flash`] are repeated
//! directly before [`write_image`].

mod catalogue;
mod diagnosis;
mod drive;
mod elf;
mod error;
mod image;
mod lines;
mod mounts;
mod preflight;
mod verify;
mod write;

pub use catalogue::{Catalogue, CatalogueImage};
pub use drive::{Drive, Fit, UsbDevice};
pub use error::FirmwareError;
pub use image::{FLASH, Image, Record};
pub use lines::{Lines, OpenLine};
pub use mounts::Places;
pub use preflight::{Answers, Asked, Permissions, Preflight, look, may_flash};
pub use verify::{
    DriveAfter, Limits, OpenPort, Verification, compare, info_with_program, verify_program, wait_for_drive,
};
pub use write::{Written, write_image};

#[cfg(test)]
mod fake;
#[cfg(test)]
mod tests;
