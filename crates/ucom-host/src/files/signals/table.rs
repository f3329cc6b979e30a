//! Reads signal table files: TOML with one table for each Program ID.

use super::Signal;
use super::form::{File, FileSignal, LARGEST, people};
use crate::files::text::{TextError, quoted, read_text};
use crate::master::io::{IoDescription, Kind, short};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Help page about signal tables.
pub const SIGNAL_HELP: &str = include_str!("help.txt");

/// Signal tables of several programs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SignalTable {
    programs: Vec<ProgramSignals>,
    given: bool,
}

/// Signals of one program.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProgramSignals {
    /// Program IDs of all program versions to which the table applies.
    pub program_ids: Vec<u16>,
    /// Name of the program for display.
    pub name: String,
    ci: BTreeMap<String, Signal>,
    so: BTreeMap<String, Signal>,
    par: BTreeMap<String, Signal>,
}

/// Reasons why a file is not a valid signal table.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SignalTableError {
    /// The signal table file cannot be read.
    #[error(transparent)]
    Text(#[from] TextError),
    /// The text is not TOML in the form of a signal table. The error message contains the line.
    #[error("{0}")]
    Form(String),
    /// A program in the table has no Program ID.
    #[error("program {number} has no program_id")]
    NoId {
        /// Index of the program in the file, from 1.
        number: usize,
    },
    /// Two tables have the same Program ID.
    #[error("program 0x{id:04X} has two entries")]
    Twice {
        /// Program ID that both tables have.
        id: u16,
    },
    /// A number of a signal is not valid.
    #[error("program 0x{id:04X}, {kind} `{signal}`: {what}")]
    Signal {
        /// First Program ID of the program.
        id: u16,
        /// Kind of the signal: `CI`, `SO` or `PAR`.
        kind: &'static str,
        /// Name of the signal.
        signal: String,
        /// Text of the error, with the limit.
        what: String,
    },
    /// A signal table file contains an error.
    #[error("{}: {source}", path.display())]
    In {
        /// Path of the signal table file.
        path: PathBuf,
        /// Error in the signal table file.
        source: Box<SignalTableError>,
    },
}

impl SignalTable {
    /// Reads a signal table from TOML text.
    pub fn parse(text: &str) -> Result<Self, SignalTableError> {
        let file: File = toml::from_str(text).map_err(|e| SignalTableError::Form(people(&e.to_string())))?;
        let mut table = Self { programs: Vec::new(), given: true };
        for (i, program) in file.program.into_iter().enumerate() {
            let Some(&id) = program.program_id.first() else {
                return Err(SignalTableError::NoId { number: i + 1 });
            };
            for (n, id) in program.program_id.iter().enumerate() {
                if table.program(*id).is_some()
                    || program.program_id.iter().take(n).any(|before| before == id)
                {
                    return Err(SignalTableError::Twice { id: *id });
                }
            }
            let signals = |kind: Kind, list: BTreeMap<String, FileSignal>| {
                let one = |(signal, of): (String, FileSignal)| match of.check() {
                    Ok(checked) => Ok((signal, checked)),
                    Err(what) => Err(SignalTableError::Signal { id, kind: kind.name(), signal, what }),
                };
                list.into_iter().map(one).collect::<Result<BTreeMap<_, _>, _>>()
            };
            table.programs.push(ProgramSignals {
                ci: signals(Kind::Ci, program.ci)?,
                so: signals(Kind::So, program.so)?,
                par: signals(Kind::Par, program.par)?,
                program_ids: program.program_id,
                name: program.name,
            });
        }
        Ok(table)
    }

    /// Reads a signal table from a file.
    pub fn read(path: &Path) -> Result<Self, SignalTableError> {
        let text = read_text(path)?;
        Self::parse(&text).map_err(|e| SignalTableError::In { path: path.into(), source: Box::new(e) })
    }

    /// Returns `true` if a signal table was read. If no signal table was read, the meaning of words is unknown.
    pub fn is_given(&self) -> bool {
        self.given
    }

    /// Returns the signals of a program.
    pub fn program(&self, id: u16) -> Option<&ProgramSignals> {
        self.programs.iter().find(|p| p.program_ids.contains(&id))
    }

