//! Modbus TCP server, through which a PLC accesses the arm as a map of registers.
//!
//! [`pdu`] contains the protocol and [`map`] the registers. [`handshake`] turns register writes into commands, and each
//! command is executed once. [`plc`] decides which of several connections may command. `act` executes the commands with
//! the same jobs as the API. [`server`] manages the connections. Modbus has no tokens, so [`allow`] lists the addresses
//! that may connect.
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

/// Returns a random first sequence number for a new agent. A PLC that repeats old writes is then unlikely to send the
/// next valid number.
///
/// # Errors
///
/// The system has no random numbers.
pub fn first_sequence() -> Result<u16, TokenError> {
    let mut bytes = [0; 2];
    getrandom::fill(&mut bytes).map_err(TokenError::Random)?;
    Ok(u16::from_be_bytes(bytes))
}
