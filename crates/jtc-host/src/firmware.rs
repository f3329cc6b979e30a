//! Firmware images of the controller's boards. These modules read an image file, write the image to a board through the drive of the
//! ST-LINK, and verify that the board runs the image (J-67).
//!
//! The debugger on a Nucleo board presents a *drive* on USB. If a binary file is copied to the drive, the ST-LINK writes the file to the
//! start of the processor's flash and then resets the processor. The drive of an ST-LINK does not store files like a real USB drive. The
//! drive contains two small files about the ST-LINK and its board, and `FAIL.TXT` after a failure. A missing `FAIL.TXT` does not prove
//! success. If the bytes arrive in an unexpected order, parts of the flash stay empty, and the ST-LINK does not report this error.
//! Therefore the controller itself must report the content of its flash over its serial line.
//!
//! A program that flashes a board uses these functions and types in this order: [`Image`], [`Drive`], [`Lines::look`] (checks if the board
//! holds an arm), [`may_flash`], [`write_image`], [`verify_program`]. If the program waits for an answer of the operator, it repeats
//! [`Places::still_there`], [`Lines::look`] and [`may_flash`] directly before [`write_image`].

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
