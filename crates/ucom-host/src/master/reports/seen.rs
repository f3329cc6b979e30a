//! Answer of a board.
use ucom::BoardInfo;

/// Answer of a board to PC_INFO.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardSeen {
    /// Board number.
    pub number: u8,
    /// Values of the first frame.
    pub info: BoardInfo,
    /// Description; `None` if it was not received completely.
    pub description: Option<String>,
}
