//! File that contains a last will. Each serial port has a separate file. Only the owner can read the file of a last will. The agent
//! writes the file completely or not at all.
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::line::{Moves, Policy, Will};

/// Version of the format of the file.
const VERSION: u32 = 1;
/// Upper limit of the file length, bytes. A valid file is always shorter than this limit.
const LEN_MAX: u64 = 16 << 10;
/// Longest name that is displayed, in characters.
const NAME_MAX: usize = 100;

/// Contents of the file of a last will.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stored {
    version: u32,
    /// Name of the serial port.
    port: String,
    /// Name of the client, which users see.
    pub client: String,
    /// Policy of the client.
    pub policy: Policy,
    /// Kind of motion that is in progress.
    pub what: Moves,
    /// Start of the motion, s since 1970.
    pub since_unix_s: f64,
}

/// State of the file of a last will when an agent starts.
#[derive(Clone, Debug, PartialEq)]
pub enum Found {
    /// No file exists, because the previous agent has ended properly or no motion was in progress.
    Nothing,
    /// Last will of an agent that was killed during a motion.
    Left(Stored),
    /// The file has invalid contents, so the policy is unknown. The text is the reason.
    Doubtful(String),
}

/// Returns the path of the last will of a serial port in the directory `folder`. The path contains the name of the port as the user has
/// specified it. A port name that identifies the adapter (by-id) never changes, but a device name may change.
pub(super) fn path(folder: &Path, port: &str) -> PathBuf {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'.' || byte == b'-';
    let escaped = |byte: u8| if plain(byte) { char::from(byte).to_string() } else { format!("_{byte:02x}") };
    folder.join(format!("moves-{}.json", port.bytes().map(escaped).collect::<String>()))
}

/// Reads the last will at this path for a serial port.
pub(super) fn read(path: &Path, port: &str) -> Found {
    let metadata = match fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Found::Nothing,
        Err(error) => return Found::Doubtful(error.to_string()),
        Ok(metadata) => metadata,
    };
    if !metadata.is_file() || metadata.len() > LEN_MAX {
        return Found::Doubtful("it is not a regular file, or it is too large".into());
    }
    if is_open(&metadata) || path.parent().is_some_and(|folder| is_others(folder, &metadata)) {
        return Found::Doubtful("other users can write to it".into());
    }
    let text = match fs::read(path) {
        Err(error) => return Found::Doubtful(error.to_string()),
        Ok(text) => text,
    };
    match serde_json::from_slice::<Stored>(&text) {
        Err(error) => Found::Doubtful(format!("it is damaged: {error}")),
        Ok(stored) if stored.version != VERSION => {
            Found::Doubtful(format!("it has version {}, expected {VERSION}", stored.version))
        }
        Ok(stored) if stored.port != port => Found::Doubtful("it belongs to another port".into()),
        Ok(stored) => {
            let client = stored.client.chars().filter(|c| !host_kit::is_hidden(*c)).take(NAME_MAX).collect();
            Found::Left(Stored { client, ..stored })
        }
    }
}

#[cfg(unix)]
fn is_open(metadata: &fs::Metadata) -> bool {
    std::os::unix::fs::MetadataExt::mode(metadata) & 0o022 != 0
}

#[cfg(not(unix))]
fn is_open(_: &fs::Metadata) -> bool {
    false
}

/// Returns `true` if the file and its folder have different owners, or if other users can write to the folder.
#[cfg(unix)]
fn is_others(folder: &Path, file: &fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    fs::metadata(folder).is_ok_and(|folder| folder.uid() != file.uid() || is_open(&folder))
}

#[cfg(not(unix))]
fn is_others(_: &Path, _: &fs::Metadata) -> bool {
    false
}

/// Writes the complete file of the last will in one step. After this call, the file is valid even if the agent is
/// killed. After the disk has stored the file, the file also survives a loss of power.
pub(super) fn write(path: &Path, port: &str, will: &Will, since_unix_s: f64) -> io::Result<()> {
    let Will { client, policy, what } = will.clone();
    let stored = Stored { version: VERSION, port: port.to_owned(), client, policy, what, since_unix_s };
    let text = serde_json::to_vec_pretty(&stored)?;
    let part = part_of(path);
    let mut file = begin(&part)?;
    let written = file.write_all(&text).and_then(|()| fs::rename(&part, path));
    if written.is_err() {
        // An error of the removal is ignored, because the error of the write is reported.
        let _ = fs::remove_file(&part);
    }
    written?;
    file.sync_all()
}

/// Truncates a file that can be neither replaced nor removed, so that its contents are invalid. Truncating a file is possible even on a
/// full disk.
pub(super) fn spoil(path: &Path) {
    // If truncating the file also fails, the error is ignored.
    let _ = OpenOptions::new().write(true).truncate(true).open(path);
}

