//! UCoM over CAN, for boards and PCs: codec, compatibility profile and the board's state machine, without any I/O.
//!
//! A PC talks to up to 31 motor boards (UCoM, a DSP each) on one classic CAN bus. [`ToBoard`] and [`FromBoard`]
//! are the messages of both directions, made from and into a [`Frame`]; a [`Profile`] says how a board reads
//! what the published description leaves open. [`node`] is the board side, usable in a board's firmware as it
//! is. The PC's side is the crate `ucom-host`, a chain of boards to try things with `ucom-sim`.
//!
//! ```
//! use ucom::{Frame, FromBoard, Profile, Sequence, ToBoard};
//!
//! let profile = Profile::default();
//! let board = Sequence::new(1).unwrap();
//! let ask = ToBoard::Init.encode(board, &profile);
//! assert_eq!(ask, "281#".parse::<Frame>().unwrap());
//!
//! let answer: Frame = "0C1#01".parse().unwrap();
//! assert_eq!(FromBoard::decode(&answer, &profile), Ok((board, FromBoard::InitAck(1))));
//! ```
//!
//! The published description of the protocol is incomplete. Wherever it is, this crate takes a decision that
//! has a number (D-01 and so on) and a key in the profile; `docs/protocol-ucom.md` lists them all.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
#[macro_use]
extern crate std;

mod admin;
mod buffer;
mod error_code;
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
pub use frame::{Foreign, Format, Frame, Payload};
pub use function::{Function, Sender, Sequence};
pub use header::{BLOCK_LEN, Header, HeaderError, Memory};
pub use info::{BoardInfo, Dimensions};
pub use message::{DecodeError, FromBoard, ToBoard};
pub use profile::{Endian, Profile};
pub use program::{Checksum, DateForm, Digest, block_count, checksum, data_block};
pub use report::Report;
pub use status::Status;
pub use string::{Assembled, Latin1, StringAssembler, StringPackages, string_package};
