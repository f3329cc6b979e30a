//! Files that another thread or program writes.
use std::path::Path;
use std::time::{Duration, Instant};

/// How long what is to be written is waited for.
const WAIT: Duration = Duration::from_secs(60);

/// The whole text of a file as soon as it has all of these words: who writes a log waits for no disk, and nobody for it.
pub fn text_with(path: &Path, words: &[&str]) -> String {
    let begun = Instant::now();
    loop {
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let missing = words.iter().find(|words| !text.contains(**words));
        let Some(missing) = missing else { return text };
        assert!(begun.elapsed() < WAIT, "no {missing} in {}: {text}", path.display());
        std::thread::sleep(Duration::from_millis(20));
    }
}
