//! Licences of all parts of a release, with their texts.
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use super::dashboard;
use super::graph::{Crate, Graph};
use crate::shell;

/// Beginnings of the names of licence files in crates.
const NAMES: [&str; 5] = ["licen", "copying", "unlicense", "notice", "copyright"];

/// Folders of a crate whose files do not become part of a program.
const NOT_SHIPPED: [&str; 7] = ["tests", "test", "examples", "benches", "fuzz", "target", "node_modules"];

/// Returns a licence as an SPDX expression. Old manifests contain `/` instead of `OR`.
pub(crate) fn expression(licence: &str) -> String {
    licence.split('/').map(str::trim).collect::<Vec<_>>().join(" OR ")
}

/// Returns THIRD-PARTY.txt: a list of all crates and libraries with their licences, followed by the licence texts, each
/// text once. Returns an error for a crate without a licence.
pub(crate) fn third_party(graph: &Graph) -> Result<String> {
    let mut list =
        String::from("openjtc contains what others wrote. Their licences, and below them the texts.\n\n");
    let mut texts = Texts::default();
    for found in graph.foreign() {
        let label = format!("{} {}", found.name, found.version);
        let licence = found.licence.as_deref();
        let licence = licence.with_context(|| format!("{label} names no licence; it cannot be shipped"))?;
        // Some licences require that the list contains the address of the source.
        let source = format!("https://crates.io/crates/{}/{}", found.name, found.version);
        writeln!(list, "{label}: {}, {source}", expression(licence))?;
        texts.of(found, &label)?;
    }
    for library in dashboard::libraries()? {
        let label = format!("{} {}", library.name, library.version);
        writeln!(list, "{label} (dashboard): {}", library.licence)?;
        texts.add(&label, &library.text);
    }
    runtime(&mut list, &mut texts)?;
    for (text, labels) in texts.0 {
        write!(list, "\n{}\n{}\n\n{}\n", "=".repeat(100), labels.join(", "), text)?;
    }
    Ok(list)
}

/// Components, in addition to crates, that the compiler and the linker add to programs.
pub(crate) const RUNTIME: [(&str, &str); 3] = [
    ("musl", "MIT"),
    ("llvm-libunwind", "Apache-2.0 WITH LLVM-exception"),
    ("llvm-compiler-rt", "Apache-2.0 WITH LLVM-exception"),
];

/// Lists the standard library of Rust, and the entries of [`RUNTIME`].
fn runtime(list: &mut String, texts: &mut Texts) -> Result<()> {
    let version = shell::read(shell::command("rustc").arg("--version"))?;
    let version = version.split(' ').nth(1).unwrap_or_default().to_owned();
    let label = format!("Rust's standard library {version}");
    writeln!(list, "{label}: MIT OR Apache-2.0")?;
    // For the Apache licence of Rust, the code uses the licence file of this project, which has the same text.
    let apache = std::fs::read_to_string(shell::root().join("LICENSE-APACHE"))?;
    texts.add(&label, &apache);
    for (name, licence) in RUNTIME {
        writeln!(list, "{name}, as Rust and Zig bring it: {licence}")?;
        if licence == "MIT" {
            texts.add(name, include_str!("../../packaging/licences/musl.txt"));
        } else {
            texts.add(name, &apache);
            texts.add(name, include_str!("../../packaging/licences/llvm-exception.txt"));
        }
    }
    Ok(())
}

/// Licence texts in the order of their first use. Each entry also contains the labels of the parts under this licence.
#[derive(Default)]
struct Texts(Vec<(String, Vec<String>)>);

impl Texts {
    fn add(&mut self, label: &str, text: &str) {
        let text: Vec<&str> =
            text.trim_matches(['\n', '\r', '\u{feff}']).lines().map(str::trim_end).collect();
        let text = text.join("\n");
        match self.0.iter_mut().find(|(known, _)| *known == text) {
            Some((_, labels)) if labels.last().is_some_and(|last| last == label) => {}
            Some((_, labels)) => labels.push(label.to_owned()),
            None => self.0.push((text, vec![label.to_owned()])),
        }
    }

    /// Adds the licence texts in the source of a crate. If the source contains no licence text, adds the standard text
    /// of the licence.
    fn of(&mut self, found: &Crate, label: &str) -> Result<()> {
        let files = files(&found.folder)?;
        for file in &files {
            self.add(label, &read(file)?);
        }
        if files.is_empty() {
            let licence = expression(found.licence.as_deref().unwrap_or_default());
            let mit = licence.split(" OR ").any(|one| one == "MIT");
            ensure!(
                mit,
                "{label} ({licence}) has no text of its licence in its source, and no standard one is known here"
            );
            let authors = match &*found.authors {
                [] => format!(
                    "the authors of {} ({})",
                    found.name,
                    found.repository.as_deref().unwrap_or("crates.io")
                ),
                authors => authors.join(", "),
            };
            let standard = include_str!("../../../LICENSE-MIT");
            let terms = standard.split_once("Permission is hereby").context("LICENSE-MIT has no terms")?.1;
            let text = format!("MIT License\n\nCopyright (c) {authors}\n\nPermission is hereby{terms}");
            self.add(label, &text);
        }
        Ok(())
    }
}

/// Returns the licence files in the source of a crate, including the files for C code and other parts. The result
/// excludes tests and examples, because they do not become part of a program.
fn files(source: &Path) -> Result<Vec<PathBuf>> {
    let (mut found, mut waiting) = (Vec::new(), vec![source.to_owned()]);
    while let Some(folder) = waiting.pop() {
        for entry in std::fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
            let path = entry?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
            if path.is_dir() {
                if !NOT_SHIPPED.contains(&&*name) && !name.starts_with('.') {
                    waiting.push(path);
                }
            } else if NAMES.iter().any(|known| name.starts_with(known)) && !is_code(&path) {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}

/// Returns `true` for source code, because the names of source files about licences can begin like the names of licence
/// files.
fn is_code(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ["rs", "py", "c", "h", "sh", "toml"].iter().any(|code| ending == *code))
}

fn read(file: &Path) -> Result<String> {
    let bytes = std::fs::read(file).with_context(|| file.display().to_string())?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_expressions_become_those_of_spdx() {
        assert_eq!(expression("MIT/Apache-2.0"), "MIT OR Apache-2.0");
        assert_eq!(expression("Apache-2.0 / MIT"), "Apache-2.0 OR MIT");
        assert_eq!(expression("(MIT OR Apache-2.0) AND Unicode-3.0"), "(MIT OR Apache-2.0) AND Unicode-3.0");
    }

    #[test]
    fn a_text_of_many_stands_once() {
        let mut texts = Texts::default();
        texts.add("a 1", "one\n");
        texts.add("b 2", "one  \r\n");
        texts.add("b 2", "\nother");
        let expected = [("one", vec!["a 1", "b 2"]), ("other", vec!["b 2"])];
        let found: Vec<(&str, Vec<&str>)> =
            texts.0.iter().map(|(text, labels)| (&**text, labels.iter().map(|l| &**l).collect())).collect();
        assert_eq!(found, expected);
    }
}
