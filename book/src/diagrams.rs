//! Diagrams, which pages contain as Mermaid source text. The browser draws them with the Mermaid script. The book
//! contains this script, so that the browser loads nothing from other servers.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use mdbook_driver::book::Book;
use serde_json::Value;

/// File name of the Mermaid script in the book.
const SCRIPT: &str = "mermaid.min.js";

/// Adds the Mermaid script to the end of each page that has a diagram, and returns the number of these pages. The
/// preprocessor of mdbook-mermaid converts the diagrams themselves.
pub fn with_script(book: &mut Book) -> usize {
    let mut pages = 0;
    book.for_each_chapter_mut(|chapter| {
        if chapter.content.contains("```mermaid") {
            let up = "../".repeat(chapter.path.iter().flat_map(|path| path.components()).count().saturating_sub(1));
            chapter.content.push_str(&format!(
                "\n\n<script src=\"{up}{SCRIPT}\"></script>\n<script>mermaid.initialize({{ startOnLoad: true }});</script>\n"
            ));
            pages += 1;
        }
    });
    pages
}

/// Copies the Mermaid script from the source of mdbook-mermaid into the book.
pub fn copy_script(root: &Path, out: &Path) -> Result<()> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    // The option `--offline` is omitted on purpose: `cargo metadata` reads the manifests of the packages for every
    // platform, and a build for this computer downloads only some of these packages.
    let words = ["metadata", "--format-version", "1", "--locked", "--manifest-path"];
    let asked = Command::new(cargo).args(words).arg(root.join("book/Cargo.toml")).output()?;
    ensure!(asked.status.success(), "cargo metadata: {}", String::from_utf8_lossy(&asked.stderr));
    let metadata: Value = serde_json::from_slice(&asked.stdout)?;
    let packages = metadata["packages"].as_array().context("cargo metadata names no packages")?;
    let package = packages.iter().find(|package| package["name"] == "mdbook-mermaid");
    let manifest = package.and_then(|package| package["manifest_path"].as_str()).map(PathBuf::from);
    let manifest = manifest.context("cargo metadata does not name mdbook-mermaid")?;
    let script = manifest.with_file_name("src").join("bin/assets").join(SCRIPT);
    std::fs::copy(&script, out.join(SCRIPT)).with_context(|| script.display().to_string())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use mdbook_driver::book::{BookItem, Chapter};

    use super::*;

    #[test]
    fn pages_with_a_diagram_load_the_script_from_where_it_is() {
        let mut book = Book::default();
        for (path, text) in
            [("a.md", "```mermaid\nx\n```\n"), ("b/c.md", "```mermaid\nx\n```\n"), ("d.md", "x\n")]
        {
            book.push_item(BookItem::Chapter(Chapter::new(path, text.into(), path, vec![])));
        }
        assert_eq!(with_script(&mut book), 2);
        let pages: Vec<String> = book.chapters().map(|chapter| chapter.content.clone()).collect();
        assert!(
            pages[0].contains("src=\"mermaid.min.js\"") && pages[1].contains("src=\"../mermaid.min.js\"")
        );
        assert_eq!(pages[2], "x\n");
    }
}
