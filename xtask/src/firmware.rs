//! `cargo xtask firmware`: builds the firmware ELF of each board, prints its sizes by memory region, and checks that the tick
//! cannot reach a panic.
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail, ensure};
use object::{Object, ObjectSection, ObjectSegment, SectionFlags};

use crate::panics::reachable_panics;
use crate::paths;
use crate::shell::{self, run};
use crate::suite::count_results;
use crate::tally::{Counts, Outcome};

/// Compiler target of the firmware.
pub(crate) const TARGET: &str = "thumbv7em-none-eabihf";

/// Names of the boards. These names are also the names of the cargo features that select the boards.
pub(crate) const BOARDS: [&str; 3] = ["nucleo-h745zi-q", "nucleo-h745zi-q-ldo", "nucleo-h743zi2"];

/// Functions that run at the priority of the tick. The second function wakes the links, and is the only function that the tick
/// calls through a register.
const ROOTS: [&str; 2] = ["TIM7", "embassy_executor::raw::waker::wake"];

/// Memories of the chip, each with name, first address and number of bytes.
const REGIONS: [(&str, u64, u64); 8] = [
    ("flash bank 1", 0x0800_0000, 1024 * 1024),
    ("flash bank 2", 0x0810_0000, 1024 * 1024),
    ("ITCM", 0x0000_0000, 64 * 1024),
    ("DTCM", 0x2000_0000, 128 * 1024),
    ("AXI SRAM", 0x2400_0000, 512 * 1024),
    ("SRAM1", 0x3000_0000, 128 * 1024),
    ("SRAM2 and 3", 0x3002_0000, 160 * 1024),
    ("SRAM4", 0x3800_0000, 64 * 1024),
];

/// Adds the compiler target of the firmware if rustup manages the toolchain.
pub(crate) fn add_target() -> Result<()> {
    // If rustup does not manage the toolchain, the toolchain already contains its targets.
    if let Ok(installed) = shell::read(shell::command("rustup").args(["target", "list", "--installed"]))
        && !installed.lines().any(|target| target == TARGET)
    {
        run(shell::command("rustup").args(["target", "add", TARGET]))?;
    }
    Ok(())
}

/// Returns a command that runs cargo in `firmware/` for one board.
fn cargo_for(board: &str, subcommand: &str) -> Result<Command> {
    let mut cargo =
        shell::cargo(&[subcommand, "--locked", "--release", "--no-default-features", "--features", board]);
    cargo.current_dir(shell::root().join("firmware"));
    cargo.env("CARGO_TARGET_DIR", directory());
    // If the firmware contained paths of this computer, these paths would change the size of the firmware.
    cargo.arg("--config").arg(paths::remapped(TARGET)?);
    Ok(cargo)
}

/// Returns the build folder of the firmware.
pub(crate) fn directory() -> PathBuf {
    shell::target().join("firmware")
}

/// Returns the path of a board's firmware ELF after its build.
pub(crate) fn elf(board: &str) -> PathBuf {
    directory().join(format!("{board}.elf"))
}

/// Builds the firmware ELF of a board and returns its path.
pub(crate) fn build(board: &str) -> Result<PathBuf> {
    add_target()?;
    run(&mut cargo_for(board, "build")?)?;
    let built = directory().join(TARGET).join("release/openjtc-firmware");
    let elf = elf(board);
    std::fs::copy(&built, &elf).with_context(|| format!("{} to {}", built.display(), elf.display()))?;
    Ok(elf)
}

/// Bit rate of both serial lines in the firmware that [`build_fast`] builds, Bd: the highest rate of J-01.
const FAST: &str = "15000000";

/// Builds the firmware of the first board with the fastest serial lines. Tests need this firmware in addition to the firmware
/// that is flashed. The build uses a separate folder, so that it does not invalidate the build of the flashed firmware.
pub(crate) fn build_fast() -> Result<PathBuf> {
    add_target()?;
    let target = directory().join("fast");
    run(cargo_for(BOARDS[0], "build")?.env("CARGO_TARGET_DIR", &target).env("OPENJTC_BAUD", FAST))?;
    let built = target.join(TARGET).join("release/openjtc-firmware");
    let elf = elf(&format!("{}-{FAST}", BOARDS[0]));
    std::fs::copy(&built, &elf).with_context(|| format!("{} to {}", built.display(), elf.display()))?;
    Ok(elf)
}

