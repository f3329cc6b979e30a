//! Checks the dependencies that cargo has resolved against deny.toml, which contains rules for licences, sources and
//! banned crates.
//!
//! The installation of cargo-deny takes minutes, so only `cargo xtask dist` runs cargo-deny. The checks in this module read deny.toml
//! directly.
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, ensure};
use spdx::{Expression, ParseMode};
use toml::{Table, Value};

use crate::dist::graph::{self, Crate};
use crate::shell::{self, root, run};

/// Version of cargo-deny that checks a release.
const CARGO_DENY: &str = "0.20.2";

/// Workspaces whose crates are part of a release.
const SHIPPED: [&str; 2] = ["Cargo.toml", "firmware/Cargo.toml"];
/// All lock files of the project. The check covers the sources of the dependencies in each workspace.
const LOCKS: [&str; 5] =
    ["Cargo.lock", "firmware/Cargo.lock", "emulator/Cargo.lock", "fuzz/Cargo.lock", "book/Cargo.lock"];

/// Returns an error that lists the violations of deny.toml.
pub(crate) fn check() -> Result<()> {
    let rules: Table =
        toml::from_str(&std::fs::read_to_string(root().join("deny.toml"))?).context("deny.toml")?;
    let mut wrong = BTreeSet::new();
    let mut crates = BTreeMap::new();
    for manifest in SHIPPED {
        let graph = graph::all(Path::new(manifest), &targets(&rules))?;
        crates.extend(graph.crates);
    }
    for found in crates.values() {
        wrong.extend(licence(&rules, found).err().map(|error| format!("{error:#}")));
        wrong.extend(banned(&rules, &found.name));
    }
    for lock in LOCKS {
        let text = std::fs::read_to_string(root().join(lock)).context(lock)?;
        wrong.extend(
            sources(&rules, &toml::from_str(&text).context(lock)?)
                .into_iter()
                .map(|line| format!("{lock}: {line}")),
        );
    }
    for path in shell::files(root(), &["toml"]).iter().filter(|path| path.ends_with("Cargo.toml")) {
        let manifest: Table =
            toml::from_str(&std::fs::read_to_string(path)?).context(path.display().to_string())?;
        let mut found = Vec::new();
        wildcards(&manifest, &mut found);
        wrong
            .extend(found.into_iter().map(|name| format!("{}: {name} may have any version", path.display())));
    }
    ensure!(
        wrong.is_empty(),
        "deny.toml does not allow:\n{}",
        wrong.into_iter().collect::<Vec<_>>().join("\n")
    );
    println!(
        "{} crates of others, each with a licence that deny.toml allows",
        crates.values().filter(|c| c.source.is_some()).count()
    );
    println!("left out: advisories, whose database is on GitHub (by hand: cargo deny check advisories)");
    Ok(())
}

/// Runs cargo-deny. If cargo-deny is missing, the function first installs it in the build folder.
pub(crate) fn with_cargo_deny() -> Result<()> {
    let folder = shell::target().join("tools");
    let program = folder.join("bin/cargo-deny");
    let version = |program: &Path| shell::read(shell::command(program).arg("--version")).unwrap_or_default();
    if !program.exists() || version(&program).trim() != format!("cargo-deny {CARGO_DENY}") {
        println!("installing cargo-deny {CARGO_DENY} (some minutes, once)");
        let mut install = shell::cargo(&[
            "install",
            "--quiet",
            "--locked",
            "--version",
            CARGO_DENY,
            "cargo-deny",
            "--root",
        ]);
        run(install.arg(&folder))?;
    }
    for manifest in SHIPPED {
        // cargo-deny reads the source code for every target, but builds for this computer have downloaded only a part
        // of it. The missing part must be downloaded first.
        run(&mut shell::cargo(&["fetch", "--quiet", "--locked", "--manifest-path", manifest]))?;
        let mut deny = shell::command(&program);
        deny.args(["--offline", "--manifest-path", manifest, "--config"]).arg(root().join("deny.toml"));
        run(deny.args(["check", "licenses", "bans", "sources"]))?;
    }
    Ok(())
}

fn strings(value: Option<&Value>) -> impl Iterator<Item = &str> {
    value.and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str)
}

fn targets(rules: &Table) -> Vec<String> {
    let graph = rules.get("graph");
    strings(graph.and_then(|graph| graph.get("targets"))).map(str::to_owned).collect()
}

/// Returns an error if the rules do not allow the licence of a crate.
fn licence(rules: &Table, found: &Crate) -> Result<()> {
    let label = format!("{} {}", found.name, found.version);
    let text = found.licence.as_deref().with_context(|| format!("{label} names no licence"))?;
    let expression = Expression::parse_mode(text, ParseMode::LAX);
    let expression =
        expression.map_err(|error| anyhow::anyhow!("{label}: the licence {text:?}: {}", error.reason))?;
    let licences = rules.get("licenses");
    let mut allowed: BTreeSet<&str> = strings(licences.and_then(|table| table.get("allow"))).collect();
    let exceptions = licences.and_then(|table| table.get("exceptions")).and_then(Value::as_array);
    for exception in exceptions.into_iter().flatten() {
        if exception.get("crate").and_then(Value::as_str) == Some(&found.name) {
            allowed.extend(strings(exception.get("allow")));
        }
    }
    let met = expression.evaluate(|one| allowed.contains(one.to_string().as_str()));
    ensure!(met, "{label} is under {text}, of which no part is allowed");
    Ok(())
}

