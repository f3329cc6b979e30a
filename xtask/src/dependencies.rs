//! Checks that docs/dependencies.md lists exactly the direct dependencies of the manifests and of the lists for
//! Python and Node.js.
use std::collections::BTreeSet;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::shell::{files, root};

/// Returns the names in the dependency tables of a manifest.
fn direct(manifest: &str) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    let mut inside = false;
    for line in manifest.lines() {
        let line = line.trim();
        if let Some(table) = line.strip_prefix('[') {
            let table = table.trim_end_matches(']');
            inside = table.ends_with("dependencies");
            if let Some((_, name)) = table.split_once("dependencies.") {
                names.insert(name.to_owned());
            }
        } else if inside && let Some((key, _)) = line.split_once('=') {
            let name = key.trim().split('.').next().unwrap_or_default();
            // This condition excludes comments and continuation lines of a value, which are not names of
            // dependencies.
            let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
            if !name.is_empty() && name.chars().all(is_name) {
                names.insert(name.to_owned());
            }
        }
    }
    names
}

/// Returns the names in the first column of the tables on the page (`` | `name` | … ``).
fn documented(page: &str) -> BTreeSet<String> {
    page.lines()
        .filter_map(|line| line.strip_prefix("| `")?.split_once('`'))
        .map(|(name, _)| name.to_owned())
        .collect()
}

/// Returns an error that lists dependencies that are missing on the page, and entries of the page that are not
/// dependencies.
pub(crate) fn check() -> Result<()> {
    let page =
        std::fs::read_to_string(root().join("docs/dependencies.md")).context("docs/dependencies.md")?;
    let documented = documented(&page);
    let mut used = BTreeSet::new();
    for directory in ["crates", "xtask", "fuzz", "firmware", "emulator", "book"] {
        for path in files(&root().join(directory), &["toml"]) {
            if path.file_name().is_some_and(|name| name == "Cargo.toml") {
                used.extend(direct(&std::fs::read_to_string(path)?));
            }
        }
    }
    for path in files(&root().join("references"), &["txt"]) {
        let list = std::fs::read_to_string(path)?;
        used.extend(list.lines().filter_map(|line| line.split_once("==")).map(|(name, _)| name.to_owned()));
    }
    let references = files(&root().join("references"), &["json"]).into_iter();
    let packages = references.filter(|path| path.file_name().is_some_and(|name| name == "package.json"));
    for path in packages.chain([root().join("web/package.json")]) {
        let package: Value = serde_json::from_str(&std::fs::read_to_string(path)?)?;
        for table in ["dependencies", "devDependencies"] {
            used.extend(package[table].as_object().into_iter().flatten().map(|(name, _)| name.clone()));
        }
    }
    let own: BTreeSet<String> = std::fs::read_dir(root().join("crates"))?
        .flatten()
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect();
    let used: BTreeSet<String> = used.difference(&own).cloned().collect();
    let missing: Vec<_> = used.difference(&documented).map(String::as_str).collect();
    ensure!(missing.is_empty(), "docs/dependencies.md says nothing about {}", missing.join(", "));
    let unused: Vec<_> = documented.difference(&used).map(String::as_str).collect();
    ensure!(unused.is_empty(), "docs/dependencies.md lists what nothing uses: {}", unused.join(", "));
    println!("{} direct dependencies, each documented", used.len());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn manifests_are_read_in_every_form() {
        let manifest = "[package]\nname = \"x\"\n[dependencies]\nserde = { version = \"1\", features = [\n  \"derive\",\n\
                        ], optional = true }\nclap.workspace = true\n# no = 1\n\
                        [dev-dependencies.proptest]\nworkspace = true\n[features]\nsim = []\n";
        let expected: BTreeSet<String> = ["serde", "clap", "proptest"].map(String::from).into();
        assert_eq!(direct(manifest), expected);
        assert_eq!(documented("| `serde` | why |\n| name | why |"), BTreeSet::from(["serde".to_owned()]));
    }
}
