//! Names of a board's inputs, outputs and parameters (D-36).
use host_kit::similarity;
use serde::{Deserialize, Serialize};

use crate::master::error::SignalError;
use ucom::{BoardInfo, Dimensions};

/// Kind of a board's buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Controller inputs.
    Ci,
    /// Sensor outputs.
    So,
    /// Parameters.
    Par,
}

impl Kind {
    /// Returns the name of the kind: `CI`, `SO` or `PAR`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ci => "CI",
            Self::So => "SO",
            Self::Par => "PAR",
        }
    }
}

/// Key under which a board's description is stored. The key contains the Program ID, the flash date (D-36) and the
/// flash number. The flash number is necessary because the applications of two boards can differ even if their images
/// are equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct DescriptionKey {
    /// Flash number of the board.
    pub flash_number: u16,
    /// Checksum of the board's program.
    pub program_id: u16,
    /// Flash date of the program as a 16-bit word.
    pub date: u16,
}

impl DescriptionKey {
    /// Returns the key for a board's answer to PC_INFO.
    pub const fn of(info: &BoardInfo) -> Self {
        Self { flash_number: info.flash_number, program_id: info.program_id, date: info.date }
    }
}

/// Description that an application sends about itself and about every signal. The description is stored under a [`DescriptionKey`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct IoDescription {
    /// Text about the application. This text can differ from the board's own description in DSP_INFO.
    pub description: String,
    /// Texts of the controller inputs.
    pub ci: Vec<String>,
    /// Texts of the sensor outputs.
    pub so: Vec<String>,
    /// Texts of the parameters.
    pub par: Vec<String>,
}

impl IoDescription {
    /// Returns the number of signals of each kind.
    pub fn dimensions(&self) -> Dimensions {
        let count = |list: &[String]| u16::try_from(list.len()).unwrap_or(u16::MAX);
        Dimensions { ci: count(&self.ci), so: count(&self.so), par: count(&self.par) }
    }

    /// Returns the texts of the signals in a buffer.
    pub fn names(&self, kind: Kind) -> &[String] {
        match kind {
            Kind::Ci => &self.ci,
            Kind::So => &self.so,
            Kind::Par => &self.par,
        }
    }

    /// Returns the index of a signal in the buffer. The caller selects the signal by its text, or by its index (`#3` or
    /// `3`) if no text matches. The unit in brackets at the end of the text can be omitted. The letter case is ignored
    /// if only one signal then matches.
    pub fn find(&self, board: u8, kind: Kind, name: &str) -> Result<u16, SignalError> {
        let names = self.names(kind);
        let only = |matches: &dyn Fn(&String) -> bool| {
            let mut found = names.iter().enumerate().filter(|(_, n)| matches(n)).map(|(i, _)| i);
            found.next().filter(|_| found.next().is_none())
        };
        let index = only(&|n| n == name)
            .or_else(|| only(&|n| n.trim().eq_ignore_ascii_case(name.trim())))
            .or_else(|| only(&|n| short(n).eq_ignore_ascii_case(name.trim())))
            .or_else(|| name.trim_start_matches('#').parse().ok().filter(|i| *i < names.len()));
        if let Some(index) = index.and_then(|i| u16::try_from(i).ok()) {
            return Ok(index);
        }
        // A unit in brackets must not reduce the similarity of two names, so both forms of the name are compared.
        let like = |n: &str| similarity(n, name).max(similarity(short(n), name));
        let mut near: Vec<(f64, &String)> = names.iter().map(|n| (like(n), n)).collect();
        near.retain(|(similarity, _)| *similarity > 0.6);
        near.sort_by(|a, b| b.0.total_cmp(&a.0));
        let near = near.into_iter().take(3).map(|(_, n)| n.clone()).collect();
        Err(SignalError::NoSignal { board, kind: kind.name(), name: name.into(), near })
    }
}

/// Returns the text of a signal without the unit in brackets at its end.
pub fn short(text: &str) -> &str {
    text.split_once(" [").map_or(text, |(name, _)| name).trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_are_found_by_name_or_number() {
        let texts = |list: &[&str]| list.iter().map(|t| (*t).to_owned()).collect();
        let io = IoDescription { ci: texts(&["Target", "target speed", "x", "x"]), ..Default::default() };
        assert_eq!(io.find(1, Kind::Ci, "Target"), Ok(0));
        assert_eq!(io.find(1, Kind::Ci, "TARGET SPEED"), Ok(1));
        assert_eq!(io.find(1, Kind::Ci, "#3"), Ok(3));
        let units = IoDescription { par: texts(&["kp [mA/deg]", "kp_2 [mA]", "KD"]), ..Default::default() };
        assert_eq!((units.find(1, Kind::Par, "KP"), units.find(1, Kind::Par, "kd")), (Ok(0), Ok(2)));
        assert!(io.find(1, Kind::Ci, "x").is_err(), "two signals have this name");
        let text = io.find(1, Kind::Ci, "traget").unwrap_err().to_string();
        assert!(text.contains("board 1 has no CI `traget`; similar: `Target`"), "{text}");
    }
}
