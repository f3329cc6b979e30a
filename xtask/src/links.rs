//! Checks that the links between documents lead to existing files.
use std::path::Path;

use anyhow::{Result, ensure};

use crate::shell::{files, root};

/// Returns the targets of the Markdown links in `page` that are files of this project.
fn targets(page: &str) -> impl Iterator<Item = &str> {
    page.split("](")
        .skip(1)
        .filter_map(|rest| rest.split_once(')'))
        .map(|(target, _)| target.split('#').next().unwrap_or_default())
        .filter(|target| !target.is_empty() && !target.contains("://"))
}

/// Returns an error that lists the links to missing files.
pub(crate) fn check() -> Result<()> {
    let (mut links, mut broken) = (0, Vec::new());
    for path in files(root(), &["md"]) {
        let page = std::fs::read_to_string(&path)?;
        for target in targets(&page) {
            links += 1;
            if !path.parent().unwrap_or(Path::new("")).join(target).exists() {
                broken.push(format!("{} → {target}", path.strip_prefix(root()).unwrap_or(&path).display()));
            }
        }
    }
    ensure!(broken.is_empty(), "broken links: {}", broken.join(", "));
    println!("{links} links between files, none broken");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_to_files_are_found() {
        let page = "[a](b.md#c) ![d](e.svg) [f](https://x.org/g) [h](#i)";
        assert_eq!(targets(page).collect::<Vec<_>>(), ["b.md", "e.svg"]);
    }
}
