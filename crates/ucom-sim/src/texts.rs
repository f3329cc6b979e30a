//! Texts of an application: its description and the names of its inputs, outputs and parameters, in Latin-1.

use ucom::node::Text;

/// Texts of an application, in Latin-1.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Texts {
    /// Description of the application.
    pub application: Vec<u8>,
    /// Names of the controller inputs.
    pub ci: Vec<Vec<u8>>,
    /// Names of the sensor outputs.
    pub so: Vec<Vec<u8>>,
    /// Names of the parameters.
    pub par: Vec<Vec<u8>>,
}

impl Texts {
    /// Creates the texts of an application from a description and names. Characters that Latin-1 does not contain are replaced by `?`.
    pub fn new<T: AsRef<str>>(application: &str, ci: &[T], so: &[T], par: &[T]) -> Self {
        let list = |names: &[T]| names.iter().map(|name| latin1(name.as_ref())).collect();
        Self { application: latin1(application), ci: list(ci), so: list(so), par: list(par) }
    }

    /// Returns a text of the application; returns an empty text if the application has no such text.
    pub fn get(&self, text: Text) -> &[u8] {
        let (list, index) = match text {
            Text::Application => return &self.application,
            Text::Ci(index) => (&self.ci, index),
            Text::So(index) => (&self.so, index),
            Text::Par(index) => (&self.par, index),
        };
        list.get(usize::from(index)).map_or(&[], Vec::as_slice)
    }
}

/// Converts a text to Latin-1. Characters that Latin-1 does not contain are replaced by `?`.
pub(super) fn latin1(text: &str) -> Vec<u8> {
    text.chars().map(|c| u8::try_from(c).unwrap_or(b'?')).collect()
}
