//! Answer of a board to PC_INFO.
use ucom::BoardInfo;

/// Answer of a board to PC_INFO.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardSeen {
    /// Board number.
    pub number: u8,
    /// Values in the first frame of the answer.
    pub info: BoardInfo,
    /// Description of the board; `None` if the PC did not receive it completely.
    pub description: Option<String>,
}
