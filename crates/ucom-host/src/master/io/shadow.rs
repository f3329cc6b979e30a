//! Parameters that this PC assumes for a board. The protocol does not allow parameters to be read back (D-35).
/// A parameter's value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ParValue {
    /// The parameter was not written since the application started.
    #[default]
    Unknown,
    /// The parameter was written; the protocol has no confirmation.
    Assumed(u16),
}

/// The parameters of one board.
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

    /// Returns all parameters in order.
    pub fn values(&self) -> &[ParValue] {
        &self.values
    }

    /// Returns the number of parameters.
    pub(crate) fn len(&self) -> u16 {
        self.values.len() as u16
    }
}
