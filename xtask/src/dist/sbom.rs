//! Machine-readable bill of materials of a release (CycloneDX 1.5, JSON).
use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::dashboard;
use super::graph::{Crate, Graph};
use super::{licences, programs};
use crate::shell::{self, Scratch, run};

/// Returns the bill of materials of `graph` and of the libraries in the dashboard pages. Equal lock files result in
/// equal bytes.
pub(super) fn bill(graph: &Graph, version: &str, time: u64) -> Result<String> {
    let scripts = dashboard::libraries()?;
    let crates = graph.crates.values().map(component);
    let scripts_listed = scripts.iter().map(|library| {
        let name = reference("npm", &library.name, &library.version);
        json!({
            "type": "library", "bom-ref": name, "purl": name, "name": library.name, "version": library.version,
            "licenses": [{ "license": { "id": library.licence } }],
        })
    });
    let runtime = licences::RUNTIME.iter().map(|(name, licence)| {
        json!({ "type": "library", "bom-ref": format!("runtime:{name}"), "name": name, "licenses": [{ "expression": licence }] })
    });
    let components: Vec<Value> = crates.chain(scripts_listed).chain(runtime).collect();
    let mut dependencies: Vec<Value> = graph
        .crates
        .iter()
        .map(|(name, found)| {
            let uses = graph.uses.get(name).into_iter().flatten();
            let mut uses: Vec<String> = uses.filter_map(|used| graph.crates.get(used)).map(purl).collect();
            if found.name == "agent-kit" {
                uses.extend(scripts.iter().map(|script| reference("npm", &script.name, &script.version)));
            }
            json!({ "ref": purl(found), "dependsOn": uses })
        })
        .collect();
    let ends = ["jtc-cli", "ucom-cli", "openjtc-py", "openjtc-firmware"];
    let parts: Vec<String> =
        graph.crates.values().filter(|found| ends.contains(&found.name.as_str())).map(purl).collect();
    let runtime = licences::RUNTIME.iter().map(|(name, _)| format!("runtime:{name}"));
    let parts: Vec<String> = parts.into_iter().chain(runtime).collect();
    let product = format!("pkg:generic/openjtc@{version}");
    dependencies.insert(0, json!({ "ref": product, "dependsOn": parts }));
    let bill = json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "timestamp": stamp(time)?,
            "component": {
                "type": "application", "bom-ref": product, "purl": product, "name": "openjtc", "version": version,
                "licenses": [{ "expression": "MIT OR Apache-2.0" }],
            },
        },
        "components": components,
        "dependencies": dependencies,
    });
    Ok(serde_json::to_string_pretty(&bill)? + "\n")
}

fn component(found: &Crate) -> Value {
    let mut component = json!({
        "type": "library", "bom-ref": purl(found), "purl": purl(found), "name": found.name, "version": found.version,
        "licenses": [{ "expression": found.licence.as_deref().map(licences::expression) }],
    });
    if let Some(sum) = &found.checksum {
        component["hashes"] = json!([{ "alg": "SHA-256", "content": sum }]);
    }
    if let Some(repository) = &found.repository {
        component["externalReferences"] = json!([{ "type": "vcs", "url": repository }]);
    }
    component
}

/// Returns the package URL of a crate. The crates of this project have no registry address.
fn purl(found: &Crate) -> String {
    reference(if found.source.is_some() { "cargo" } else { "generic" }, &found.name, &found.version)
}

fn reference(kind: &str, name: &str, version: &str) -> String {
    format!("pkg:{kind}/{name}@{}", version.replace('+', "%2B"))
}

/// Returns a Unix time in the format of RFC 3339.
fn stamp(time: u64) -> Result<String> {
    let text =
        shell::read(shell::command("date").args(["-u", "+%Y-%m-%dT%H:%M:%SZ", "-d", &format!("@{time}")]))
            .context("date")?;
    Ok(text.trim().to_owned())
}

/// Validates a bill of materials against the schema of CycloneDX, with the library of CycloneDX.
pub(super) fn validate(bill: &str) -> Result<()> {
    let scratch = Scratch::new("sbom")?;
    let file = scratch.path().join("bill.json");
    std::fs::write(&file, bill)?;
    let script = "import sys\n\
        from cyclonedx.schema import SchemaVersion\n\
        from cyclonedx.validation.json import JsonStrictValidator\n\
        error = JsonStrictValidator(SchemaVersion.V1_5).validate_str(open(sys.argv[1]).read())\n\
        sys.exit(f'the bill of materials is not CycloneDX 1.5: {error}' if error else 0)\n";
    run(shell::command(programs::tools()?.join("python")).arg("-c").arg(script).arg(&file))
}
