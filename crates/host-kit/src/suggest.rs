//! Similarity of names for “did you mean …?” hints after a typing error.

/// Returns the Jaro-Winkler similarity of two names, 0 to 1. The Jaro-Winkler method gives more weight to the beginning
/// of a name.
pub fn similarity(a: &str, b: &str) -> f64 {
    strsim::jaro_winkler(a, b)
}

/// Returns the known name that is most similar to `name`. Returns `None` if no known name has a similarity, 0 to 1, of
/// at least `least`. Upper and lower case count as equal.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>, least: f64) -> Option<&'a str> {
    let name = name.to_lowercase();
    let all = known.into_iter().map(|known| (similarity(&known.to_lowercase(), &name), known));
    all.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(most, _)| *most >= least).map(|(_, known)| known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_of_the_hand_finds_its_name_and_another_word_none() {
        let known = ["home", "above-table", "drop"];
        assert_eq!(nearest("hone", known, 0.7), Some("home"));
        assert_eq!(nearest("above_tabel", known, 0.7), Some("above-table"));
        assert_eq!(nearest("HOEM", known, 0.7), Some("home"));
        assert_eq!(nearest("xyz", known, 0.7), None);
        assert_eq!(nearest("home", [], 0.0), None);
    }
}
