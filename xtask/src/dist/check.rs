//! Test of the packages. The test installs the packages in a separate Debian system, uses them, removes them and purges
//! them. After the purge, the system must not contain any file of the packages.
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use super::chroot::Root;
use super::{assembled_twice, programs, write};
use crate::shell::{self, run};
use crate::tally::{Outcome, Tally};

/// Runs the steps that belong to `cargo xtask test`, with the programs that were built for the tests.
pub(crate) fn steps(tally: &mut Tally) {
    tally.step("packages: assembled twice, installed, used, removed", || {
        if programs::own().is_err() || !Path::new("/var/lib/dpkg/status").exists() {
            return Ok(Outcome::Skipped("packages are for Debian on x86_64 and aarch64".into()));
        }
        if shell::read(shell::command("id").arg("-u"))?.trim() != "0" {
            return Ok(Outcome::Skipped("only root can change into the root of another system".into()));
        }
        cheaply().map(|()| Outcome::Passed)
    });
}

fn cheaply() -> Result<()> {
    let [first, second] = assembled_twice(&crate::suite::programs()?)?;
    for (first, second) in first.iter().zip(&second) {
        ensure!(first.bytes == second.bytes, "{} is other bytes when it is made again", first.name);
        println!("{}: {} B, twice the same", first.name, first.bytes.len());
    }
    ensure!(first.len() == second.len(), "another number of files when they are made again");
    let (_scratch, paths) = write(&first, "packages")?;
    trial(&Root::copied("root")?, &debs(&paths))
}

/// Installs the packages of a release in a newly created Debian system.
pub(super) fn install(out: &Path) -> Result<()> {
    let paths: Vec<PathBuf> = fs::read_dir(out)?.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    let own = format!("_{}.deb", programs::own()?.debian);
    let debs: Vec<PathBuf> =
        debs(&paths).into_iter().filter(|path| path.to_string_lossy().ends_with(&own)).collect();
    run(shell::command("sha256sum").args(["--check", "--quiet", super::tree::SUMS]).current_dir(out))?;
    trial(&Root::bootstrapped("bookworm")?, &debs)
}

fn debs(paths: &[PathBuf]) -> Vec<PathBuf> {
    let mut debs: Vec<PathBuf> =
        paths.iter().filter(|path| path.extension().is_some_and(|ending| ending == "deb")).cloned().collect();
    debs.sort();
    debs
}

/// Tests the packages from the installation to the purge.
fn trial(root: &Root, debs: &[PathBuf]) -> Result<()> {
    ensure!(debs.len() == 2, "there are {} packages to try, not those of jtc and ucom", debs.len());
    let before = root.files()?;
    run(root.dpkg().arg("--install").args(debs))?;
    run(root.dpkg().args(["--verify", "jtc", "ucom"]))?;
    used(root)?;
    units(root)?;
    // Creates files like the files that an agent creates during use.
    let state = root.path().join("var/lib/jtc/cell1");
    fs::create_dir_all(&state)?;
    fs::write(state.join("tokens.toml"), "")?;

    run(root.dpkg().args(["--remove", "jtc", "ucom"]))?;
    for program in ["usr/bin/jtc", "usr/bin/ucom"] {
        ensure!(root.has(program).is_none(), "/{program} is there after the packages are removed");
    }
    ensure!(
        state.join("tokens.toml").exists(),
        "removing a package, which can be undone, has removed an agent's tokens"
    );
    run(root.dpkg().args(["--purge", "jtc", "ucom"]))?;
    let after = root.files()?;
    let mut left = Vec::new();
    for (path, now) in &after {
        match before.get(path) {
            None => left.push(format!("/{path} is left")),
            Some(then) if then != now => left.push(format!("/{path} was {then} and is {now}")),
            Some(_) => {}
        }
    }
    left.extend(
        before.keys().filter(|path| !after.contains_key(*path)).map(|path| format!("/{path} is gone")),
    );
    if !left.is_empty() {
        bail!("the packages leave traces after they are purged:\n{}", left.join("\n"));
    }
    println!("{} files and folders, as before the packages were installed", after.len());
    Ok(())
}

