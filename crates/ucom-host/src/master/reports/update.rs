//! Firmware update: options, the blocks to send, and results for each board.
mod failure;
mod options;
mod outcome;
mod plan;
mod report;

pub use failure::UpdateFailure;
pub use options::{UpdateImage, UpdateMode, UpdateOptions, UpdateTarget};
pub use outcome::UpdateOutcome;
pub use plan::{Expected, PlannedImage, Unverifiable, UpdatePlan, has_header};
pub use report::{Progress, UpdateReport, UpdateResult};
