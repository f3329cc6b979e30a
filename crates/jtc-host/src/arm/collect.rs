//! Loader for parameter files in all formats and for directories of parameter files.

use std::path::{Path, PathBuf};

use jtc_core::{Friction, JOINTS, PidGains, TableOf};
use jtc_dynamics::ArmModel;
use jtc_wire::Joint;

use super::csv::{self, Table};
use super::{Arm, Change, ParameterSet, Warning, is_xml};
use crate::file::{FileError, read_xml_or_text};

/// Choice between the friction table and the friction polynomial, for files that contain both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrictionChoice {
    /// The friction polynomial is used.
    #[default]
    Polynomial,
    /// The friction table is used.
    Table,
}

/// Parameters that were read from files and directories.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParameterFile {
    /// Complete arm; `None` if no file describes an arm.
    pub arm: Option<Arm>,
    /// Friction polynomial of each joint, coefficients c0 to c5.
    pub polynomial: Option<[[f64; 6]; JOINTS]>,
    /// Friction table of each joint.
    pub table: Option<Box<[TableOf<f32>; JOINTS]>>,
    /// Gains of each joint.
    pub pid: Option<[PidGains; JOINTS]>,
    /// Kinematics and masses of the arm.
    pub model: Option<ArmModel>,
    /// Files that were read, each with the name of the parameter that the file contains.
    pub sources: Vec<(PathBuf, &'static str)>,
    /// Warnings about values that the loader ignored, changed or filled in.
    pub warnings: Vec<Warning>,
}

