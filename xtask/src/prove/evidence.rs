//! Reads and updates docs/evidence.md. The page contains generated tables between marks, and explanations of mutants
//! that tests cannot detect.
use std::collections::BTreeSet;
use std::fs::{read_to_string, write};

use anyhow::{Context, Result};

use crate::shell::root;

const PAGE: &str = "docs/evidence.md";

/// Returns the text of docs/evidence.md.
pub(super) fn read() -> Result<String> {
    read_to_string(root().join(PAGE)).with_context(|| format!("cannot read {PAGE}"))
}

/// Replaces the text of the page between the marks `<!-- name -->` and `<!-- end of name -->`.
pub(super) fn replace(name: &str, table: &str) -> Result<()> {
    let page = read()?;
    let (before, rest) = parts(&page, name)?;
    let (_, after) = rest;
    let page = format!("{before}\n{}\n{after}", table.trim_end());
    write(root().join(PAGE), page).with_context(|| format!("cannot write {PAGE}"))
}

/// Returns the text between the marks of `name`.
pub(super) fn table(page: &str, name: &str) -> Result<String> {
    Ok(parts(page, name)?.1.0.trim().to_owned())
}

/// Splits the page at two marks into three parts. The first part ends with the first mark, and the third part begins
/// with the second mark.
fn parts<'a>(page: &'a str, name: &str) -> Result<(&'a str, (&'a str, &'a str))> {
    let (open, close) = (format!("<!-- {name} -->"), format!("<!-- end of {name} -->"));
    let missing = || format!("{PAGE} lacks `{open}` … `{close}`");
    let start = page.find(&open).with_context(missing)? + open.len();
    let end = start + page[start..].find(&close).with_context(missing)?;
    Ok((&page[..start], (&page[start..end], &page[end..])))
}

/// Identification of a mutant by its file, its source line and its change. The identification does not depend on line
/// numbers.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Named {
    /// Path of the source file, relative to the root of the workspace.
    pub file: String,
    /// Source line in which the mutant begins, without indentation.
    pub line: String,
    /// Change of the source in the words of cargo-gamma.
    pub change: String,
}

/// Returns the mutants that the page explains as equivalent. The explanations are the items ``- `LINE` → `CHANGE`: sentence``
/// below a heading `### FILE`.
pub(super) fn explained(page: &str) -> BTreeSet<Named> {
    let mut file = "";
    let mut explained = BTreeSet::new();
    for text in page.lines() {
        if let Some(heading) = text.strip_prefix("### ") {
            file = heading.trim();
        }
        let item = text.strip_prefix("- `").and_then(|rest| rest.split_once("` → `"));
        let Some((line, rest)) = item else { continue };
        // A mutant without an explaining sentence counts as not explained.
        let Some((change, sentence)) = rest.split_once("`: ") else { continue };
        if !sentence.trim().is_empty() {
            explained.insert(Named { file: file.into(), line: line.into(), change: change.into() });
        }
    }
    explained
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_has_its_tables_and_names_files_that_are_there() {
        let page = read().unwrap();
        for name in ["mutants", "fuzz"] {
            assert!(table(&page, name).unwrap().starts_with('|'), "{name}");
        }
        for named in explained(&page) {
            let source = read_to_string(root().join(&named.file)).unwrap_or_default();
            assert!(source.lines().any(|line| line.trim() == named.line), "{PAGE}: {named:?} is no more");
        }
    }

    #[test]
    fn only_items_with_a_sentence_explain() {
        let page = "### a.rs\n- `x < y` → `replace x < y with x <= y`: equal ones are sorted before.\n- `z` → `gone`: \n";
        let named =
            Named { file: "a.rs".into(), line: "x < y".into(), change: "replace x < y with x <= y".into() };
        assert_eq!(explained(page), BTreeSet::from([named]));
    }
}
