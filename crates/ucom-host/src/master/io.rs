//! Inputs, outputs and parameters of a board: descriptions, values and snapshots.

pub(crate) mod description;
pub(crate) mod process_data;
pub(crate) mod shadow;
pub(crate) mod snapshot;

pub use description::{DescriptionKey, IoDescription, Kind, short};
pub use shadow::{ParValue, Shadow};
pub use snapshot::{Snapshot, SnapshotAssembler};
