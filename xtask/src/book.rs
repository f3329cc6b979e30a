//! `cargo xtask book`: builds an HTML book from docs/. Every test run checks the pages without building the book.
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, ensure};

use crate::shell::{self, Scratch, cargo, files, root, run};

/// Runs `cargo xtask book`. `arguments` may contain `--out DIR`.
pub(crate) fn main(arguments: &[String]) -> Result<ExitCode> {
    let mut arguments = arguments.to_vec();
    let out = shell::option(&mut arguments, "--out")?;
    shell::nothing_left(&arguments)?;
    check()?;
    make(&out.map_or_else(|| shell::target().join("book"), PathBuf::from))?;
    Ok(ExitCode::SUCCESS)
}

/// Returns a cargo command for the program that builds the book. This program has its own workspace, so that a build
/// of the project does not compile mdbook.
fn tool(words: &[&str]) -> Command {
    let mut cargo = cargo(words);
    cargo.args(["--quiet", "--locked", "--manifest-path"]).arg(root().join("book/Cargo.toml"));
    cargo.env("CARGO_TARGET_DIR", shell::target().join("book-tool"));
    cargo
}

/// Builds the program that builds the book, and the tests of this program.
pub(crate) fn build() -> Result<()> {
    run(&mut tool(&["build"]))?;
    run(&mut tool(&["test", "--no-run"]))
}

/// Builds the HTML book in a folder.
pub(crate) fn make(out: &Path) -> Result<()> {
    run(tool(&["run"]).arg("--").arg(root()).arg(out))
}

/// Tests the program that builds the book, builds the book, and checks all links of the book.
pub(crate) fn made() -> Result<()> {
    run(&mut tool(&["test"]))?;
    let scratch = Scratch::new("book")?;
    make(&scratch.path().join("book"))
}

/// Checks that every page of docs/ is in the book, and that every link to a section leads to a heading of the page. The function
/// also checks that the tests execute every block of commands, or that the page states why they do not execute the block.
pub(crate) fn check() -> Result<()> {
    let docs = root().join("docs");
    let summary = std::fs::read_to_string(docs.join("SUMMARY.md")).context("docs/SUMMARY.md")?;
    let listed: BTreeSet<&str> = targets(&summary).filter(|target| target.ends_with(".md")).collect();
    let pages = files(&docs, &["md"]);
    let names: BTreeSet<String> =
        pages.iter().filter_map(|page| Some(page.strip_prefix(&docs).ok()?.to_str()?.to_owned())).collect();
    let missing: Vec<&String> =
        names.iter().filter(|name| *name != "SUMMARY.md" && !listed.contains(name.as_str())).collect();
    ensure!(missing.is_empty(), "docs/SUMMARY.md leaves out {missing:?}");
    let (mut commands, mut left_out, mut wrong) = (0, 0, Vec::new());
    for path in pages.iter().chain([&root().join("README.md")]) {
        let page = std::fs::read_to_string(path)?;
        let name = path.strip_prefix(root()).unwrap_or(path).display().to_string();
        for (line, block) in blocks(&page) {
            match block {
                Block::Run => commands += 1,
                Block::LeftOut => left_out += 1,
                Block::Forgotten => wrong.push(format!(
                    "{name}:{line}: no test runs these commands; name the program (`<!-- commands: jtc -->` at the top of the page) \
                     or why not (`<!-- not run: REASON -->` above the block)"
                )),
            }
        }
        for target in targets(&page) {
            let Some((file, anchor)) = target.split_once('#').filter(|_| !target.contains("://")) else {
                continue;
            };
            let to = if file.is_empty() { path.clone() } else { path.parent().unwrap_or(root()).join(file) };
            let text = std::fs::read_to_string(&to).unwrap_or_default();
            if to.extension().is_some_and(|ending| ending == "md") && !anchors(&text).contains(anchor) {
                wrong.push(format!("{name}: no heading exists for {target}"));
            }
        }
    }
    ensure!(wrong.is_empty(), "{}", wrong.join("\n"));
    println!(
        "{} pages; {commands} blocks of commands are run by tests, {left_out} say why not",
        names.len() - 1
    );
    Ok(())
}

/// Returns the targets of the links in a page, without the links in fenced blocks.
fn targets(page: &str) -> impl Iterator<Item = &str> {
    prose(page).flat_map(|line| line.split("](").skip(1)).filter_map(|rest| Some(rest.split_once(')')?.0))
}

/// Returns the lines of a page that are not in a fenced block.
fn prose(page: &str) -> impl Iterator<Item = &str> {
    let mut fenced = false;
    page.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        fenced ^= fence;
        !fenced && !fence
    })
}

/// Returns the names of the headings of a page, in the form that links use.
fn anchors(page: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for heading in prose(page).filter(|line| line.starts_with('#')) {
        let words = heading.trim_start_matches('#').trim().to_lowercase();
        let kept = |c: &char| c.is_alphanumeric() || [' ', '-', '_'].contains(c);
        let name: String = words.chars().filter(kept).map(|c| if c == ' ' { '-' } else { c }).collect();
        let mut numbered = name.clone();
        for n in 1.. {
            if names.insert(numbered) {
                break;
            }
            numbered = format!("{name}-{n}");
        }
    }
    names
}

/// Specification of how tests treat a block of commands.
#[derive(Debug, PartialEq, Eq)]
enum Block {
    Run,
    LeftOut,
    Forgotten,
}

/// Returns the blocks of commands in a page, with the line number of the first line of each block.
fn blocks(page: &str) -> Vec<(usize, Block)> {
    let mut found = Vec::new();
    let (mut named, mut generated, mut fenced, mut above) = (false, false, false, "");
    for (number, line) in (1..).zip(page.lines().map(str::trim)) {
        if fenced {
            fenced = line != "```";
        } else if let Some(comment) = line.strip_prefix("<!--").and_then(|rest| rest.strip_suffix("-->")) {
            let comment = comment.trim();
            named |= comment.starts_with("commands:");
            generated = comment.ends_with(" begin") || (generated && !comment.ends_with(" end"));
        } else if let Some(kind) = line.strip_prefix("```") {
            fenced = true;
            // This module checks only these kinds of blocks, because the tests of the Python package run all Python
            // blocks.
            if ["console", "sh"].contains(&kind) {
                let own = above.contains("program:");
                found.push((
                    number,
                    match above.contains("not run:") {
                        true => Block::LeftOut,
                        false if named || generated || own => Block::Run,
                        false => Block::Forgotten,
                    },
                ));
            }
        }
        if !line.is_empty() {
            above = line;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_have_names() {
        let names = anchors("# A `b`, c\n## 2. D-e\n```\n# no heading\n```\n## 2. D-e\n");
        assert_eq!(names.into_iter().collect::<Vec<_>>(), ["2-d-e", "2-d-e-1", "a-b-c"]);
    }

    #[test]
    fn a_block_that_no_test_runs_is_found() {
        let forgotten = "```sh\na\n```\n";
        assert_eq!(blocks(forgotten), [(1, Block::Forgotten)]);
        assert_eq!(blocks(&format!("<!-- commands: jtc -->\n{forgotten}")), [(2, Block::Run)]);
        assert_eq!(blocks(&format!("<!-- not run: it takes a port -->\n{forgotten}")), [(2, Block::LeftOut)]);
        assert_eq!(blocks(&format!("<!-- a begin -->\n{forgotten}<!-- a end -->\n{forgotten}")).len(), 2);
        assert_eq!(blocks("```toml\na\n```\n"), []);
    }
}
