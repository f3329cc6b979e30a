//! `cargo xtask fuzz`: runs the fuzz targets with cargo-fuzz on the nightly toolchain, both installed when missing.
use std::fs::create_dir_all;
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, ensure};

use crate::shell::{self, command, root, run, works};

const RUNS: &str = "20000000";

/// Kept inputs are short, so that a person can read them and git need not carry them.
const KEPT_LENGTH: &str = "-max_len=4096";

/// A command of the nightly toolchain; the pinned toolchain's variables are taken away.
fn nightly(arguments: &[&str]) -> Command {
    let mut rustup = command("rustup");
    rustup.args(["run", "nightly"]).args(arguments).env_remove("RUSTUP_TOOLCHAIN").env_remove("CARGO");
    rustup
}

/// `arguments`: a target, `--runs N`, `--keep`.
pub fn main(arguments: &[String]) -> Result<ExitCode> {
    let mut arguments = arguments.to_vec();
    let runs = shell::option(&mut arguments, "--runs")?.unwrap_or_else(|| RUNS.into());
    ensure!(runs.parse::<u64>().is_ok(), "--runs needs a number, not `{runs}`");
    let keep = shell::flag(&mut arguments, "--keep");
    let only = if arguments.is_empty() { None } else { Some(arguments.remove(0)) };
    shell::nothing_left(&arguments)?;

    let mut targets = targets();
    if let Some(only) = only {
        ensure!(targets.contains(&only), "no fuzz target `{only}`; there are: {}", targets.join(", "));
        targets = vec![only];
    }
    ensure!(!targets.is_empty(), "there is no fuzz target in fuzz/fuzz_targets");
    if !works(&mut nightly(&["rustc", "--version"])) {
        run(command("rustup").args(["toolchain", "install", "nightly", "--profile", "minimal"]))?;
    }
    if !works(&mut nightly(&["cargo", "fuzz", "--version"])) {
        run(&mut nightly(&["cargo", "install", "cargo-fuzz", "--locked"]))?;
    }
    for target in targets {
        println!("\n== {target}: {runs} executions");
        // What is found grows from run to run beside the build, outside git; git has the kept inputs.
        let found = format!("fuzz/target/corpus/{target}");
        let kept = format!("fuzz/corpus/{target}");
        let regressions = format!("fuzz/regressions/{target}");
        for directory in [&found, &kept] {
            let path = root().join(directory);
            create_dir_all(&path).with_context(|| format!("cannot create {}", path.display()))?;
        }
        let mut directories = vec![found.as_str(), kept.as_str()];
        if root().join(&regressions).is_dir() {
            directories.push(&regressions);
        }
        let limit = format!("-runs={runs}");
        run(&mut fuzz(&target, &directories, &[&limit, "-max_len=16384"]))?;
        if keep {
            // What code is reached, not how often, and by few inputs.
            let merge = ["-set_cover_merge=1", "-use_counters=0", KEPT_LENGTH];
            run(&mut fuzz(&target, &[&kept, &found], &merge))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The fuzzer on `directories`; new inputs go into the first. Without address sanitizer: there is no unsafe code, and it
/// is several times as fast.
fn fuzz(target: &str, directories: &[&str], options: &[&str]) -> Command {
    let mut fuzz = nightly(&["cargo", "fuzz", "run", "-s", "none", target]);
    fuzz.args(directories).arg("--").args(options);
    fuzz
}

/// Names of the fuzz targets.
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

    /// A target runs over its kept inputs in every test run, too, and what is kept belongs to a target.
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
