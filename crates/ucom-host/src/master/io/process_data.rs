//! Buffers of a board, as far as they are known.

use std::collections::BTreeSet;

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
    /// Places of them that were set or read since its application started; others are not known.
    pub ci_known: BTreeSet<u16>,
    /// Time of the next repetition; `None`: no repetition.
    pub repeat: Option<u64>,
    pub par: Shadow,
    pub so: SnapshotAssembler,
    /// Snapshots are wanted.
    pub watched: bool,
}

impl ProcessData {
    /// All inputs are these.
    pub(crate) fn know_inputs(&mut self, ci: Vec<u16>) {
        self.ci_known = (0..).zip(&ci).map(|(place, _)| place).collect();
        self.ci = ci;
    }

    /// Inputs as last set or read; `None`: not known.
    pub(crate) fn inputs(&self) -> Vec<Option<u16>> {
        (0..)
            .zip(&self.ci)
            .map(|(place, word)| Some(*word).filter(|_| self.ci_known.contains(&place)))
            .collect()
    }
}
