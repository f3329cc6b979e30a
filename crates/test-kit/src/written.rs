//! Functions for files that another thread or another program writes.
use std::path::Path;

use crate::patience::Patience;

/// Waits until the text of a file contains all words in `words`, and returns the text. The wait is needed because the
/// writer works in parallel.
pub fn text_with(path: &Path, words: &[&str]) -> String {
    let mut patience = Patience::begin();
    loop {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let missing = words.iter().find(|words| !text.contains(**words));
        let Some(missing) = missing else { return text };
        patience.pause(format_args!("{missing} in {}: {text}", path.display()));
    }
}
