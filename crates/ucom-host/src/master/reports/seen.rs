//! A board as seen on the bus.
use ucom::BoardInfo;

/// Answer of a board to PC_INFO.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardSeen {
    /// Board number.
    pub number: u8,
    /// The numbers.
    pub info: BoardInfo,
    /// Description; `None` if it was never complete.
    pub description: Option<String>,
}
