//! Source changes since the last mutation test. The command tests only the mutants in changed parts again, and keeps
//! the results of the other mutants.
use std::collections::BTreeMap;
use std::fs::{read_to_string, write};
use std::path::Path;

use anyhow::{Context, Result};
use serde_json::{Value, json};

use crate::shell::{command, root};

/// Changes of a source file since its last mutation test, from `git diff -U0`.
pub(super) struct Changes {
    pub(super) diff: String,
    /// Changed pieces, each with the first old line, the number of old lines and the number of new lines.
    pieces: Vec<(u64, u64, u64)>,
}

impl Changes {
    /// Compares the file `old` with the current file.
    fn of(old: &Path, file: &str) -> Result<Self> {
        let mut git = command("git");
        git.args(["diff", "--no-index", "-U0"]).arg(old).arg(file);
        // The exit code of `git diff` is 1 if the files differ.
        let diff = String::from_utf8(git.output().context("cannot start git")?.stdout)?;
        Ok(Self { pieces: diff.lines().filter_map(piece).collect(), diff })
    }

    /// Returns the current line number of an old line. Returns `None` if the line was changed or removed.
    fn now(&self, line: u64) -> Option<u64> {
        let mut shifted = line;
        for &(first, old, new) in &self.pieces {
            // If a piece has no old lines, its new lines are inserted after the line `first`.
            let first = if old == 0 { first + 1 } else { first };
            if line < first {
                break;
            }
            if line < first + old {
                return None;
            }
            shifted = shifted + new - old;
        }
        Some(shifted)
    }
}

/// Parses a header of a diff such as `@@ -12,2 +13 @@`. Returns the first old line, the number of old lines and the
/// number of new lines.
fn piece(line: &str) -> Option<(u64, u64, u64)> {
    let (old, new) = line.strip_prefix("@@ -")?.split_once(" +")?;
    let new = new.split(' ').next()?;
    let count = |text: &str| text.split_once(',').map_or(Some(1), |(_, n)| n.parse().ok());
    Some((old.split(',').next()?.parse().ok()?, count(old)?, count(new)?))
}

/// Returns the changes of the source files in a report. The report contains the old sources of the files. The result
/// does not contain deleted files.
pub(super) fn changes(results: &Path, report: &Value) -> Result<BTreeMap<String, Changes>> {
    let old = results.join("old.rs");
    let mut all = BTreeMap::new();
    for (file, content) in report["files"].as_object().into_iter().flatten() {
        if root().join(file).is_file() {
            write(&old, content["source"].as_str().unwrap_or_default())
                .with_context(|| format!("cannot write {}", old.display()))?;
            all.insert(file.clone(), Changes::of(&old, file)?);
        }
    }
    Ok(all)
}

/// Completes a report about changed parts with the results of unchanged parts from the previous report.
pub(super) fn complete(part: &mut Value, before: Value, changes: &BTreeMap<String, Changes>) -> Result<()> {
    let Value::Object(files) = &mut part["files"] else { return Ok(()) };
    for (file, changes) in changes {
        let source = read_to_string(root().join(file)).with_context(|| format!("cannot read {file}"))?;
        let new = files.entry(file.clone()).or_insert_with(|| json!({ "language": "rust", "mutants": [] }));
        new["source"] = source.into();
        let Value::Array(new) = &mut new["mutants"] else { continue };
        for mut mutant in before["files"][file]["mutants"].as_array().into_iter().flatten().cloned() {
            let line = |mutant: &Value, end: &str| mutant["location"][end]["line"].as_u64();
            let now = ["start", "end"].map(|end| line(&mutant, end).and_then(|line| changes.now(line)));
            let [Some(start), Some(end)] = now else { continue };
            mutant["location"]["start"]["line"] = start.into();
            mutant["location"]["end"]["line"] = end.into();
            let same = |other: &Value| {
                other["location"] == mutant["location"] && other["description"] == mutant["description"]
            };
            if !new.iter().any(same) {
                new.push(mutant);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_followed_through_what_has_changed() {
        let diff = "@@ -3 +3,2 @@\n-a\n+b\n+c\n@@ -5,0 +7 @@\n+d\n@@ -8,2 +9,0 @@\n-e\n-f\n";
        let changes = Changes { pieces: diff.lines().filter_map(piece).collect(), diff: diff.into() };
        let now: Vec<_> = (1..=11).map(|line| changes.now(line)).collect();
        let some = [1, 2, 0, 5, 6, 8, 9, 0, 0, 10, 11].map(|line| (line > 0).then_some(line));
        assert_eq!(now, some);
    }

    #[test]
    fn what_has_not_changed_is_as_it_was() {
        let mutant = |line: u64, what: &str, status: &str| {
            let place = json!({ "line": line, "column": 1 });
            json!({ "location": { "start": place, "end": place }, "description": what, "status": status })
        };
        let file = "xtask/src/prove.rs";
        let report = |mutants: &[Value]| json!({ "files": { file: { "source": "", "mutants": mutants } } });
        let before =
            report(&[mutant(2, "a", "Killed"), mutant(3, "b", "Survived"), mutant(5, "c", "Survived")]);
        let mut part = report(&[mutant(3, "d", "Killed"), mutant(7, "c", "Killed")]);
        let diff = "@@ -3 +3,3 @@".to_owned();
        let changes = Changes { pieces: diff.lines().filter_map(piece).collect(), diff };
        complete(&mut part, before, &BTreeMap::from([(file.into(), changes)])).unwrap();
        let all = [mutant(3, "d", "Killed"), mutant(7, "c", "Killed"), mutant(2, "a", "Killed")];
        assert_eq!(part["files"][file]["mutants"], json!(all));
    }
}
