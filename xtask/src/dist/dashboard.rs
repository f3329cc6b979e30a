//! JavaScript libraries that are part of the dashboard pages in the programs `jtc` and `ucom`.
use anyhow::{Context, Result};
use serde_json::Value;

use crate::shell::root;

/// Libraries whose scripts are part of the built dashboard. Only the build and the tests use the other entries of web/package.json.
const NAMES: [&str; 4] = ["clsx", "svelte", "three", "uplot"];

/// JavaScript library of the dashboard.
pub(super) struct Library {
    /// Name of the library in the npm registry.
    pub name: String,
    /// Version of the library in the lock file.
    pub version: String,
    /// Licence of the library, as an SPDX identifier.
    pub licence: String,
    /// Text of the licence of the library.
    pub text: String,
}

/// Returns all libraries. The licence texts are stored with the source of this program, so that a release can be built
/// without Node.js.
pub(super) fn libraries() -> Result<Vec<Library>> {
    let lock = root().join("web/package-lock.json");
    let lock: Value =
        serde_json::from_str(&std::fs::read_to_string(lock)?).context("web/package-lock.json")?;
    let library = |name: &str| {
        let entry = &lock["packages"][format!("node_modules/{name}")];
        let part = |part: &str| {
            let text = entry[part].as_str().map(str::to_owned);
            text.with_context(|| format!("web/package-lock.json has no {part} of {name}"))
        };
        let kept = root().join(format!("xtask/packaging/licences/{name}.txt"));
        let text = std::fs::read_to_string(&kept).with_context(|| kept.display().to_string())?;
        let installed = root().join(format!("web/node_modules/{name}"));
        for file in ["LICENSE", "LICENSE.md", "license"] {
            let other = std::fs::read_to_string(installed.join(file)).unwrap_or_else(|_| text.clone());
            anyhow::ensure!(
                other == text,
                "{} is not {file} of {name}: copy it from web/node_modules",
                kept.display()
            );
        }
        Ok(Library { name: name.to_owned(), version: part("version")?, licence: part("license")?, text })
    };
    NAMES.into_iter().map(library).collect()
}