impl ParameterFile {
    /// Reads parameters from an arm file (TOML, URDF) or a CSV file. If `path` is a directory, reads all such files
    /// in it.
    ///
    /// # Errors
    ///
    /// Returns an error with the position if a file cannot be read or has no parameters in a known format.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        Self::load_all(std::slice::from_ref(&path.to_owned()))
    }

    /// Reads several files and directories into one set of parameters. If two files contain the same parameter, the
    /// value of the later file is used.
    ///
    /// If a parameter has one file for each joint, `paths` must contain all six files or their directory. The loader
    /// reads only files that the user has listed. Therefore no joint receives the values of another joint.
    ///
    /// # Errors
    ///
    /// Returns an error for the first file that cannot be read or parsed, and if the tables of some joints are
    /// missing. Also returns an error if a number cannot be sent ([`ParameterSet::check`]).
    pub fn load_all(paths: &[PathBuf]) -> Result<Self, FileError> {
        let mut all = Self::default();
        let mut joints = JointTables::default();
        for path in paths {
            if path.is_dir() { all.directory(path, &mut joints)? } else { all.file(path, &mut joints)? }
        }
        all.take_joints(joints)?;
        let about = paths.first().map_or(Path::new(""), PathBuf::as_path);
        for choice in [FrictionChoice::Polynomial, FrictionChoice::Table] {
            let set = all.parameter_set(choice);
            set.check().map_err(|e| FileError::form(e.to_string()).in_file(about))?;
        }
        Ok(all)
    }

    /// Parses the text of one parameter table. A table for a single joint is copied to all six joints, because the
    /// check requires a table for each joint.
    #[cfg(any(test, feature = "fuzzing"))]
    pub(crate) fn parse_table(text: &str) -> Result<Self, FileError> {
        let mut all = Self::default();
        match csv::read(text)? {
            Table::Friction(t) => all.table = Some(Box::new([*t; JOINTS])),
            Table::Pid(g) => all.pid = Some([g; JOINTS]),
            whole => all.take(Path::new(""), whole),
        }
        Ok(all)
    }

    /// Returns the parameters for a controller.
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
        self.warnings.push(Warning::new(Change::Files, place, problem));
    }

    fn file(&mut self, path: &Path, joints: &mut JointTables) -> Result<(), FileError> {
        let text = read_xml_or_text(path)?;
        if is_arm(&text) {
            let arm = Arm::parse(&text).map_err(|e| e.in_file(path))?;
            self.take_arm(path, arm);
            return Ok(());
        }
        match csv::read(&text).map_err(|e| e.in_file(path))? {
            Table::Friction(table) => joints.friction.add(path, *table),
            Table::Pid(gains) => joints.gains.add(path, gains),
            whole => {
                self.take(path, whole);
                Ok(())
            }
        }
    }

    fn take_joints(&mut self, joints: JointTables) -> Result<(), FileError> {
        if let Some((tables, paths)) = joints.friction.complete()? {
            self.table = Some(Box::new(tables));
            self.sources.extend(paths.into_iter().map(|path| (path, "friction table")));
        }
        if let Some((gains, paths)) = joints.gains.complete()? {
            self.pid = Some(gains);
            self.sources.extend(paths.into_iter().map(|path| (path, "gains")));
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

    fn directory(&mut self, path: &Path, joints: &mut JointTables) -> Result<(), FileError> {
        let before = self.sources.len() + joints.len();
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
        for head in ["FricTableJoint", "PidParamJoint"] {
            named(head).iter().try_for_each(|file| self.file(file, joints))?;
        }
        if let Some(file) = named("FricPolynomial").first() {
            self.file(file, joints)?;
        }
        if joints.friction.len() > 0 && self.polynomial.is_some() {
            self.warn(
                path.display().to_string(),
                "the directory has a friction polynomial and a friction table: the polynomial is used",
            );
        }
        let arms: Vec<&PathBuf> =
            files.iter().filter(|p| p.extension().is_some_and(|e| e == "toml" || e == "urdf")).collect();
        match arms[..] {
            [] => {}
            [one] => self.file(one, joints)?,
            _ => {
                let names: Vec<String> = arms.iter().map(|p| p.display().to_string()).collect();
                self.warn(
                    "arm model".to_owned(),
                    format!(
                        "several files found, none is used: {}; push the right file by name",
                        names.join(", ")
                    ),
                );
            }
        }
        if self.sources.len() + joints.len() == before {
            let problem = "the directory has no FricTableJointN.csv, FricPolynomialCoeffs.csv, PidParamJointN.csv, URDF or TOML file";
            return Err(FileError::form(problem).in_file(path));
        }
        Ok(())
    }
}

/// Returns `true` if the text is TOML or XML, and `false` if the text is a table of numbers.
fn is_arm(text: &str) -> bool {
    is_xml(text) || text.lines().any(|l| l.contains('=') || l.trim_start().starts_with("[["))
}

/// Tables of single joints. The tables are collected until each of the six joints has a table.
#[derive(Default)]
struct JointTables {
    friction: PerJoint<TableOf<f32>>,
    gains: PerJoint<PidGains>,
}

impl JointTables {
    fn len(&self) -> usize {
        self.friction.len() + self.gains.len()
    }
}

/// Tables of all six joints, with the files from which they were read.
type Complete<T> = ([T; JOINTS], Vec<PathBuf>);

/// Tables of one parameter for single joints, each with the file from which it was read.
struct PerJoint<T> {
    found: [Option<(PathBuf, T)>; JOINTS],
}

impl<T> Default for PerJoint<T> {
    fn default() -> Self {
        Self { found: [const { None }; JOINTS] }
    }
}

impl<T> PerJoint<T> {
    fn len(&self) -> usize {
        self.found.iter().flatten().count()
    }

    /// Adds the table of a joint. The file name contains the joint number.
    fn add(&mut self, path: &Path, table: T) -> Result<(), FileError> {
        let Some((_, joint, _)) = split_name(path) else {
            let problem = "has the numbers of one joint, but its name has no joint number, expected ...Joint0.csv (joint 1) to ...Joint5.csv (joint \
                           6); all six files are needed";
            return Err(FileError::form(problem).in_file(path));
        };
        if let Some((other, _)) = &self.found[joint.index()] {
            let problem = format!("has the numbers of {joint}, but {} has them too", other.display());
            return Err(FileError::form(problem).in_file(path));
        }
        self.found[joint.index()] = Some((path.to_owned(), table));
        Ok(())
    }

    /// Returns the tables of all six joints, or `None` if no joint has a table of this parameter. If only some joints
    /// have a table, returns an error that lists the missing files.
    fn complete(self) -> Result<Option<Complete<T>>, FileError> {
        let Some((first, _)) = self.found.iter().flatten().next() else { return Ok(None) };
        let first = first.clone();
        let missing: Vec<String> = Joint::ALL
            .into_iter()
            .filter(|joint| self.found[joint.index()].is_none())
            .map(|joint| format!("{} ({joint})", sibling(&first, joint)))
            .collect();
        let found: Vec<(PathBuf, T)> = self.found.into_iter().flatten().collect();
        let (paths, tables): (Vec<PathBuf>, Vec<T>) = found.into_iter().unzip();
        match <[T; JOINTS]>::try_from(tables) {
            Ok(tables) => Ok(Some((tables, paths))),
            Err(_) => {
                let problem = format!(
                    "has the numbers of one joint; missing: {}. Name all six files, or their directory",
                    missing.join(", ")
                );
                Err(FileError::form(problem).in_file(&first))
            }
        }
    }
}

/// Splits a file name: `PidParamJoint3.csv` gives `PidParamJoint`, joint 4 and `.csv`. The joint numbers in these file names start at 0.
fn split_name(path: &Path) -> Option<(String, Joint, String)> {
    let name = path.file_name()?.to_string_lossy().into_owned();
    let (head, tail) = name.split_once("Joint")?;
    let digit = tail.chars().next()?.to_digit(10)? as usize;
    Some((format!("{head}Joint"), Joint::from_index(digit)?, tail[1..].to_owned()))
}

/// Returns the file name for another joint in the directory of `path`.
fn sibling(path: &Path, joint: Joint) -> String {
    let joint = joint.index();
    match split_name(path) {
        Some((head, _, tail)) => path.with_file_name(format!("{head}{joint}{tail}")).display().to_string(),
        None => format!("...Joint{joint}.csv"),
    }
}
