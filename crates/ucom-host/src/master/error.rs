//! Errors of procedures, with the facts, the kind of failure and the command that the user should run next. Each operation has its own
//! small error type. A procedure can return any of these errors.
mod address;
mod exchange;
mod identity;
mod master;
mod plan;
mod procedure;
mod running;
mod signal;
mod status;
mod words;

pub use address::AddressError;
pub use exchange::{ExchangeError, Incomplete, LastReceived, Received};
pub use identity::IdentityError;
pub(crate) use identity::{SHARED_CAUSE, shared_remedy};
pub use master::MasterError;
pub use plan::{PlanError, SecondImageError, TargetError};
pub use procedure::Error;
pub(crate) use procedure::of_one;
pub use running::RunningError;
pub use signal::SignalError;
pub use status::StatusError;
pub(crate) use words::{MEASURE_ORDER, other_order};
