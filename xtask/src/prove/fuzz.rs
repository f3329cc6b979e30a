//! `cargo xtask prove fuzz`: runs the fuzz targets with cargo-fuzz on the nightly toolchain. If cargo-fuzz or the
//! toolchain is missing, the command installs it.
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::create_dir_all;
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, ensure};

use super::evidence;
use super::mutants::commit;
use crate::shell::{self, command, root, run, works};

const RUNS: &str = "20000000";
const PORTION: u64 = 500_000;
/// Number of executions of a fuzz target that are also guided by comparisons in the code, which finds keywords and
/// constants. The later executions are guided only by code coverage, and are two to three times as fast.
const COMPARING: u64 = 1_000_000;
/// Name of the table in docs/evidence.md.
const TABLE: &str = "fuzz";

/// Option that limits the length of fuzz inputs. Longer inputs are slow and only repeat the contents of shorter inputs.
/// Kept inputs must be readable and small enough for git.
const LENGTH: &str = "-max_len=4096";

/// Returns a command of the nightly toolchain, without the environment variables of the pinned toolchain.
fn nightly(arguments: &[&str]) -> Command {
    let mut rustup = command("rustup");
    rustup.args(["run", "nightly"]).args(arguments).env_remove("RUSTUP_TOOLCHAIN").env_remove("CARGO");
    rustup
}

