//! Kinds of failure: what a caller can act on without knowing each error.

/// What kind of failure an error or a report is, the less grave first.
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
    /// Something went wrong on the way, or was cancelled there.
    Fault,
}
