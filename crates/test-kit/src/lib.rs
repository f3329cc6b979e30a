//! Shared code of the tests and benchmarks of several crates. The code runs the stored fuzz inputs on the stable
//! toolchain, and compares documents with the output of their commands. This crate also contains access to data of an
//! existing arm, a clock, test timeouts, and requests to agents.
#![forbid(unsafe_code)]

pub mod clock;
pub mod existing;
pub mod flood;
pub mod http;
pub mod page;
pub mod patience;
#[cfg(unix)]
pub mod transcript;
pub mod written;

use std::fs::read_dir;
use std::path::{Path, PathBuf};

/// Returns `true` for the line in which a command lists the environment variables that affect it. Documents omit this
/// line, because they show each variable next to the command that sets it.
fn shows_variables(line: &str) -> bool {
    ["jtc: from the environment: ", "ucom: from the environment: "]
        .iter()
        .any(|start| line.starts_with(start))
}

/// Body of a fuzz target; it panics if a property is violated.
pub type Body = fn(&[u8]);

/// Fuzz target: the name of its file in `fuzz/fuzz_targets`, and its body.
pub type Target = (&'static str, Body);

/// Runs each body on every file of `fuzz/corpus/<target>` and `fuzz/regressions/<target>`. Prints the name of the
/// current file, so that the output of a failed test shows it.
///
/// # Panics
/// Panics if a body panics, if the target does not exist, or if no input is stored for the target. Otherwise a
/// misspelt name would test nothing.
pub fn run_kept_inputs(targets: &[Target]) {
    for (target, body) in targets {
        let files = kept_inputs(target);
        assert!(!files.is_empty(), "nothing is kept for {target} in fuzz/corpus and fuzz/regressions");
        for path in &files {
            println!("{}", path.display());
            body(&std::fs::read(path).expect("a readable file"));
        }
        println!("{target}: {} kept inputs", files.len());
    }
}

/// Returns the stored inputs of a target, sorted by name.
fn kept_inputs(target: &str) -> Vec<PathBuf> {
    let fuzz = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fuzz"));
    let source = fuzz.join("fuzz_targets").join(target).with_extension("rs");
    assert!(source.is_file(), "no fuzz target {} exists", source.display());
    let mut files = Vec::new();
    for kind in ["corpus", "regressions"] {
        let Ok(directory) = read_dir(fuzz.join(kind).join(target)) else { continue };
        files.extend(directory.map(|file| file.expect("a readable directory").path()));
    }
    files.sort();
    files
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::run_kept_inputs;

    static BYTES: AtomicUsize = AtomicUsize::new(0);

    #[test]
    fn a_body_sees_what_is_kept() {
        run_kept_inputs(&[("status_stream", |data| {
            BYTES.fetch_add(data.len(), Ordering::Relaxed);
        })]);
        assert!(BYTES.load(Ordering::Relaxed) > 0);
    }

    #[test]
    #[should_panic = "no fuzz target"]
    fn a_target_that_is_none() {
        run_kept_inputs(&[("no_target", |_| ())]);
    }
}
