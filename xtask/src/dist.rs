//! `cargo xtask dist`: builds and checks the files of a release.
mod check;
mod chroot;
mod dashboard;
mod deb;
pub(crate) mod graph;
mod images;
pub(crate) mod licences;
mod packages;
mod pages;
mod programs;
mod sbom;
mod tree;
mod twice;
mod wheel;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};

pub(crate) use check::steps;

use crate::shell::{self, Scratch};
use packages::{Made, Release};
use programs::PLATFORMS;

/// Runs `cargo xtask dist`. `arguments` may contain `--out DIR`, `--quick`, `--made`, `--twice` and `--check`.
pub(crate) fn main(arguments: &[String]) -> Result<ExitCode> {
    let mut arguments = arguments.to_vec();
    let out = shell::option(&mut arguments, "--out")?;
    let out = out.map_or_else(|| shell::target().join("dist-files"), |out| shell::root().join(out));
    let quick = shell::flag(&mut arguments, "--quick");
    let made = shell::flag(&mut arguments, "--made");
    let twice = shell::flag(&mut arguments, "--twice");
    let check = shell::flag(&mut arguments, "--check");
    shell::nothing_left(&arguments)?;
    let left_out = if made { Vec::new() } else { make(&out, quick)? };
    if twice {
        twice::compare(&out, quick)?;
    }
    if check {
        check::install(&out)?;
    }
    println!("\nrelease files in {}:", out.display());
    for line in std::fs::read_to_string(out.join(tree::SUMS))?.lines() {
        println!("  {line}");
    }
    for line in left_out {
        println!("left out: {line}");
    }
    Ok(ExitCode::SUCCESS)
}

/// Creates all files of a release in an empty folder. Returns the parts that the command has omitted, with the reasons.
fn make(out: &Path, quick: bool) -> Result<Vec<String>> {
    let mut left_out = Vec::new();
    empty(out)?;
    let time = programs::time()?;
    let version = version()?;
    let own = programs::own()?;
    let graph = graph::shipped()?;
    let third_party = licences::third_party(&graph)?;
    if quick {
        left_out.push(
            "cargo-deny (--quick); `cargo xtask test` holds deny.toml against what cargo resolves".into(),
        );
    } else {
        crate::deny::with_cargo_deny()?;
    }
    left_out.push("cargo-deny's advisories: their database is on GitHub, and is asked by hand (cargo deny check advisories)".into());
    let bill = sbom::bill(&graph, &version, time)?;
    sbom::validate(&bill)?;
    let release = Release {
        version: version.clone(),
        time,
        third_party: third_party.clone(),
        images: images::build()?,
    };
    let mut made = vec![
        Made { name: format!("openjtc-{version}.cdx.json"), bytes: bill.into_bytes() },
        Made { name: "THIRD-PARTY.txt".into(), bytes: third_party.clone().into_bytes() },
        Made { name: "firmware.json".into(), bytes: images::list(&release.images, &version)?.into_bytes() },
    ];
    for image in &release.images {
        made.push(Made { name: images::name(image), bytes: image.bin.clone() });
    }
    let runnable = programs::build(own, time)?;
    made.extend(release.packages(own, &runnable, &runnable)?);
    if wheel::folder().is_some() {
        made.push(wheel::build(own, time, &third_party)?);
    } else {
        left_out.push("the Python wheel: crates/openjtc-py is not there".into());
    }
    for platform in PLATFORMS.into_iter().filter(|platform| *platform != own) {
        let machine = platform.machine;
        if quick {
            left_out.push(format!("all for {machine} (--quick)"));
            continue;
        }
        match programs::build(platform, time) {
            Ok(programs) => made.extend(release.packages(platform, &programs, &runnable)?),
            Err(error) => {
                left_out.push(format!("the programs for {machine}, which cannot be built here: {error:#}"))
            }
        }
        if wheel::folder().is_some() {
            match wheel::build(platform, time, &third_party) {
                Ok(wheel) => made.push(wheel),
                Err(error) => left_out
                    .push(format!("the Python wheel for {machine}, which cannot be built here: {error:#}")),
            }
        }
    }
    // The command writes the files only after all of them are ready, so a failed run leaves an empty folder.
    for Made { name, bytes } in made {
        std::fs::write(out.join(&name), bytes).with_context(|| name.clone())?;
    }
    tree::write_sums(out)?;
    Ok(left_out)
}

/// Returns the version of the workspace.
fn version() -> Result<String> {
    let manifest = std::fs::read_to_string(shell::root().join("Cargo.toml")).context("Cargo.toml")?;
    let manifest: toml::Table = toml::from_str(&manifest).context("Cargo.toml")?;
    let version = manifest["workspace"]["package"]["version"].as_str();
    Ok(version.context("the workspace has no version")?.to_owned())
}

/// Creates the folder, or removes the files of an earlier release that are listed in its checksum file. If the folder contains
/// any other file, returns an error and does not change the folder.
fn empty(out: &Path) -> Result<()> {
    std::fs::create_dir_all(out).with_context(|| out.display().to_string())?;
    let list = std::fs::read_to_string(out.join(tree::SUMS)).unwrap_or_default();
    let listed: BTreeSet<&str> = list.lines().filter_map(|line| Some(line.split_once("  ")?.1)).collect();
    let mut earlier = Vec::new();
    for entry in std::fs::read_dir(out)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        ensure!(
            path.is_file() && (name == tree::SUMS || listed.contains(&*name)),
            "{} holds {name:?}, which no release has left there; name another folder with --out",
            out.display()
        );
        earlier.push(path);
    }
    earlier.iter().try_for_each(|path| std::fs::remove_file(path).with_context(|| path.display().to_string()))
}

/// Builds the packages and archives twice from the existing programs in `folder`, so that the caller can compare both
/// builds. Both builds use the same commit and the same board images.
fn assembled_twice(folder: &Path) -> Result<[Vec<Made>; 2]> {
    let (time, own) = (programs::time()?, programs::own()?);
    let mut images = images::build()?;
    let mut again = || -> Result<Vec<Made>> {
        let third_party = licences::third_party(&graph::shipped()?)?;
        let release = Release { version: version()?, time, third_party, images: std::mem::take(&mut images) };
        let made = release.packages(own, folder, folder)?;
        images = release.images;
        Ok(made)
    };
    Ok([again()?, again()?])
}

/// Writes files into a new temporary folder and returns their paths.
fn write(made: &[Made], name: &str) -> Result<(Scratch, Vec<PathBuf>)> {
    let scratch = Scratch::new(name)?;
    let mut paths = Vec::new();
    for Made { name, bytes } in made {
        let path = scratch.path().join(name);
        std::fs::write(&path, bytes)?;
        paths.push(path);
    }
    Ok((scratch, paths))
}
