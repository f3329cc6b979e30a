//! This library contains the parts of the firmware that do not depend on hardware. These parts are clock arithmetic,
//! the memory layout of the CAN controller, the statuses for two serial lines, the causes of a reset, and the records
//! that tools read.
//!
//! The program itself is in `main.rs` and its modules, and is built only for the board. This library is also built for
//! the PC, and tested on the PC with `cargo test --target x86_64-unknown-linux-gnu`.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

pub mod clock;
pub mod flight;
pub mod lines;
pub mod message_ram;
pub mod reset;
pub mod version;

/// Name of the board for which the firmware is built, spelled as its feature.
pub const BOARD: &str = match (
    cfg!(feature = "nucleo-h745zi-q"),
    cfg!(feature = "nucleo-h745zi-q-ldo"),
    cfg!(feature = "nucleo-h743zi2"),
) {
    (true, false, false) => "nucleo-h745zi-q",
    (false, true, false) => "nucleo-h745zi-q-ldo",
    (false, false, true) => "nucleo-h743zi2",
    _ => panic!(
        "exactly one board is needed: --no-default-features --features nucleo-h745zi-q, nucleo-h745zi-q-ldo or \
         nucleo-h743zi2"
    ),
};

/// Rate of both serial lines, Bd; set by `OPENJTC_BAUD` at build time.
pub const BAUD: u32 = match u32::from_str_radix(env!("OPENJTC_BAUD"), 10) {
    Ok(baud) => baud,
    Err(_) => panic!("the build script checks it"),
};
