//! The section of docs/codes.md about the arm contains the pages of `jtc explain`. `UPDATE_DOCS=1` rewrites this section.

use std::fmt::Write as _;

use jtc_host::explain::{Family, pages};

#[test]
fn the_page_of_codes_has_every_page_of_explain() {
    let mut page = test_kit::page::Page::new("codes.md", "jtc");
    for family in Family::ALL {
        let mut text = String::new();
        for one in pages().filter(|page| page.family == family) {
            let number = if family.is_bits() {
                format!("`{}:0x{:02X}` (bit {})", family.key(), one.number(), one.code)
            } else {
                format!("`{}:{}`", family.key(), one.code)
            };
            let _ = write!(
                text,
                "### {}\n\n{number}. {}\n\nCause: {}\n\n{} Next: `{}`\n\n",
                one.name, one.meaning, one.cause, one.remedy, one.command
            );
        }
        page.group(&capital(family.title()));
        page.text(&text);
    }
    page.finish();
}

fn capital(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}
