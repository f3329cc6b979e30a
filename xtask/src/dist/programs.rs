//! Programs of a release, which are statically linked and stripped. The bytes of the programs do not depend on the
//! folder of the checkout or on the folders of cargo.
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::shell::{self, run};
use crate::{paths, python};

/// Names of the programs, with the packages that contain them.
pub(super) const PROGRAMS: [(&str, &str); 2] = [("jtc", "jtc-cli"), ("ucom", "ucom-cli")];

/// Platform for which a program is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Platform {
    /// Platform name that the Linux kernel and Rust use.
    pub machine: &'static str,
    /// Platform name that Debian uses.
    pub debian: &'static str,
    /// Rust target for static programs.
    pub triple: &'static str,
    /// Rust target for libraries that Python loads.
    pub library: &'static str,
}

/// Platforms for which a release has programs.
pub(super) const PLATFORMS: [Platform; 2] = [
    Platform {
        machine: "x86_64",
        debian: "amd64",
        triple: "x86_64-unknown-linux-musl",
        library: "x86_64-unknown-linux-gnu",
    },
    Platform {
        machine: "aarch64",
        debian: "arm64",
        triple: "aarch64-unknown-linux-musl",
        library: "aarch64-unknown-linux-gnu",
    },
];

/// Returns the platform of this computer. Returns an error if a release contains no programs for this platform.
pub(super) fn own() -> Result<Platform> {
    let machine = std::env::consts::ARCH;
    let own = PLATFORMS.into_iter().find(|platform| platform.machine == machine);
    own.with_context(|| format!("there are no packages for computers like this ({machine}), which would have to run their programs"))
}

/// Installs the compiler target if rustup manages the toolchain. Returns an error if the target is not available on
/// this computer.
pub(super) fn add_target(triple: &str) -> Result<()> {
    let installed = shell::read(shell::command("rustup").args(["target", "list", "--installed"]))?;
    if installed.lines().any(|target| target == triple) {
        return Ok(());
    }
    run(shell::command("rustup").args(["target", "add", triple]))
}

/// Returns the Unix time that all archives contain, s. This time is the time of the last commit, or
/// `SOURCE_DATE_EPOCH`.
pub(super) fn time() -> Result<u64> {
    let time = match std::env::var("SOURCE_DATE_EPOCH") {
        Ok(time) => time,
        Err(_) => shell::read(shell::command("git").args(["log", "-1", "--format=%ct"])).context(
            "the time of the release is that of its commit; outside a checkout set SOURCE_DATE_EPOCH",
        )?,
    };
    time.trim().parse().with_context(|| format!("SOURCE_DATE_EPOCH is {time:?}, and no number of seconds"))
}

/// Returns the folder of the tools that requirements-dist.txt lists.
pub(super) fn tools() -> Result<PathBuf> {
    let python = python::environment("requirements-dist.txt")?;
    Ok(python.parent().context("an interpreter in no folder")?.to_owned())
}

/// Adds switches for `triple` to a cargo command, so that the output does not contain paths of this computer.
pub(super) fn without_paths(command: &mut Command, triple: &str) -> Result<()> {
    command.arg("--config").arg(paths::remapped(triple)?);
    // These options remove the paths of this computer from compiled C code and assembler code.
    let folders = paths::folders()?;
    let maps: Vec<String> =
        folders.iter().map(|(path, name)| format!("-ffile-prefix-map={}={name}", path.display())).collect();
    command.env(format!("CFLAGS_{}", triple.replace('-', "_")), format!("-g0 {}", maps.join(" ")));
    Ok(())
}

/// Sets the environment so that cargo uses the compilers and the linker in `tools`.
pub(super) fn with_tools(command: &mut Command, tools: &Path, time: u64) -> Result<()> {
    let others = std::env::var_os("PATH").unwrap_or_default();
    let all = [tools.to_owned()].into_iter().chain(std::env::split_paths(&others));
    command.env("PATH", std::env::join_paths(all)?).env("SOURCE_DATE_EPOCH", time.to_string());
    Ok(())
}

/// Builds the programs of a release and returns the folder that contains them.
pub(super) fn build(platform: Platform, time: u64) -> Result<PathBuf> {
    add_target(platform.triple)?;
    let tools = tools()?;
    let mut build = shell::command(tools.join("cargo-zigbuild"));
    build.args(["zigbuild", "--locked", "--profile", "dist", "--target", platform.triple]);
    for (_, package) in PROGRAMS {
        build.args(["--package", package]);
    }
    without_paths(&mut build, platform.triple)?;
    with_tools(&mut build, &tools, time)?;
    // The build removes all debug information.
    build.env("CARGO_PROFILE_DIST_STRIP", "symbols").env("CARGO_PROFILE_DIST_DEBUG", "false");
    build.env("CARGO_TARGET_DIR", shell::target());
    run(&mut build)?;
    let folder = shell::target().join(platform.triple).join("dist");
    for (name, _) in PROGRAMS {
        let bytes = std::fs::read(folder.join(name)).with_context(|| name.to_owned())?;
        is_static(name, &bytes)?;
        has_no_paths(name, &bytes)?;
    }
    Ok(folder)
}

/// Returns an error if the program requests a dynamic loader, because such a program needs libraries of the operating
/// system.
fn is_static(name: &str, bytes: &[u8]) -> Result<()> {
    use object::read::elf::{FileHeader as _, ProgramHeader as _};
    let header = object::elf::FileHeader64::<object::Endianness>::parse(bytes)?;
    let endian = header.endian()?;
    let loader = header
        .program_headers(endian, bytes)?
        .iter()
        .any(|part| part.p_type(endian) == object::elf::PT_INTERP);
    ensure!(!loader, "{name} is not linked statically");
    Ok(())
}

/// Returns an error if a file contains the path of a folder of this computer.
pub(super) fn has_no_paths(name: &str, bytes: &[u8]) -> Result<()> {
    for (path, _) in paths::folders()? {
        let path = path.to_string_lossy();
        if let Some(at) = bytes.windows(path.len()).position(|window| window == path.as_bytes()) {
            let text = String::from_utf8_lossy(&bytes[at..(at + 120).min(bytes.len())]).into_owned();
            anyhow::bail!("{name} has a path of this computer in it: {text:?}");
        }
    }
    Ok(())
}
