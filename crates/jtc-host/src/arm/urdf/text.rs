//! Checks of the text of a robot description before the XML reader parses it. The module also finds the positions of errors for which the
//! XML reader does not report a position.

use std::borrow::Cow;

use crate::file::{FileError, Place, short};

/// Maximum nesting depth of elements. Descriptions of arms have a lower depth.
const DEPTH_MAX: usize = 32;

/// Tag in the text: beginning, end, and nesting depth of its element. The outermost element has depth 0.
struct Tag<'a> {
    text: &'a str,
    begin: usize,
    end: usize,
    depth: usize,
    closes: bool,
    empty: bool,
}

/// Returns the tags of a text. Comments and declarations are not included.
fn tags(text: &str) -> impl Iterator<Item = Tag<'_>> {
    let (mut at, mut depth) = (0, 0usize);
    std::iter::from_fn(move || {
        loop {
            let begin = at + text.get(at..)?.find('<')?;
            let rest = &text[begin..];
            if let Some((_, end)) =
                [("<!--", "-->"), ("<![CDATA[", "]]>")].iter().find(|(b, _)| rest.starts_with(b))
            {
                at = rest.find(end).map_or(text.len(), |e| begin + e + 3);
                continue;
            }
            at = end_of_tag(rest).map_or(text.len(), |e| begin + e + 1);
            if rest.starts_with("<!") || rest.starts_with("<?") {
                continue;
            }
            let tag = &text[begin..at];
            let (closes, empty) = (tag.starts_with("</"), tag.ends_with("/>"));
            if closes {
                depth = depth.saturating_sub(1);
            }
            let own = depth;
            if !closes && !empty {
                depth += 1;
            }
            return Some(Tag { text: tag, begin, end: at, depth: own, closes, empty });
        }
    })
}

/// Returns the position of the end of the tag that begins at the start of `rest`. In an opening tag, a `>` inside an
/// attribute value does not end the tag. A closing tag has no attributes.
fn end_of_tag(rest: &str) -> Option<usize> {
    if rest.starts_with("</") {
        return rest.find('>');
    }
    let mut quote = None;
    rest.bytes().position(|byte| {
        match (quote, byte) {
            (None, b'\'' | b'"') => quote = Some(byte),
            (Some(open), _) if open == byte => quote = None,
            _ => {}
        }
        quote.is_none() && byte == b'>'
    })
}

/// Rejects a text whose elements are nested too deeply. The XML reader is recursive, so deep nesting could overflow
/// its stack.
pub(super) fn check_depth(text: &str) -> Result<(), FileError> {
    let deepest = tags(text).map(|tag| tag.depth + 1).max().unwrap_or(0);
    if deepest > DEPTH_MAX {
        return Err(FileError::form(format!(
            "XML nested {deepest} levels deep is not a description of an arm"
        )));
    }
    Ok(())
}

/// Adds the velocity 0 to each `limit` element without a velocity, because the XML reader requires a velocity. Velocity 0 means that the
/// velocity is not limited.
pub(super) fn with_velocities(text: &str) -> Cow<'_, str> {
    let lacks = |tag: &Tag| tag.text.starts_with("<limit") && !has_attribute(tag, &["velocity"]);
    let places: Vec<usize> = tags(text).filter(lacks).map(|tag| tag.begin + "<limit".len()).collect();
    if places.is_empty() {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16 * places.len());
    let mut from = 0;
    for place in places {
        out += &text[from..place];
        out += " velocity=\"0\"";
        from = place;
    }
    Cow::Owned(out + &text[from..])
}

/// Returns the names of the joints that have neither a lower nor an upper position limit. The XML reader would set both missing limits to
/// 0.
pub(super) fn without_ranges(text: &str) -> Vec<String> {
    let mut joints: Vec<(String, bool)> = Vec::new();
    for tag in tags(text).filter(|tag| !tag.closes) {
        if tag.depth == 1 {
            joints.push((name(&tag), false));
        } else if tag.depth == 2
            && tag.text.starts_with("<limit")
            && let Some((_, given)) = joints.last_mut()
        {
            *given |= has_attribute(&tag, &["lower", "upper"]);
        }
    }
    let lacking = joints.into_iter().filter(|(_, given)| !given);
    lacking.filter_map(|(name, _)| name.strip_prefix("joint ").map(str::to_owned)).collect()
}

