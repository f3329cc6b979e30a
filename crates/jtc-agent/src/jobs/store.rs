//! Trajectories that an agent keeps by number: what a run, or a machine control that knows numbers only, asks for.
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use jtc_host::Trajectory;
use jtc_host::file::FileError;
use jtc_host::trajectory::{Loaded, POINTS_MAX};

/// The numbers that there are: 1 to this.
pub const NUMBER_MAX: u16 = 99;

/// A trajectory that is kept.
#[derive(Clone, Debug)]
pub struct Stored {
    /// Its number.
    pub number: u16,
    /// What people call it.
    pub name: String,
    /// The trajectory.
    pub trajectory: Trajectory,
    /// What was derived or left out when it was read.
    pub notes: Vec<String>,
}

/// Why something is not kept.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// No such number.
    #[error("{0} is no number of a trajectory: 1 to {NUMBER_MAX} are")]
    Number(u16),
    /// More points than a controller holds.
    #[error("{points} points: a controller holds {POINTS_MAX}")]
    TooMany {
        /// So many.
        points: usize,
    },
    /// No trajectory, or none that can be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The directory cannot be read or written.
    #[error("{path}: {source}", path = path.display())]
    Io {
        /// Which file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
}

impl host_kit::Diagnose for StoreError {
    fn diagnosis(&self) -> host_kit::Diagnosis {
        let (code, next) = match self {
            Self::Number(_) => ("number", format!("choose a number from 1 to {NUMBER_MAX}")),
            Self::TooMany { .. } => ("too-long", "send it in parts, or with a longer step".into()),
            Self::File(error) => return error.diagnosis(),
            Self::Io { .. } => {
                ("store", "make room, or name another directory with `jtc serve --trajectories DIR`".into())
            }
        };
        host_kit::Diagnosis::new(host_kit::ErrorKind::Usage, code, next)
    }
}

/// Trajectories by number; in a directory, where one is given, so that they outlast the agent.
pub struct Store {
    directory: Option<PathBuf>,
    kept: Mutex<BTreeMap<u16, Arc<Stored>>>,
}

impl Store {
    /// In memory alone.
    pub fn in_memory() -> Self {
        Self { directory: None, kept: Mutex::default() }
    }

    /// In a directory: files with names like `7-pick.csv`. What is no such file is left alone.
    ///
    /// # Errors
    ///
    /// The directory cannot be read or made, or one of its trajectories is none: an agent that keeps other numbers than people think is
    /// worse than none.
    pub fn open(directory: &Path) -> Result<Self, StoreError> {
        let io = |source| StoreError::Io { path: directory.to_owned(), source };
        fs::create_dir_all(directory).map_err(io)?;
        let store = Self { directory: Some(directory.to_owned()), kept: Mutex::default() };
        for entry in fs::read_dir(directory).map_err(io)? {
            let path = entry.map_err(io)?.path();
            let Some((number, name)) = numbered(&path) else { continue };
            let loaded = Loaded::load(&path, None)?;
            store.lock().insert(number, Arc::new(Stored::new(number, &name, loaded)));
        }
        Ok(store)
    }

    /// One of them.
    pub fn get(&self, number: u16) -> Option<Arc<Stored>> {
        self.lock().get(&number).cloned()
    }

    /// All of them, by number.
    pub fn list(&self) -> Vec<Arc<Stored>> {
        self.lock().values().cloned().collect()
    }

    /// Keeps what was read from `text`, a file of any form that [`Loaded::parse`] knows, in place of what had this number. A run that has
    /// begun goes on with what it has.
    ///
    /// # Errors
    ///
    /// [`StoreError`]; what had this number before is kept then.
    pub fn put(&self, number: u16, name: &str, text: &str, degrees: bool) -> Result<Arc<Stored>, StoreError> {
        if !(1..=NUMBER_MAX).contains(&number) {
            return Err(StoreError::Number(number));
        }
        let named = |error: FileError| error.in_file(Path::new(if name.is_empty() { "text" } else { name }));
        let loaded = Loaded::parse(text, None).map_err(named)?;
        let loaded = if degrees { loaded.in_degrees().map_err(named)? } else { loaded };
        let points = loaded.trajectory.points.len();
        if points > POINTS_MAX {
            return Err(StoreError::TooMany { points });
        }
        let stored = Arc::new(Stored::new(number, name, loaded));
        let mut kept = self.lock();
        if let Some(directory) = &self.directory {
            let path = directory.join(format!("{number}-{}.csv", file_name(name)));
            let written = write(&path, &stored.trajectory);
            written.map_err(|source| StoreError::Io { path: path.clone(), source })?;
            remove(directory, number, Some(&path))?;
        }
        kept.insert(number, stored.clone());
        Ok(stored)
    }

    /// Keeps it no more. False: there was none.
    ///
    /// # Errors
    ///
    /// Its file cannot be removed; it is kept then.
    pub fn delete(&self, number: u16) -> Result<bool, StoreError> {
        let mut kept = self.lock();
        if let Some(directory) = &self.directory {
            remove(directory, number, None)?;
        }
        Ok(kept.remove(&number).is_some())
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<u16, Arc<Stored>>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Stored {
    fn new(number: u16, name: &str, loaded: Loaded) -> Self {
        let Loaded { trajectory, notes, .. } = loaded;
        Self { number, name: name.to_owned(), trajectory, notes }
    }
}

/// Number and name of a file that holds a trajectory by number.
fn numbered(path: &Path) -> Option<(u16, String)> {
    let stem =
        path.file_stem()?.to_str().filter(|_| path.extension().is_some_and(|ending| ending == "csv"))?;
    let (number, name) = stem.split_once('-')?;
    let number = number.parse().ok().filter(|number| (1..=NUMBER_MAX).contains(number))?;
    Some((number, name.to_owned()))
}

/// A name as a file can have it.
fn file_name(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let name: String = name.chars().map(plain).take(64).collect();
    if name.is_empty() { "trajectory".to_owned() } else { name }
}

/// Whole, or not at all.
fn write(path: &Path, trajectory: &Trajectory) -> io::Result<()> {
    let part = path.with_extension("part");
    fs::write(&part, trajectory.to_exact_csv())?;
    fs::File::open(&part)?.sync_all()?;
    fs::rename(&part, path)
}

/// Removes the files of a number, but for `keep`.
fn remove(directory: &Path, number: u16, keep: Option<&Path>) -> Result<(), StoreError> {
    let io = |path: &Path, source| StoreError::Io { path: path.to_owned(), source };
    for entry in fs::read_dir(directory).map_err(|e| io(directory, e))? {
        let path = entry.map_err(|e| io(directory, e))?.path();
        if numbered(&path).is_some_and(|(n, _)| n == number) && Some(path.as_path()) != keep {
            fs::remove_file(&path).map_err(|e| io(&path, e))?;
        }
    }
    Ok(())
}
