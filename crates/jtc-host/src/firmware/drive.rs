//! USB drive that an ST-LINK presents, with the name of the board and the files on the drive.

use std::fs;
use std::path::{Path, PathBuf};

use super::FirmwareError;

/// Maximum length of a label in the file system of the drive. Longer labels are truncated.
const LABEL_MAX: usize = 11;
/// Maximum number of bytes read from the drive's small files.
const TEXT_MAX: usize = 4096;

/// Prefixes of the board name in a label. ST-LINK firmware since 2019 uses the first prefix. Older ST-LINK firmware uses the second prefix.
const PREFIXES: [&str; 2] = ["NOD_", "NODE_"];

/// Board numbers in `MBED.HTM`, each with the board name that is used in labels.
const CODES: [(&str, &str); 6] = [
    ("0813", "H743ZI"),
    ("0836", "H743ZI2"),
    ("0842", "H753ZI"),
    ("0843", "H745ZIQ"),
    ("0844", "H755ZIQ"),
    ("0847", "H745I-DISCO"),
];

/// Drive of an ST-LINK, with the information from its files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Drive {
    /// Mount point of the drive.
    pub path: PathBuf,
    /// Label of the drive; `None` if it is unknown. If the block device is unknown, the name of the mount folder is
    /// used as the label.
    pub label: Option<String>,
    /// Board number in `MBED.HTM`; `None` if the file does not contain a board number.
    pub code: Option<String>,
    /// Content of `DETAILS.TXT`: version and build date of the ST-LINK firmware, one line each.
    pub details: String,
    /// Block device of the drive, such as `/dev/sda`; `None` if the operating system does not report the device.
    pub device: Option<PathBuf>,
    /// USB device to which the drive belongs; `None` if the operating system does not report the USB device.
    pub usb: Option<UsbDevice>,
    /// Number of the file system at the mount point; `None` if the operating system has no such numbers. After the drive is removed, the
    /// path belongs to another file system and the number changes.
    pub volume: Option<u64>,
}

/// Number of the file system at the mount point; `None` if the operating system has no such numbers. If the drive is
/// removed, its path belongs to another file system, so the number shows the removal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UsbDevice {
    /// Folder of the USB device in the device tree of the operating system. The name of this folder contains the
    /// number of the USB connector.
    pub folder: PathBuf,
    /// Number of the device on the USB bus. The number changes each time the device is plugged in.
    pub number: String,
}

/// Result of the comparison of a drive with a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Fit {
    /// The drive belongs to the board.
    Same,
    /// The drive does not name its board, or contains only a part of the board name.
    Unknown,
    /// The drive belongs to a different board.
    Other,
}

impl Drive {
    /// Reads the description of the drive that is mounted at a folder.
    ///
    /// # Errors
    ///
    /// Returns [`FirmwareError::NoDrive`] if the folder does not contain a file of an ST-LINK drive.
    pub fn at(path: &Path) -> Result<Self, FirmwareError> {
        let no_drive = |why: &str| FirmwareError::NoDrive { path: path.to_owned(), why: why.to_owned() };
        if !path.is_dir() {
            return Err(no_drive("this folder does not exist"));
        }
        let (details, page) = (text(path, "DETAILS.TXT"), text(path, "MBED.HTM"));
        if details.is_none() && page.is_none() {
            return Err(no_drive("the folder has neither DETAILS.TXT nor MBED.HTM"));
        }
        Ok(Self {
            path: path.to_owned(),
            // If the operating system mounts a drive automatically, the label of the drive is the name of the folder.
            label: path.file_name().map(|name| name.to_string_lossy().into_owned()),
            code: page.as_deref().and_then(code),
            details: details.unwrap_or_default(),
            device: None,
            usb: None,
            volume: fs::metadata(path).ok().as_ref().and_then(volume),
        })
    }

    /// Adds the information about the drive that the operating system provides. The label of the block device replaces the folder name,
    /// because the folder name can be wrong. The operating system appends a digit to the folder name of a second drive with the same label.
    /// For example, the folder `NODE_H743ZI2` may belong to a NUCLEO-H743ZI.
    pub fn of_system(self, device: PathBuf, label: Option<String>, usb: Option<UsbDevice>) -> Self {
        Self { device: Some(device), label, usb, ..self }
    }

    /// Returns the board name in the form that drive labels use (`H745ZIQ`), and `true` if the name is complete. Returns `None` if the
    /// drive does not name its board.
    pub fn board(&self) -> Option<(&str, bool)> {
        let by_code =
            |code: &String| CODES.iter().find(|(known, _)| known == code).map(|(_, name)| (*name, true));
        let by_label = |label: &'_ String| {
            let name =
                PREFIXES.iter().find_map(|prefix| label.strip_prefix(prefix)).filter(|name| !name.is_empty());
            let at = name.map(|name| label.len() - name.len())?;
            Some((at, label.len() < LABEL_MAX))
        };
        self.code.as_ref().and_then(by_code).or_else(|| {
            let label = self.label.as_ref()?;
            let (at, whole) = by_label(label)?;
            Some((&label[at..], whole))
        })
    }

    /// Compares the drive with a board. `board` has the form that the firmware uses, for example `nucleo-h745zi-q`.
    pub fn fit(&self, board: &str) -> Fit {
        let wanted = short_name(board);
        match self.board() {
            Some((name, _)) if name == wanted => Fit::Same,
            // A label with the maximum length may contain only the beginning of a board name.
            Some((name, false)) if wanted.starts_with(name) => Fit::Unknown,
            Some(_) => Fit::Other,
            None => Fit::Unknown,
        }
    }

    /// Returns the content of `FAIL.TXT`; `None` if the file does not exist.
    pub fn failure(&self) -> Option<String> {
        text(&self.path, "FAIL.TXT").map(|text| text.trim().to_owned())
    }

    /// Returns `true` if the drive is present.
    pub fn is_there(&self) -> bool {
        ["DETAILS.TXT", "MBED.HTM"].iter().any(|file| self.path.join(file).exists())
    }
}

