//! Modbus TCP for a PLC: the arm as a map of registers.
//!
//! [`pdu`] has the protocol, [`map`] the registers, [`handshake`] what makes a command of them, once; [`plc`] decides who of several commands,
//! `act` does it with the same jobs that the API has, and [`server`] has the connections. Modbus knows no tokens: [`allow`] names who may
//! connect.
mod act;
pub mod allow;
pub mod codes;
#[cfg(any(test, feature = "fuzzing"))]
#[doc(hidden)]
pub mod fuzzing;
pub mod handshake;
pub mod map;
mod page;
pub mod pdu;
pub mod plc;
pub mod server;

pub use allow::{Allowed, Network};
pub use page::tables;
pub use plc::Plc;
pub use server::Server;

use crate::access::TokenError;

/// A number that a fresh agent's commands are counted from: nobody who goes on writing what was written before knows the one behind it.
///
/// # Errors
///
/// The system has no random numbers.
pub fn first_sequence() -> Result<u16, TokenError> {
    let mut bytes = [0; 2];
    getrandom::fill(&mut bytes).map_err(TokenError::Random)?;
    Ok(u16::from_be_bytes(bytes))
}