/// Runs the programs as a user without privileges. Checks that their manual pages, completions and other files are
/// installed, and that the images of boards match firmware.json.
fn used(root: &Root) -> Result<()> {
    for name in ["jtc", "ucom"] {
        print!("{}", shell::read(root.as_nobody(name).arg("--version"))?);
        let files = [
            format!("usr/share/bash-completion/completions/{name}"),
            format!("usr/share/zsh/vendor-completions/_{name}"),
            format!("usr/share/fish/vendor_completions.d/{name}.fish"),
            format!("usr/share/doc/{name}/copyright"),
            format!("usr/share/man/man1/{name}.1.gz"),
            format!("usr/lib/udev/rules.d/70-{name}.rules"),
        ];
        for file in files {
            ensure!(root.has(&file).is_some(), "/{file} is not installed");
        }
        if root.has("usr/bin/man").is_some() {
            let page = shell::read(root.as_nobody("man").args(["-P", "cat", name]).env("MANWIDTH", "80"))?;
            ensure!(page.contains("NAME") && page.contains(name), "`man {name}` shows no page of it");
        }
    }
    run(root.as_nobody("jtc").args(["demo", "--speed", "max", "--out", "/tmp/demo"]).current_dir("/"))?;
    let report = root.path().join("tmp/demo/report.html");
    ensure!(report.exists(), "`jtc demo` wrote no report");
    fs::remove_dir_all(root.path().join("tmp/demo"))?;
    let list = root.path().join("usr/share/openjtc/firmware/firmware.json");
    let list: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(&list)?).context("firmware.json")?;
    let images = list["images"].as_array().context("firmware.json lists no images")?;
    for image in images {
        let file = image["file"].as_str().context("an image without a file")?;
        let bytes = fs::read(root.path().join("usr/share/openjtc/firmware").join(file))?;
        ensure!(image["sha256"] == super::tree::sha256(&bytes), "{file} is not what firmware.json says");
    }
    println!("{} images of boards, as firmware.json lists them", images.len());
    Ok(())
}

/// Checks that the systemd unit is valid, that its user exists, and that no unit is enabled.
fn units(root: &Root) -> Result<()> {
    for folder in ["etc/systemd/system", "etc/rc2.d"] {
        for file in shell::files(&root.path().join(folder), &["service"]) {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            ensure!(!name.starts_with("jtc"), "{name} is enabled by the package");
        }
    }
    if root.has("usr/bin/systemd-analyze").or_else(|| root.has("bin/systemd-analyze")).is_none() {
        println!("no systemd: neither its unit nor its user is tried");
        return Ok(());
    }
    let users = fs::read_to_string(root.path().join("etc/passwd"))?;
    ensure!(users.lines().any(|line| line.starts_with("jtc:")), "the user jtc was not made");
    // The test first checks an invalid unit, to verify that the check detects an error.
    let broken = root.path().join("etc/systemd/system/jtc-broken.service");
    fs::write(&broken, "[Service]\nExecStart=/usr/bin/no-such-program\nNoSuchKey=1\n")?;
    let found = complaints(root, "jtc-broken.service")?;
    fs::remove_file(&broken)?;
    if found.is_empty() {
        println!("systemd-analyze verify does not work here: the unit is not tried");
        return Ok(());
    }
    let found = complaints(root, "jtc-serve@cell1.service")?;
    ensure!(found.is_empty(), "systemd-analyze verify: {}", found.join("; "));
    println!("systemd-analyze verify finds nothing in jtc-serve@.service");
    Ok(())
}

/// Returns the problems that systemd reports for a unit of this project. The function does not check other units, because the
/// copied Debian system may lack their dependencies.
fn complaints(root: &Root, unit: &str) -> Result<Vec<String>> {
    let verified = root.command("systemd-analyze").args(["verify", "--man=no", unit]).output()?;
    let text = String::from_utf8_lossy(&verified.stderr).into_owned();
    Ok(text.lines().filter(|line| line.contains("jtc")).map(str::to_owned).collect())
}
