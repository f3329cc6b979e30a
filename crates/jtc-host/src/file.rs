//! Functions that read text files with numbers. Each error contains the file and, if known, the line, column and value.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use host_kit::{Diagnose, Diagnosis, ErrorKind, Next, next};

use crate::table::lines;

/// Size limit for files, bytes. Larger files are not read.
pub const FILE_MAX: u64 = 64 << 20;
/// Message that explains why `--deg` is not allowed for a file that contains its units.
pub(crate) const UNITS_KNOWN: &str =
    "the file states its units, so its numbers cannot be degrees; omit --deg";

/// Reason why a file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The operating system could not read or write the file.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is larger than the size limit for files.
    #[error("{}: {bytes} bytes, more than {FILE_MAX}", path.display())]
    TooLarge {
        /// Path of the file.
        path: PathBuf,
        /// Size of the file, bytes.
        bytes: u64,
    },
    /// The text of the file has an error at a known line, column or name.
    #[error("{}{place}: {problem}", path.display())]
    At {
        /// Path of the file.
        path: PathBuf,
        /// Line, column or name at which the error was found.
        place: Place,
        /// Text that describes the problem, with the value.
        problem: String,
    },
    /// The joints in the file are not the joints of the arm.
    #[error("{}, joint_names: {problem}", path.display())]
    JointNames {
        /// Path of the file.
        path: PathBuf,
        /// Text with the names in the file and the names of the arm.
        problem: String,
        /// `true` if the numbers at the ends of the names give an order of six joints.
        numbered: bool,
    },
    /// The robot description has more than six joints, so the caller must select the six joints of the arm.
    #[error("{}: {problem}", path.display())]
    Joints {
        /// Path of the file.
        path: PathBuf,
        /// Text that names the joints that move.
        problem: String,
        /// Six joints that could be the arm, separated by commas.
        six: String,
    },
    /// The joints or the flange that the caller selected do not form an arm.
    #[error("{}{place}: {problem}", path.display())]
    Choice {
        /// Path of the file.
        path: PathBuf,
        /// Name of the joint; empty if the problem is not about one joint.
        place: Place,
        /// Text that describes the problem with the selection.
        problem: String,
    },
    /// The robot description has no chain of six rotary joints, so this controller cannot use the description with any option.
    #[error("{}: {problem}", path.display())]
    FewJoints {
        /// Path of the file.
        path: PathBuf,
        /// Text that describes the joints of the robot description.
        problem: String,
    },
    /// The file describes a robot in a format from which another program can make a URDF.
    #[error("{}{place}: {element}: the file is {}, not URDF", path.display(), form.name())]
    Foreign {
        /// Path of the file.
        path: PathBuf,
        /// Line of the element from which the format was recognised.
        place: Place,
        /// Element from which the format was recognised.
        element: String,
        /// Format of the file.
        form: Foreign,
    },
    /// The file is not in one of the known formats.
    #[error("{}: {problem}", path.display())]
    Form {
        /// Path of the file.
        path: PathBuf,
        /// Text that describes the content of the file and the known formats.
        problem: String,
    },
}

/// Format of a robot description that is not URDF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Foreign {
    /// URDF with macros, which the program xacro replaces.
    Xacro,
    /// Robot description of the simulator MuJoCo.
    Mjcf,
    /// Robot description of the simulator Gazebo.
    Sdf,
}

impl Foreign {
    const fn name(self) -> &'static str {
        match self {
            Self::Xacro => "xacro",
            Self::Mjcf => "MJCF (MuJoCo)",
            Self::Sdf => "SDF (Gazebo)",
        }
    }

    /// Returns the command that makes a URDF from `file`.
    fn next(self, file: &str) -> String {
        match self {
            Self::Xacro => format!(
                "expand the macros, then import the result: `xacro {file} > arm.urdf` (package xacro of ROS, or `pip install xacrodoc`, then \
                 `xacrodoc {file} -o arm.urdf`)"
            ),
            Self::Mjcf => format!(
                "import the URDF of the manufacturer, or convert the file: `pip install mjcf-urdf-simple-converter`, then `python3 -c 'from \
                 mjcf_urdf_simple_converter import convert; convert(\"{file}\", \"arm.urdf\")'`; MJCF has no torque or velocity limits in the \
                 form of a URDF, so add them"
            ),
            Self::Sdf => format!(
                "import the URDF from which the file was made, or convert the file: `rosrun pysdf sdf2urdf.py {file} arm.urdf`"
            ),
        }
    }
}

/// Position in a file: line, column and name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Line number, from 1.
    pub line: Option<usize>,
    /// Column number of a table, from 1.
    pub column: Option<usize>,
    /// Name of a column, key or element.
    pub name: Option<String>,
}

