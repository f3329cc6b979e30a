//! Names of signals in a DBC file: unique C identifiers of at most 32 characters, which are made from free texts.

use std::collections::BTreeSet;
/// Maximum length of a name that all readers of DBC files accept.
const MAX: usize = 32;

/// Reserved words, which are not allowed as names in DBC files or in C.
const RESERVED: [&str; 44] = [
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum",
    "extern", "float", "for", "goto", "if", "int", "long", "register", "return", "short", "signed", "sizeof",
    "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while", "BO_", "SG_",
    "BU_", "CM_", "BA_", "VAL_", "EV_", "NS_", "BS_", "VERSION", "inline", "restrict",
];

/// Names that are already used. Each text gets a new name that differs from all of them.
#[derive(Default)]
pub(super) struct Names {
    used: BTreeSet<String>,
}

impl Names {
    /// Creates a set of names that excludes the names in `taken`.
    pub(super) fn without(taken: &[&str]) -> Self {
        Self { used: taken.iter().map(|name| name.to_ascii_lowercase()).collect() }
    }

    /// Returns a new unique name for a text. If the text has no letter or digit, the name is made from `fallback`.
    pub(super) fn name(&mut self, text: &str, fallback: &str) -> String {
        let mut base = identifier(text);
        if base.is_empty() {
            base = fallback.to_owned();
        }
        base.truncate(MAX);
        let mut name = base.clone();
        let mut number = 2_u32;
        // Some readers ignore the letter case, so two names must differ by more than the letter case.
        while !self.used.insert(name.to_ascii_lowercase()) {
            let suffix = format!("_{number}");
            name = base.chars().take(MAX - suffix.len()).collect::<String>() + &suffix;
            number += 1;
        }
        name
    }
}

/// Reduces a text to letters, digits and underscores; an umlaut becomes two letters. The resulting identifier can be empty.
fn identifier(text: &str) -> String {
    let mut name = String::new();
    for c in text.chars() {
        match c {
            'ä' => name += "ae",
            'ö' => name += "oe",
            'ü' => name += "ue",
            'Ä' => name += "Ae",
            'Ö' => name += "Oe",
            'Ü' => name += "Ue",
            'ß' => name += "ss",
            'µ' => name += "u",
            c if c.is_ascii_alphanumeric() => name.push(c),
            _ if name.is_empty() || name.ends_with('_') => {}
            _ => name.push('_'),
        }
    }
    while name.ends_with('_') {
        name.pop();
    }
    if name.starts_with(|c: char| c.is_ascii_digit()) || RESERVED.contains(&name.as_str()) {
        name.insert(0, '_');
    }
    name
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn names_keep_what_the_texts_mean() {
        let mut names = Names::default();
        assert_eq!(names.name("Position (Soll)", "x"), "Position_Soll");
        assert_eq!(names.name("position soll", "x"), "position_soll_2");
        assert_eq!(names.name("Motor-Überstrom", "x"), "Motor_Ueberstrom");
        assert_eq!(names.name("2nd", "x"), "_2nd");
        assert_eq!(names.name("int", "x"), "_int");
        assert_eq!(names.name("…", "so_3"), "so_3");
    }

    proptest! {
        #[test]
        fn any_texts_give_distinct_identifiers(texts in prop::collection::vec(any::<String>(), 0..60), same in any::<String>()) {
            let mut names = Names::default();
            let mut seen = BTreeSet::new();
            for text in texts.iter().chain(std::iter::repeat_n(&same, 12)) {
                let name = names.name(text, "edge");
                prop_assert!(name.len() <= 32 && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_'));
                prop_assert!(!name.starts_with(|c: char| c.is_ascii_digit()));
                prop_assert!(seen.insert(name.to_ascii_lowercase()));
            }
        }
    }
}
