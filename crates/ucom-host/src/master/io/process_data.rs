//! Known contents of a board's buffers.

use std::collections::BTreeSet;

use crate::master::io::description::DescriptionKey;
use crate::master::io::shadow::Shadow;
use crate::master::io::snapshot::SnapshotAssembler;

/// Process data of a board.
#[derive(Clone, Debug, Default)]
pub(crate) struct ProcessData {
    /// Key of the board's description.
    pub description: Option<DescriptionKey>,
    /// `true` if the board has sent the description with this key since its application started.
    pub sent: bool,
    /// Values of the controller inputs that were set last.
    pub ci: Vec<u16>,
    /// Indices, in `ci`, of the inputs that were set or read since the application started. The values of the other inputs are not known.
    pub ci_known: BTreeSet<u16>,
    /// Time at which the inputs are repeated next; `None` if the inputs are not repeated.
    pub repeat: Option<u64>,
    pub par: Shadow,
    pub so: SnapshotAssembler,
    /// `true` if the caller requested snapshots of the sensor outputs.
    pub watched: bool,
}

impl ProcessData {
    /// Stores the values of all inputs of the board.
    pub(crate) fn know_inputs(&mut self, ci: Vec<u16>) {
        self.ci_known = (0..).zip(&ci).map(|(place, _)| place).collect();
        self.ci = ci;
    }

    /// Returns the inputs that were set or read last; `None` for inputs that are not known.
    pub(crate) fn inputs(&self) -> Vec<Option<u16>> {
        (0..)
            .zip(&self.ci)
            .map(|(place, word)| Some(*word).filter(|_| self.ci_known.contains(&place)))
            .collect()
    }
}
