//! Progress of a frame that is too long for one tick, and result of one slice of this frame (J-06).
use jtc_wire::DataStatus;

/// Progress of a long frame. Each tick executes one slice of the frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum SliceProgress {
    #[default]
    Begin,
    /// Number of points that have been checked.
    PointCheck(usize),
    /// Number of points that have been copied.
    PointCopy(usize),
    /// Number of joints whose table has been checked.
    TableCheck(usize),
    /// Number of joints whose table has been copied.
    TableCopy(usize),
    /// Number of poses in which the controller has computed the inertia of the joints.
    Pose(usize),
    /// Number of bytes of the arm image that are stored.
    Image(usize),
}

/// Result of the execution of one slice.
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
