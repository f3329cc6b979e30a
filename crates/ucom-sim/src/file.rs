//! Chain files, which define the boards of a simulated chain in the order of the wire.

use serde::Deserialize;
use std::path::{Path, PathBuf};

use super::axis::AxisConfig;
use ucom::profile::{Profile, ProfileError};

/// Built-in chain: a humanoid head of ten boards.
pub const HEAD: &str = include_str!("head.toml");
/// Text of `ucom help sim` before the built-in chain.
const FORM: &str = include_str!("file.txt");
/// Largest number of boards of a chain: a bus has numbers for 31 boards.
const MOST_BOARDS: usize = 31;
/// Largest number of axes of a board. The processor (DSP) of the original boards could not process the words of more axes.
const MOST_AXES: usize = 8;

/// Board of a simulated chain.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardConfig {
    /// Flash number of the board; DSP_REPORT contains the low byte of this number.
    pub flash_id: u16,
    /// Description of the board in DSP_INFO.
    pub description: String,
    /// Program ID of the board's application. If `None`, the Program ID is computed from the image, which is derived from the description.
    pub program_id: Option<u16>,
    /// Flash date of the application as a number.
    pub date: u16,
    /// `true` if the board has an application.
    pub application: bool,
    /// `true` if the automatic start of the application is enabled.
    pub autostart: bool,
    /// Axes that the application of the board moves.
    pub axes: Vec<AxisConfig>,
    /// Compatibility profile of the board.
    pub profile: Profile,
}

/// Boards of a simulated chain.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChainConfig {
    /// Boards in the order of the init wire.
    pub boards: Vec<BoardConfig>,
}

/// Reasons why a chain file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ChainFileError {
    /// The chain file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the chain file.
        path: PathBuf,
        /// Error that the system reported.
        source: std::io::Error,
    },
    /// The text is not TOML in the form of a chain file; the message contains the position and the reason.
    #[error("{0}")]
    Form(String),
    /// The chain has more boards than a bus has board numbers.
    #[error("the chain has {count} boards, expected at most {MOST_BOARDS}")]
    Boards {
        /// Number of boards in the chain file.
        count: usize,
    },
    /// The board has no axis, or more axes than its words allow.
    #[error("board {board}: {count} axes are out of range, expected 1 to {MOST_AXES}")]
    Axes {
        /// Position of the board in the file, from 1.
        board: usize,
        /// Number of axes of the board.
        count: usize,
    },
    /// The values of an axis cannot be simulated.
    #[error("board {board}: axis {axis}: {what}")]
    Axis {
        /// Position of the board in the file, from 1.
        board: usize,
        /// Position of the axis among the board's axes, from 1.
        axis: usize,
        /// Reason why the axis cannot be simulated.
        what: &'static str,
    },
    /// The protocol cannot carry the description of a board.
    #[error(
        "board {board}: the description has {count} characters, expected at most 512 characters of Latin-1"
    )]
    Description {
        /// Position of the board in the file, from 1.
        board: usize,
        /// Number of characters in the description.
        count: usize,
    },
    /// A key of the board's profile is not valid.
    #[error("board {board}: profile: {key}: {source}")]
    Profile {
        /// Position of the board in the file, from 1.
        board: usize,
        /// Name of the key in the profile.
        key: String,
        /// Reason why the key is not valid.
        source: ProfileError,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    board: Vec<Board>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Board {
    flash_id: u16,
    #[serde(default = "nameless")]
    description: String,
    program_id: Option<u16>,
    #[serde(default = "some_day")]
    date: u16,
    #[serde(default = "yes")]
    application: bool,
    #[serde(default)]
    autostart: bool,
    #[serde(default = "one_axis")]
    axis: Vec<AxisConfig>,
    #[serde(default)]
    profile: toml::Table,
}

fn nameless() -> String {
    "UCoM2".into()
}

/// Returns the date 2008-03-14 in the FAT encoding.
const fn some_day() -> u16 {
    0x386E
}

const fn yes() -> bool {
    true
}

fn one_axis() -> Vec<AxisConfig> {
    vec![AxisConfig::default()]
}

/// Returns the text of `ucom help sim`.
pub fn help() -> String {
    format!("{FORM}\nThe built-in chain:\n\n{HEAD}")
}

impl ChainConfig {
    /// Reads a chain from the text of a chain file. `profile` applies to boards that have no profile of their own in the text.
    pub fn from_toml(text: &str, profile: &Profile) -> Result<Self, ChainFileError> {
        let file: File = toml::from_str(text).map_err(|e| ChainFileError::Form(e.to_string()))?;
        let count = file.board.len();
        if count > MOST_BOARDS {
            return Err(ChainFileError::Boards { count });
        }
        let boards = file.board.into_iter().enumerate();
        let boards = boards.map(|(i, board)| board.checked(i + 1, profile)).collect::<Result<_, _>>()?;
        Ok(Self { boards })
    }

    /// Reads a chain file.
    pub fn read(path: &Path, profile: &Profile) -> Result<Self, ChainFileError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| ChainFileError::Io { path: path.into(), source })?;
        Self::from_toml(&text, profile).map_err(|e| match e {
            ChainFileError::Form(text) => ChainFileError::Form(format!("{}: {text}", path.display())),
            other => other,
        })
    }

    /// Returns the built-in head with ten boards.
    pub fn head(profile: &Profile) -> Self {
        // The chain file is part of the program, and a test reads it, so reading cannot fail.
        Self::from_toml(HEAD, profile).unwrap_or_default()
    }

    /// Returns this chain with `count` boards. Surplus boards are removed from the end of the chain; additional boards have one axis each.
    #[must_use]
    pub fn with_boards(mut self, count: usize, profile: &Profile) -> Self {
        self.boards.truncate(count);
        while self.boards.len() < count.min(MOST_BOARDS) {
            let taken = |id: u16| self.boards.iter().any(|b| b.flash_id == id);
            let flash_id = (0x01..0x80).find(|id| !taken(*id)).unwrap_or(0);
            self.boards.push(BoardConfig {
                flash_id,
                description: format!("UCoM2 spare {}", self.boards.len() + 1),
                program_id: None,
                date: some_day(),
                application: true,
                autostart: false,
                axes: one_axis(),
                profile: *profile,
            });
        }
        self
    }

    /// Returns this chain with the given flash ids, in the order of the init wire. Boards for which the list has no flash id keep their
    /// flash ids.
    #[must_use]
    pub fn with_flash_ids(mut self, ids: &[u16]) -> Self {
        for (board, id) in self.boards.iter_mut().zip(ids) {
            board.flash_id = *id;
        }
        self
    }
}

