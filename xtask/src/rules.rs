//! Rule coverage: checks that a test in the Rust sources mentions each rule of the protocol pages.
use std::collections::BTreeSet;

use anyhow::{Context, Result, ensure};

use crate::shell::{files, root};

/// Protocol pages, each with the letter of its rules and the smallest expected number of rules.
const PAGES: [(&str, char, usize); 2] =
    [("docs/protocol-jtc.md", 'J', 30), ("docs/protocol-ucom.md", 'D', 30)];

/// Returns the numbers of the rules that a protocol page defines (`**J-13**`).
fn defined(page: &str, letter: char) -> BTreeSet<u32> {
    let start = format!("**{letter}-");
    page.split(&start).skip(1).filter_map(|rest| rest.split_once("**")?.0.parse().ok()).collect()
}

/// Returns the numbers of the rules that a source file mentions as `j13_…`, `J-13` or `j_13`, in upper or lower case.
fn named(source: &str, letter: char) -> BTreeSet<u32> {
    let mut rules = BTreeSet::new();
    let bytes = source.as_bytes();
    for (at, _) in source.match_indices([letter.to_ascii_lowercase(), letter]) {
        if at > 0 && (bytes[at - 1].is_ascii_alphanumeric()) {
            continue;
        }
        let rest = &source[at + 1..];
        let rest = rest.strip_prefix(['-', '_']).unwrap_or(rest);
        let digits = rest.len() - rest.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        if digits == 2
            && let Ok(rule) = rest[..2].parse()
        {
            rules.insert(rule);
        }
    }
    rules
}

/// Returns the part of a source file that contains tests: the complete file if it is in tests/, otherwise the part from
/// `#[cfg(test)]` on.
fn test_part<'a>(path: &std::path::Path, source: &'a str) -> &'a str {
    let is_test_file = path.components().any(|c| c.as_os_str() == "tests")
        || path.file_stem().is_some_and(|stem| stem.to_string_lossy().ends_with("tests"));
    if is_test_file {
        return source;
    }
    source.find("#[cfg(test)]").map_or("", |at| &source[at..])
}

/// Returns an error that lists the rules that no test mentions.
pub(crate) fn check() -> Result<()> {
    let mut tests = Vec::new();
    for directory in ["crates", "emulator", "firmware"] {
        for path in files(&root().join(directory), &["rs"]) {
            let source = std::fs::read_to_string(&path)?;
            tests.push(test_part(&path, &source).to_owned());
        }
    }
    let mut missing = Vec::new();
    for (page, letter, at_least) in PAGES {
        let text = std::fs::read_to_string(root().join(page)).context(page)?;
        let defined = defined(&text, letter);
        ensure!(defined.len() >= at_least, "{page} defines {} rules only", defined.len());
        let tested: BTreeSet<u32> = tests.iter().flat_map(|source| named(source, letter)).collect();
        missing.extend(defined.difference(&tested).map(|rule| format!("{letter}-{rule:02}")));
        println!("{page}: {} rules", defined.len());
    }
    ensure!(missing.is_empty(), "no test names {}", missing.join(", "));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_in_every_form() {
        assert_eq!(named("fn j13_saturates() {} // J-44, j_07, d22_x", 'J'), BTreeSet::from([7, 13, 44]));
        assert_eq!(named("obj13 j1 j130 J-", 'J'), BTreeSet::new());
        assert_eq!(named("fn d22_mask() {} // D-T17, D-07", 'D'), BTreeSet::from([7, 22]));
        assert_eq!(defined("- **J-01** a\n- **J-02**, see J-03, **D-04**", 'J'), BTreeSet::from([1, 2]));
    }
}
