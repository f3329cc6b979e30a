//! Names that look like each other, for what a person typed with a slip of the hand.

/// How much two names look alike, 0 to 1: that of Jaro and Winkler, who weigh what they begin with.
pub fn likeness(a: &str, b: &str) -> f64 {
    strsim::jaro_winkler(a, b)
}

/// The known name that looks most like `name`, where one is as much like it as `least`, 0 to 1; small and capital letters are one.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>, least: f64) -> Option<&'a str> {
    let name = name.to_lowercase();
    let all = known.into_iter().map(|known| (likeness(&known.to_lowercase(), &name), known));
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