impl Board {
    fn checked(self, board: usize, profile: &Profile) -> Result<BoardConfig, ChainFileError> {
        let count = self.description.chars().count();
        if count > 512 || self.description.chars().any(|c| u32::from(c) > 255) {
            return Err(ChainFileError::Description { board, count });
        }
        let count = self.axis.len();
        if !(1..=MOST_AXES).contains(&count) {
            return Err(ChainFileError::Axes { board, count });
        }
        for (i, axis) in self.axis.iter().enumerate() {
            sound(axis).map_err(|what| ChainFileError::Axis { board, axis: i + 1, what })?;
        }
        let mut profile = *profile;
        let mut keys = Vec::new();
        flatten("", self.profile, &mut keys);
        for (key, value) in keys {
            profile.set(&key, &value).map_err(|source| ChainFileError::Profile {
                board,
                key: key.clone(),
                source,
            })?;
        }
        profile.check().map_err(|source| ChainFileError::Profile {
            board,
            key: "combination".into(),
            source,
        })?;
        Ok(BoardConfig {
            flash_id: self.flash_id,
            description: self.description,
            program_id: self.program_id,
            date: self.date,
            application: self.application,
            autostart: self.autostart,
            axes: self.axis,
            profile,
        })
    }
}

/// Flattens tables: `a.b = 1` and `[a] b = 1` define one key.
fn flatten(prefix: &str, table: toml::Table, out: &mut Vec<(String, String)>) {
    for (name, value) in table {
        let name = if prefix.is_empty() { name } else { format!("{prefix}.{name}") };
        match value {
            toml::Value::Table(table) => flatten(&name, table, out),
            toml::Value::String(text) => out.push((name, text)),
            toml::Value::Boolean(true) => out.push((name, "yes".into())),
            toml::Value::Boolean(false) => out.push((name, "no".into())),
            toml::Value::Integer(number) => out.push((name, number.to_string())),
            _ => out.push((name, String::new())),
        }
    }
}

