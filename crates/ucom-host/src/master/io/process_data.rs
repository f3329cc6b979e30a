//! What is known of the buffers of a board.

use crate::master::io::description::DescriptionKey;
use crate::master::io::shadow::Shadow;
use crate::master::io::snapshot::SnapshotAssembler;

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