    /// Returns the text of a signal table for programs that need a table. The text contains the name of every signal, with scale and unit
    /// guessed from the texts of the boards. An expert must review the text.
    pub fn template(programs: &[(u16, &IoDescription)]) -> String {
        let mut text = String::from(
            "# What the words of inputs, outputs and parameters mean; `ucom help edges` explains the keys.\n\
             # Begun from the texts of the boards: look over types, scales and units before you trust them.\n",
        );
        for (id, description) in programs {
            text += &format!(
                "\n[[program]]\nprogram_id = 0x{id:04X}\nname = {}\n",
                quoted(&description.description)
            );
            for (kind, title) in [(Kind::Ci, "ci"), (Kind::So, "so"), (Kind::Par, "par")] {
                text += &format!("\n[program.{title}]\n");
                if kind != Kind::So {
                    text += "# Boards send no limits: add them, as { …, min = -60, max = 60 }, before anything moves.\n";
                }
                let mut used = BTreeSet::new();
                for (i, name) in description.names(kind).iter().enumerate() {
                    let unique = description.find(0, kind, short(name)) == Ok(i as u16);
                    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_';
                    let key = match short(name) {
                        name if unique && !name.is_empty() && name.chars().all(bare) => name.to_owned(),
                        name if unique => quoted(name),
                        _ => format!("\"#{i}\""),
                    };
                    // Skips a key that the table already contains. For example, two signals share a name, so their
                    // keys are their indices, such as `#2`. A third signal may have the name `#2`.
                    if used.insert(key.clone()) {
                        text += &format!("{key} = {{ {} }}\n", keys(name));
                    }
                }
            }
        }
        text
    }
}

/// Returns the keys of a signal, such as `scale = 0.01, unit = "deg"` for the name `position [0.01 deg]`.
fn keys(name: &str) -> String {
    let bracket =
        name.split_once('[').and_then(|(_, rest)| rest.split_once(']')).map(|(inside, _)| inside.trim());
    let mut keys = vec!["type = \"int16\"".to_owned()];
    let Some(inside) = bracket else { return keys.concat() };
    let (scale, unit) = match inside.split_once(' ') {
        Some((number, unit)) if number.parse::<f64>().is_ok_and(|n| n.is_finite()) => {
            (number.parse().ok(), unit.trim())
        }
        _ => (None, inside),
    };
    let scale = scale.filter(|n: &f64| (1.0 / LARGEST..=LARGEST).contains(n));
    keys.extend(scale.map(|n| format!("scale = {n}")));
    let signal = FileSignal { unit: unit.into(), ..Default::default() };
    if signal.check().is_ok() && !unit.is_empty() {
        keys.push(format!("unit = {}", quoted(unit)));
    }
    keys.join(", ")
}

impl ProgramSignals {
    /// Returns the names in the table for one kind of signal.
    pub fn names(&self, kind: Kind) -> impl Iterator<Item = &String> {
        self.of(kind).keys()
    }

    fn of(&self, kind: Kind) -> &BTreeMap<String, Signal> {
        match kind {
            Kind::Ci => &self.ci,
            Kind::So => &self.so,
            Kind::Par => &self.par,
        }
    }

    /// Finds a signal by its complete name, by its name without the unit in brackets, or by its index. The letter
    /// case is ignored unless two names differ only by letter case. This rule also applies to names that the user
    /// gives.
    pub fn signal(&self, kind: Kind, index: usize, name: &str) -> Option<&Signal> {
        let all = self.of(kind);
        let like = |wanted: &str| {
            let mut found = all.iter().filter(|(key, _)| key.trim().eq_ignore_ascii_case(wanted.trim()));
            found.next().filter(|_| found.next().is_none()).map(|(_, signal)| signal)
        };
        all.get(name)
            .or_else(|| all.get(short(name)))
            .or_else(|| like(name))
            .or_else(|| like(short(name)))
            .or_else(|| all.get(&format!("#{index}")))
    }

    /// Returns the names in the table that the program does not have. Most of these names are typing errors of the author.
    pub fn strays(&self, description: &IoDescription) -> Vec<String> {
        let mut strays = Vec::new();
        for kind in [Kind::Ci, Kind::So, Kind::Par] {
            let names = description.names(kind);
            let fits = |key: &str| {
                let key_is = |n: &str| n.trim().eq_ignore_ascii_case(key.trim());
                let by_name = names.iter().any(|n| key_is(n) || key_is(short(n)));
                by_name || (0..names.len()).any(|i| key == format!("#{i}"))
            };
            strays.extend(
                self.names(kind).filter(|key| !fits(key)).map(|key| format!("{} `{key}`", kind.name())),
            );
        }
        strays
    }
}

#[cfg(test)]
mod tests {
    use std::panic;

    use super::*;
    use crate::files::signals::BoardSignals;
    use ucom::Profile;

    fn texts(list: &[&str]) -> Vec<String> {
        list.iter().map(|t| (*t).to_owned()).collect()
    }

    fn description() -> IoDescription {
        IoDescription {
            description: "head \"pan\"".into(),
            ci: texts(&["set_position [0.01 deg]", "stiffness"]),
            so: texts(&["position [0.01 deg]", "x", "x"]),
            par: texts(&["kp [mA/deg]", "müde [1/2 \\]"]),
        }
    }