/// Removes the file of the last will.
pub(super) fn remove(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Checks that files can be written to the folder of `path`; creates the folder if it is missing.
pub(super) fn try_out(path: &Path) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        let mut builder = fs::DirBuilder::new();
        builder.recursive(true);
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
        builder.create(folder)?;
    }
    let part = part_of(path);
    begin(&part)?.write_all(b"{}")?;
    fs::remove_file(part)
}

fn part_of(path: &Path) -> PathBuf {
    path.with_extension("part")
}

/// Creates a file that only its owner can read. Replaces an incomplete file that a killed agent has left.
fn begin(part: &Path) -> io::Result<File> {
    remove(part)?;
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PORT: &str = "/dev/serial/by-id/usb-FTDI_A";

    fn will(policy: Policy) -> Will {
        Will { client: "anna: jtc traj".into(), policy, what: Moves::Motion }
    }

    #[test]
    fn what_is_written_is_read_back_by_its_owner_alone_and_in_one_step() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = path(&dir.path().join("state"), PORT);
        try_out(&path).expect("there is room");
        assert_eq!(read(&path, PORT), Found::Nothing);
        for policy in [Policy::Continue, Policy::Pause, Policy::Stop] {
            write(&path, PORT, &will(policy), 1.5).expect("there is room");
            let Found::Left(stored) = read(&path, PORT) else { panic!("{:?}", read(&path, PORT)) };
            assert_eq!((stored.client.as_str(), stored.policy), ("anna: jtc traj", policy));
            assert_eq!((stored.what, stored.since_unix_s), (Moves::Motion, 1.5));
        }
        let folder = path.parent().expect("a folder");
        assert_eq!(fs::read_dir(folder).expect("it is there").count(), 1, "nothing is left beside it");
        #[cfg(unix)]
        {
            use std::os::unix::fs::MetadataExt as _;
            let mode = |path: &Path| fs::metadata(path).expect("it is there").mode() & 0o777;
            assert_eq!((mode(&path), mode(folder)), (0o600, 0o700));
        }
        remove(&path).expect("it is there");
        remove(&path).expect("it is gone already");
        assert_eq!(read(&path, PORT), Found::Nothing);
    }

    #[test]
    fn each_port_has_a_file_of_its_own_by_name() {
        let ports = ["/dev/ttyUSB0", "/dev/ttyUSB1", "dev/ttyUSB0", "_2fdev_2fttyUSB0", "COM3", "../x", "ü"];
        let files: std::collections::BTreeSet<PathBuf> =
            ports.iter().map(|port| path("folder".as_ref(), port)).collect();
        assert_eq!(files.len(), ports.len());
        assert!(files.iter().all(|file| file.parent() == Some("folder".as_ref())), "{files:?}");
    }

    #[test]
    fn what_is_damaged_or_somebody_elses_is_in_doubt() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = path(dir.path(), PORT);
        let doubtful = |why: &str| match read(&path, PORT) {
            Found::Doubtful(text) => assert!(text.contains(why), "{text}"),
            other => panic!("{why}: {other:?}"),
        };
        write(&path, "/dev/other", &will(Policy::Continue), 0.0).expect("there is room");
        doubtful("another port");
        write(&path, PORT, &will(Policy::Continue), 0.0).expect("there is room");
        let good = fs::read_to_string(&path).expect("text");
        // If the file is truncated at any byte, the agent reports it as damaged, and never reads another policy from it.
        for n in 0..good.len() {
            fs::write(&path, &good[..n]).expect("a file");
            doubtful("damaged");
        }
        for (from, to, why) in [
            ("\"continue\"", "\"go_on\"", "damaged"),
            ("\"version\": 1", "\"version\": 2", "version 2"),
            ("\"version\": 1", "\"version\": 1, \"more\": 2", "damaged"),
        ] {
            fs::write(&path, good.replace(from, to)).expect("a file");
            doubtful(why);
        }
        fs::write(&path, " ".repeat(1 << 20)).expect("a file");
        doubtful("not a regular file");
        fs::write(&path, good.replace("anna", "an\\u001b[31mna")).expect("a file");
        assert!(matches!(read(&path, PORT), Found::Left(stored) if stored.client == "an[31mna: jtc traj"));
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            fs::set_permissions(&path, fs::Permissions::from_mode(0o666)).expect("it is there");
            doubtful("other users");
            remove(&path).expect("it is there");
            std::os::unix::fs::symlink(dir.path().join("elsewhere"), &path).expect("a link");
            doubtful("not a regular file");
            remove(&path).expect("it is there");
        }
        fs::create_dir(&path).expect("a directory");
        doubtful("not a regular file");
    }
}
