//! Named poses that clients have saved through the agent. If the agent has a directory for trajectories, a file in this
//! directory stores the poses. The poses then survive a restart of the agent.
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use jtc_host::arm::{Poses, is_pose_name};

/// Largest number of poses in the store.
pub const POSES_MAX: usize = 200;
/// Name of the file that stores the poses.
const FILE: &str = "poses.json";
/// Version of the format of the pose file.
const FORMAT: u8 = 1;
/// Positions are rounded to 1 µrad, as in arm files. At the end of an arm that is one metre long, 1 µrad corresponds to
/// one micrometre.
const DECIMALS: f64 = 1e6;

/// Reason why a pose is not stored.
#[derive(Debug, thiserror::Error)]
pub enum PoseStoreError {
    /// The store of poses is full.
    #[error("the store is full: it has {POSES_MAX} poses, the maximum")]
    Full,
    /// The pose file has invalid contents.
    #[error("{}: {why}", path.display())]
    Form {
        /// Path of the pose file.
        path: PathBuf,
        /// Problem in the contents of the pose file.
        why: String,
    },
    /// The pose file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Path of the pose file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

impl host_kit::Diagnose for PoseStoreError {
    fn diagnosis(&self) -> host_kit::Diagnosis {
        let (kind, next) = match self {
            Self::Full => {
                (host_kit::ErrorKind::Refused, "delete an unused pose; GET /api/poses lists the poses")
            }
            Self::Form { .. } => {
                (host_kit::ErrorKind::Usage, "correct the file, or move it away to start without its poses")
            }
            Self::Io { .. } => (
                host_kit::ErrorKind::Usage,
                "free disk space, or choose another directory with `jtc serve --trajectories DIR`",
            ),
        };
        host_kit::Diagnosis::new(kind, "poses", next)
    }
}

/// Contents of the pose file.
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    format: u8,
    poses_rad: Poses,
}

/// Store of poses by name.
#[derive(Default)]
pub struct PoseStore {
    path: Option<PathBuf>,
    kept: Mutex<Poses>,
    /// Lock for writing the pose file. The lock is separate, so that readers never wait for the disk.
    writing: Mutex<()>,
}

impl PoseStore {
    /// Opens the pose file in a directory.
    ///
    /// # Errors
    ///
    /// The pose file cannot be read, or has invalid contents.
    pub fn open(directory: &Path) -> Result<Self, PoseStoreError> {
        let path = directory.join(FILE);
        let poses = match std::fs::read(&path) {
            Ok(bytes) => {
                understood(&bytes).map_err(|why| PoseStoreError::Form { path: path.clone(), why })?
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => Poses::new(),
            Err(source) => return Err(PoseStoreError::Io { path, source }),
        };
        Ok(Self { path: Some(path), kept: Mutex::new(poses), ..Self::default() })
    }

    /// Returns all stored poses.
    pub fn list(&self) -> Poses {
        self.lock().clone()
    }

    /// Stores a pose (joint positions in rad) under a valid name. A pose of the same name is replaced. Returns the
    /// rounded positions.
    ///
    /// # Errors
    ///
    /// A [`PoseStoreError`]; the stored pose of this name is then unchanged.
    pub fn put(&self, name: &str, position: &[f64; 6]) -> Result<[f64; 6], PoseStoreError> {
        let rounded = position.map(|v| (v * DECIMALS).round() / DECIMALS + 0.0);
        self.change(|poses| {
            poses.insert(name.to_owned(), rounded);
            if poses.len() > POSES_MAX { Err(PoseStoreError::Full) } else { Ok(rounded) }
        })
    }

    /// Deletes a pose. Returns `false` if the pose did not exist.
    ///
    /// # Errors
    ///
    /// The pose file cannot be written. If an error is returned, the pose is still stored.
    pub fn delete(&self, name: &str) -> Result<bool, PoseStoreError> {
        self.change(|poses| Ok(poses.remove(name).is_some()))
    }

    fn change<T>(
        &self,
        change: impl FnOnce(&mut Poses) -> Result<T, PoseStoreError>,
    ) -> Result<T, PoseStoreError> {
        let _writing = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let mut poses = self.list();
        let done = change(&mut poses)?;
        if let Some(path) = &self.path {
            let kept = Kept { format: FORMAT, poses_rad: poses.clone() };
            let io = |source| PoseStoreError::Io { path: path.clone(), source };
            let text = serde_json::to_vec_pretty(&kept).map_err(|e| io(e.into()))?;
            host_kit::write_atomically(path, &text).map_err(io)?;
        }
        *self.lock() = poses;
        Ok(done)
    }

    fn lock(&self) -> MutexGuard<'_, Poses> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Returns the poses that the bytes of a pose file contain.
fn understood(bytes: &[u8]) -> Result<Poses, String> {
    let Kept { format, poses_rad } = serde_json::from_slice(bytes).map_err(|e| e.to_string())?;
    if format != FORMAT {
        return Err(format!("format {format} is not supported: expected {FORMAT}"));
    }
    match poses_rad.keys().find(|name| !is_pose_name(name)) {
        Some(name) => Err(format!("{name:?} is not a valid pose name")),
        None if poses_rad.len() > POSES_MAX => Err(format!("too many poses: the limit is {POSES_MAX}")),
        None => Ok(poses_rad),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_outlast_the_agent_and_what_is_none_is_refused_whole() {
        let directory = tempfile::tempdir().expect("a directory");
        let open = || PoseStore::open(directory.path());
        let store = open().expect("it is empty");
        assert_eq!(store.put("home", &[0.123_456_78; 6]).expect("room"), [0.123_457; 6]);
        store.put("up", &[-0.0; 6]).expect("room");
        assert!(store.delete("up").expect("it is written") && !store.delete("up").expect("it is written"));
        assert_eq!(open().expect("its own file").list(), Poses::from([("home".into(), [0.123_457; 6])]));
        let path = directory.path().join(FILE);
        for wrong in [
            "",
            "{}",
            r#"{"format":2,"poses_rad":{}}"#,
            r#"{"format":1,"poses_rad":{"1":[0,0,0,0,0,0]}}"#,
            r#"{"format":1,"poses_rad":{"a":[0,0,0]}}"#,
        ] {
            std::fs::write(&path, wrong).expect("a file");
            let error = open().err().expect("it is none");
            assert!(error.to_string().contains(FILE), "{wrong}: {error}");
        }
    }

    #[test]
    fn there_is_room_for_so_many_and_one_that_is_there_can_be_changed() {
        let store = PoseStore::default();
        for n in 0..POSES_MAX {
            store.put(&format!("p{n}"), &[0.0; 6]).expect("room");
        }
        assert!(matches!(store.put("more", &[0.0; 6]), Err(PoseStoreError::Full)));
        store.put("p7", &[1.0; 6]).expect("it takes the place of what is there");
        assert_eq!((store.list().len(), store.list()["p7"]), (POSES_MAX, [1.0; 6]));
    }

    /// If the directory cannot be written, the poses in memory and on disk stay unchanged.
    #[test]
    fn a_disk_that_takes_nothing_leaves_what_is_kept() {
        let directory = tempfile::tempdir().expect("a directory");
        let store = PoseStore::open(directory.path()).expect("it is empty");
        store.put("home", &[0.1; 6]).expect("room");
        directory.close().expect("it is removed");
        assert!(matches!(store.put("home", &[0.2; 6]), Err(PoseStoreError::Io { .. })));
        assert!(matches!(store.delete("home"), Err(PoseStoreError::Io { .. })));
        assert_eq!(store.list()["home"], [0.1; 6]);
    }
}