/// Checks that the values of an axis can be simulated.
fn sound(axis: &AxisConfig) -> Result<(), &'static str> {
    let figures = [
        axis.min_deg,
        axis.max_deg,
        axis.start_deg,
        axis.acceleration_per_ma,
        axis.damping_per_s,
        axis.friction_deg_s2,
        axis.gravity_deg_s2,
    ];
    if figures.iter().any(|f| !f.is_finite() || f.abs() > 1e6) {
        return Err("a value is not a number, or outside -1e6..1e6");
    }
    if axis.min_deg >= axis.max_deg || axis.min_deg < -327.0 || axis.max_deg > 327.0 {
        return Err(
            "min_deg must be below max_deg, and both within -327..327 (the range of a 16-bit word of 0.01 \
             deg)",
        );
    }
    if !(axis.min_deg..=axis.max_deg).contains(&axis.start_deg) {
        return Err("start_deg is not between min_deg and max_deg");
    }
    if axis.damping_per_s < 0.0 || axis.friction_deg_s2 < 0.0 {
        return Err("damping_per_s and friction_deg_s2 must not be negative");
    }
    if axis.name.chars().any(|c| !c.is_ascii_alphanumeric() && c != '_') || axis.name.len() > 32 {
        return Err("name must have at most 32 characters: letters, digits and _");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_built_in_head_is_sound() {
        let head = ChainConfig::from_toml(HEAD, &Profile::default()).unwrap();
        assert_eq!(head.boards.len(), 10);
        let ids: BTreeSet<u16> = head.boards.iter().map(|b| b.flash_id & 0x7F).collect();
        assert_eq!(ids.len(), 10, "flash ids are distinguished");
    }

    #[test]
    fn chains_of_any_length_have_different_flash_ids() {
        let profile = Profile::default();
        for count in 0..=31 {
            let chain = ChainConfig::head(&profile).with_boards(count, &profile);
            let ids: BTreeSet<u16> = chain.boards.iter().map(|b| b.flash_id & 0x7F).collect();
            assert_eq!((chain.boards.len(), ids.len()), (count, count));
        }
        let chain = ChainConfig::head(&profile).with_boards(3, &profile).with_flash_ids(&[1, 2]);
        assert_eq!(chain.boards.iter().map(|b| b.flash_id).collect::<Vec<_>>(), [1, 2, 0x23]);
    }

    #[test]
    fn a_board_may_read_the_protocol_in_its_own_way() {
        let text = "[[board]]\nflash_id = 1\n[board.profile]\nendian = 'big'\nprog.checksum = 'sum16'\n[[board]]\nflash_id = 2";
        let chain = ChainConfig::from_toml(text, &Profile::default()).unwrap();
        assert_eq!(chain.boards[0].profile.endian, ucom::Endian::Big);
        assert_eq!(chain.boards[1].profile, Profile::default());
    }

    #[test]
    fn what_cannot_be_is_refused_with_its_place() {
        let refused = |text: &str| ChainConfig::from_toml(text, &Profile::default()).unwrap_err().to_string();
        assert!(refused("[[board]]\nflashid = 1").contains("flashid"));
        assert!(refused("[[board]]\nflash_id = 1\naxis = []").contains("board 1: 0 axes"));
        let axis = |text: &str| refused(&format!("[[board]]\nflash_id = 1\naxis = [{{{text}}}]"));
        assert!(axis("min_deg = 5, max_deg = 3").contains("below max_deg"));
        assert!(axis("start_deg = 100").contains("between"));
        assert!(axis("damping_per_s = nan").contains("not a number"));
        assert!(axis("name = 'a b'").contains("letters"));
        assert!(refused("[[board]]\nflash_id = 1\n[board.profile]\nendan = 'big'").contains("endan"));
        assert!(refused("[[board]]\nflash_id = 1\ndescription = '語'").contains("Latin-1"));
        let many = "[[board]]\nflash_id = 1\n".repeat(32);
        assert!(refused(&many).contains("32 boards"));
    }
}