/// Returns the bytes of static data in each memory region, in the order of [`REGIONS`]. Each entry contains name, used
/// bytes and size of the region.
pub(crate) fn used(elf: &Path) -> Result<Vec<(&'static str, u64, u64)>> {
    let bytes = std::fs::read(elf)?;
    let file = object::File::parse(&*bytes)?;
    let mut used = REGIONS.map(|(name, _, size)| (name, 0_u64, size));
    let mut add = |address: u64, size: u64| -> Result<()> {
        let at = REGIONS.iter().position(|(_, start, len)| (*start..start + len).contains(&address));
        let at = at.with_context(|| format!("{size} B at {address:#x} are in no known memory"))?;
        used[at].1 += size;
        Ok(())
    };
    for section in file.sections().filter(|section| section.size() > 0) {
        let SectionFlags::Elf { sh_flags } = section.flags() else { continue };
        if sh_flags & u64::from(object::elf::SHF_ALLOC) != 0 {
            add(section.address(), section.size())?;
        }
    }
    // Flash also contains the initial values of .data.
    for segment in file.segments() {
        let (_, in_file) = segment.file_range();
        if in_file > 0 && segment.address() >= 0x2000_0000 {
            used[0].1 += in_file;
        }
    }
    Ok(used.into_iter().filter(|(_, bytes, _)| *bytes > 0).collect())
}

/// Runs all checks of the firmware ELF of a board and prints the results.
pub(crate) fn check(board: &str, elf: &Path) -> Result<()> {
    for (name, bytes, size) in used(elf)? {
        println!("{board}: {name}: {bytes} of {size} B");
        ensure!(bytes <= size, "{name} holds {size} B, the program takes {bytes} B");
    }
    let report = reachable_panics(&std::fs::read(elf)?, &ROOTS)?;
    println!("{board}: {report}");
    ensure!(report.paths.is_empty(), "the tick can reach a panic");
    ensure!(report.indirect.len() <= ROOTS.len(), "the tick jumps to places that are not looked at");
    Ok(())
}

/// Lints the firmware code. Every `unsafe` block must have a comment that explains it. Prints the number of `unsafe`
/// blocks.
pub(crate) fn lints() -> Result<()> {
    add_target()?;
    for board in BOARDS {
        let mut clippy = cargo_for(board, "clippy")?;
        clippy.args(["--", "-D", "warnings", "-D", "clippy::undocumented_unsafe_blocks"]);
        run(&mut clippy)?;
    }
    let mut blocks = 0;
    for path in shell::files(&shell::root().join("firmware/src"), &["rs"]) {
        let source = std::fs::read_to_string(path)?;
        let code = source.lines().map(|line| line.split("//").next().unwrap_or_default());
        blocks += code.map(|line| line.matches("unsafe {").count()).sum::<usize>();
    }
    println!("{blocks} unsafe blocks in firmware/, each with its reason beside it");
    Ok(())
}

/// Tests the library part of the firmware, which needs no hardware, on this computer.
pub(crate) fn tests() -> Result<Outcome> {
    let host = shell::read(shell::command("rustc").args(["--print", "host-tuple"]))?;
    let mut cargo = shell::cargo(&["test", "--lib", "--target", host.trim()]);
    cargo.current_dir(shell::root().join("firmware")).env("CARGO_TARGET_DIR", directory());
    let mut counts = Counts::default();
    let result = shell::run_lines(&mut cargo, |line| count_results(line, &mut counts));
    if counts.failed == 0 {
        result?;
    }
    Ok(Outcome::Counted(counts, String::new()))
}

/// Runs `cargo xtask firmware`. `arguments` contains names of boards. If `arguments` is empty, the command builds the
/// firmware of all boards.
pub(crate) fn main(arguments: &[String]) -> Result<ExitCode> {
    let boards: Vec<&str> = match arguments {
        [] => BOARDS.to_vec(),
        some => some.iter().map(String::as_str).collect(),
    };
    if let Some(other) = boards.iter().find(|board| !BOARDS.contains(board)) {
        bail!("no board `{other}`; there are {}", BOARDS.join(", "));
    }
    for board in boards {
        let elf = build(board)?;
        check(board, &elf)?;
        println!("{}", elf.display());
    }
    println!("to flash a connected board: cd firmware && cargo run --release");
    Ok(ExitCode::SUCCESS)
}
