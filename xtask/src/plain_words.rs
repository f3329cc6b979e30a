//! `cargo xtask plain-words`: counts marks in comments, messages, help and documents. A mark is a pattern of sentences
//! that are hard to read.
//!
//! The command stores the counts of each part of the project, and the counts may only decrease. CONTRIBUTING.md
//! explains how to write plain sentences.
mod marks;
mod texts;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{read_to_string, write};
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};

use crate::shell::{self, files, root};

/// File that contains the stored counts of marks.
const KEPT: &str = "xtask/plain-words.txt";
/// Extensions of the files that contain prose.
const EXTENSIONS: [&str; 7] = ["rs", "py", "pyi", "md", "toml", "ts", "svelte"];
/// Files that the command does not read: the changelog, and files that another project or a command has written.
const EXCLUDED: [&str; 3] = ["CHANGELOG.md", "Cargo.toml", "api-types.ts"];

/// Occurrence of a mark in a file.
struct Place {
    part: String,
    /// Path and line number of the mark.
    at: String,
    mark: &'static str,
    /// Sentence that contains the mark.
    sentence: String,
}

/// Runs `cargo xtask plain-words`. `arguments` is `--update`, or the name of a part whose marks the command prints.
pub(crate) fn main(arguments: &[String]) -> Result<ExitCode> {
    let mut arguments = arguments.to_vec();
    let update = shell::flag(&mut arguments, "--update");
    let part = arguments.pop();
    shell::nothing_left(&arguments)?;
    let places = places()?;
    for place in places.iter().filter(|place| part.as_ref().is_some_and(|part| *part == place.part)) {
        println!("{}: {}: {}", place.at, place.mark, place.sentence);
    }
    let counts = counts(&places);
    if update {
        let text = counts.iter().fold(String::new(), |mut text, (part, count)| {
            let _ = writeln!(text, "{part} {count}");
            text
        });
        write(root().join(KEPT), text).context(KEPT)?;
        println!("written to {KEPT}");
    } else if part.is_none() {
        for (mark, _) in marks::MARKS {
            println!("{:6} {mark}", places.iter().filter(|place| place.mark == mark).count());
        }
        compare(&counts, &kept()?)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns an error if a part of the project has more marks than its stored count.
pub(crate) fn check() -> Result<()> {
    compare(&counts(&places()?), &kept()?)
}

fn compare(now: &BTreeMap<String, usize>, kept: &BTreeMap<String, usize>) -> Result<()> {
    let (mut worse, mut better) = (Vec::new(), false);
    for (part, count) in now {
        let before = kept.get(part).copied().unwrap_or_default();
        better |= *count < before;
        if *count > before {
            worse.push(format!("{part}: {count} marks, {before} allowed"));
        }
    }
    println!("{} marks, {} allowed", now.values().sum::<usize>(), kept.values().sum::<usize>());
    ensure!(
        worse.is_empty(),
        "{}; `cargo xtask plain-words PART` lists the sentences, and CONTRIBUTING.md says how to write them",
        worse.join(", ")
    );
    if better {
        println!("keep the lower counts: cargo xtask plain-words --update");
    }
    Ok(())
}

fn kept() -> Result<BTreeMap<String, usize>> {
    let text = read_to_string(root().join(KEPT)).context(KEPT)?;
    let row = |line: &str| {
        let (part, count) = line.split_once(' ').context("a part and its count")?;
        Ok((part.to_owned(), count.parse()?))
    };
    text.lines().map(row).collect()
}

fn counts(places: &[Place]) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for place in places {
        *counts.entry(place.part.clone()).or_default() += 1;
    }
    counts
}

fn places() -> Result<Vec<Place>> {
    let mut places = Vec::new();
    for path in files(root(), &EXTENSIONS) {
        let name = path.strip_prefix(root()).unwrap_or(&path);
        if EXCLUDED.iter().any(|excluded| name.ends_with(excluded)) {
            continue;
        }
        let source = read_to_string(&path).with_context(|| path.display().to_string())?;
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        for text in texts::of(&source, &extension) {
            for (mark, offset) in marks::find(&text.words) {
                places.push(Place {
                    part: part(name),
                    at: format!("{}:{}", name.display(), text.line_at(offset)),
                    mark,
                    sentence: marks::sentence(&text.words, offset).to_owned(),
                });
            }
        }
    }
    Ok(places)
}

/// Returns the name of the crate that contains a file. For files outside of crates, returns the name of the folder. For
/// files in the root folder, returns `pages`.
fn part(path: &Path) -> String {
    let mut folders = path.iter().map(|folder| folder.to_string_lossy());
    let first = folders.next().unwrap_or_default();
    match folders.next() {
        Some(second) if first == "crates" => second.into_owned(),
        Some(_) => first.into_owned(),
        None => "pages".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_a_crate_or_a_folder() {
        for (path, name) in
            [("crates/ucom/src/lib.rs", "ucom"), ("docs/a.md", "docs"), ("README.md", "pages")]
        {
            assert_eq!(part(Path::new(path)), name);
        }
    }

    #[test]
    fn no_part_gets_more_marks_and_fewer_are_welcome() {
        let counts = |count| BTreeMap::from([("docs".to_owned(), count)]);
        assert!(compare(&counts(2), &counts(2)).is_ok() && compare(&counts(1), &counts(2)).is_ok());
        let worse = compare(&counts(3), &counts(2)).unwrap_err().to_string();
        assert!(worse.contains("docs: 3 marks, 2 allowed"), "{worse}");
        assert!(compare(&counts(1), &BTreeMap::new()).is_err(), "a new part begins without any");
    }
}
