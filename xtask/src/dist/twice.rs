//! Builds a release again from a copy of the checkout in another folder, and compares both releases byte by byte.
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};

use crate::shell::{self, run};

/// Builds the release in `first` again in another folder. If files differ, returns an error that lists these files, and
/// keeps both releases.
pub(super) fn compare(first: &Path, quick: bool) -> Result<()> {
    // The command does not use the folder for temporary files, because on some systems this folder is in memory, and
    // the build needs gigabytes.
    let folder = shell::target().join("made-again-in-a-folder-with-a-longer-name");
    if folder.exists() {
        fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
    }
    let checkout = folder.join("a/checkout");
    copy(&checkout, first)?;
    let (second, target) = (folder.join("release"), folder.join("built"));
    let mut again = shell::command("cargo");
    again.current_dir(&checkout).args(["xtask", "dist", "--out"]).arg(&second);
    if quick {
        again.arg("--quick");
    }
    // The command removes the environment variables of cargo, so that only the checkout selects the toolchain.
    for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("CARGO") && name != "CARGO_HOME") {
        again.env_remove(name);
    }
    run(again.env("CARGO_TARGET_DIR", &target))?;
    let names = |folder: &Path| -> Result<BTreeSet<String>> {
        fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned())).collect()
    };
    let mut differ = Vec::new();
    let all: BTreeSet<String> = names(first)?.union(&names(&second)?).cloned().collect();
    for name in &all {
        match (fs::read(first.join(name)), fs::read(second.join(name))) {
            (Ok(one), Ok(other)) if one == other => {}
            (Ok(one), Ok(other)) => {
                let at =
                    one.iter().zip(&other).position(|(a, b)| a != b).unwrap_or(one.len().min(other.len()));
                differ.push(format!(
                    "{name}: {} and {} B, the first other byte is {at}",
                    one.len(),
                    other.len()
                ));
            }
            _ => differ.push(format!("{name}: in one of both only")),
        }
    }
    if !differ.is_empty() {
        bail!(
            "{} of {} files are other bytes when they are made again ({} and {}):\n{}",
            differ.len(),
            all.len(),
            first.display(),
            second.display(),
            differ.join("\n")
        );
    }
    fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
    println!("{} files, the same bytes from another folder", all.len());
    Ok(())
}

/// Copies the current checkout with uncommitted changes and history, but without build output and without the release.
fn copy(to: &Path, release: &Path) -> Result<()> {
    run(shell::command("git").args(["clone", "--quiet", "--no-local", "."]).arg(to))?;
    let listed = shell::read(shell::command("git").args([
        "-c",
        "core.quotePath=false",
        "ls-files",
        "--cached",
        "--others",
        "--exclude-standard",
    ]))?;
    for name in listed.lines() {
        let (from, to) = (shell::root().join(name), to.join(name));
        if from.starts_with(release) {
            continue;
        }
        if !from.exists() {
            let _ = fs::remove_file(&to);
            continue;
        }
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder)?;
        }
        fs::copy(&from, &to).with_context(|| name.to_owned())?;
    }
    Ok(())
}
