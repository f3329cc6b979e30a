//! Bus session of a command: bus and profile, Ctrl-C, and notes on stderr.

use cli_kit::{Diagnose, Failure, Lines, Stop};
use serde_json::{Value, json};
use ucom::Profile;
use ucom_host::ProfileFile;
use ucom_host::master::{Error, IdentityError, Master};
use ucom_host::session::{CleanupList, Driver, Link, Operator};

use crate::args::LinkArgs;
use crate::interrupt::listen;

struct Console {
    stop: Stop,
    notes: Lines,
}

impl Operator for Console {
    fn stop_asked(&self) -> bool {
        self.stop.asked()
    }

    fn note(&self, text: String) {
        self.notes.push(text);
    }
}

impl LinkArgs {
    /// Returns the protocol profile, or the default profile if the user selects no file.
    pub(crate) fn profile(&self) -> Result<Profile, Failure> {
        let Some(path) = &self.profile else { return Ok(Profile::default()) };
        let text =
            std::fs::read_to_string(path).map_err(|e| Failure::usage(format!("{}: {e}", path.display())))?;
        Profile::from_toml(&text).map_err(|e| {
            Failure::usage(format!("{}: {e}", path.display())).next("ucom help profile lists every key")
        })
    }

    /// Returns the URL of the bus.
    pub(crate) fn url(&self) -> Result<&str, Failure> {
        self.bus.as_deref().ok_or_else(|| {
            Failure::usage("no bus is selected: neither --bus URL nor UCOM_BUS is given").next(
                "give a bus, such as --bus socketcan:can0; ucom sim makes a simulated bus and prints its URL",
            )
        })
    }

    /// Opens the bus that the user has selected.
    pub(crate) fn open(&self) -> Result<Link, Failure> {
        Ok(Link::open(self.url()?)?)
    }

    /// Opens a session on the bus that the user has selected.
    pub(crate) fn session(&self) -> Result<Driver, Failure> {
        self.session_with(self.profile()?)
    }

    /// Like [`Self::session`], but with another profile than the one of the command line.
    pub(crate) fn session_with(&self, profile: Profile) -> Result<Driver, Failure> {
        let cleanup = CleanupList::default();
        let console = Console { stop: listen(&cleanup)?, notes: Lines::stderr()? };
        Ok(Driver::new(profile, self.open()?, Box::new(console), cleanup))
    }
}

/// Returns the board numbers that two boards share, in the format for `--json`.
pub(crate) fn shared_numbers(master: &Master) -> Vec<Value> {
    let value = |e: &Error| {
        let Error::Identity(IdentityError::NumberShared { board, found, .. }) = e else { return Value::Null };
        json!({ "board": board, "flash_numbers": found, "code": e.code(), "message": e.to_string(), "hint": e.hint() })
    };
    master.shared_numbers().iter().map(value).collect()
}
