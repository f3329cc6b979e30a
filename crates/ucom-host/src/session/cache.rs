//! Cache that stores data between sessions, as small files in a directory.
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};

/// Size limit of a file that is read in advance, in bytes.
const FILE_MAX: u64 = 1 << 20;
/// Limit of files that wait until the writer thread writes them. If the limit is reached, further files are not written to the disk.
const WAITING_MAX: usize = 64;

/// Cache of signal names, and a flag to ignore the cached names.
#[derive(Clone, Debug, Default)]
pub struct Cache {
    place: Place,
    /// `true` to request the names from the boards although the names are cached.
    pub fresh: bool,
}

#[derive(Clone, Debug, Default)]
enum Place {
    /// The session has no cache directory.
    #[default]
    Nowhere,
    Directory(PathBuf),
    Memory(Memory),
}

/// Contents of the cache files in memory, and the channel to the thread that writes new files.
#[derive(Clone, Debug)]
struct Memory {
    texts: Arc<Mutex<BTreeMap<String, String>>>,
    writer: SyncSender<(String, String)>,
}

impl Cache {
    /// Creates a cache in this directory. If the directory is `None`, the session has no cache.
    pub fn new(directory: Option<PathBuf>, fresh: bool) -> Self {
        Self { place: directory.map_or(Place::Nowhere, Place::Directory), fresh }
    }

    /// Converts the cache for a caller that must never wait for a disk. The function reads all files now; a separate thread writes new
    /// files.
    #[must_use]
    pub fn in_memory(self) -> Self {
        let Self { place: Place::Directory(directory), fresh } = self else { return self };
        let texts = Arc::new(Mutex::new(all(&directory)));
        let (writer, written) = sync_channel::<(String, String)>(WAITING_MAX);
        // The writer thread ends after the last clone of this cache is dropped, but the program does not wait for the
        // thread. If data are not stored in time, the next session reads them from the boards again.
        std::thread::spawn(move || written.iter().for_each(|(name, text)| write(&directory, &name, text)));
        Self { place: Place::Memory(Memory { texts, writer }), fresh }
    }

    /// Returns a cache that ignores the stored names, so that the names are requested from the boards again.
    pub(super) fn refreshed(&self) -> Self {
        Self { fresh: true, ..self.clone() }
    }

    /// Reads a file of the cache; returns `None` if the file does not exist or cannot be read.
    pub(super) fn read(&self, name: &str) -> Option<String> {
        match &self.place {
            Place::Nowhere => None,
            Place::Directory(directory) => fs::read_to_string(directory.join(name)).ok(),
            Place::Memory(memory) => {
                memory.texts.lock().unwrap_or_else(PoisonError::into_inner).get(name).cloned()
            }
        }
    }

    /// Stores a file in the cache. The function ignores an error that occurs while the file is written.
    pub(super) fn write(&self, name: String, text: String) {
        match &self.place {
            Place::Nowhere => {}
            Place::Directory(directory) => write(directory, &name, text),
            Place::Memory(Memory { texts, writer }) => {
                texts.lock().unwrap_or_else(PoisonError::into_inner).insert(name.clone(), text.clone());
                // The cache does not wait for a slow disk.
                let _ = writer.try_send((name, text));
            }
        }
    }
}

fn write(directory: &Path, name: &str, text: String) {
    let _ = fs::create_dir_all(directory).and_then(|()| fs::write(directory.join(name), text));
}

fn all(directory: &Path) -> BTreeMap<String, String> {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    let text = |entry: fs::DirEntry| {
        let name = entry.file_name().into_string().ok().filter(|name| name.ends_with(".json"))?;
        // The cache reads only regular files. Reading from other kinds of files could block endlessly.
        let about = entry.metadata().ok().filter(|about| about.is_file() && about.len() <= FILE_MAX);
        about.and_then(|_| Some((name, fs::read_to_string(entry.path()).ok()?)))
    };
    entries.filter_map(text).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_in_memory_comes_from_the_directory_and_gets_there() {
        let dir = tempfile::tempdir().unwrap();
        let on_disk = Cache::new(Some(dir.path().join("new")), false);
        on_disk.write("a.json".into(), "1".into());
        let cache = on_disk.clone().in_memory();
        // The cache in memory has read all files already, so this change on the disk has no effect on it.
        on_disk.write("a.json".into(), "2".into());
        assert_eq!(cache.read("a.json").as_deref(), Some("1"));
        cache.write("b.json".into(), "3".into());
        assert_eq!(cache.read("b.json").as_deref(), Some("3"));
        let begun = std::time::Instant::now();
        while on_disk.read("b.json").as_deref() != Some("3") {
            assert!(begun.elapsed().as_secs() < 60, "never written");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        assert!(Cache::default().in_memory().read("a.json").is_none());
    }
}
