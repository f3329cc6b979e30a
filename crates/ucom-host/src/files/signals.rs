//! Signal tables: type, scale, offset, unit and limits of the inputs, outputs and parameters of a program (D-11), like the `SG_` lines of a
//! DBC file. The signal table is a separate file, because boards send only a text for each signal.

mod form;
mod signal;
mod table;
mod value;
mod value_error;

use crate::master::io::{IoDescription, Kind};
pub use signal::{Signal, SignalType};
pub use table::{ProgramSignals, SIGNAL_HELP, SignalTable, SignalTableError};
use ucom::Profile;
pub use value::{SignalValue, SignalValueError};
pub use value_error::ValueError;

/// Signals of one board, each with its meaning.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoardSignals {
    ci: Vec<Signal>,
    so: Vec<Signal>,
    par: Vec<Signal>,
}

impl BoardSignals {
    /// Creates the signals of a board from its description. A signal that is not in the table becomes a raw word.
    pub fn new(description: &IoDescription, program: Option<&ProgramSignals>, profile: &Profile) -> Self {
        let of = |kind: Kind| {
            let names = description.names(kind).iter().enumerate();
            let signal = |(i, name): (usize, &String)| {
                let known = program.and_then(|p| p.signal(kind, i, name));
                known.cloned().unwrap_or_else(|| Signal::bare(profile))
            };
            names.map(signal).collect()
        };
        Self { ci: of(Kind::Ci), so: of(Kind::So), par: of(Kind::Par) }
    }

    /// Returns the signals of a program that the signal table does not contain. All signals accept only raw words,
    /// because the units of numbers are not known.
    pub fn raw_only(mut self) -> Self {
        for signal in self.ci.iter_mut().chain(&mut self.so).chain(&mut self.par) {
            signal.raw_only = true;
        }
        self
    }

    /// Returns all signals of one kind, in the order of the buffer.
    pub fn all(&self, kind: Kind) -> &[Signal] {
        match kind {
            Kind::Ci => &self.ci,
            Kind::So => &self.so,
            Kind::Par => &self.par,
        }
    }

    /// Returns the signal with this index; returns `None` if the buffer has no such signal.
    pub fn get(&self, kind: Kind, index: usize) -> Option<&Signal> {
        self.all(kind).get(index)
    }

    #[cfg(test)]
    pub(crate) fn replace_par(&mut self, signal: Signal) {
        self.par.fill(signal);
    }
}
