//! Small Debian system in a folder, in which a test installs packages.
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use super::tree::sha256;
use crate::shell::{self, Scratch, apt_install, run, works};

/// Folders that the test does not compare, because they contain dpkg's own records or temporary files.
const UNCOMPARED: [&str; 6] = ["var/lib/dpkg", "var/log", "var/cache", "proc", "tmp", "run"];
/// Backup files that are written by the programs that change user accounts.
const BACKUPS: [&str; 7] = [
    "etc/passwd-",
    "etc/group-",
    "etc/shadow-",
    "etc/gshadow-",
    "etc/subuid-",
    "etc/subgid-",
    "etc/.pwd.lock",
];
/// Packages that the test uses in addition to the essential packages, if these packages are installed on this computer.
const WANTED: [&str; 3] = ["passwd", "systemd", "man-db"];
/// Files of packages that the test does not need.
const LEFT_OUT: [&str; 5] =
    ["/usr/share/doc", "/usr/share/locale", "/usr/share/info", "/usr/share/man", "/usr/lib/udev/hwdb.d"];

/// Folder of the Debian system. The folder is removed when this value is dropped.
pub(super) struct Root(Scratch);

/// Package of this computer, with data from dpkg.
struct Installed {
    essential: bool,
    /// Dependencies of the package. Each entry is a list of alternative package names.
    depends: Vec<Vec<String>>,
}

impl Root {
    /// Copies the essential packages of the Debian system on this computer. The copy needs no network and takes
    /// seconds.
    pub(super) fn copied(name: &str) -> Result<Self> {
        let root = Self(Scratch::new(name)?);
        for folder in ["bin", "sbin", "lib", "lib32", "lib64", "libx32"] {
            if let Ok(to) = fs::read_link(Path::new("/").join(folder)) {
                fs::create_dir_all(root.path().join(&to))?;
                symlink(to, root.path().join(folder))?;
            }
        }
        let packages = closure(&installed()?)?;
        let mut list = shell::command("dpkg-query");
        for path in shell::read(list.arg("-L").args(&packages))?.lines() {
            if path.starts_with('/') && !LEFT_OUT.iter().any(|folder| Path::new(path).starts_with(folder)) {
                copy(Path::new(path), &root.path().join(&path[1..])).with_context(|| path.to_owned())?;
            }
        }
        root.remember(&packages)?;
        root.complete()?;
        Ok(root)
    }

    /// Creates a new Debian 12 system from the Debian archive, with the programs that the test uses.
    pub(super) fn bootstrapped(name: &str) -> Result<Self> {
        if !works(shell::command("debootstrap").arg("--version")) {
            apt_install(&["debootstrap"])?;
        }
        let root = Self(Scratch::new(name)?);
        let mut debootstrap = shell::command("debootstrap");
        debootstrap.args(["--variant=minbase", "--include=systemd,man-db", "bookworm"]).arg(root.path());
        run(debootstrap.env("DEBIAN_FRONTEND", "noninteractive"))?;
        Ok(root)
    }

    /// Returns the path of the folder with the Debian system.
    pub(super) fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes the dpkg records of the new system. The new records are copies of the records on this computer for the
    /// copied packages.
    fn remember(&self, packages: &BTreeSet<String>) -> Result<()> {
        let to = self.path().join("var/lib/dpkg");
        for folder in ["info", "updates", "triggers", "alternatives"] {
            fs::create_dir_all(to.join(folder))?;
        }
        fs::write(to.join("status"), shell::read(shell::command("dpkg-query").arg("-s").args(packages))?)?;
        for entry in fs::read_dir("/var/lib/dpkg/info")? {
            let path = entry?.path();
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            if packages.contains(name.split(':').next().unwrap_or_default()) {
                fs::copy(&path, to.join("info").join(path.file_name().unwrap_or_default()))?;
            }
        }
        Ok(())
    }

    /// Creates the files that the installation scripts of essential packages create.
    fn complete(&self) -> Result<()> {
        for (file, from) in [("passwd", "passwd.master"), ("group", "group.master")] {
            fs::copy(Path::new("/usr/share/base-passwd").join(from), self.path().join("etc").join(file))?;
        }
        for folder in ["dev", "proc", "tmp", "run"] {
            fs::create_dir_all(self.path().join(folder))?;
        }
        fs::set_permissions(self.path().join("tmp"), fs::Permissions::from_mode(0o1777))?;
        let null = self.path().join("dev/null");
        if !works(shell::command("mknod").args(["-m", "666"]).arg(&null).args(["c", "1", "3"])) {
            fs::write(&null, "")?;
            fs::set_permissions(&null, fs::Permissions::from_mode(0o666))?;
        }
        if self.has("usr/bin/awk").is_none() && self.has("usr/bin/mawk").is_some() {
            symlink("mawk", self.path().join("usr/bin/awk"))?;
        }
        for program in ["ldconfig", "pwconv", "grpconv"] {
            run(&mut self.command(program))?;
        }
        Ok(())
    }

    /// Returns the path of a file of the system. Returns `None` if the file does not exist.
    pub(super) fn has(&self, path: &str) -> Option<PathBuf> {
        Some(self.path().join(path)).filter(|path| path.symlink_metadata().is_ok())
    }

    /// Returns a command that runs `program` in the system as root.
    pub(super) fn command(&self, program: &str) -> Command {
        self.chroot(&[], program)
    }

    /// Returns a command that runs `program` in the system as a user without privileges.
    pub(super) fn as_nobody(&self, program: &str) -> Command {
        self.chroot(&["--userspec=65534:65534"], program)
    }

