//! Third-party crates that a release contains. Cargo selects these crates with the lock files.
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;

use super::programs::PLATFORMS;
use crate::{firmware, shell};

/// A crate in the dependency graph.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Crate {
    /// Name of the crate.
    pub name: String,
    /// Version of the crate.
    pub version: String,
    /// Licence as an SPDX expression; `None` if the manifest of the crate contains no licence.
    pub licence: Option<String>,
    /// Source of the crate; `None` for the crates of this project.
    pub source: Option<String>,
    /// Authors of the crate, as listed in its manifest.
    pub authors: Vec<String>,
    /// Address of the repository of the crate.
    pub repository: Option<String>,
    /// Folder with the source code of the crate.
    pub folder: PathBuf,
    /// SHA-256 of the crate archive in the registry.
    pub checksum: Option<String>,
}

/// Crates by `name version`, with the dependencies of each crate.
#[derive(Default)]
pub(crate) struct Graph {
    /// All crates of the graph.
    pub crates: BTreeMap<String, Crate>,
    /// Dependencies of each crate, by `name version`.
    pub uses: BTreeMap<String, BTreeSet<String>>,
}

/// Kinds of dependencies to include.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Kind {
    /// Dependencies that become a part of a program, or generate a part of a program during compilation.
    Shipped,
    /// All dependencies, including the dependencies of build scripts and tests.
    All,
}

/// Returns the crates in the programs, the Python package and the firmware of the boards. The function uses the features of the whole
/// workspace, so the graph may contain more crates than a program, but never fewer.
pub(crate) fn shipped() -> Result<Graph> {
    let mut graph = Graph::default();
    for platform in PLATFORMS {
        let metadata = metadata(Path::new("Cargo.toml"), platform.triple)?;
        graph.add(&metadata, Kind::Shipped, |name| ["jtc-cli", "ucom-cli"].contains(&name))?;
        if super::wheel::folder().is_some() {
            let metadata = self::metadata(Path::new("Cargo.toml"), platform.library)?;
            graph.add(&metadata, Kind::Shipped, |name| name == "openjtc-py")?;
        }
    }
    let metadata = metadata(Path::new("firmware/Cargo.toml"), firmware::TARGET)?;
    graph.add(&metadata, Kind::Shipped, |name| name == "openjtc-firmware")?;
    graph.checksums()?;
    Ok(graph)
}

/// Returns all dependencies of a manifest on these platforms, including the dependencies of tests.
pub(crate) fn all(manifest: &Path, platforms: &[String]) -> Result<Graph> {
    let mut graph = Graph::default();
    for platform in platforms {
        graph.add(&metadata(manifest, platform)?, Kind::All, |_| true)?;
    }
    Ok(graph)
}

/// Returns the dependencies that cargo resolves for a platform, without network access if possible.
fn metadata(manifest: &Path, platform: &str) -> Result<Value> {
    let ask = || {
        let mut cargo = shell::cargo(&[
            "metadata",
            "--format-version",
            "1",
            "--filter-platform",
            platform,
            "--manifest-path",
        ]);
        cargo.arg(manifest);
        cargo
    };
    let offline = ask().args(["--offline", "--quiet"]).output()?;
    let text = if offline.status.success() {
        String::from_utf8_lossy(&offline.stdout).into_owned()
    } else {
        shell::read(&mut ask())?
    };
    serde_json::from_str(&text).context("cargo metadata printed no JSON")
}

fn text(value: &Value) -> Option<String> {
    value.as_str().map(str::to_owned)
}

impl Graph {
    /// Adds the dependencies of the workspace crates that `begins` selects.
    fn add(&mut self, metadata: &Value, kind: Kind, begins: impl Fn(&str) -> bool) -> Result<()> {
        let packages = metadata["packages"].as_array().context("cargo metadata names no packages")?;
        let by_id: BTreeMap<&str, &Value> =
            packages.iter().filter_map(|package| Some((package["id"].as_str()?, package))).collect();
        let nodes = metadata["resolve"]["nodes"].as_array().context("cargo metadata resolves nothing")?;
        let nodes: BTreeMap<&str, &Value> =
            nodes.iter().filter_map(|node| Some((node["id"].as_str()?, node))).collect();
        let members = metadata["workspace_members"].as_array().context("cargo metadata names no members")?;
        let mut waiting: Vec<&str> = members
            .iter()
            .filter_map(Value::as_str)
            .filter(|id| by_id.get(id).is_some_and(|package| package["name"].as_str().is_some_and(&begins)))
            .collect();
        anyhow::ensure!(!waiting.is_empty(), "the workspace has none of the crates that are asked for");
        let key = |id: &str| -> Result<String> {
            let package = by_id.get(id).with_context(|| format!("cargo metadata has no package {id}"))?;
            let part = |name: &str| text(&package[name]).with_context(|| format!("{id} has no {name}"));
            Ok(format!("{} {}", part("name")?, part("version")?))
        };
        let mut seen = BTreeSet::new();
        while let Some(id) = waiting.pop() {
            if !seen.insert(id) {
                continue;
            }
            let name = key(id)?;
            self.crates.insert(name.clone(), described(by_id[id])?);
            let dependencies = nodes.get(id).and_then(|node| node["deps"].as_array()).into_iter().flatten();
            for dependency in dependencies {
                let kinds = dependency["dep_kinds"].as_array().into_iter().flatten();
                let counts = kinds.into_iter().any(|one| kind == Kind::All || one["kind"].is_null());
                if let (Some(used), true) = (dependency["pkg"].as_str(), counts) {
                    self.uses.entry(name.clone()).or_default().insert(key(used)?);
                    waiting.push(used);
                }
            }
        }
        Ok(())
    }

    /// Adds the checksums of the crates from the lock files.
    fn checksums(&mut self) -> Result<()> {
        for lock in ["Cargo.lock", "firmware/Cargo.lock"] {
            let text = std::fs::read_to_string(shell::root().join(lock)).context(lock)?;
            let lock: toml::Table = toml::from_str(&text).context(lock)?;
            for package in lock.get("package").and_then(|all| all.as_array()).into_iter().flatten() {
                let part = |name: &str| package.get(name).and_then(|value| value.as_str());
                if let (Some(name), Some(version), Some(sum)) =
                    (part("name"), part("version"), part("checksum"))
                    && let Some(found) = self.crates.get_mut(&format!("{name} {version}"))
                {
                    found.checksum = Some(sum.to_owned());
                }
            }
        }
        Ok(())
    }

    /// Returns the third-party crates of the graph.
    pub(crate) fn foreign(&self) -> impl Iterator<Item = &Crate> {
        self.crates.values().filter(|found| found.source.is_some())
    }
}

fn described(package: &Value) -> Result<Crate> {
    let name = text(&package["name"]).context("a package without a name")?;
    let manifest = text(&package["manifest_path"]).context(name.clone())?;
    let authors = package["authors"].as_array().into_iter().flatten();
    Ok(Crate {
        version: text(&package["version"]).context(name.clone())?,
        licence: text(&package["license"]),
        source: text(&package["source"]),
        authors: authors.filter_map(text).collect(),
        repository: text(&package["repository"]),
        folder: Path::new(&manifest).parent().context(name.clone())?.to_owned(),
        checksum: None,
        name,
    })
}
