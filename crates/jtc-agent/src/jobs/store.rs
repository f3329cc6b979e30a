//! Store of trajectories, which are identified by number. Machine controls that can send only numbers select a
//! trajectory by its number.
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use jtc_host::Trajectory;
use jtc_host::file::FileError;
use jtc_host::trajectory::{ArmNames, Loaded, POINTS_MAX, Point};
use sha2::{Digest as _, Sha256};

use super::{PoseStore, PoseStoreError};

/// Largest number of a trajectory; the smallest number is 1.
pub const NUMBER_MAX: u16 = 99;

/// Trajectory in the store.
#[derive(Clone, Debug)]
pub struct Stored {
    /// Number of the trajectory.
    pub number: u16,
    /// Name of the trajectory, which users see.
    pub name: String,
    /// Points and time step of the trajectory.
    pub trajectory: Trajectory,
    /// Notes about values that were derived or omitted when the trajectory was read.
    pub notes: Vec<String>,
    /// Digest of the points and the time step of the trajectory. The digest changes if a point or the time step
    /// changes, but does not depend on the name.
    pub digest: String,
}

/// Reason why a trajectory is not stored.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The trajectory number is out of range.
    #[error("trajectory number {0} is out of range (1 to {NUMBER_MAX})")]
    Number(u16),
    /// Another trajectory already has this number, and the caller does not permit its replacement.
    #[error("trajectory {number} already exists, {name}: nothing was replaced")]
    Taken {
        /// Number that both trajectories would have.
        number: u16,
        /// Name of the trajectory that already has this number.
        name: String,
    },
    /// Two trajectory files have the same number.
    #[error("{directory}: two files have the trajectory number {number}", directory = directory.display())]
    Twice {
        /// Directory of the trajectory files.
        directory: PathBuf,
        /// Number of both trajectory files.
        number: u16,
    },
    /// The trajectory has more points than a controller can store.
    #[error("too many points: {points}, a controller holds at most {POINTS_MAX}")]
    TooMany {
        /// Number of points of the trajectory.
        points: usize,
    },
    /// The file does not contain a readable trajectory.
    #[error(transparent)]
    File(#[from] FileError),
    /// The poses in the directory of the trajectories cannot be used.
    #[error(transparent)]
    Poses(#[from] PoseStoreError),
    /// The directory of the trajectories cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// Path of the file or the directory.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

impl host_kit::Diagnose for StoreError {
    fn diagnosis(&self) -> host_kit::Diagnosis {
        let (code, next) = match self {
            Self::Number(_) => ("number", format!("choose a number from 1 to {NUMBER_MAX}")),
            Self::Taken { .. } => {
                let next = "choose another number, or leave out `new` to replace the trajectory";
                return host_kit::Diagnosis::new(host_kit::ErrorKind::Refused, "taken", next);
            }
            Self::Twice { .. } => ("store", "remove one of the files, or give it another number".into()),
            Self::TooMany { .. } => ("too-long", "split the trajectory, or use a longer step".into()),
            Self::File(error) => return error.diagnosis(),
            Self::Poses(error) => return error.diagnosis(),
            Self::Io { .. } => (
                "store",
                "free disk space, or choose another directory with `jtc serve --trajectories DIR`".into(),
            ),
        };
        host_kit::Diagnosis::new(host_kit::ErrorKind::Usage, code, next)
    }
}

/// Store of trajectories by number. If the store has a directory, the trajectories survive a restart of the agent.
pub struct Store {
    directory: Option<PathBuf>,
    kept: Mutex<BTreeMap<u16, Arc<Stored>>>,
    /// Store of named poses.
    pub poses: PoseStore,
    /// Lock for writing into the directory. The lock is separate, so that readers never wait for the disk.
    writing: Mutex<()>,
}

impl Store {
    /// Returns a store that keeps trajectories only in memory.
    pub fn in_memory() -> Self {
        Self {
            directory: None,
            kept: Mutex::default(),
            poses: PoseStore::default(),
            writing: Mutex::default(),
        }
    }

    /// Opens a directory of trajectory files with names like `7-pick.csv`. Other files in the directory are
    /// ignored.
    ///
    /// # Errors
    ///
    /// The directory cannot be read or created, or one of its trajectories is invalid. The agent then does not start,
    /// so that it never runs other trajectories than the users expect.
    pub fn open(directory: &Path) -> Result<Self, StoreError> {
        let io = |source| StoreError::Io { path: directory.to_owned(), source };
        fs::create_dir_all(directory).map_err(io)?;
        let poses = PoseStore::open(directory)?;
        let store = Self { directory: Some(directory.to_owned()), poses, ..Self::in_memory() };
        for entry in fs::read_dir(directory).map_err(io)? {
            let path = entry.map_err(io)?.path();
            let Some((number, name)) = numbered(&path) else { continue };
            let loaded = Loaded::load(&path, None)?;
            let stored = Arc::new(Stored::new(number, &name, loaded));
            if store.lock().insert(number, stored).is_some() {
                return Err(StoreError::Twice { directory: directory.to_owned(), number });
            }
        }
        Ok(store)
    }

    /// Returns a trajectory by its number.
    pub fn get(&self, number: u16) -> Option<Arc<Stored>> {
        self.lock().get(&number).cloned()
    }

    /// Returns all trajectories in the order of their numbers.
    pub fn list(&self) -> Vec<Arc<Stored>> {
        self.lock().values().cloned().collect()
    }

    /// Stores the trajectory in `text`, and replaces the trajectory that has the same number. `text` is a file in
    /// any format that [`Loaded::parse`] accepts, with `names`. A run that has already begun continues with the old trajectory.
    ///
    /// # Errors
    ///
    /// A [`StoreError`]; the trajectory that has this number is then unchanged.
    pub fn put(
        &self,
        number: u16,
        name: &str,
        text: &str,
        degrees: bool,
        names: Option<ArmNames<'_>>,
    ) -> Result<Arc<Stored>, StoreError> {
        self.keep((number, name), (text, degrees, names), false)
    }

    /// Like [`put`](Self::put), but never replaces a trajectory.
    ///
    /// # Errors
    ///
    /// [`StoreError::Taken`] if the number is in use, and the errors of [`put`](Self::put).
    pub fn put_new(
        &self,
        number: u16,
        name: &str,
        text: &str,
        degrees: bool,
        names: Option<ArmNames<'_>>,
    ) -> Result<Arc<Stored>, StoreError> {
        self.keep((number, name), (text, degrees, names), true)
    }

    /// Checks that no trajectory has this number.
    ///
    /// # Errors
    ///
    /// [`StoreError::Taken`] if a trajectory has this number.
    pub fn is_free(&self, number: u16) -> Result<(), StoreError> {
        match self.get(number) {
            Some(stored) => Err(StoreError::Taken { number, name: stored.name.clone() }),
            None => Ok(()),
        }
    }

    fn keep(
        &self,
        (number, name): (u16, &str),
        (text, degrees, names): (&str, bool, Option<ArmNames<'_>>),
        new: bool,
    ) -> Result<Arc<Stored>, StoreError> {
        if !(1..=NUMBER_MAX).contains(&number) {
            return Err(StoreError::Number(number));
        }
        let named = |error: FileError| error.in_file(Path::new(if name.is_empty() { "text" } else { name }));
        let loaded = Loaded::parse(text, names).map_err(named)?;
        let loaded = if degrees { loaded.in_degrees().map_err(named)? } else { loaded };
        let points = loaded.trajectory.points.len();
        if points > POINTS_MAX {
            return Err(StoreError::TooMany { points });
        }
        let stored = Arc::new(Stored::new(number, name, loaded));
        let _writing = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        if new {
            self.is_free(number)?;
        }
        if let Some(directory) = &self.directory {
            let path = directory.join(format!("{number}-{}.csv", file_name(name)));
            let written = write(directory, &path, &stored.trajectory, number);
            written.map_err(|source| StoreError::Io { path, source })?;
        }
        self.lock().insert(number, stored.clone());
        Ok(stored)
    }

    /// Deletes a trajectory. Returns `false` if the trajectory did not exist.
    ///
    /// # Errors
    ///
    /// The trajectory file cannot be removed. If an error is returned, the trajectory stays in the store.
    pub fn delete(&self, number: u16) -> Result<bool, StoreError> {
        let _writing = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(directory) = &self.directory {
            let removed = remove(directory, number, None);
            removed.map_err(|source| StoreError::Io { path: directory.clone(), source })?;
        }
        Ok(self.lock().remove(&number).is_some())
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<u16, Arc<Stored>>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Stored {
    fn new(number: u16, name: &str, loaded: Loaded) -> Self {
        let Loaded { trajectory, notes, .. } = loaded;
        let digest = digest(&trajectory);
        Self { number, name: name.to_owned(), trajectory, notes, digest }
    }
}

/// Returns the first 64 bits of a SHA-256 hash of the time step and the points, as text.
fn digest(trajectory: &Trajectory) -> String {
    let mut hash = Sha256::new();
    hash.update(trajectory.step_ms.to_le_bytes());
    for Point { position, velocity, acceleration } in &trajectory.points {
        for value in [position, velocity, acceleration].into_iter().flatten() {
            // Positive and negative zero produce the same digest.
            hash.update((value + 0.0).to_le_bytes());
        }
    }
    hash.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}

/// Returns the number and the name in the path of a trajectory file.
fn numbered(path: &Path) -> Option<(u16, String)> {
    let stem =
        path.file_stem()?.to_str().filter(|_| path.extension().is_some_and(|ending| ending == "csv"))?;
    let (number, name) = stem.split_once('-')?;
    let number = number.parse().ok().filter(|number| (1..=NUMBER_MAX).contains(number))?;
    Some((number, name.to_owned()))
}

/// Returns a trajectory name that is valid in a file name, at most 64 bytes long.
fn file_name(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let mut short = String::new();
    for c in name.chars().map(plain) {
        if short.len() + c.len_utf8() > 64 {
            break;
        }
        short.push(c);
    }
    if short.is_empty() { "trajectory".to_owned() } else { short }
}

/// Writes the trajectory file completely or not at all. The old file is removed before the new file receives its
/// name. After a loss of power, there may therefore be no trajectory with this number, but never two.
fn write(directory: &Path, path: &Path, trajectory: &Trajectory, number: u16) -> io::Result<()> {
    let part = path.with_extension("part");
    let written = fs::write(&part, trajectory.to_exact_csv());
    let written = written.and_then(|()| fs::File::open(&part)?.sync_all());
    // If the disk is full, the incomplete file is removed, so that it does not occupy space.
    written.inspect_err(|_| drop(fs::remove_file(&part)))?;
    remove(directory, number, Some(path))?;
    fs::rename(&part, path)?;
    fs::File::open(directory)?.sync_all()
}

/// Removes all files of a trajectory number, except `keep`.
fn remove(directory: &Path, number: u16, keep: Option<&Path>) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let path = entry?.path();
        if numbered(&path).is_some_and(|(n, _)| n == number) && Some(path.as_path()) != keep {
            match fs::remove_file(&path) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n";

    #[test]
    fn what_is_kept_outlasts_the_agent_under_its_number_and_name() {
        let directory = tempfile::tempdir().expect("a directory");
        let store = Store::open(directory.path()).expect("it is empty");
        store.put(7, "pick", TEXT, false, None).expect("a trajectory");
        store.put(7, "place", TEXT, false, None).expect("another one");
        store.put(8, &"ä/".repeat(60), TEXT, false, None).expect("a long name");
        assert!(
            store.put(0, "x", TEXT, false, None).is_err() && store.put(100, "x", TEXT, false, None).is_err()
        );
        assert!(store.put(7, "bad", "no trajectory", false, None).is_err());
        let names =
            |store: &Store| store.list().iter().map(|s| (s.number, s.name.clone())).collect::<Vec<_>>();
        let again = Store::open(directory.path()).expect("its own files");
        assert_eq!(names(&again)[0], (7, "place".to_owned()));
        assert_eq!(
            again.get(7).expect("it is there").trajectory,
            store.get(7).expect("it is there").trajectory
        );
        assert_eq!(
            again.get(7).map(|kept| kept.digest.clone()),
            store.get(7).map(|kept| kept.digest.clone())
        );
        assert!(again.delete(7).expect("it can be written") && !again.delete(7).expect("it can be written"));
        assert_eq!(names(&Store::open(directory.path()).expect("its own files")).len(), 1);
    }

    #[test]
    fn a_digest_is_that_of_what_is_executed_alone() {
        let store = Store::in_memory();
        let digest = |name: &str, text: &str, degrees| {
            store.put(1, name, text, degrees, None).expect("a trajectory").digest.clone()
        };
        let first = digest("a", TEXT, false);
        assert!(first.len() == 16 && first.chars().all(|c| c.is_ascii_hexdigit()), "{first}");
        // The name and the number format do not change the motion, and therefore do not change the digest.
        assert_eq!(digest("b", TEXT, true), first);
        assert_eq!(digest("b", &TEXT.replace("0,0\n", "0.0,-0\n"), false), first);
        // A change of the points, their order or the time step changes the motion, and therefore the digest.
        for other in [
            TEXT.replace("1,0,", "1,0.000001,"),
            TEXT.replace("1,0,0", "1,0,0.000001"),
            TEXT.replace("\n1,", "\n2,"),
            format!("{TEXT}2,0,0,0,0,0,0\n"),
        ] {
            assert_ne!(digest("a", &other, false), first, "{other}");
        }
    }

    #[test]
    fn what_is_new_takes_the_place_of_nothing() {
        let store = Store::in_memory();
        store.put_new(7, "pick", TEXT, false, None).expect("it is free");
        let error = store.put_new(7, "place", TEXT, false, None).expect_err("it is taken");
        assert!(matches!(&error, StoreError::Taken { number: 7, name } if name == "pick"), "{error}");
        assert_eq!(store.get(7).map(|kept| kept.name.clone()), Some("pick".to_owned()));
        assert!(store.is_free(7).is_err() && store.is_free(8).is_ok());
        store.put(7, "place", TEXT, false, None).expect("that is what is asked for");
        assert!(store.delete(7).is_ok() && store.put_new(7, "pick", TEXT, false, None).is_ok());
    }

    /// While the disk is full, the stored trajectory stays in the store, even after a restart of the agent. When
    /// the disk has free space again, the next trajectory is stored.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_leaves_what_had_the_number() {
        let directory = tempfile::tempdir().expect("a directory");
        let store = Store::open(directory.path()).expect("it is empty");
        store.put(7, "pick", TEXT, false, None).expect("a trajectory");
        std::os::unix::fs::symlink("/dev/full", directory.path().join("7-pick.part")).expect("a link");
        let longer = format!("{TEXT}2,0,0,0,0,0,0\n");
        let error = store.put(7, "pick", &longer, false, None).expect_err("there is no room");
        assert!(error.to_string().contains("7-pick.csv: No space left"), "{error}");
        for store in [&store, &Store::open(directory.path()).expect("its own files")] {
            let kept = store.get(7).expect("it is there");
            assert_eq!(kept.trajectory.points.len(), 2);
        }
        assert_eq!(
            fs::read_dir(directory.path()).expect("the directory").count(),
            1,
            "no part of it is left"
        );
        store.put(7, "pick", &longer, false, None).expect("there is room");
        assert_eq!(
            Store::open(directory.path()).expect("its own files").list()[0].trajectory.points.len(),
            3
        );
    }

    #[test]
    fn two_files_of_one_number_are_refused() {
        let directory = tempfile::tempdir().expect("a directory");
        for name in ["07-old.csv", "7-new.csv"] {
            std::fs::write(directory.path().join(name), TEXT).expect("a file");
        }
        let error = Store::open(directory.path()).err().expect("which is meant?");
        assert!(error.to_string().contains("two files have the trajectory number 7"), "{error}");
    }
}
