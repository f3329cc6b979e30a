//! The marks: words and turns that hide who does what, or that mean something else in most other texts.
use std::fmt;
use std::sync::LazyLock;

use regex::Regex;

/// A mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A sentence begins with What, Who, Whose or Whether.
    What,
    /// A sentence begins with It, They, Nobody, Somebody, One or Nothing.
    It,
    /// A sentence begins with The same, That of, Those of or Of.
    Same,
    /// `where`, which is used for if and when.
    Where,
    /// `of which` and the like.
    Which,
    /// `is no`, where `is not a` is meant, or `invalid`.
    IsNo,
    /// `is to`, `has to`, where `must` is meant.
    IsTo,
    /// `so many`, where there is a number.
    SoMany,
    /// `whoever`, `whatever`.
    Whoever,
    /// `behind`, `anew`, `beside`.
    Behind,
}

impl Mark {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::What,
        Self::It,
        Self::Same,
        Self::Where,
        Self::Which,
        Self::IsNo,
        Self::IsTo,
        Self::SoMany,
        Self::Whoever,
        Self::Behind,
    ];

    /// What it is called, and how it looks.
    fn described(self) -> (&'static str, &'static str) {
        match self {
            Self::What => {
                ("begins with What, Who, Whose, Whether", r"(?:^|[.!;:] )(?:What|Who|Whose|Whether)\b")
            }
            Self::It => (
                "begins with It, They, Nobody, Somebody, One, Nothing",
                r"(?:^|[.!;:] )(?:It|They|Nobody|Somebody|One|Nothing)\b",
            ),
            Self::Same => (
                "begins with The same, That of, Those of, Of",
                r"(?:^|[.!;:] )(?:The same|That of|Those of|Of)\b",
            ),
            Self::Where => ("where", r"\bwhere\b"),
            Self::Which => {
                ("of which, by which, with which, of what", r"\b(?:of|by|with) which\b|\bof what\b")
            }
            Self::IsNo => ("is no, is none", r"\b(?:is|are|was|were) (?:no|none)\b"),
            Self::IsTo => ("is to, has to", r"\b(?:is|are|was|were|has|have|had) to (?:be|[a-z]+)\b"),
            Self::SoMany => ("so many, so long, so often", r"\bso (?:many|much|long|often|few)\b"),
            Self::Whoever => ("whoever, whatever", r"\b(?:[Ww]hoever|[Ww]hatever)\b"),
            Self::Behind => ("behind, anew, beside", r"\b(?:[Bb]ehind|[Aa]new|[Bb]eside)\b"),
        }
    }
}

impl fmt::Display for Mark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.described().0)
    }
}

static PATTERNS: LazyLock<Vec<(Mark, Regex)>> = LazyLock::new(|| {
    let compiled = |mark: Mark| Regex::new(mark.described().1).map(|pattern| (mark, pattern));
    Mark::ALL.into_iter().filter_map(|mark| compiled(mark).ok()).collect()
});

/// The marks in a text, and the byte at which each begins.
pub fn find(words: &str) -> Vec<(Mark, usize)> {
    let found = |(mark, pattern): &(Mark, Regex)| {
        let at = pattern.find_iter(words).map(|found| (*mark, found.start())).collect::<Vec<_>>();
        at.into_iter()
    };
    PATTERNS.iter().flat_map(found).collect()
}

/// The sentence around a byte.
pub fn sentence(words: &str, at: usize) -> &str {
    let start = words[..at].rfind(". ").map_or(0, |end| end + 2);
    let end = words[at..].find(". ").map_or(words.len(), |end| at + end + 1);
    words.get(start..end.max(start)).unwrap_or(words).trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_mark_is_found_and_plain_sentences_have_none() {
        for (text, mark) in [
            ("What is held.", Mark::What),
            ("Stops. It waits.", Mark::It),
            ("The same without limits.", Mark::Same),
            ("Fails where the arm moves.", Mark::Where),
            ("The client of which it is.", Mark::Which),
            ("120 % is no speed.", Mark::IsNo),
            ("The host has to wait.", Mark::IsTo),
            ("Sent so many times.", Mark::SoMany),
            ("Whoever asks gets it.", Mark::Whoever),
            ("Frames behind a Stop.", Mark::Behind),
        ] {
            assert!(find(text).iter().any(|(found, _)| *found == mark), "{text}: {:?}", find(text));
        }
        let plain = "Stops the arm on its path. Returns when the controller reports that the arm is at rest.";
        assert_eq!(find(plain), []);
        assert_eq!(PATTERNS.len(), Mark::ALL.len(), "all of them are patterns");
    }

    #[test]
    fn the_sentence_of_a_mark_is_shown() {
        let text = "Stops the arm. It waits until it stands. Then it returns.";
        let (_, at) = find(text)[0];
        assert_eq!(sentence(text, at + 2), "It waits until it stands.");
    }
}
