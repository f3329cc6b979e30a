//! Cause of the last held stop (J-69).
use jtc_wire::StopCause;

use crate::bit_codec::bit_codec;

/// Cause of the last held stop.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LastStop {
    pub(crate) cause: StopCause,
    /// Tick in which the held stop began; 0 if no held stop is stored.
    pub(crate) tick: u64,
}

bit_codec!(StopCause { kind, joint, value, limit });
bit_codec!(LastStop { cause, tick });
