//! `cargo xtask emulate`: runs the firmware of the boards in an emulator of the chip. The command is for tests, for
//! measurements, and for a live controller on a serial port.
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail, ensure};

use crate::shell::{self, run, run_lines, works};
use crate::suite::{self, count_results};
use crate::tally::{Counts, Outcome, Tally};
use crate::{firmware, python, size};

/// File with measurements of the firmware. The file is in the repository, so that every change of a measurement is
/// reviewed.
const FIGURES: &str = "docs/board-figures.txt";

/// Runs `cargo xtask emulate`. `arguments` is `--update`, or `--serial PATH` and arguments of the emulator itself.
pub(crate) fn main(arguments: &[String]) -> Result<ExitCode> {
    if arguments.iter().any(|a| a.starts_with("--serial")) {
        return live(arguments);
    }
    let mut arguments = arguments.to_vec();
    let update = shell::flag(&mut arguments, "--update");
    shell::nothing_left(&arguments)?;
    let mut tally = Tally::new(None);
    steps(&mut tally, update);
    Ok(tally.finish())
}

/// Runs the emulator steps, which are also part of `cargo xtask test`.
pub(crate) fn steps(tally: &mut Tally, update: bool) {
    tally.step("board: lints, every unsafe block explained", || firmware::lints().map(|()| Outcome::Passed));
    tally.step("board: tests of what needs no hardware", firmware::tests);
    tally.step("board: programs, sizes, no panic within reach of the tick", || {
        for board in firmware::BOARDS {
            firmware::check(board, &firmware::build(board)?)?;
        }
        Ok(Outcome::Passed)
    });
    tally.step("board: sessions on the emulated chip", tests);
    tally.step("board: arms of other people's robot descriptions", driving);
    tally.step("board: figures", || figures(update).map(|()| Outcome::Passed));
}

/// Installs the tools that the build of the emulator needs. Unicorn is built from C code, which needs cmake, and its
/// bindings need libclang.
fn install_tools() -> Result<()> {
    if !works(shell::command("cmake").arg("--version")) {
        shell::apt_install(&["cmake"])?;
    }
    if !has_libclang() {
        shell::apt_install(&["libclang-dev"])?;
    }
    Ok(())
}

/// Returns `true` if bindgen can find libclang, either in the folders of Debian or through LIBCLANG_PATH.
fn has_libclang() -> bool {
    let entries = |place: &Path| std::fs::read_dir(place).into_iter().flatten().flatten();
    let of_llvm = entries(Path::new("/usr/lib")).map(|entry| entry.path().join("lib"));
    let places = of_llvm.chain(["/usr/lib".into(), "/usr/lib/x86_64-linux-gnu".into()]);
    let is_library = |name: &str| {
        let rest = name.strip_prefix("libclang").unwrap_or_default();
        let version = rest.strip_prefix('-').unwrap_or_default();
        rest.starts_with(".so") || version.starts_with(|c: char| c.is_ascii_digit())
    };
    let found = |place: PathBuf| entries(&place).any(|file| is_library(&file.file_name().to_string_lossy()));
    std::env::var_os("LIBCLANG_PATH").is_some() || places.into_iter().any(found)
}

/// Returns a cargo command in `emulator/`. Warnings are errors. This also applies to the crates of `crates/`, because
/// they have other features here than in the workspace and could cause other warnings.
fn cargo(arguments: &[&str]) -> Command {
    let mut cargo = shell::cargo(arguments);
    cargo.current_dir(shell::root().join("emulator"));
    cargo.env("CARGO_TARGET_DIR", shell::target().join("emulator"));
    cargo.env("OPENJTC_FIRMWARE", firmware::directory());
    cargo.env("RUSTFLAGS", "-D warnings");
    cargo
}

/// Builds all programs that the sessions with an emulated board need, except the host program.
pub(crate) fn programs() -> Result<()> {
    install_tools()?;
    firmware::build_fast()?;
    lints()?;
    run(&mut cargo(&["test", "--release", "--no-run"]))?;
    run(&mut cargo(&["build", "--release", "--bins", "--examples"]))
}

fn lints() -> Result<()> {
    run(&mut cargo(&["clippy", "--release", "--all-targets", "--", "-D", "warnings"]))
}

fn tests() -> Result<Outcome> {
    install_tools()?;
    let jtc = suite::programs()?.join("jtc");
    firmware::build_fast()?;
    lints()?;
    let mut counts = Counts::default();
    let mut test = cargo(&["test", "--release", "--no-fail-fast"]);
    let result = run_lines(test.env("OPENJTC_JTC", jtc), |line| count_results(line, &mut counts));
    if counts.failed == 0 {
        result?;
        ensure!(counts.passed > 0, "cargo ran no test at all");
    }
    Ok(Outcome::Counted(counts, String::new()))
}

/// Checks the steps from a robot description to a motion, with the firmware file that is flashed to a board.
fn driving() -> Result<Outcome> {
    let jtc = suite::programs()?.join("jtc");
    run(&mut cargo(&["build", "--release"]))?;
    let emulator = shell::target().join("emulator/release/openjtc-emulate");
    let mut script = shell::command(python::environment("requirements.txt")?);
    script.arg("references/arms/check_driving.py").arg(jtc);
    script.arg("--board").arg(emulator).arg(firmware::elf(firmware::BOARDS[0]));
    script.env("OPENJTC_ROBOTS", python::robots());
    run(script.env("PYTHONDONTWRITEBYTECODE", "1")).map(|()| Outcome::Passed)
}

/// Measures and prints the figures of the firmware, and compares them with the stored figures.
fn figures(update: bool) -> Result<()> {
    install_tools()?;
    let mut text = String::new();
    for board in firmware::BOARDS {
        text += &format!("{board}\n{}", size::regions(board)?);
        text += &shell::read(
            cargo(&["run", "--release", "--quiet", "--example", "figures", "--"]).arg(firmware::elf(board)),
        )?;
        text.push('\n');
    }
    print!("{text}");
    let kept = shell::root().join(FIGURES);
    if update {
        std::fs::write(&kept, &text).with_context(|| kept.display().to_string())?;
        println!("written to {FIGURES}");
        return Ok(());
    }
    compare(&kept, &text)
}

fn compare(kept: &Path, text: &str) -> Result<()> {
    let old = std::fs::read_to_string(kept).with_context(|| kept.display().to_string())?;
    let (old, new): (Vec<&str>, Vec<&str>) = (lasting(&old).collect(), lasting(text).collect());
    if old == new {
        return Ok(());
    }
    for (old, new) in old.iter().zip(&new).filter(|(old, new)| old != new) {
        println!("- {old}\n+ {new}");
    }
    bail!("the figures are not those of {FIGURES}; if that is meant: cargo xtask emulate --update")
}

/// Returns the text without the values that can differ between builds: the line about masked interrupts, and the
/// latencies of the handlers. A latency depends on the exact time of bytes relative to ticks. The measuring program
/// compares the latency of the tick with its limit.
fn lasting(text: &str) -> impl Iterator<Item = &str> {
    let lines = text.lines().filter(|line| !line.contains("interrupts are masked"));
    lines.map(|line| line.split(", begins at most").next().unwrap_or_default())
}

/// Runs an emulated board that a host program can open, until the user interrupts the command.
fn live(arguments: &[String]) -> Result<ExitCode> {
    install_tools()?;
    let elf = firmware::build(firmware::BOARDS[0])?;
    let mut emulate = cargo(&["run", "--release", "--quiet", "--bin", "openjtc-emulate", "--"]);
    run(emulate.arg(elf).args(arguments))?;
    Ok(ExitCode::SUCCESS)
}