impl Place {
    /// Creates a position from a line number.
    pub fn line(line: usize) -> Self {
        Self { line: Some(line), ..Self::default() }
    }
    /// Creates a position from the line and column of a table cell.
    pub fn cell(line: usize, column: usize) -> Self {
        Self { line: Some(line), column: Some(column), name: None }
    }
    /// Creates a position from the name of a key or element.
    pub fn name(name: impl Into<String>) -> Self {
        Self { name: Some(name.into()), ..Self::default() }
    }
    /// Adds a name to this position.
    pub fn named(self, name: impl Into<String>) -> Self {
        Self { name: Some(name.into()), ..self }
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        if let Some(column) = self.column {
            write!(f, ", column {column}")?;
        }
        if let Some(name) = &self.name {
            write!(f, ", {name}")?;
        }
        Ok(())
    }
}

impl Diagnose for FileError {
    fn diagnosis(&self) -> Diagnosis {
        let next: Next = match self {
            FileError::Io { .. } => "check the name and the rights of the file".into(),
            FileError::TooLarge { .. } => "check that this is the right file".into(),
            FileError::Joints { path, six, .. } => format!(
                "name the six joints of the arm; the others are held at 0: jtc arm import {} --joints {six} -o arm.toml",
                path.display()
            )
            .into(),
            FileError::Choice { .. } => {
                "--joints takes the names of six joints from the base to the wrist, separated by commas. --tip takes the link of the flange, which \
                 the sixth joint carries: `jtc arm import --help`"
                    .into()
            }
            FileError::FewJoints { .. } => {
                "this controller drives only arms with six revolute or continuous joints, without prismatic axes; `jtc example arm` writes an \
                 example"
                    .into()
            }
            FileError::Foreign { path, form, .. } => form.next(&path.display().to_string()).into(),
            FileError::JointNames { numbered: true, .. } => next!(
                "name the arm of this file, or use {} to take the joints in the order of the numbers in their names",
                JointsByNumber
            ),
            FileError::JointNames { .. } => "name the arm of this file, or rename the joints in the file".into(),
            FileError::At { .. } | FileError::Form { .. } => {
                "`jtc help files` shows the forms of files, `jtc example` writes one of each".into()
            }
        };
        Diagnosis::new(ErrorKind::Usage, "file", next)
    }
}

impl FileError {
    /// Adds the path of the file to this error.
    pub fn in_file(mut self, file: &Path) -> Self {
        let (FileError::Io { path, .. }
        | FileError::TooLarge { path, .. }
        | FileError::At { path, .. }
        | FileError::JointNames { path, .. }
        | FileError::Joints { path, .. }
        | FileError::Choice { path, .. }
        | FileError::FewJoints { path, .. }
        | FileError::Foreign { path, .. }
        | FileError::Form { path, .. }) = &mut self;
        *path = file.to_owned();
        self
    }

    pub(crate) fn at(place: Place, problem: impl Into<String>) -> Self {
        FileError::At { path: PathBuf::new(), place, problem: problem.into() }
    }

    #[cfg(feature = "urdf")]
    pub(crate) fn few_joints(problem: impl Into<String>) -> Self {
        FileError::FewJoints { path: PathBuf::new(), problem: problem.into() }
    }

    #[cfg(feature = "urdf")]
    pub(crate) fn choice(place: Place, problem: impl Into<String>) -> Self {
        FileError::Choice { path: PathBuf::new(), place, problem: problem.into() }
    }

    pub(crate) fn form(problem: impl Into<String>) -> Self {
        FileError::Form { path: PathBuf::new(), problem: problem.into() }
    }
}

/// Reads the whole text of a file.
pub(crate) fn read_text(path: &Path) -> Result<String, FileError> {
    text_of(read_bytes(path)?, path)
}