/// Returns `true` if a tag has one of the attributes `keys`.
fn has_attribute(tag: &Tag, keys: &[&str]) -> bool {
    tag.text.split('=').any(|head| head.split_whitespace().last().is_some_and(|name| keys.contains(&name)))
}

/// Finds the element that causes an error of the XML reader, because the XML reader does not report the position. Returns an error that
/// names this element.
pub(super) fn locate(text: &str, what: &str) -> FileError {
    let what = what.trim_start_matches("custom: ").replace("float literal", "number");
    let mut open = None;
    for tag in tags(text).filter(|tag| tag.depth == 1) {
        let begin = if tag.closes { open.take() } else { Some((tag.begin, name(&tag))) };
        let Some((begin, name)) = begin else { continue };
        if !tag.closes && !tag.empty {
            open = Some((begin, name));
            continue;
        }
        let alone = format!("<robot name=\"_\">{}</robot>", &text[begin..tag.end]);
        if urdf_rs::read_from_string(&alone).is_err() {
            let line = 1 + text[..begin].matches('\n').count();
            let slip = if what == "invalid number" { no_number(&text[begin..tag.end]) } else { None };
            return FileError::at(Place::line(line).named(name), slip.unwrap_or(what));
        }
    }
    let whole = if what == "No elements found" { "the file is incomplete or has no element" } else { &what };
    FileError::form(format!("not a valid URDF: {whole}"))
}

/// Returns a message about the first attribute of an element that must be a number but is not a number.
fn no_number(element: &str) -> Option<String> {
    const NUMBERS: [&str; 16] = [
        "value",
        "lower",
        "upper",
        "effort",
        "velocity",
        "acceleration",
        "damping",
        "friction",
        "xyz",
        "rpy",
        "ixx",
        "ixy",
        "ixz",
        "iyy",
        "iyz",
        "izz",
    ];
    NUMBERS.iter().find_map(|key| {
        let head = format!(" {key}=");
        element.match_indices(&head).find_map(|(at, _)| {
            let rest = &element[at + head.len()..];
            let quote = rest.chars().next()?;
            let value = rest[quote.len_utf8()..].split(quote).next()?;
            let bad =
                value.split_whitespace().any(|word| word.parse::<f64>().is_err()) || value.trim().is_empty();
            bad.then(|| format!("{key} is \"{}\", not a number", short(value)))
        })
    })
}

/// Returns the type and name of an element.
fn name(tag: &Tag) -> String {
    let kind = tag.text.trim_start_matches('<').split([' ', '\n', '\t', '\r', '>', '/']).next().unwrap_or("");
    let name = tag.text.split("name=").nth(1).and_then(|rest| rest.split(['"', '\'']).nth(1));
    name.map_or_else(|| kind.to_owned(), |name| format!("{kind} {name}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_know_their_depth_and_comments_are_none() {
        let text = "<?xml?><robot><!-- <link> --><link name=\"a\"><mass/></link><joint/></robot>";
        let depths: Vec<_> = tags(text).map(|t| (t.text.to_owned(), t.depth)).collect();
        let expected = [
            ("<robot>", 0),
            ("<link name=\"a\">", 1),
            ("<mass/>", 2),
            ("</link>", 1),
            ("<joint/>", 1),
            ("</robot>", 0),
        ];
        assert_eq!(depths, expected.map(|(text, depth)| (text.to_owned(), depth)));
    }

    #[test]
    fn only_limits_without_a_velocity_get_one() {
        let text = "<limit lower=\"1\"/><limit velocity=\"2\"/>";
        let expected = "<limit velocity=\"0\" lower=\"1\"/><limit velocity=\"2\"/>";
        assert_eq!(with_velocities(text), expected);
        assert!(matches!(with_velocities(expected), Cow::Borrowed(_)));
    }

    #[test]
    fn texts_that_break_off_have_tags_all_the_same() {
        for text in ["", "<", "<a", "<!--", "<a><", "</a></b>", "<a b='", "ü<ü>"] {
            assert!(tags(text).count() <= 2, "{text}");
        }
    }
}
