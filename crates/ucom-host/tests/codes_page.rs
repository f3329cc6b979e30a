//! Compares the part of docs/codes.md about boards with the texts of `ucom explain`. With `UPDATE_DOCS=1`, the test rewrites that part of
//! the page.

use std::fmt::Write as _;

use ucom_host::explain::words;

#[test]
fn the_page_of_codes_has_every_word_of_explain() {
    let mut page = test_kit::page::Page::new("codes.md", "ucom");
    let all = words();
    let mut families: Vec<&str> = Vec::new();
    for word in &all {
        if !families.contains(&word.family) {
            families.push(word.family);
        }
    }
    for family in families {
        let mut text = String::from("| shown | meaning | next |\n|---|---|---|\n");
        for word in all.iter().filter(|word| word.family == family) {
            let shown: Vec<String> = word.shown.iter().map(|shown| format!("`{shown}`")).collect();
            let cell = |text: &str| text.replace('|', "\\|").replace('<', "\\<");
            let _ =
                writeln!(text, "| {} | {} | {} |", shown.join(", "), cell(&word.meaning), cell(&word.next));
        }
        text.push('\n');
        page.group(&format!("ucom: {family}"));
        page.text(&text);
    }
    page.finish();
}
