//! Names of boards' inputs, outputs and parameters that were read before (D-36), and what their words mean (D-11).

use std::path::{Path, PathBuf};

use ucom::{BoardInfo, Profile};
use ucom_host::files::{BoardSignals, SignalTable};
use ucom_host::master::io::{DescriptionKey, IoDescription};
use ucom_host::master::{Outcome, Request};

use crate::args::{Boards, CacheArgs, LinkArgs};
use crate::commands::seen;
use crate::driver::{Driver, unexpected};
use crate::failure::Failure;

/// The signal table that is taken without being named.
const SIGNAL_TABLE: &str = "ucom-edges.toml";

/// A board, its names, and what its words mean.
#[derive(Clone, Debug)]
pub struct Known {
    /// Its number.
    pub board: u8,
    /// Its answer to PC_INFO.
    pub info: BoardInfo,
    /// Its names.
    pub names: IoDescription,
    /// Types, scales and units.
    pub signals: BoardSignals,
    /// Where signal table and program do not fit.
    strays: Vec<String>,
}

/// A board of several whose application is not started is seldom the only one.
pub fn of_several(failure: Failure, boards: &Boards) -> Failure {
    let list = match boards {
        Boards::Some(numbers) if numbers.len() > 1 => {
            numbers.iter().map(u8::to_string).collect::<Vec<_>>().join(",")
        }
        Boards::All => "all".into(),
        _ => return failure,
    };
    match failure.code.as_str() {
        "no-application" if !failure.hint.contains("update") => failure.hint(format!("`ucom start {list}`")),
        _ => failure,
    }
}

impl LinkArgs {
    /// The signal table; without a file an empty one.
    pub fn signal_table(&self) -> Result<SignalTable, Failure> {
        let here = Path::new(SIGNAL_TABLE);
        let path = match &self.edges {
            Some(path) => path,
            None if here.exists() => here,
            None => return Ok(SignalTable::default()),
        };
        SignalTable::read(path).map_err(|e| Failure::usage(e).hint("ucom help edges shows the form"))
    }
}

impl CacheArgs {
    /// Where things are remembered; `None` when there is no place for them.
    pub fn directory(&self) -> Option<PathBuf> {
        let base = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
        let of_user = || base("XDG_CACHE_HOME").or_else(|| base("HOME").map(|home| home.join(".cache")));
        self.cache.clone().or_else(|| of_user().map(|dir| dir.join("ucom")))
    }

    fn file(&self, key: DescriptionKey) -> Option<PathBuf> {
        let DescriptionKey { program_id, date, flash_number } = key;
        Some(self.directory()?.join(format!("io-{program_id:04X}-{date:04X}-{flash_number:04X}.json")))
    }

    /// A board with its names. They are known from before, or its application runs and is asked; what cannot be kept is
    /// read anew next time: that is no error.
    pub fn known(&self, driver: &mut Driver, table: &SignalTable, board: u8) -> Result<Known, Failure> {
        let info = seen(driver, board)?.info;
        if let Some(names) = self.kept(driver, &info) {
            return Ok(with_signals(board, info, names, table, driver.master.profile()).with_notes(driver));
        }
        self.described(driver, table, board)
    }

    /// The same for a board whose application must run: it is asked, for what is kept may be of another application.
    pub fn described(&self, driver: &mut Driver, table: &SignalTable, board: u8) -> Result<Known, Failure> {
        let info = seen(driver, board)?.info;
        let names = match driver.run(Request::Describe { board, fresh: self.fresh })? {
            Outcome::Description { description, .. } => description,
            other => return Err(unexpected(&other)),
        };
        if let (Some(directory), Some(file), Ok(text)) =
            (self.directory(), self.file(DescriptionKey::of(&info)), serde_json::to_string_pretty(&names))
        {
            let _ = std::fs::create_dir_all(directory).and_then(|()| std::fs::write(file, text));
        }
        Ok(with_signals(board, info, names, table, driver.master.profile()).with_notes(driver))
    }

    /// What is known of a program without asking for it.
    fn kept(&self, driver: &mut Driver, info: &BoardInfo) -> Option<IoDescription> {
        let key = DescriptionKey::of(info);
        if self.fresh || !info.has_application() {
            return None;
        }
        if let Some(names) = driver.master.descriptions().remove(&key) {
            return Some(names);
        }
        let text = std::fs::read_to_string(self.file(key)?).ok()?;
        let names: IoDescription = serde_json::from_str(&text).ok()?;
        driver.master.know_description(key, names.clone());
        Some(names)
    }
}

impl Known {
    /// The same board by the names that it has sent since.
    pub fn renamed(self, names: IoDescription, table: &SignalTable, profile: Profile) -> Self {
        if self.names == names { self } else { with_signals(self.board, self.info, names, table, profile) }
    }
}

impl Known {
    /// Prints where signal table and program do not fit.
    fn with_notes(self, driver: &Driver) -> Self {
        for stray in &self.strays {
            driver.note(format!("signal table: {stray}"));
        }
        self
    }
}

fn with_signals(
    board: u8,
    info: BoardInfo,
    names: IoDescription,
    table: &SignalTable,
    profile: Profile,
) -> Known {
    let who = format!("program 0x{:04X} (board {board})", info.program_id);
    let program = table.program(info.program_id).filter(|_| info.has_application());
    let strays = program.map(|p| p.strays(&names)).unwrap_or_default();
    let mut strays: Vec<String> = strays.iter().map(|stray| format!("{who} has no {stray}")).collect();
    let mut signals = BoardSignals::new(&names, program, &profile);
    // Who gives a table thinks in its units: numbers for a program that is not in it would be sent as they are.
    if table.is_given() && program.is_none() && info.has_application() {
        strays.push(format!("it knows nothing of {who}"));
        signals = signals.raw_only();
    }
    Known { board, info, names, signals, strays }
}
