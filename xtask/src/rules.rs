//! Rule coverage: every rule of docs/protocol-jtc.md is named by a test in the Rust sources.
use std::collections::BTreeSet;

use anyhow::{Context, Result, ensure};

use crate::shell::{files, root};

/// The rules that the protocol page defines (`**J-13**`), as numbers.
fn defined(page: &str) -> BTreeSet<u32> {
    page.split("**J-").skip(1).filter_map(|rest| rest.split_once("**")?.0.parse().ok()).collect()
}

/// The rules that a source names: `j13_…`, `J-13`, `j_13`, in either case.
fn named(source: &str) -> BTreeSet<u32> {
    let mut rules = BTreeSet::new();
    let bytes = source.as_bytes();
    for (at, _) in source.match_indices(['j', 'J']) {
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

/// The part of a source that is tests: a file under tests/, or from its `#[cfg(test)]` on.
fn test_part<'a>(path: &std::path::Path, source: &'a str) -> &'a str {
    let is_test_file = path.components().any(|c| c.as_os_str() == "tests")
        || path.file_stem().is_some_and(|stem| stem.to_string_lossy().ends_with("tests"));
    if is_test_file {
        return source;
    }
    source.find("#[cfg(test)]").map_or("", |at| &source[at..])
}

/// An error that lists the rules without a test.
pub fn check() -> Result<()> {
    let page =
        std::fs::read_to_string(root().join("docs/protocol-jtc.md")).context("docs/protocol-jtc.md")?;
    let defined = defined(&page);
    ensure!(defined.len() >= 30, "docs/protocol-jtc.md defines {} rules only", defined.len());
    let mut tested = BTreeSet::new();
    for path in files(&root().join("crates"), &["rs"]) {
        let source = std::fs::read_to_string(&path)?;
        tested.extend(named(test_part(&path, &source)));
    }
    let missing: Vec<String> = defined.difference(&tested).map(|rule| format!("J-{rule:02}")).collect();
    ensure!(missing.is_empty(), "no test names {}", missing.join(", "));
    println!("{} rules, each named by a test", defined.len());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_in_every_form() {
        assert_eq!(named("fn j13_saturates() {} // J-44, j_07"), BTreeSet::from([7, 13, 44]));
        assert_eq!(named("obj13 j1 j130 J-"), BTreeSet::new());
        assert_eq!(defined("- **J-01** a\n- **J-02**, see J-03"), BTreeSet::from([1, 2]));
    }
}
