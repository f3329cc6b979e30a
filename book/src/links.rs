//! Replaces the targets of the links in a page of Markdown.

/// Returns the page with the targets of its links replaced by those that `change` returns. If the new target is
/// empty, the words stay without a link. Fenced blocks are not changed.
pub fn rewritten(page: &str, mut change: impl FnMut(&str) -> Option<String>) -> String {
    let mut out = String::with_capacity(page.len());
    let mut fenced = false;
    for line in page.split_inclusive('\n') {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        }
        if fenced {
            out += line;
        } else {
            rewrite_line(line, &mut out, &mut change);
        }
    }
    out
}

fn rewrite_line(line: &str, out: &mut String, change: &mut impl FnMut(&str) -> Option<String>) {
    let mut rest = line;
    while let Some((before, after)) = rest.split_once("](") {
        let Some((target, behind)) = after.split_once(')') else { break };
        match change(target) {
            Some(new) if new.is_empty() => {
                // Reduces the link `[words](target)` to `words`.
                let (kept, words) = before.rsplit_once('[').unwrap_or((before, ""));
                *out += kept;
                *out += words;
            }
            new => {
                *out += before;
                *out += "](";
                *out += new.as_deref().unwrap_or(target);
                out.push(')');
            }
        }
        rest = behind;
    }
    *out += rest;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_change_and_blocks_do_not() {
        let page = "a [b](../c.md#d) [e](f.md) [g](../h/)\n```\n[i](../j)\n```\n![k](../l.png)\n";
        let changed = rewritten(page, |target| match target.strip_prefix("../") {
            Some("h/") => Some(String::new()),
            Some(rest) => Some(format!("x/{rest}")),
            None => None,
        });
        assert_eq!(changed, "a [b](x/c.md#d) [e](f.md) g\n```\n[i](../j)\n```\n![k](x/l.png)\n");
    }
}
