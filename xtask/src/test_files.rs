//! Checks that every file with tests belongs to a test program. The tests of a crate are one program, and cargo does not find
//! other test files automatically.
use std::fs::read_to_string;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::shell::{self, root};

/// Returns the root files of the test programs of a crate, if the manifest of the crate lists these files.
fn programs(package: &Path) -> Result<Option<Vec<PathBuf>>> {
    let manifest: toml::Table = read_to_string(package.join("Cargo.toml"))?.parse()?;
    if manifest["package"].get("autotests").and_then(toml::Value::as_bool) != Some(false) {
        return Ok(None);
    }
    let named = manifest.get("test").and_then(toml::Value::as_array).into_iter().flatten();
    let roots =
        named.filter_map(|test| Some(package.join(format!("tests/{}.rs", test.get("name")?.as_str()?))));
    Ok(Some(roots.collect()))
}

/// Returns the files that may declare the module in `file`, and the name of this module.
fn parents(file: &Path, tests: &Path, programs: &[PathBuf]) -> Option<(Vec<PathBuf>, String)> {
    let is_folder = file.file_name()? == "mod.rs";
    let module = if is_folder { file.parent()? } else { file };
    let folder = module.parent()?;
    let parents = if folder == tests {
        programs.to_vec()
    } else {
        vec![folder.join("mod.rs"), folder.with_extension("rs")]
    };
    Some((parents, module.file_stem()?.to_string_lossy().into_owned()))
}

/// Returns the files in tests/ of `package` that do not belong to a test program.
fn forgotten(package: &Path) -> Result<Vec<PathBuf>> {
    let Some(programs) = programs(package)? else { return Ok(Vec::new()) };
    let tests = package.join("tests");
    let mut forgotten = Vec::new();
    for file in shell::files(&tests, &["rs"]) {
        if programs.contains(&file) {
            continue;
        }
        let (parents, name) = parents(&file, &tests, &programs).context("a test in no folder")?;
        let declarations =
            ["", "pub ", "pub(crate) ", "pub(super) "].map(|visibility| format!("{visibility}mod {name};"));
        let declares = |parent: &PathBuf| {
            let text = read_to_string(parent).unwrap_or_default();
            text.lines().any(|line| declarations.iter().any(|declaration| declaration == line))
        };
        if !parents.iter().any(declares) {
            forgotten.push(file);
        }
    }
    Ok(forgotten)
}

/// Returns an error that lists the files with tests that do not belong to a test program.
pub(crate) fn check() -> Result<()> {
    let mut missing = Vec::new();
    for manifest in shell::files(&root().join("crates"), &["toml"]) {
        if manifest.file_name().is_some_and(|name| name == "Cargo.toml") {
            missing.extend(forgotten(manifest.parent().context("a manifest in no folder")?)?);
        }
    }
    let names: Vec<_> = missing.iter().map(|path| path.display().to_string()).collect();
    ensure!(names.is_empty(), "no test program has {}: a line `mod …;` in tests/suite.rs", names.join(", "));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{create_dir_all, write};

    #[test]
    fn files_that_no_program_has_are_found() {
        let package = tempfile::tempdir().unwrap();
        let tests = package.path().join("tests");
        create_dir_all(tests.join("rig")).unwrap();
        let manifest =
            "[package]\nautotests = false\n[[test]]\nname = \"suite\"\n[[test]]\nname = \"alone\"\n";
        write(package.path().join("Cargo.toml"), manifest).unwrap();
        for (name, text) in [
            ("suite.rs", "mod rig;\nmod there;\n"),
            ("alone.rs", ""),
            ("there.rs", ""),
            ("not_there.rs", ""),
            ("rig/mod.rs", "pub mod node;\n"),
            ("rig/node.rs", ""),
            ("rig/lost.rs", ""),
        ] {
            write(tests.join(name), text).unwrap();
        }
        assert_eq!(
            forgotten(package.path()).unwrap(),
            [tests.join("not_there.rs"), tests.join("rig/lost.rs")]
        );
        write(package.path().join("Cargo.toml"), "[package]\n").unwrap();
        assert_eq!(forgotten(package.path()).unwrap(), [""; 0].map(PathBuf::from));
    }
}
