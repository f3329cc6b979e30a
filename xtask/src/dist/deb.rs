//! Format of Debian packages (deb(5)). The packages are reproducible byte for byte. The packages do not contain checksums of
//! their files, because dpkg computes the checksums.
use std::fmt::Write as _;

use anyhow::{Context, Result, ensure};

use super::tree::Tree;

/// Debian package of a command.
pub(super) struct Deb<'a> {
    /// Name of the package.
    pub name: &'a str,
    /// Version of the package, including Debian's revision.
    pub version: &'a str,
    /// Architecture of the package: `amd64` or `arm64`.
    pub architecture: &'a str,
    /// Additional lines of the control file, such as `Section: science`.
    pub fields: &'a str,
    /// Files that the package installs.
    pub tree: &'a Tree,
    /// Installation scripts by name, such as `postinst` and `postrm`.
    pub scripts: &'a [(&'a str, &'a str)],
}

impl Deb<'_> {
    /// Returns the file name of the package, such as `jtc_0.2.0-1_amd64.deb`.
    pub(super) fn file_name(&self) -> String {
        format!("{}_{}_{}.deb", self.name, self.version, self.architecture)
    }

    /// Returns the bytes of the package. All files in the package have the time stamp `time` (Unix time, s).
    pub(super) fn bytes(&self, time: u64) -> Result<Vec<u8>> {
        let mut ar = ar::Builder::new(Vec::new());
        for (name, bytes) in [
            ("debian-binary", b"2.0\n".to_vec()),
            ("control.tar.gz", self.control()?.tar_gz("./", time)?),
            ("data.tar.gz", self.tree.tar_gz("./", time)?),
        ] {
            let mut header = ar::Header::new(name.as_bytes().to_vec(), bytes.len() as u64);
            header.set_mode(0o100_644);
            header.set_mtime(time);
            ar.append(&header, &*bytes).with_context(|| name.to_owned())?;
        }
        Ok(ar.into_inner()?)
    }

    fn control(&self) -> Result<Tree> {
        let mut control = Tree::default();
        let kibibytes: usize = self.tree.files().map(|(_, file)| file.bytes.len().div_ceil(1024)).sum();
        let Self { name, version, architecture, fields, .. } = self;
        ensure!(fields.contains("\nDescription: "), "the package {name} has no description");
        control.put(
            "control",
            format!(
                "Package: {name}\nVersion: {version}\nArchitecture: {architecture}\nInstalled-Size: {kibibytes}\n{}\n",
                fields.trim()
            ),
        );
        let mut settings = String::new();
        for (path, _) in self.tree.files().filter(|(path, _)| path.starts_with("etc/")) {
            writeln!(settings, "/{path}")?;
        }
        if !settings.is_empty() {
            control.put("conffiles", settings);
        }
        for (name, script) in self.scripts {
            control.put_program(*name, *script);
        }
        Ok(control)
    }
}
