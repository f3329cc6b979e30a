//! Kinds of failure. A caller can react to the kind without knowing each error.

/// Kind of failure of an error or a report, ordered from the least to the most serious.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ErrorKind {
    /// Wrong usage or unreadable input.
    Usage,
    /// A check refused the request: nothing was sent, moved or changed.
    Refused,
    /// The controller or a board reported an error.
    Device,
    /// The port or the bus is not available, or no answer was received.
    NoLink,
    /// The operation began, but then failed or was cancelled.
    Fault,
}
