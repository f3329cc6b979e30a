//! Builds the test programs of a crate. Each program contains all mutants of the crate, and an environment variable
//! enables one of them. The file gamma.toml defines the changes that create mutants.
use std::collections::BTreeMap;
use std::fs::{create_dir_all, read_to_string, remove_dir_all, write};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::prove::evidence::Named;
use crate::shell::{self, cargo, command, files, run, target, works};

/// Version of cargo-gamma that the command installs. The files that this module reads may differ in other versions.
const VERSION: &str = "0.4.0";
/// Test filter that matches no test. With this filter, cargo-gamma prepares all mutants but runs no test.
const NO_TEST: &str = "this_filter_selects_no_test";
/// First line of the function that the programs call at each mutant, and that returns `true` for the enabled mutant.
const GUARD: &str = "pub fn a(id: u32) -> bool {\n";
/// Last line of a function.
const END: &str = "\n}\n";
/// Body of the function [`GUARD`] in the programs that run the tests. The original body of cargo-gamma is slower.
const COMPARE: &str = "    ACTIVE.load(Ordering::Relaxed) == id";
/// Body of the function [`GUARD`] in the programs that record which mutants a test reaches. The function writes the
/// number of each mutant to standard error when the program reaches the mutant for the first time.
const RECORD: &str = "    static REACHED: [AtomicBool; 65536] = [const { AtomicBool::new(false) }; 65536];
    unsafe extern \"C\" {
        fn write(file: i32, bytes: *const u8, count: usize) -> isize;
    }
    let reached = &REACHED[id as usize % REACHED.len()];
    if !reached.load(Ordering::Relaxed) {
        reached.store(true, Ordering::Relaxed);
        let digit = |unit: u32| b'0' + (id / unit % 10) as u8;
        let line = [1, digit(10_000), digit(1_000), digit(100), digit(10), digit(1), b'\\n'];
        let _ = unsafe { write(2, line.as_ptr(), line.len()) };
    }
    false";

/// Mutant of a crate.
pub(super) struct Mutant {
    /// Identification of the mutant. cargo-gamma derives it from the function and the code of the mutant.
    pub id: String,
    /// Number that enables the mutant in the test programs.
    pub ordinal: u32,
    pub named: Named,
    /// Line of the source file, from 1.
    pub at: u64,
}

/// Test program that contains the mutants.
pub(super) struct Program {
    pub path: PathBuf,
    /// Folder in which the program runs: the folder of its package.
    pub folder: PathBuf,
}

/// Test programs of a crate, and the mutants in them.
pub(super) struct Build {
    pub programs: Vec<Program>,
    /// Test programs that record the mutants that a test reaches, in the same order as in `programs`.
    pub recording: Vec<Program>,
    pub mutants: Vec<Mutant>,
}

/// Installs cargo-gamma if it is missing.
pub(super) fn install() -> Result<()> {
    if !works(command(program()).args(["gamma", "--version"])) {
        let mut install = cargo(&["install", "cargo-gamma", "--locked", "--version", VERSION, "--root"]);
        run(install.arg(target().join("tools")))?;
    }
    // Downloads the dependencies for every platform, because cargo-gamma calls cargo offline.
    run(&mut cargo(&["fetch", "--locked"]))
}

fn program() -> PathBuf {
    target().join("tools/bin/cargo-gamma")
}

/// Builds the test programs of the packages `judges` with all mutants of the crate `package`. Writes the report of
/// cargo-gamma to the folder `results`.
pub(super) fn build(package: &str, judges: &[&str], results: &Path) -> Result<Build> {
    create_dir_all(results).with_context(|| format!("cannot create {}", results.display()))?;
    let mut gamma: Command = command(program());
    gamma.args(["gamma", "run", "--color", "never", "--progress", "never", "--profile", "release"]);
    gamma.arg("--artifact-dir").arg(results).args(["--package", package]);
    gamma.args(judges.iter().flat_map(|judge| ["--test-package", judge]));
    gamma.args(["--", NO_TEST]);
    println!("$ cargo gamma run --package {package}");
    let status = gamma.status().context("cannot start cargo-gamma")?;
    // Exit code 2 means that too many mutants survived. This is expected here, because no test ran.
    ensure!(matches!(status.code(), Some(0 | 2)), "cargo-gamma ended with {status}");

    let session = session()?;
    let mutants = mutants(&read(&results.join("gamma-report.json"))?, &session)?;
    let of = |key: &str| session["workspace"][key].as_str().map(PathBuf::from).context("no workspace");
    let copy = copy(&of("root")?, &of("runtime")?)?;
    let recording = programs(&copy, RECORD, judges, "recording")?;
    let programs = programs(&copy, COMPARE, judges, "programs")?;
    ensure!(recording.len() == programs.len(), "cargo built different test programs");
    Ok(Build { programs, recording, mutants })
}

fn read(path: &Path) -> Result<Value> {
    let text = read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(serde_json::from_str(&text)?)
}

