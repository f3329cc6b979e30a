//! What can go wrong, with the facts, the kind of failure and the command that helps.
mod answer;
mod codes;
mod plan;
mod procedure;
mod words;

pub use answer::{Incomplete, LastReceived, Received};
pub use plan::PlanError;
pub use procedure::Error;
pub(crate) use words::{MEASURE_ORDER, SHARED_CAUSE, other_order};
