//! Details of an error for programs: board, joint or point, with the value and its limit.

/// Details of an error. A field is `None` if it does not apply.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Number of the board.
    pub board: Option<u8>,
    /// Number of the joint, 1 to 6 from the base.
    pub joint: Option<u8>,
    /// Index of the trajectory point, from 0; during a motion, index of the 1 ms point.
    pub point: Option<u32>,
    /// Value that was found, in the unit of the message.
    pub value: Option<f64>,
    /// Limit of the value.
    pub limit: Option<f64>,
    /// Usual cause.
    pub cause: Option<&'static str>,
    /// Cause of a held stop, if the controller reports the cause.
    pub held_stop: Option<Box<HeldStopFacts>>,
}

/// Cause of a held stop.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldStopFacts {
    /// Name of the cause, with hyphens.
    pub kind: String,
    /// Unit of value and limit; empty if the cause has no value.
    pub unit: &'static str,
    /// Sentence without a full stop.
    pub text: String,
}

impl Facts {
    /// Creates the details of a value that exceeds its limit.
    pub fn beyond(value: f64, limit: f64) -> Self {
        Self { value: Some(value), limit: Some(limit), ..Self::default() }
    }

    /// Sets the joint, 1 to 6 from the base.
    pub fn at_joint(self, joint: u8) -> Self {
        Self { joint: Some(joint), ..self }
    }

    /// Sets the board.
    pub fn at_board(self, board: u8) -> Self {
        Self { board: Some(board), ..self }
    }
}