fn text_of(bytes: Vec<u8>, path: &Path) -> Result<String, FileError> {
    decoded(bytes).map_err(|problem| FileError::form(problem).in_file(path))
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, FileError> {
    let io = |source| FileError::Io { path: path.to_owned(), source };
    let bytes = std::fs::metadata(path).map_err(io)?.len();
    if bytes > FILE_MAX {
        return Err(FileError::TooLarge { path: path.to_owned(), bytes });
    }
    std::fs::read(path).map_err(io)
}

/// Reads the whole text of a file that may be XML. An XML file may have another encoding than UTF-8: the encoding of
/// its byte order mark, or the encoding in its first line. Bytes that are not valid in this encoding are replaced,
/// because most of them are in comments.
pub(crate) fn read_xml_or_text(path: &Path) -> Result<String, FileError> {
    let bytes = read_bytes(path)?;
    let marked = encoding_rs::Encoding::for_bom(&bytes).map(|(encoding, _)| encoding);
    let encoding = match &bytes[..] {
        _ if marked.is_some() => marked,
        [b'<', 0, ..] => Some(encoding_rs::UTF_16LE),
        [0, b'<', ..] => Some(encoding_rs::UTF_16BE),
        _ if bytes.trim_ascii_start().starts_with(b"<") => Some(declared(&bytes)),
        _ => None,
    };
    match encoding {
        None => text_of(bytes, path),
        Some(encoding) => Ok(encoding.decode(&bytes).0.into_owned()),
    }
}

/// Returns the encoding that the first line of an XML file declares, or UTF-8.
fn declared(bytes: &[u8]) -> &'static encoding_rs::Encoding {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]);
    let declaration = head.split("?>").next().filter(|head| head.trim_start().starts_with("<?xml"));
    let label = declaration.and_then(|text| text.split("encoding").nth(1)?.split(['"', '\'']).nth(1));
    let known = label.and_then(|label| encoding_rs::Encoding::for_label(label.as_bytes()));
    // A file in UTF-16 without a byte order mark begins with `<` and 0, so this file is not in UTF-16.
    known.filter(|encoding| encoding.is_ascii_compatible()).unwrap_or(encoding_rs::UTF_8)
}

/// Decodes UTF-8, or UTF-16 with a byte order mark, as some programs for Windows write it.
fn decoded(bytes: Vec<u8>) -> Result<String, &'static str> {
    match encoding_rs::Encoding::for_bom(&bytes) {
        Some((encoding, mark)) if encoding != encoding_rs::UTF_8 => encoding
            .decode_without_bom_handling_and_without_replacement(&bytes[mark..])
            .map(Cow::into_owned)
            .ok_or("the text begins as UTF-16, but is not valid UTF-16; save the file as UTF-8"),
        _ => String::from_utf8(bytes).map_err(|_| "not a text file (its bytes are not valid UTF-8)"),
    }
}

/// Parses a number in the notations that occur in these files (`20.`, `-9.e-6`, ` 1`). The function rejects NaN and infinity.
pub(crate) fn number(text: &str, place: impl Fn() -> Place) -> Result<f64, FileError> {
    match text.trim().parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        Ok(v) => Err(FileError::at(place(), format!("{v} is not a finite number"))),
        Err(_) if text.trim().is_empty() => Err(FileError::at(place(), "a number is missing")),
        Err(_) if text.trim().replacen(',', ".", 1).parse::<f64>().is_ok() => {
            let problem = format!("\"{}\" has a decimal comma; write a decimal point", short(text));
            Err(FileError::at(place(), problem))
        }
        Err(_) => Err(FileError::at(place(), format!("\"{}\" is not a number", short(text)))),
    }
}

/// Shortens a text to at most 40 characters for an error line, and escapes control characters.
pub(crate) fn short(text: &str) -> String {
    short_to(text, 40)
}

/// Like [`short`], with another number of characters.
pub(crate) fn short_to(text: &str, most: usize) -> String {
    let text = text.trim();
    let (shown, end) =
        if text.chars().count() <= most { (most, "") } else { (most.saturating_sub(3), "...") };
    let mut out = String::new();
    for c in text.chars().take(shown) {
        // These characters change the direction of the text, or are invisible.
        let invisible = matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{2069}' | '\u{feff}');
        if c.is_control() || invisible { out.extend(c.escape_default()) } else { out.push(c) }
    }
    out + end
}

/// Returns rows of cells that are separated by commas, semicolons or spaces. Blank lines and lines that begin with `#` are skipped.
pub(crate) fn rows(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    lines(text).enumerate().filter_map(|(i, line)| {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            return None;
        }
        Some((i + 1, cells(line)))
    })
}

fn cells(line: &str) -> Vec<&str> {
    // If the cells are separated by semicolons, a comma belongs to the number in the cell. Such a number is then
    // rejected, because a number must not contain a comma.
    match [';', ','].into_iter().find(|c| line.contains(*c)) {
        Some(c) => line.split(c).map(str::trim).collect(),
        None => line.split_whitespace().collect(),
    }
}

/// Returns the rows of a table of numbers, each with its line number.
pub(crate) fn number_rows(text: &str) -> Result<Vec<(usize, Vec<f64>)>, FileError> {
    rows(text)
        .map(|(line, cells)| {
            let values = cells
                .iter()
                .enumerate()
                .map(|(i, cell)| number(cell, || Place::cell(line, i + 1)))
                .collect::<Result<Vec<f64>, _>>()?;
            Ok((line, values))
        })
        .collect()
}
