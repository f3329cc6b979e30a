//! What there is to know of an error beside its words.
use host_kit::ErrorKind;

/// What kind of failure it is, a short name for programs, the likely cause with the next command or act that helps.
pub(crate) type Facts = (ErrorKind, &'static str, String);
