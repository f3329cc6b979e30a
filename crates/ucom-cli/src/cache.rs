//! What is remembered of boards, and what their words mean (D-11), as the command line names it.

use cli_kit::Failure;
use host_kit::user_folder;
use std::path::{Path, PathBuf};

use ucom_host::files::SignalTable;
use ucom_host::session::Cache;

use crate::args::{CacheArgs, LinkArgs};

/// The signal table that is taken without being named.
const SIGNAL_TABLE: &str = "ucom-edges.toml";

impl LinkArgs {
    /// The signal table; without a file an empty one.
    pub fn signal_table(&self) -> Result<SignalTable, Failure> {
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
    /// Where names are remembered.
    pub fn cache(&self) -> Cache {
        Cache::new(self.directory(), self.fresh)
    }

    /// Where things are remembered; `None` when there is no place for them.
    fn directory(&self) -> Option<PathBuf> {
        self.cache.clone().or_else(|| Some(user_folder("XDG_CACHE_HOME", ".cache")?.join("ucom")))
    }
}
