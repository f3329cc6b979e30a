//! Comparison of the output of a command with the output on the page.

/// Line on a page that stands for any number of output lines.
const LEFT_OUT: &str = "...";

/// Returns `true` if the printed lines match the lines of the page. `...` matches any number of lines. If `varying` is set,
/// the function does not compare numbers, except the numbers of joints and boards.
pub(super) fn same(shown: &[String], printed: &[String], varying: bool) -> bool {
    let prepared = |lines: &[String]| -> Vec<String> {
        let line = |line: &String| if varying { masked(line) } else { line.trim_end().to_owned() };
        let lines: Vec<String> = lines.iter().map(line).collect();
        // Blank lines at the end are not compared, because they are not visible on a page.
        let end = lines.iter().rposition(|line| !line.is_empty()).map_or(0, |last| last + 1);
        lines[..end].to_vec()
    };
    fits(&prepared(shown), &prepared(printed))
}

fn fits(shown: &[String], printed: &[String]) -> bool {
    match shown.split_first() {
        None => printed.is_empty(),
        Some((first, rest)) if first.trim() == LEFT_OUT => {
            (0..=printed.len()).any(|skipped| fits(rest, &printed[skipped..]))
        }
        Some((first, rest)) => printed.first() == Some(first) && fits(rest, &printed[1..]),
    }
}

/// Returns the line with `#` instead of each number, and with one blank between words. The original number of blanks
/// depends on the length of the numbers.
fn masked(line: &str) -> String {
    let words: Vec<&str> = line.split_whitespace().collect();
    let mut out = Vec::new();
    for (n, word) in words.iter().enumerate() {
        let before = n.checked_sub(1).map_or("", |n| words[n]);
        let kept = ["joint", "board", "joints", "boards"].contains(&before);
        out.push(if kept { (*word).to_owned() } else { numbers_masked(word) });
    }
    out.join(" ")
}

fn numbers_masked(word: &str) -> String {
    let mut out = String::new();
    let mut rest = word;
    while let Some(at) = rest.find(|c: char| c.is_ascii_digit()) {
        let (before, from) = rest.split_at(at);
        // A sign directly before the number is also masked.
        out += before.strip_suffix(['-', '+', '−']).unwrap_or(before);
        out.push('#');
        rest = &from[number_length(from)..];
    }
    out + rest
}

/// Returns the length, in bytes, of the number at the start of the text. A number is decimal, optionally with an
/// exponent, or hexadecimal. Hexadecimal numbers begin with `0x`, or have eight digits
/// and contain a letter.
fn number_length(text: &str) -> usize {
    let while_of = |text: &str, of: fn(char) -> bool| text.find(|c| !of(c)).unwrap_or(text.len());
    if let Some(digits) = text.strip_prefix("0x") {
        return 2 + while_of(digits, |c| c.is_ascii_hexdigit());
    }
    let hash = while_of(text, |c| c.is_ascii_hexdigit());
    if hash >= 8 && text[..hash].contains(|c: char| c.is_ascii_alphabetic()) {
        return hash;
    }
    // A full stop at the end of a sentence does not belong to the number.
    let plain = text[..while_of(text, |c| c.is_ascii_digit() || c == '.')].trim_end_matches('.').len();
    let exponent = text[plain..].strip_prefix('e').map_or(0, |rest| {
        let sign = usize::from(rest.starts_with(['-', '+']));
        let digits = while_of(&rest[sign..], |c| c.is_ascii_digit());
        if digits > 0 { 1 + sign + digits } else { 0 }
    });
    plain + exponent
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(text: &str) -> Vec<String> {
        text.lines().map(str::to_owned).collect()
    }

    #[test]
    fn lines_are_compared_and_dots_stand_for_any() {
        assert!(same(&lines("a\n...\nd"), &lines("a\nb\nc\nd\n"), false));
        assert!(same(&lines("...\nd"), &lines("d"), false));
        assert!(!same(&lines("a\n..."), &lines("b"), false));
        assert!(!same(&lines("a"), &lines("a\nb"), false));
        assert!(!same(&lines("1.5 s"), &lines("1.6 s"), false));
    }

    #[test]
    fn numbers_vary_where_the_page_says_so_but_not_those_of_joints() {
        assert!(same(&lines("joint 3   1.5 rad, -7"), &lines("joint 3  11.25 rad, 8"), true));
        assert!(!same(&lines("joint 3: 1.5"), &lines("joint 4: 1.5"), true));
        assert!(same(&lines("at 0x1F, hash 12ab34cd56ef."), &lines("at 0x2, hash 998877aabb01."), true));
        assert!(same(&lines("1e-5 and 2.5e3 s"), &lines("0.25 and 17 s"), true));
        assert!(!same(&lines("3 faults"), &lines("3 results"), true));
    }
}
