//! A board as it was seen.
use ucom::BoardInfo;

/// A board as it answered PC_INFO.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoardSeen {
    /// Board number.
    pub number: u8,
    /// The numbers.
    pub info: BoardInfo,
    /// Description; `None`: it never came whole.
    pub description: Option<String>,
}
