//! Modbus TCP server, through which a PLC accesses the arm as a map of registers.
//!
//! [`pdu`] contains the protocol, and [`map`] contains the registers. [`handshake`] converts register writes to
//! commands, and each command is executed once. [`plc`] decides which of several PLC connections may send commands.
//! `act` executes the commands with the same jobs as the API of the agent. [`server`] manages the connections of PLCs.
//! Modbus has no tokens, so [`allow`] lists the addresses that may connect.
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

/// Returns a random first sequence number for a new agent. If a PLC repeats writes of an earlier run, these writes
/// are therefore unlikely to contain the next valid sequence number.
///
/// # Errors
///
/// The operating system provides no random numbers.
pub fn first_sequence() -> Result<u16, TokenError> {
    let mut bytes = [0; 2];
    getrandom::fill(&mut bytes).map_err(TokenError::Random)?;
    Ok(u16::from_be_bytes(bytes))
}
