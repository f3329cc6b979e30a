//! Text for a number with a noun in the singular or plural.

use std::format;
use std::string::String;

/// Returns `1 board`, `3 boards` and so on. The function supports only nouns whose plural is formed with an s.
pub fn counted(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

#[cfg(test)]
mod tests {
    use super::counted;

    #[test]
    fn one_is_not_many() {
        assert_eq!([0, 1, 2].map(|n| counted(n, "board")), ["0 boards", "1 board", "2 boards"]);
    }
}
