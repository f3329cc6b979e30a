//! Values of parameters that this PC assumes for a board. The protocol has no function that reads parameters back
//! (D-35).
/// Value of a parameter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ParValue {
    /// The PC has not written the parameter since the application started.
    #[default]
    Unknown,
    /// The PC wrote the parameter; the protocol has no confirmation for this.
    Assumed(u16),
}

/// Values that this PC assumes for the parameters of one board.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Shadow {
    values: Vec<ParValue>,
}

impl Shadow {
    pub(crate) fn resize(&mut self, dimension: u16) {
        self.values.resize(dimension.into(), ParValue::Unknown);
    }

    pub(crate) fn wrote(&mut self, index: u16, value: u16) {
        if let Some(place) = self.values.get_mut(usize::from(index)) {
            *place = ParValue::Assumed(value);
        }
    }

    pub(crate) fn forget(&mut self) {
        self.values.fill(ParValue::Unknown);
    }

    /// Returns the values of all parameters in the order of the buffer.
    pub fn values(&self) -> &[ParValue] {
        &self.values
    }

    /// Returns the number of parameters of the board.
    pub(crate) fn len(&self) -> u16 {
        self.values.len() as u16
    }
}
