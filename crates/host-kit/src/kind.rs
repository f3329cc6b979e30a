//! Kinds of failure, on which a caller can act without knowing each error.

/// Kind of failure of an error or a report, from the least to the most serious.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ErrorKind {
    /// Wrong usage or unreadable input.
    Usage,
    /// Refused by a check: nothing was sent, moved or changed.
    Refused,
    /// The controller or a board reported an error.
    Device,
    /// No port or bus, or no answer.
    NoLink,
    /// An error or a cancellation during the operation.
    Fault,
}
