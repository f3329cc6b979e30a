//! Inputs, outputs and parameters of a board: their descriptions, values and snapshots.

mod description;
mod dump;
mod shadow;
mod snapshot;

pub use description::{DescriptionKey, IoDescription, Kind, short};
pub(crate) use dump::{describe, describe_procedure, initial_inputs_procedure, read_initial_inputs};
pub use shadow::{ParValue, Shadow};
pub use snapshot::{Snapshot, SnapshotAssembler};
/// Process data of a board that is known.
#[derive(Clone, Debug, Default)]
pub(crate) struct ProcessData {
    /// Key of its description.
    pub description: Option<DescriptionKey>,
    /// The board has sent that description itself since its application started.
    pub sent: bool,
    /// Inputs as last set.
    pub ci: Vec<u16>,
    /// When they are sent again; `None`: not at all.
    pub repeat: Option<u64>,
    pub par: Shadow,
    pub so: SnapshotAssembler,
    /// Snapshots are wanted.
    pub watched: bool,
}