/// Runs `cargo xtask prove fuzz`. `arguments` may contain a fuzz target, `--runs N` and `--keep`.
pub(super) fn main(arguments: &[String]) -> Result<ExitCode> {
    let mut arguments = arguments.to_vec();
    let wanted = shell::option(&mut arguments, "--runs")?;
    let wanted: u64 = wanted.as_deref().unwrap_or(RUNS).parse().context("--runs needs a number")?;
    let keep = shell::flag(&mut arguments, "--keep");
    let only = if arguments.is_empty() { None } else { Some(arguments.remove(0)) };
    shell::nothing_left(&arguments)?;

    let mut targets = targets();
    if let Some(only) = only {
        ensure!(targets.contains(&only), "no fuzz target `{only}`; there are: {}", targets.join(", "));
        targets = vec![only];
    }
    ensure!(!targets.is_empty(), "there is no fuzz target in fuzz/fuzz_targets");
    install()?;
    for target in targets {
        let done = executions(&evidence::table(&evidence::read()?, TABLE)?, &target);
        println!("\n== {target}: {done} of {wanted} executions done");
        let directories = directories(&target)?;
        let directories: Vec<&str> = directories.iter().map(String::as_str).collect();
        let mut done = done;
        while done < wanted {
            // The command runs the executions in portions, and counts each finished portion. So these executions
            // count even if the user interrupts the command.
            let portion = (wanted - done).min(PORTION);
            let build = if done < COMPARING { &COMPARISONS[..] } else { &COVERAGE[..] };
            run(&mut fuzz(&target, build, &directories, &[&format!("-runs={portion}"), LENGTH]))?;
            count(&target, portion)?;
            done += portion;
        }
        if keep {
            // The merge compares only which code an input executes, not how often. So it keeps only few inputs.
            let merge = ["-set_cover_merge=1", "-use_counters=0", LENGTH];
            run(&mut fuzz(&target, &COMPARISONS, &[directories[1], directories[0]], &merge))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Installs the nightly toolchain and cargo-fuzz if they are missing.
fn install() -> Result<()> {
    if !works(&mut nightly(&["rustc", "--version"])) {
        run(command("rustup").args(["toolchain", "install", "nightly", "--profile", "minimal"]))?;
    }
    if !works(&mut nightly(&["cargo", "fuzz", "--version"])) {
        run(&mut nightly(&["cargo", "install", "cargo-fuzz", "--locked"]))?;
    }
    Ok(())
}

/// Returns the folders of found inputs and kept inputs. If the folder of regressions exists, the function also returns
/// this folder.
fn directories(target: &str) -> Result<Vec<String>> {
    // Found inputs accumulate in the build folder, which is not in git. Kept inputs are stored in git.
    let mut directories = vec![format!("fuzz/target/corpus/{target}"), format!("fuzz/corpus/{target}")];
    for directory in &directories {
        let path = root().join(directory);
        create_dir_all(&path).with_context(|| format!("cannot create {}", path.display()))?;
    }
    let regressions = format!("fuzz/regressions/{target}");
    if root().join(&regressions).is_dir() {
        directories.push(regressions);
    }
    Ok(directories)
}

/// Adds `portion` executions of the checked-out commit to the page, unless the tested code has uncommitted changes.
fn count(target: &str, portion: u64) -> Result<()> {
    let changed =
        shell::read(command("git").args(["status", "--porcelain", "--", "crates", "fuzz/fuzz_targets"]))?;
    if !changed.trim().is_empty() {
        println!("crates/ has changes that are in no commit: these executions are not counted");
        return Ok(());
    }
    let table = evidence::table(&evidence::read()?, TABLE)?;
    evidence::replace(TABLE, &with(&table, target, &commit()?, portion))
}

/// Returns the rows of the table: fuzz target and commit, with the number of executions.
fn rows(table: &str) -> BTreeMap<(String, String), u64> {
    let row = |line: &str| {
        let mut cells = line.split('|').map(|cell| cell.trim().trim_matches('`').to_owned()).skip(1);
        let key = (cells.next()?, cells.next()?);
        Some((key, cells.next()?.replace(',', "").parse().ok()?))
    };
    table.lines().filter_map(row).collect()
}

/// Returns the number of executions of the fuzz target `target` on all commits.
fn executions(table: &str, target: &str) -> u64 {
    rows(table).iter().filter(|((name, _), _)| name == target).map(|(_, executions)| executions).sum()
}

/// Returns the table with `portion` additional executions of `target` on `commit`.
fn with(table: &str, target: &str, commit: &str, portion: u64) -> String {
    let mut rows = rows(table);
    *rows.entry((target.into(), commit.into())).or_default() += portion;
    let mut table = String::from("| target | commit | executions |\n|---|---|---|\n");
    for ((target, commit), executions) in rows {
        let _ = writeln!(table, "| `{target}` | {commit} | {executions} |");
    }
    table
}

/// Build arguments for fuzzing that is guided by coverage and by comparisons. This is the default of cargo-fuzz, so
/// no arguments are needed.
const COMPARISONS: [&str; 0] = [];
/// Build arguments for fuzzing that is guided only by coverage. This build has a separate folder, so that neither of
/// the two builds is repeated.
const COVERAGE: [&str; 2] = ["--no-trace-compares", "--target-dir=fuzz/target/coverage"];

/// Returns the command that runs the fuzzer on `directories`. The fuzzer writes new inputs to the first folder. The address
/// sanitizer is off, because the code has no `unsafe` and the fuzzer is several times as fast without the sanitizer.
fn fuzz(target: &str, build: &[&str], directories: &[&str], options: &[&str]) -> Command {
    let mut fuzz = nightly(&["cargo", "fuzz", "run", "-s", "none"]);
    fuzz.args(build).arg(target).args(directories).arg("--").args(options);
    fuzz
}

/// Returns the names of the fuzz targets.
fn targets() -> Vec<String> {
    shell::files(&root().join("fuzz/fuzz_targets"), &["rs"])
        .iter()
        .filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned()))
        .collect()
}

#[cfg(test)]
mod tests {
    use std::fs::{read_dir, read_to_string};

    use super::*;

    #[test]
    fn executions_of_all_commits_are_added() {
        let table = with("", "stream_parser", "aaa", 500);
        let table = with(&with(&table, "stream_parser", "bbb", 20), "stream_parser", "aaa", 1);
        assert_eq!(
            table.lines().skip(2).collect::<Vec<_>>(),
            ["| `stream_parser` | aaa | 501 |", "| `stream_parser` | bbb | 20 |"]
        );
        assert_eq!((executions(&table, "stream_parser"), executions(&table, "bus_frame")), (521, 0));
    }

    /// Checks that every test run executes each fuzz target with its kept inputs, and that all kept inputs belong to a
    /// fuzz target.
    #[test]
    fn every_target_is_built_and_tested() {
        let manifest = read_to_string(root().join("fuzz/Cargo.toml")).unwrap();
        let tests: String = shell::files(&root().join("crates"), &["rs"])
            .iter()
            .filter(|path| path.ends_with("tests/fuzz_regressions.rs"))
            .map(|path| read_to_string(path).unwrap())
            .collect();
        let targets = targets();
        for target in &targets {
            assert!(manifest.contains(&format!("name = \"{target}\"\n")), "{target} is no [[bin]] of fuzz/");
            assert!(
                tests.contains(&format!("(\"{target}\", ")),
                "{target} is in no tests/fuzz_regressions.rs"
            );
        }
        for kind in ["fuzz/corpus", "fuzz/regressions"] {
            for directory in read_dir(root().join(kind)).into_iter().flatten() {
                let name = directory.unwrap().file_name().into_string().unwrap();
                assert!(targets.contains(&name), "{kind}/{name} belongs to no target");
            }
        }
    }
}
