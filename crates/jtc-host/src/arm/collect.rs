//! One loader for every file that has parameters, and for a directory full of them.

use std::path::{Path, PathBuf};

use jtc_core::{Friction, JOINTS, PidGains, TableOf};
use jtc_dynamics::ArmModel;

use super::csv::{self, Table};
use super::{Arm, ParameterSet, Warning};
use crate::file::{FileError, read_text};

/// Which friction compensation to take where a file has both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrictionChoice {
    /// The polynomial.
    #[default]
    Polynomial,
    /// The table.
    Table,
}

/// Parameters from a file or a directory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterFile {
    /// The whole arm, where the file describes one.
    pub arm: Option<Arm>,
    /// Friction polynomial, c0..c5 ascending.
    pub polynomial: Option<[[f64; 6]; JOINTS]>,
    /// Friction tables.
    pub table: Option<Box<[TableOf<f32>; JOINTS]>>,
    /// Gains.
    pub pid: Option<[PidGains; JOINTS]>,
    /// Kinematics and masses.
    pub model: Option<ArmModel>,
    /// Files read, with what each gave.
    pub sources: Vec<(PathBuf, &'static str)>,
    /// What was not carried over, filled in or left out.
    pub warnings: Vec<Warning>,
}

impl ParameterFile {
    /// Reads an arm file (TOML, URDF), one of the CSV forms, or all of a directory.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let mut all = Self::default();
        if path.is_dir() {
            all.directory(path)?
        } else {
            all.file(path)?
        }
        all.parameter_set(FrictionChoice::default())
            .check()
            .map_err(|e| FileError::form(e.to_string()).in_file(path))?;
        all.parameter_set(FrictionChoice::Table)
            .check()
            .map_err(|e| FileError::form(e.to_string()).in_file(path))?;
        Ok(all)
    }

    /// From the text of a table alone.
    pub fn parse_table(text: &str) -> Result<Self, FileError> {
        let mut all = Self::default();
        match csv::read(text)? {
            Table::Friction(t) => all.table = Some(Box::new([*t; JOINTS])),
            Table::Pid(g) => all.pid = Some([g; JOINTS]),
            whole => all.take(Path::new(""), whole),
        }
        Ok(all)
    }

    /// What can be sent.
    pub fn parameter_set(&self, choice: FrictionChoice) -> ParameterSet {
        let polynomial = self.polynomial.map(Friction::Polynomial);
        let table = self.table.as_ref().map(|t| Friction::Table(**t));
        let friction = match choice {
            FrictionChoice::Polynomial => polynomial.or(table),
            FrictionChoice::Table => table.or(polynomial),
        };
        ParameterSet { friction, pid: self.pid, model: self.model }
    }

    fn warn(&mut self, place: String, problem: impl Into<String>) {
        self.warnings.push(Warning { place, problem: problem.into() });
    }

    fn file(&mut self, path: &Path) -> Result<(), FileError> {
        let text = read_text(path)?;
        if is_arm(&text) {
            let arm = Arm::parse(&text).map_err(|e| e.in_file(path))?;
            self.take_arm(path, arm);
            return Ok(());
        }
        match csv::read(&text).map_err(|e| e.in_file(path))? {
            // One joint's file stands for its five siblings beside it.
            Table::Friction(own) => {
                let tables = siblings(path, |t| if let Table::Friction(t) = t { Some(*t) } else { None })?;
                if tables.is_none() {
                    self.warn(path.display().to_string(), "one friction table: used for all six joints");
                }
                self.table = Some(Box::new(tables.unwrap_or([*own; JOINTS])));
                self.sources.push((path.to_owned(), "friction table"));
            }
            Table::Pid(own) => {
                let gains = siblings(path, |t| if let Table::Pid(g) = t { Some(g) } else { None })?;
                if gains.is_none() {
                    self.warn(path.display().to_string(), "gains of one joint: used for all six");
                }
                self.pid = Some(gains.unwrap_or([own; JOINTS]));
                self.sources.push((path.to_owned(), "gains"));
            }
            whole => self.take(path, whole),
        }
        Ok(())
    }

    fn take(&mut self, path: &Path, table: Table) {
        let what = match table {
            Table::FrictionAll(t) => {
                self.table = Some(t);
                "friction table"
            }
            Table::Polynomial(c) => {
                self.polynomial = Some(c);
                "friction polynomial"
            }
            Table::PidAll(g) => {
                self.pid = Some(g);
                "gains"
            }
            Table::Model(m) => {
                self.model = Some(*m);
                "arm model"
            }
            Table::Friction(_) | Table::Pid(_) => return,
        };
        self.sources.push((path.to_owned(), what));
    }

    fn take_arm(&mut self, path: &Path, arm: Arm) {
        self.warnings.extend(arm.warnings.iter().cloned());
        self.polynomial = arm.polynomial.or(self.polynomial);
        self.table = arm.table.clone().or(self.table.take());
        self.pid = arm.pid.or(self.pid);
        self.model = Some(arm.model);
        self.arm = Some(arm);
        self.sources.push((path.to_owned(), "arm"));
    }

    fn directory(&mut self, path: &Path) -> Result<(), FileError> {
        let io = |source| FileError::Io { path: path.to_owned(), source };
        let mut files: Vec<PathBuf> = Vec::new();
        for entry in std::fs::read_dir(path).map_err(io)? {
            files.push(entry.map_err(io)?.path());
        }
        files.sort();
        let named = |head: &str| -> Vec<PathBuf> {
            let fits = |p: &&PathBuf| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with(head));
            files.iter().filter(fits).cloned().collect()
        };
        for head in ["FricTableJoint0", "PidParamJoint0", "FricPolynomial"] {
            if let Some(file) = named(head).first() {
                self.file(file)?;
            }
        }
        if self.table.is_some() && self.polynomial.is_some() {
            self.warn(
                path.display().to_string(),
                "friction polynomial and table are there: the polynomial is taken",
            );
        }
        let arms: Vec<&PathBuf> =
            files.iter().filter(|p| p.extension().is_some_and(|e| e == "toml" || e == "urdf")).collect();
        match arms[..] {
            [] => {}
            [one] => self.file(one)?,
            _ => {
                let names: Vec<String> = arms.iter().map(|p| p.display().to_string()).collect();
                self.warn(
                    "arm model".to_owned(),
                    format!("none taken of {}: push the right one by name", names.join(", ")),
                );
            }
        }
        if self.sources.is_empty() {
            let problem = "no FricTableJointN.csv, FricPolynomialCoeffs.csv, PidParamJointN.csv, URDF or TOML file in it";
            return Err(FileError::form(problem).in_file(path));
        }
        Ok(())
    }
}

/// TOML or XML, not a table of numbers.
fn is_arm(text: &str) -> bool {
    let start = text.trim_start_matches('\u{feff}').trim_start();
    start.starts_with('<') || start.lines().any(|l| l.contains('=') || l.trim_start().starts_with("[["))
}

/// The six files `…Joint0.csv` to `…Joint5.csv` beside `path`, when they are all there.
fn siblings<T>(path: &Path, get: impl Fn(Table) -> Option<T>) -> Result<Option<[T; JOINTS]>, FileError> {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let Some((head, tail)) = name.split_once("Joint") else { return Ok(None) };
    let Some(tail) = tail.strip_prefix(|c: char| c.is_ascii_digit()) else { return Ok(None) };
    let mut all = Vec::new();
    for j in 0..JOINTS {
        let file = path.with_file_name(format!("{head}Joint{j}{tail}"));
        if !file.exists() {
            return Ok(None);
        }
        match get(csv::read(&read_text(&file)?).map_err(|e| e.in_file(&file))?) {
            Some(v) => all.push(v),
            None => {
                return Err(
                    FileError::form("is another kind of table than the files beside it").in_file(&file)
                );
            }
        }
    }
    Ok(all.try_into().ok())
}
