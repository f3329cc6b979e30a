#![doc = include_str!("../README.md")]
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
#[macro_use]
extern crate std;

mod admin;
mod buffer;
#[cfg(feature = "embedded-can")]
mod can;
mod error_code;
mod foreign;
mod frame;
mod function;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
mod header;
mod info;
mod message;
mod program;
mod report;
mod status;
mod string;

pub mod node;
pub mod profile;

pub use admin::Admin;
pub use buffer::{BeyondBuffer, BufferPackage, Packages, package_count};
pub use error_code::ErrorCode;
pub use foreign::Foreign;
pub use frame::{Format, Frame, Payload};
pub use function::{Function, Sender, Sequence};
pub use header::{BLOCK_LEN, Header, HeaderError, Memory};
pub use info::{BoardInfo, Dimensions};
pub use message::{DecodeError, FromBoard, ToBoard};
pub use profile::{Endian, Profile};
pub use program::{Checksum, DateForm, Digest, block_count, checksum, data_block};
pub use report::Report;
pub use status::Status;
pub use string::{Assembled, Latin1, StringAssembler, StringPackages, string_package};
