//! Files of a package in memory, and reproducible archives of these files.
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write as _;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use flate2::{Compression, GzBuilder};
use sha2::{Digest as _, Sha256};

/// Files of a package by their path relative to the root folder, such as `usr/bin/jtc`.
#[derive(Clone, Default, Debug, PartialEq)]
pub(super) struct Tree(BTreeMap<String, File>);

/// File of a package, with content and kind.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct File {
    /// Content of the file.
    pub bytes: Vec<u8>,
    /// `true` if the file is executable.
    pub runs: bool,
}

impl Tree {
    /// Adds a file that all users can read.
    pub(super) fn put(&mut self, path: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        self.0.insert(path.into(), File { bytes: bytes.into(), runs: false });
    }

    /// Adds an executable program.
    pub(super) fn put_program(&mut self, path: impl Into<String>, bytes: impl Into<Vec<u8>>) {
        self.0.insert(path.into(), File { bytes: bytes.into(), runs: true });
    }

    /// Adds a copy of a file on this computer.
    pub(super) fn copy(&mut self, path: impl Into<String>, from: &Path) -> Result<()> {
        let bytes = std::fs::read(from).with_context(|| from.display().to_string())?;
        self.put(path, bytes);
        Ok(())
    }

    /// Returns the files in the order of their paths.
    pub(super) fn files(&self) -> impl Iterator<Item = (&str, &File)> {
        self.0.iter().map(|(path, file)| (path.as_str(), file))
    }

    /// Returns a tar archive with sorted paths. All files belong to root and have the time `time` (Unix time, s). Each path begins
    /// with `prefix` (`./` or `name/`). The archive also contains entries for the folders.
    pub(super) fn tar(&self, prefix: &str, time: u64) -> Result<Vec<u8>> {
        let mut tar = tar::Builder::new(Vec::new());
        let mut folders = BTreeSet::new();
        folders.insert(prefix.to_owned());
        for path in self.0.keys() {
            let ends = path.match_indices('/').map(|(at, _)| format!("{prefix}{}/", &path[..at]));
            folders.extend(ends);
        }
        for folder in folders {
            let mut header = header(tar::EntryType::Directory, 0o755, 0, time);
            tar.append_data(&mut header, &folder, std::io::empty()).with_context(|| folder.clone())?;
        }
        for (path, file) in &self.0 {
            let mode = if file.runs { 0o755 } else { 0o644 };
            let mut header = header(tar::EntryType::Regular, mode, file.bytes.len() as u64, time);
            tar.append_data(&mut header, format!("{prefix}{path}"), &*file.bytes)
                .with_context(|| path.clone())?;
        }
        Ok(tar.into_inner()?)
    }

    /// Returns the files as a compressed tar archive.
    pub(super) fn tar_gz(&self, prefix: &str, time: u64) -> Result<Vec<u8>> {
        compress(&self.tar(prefix, time)?, Compression::default())
    }
}

fn header(kind: tar::EntryType, mode: u32, size: u64, time: u64) -> tar::Header {
    let mut header = tar::Header::new_gnu();
    header.set_entry_type(kind);
    header.set_mode(mode);
    header.set_size(size);
    header.set_mtime(time);
    header.set_uid(0);
    header.set_gid(0);
    // These calls cannot fail, because the names fit into their header fields.
    let _ = header.set_username("root");
    let _ = header.set_groupname("root");
    header
}

/// Compresses a manual page or a text with the highest level of gzip, as Debian requires.
pub(super) fn gzip(bytes: &[u8]) -> Result<Vec<u8>> {
    compress(bytes, Compression::best())
}

/// Compresses data with gzip, without a time and a name in the header. For a program, the highest level would take
/// three times as long as the default level and save 1 %.
fn compress(bytes: &[u8], by: Compression) -> Result<Vec<u8>> {
    let mut gzip = GzBuilder::new().mtime(0).operating_system(3).write(Vec::new(), by);
    gzip.write_all(bytes)?;
    Ok(gzip.finish()?)
}

/// Returns the SHA-256 of the bytes in the format of `sha256sum`.
pub(super) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Name of the list of checksums that `sha256sum --check` reads.
pub(super) const SUMS: &str = "SHA256SUMS";

/// Writes the list of checksums into a folder. The list contains the checksums of all other files in the folder.
pub(super) fn write_sums(folder: &Path) -> Result<()> {
    let mut lines = BTreeMap::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        ensure!(path.is_file(), "{} is no file; release files lie in no folders", path.display());
        if name != SUMS {
            lines.insert(name, sha256(&std::fs::read(&path)?));
        }
    }
    let text: String = lines.iter().map(|(name, sum)| format!("{sum}  {name}\n")).collect();
    std::fs::write(folder.join(SUMS), text)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_archive_is_sorted_and_depends_on_nothing_but_its_files_and_the_time() {
        let put = |names: &[&str]| {
            let mut tree = Tree::default();
            names.iter().for_each(|name| tree.put(*name, *name));
            tree.put_program("usr/bin/jtc", "program");
            tree
        };
        let tree = put(&["usr/share/b", "etc/a"]);
        let bytes = tree.tar_gz("./", 1_700_000_000).unwrap();
        assert_eq!(bytes, put(&["etc/a", "usr/share/b"]).tar_gz("./", 1_700_000_000).unwrap());
        assert_ne!(bytes, tree.tar_gz("./", 1_700_000_001).unwrap());
        let tar = tree.tar("./", 1_700_000_000).unwrap();
        let mut archive = tar::Archive::new(&*tar);
        let entries: Vec<_> = archive
            .entries()
            .unwrap()
            .map(|entry| {
                let entry = entry.unwrap();
                let header = entry.header();
                assert_eq!((header.uid().unwrap(), header.gid().unwrap()), (0, 0));
                assert_eq!(header.mtime().unwrap(), 1_700_000_000);
                let path = String::from_utf8(entry.path_bytes().into_owned()).unwrap();
                (path, header.mode().unwrap())
            })
            .collect();
        // The archiver omits the `./` at the beginning of all names except the root folder. dpkg and tar accept both
        // forms.
        let expected = [
            ("./", 0o755),
            ("etc/", 0o755),
            ("usr/", 0o755),
            ("usr/bin/", 0o755),
            ("usr/share/", 0o755),
            ("etc/a", 0o644),
            ("usr/bin/jtc", 0o755),
            ("usr/share/b", 0o644),
        ];
        assert_eq!(entries, expected.map(|(path, mode)| (path.to_owned(), mode)));
    }

    #[test]
    fn sums_are_those_that_the_standard_names() {
        // The expected value is from FIPS 180-2, appendix B.1.
        assert_eq!(sha256(b"abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }
}