/// Reads the session file of the last run of cargo-gamma in this checkout.
fn session() -> Result<Value> {
    let cache = target().join("cargo-gamma/cache");
    let sessions = files(&cache, &["json"]).into_iter().filter(|path| path.ends_with("testing-session.json"));
    let last = sessions.max_by_key(|path| path.metadata().and_then(|data| data.modified()).ok());
    read(&last.with_context(|| format!("no testing-session.json below {}", cache.display()))?)
}

/// Returns the mutants that compile. The report contains the description and the source line of each mutant, and the
/// session contains its number.
fn mutants(report: &Value, session: &Value) -> Result<Vec<Mutant>> {
    let list = session["plan"]["mutants"].as_array().context("the session has no mutants")?;
    let ordinals: BTreeMap<_, _> =
        list.iter().filter_map(|one| Some((one["id"].as_str()?, one["ordinal"].as_u64()?))).collect();
    let mut mutants = Vec::new();
    for (file, content) in report["files"].as_object().context("the report has no files")? {
        let lines: Vec<&str> = content["source"].as_str().unwrap_or_default().lines().collect();
        for mutant in content["mutants"].as_array().into_iter().flatten() {
            let id = mutant["id"].as_str().context("a mutant has no id")?;
            if mutant["status"] == "CompileError" {
                continue;
            }
            let ordinal = ordinals.get(id).with_context(|| format!("the mutant {id} has no number"))?;
            let at = mutant["location"]["start"]["line"].as_u64().unwrap_or(1);
            mutants.push(Mutant {
                id: id.into(),
                ordinal: u32::try_from(*ordinal)?,
                named: Named {
                    file: file.clone(),
                    line: lines.get(at as usize - 1).map_or("", |line| line.trim()).into(),
                    change: mutant["description"].as_str().unwrap_or_default().into(),
                },
                at,
            });
        }
    }
    Ok(mutants)
}

/// Copies the sources with the mutants, and the runtime. Returns the folder with both.
fn copy(workspace: &Path, runtime: &Path) -> Result<PathBuf> {
    let copy = target().join("mutants/copy");
    if copy.exists() {
        remove_dir_all(&copy).with_context(|| format!("cannot remove {}", copy.display()))?;
    }
    create_dir_all(&copy).with_context(|| format!("cannot create {}", copy.display()))?;
    run(command("cp").arg("-a").arg(workspace).arg(copy.join("workspace")))?;
    run(command("cp").arg("-a").arg(runtime).arg(copy.join("runtime")))?;
    let (old, new) = (runtime.to_string_lossy(), copy.join("runtime"));
    for manifest in files(&copy.join("workspace/crates"), &["toml"]) {
        let text = read_to_string(&manifest)?;
        if text.contains(&*old) {
            write(&manifest, text.replace(&*old, &new.to_string_lossy()))?;
        }
    }
    Ok(copy)
}

/// Builds the test programs of the packages, with `code` as the body of the function [`GUARD`]. The target folder is
/// `name`.
fn programs(copy: &Path, code: &str, packages: &[&str], name: &str) -> Result<Vec<Program>> {
    let runtime = copy.join("runtime/src/runtime.rs");
    let text = read_to_string(&runtime).with_context(|| format!("cannot read {}", runtime.display()))?;
    let text = with_guard(&text, code).with_context(|| format!("{} has no guard", runtime.display()))?;
    write(&runtime, text).with_context(|| format!("cannot write {}", runtime.display()))?;

    let mut cargo = cargo(&["test", "--offline", "--release", "--no-run", "--message-format", "json"]);
    cargo.args(packages.iter().flat_map(|package| ["--package", package]));
    cargo.current_dir(copy.join("workspace")).env("CARGO_TARGET_DIR", target().join("mutants").join(name));
    let mut programs = BTreeMap::new();
    for line in shell::read(&mut cargo)?.lines() {
        let Ok(message) = serde_json::from_str::<Value>(line) else { continue };
        let test = message["profile"]["test"] == true;
        let Some(path) = message["executable"].as_str().filter(|_| test) else { continue };
        let manifest = Path::new(message["manifest_path"].as_str().unwrap_or_default());
        let Some(folder) = manifest.parent() else { continue };
        let source = message["target"]["src_path"].as_str().unwrap_or_default().to_owned();
        programs.insert(source, Program { path: path.into(), folder: folder.into() });
    }
    ensure!(!programs.is_empty(), "cargo built no test program of {}", packages.join(", "));
    Ok(programs.into_values().collect())
}

/// Returns the source of the runtime, with `code` as the body of the function [`GUARD`].
fn with_guard(source: &str, code: &str) -> Option<String> {
    let (before, rest) = source.split_once(GUARD)?;
    let (_, after) = rest.split_once(END)?;
    Some(format!("{before}{GUARD}{code}{END}{after}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_code_of_the_guard_changes() {
        let source = "fn b() {\n}\npub fn a(id: u32) -> bool {\n    old(id)\n}\n\nfn c() {\n}\n";
        let new = with_guard(source, "    new(id)").unwrap();
        assert_eq!(new, source.replace("old", "new"));
        assert_eq!(with_guard("fn b() {\n}\n", ""), None);
    }
}
