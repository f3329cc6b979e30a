//! Cache of board information and signal names (D-11), in the folder that the command line specifies.

use cli_kit::Failure;
use host_kit::user_folder;
use std::path::{Path, PathBuf};

use ucom_host::files::SignalTable;
use ucom_host::session::Cache;

use crate::args::{CacheArgs, LinkArgs};

/// Path of the default signal table.
const SIGNAL_TABLE: &str = "ucom-edges.toml";

impl LinkArgs {
    /// Loads the signal table. If the user specifies no file and the default file does not exist, the
    /// signal table is empty.
    pub(crate) fn signal_table(&self) -> Result<SignalTable, Failure> {
        let here = Path::new(SIGNAL_TABLE);
        let path = match &self.edges {
            Some(path) => path,
            None if here.exists() => here,
            None => return Ok(SignalTable::default()),
        };
        SignalTable::read(path).map_err(|e| Failure::usage(e).next("ucom help edges shows the form"))
    }
}

impl CacheArgs {
    /// Returns the cache of signal names.
    pub(crate) fn cache(&self) -> Cache {
        Cache::new(self.directory(), self.fresh)
    }

    /// Returns the folder of the cache; `None` if the folder cannot be determined.
    fn directory(&self) -> Option<PathBuf> {
        self.cache.clone().or_else(|| Some(user_folder("XDG_CACHE_HOME", ".cache")?.join("ucom")))
    }
}
