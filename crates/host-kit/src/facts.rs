//! Details of an error for programs: board, joint or point, with the value and its limit.

/// Details of an error. A field is `None` if it does not apply to the error.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// Number of the board.
    pub board: Option<u8>,
    /// Number of the joint, 1 to 6 from the base.
    pub joint: Option<u8>,
    /// Index of the trajectory point, from 0. For an error during a motion, index of the 1 ms point.
    pub point: Option<u32>,
    /// Value that caused the error, in the unit of the message.
    pub value: Option<f64>,
    /// Limit of the value, in the same unit as the value.
    pub limit: Option<f64>,
    /// Usual cause of the error.
    pub cause: Option<&'static str>,
    /// Cause of a held stop, if the controller reports the cause.
    pub held_stop: Option<Box<HeldStopFacts>>,
}

/// Cause of a held stop.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldStopFacts {
    /// Name of the cause, with hyphens between the words.
    pub kind: String,
    /// Unit of the value and of the limit; empty if the cause has no value.
    pub unit: &'static str,
    /// Sentence that describes the cause, without a full stop.
    pub text: String,
}

impl Facts {
    /// Creates the details of a value that exceeds its limit.
    pub fn beyond(value: f64, limit: f64) -> Self {
        Self { value: Some(value), limit: Some(limit), ..Self::default() }
    }

    /// Sets the number of the joint, 1 to 6 from the base.
    pub fn at_joint(self, joint: u8) -> Self {
        Self { joint: Some(joint), ..self }
    }

    /// Sets the number of the board.
    pub fn at_board(self, board: u8) -> Self {
        Self { board: Some(board), ..self }
    }
}
