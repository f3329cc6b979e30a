//! Makes the HTML book from docs/: `openjtc-book ROOT OUT`.
//!
//! mdbook makes the book, but it does not know that docs/ is a part of a repository. So this program resolves links that lead out of docs/
//! ([`outside`]): it copies pictures, and turns readable files into pages of the book's last part. The program also adds the script that
//! draws the diagrams ([`diagrams`]).
#![forbid(unsafe_code)]

mod diagrams;
mod links;
mod made;
mod outside;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use mdbook_driver::MDBook;
use mdbook_driver::config::Config;

/// File that every book made by mdbook contains. The file shows that an output folder contains an earlier book.
const MARK: &str = "searcher.js";

fn main() -> Result<()> {
    let words: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [root, out] = words.as_slice() else {
        bail!(
            "usage: openjtc-book ROOT OUT: the root of the repository, and the folder that the book is written to"
        );
    };
    let root = root.canonicalize().with_context(|| root.display().to_string())?;
    std::fs::create_dir_all(out).with_context(|| out.display().to_string())?;
    let out = out.canonicalize()?;
    // mdbook empties the output folder first, so this folder must not contain the repository.
    ensure!(!root.starts_with(&out), "{} holds the repository, and would be emptied", out.display());
    let is_empty = std::fs::read_dir(&out)?.next().is_none();
    ensure!(
        is_empty || out.join(MARK).exists(),
        "{} holds other files than those of a book, and would be emptied; name another folder",
        out.display()
    );
    make(&root, &out)
}

fn make(root: &Path, out: &Path) -> Result<()> {
    let mut config = Config::from_disk(root.join("book/book.toml")).context("book/book.toml")?;
    config.build.build_dir = out.to_owned();
    let mut book = MDBook::load_with_config(root.join("book"), config).context("docs/SUMMARY.md")?;
    let pictures = outside::resolve(root, &mut book.book)?;
    let drawn = diagrams::with_script(&mut book.book);
    book.with_preprocessor(mdbook_mermaid::Mermaid);
    book.build()?;
    if drawn > 0 {
        diagrams::copy_script(root, out)?;
    }
    for picture in &pictures {
        let to = out.join(outside::FOLDER).join(picture);
        std::fs::create_dir_all(to.parent().context("a picture in no folder")?)?;
        std::fs::copy(root.join(picture), &to).with_context(|| picture.display().to_string())?;
    }
    let pages = book.book.chapters().count();
    let links = made::check(out)?;
    println!(
        "{pages} pages, {drawn} of them with diagrams, and {links} links: {}",
        out.join("index.html").display()
    );
    Ok(())
}