    /// D-11: the Program ID of the board selects the signal table. A signal without an entry in the table stays a raw word.
    #[test]
    fn d11_tables_are_found_by_program_and_name() {
        let text = "[[program]]\nprogram_id = [0x1234, 0x4B3F]\n[program.ci]\nset_position = { scale = 0.01, unit = \"deg\" }\n\
                    [program.so]\n\"#2\" = { type = \"hex\" }\n\"y\" = { type = \"bool\" }\n";
        let table = SignalTable::parse(text).unwrap();
        assert!(table.program(0x1235).is_none());
        let program = table.program(0x4B3F).unwrap();
        let signals = BoardSignals::new(&description(), Some(program), &Profile::default());
        assert_eq!(signals.get(Kind::Ci, 0).unwrap().text_with_unit(1500), "15.00 deg");
        assert_eq!(signals.get(Kind::Ci, 1).unwrap().text(1500), "1500");
        assert_eq!(signals.get(Kind::So, 2).unwrap().text(1500), "0x05DC");
        assert_eq!(program.strays(&description()), ["SO `y`"]);
    }

    #[test]
    fn d11_what_makes_no_sense_is_refused_with_its_place() {
        let refused = |signal: &str| {
            let text = format!("[[program]]\nprogram_id = 1\n[program.par]\nkp = {{ {signal} }}\n");
            SignalTable::parse(&text).unwrap_err().to_string()
        };
        assert_eq!(
            refused("scale = 0"),
            "program 0x0001, PAR `kp`: scale = 0 is out of range: its magnitude must be 1e-9 to 1e9"
        );
        assert!(refused("scale = nan").contains("NaN"));
        assert!(refused("offset = inf").contains("inf"));
        assert!(refused("min = 2, max = 1").contains("min = 2 is above max = 1"));
        let message = refused("scale = 0.01, unit = \"deg\", min = -60, max = 400");
        assert!(message.contains("max = 400 is outside -327.68..327.67, the range of the word"), "{message}");
        assert!(refused("type = \"uint16\", min = -1").contains("min = -1 is outside 0..65535"));
        assert!(refused("scale = 100, min = 110, max = 150").contains("no word lies between"));
        assert!(refused("type = \"bool\", scale = 2").contains("have no scale"));
        assert!(refused("unit = \"2m\"").contains("cannot follow a number"));
        assert!(refused("scales = 2").contains("line 4") && refused("type = \"int8\"").contains("line 4"));
        let message = refused("scale = \"x\"");
        assert!(message.contains("expected a number") && !message.contains("f64"), "{message}");
        let form = |text: &str| SignalTable::parse(text).unwrap_err().to_string();
        assert!(form("[[program]]\nname = \"x\"").contains("program 1 has no program_id"));
        assert!(form("[[program]]\nprogram_id = [1, 1]").contains("0x0001 has two entries"));
        assert!(form("[[program]]\nprogram_id = 1\n[[program]]\nprogram_id = 1").contains("has two entries"));
        assert!(form("[[program]]\nprogram_id = 70000").contains("line 2"));
    }

    /// D-11: the letter case of names in the signal table does not matter. This rule also applies to names that the
    /// user gives.
    #[test]
    fn d11_names_of_the_table_are_found_in_any_case() {
        let text = "[[program]]\nprogram_id = 1\n[program.ci]\nSet_Position = { scale = 0.01, unit = \"deg\" }\n\
                    STIFFNES = {}\n";
        let table = SignalTable::parse(text).unwrap();
        let program = table.program(1).unwrap();
        let signals = BoardSignals::new(&description(), Some(program), &Profile::default());
        assert_eq!(signals.get(Kind::Ci, 0).unwrap().unit, "deg");
        assert_eq!(program.strays(&description()), ["CI `STIFFNES`"]);
        assert!(table.is_given() && !SignalTable::default().is_given());
    }

    /// A template is a valid signal table and contains every signal.
    #[test]
    fn a_template_is_a_table_of_all_signals() {
        let text = SignalTable::template(&[(0x1234, &description())]);
        let table = SignalTable::parse(&text).unwrap_or_else(|e| panic!("{e}\n{text}"));
        let program = table.program(0x1234).unwrap();
        assert!(program.strays(&description()).is_empty());
        for kind in [Kind::Ci, Kind::So, Kind::Par] {
            for (i, name) in description().names(kind).iter().enumerate() {
                assert!(program.signal(kind, i, name).is_some(), "{name}\n{text}");
            }
        }
        let signal = program.signal(Kind::Ci, 0, "set_position [0.01 deg]").unwrap();
        assert_eq!((signal.scale, signal.unit.as_str()), (0.01, "deg"));
        assert_eq!(program.signal(Kind::Par, 0, "kp").unwrap().unit, "mA/deg");
    }
}