/// Returns the reason why a crate is banned. Returns `None` if the crate is not banned.
fn banned(rules: &Table, name: &str) -> Option<String> {
    let bans = rules.get("bans")?.get("deny")?.as_array()?;
    let ban = bans.iter().find(|ban| ban.get("crate").and_then(Value::as_str) == Some(name))?;
    let reason = ban.get("reason").and_then(Value::as_str).unwrap_or("deny.toml gives no reason");
    Some(format!("{name} is banned: {reason}"))
}

/// Returns the crates of a lock file whose source the rules do not allow.
fn sources(rules: &Table, lock: &Table) -> Vec<String> {
    let allowed: BTreeSet<String> =
        strings(rules.get("sources").and_then(|table| table.get("allow-registry")))
            .map(|url| format!("registry+{url}"))
            .collect();
    let packages = lock.get("package").and_then(Value::as_array).into_iter().flatten();
    let elsewhere = |package: &Value| {
        let source = package.get("source")?.as_str()?;
        let name = package.get("name")?.as_str()?;
        (!allowed.contains(source)).then(|| format!("{name} comes from {source}"))
    };
    packages.filter_map(elsewhere).collect()
}

/// Adds those dependencies of a manifest that have no version. Path dependencies are not added, because they are
/// crates of this project.
fn wildcards(table: &Table, found: &mut Vec<String>) {
    for (key, value) in table {
        let Some(inner) = value.as_table() else { continue };
        if !key.ends_with("dependencies") {
            wildcards(inner, found);
            continue;
        }
        for (name, wanted) in inner {
            let part = |part: &str| wanted.get(part);
            let own = part("path").is_some() || part("workspace").is_some();
            let version = wanted.as_str().or_else(|| part("version")?.as_str());
            if !own && version.is_none_or(|version| version.trim() == "*") {
                found.push(name.clone());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULES: &str = r#"
        [licenses]
        allow = ["MIT", "Apache-2.0 WITH LLVM-exception"]
        exceptions = [{ crate = "port", allow = ["MPL-2.0"] }]
        [bans]
        deny = [{ crate = "bad", reason = "it is" }]
        [sources]
        allow-registry = ["https://index"]
    "#;

    fn rules() -> Table {
        toml::from_str(RULES).unwrap()
    }

    fn named(name: &str, licence: Option<&str>) -> Crate {
        Crate {
            name: name.into(),
            version: "1".into(),
            licence: licence.map(Into::into),
            source: None,
            authors: vec![],
            repository: None,
            folder: ".".into(),
            checksum: None,
        }
    }

    #[test]
    fn licences_are_allowed_by_what_can_be_chosen() {
        let allowed = |name: &str, licence: Option<&str>| licence_of(name, licence).is_ok();
        fn licence_of(name: &str, text: Option<&str>) -> Result<()> {
            licence(&rules(), &named(name, text))
        }
        assert!(
            allowed("a", Some("MIT"))
                && allowed("a", Some("GPL-3.0 OR MIT"))
                && allowed("a", Some("Unlicense/MIT"))
        );
        assert!(allowed("a", Some("Apache-2.0 WITH LLVM-exception OR Apache-2.0")));
        assert!(allowed("port", Some("MPL-2.0")) && !allowed("other", Some("MPL-2.0")));
        assert!(!allowed("a", Some("MIT AND GPL-2.0-only")) && !allowed("a", Some("Apache-2.0")));
        assert!(!allowed("a", None) && !allowed("a", Some("as you like")));
    }

    #[test]
    fn bans_sources_and_wildcards_are_found() {
        assert_eq!(banned(&rules(), "bad").unwrap(), "bad is banned: it is");
        assert_eq!(banned(&rules(), "good"), None);
        let lock = "[[package]]\nname = \"own\"\n[[package]]\nname = \"a\"\nsource = \"registry+https://index\"\n\
                    [[package]]\nname = \"b\"\nsource = \"git+https://elsewhere\"\n";
        assert_eq!(sources(&rules(), &toml::from_str(lock).unwrap()), ["b comes from git+https://elsewhere"]);
        let manifest = "[dependencies]\na = \"1\"\nb = \"*\"\nc = { path = \"c\" }\nd.workspace = true\n\
                        [target.'cfg(unix)'.dev-dependencies]\ne = { features = [] }\n";
        let mut found = Vec::new();
        wildcards(&toml::from_str(manifest).unwrap(), &mut found);
        found.sort();
        assert_eq!(found, ["b", "e"]);
    }
}
