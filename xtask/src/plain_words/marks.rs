//! Marks, which are words and constructions that hide the subject of a sentence. A word is also a mark if it has
//! another meaning in most other texts.
use std::sync::LazyLock;

use regex::Regex;

/// Names of the marks, with the search pattern of each mark.
pub(super) const MARKS: [(&str, &str); 10] = [
    ("begins with What, Who, Whose, Whether", r"(?:^|[.!;:] )(?:What|Who|Whose|Whether)\b"),
    (
        "begins with It, They, Nobody, Somebody, One, Nothing",
        r"(?:^|[.!;:] )(?:It|They|Nobody|Somebody|One|Nothing)\b",
    ),
    ("begins with The same, That of, Those of, Of", r"(?:^|[.!;:] )(?:The same|That of|Those of|Of)\b"),
    ("where", r"\bwhere\b"),
    ("of which, by which, with which, of what", r"\b(?:of|by|with) which\b|\bof what\b"),
    ("is no, is none", r"\b(?:is|are|was|were) (?:no|none)\b"),
    ("is to, has to", r"\b(?:is|are|was|were|has|have|had) to (?:be|[a-z]+)\b"),
    ("so many, so long, so often", r"\bso (?:many|much|long|often|few)\b"),
    ("whoever, whatever", r"\b(?:[Ww]hoever|[Ww]hatever)\b"),
    ("behind, anew, beside", r"\b(?:[Bb]ehind|[Aa]new|[Bb]eside)\b"),
];

static PATTERNS: LazyLock<Vec<(&str, Regex)>> = LazyLock::new(|| {
    MARKS.iter().filter_map(|(mark, pattern)| Some((*mark, Regex::new(pattern).ok()?))).collect()
});

/// Returns the marks in a text, with the byte position at which each mark begins.
pub(super) fn find(words: &str) -> Vec<(&'static str, usize)> {
    let mut found = Vec::new();
    for (mark, pattern) in PATTERNS.iter() {
        found.extend(pattern.find_iter(words).map(|at| (*mark, at.start())));
    }
    found
}

/// Returns the sentence that contains a byte position.
pub(super) fn sentence(words: &str, at: usize) -> &str {
    let start = words[..at].rfind(". ").map_or(0, |end| end + 2);
    let end = words[at..].find(". ").map_or(words.len(), |end| at + end + 1);
    words.get(start..end.max(start)).unwrap_or(words).trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_mark_is_found_and_plain_sentences_have_none() {
        let texts = [
            "What is held.",
            "Stops. It waits.",
            "The same without limits.",
            "Fails where the arm moves.",
            "The client of which it is.",
            "120 % is no speed.",
            "The host has to wait.",
            "Sent so many times.",
            "Whoever asks gets it.",
            "Frames behind a Stop.",
        ];
        for (text, (mark, _)) in texts.into_iter().zip(MARKS) {
            assert!(find(text).iter().any(|(found, _)| *found == mark), "{text}: {:?}", find(text));
        }
        let plain = "Stops the arm on its path. Returns when the controller reports that the arm is at rest.";
        assert_eq!(find(plain), []);
        assert_eq!(PATTERNS.len(), MARKS.len(), "all of them are patterns");
    }

    #[test]
    fn the_sentence_of_a_mark_is_shown() {
        let text = "Stops the arm. It waits until it stands. Then it returns.";
        let (_, at) = find(text)[0];
        assert_eq!(sentence(text, at + 2), "It waits until it stands.");
    }
}
