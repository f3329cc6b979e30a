//! Checks that every link in the finished book leads to a file of the book.

use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};

/// Checks each page below `out`. Returns the number of links between files of the book.
pub fn check(out: &Path) -> Result<usize> {
    let (mut links, mut broken, mut waiting) = (0, Vec::new(), vec![out.to_owned()]);
    while let Some(folder) = waiting.pop() {
        for entry in std::fs::read_dir(&folder)? {
            let path = entry?.path();
            if path.is_dir() {
                waiting.push(path);
            } else if path.extension().is_some_and(|ending| ending == "html") {
                for target in targets(&std::fs::read_to_string(&path)?) {
                    links += 1;
                    if !folder.join(&target).exists() {
                        broken.push(format!("{} \u{2192} {}", path.display(), target.display()));
                    }
                }
            }
        }
    }
    ensure!(broken.is_empty(), "links that lead nowhere:\n{}", broken.join("\n"));
    Ok(links)
}

/// Returns the files to which a page links, as written in the page.
fn targets(page: &str) -> Vec<PathBuf> {
    let of = |name: &'static str| page.split(name).skip(1).filter_map(|rest| Some(rest.split_once('"')?.0));
    let path = |target: &str| {
        let file = target.split(['#', '?']).next().unwrap_or_default();
        let elsewhere =
            file.is_empty() || file.contains(':') || file.starts_with("//") || file.starts_with('/');
        (!elsewhere).then(|| PathBuf::from(file))
    };
    of(" href=\"").chain(of(" src=\"")).filter_map(path).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_between_files_are_found() {
        let page =
            "<a href=\"b.html#c\"><img src=\"d/e.png\"><a href=\"#f\"><a href=\"https://example.org\">";
        assert_eq!(targets(page), [PathBuf::from("b.html"), PathBuf::from("d/e.png")]);
    }
}
