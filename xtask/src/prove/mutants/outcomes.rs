//! Stores the outcomes of mutants. After an interruption, the mutation test continues with the remaining mutants.
//! After a test was added, only the surviving mutants need to be tested again.
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, read_to_string, remove_file, write};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use serde_json::{Value, json};

use super::build::Mutant;
use crate::prove::evidence::Named;

/// Name of the file with the mutants of the crate.
const MUTANTS: &str = "mutants.json";
/// Name of the file with the outcomes, one line for each outcome. A later line replaces an earlier line for the same
/// mutant.
const OUTCOMES: &str = "outcomes.txt";
/// Name of the file with the commit that was tested.
const COMMIT: &str = "commit";

/// Result of the tests that ran on a mutant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Outcome {
    /// A test failed.
    Killed,
    /// A test did not end.
    Endless,
    /// All tests passed.
    Survived,
}

impl Outcome {
    const ALL: [(Self, &str); 3] =
        [(Self::Killed, "killed"), (Self::Endless, "endless"), (Self::Survived, "survived")];

    fn name(self) -> &'static str {
        Self::ALL.into_iter().find(|(outcome, _)| *outcome == self).map_or("", |(_, name)| name)
    }

    fn of(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|(_, known)| *known == name).map(|(outcome, _)| outcome)
    }
}

/// A mutant, its line in the source file, and its outcome.
pub(super) type Judged = (Named, u64, Outcome);

/// Outcomes of the mutants of a crate, with the file that contains them.
pub(super) struct Outcomes {
    folder: PathBuf,
    known: BTreeMap<String, Outcome>,
    file: File,
}

impl Outcomes {
    /// Opens the file of outcomes in `folder`. If `left` is `false`, the function removes all earlier outcomes. If
    /// `left` is `true`, it keeps the outcomes of mutants that tests have found, although the code and the tests
    /// could have changed since then.
    pub(super) fn open(folder: &Path, left: bool, commit: &str) -> Result<Self> {
        let path = folder.join(OUTCOMES);
        if !left && path.exists() {
            remove_file(&path).with_context(|| format!("cannot remove {}", path.display()))?;
        }
        write(folder.join(COMMIT), commit)?;
        let known = known(folder);
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let file = file.with_context(|| format!("cannot write {}", path.display()))?;
        Ok(Self { folder: folder.into(), known, file })
    }

    /// Writes the list of the mutants of the crate.
    pub(super) fn list(&self, mutants: &[Mutant]) -> Result<()> {
        let list: Vec<Value> = mutants
            .iter()
            .map(|mutant| {
                let Named { file, line, change } = &mutant.named;
                json!({ "id": mutant.id, "file": file, "at": mutant.at, "line": line, "change": change })
            })
            .collect();
        let path = self.folder.join(MUTANTS);
        write(&path, Value::from(list).to_string())
            .with_context(|| format!("cannot write {}", path.display()))
    }

    /// Returns `true` if the tests must run on this mutant: it has no outcome, or it survived.
    pub(super) fn is_left(&self, id: &str) -> bool {
        self.known.get(id).is_none_or(|outcome| *outcome == Outcome::Survived)
    }

    /// Adds the outcome of a mutant.
    pub(super) fn add(&mut self, id: &str, outcome: Outcome) -> Result<()> {
        writeln!(self.file, "{id} {}", outcome.name()).context("cannot write the outcomes of the mutants")
    }
}

/// Reads the outcomes in `folder`.
fn known(folder: &Path) -> BTreeMap<String, Outcome> {
    let text = read_to_string(folder.join(OUTCOMES)).unwrap_or_default();
    let lines = text.lines().filter_map(|line| line.split_once(' '));
    lines.filter_map(|(id, name)| Some((id.to_owned(), Outcome::of(name)?))).collect()
}

/// Reads the mutants of a crate with their source lines and outcomes, and the commit that was tested. Returns `None` if
/// this computer has no results of the crate.
///
/// # Errors
///
/// Returns an error if mutants have no outcome.
pub(super) fn read(folder: &Path) -> Result<Option<(Vec<Judged>, String)>> {
    let Ok(text) = read_to_string(folder.join(MUTANTS)) else { return Ok(None) };
    let list: Vec<Value> = serde_json::from_str(&text)?;
    let known = known(folder);
    let mut outcomes = Vec::new();
    for mutant in &list {
        let text = |key: &str| mutant[key].as_str().unwrap_or_default().to_owned();
        let named = Named { file: text("file"), line: text("line"), change: text("change") };
        if let Some(outcome) = known.get(&text("id")) {
            outcomes.push((named, mutant["at"].as_u64().unwrap_or(1), *outcome));
        }
    }
    let missing = list.len() - outcomes.len();
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    ensure!(
        missing == 0,
        "{missing} mutants of {name} have no outcome: cargo xtask prove mutants --package {name} --left"
    );
    Ok(Some((outcomes, read_to_string(folder.join(COMMIT)).unwrap_or_default())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell::Scratch;

    #[test]
    fn a_survivor_that_a_new_test_kills_is_killed_from_then_on() {
        let folder = Scratch::new("outcomes").unwrap();
        let mutant = |id: &str| Mutant {
            id: id.into(),
            ordinal: 1,
            named: Named { file: "a.rs".into(), line: "a < b".into(), change: "replace < with <=".into() },
            at: 7,
        };
        assert!(read(folder.path()).unwrap().is_none());
        let mut first = Outcomes::open(folder.path(), false, "abc").unwrap();
        first.list(&[mutant("a"), mutant("b"), mutant("c")]).unwrap();
        first.add("a", Outcome::Killed).unwrap();
        first.add("b", Outcome::Survived).unwrap();
        let error = read(folder.path()).unwrap_err().to_string();
        assert!(error.starts_with("1 mutants of "), "{error}");

        let mut then = Outcomes::open(folder.path(), true, "def").unwrap();
        assert_eq!(["a", "b", "c"].map(|id| then.is_left(id)), [false, true, true]);
        then.add("b", Outcome::Killed).unwrap();
        then.add("c", Outcome::Endless).unwrap();
        let (outcomes, commit) = read(folder.path()).unwrap().unwrap();
        assert_eq!(commit, "def");
        let outcomes: Vec<Outcome> = outcomes.into_iter().map(|(_, _, outcome)| outcome).collect();
        assert_eq!(outcomes, [Outcome::Killed, Outcome::Killed, Outcome::Endless]);

        let all = Outcomes::open(folder.path(), false, "ghi").unwrap();
        assert!(["a", "b", "c"].into_iter().all(|id| all.is_left(id)));
    }
}
