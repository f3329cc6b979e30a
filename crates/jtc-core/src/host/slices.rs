//! Frames that are too long for one tick: progress of such a frame, and outcome of a slice of it (J-06).
use jtc_wire::DataStatus;

/// Progress of a long frame, a slice in each tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum SliceProgress {
    #[default]
    Begin,
    /// Points checked.
    PointCheck(usize),
    /// Points copied.
    PointCopy(usize),
    /// Joints whose table is checked.
    TableCheck(usize),
    /// Joints whose table is copied.
    TableCopy(usize),
    /// Poses in which the inertia of the joints was computed.
    Pose(usize),
    /// Bytes of the arm image that are written.
    Image(usize),
}

/// Outcome of a slice.
pub(crate) enum SliceOutcome {
    Done,
    Refused(DataStatus),
    Unfinished(SliceProgress),
}

impl From<Result<(), DataStatus>> for SliceOutcome {
    fn from(result: Result<(), DataStatus>) -> Self {
        match result {
            Ok(()) => Self::Done,
            Err(status) => Self::Refused(status),
        }
    }
}