    fn chroot(&self, switches: &[&str], program: &str) -> Command {
        let mut chroot = shell::command("chroot");
        chroot.args(switches).arg(self.path()).arg(program);
        chroot
            .env_clear()
            .env("PATH", "/usr/sbin:/usr/bin:/sbin:/bin")
            .env("LC_ALL", "C.UTF-8")
            .env("HOME", "/tmp");
        chroot
    }

    /// Returns a command that runs dpkg on the system. This dpkg also installs manual pages; in some containers, the
    /// configuration of dpkg excludes manual pages.
    pub(super) fn dpkg(&self) -> Command {
        let mut dpkg = shell::command("dpkg");
        dpkg.arg("--root").arg(self.path()).arg("--path-include=/usr/*").env("LC_ALL", "C.UTF-8");
        dpkg.env("PATH", "/usr/sbin:/usr/bin:/sbin:/bin").env("DEBIAN_FRONTEND", "noninteractive");
        dpkg
    }

    /// Returns all files that packages may have created, by path, with kind, mode, owner and content.
    pub(super) fn files(&self) -> Result<BTreeMap<String, String>> {
        let mut found = BTreeMap::new();
        let mut waiting = vec![self.path().to_owned()];
        while let Some(folder) = waiting.pop() {
            for entry in fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
                let path = entry?.path();
                let name = path.strip_prefix(self.path())?.to_string_lossy().into_owned();
                if UNCOMPARED.contains(&&*name) || BACKUPS.contains(&&*name) {
                    continue;
                }
                let data = path.symlink_metadata()?;
                let content = if data.is_symlink() {
                    fs::read_link(&path)?.display().to_string()
                } else if data.is_file() {
                    sha256(&fs::read(&path)?)
                } else {
                    String::new()
                };
                if data.is_dir() {
                    waiting.push(path);
                }
                found.insert(name, format!("{:o} {}:{} {content}", data.mode(), data.uid(), data.gid()));
            }
        }
        Ok(found)
    }
}

/// Returns all packages that are installed on this computer.
fn installed() -> Result<BTreeMap<String, Installed>> {
    let mut query = shell::command("dpkg-query");
    let format = "${db:Status-Abbrev}\t${Package}\t${Essential}\t${Pre-Depends}, ${Depends}\t${Provides}\n";
    let text = shell::read(query.args(["-W", "-f", format]))
        .context("packages can be tried on Debian and its kin only, where dpkg is")?;
    let names = |list: &str| -> Vec<String> {
        let parts = list.split('|').filter_map(|part| part.split_whitespace().next());
        parts.map(|name| name.split(':').next().unwrap_or(name).to_owned()).collect()
    };
    let mut packages = BTreeMap::new();
    let mut provided: Vec<(String, String)> = Vec::new();
    for line in text.lines() {
        let [status, name, essential, depends, provides] = line.split('\t').collect::<Vec<_>>()[..] else {
            continue;
        };
        if !status.starts_with("ii") {
            continue;
        }
        let depends = depends.split(',').map(names).filter(|any| !any.is_empty()).collect();
        packages.insert(name.to_owned(), Installed { essential: essential == "yes", depends });
        provided.extend(provides.split(',').flat_map(names).map(|other| (other, name.to_owned())));
    }
    // A package may provide other package names. The function adds such a name as a package that depends on the
    // providing package.
    for (other, by) in provided {
        packages.entry(other).or_insert(Installed { essential: false, depends: vec![vec![by]] });
    }
    Ok(packages)
}

/// Returns the essential packages and the packages that the test uses, with all of their dependencies.
fn closure(installed: &BTreeMap<String, Installed>) -> Result<BTreeSet<String>> {
    let begins = |name: &str, package: &Installed| package.essential || WANTED.contains(&name);
    let mut waiting: Vec<&str> =
        installed.iter().filter(|(name, package)| begins(name, package)).map(|(name, _)| &**name).collect();
    let (mut seen, mut real) = (BTreeSet::new(), BTreeSet::new());
    let provides = |name: &str| !Path::new(&format!("/var/lib/dpkg/info/{name}.list")).exists();
    while let Some(name) = waiting.pop() {
        if !seen.insert(name) {
            continue;
        }
        let architecture = shell_architecture()?;
        if !provides(name) || !provides(&format!("{name}:{architecture}")) {
            real.insert(name.to_owned());
        }
        for any in &installed[name].depends {
            match any.iter().find_map(|one| installed.get_key_value(one)) {
                Some((one, _)) => waiting.push(one),
                None => bail!("{name} needs {}, which this computer does not have", any.join(" or ")),
            }
        }
    }
    ensure!(real.contains("dpkg"), "this computer has no essential packages");
    Ok(real)
}

/// Returns the name that Debian uses for the architecture of this computer.
fn shell_architecture() -> Result<&'static str> {
    Ok(super::programs::own()?.debian)
}

/// Copies a file, link or folder unchanged. Skips a path of a package that does not exist on this computer.
fn copy(from: &Path, to: &Path) -> Result<()> {
    let Ok(data) = from.symlink_metadata() else { return Ok(()) };
    if let Some(folder) = to.parent() {
        fs::create_dir_all(folder)?;
    }
    if to.symlink_metadata().is_ok() {
        return Ok(());
    }
    if data.is_symlink() {
        symlink(fs::read_link(from)?, to)?;
    } else if data.is_dir() {
        fs::create_dir_all(to)?;
        fs::set_permissions(to, data.permissions())?;
    } else if data.is_file() {
        fs::copy(from, to)?;
    }
    Ok(())
}
