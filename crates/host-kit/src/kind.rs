//! Kinds of failure, so that a caller can react without knowing each error.

/// Kind of failure of an error or a report, from the least to the most serious.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ErrorKind {
    /// Wrong usage or unreadable input.
    Usage,
    /// Refused by a check: nothing was sent, moved or changed.
    Refused,
    /// The controller or a board reported an error.
    Device,
    /// Port or bus not available, or no answer.
    NoLink,
    /// An error or a cancellation during the operation.
    Fault,
}
