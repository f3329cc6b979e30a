//! Descriptions of applications that were read before, by Program ID and flash date (D-36).

use std::path::PathBuf;

use ucom::master::io::IoDescription;
use ucom::master::{Outcome, Request};

use crate::args::CacheArgs;
use crate::commands::seen;
use crate::driver::{Driver, unexpected};
use crate::failure::Failure;

impl CacheArgs {
    /// Where descriptions are kept; `None` when there is no place for them.
    fn directory(&self) -> Option<PathBuf> {
        let base = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
        let of_user = || base("XDG_CACHE_HOME").or_else(|| base("HOME").map(|home| home.join(".cache")));
        self.cache.clone().or_else(|| of_user().map(|dir| dir.join("ucom")))
    }

    fn file(&self, (program_id, date): (u16, u16)) -> Option<PathBuf> {
        Some(self.directory()?.join(format!("io-{program_id:04X}-{date:04X}.json")))
    }

    /// The description of a board's application: known, or read from the board now. What cannot be kept is read anew next
    /// time: that is no error.
    pub fn describe(&self, driver: &mut Driver, board: u8) -> Result<IoDescription, Failure> {
        if let (Some(known), false) = (driver.master.description(board), self.fresh) {
            return Ok(known);
        }
        let seen = seen(driver, board)?;
        let key = (seen.info.program_id, seen.info.date);
        let file = self.file(key);
        if !self.fresh
            && let Some(text) = file.as_ref().and_then(|file| std::fs::read_to_string(file).ok())
            && let Ok(known) = serde_json::from_str::<IoDescription>(&text)
        {
            driver.master.know_description(key, known);
        }
        let description = match driver.run(Request::Describe { board, fresh: self.fresh })? {
            Outcome::Description { description, .. } => description,
            other => return Err(unexpected(&other)),
        };
        if let (Some(directory), Some(file), Ok(text)) =
            (self.directory(), file, serde_json::to_string_pretty(&description))
        {
            let _ = std::fs::create_dir_all(directory).and_then(|()| std::fs::write(file, text));
        }
        Ok(description)
    }
}
