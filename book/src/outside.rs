//! Links from docs/ to other files of the repository.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, Result, bail};
use mdbook_driver::book::{Book, BookItem, Chapter};

use crate::links::rewritten;

/// Folder of the book for files from outside docs/.
pub const FOLDER: &str = "repository";

/// File name extensions of pictures, which are copied unchanged.
const PICTURES: [&str; 4] = ["png", "svg", "jpg", "gif"];

/// Gives every link that leads out of docs/ a target in the book, and adds a page for each file that is not a
/// picture. Returns the pictures, as paths from the root of the repository.
pub fn resolve(root: &Path, book: &mut Book) -> Result<BTreeSet<PathBuf>> {
    let mut files = BTreeSet::new();
    let mut failed = None;
    book.for_each_chapter_mut(|chapter| {
        let Some(page) = chapter.source_path.clone() else { return };
        let from = Path::new("docs").join(page);
        chapter.content = rewritten(&chapter.content, |target| {
            let (path, anchor) = split(target)?;
            let file = joined(from.parent()?, path)?;
            if file.starts_with("docs") {
                return None;
            }
            if !root.join(&file).is_file() {
                failed.get_or_insert(format!(
                    "{}: {target} is not a file: a page links only to files",
                    from.display()
                ));
                return None;
            }
            let up = "../".repeat(from.components().count().saturating_sub(2));
            let to = format!("{up}{FOLDER}/{}{anchor}", shown(&file).display());
            files.insert(file);
            Some(to)
        });
    });
    if let Some(failed) = failed {
        bail!(failed);
    }
    let (pictures, texts): (BTreeSet<_>, BTreeSet<_>) = files.into_iter().partition(|file| is_picture(file));
    if !texts.is_empty() {
        book.push_item(BookItem::PartTitle("Files of the repository".into()));
    }
    for file in &texts {
        book.push_item(BookItem::Chapter(chapter(root, file, &texts)?));
    }
    Ok(pictures)
}

/// Returns the page of the book that shows this file.
fn chapter(root: &Path, file: &Path, pages: &BTreeSet<PathBuf>) -> Result<Chapter> {
    let name = file.display().to_string();
    let text = std::fs::read_to_string(root.join(file)).with_context(|| name.clone())?;
    let content = if file.extension() == Some(OsStr::new("md")) {
        let up = "../".repeat(file.components().count());
        rewritten(&text, |target| {
            let (path, anchor) = split(target)?;
            let file = joined(file.parent()?, path)?;
            match file.strip_prefix("docs") {
                Ok(page) => Some(format!("{up}{}{anchor}", page.display())),
                Err(_) if pages.contains(&file) => {
                    Some(format!("{up}{FOLDER}/{}{anchor}", shown(&file).display()))
                }
                // The book has no page for this file, so the link is removed and its words stay.
                Err(_) => Some(String::new()),
            }
        })
    } else {
        let kind = file.extension().and_then(OsStr::to_str).unwrap_or("text");
        format!("# {name}\n\n````{kind}\n{text}\n````\n")
    };
    Ok(Chapter::new(&name, content, Path::new(FOLDER).join(shown(file)), Vec::new()))
}

/// Returns the name of a file in the book. Pictures and Markdown files keep their names, except `README.md`. Every
/// other file becomes a page whose name has `.md` at the end.
fn shown(file: &Path) -> PathBuf {
    // mdbook turns `README.md` into an index page, and does not adjust links to it from other folders.
    if file.file_name() == Some(OsStr::new("README.md")) {
        return file.with_file_name("about.md");
    }
    if is_picture(file) || file.extension() == Some(OsStr::new("md")) {
        return file.to_owned();
    }
    let mut name = file.as_os_str().to_owned();
    name.push(".md");
    PathBuf::from(name)
}

fn is_picture(file: &Path) -> bool {
    file.extension().and_then(OsStr::to_str).is_some_and(|ending| PICTURES.contains(&ending))
}

/// Returns the path and the anchor (with its `#`) of a link target that is a file. Returns `None` for web addresses,
/// and for anchors on the same page.
fn split(target: &str) -> Option<(&str, &str)> {
    let at = target.find('#').unwrap_or(target.len());
    let (path, anchor) = target.split_at(at);
    (!path.is_empty() && !path.contains("://") && !path.starts_with("mailto:")).then_some((path, anchor))
}

/// Resolves `path` relative to `folder` into a path from the root of the repository. Returns `None` if the path leads
/// out of the repository.
fn joined(folder: &Path, path: &str) -> Option<PathBuf> {
    let mut whole = PathBuf::new();
    for part in folder.join(path).components() {
        match part {
            Component::Normal(name) => whole.push(name),
            Component::ParentDir => {
                if !whole.pop() {
                    return None;
                }
            }
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_followed_from_the_folder_of_their_page() {
        assert_eq!(joined(Path::new("docs"), "../arms/avena.toml"), Some("arms/avena.toml".into()));
        assert_eq!(joined(Path::new("docs"), "arm.md"), Some("docs/arm.md".into()));
        assert_eq!(joined(Path::new("docs"), "../../elsewhere"), None);
    }

    #[test]
    fn addresses_are_no_files() {
        assert_eq!(split("https://example.org/a"), None);
        assert_eq!(split("#place"), None);
        assert_eq!(split("arm.md#place"), Some(("arm.md", "#place")));
    }

    #[test]
    fn files_get_pages_and_pictures_stay() {
        assert_eq!(shown(Path::new("arms/avena.toml")), Path::new("arms/avena.toml.md"));
        assert_eq!(shown(Path::new("references/README.md")), Path::new("references/about.md"));
        assert_eq!(shown(Path::new("web/a.png")), Path::new("web/a.png"));
    }
}