/// Returns the number of the file system of a file or folder.
#[cfg(unix)]
pub(super) fn volume(found: &fs::Metadata) -> Option<u64> {
    use std::os::unix::fs::MetadataExt as _;
    Some(found.dev())
}

/// Returns `None`, because this operating system does not number its file systems.
#[cfg(not(unix))]
pub(super) fn volume(_: &fs::Metadata) -> Option<u64> {
    None
}

/// Returns the board name in the form that drive labels use. `nucleo-h745zi-q-ldo` and `nucleo-h745zi-q` are names of the same board,
/// `H745ZIQ`.
fn short_name(board: &str) -> String {
    let name = same_board(board);
    name.strip_prefix("nucleo-").unwrap_or(name).replace('-', "").to_uppercase()
}

/// Returns the board name without the suffix for the core supply.
pub(super) fn same_board(board: &str) -> &str {
    board.strip_suffix("-ldo").unwrap_or(board)
}

/// Returns `true` if the core of the processor on this board can be supplied in two ways. Each image is built for one
/// of the two supplies. In ST's board names, `-q` means that the board has a switching regulator in addition to the
/// linear regulator.
pub(super) fn has_two_supplies(board: &str) -> bool {
    same_board(board).ends_with("-q") || same_board(board) != board
}

fn text(folder: &Path, file: &str) -> Option<String> {
    let bytes = fs::read(folder.join(file)).ok()?;
    Some(String::from_utf8_lossy(&bytes[..bytes.len().min(TEXT_MAX)]).into_owned())
}

/// Returns the four digits after the first `code=`, which are the number of the board.
fn code(page: &str) -> Option<String> {
    let (_, behind) = page.split_once("code=")?;
    let code = behind.get(..4)?;
    code.bytes().all(|byte| byte.is_ascii_hexdigit()).then(|| code.to_owned())
}

/// Returns `true` if the chip of this board has a second core. The second core starts at the beginning of bank 2 of the flash.
pub(super) fn has_second_core(board: &str) -> bool {
    ["nucleo-h745", "nucleo-h755"].iter().any(|chip| board.starts_with(chip))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(label: &str, code: Option<&str>) -> Drive {
        Drive {
            path: PathBuf::new(),
            label: Some(label.into()),
            code: code.map(Into::into),
            details: String::new(),
            device: None,
            usb: None,
            volume: None,
        }
    }

    #[test]
    fn a_drive_fits_the_board_that_it_names() {
        use Fit::*;
        let (h745, h743) = ("nucleo-h745zi-q", "nucleo-h743zi2");
        for (label, code, of_h745, of_h743) in [
            ("NOD_H745ZIQ", None, Same, Other),
            ("NOD_H743ZI2", None, Other, Same),
            // The older NUCLEO-H743ZI is a different board with other LEDs. Its full label equals the truncated label
            // of the newer board, so the label alone does not identify the board.
            ("NODE_H743ZI", None, Other, Unknown),
            ("NODE_H743ZI", Some("0836"), Other, Same),
            ("NODE_H743ZI", Some("0813"), Other, Other),
            ("NODE_H745ZI", None, Unknown, Other),
            ("NOD_F401RE", None, Other, Other),
            ("NOD_H745", None, Other, Other),
            ("NUCLEO", None, Unknown, Unknown),
            ("D:", Some("0843"), Same, Other),
            ("anything", Some("9999"), Unknown, Unknown),
        ] {
            let drive = drive(label, code);
            assert_eq!((drive.fit(h745), drive.fit(h743)), (of_h745, of_h743), "{label} {code:?}");
            assert_eq!(drive.fit("nucleo-h745zi-q-ldo"), of_h745, "it is the same board");
        }
    }

    #[test]
    fn boards_with_a_switching_regulator_come_in_two_kinds() {
        for (board, two) in
            [("nucleo-h745zi-q", true), ("nucleo-h745zi-q-ldo", true), ("nucleo-h743zi2", false)]
        {
            assert_eq!(has_two_supplies(board), two, "{board}");
        }
    }

    #[test]
    fn a_folder_is_a_drive_when_it_has_its_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("NOD_H745ZIQ");
        assert!(Drive::at(&path).unwrap_err().to_string().contains("folder does not exist"));
        fs::create_dir(&path).unwrap();
        assert!(Drive::at(&path).unwrap_err().to_string().contains("neither DETAILS.TXT"));
        fs::write(path.join("DETAILS.TXT"), "Version: 0221\n").unwrap();
        let found = Drive::at(&path).unwrap();
        assert_eq!((found.fit("nucleo-h745zi-q"), found.failure()), (Fit::Same, None));
        fs::write(path.join("MBED.HTM"), "<a href=\"https://os.mbed.com/platforms/?code=08360221FFFF\">")
            .unwrap();
        fs::write(path.join("FAIL.TXT"), "no target\r\n").unwrap();
        let found = Drive::at(&path).unwrap();
        assert_eq!((found.code.as_deref(), found.failure().as_deref()), (Some("0836"), Some("no target")));
        assert_eq!(found.fit("nucleo-h745zi-q"), Fit::Other, "the number counts");
    }
}
