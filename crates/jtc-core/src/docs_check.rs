//! Parts of the documentation that are generated from the code. Tests compare these parts with the code. With
//! `UPDATE_DOCS=1`, the tests write them.
extern crate std;
use std::format;
use std::path::Path;

/// Checks that the text between two markers in docs/protocol-jtc.md is equal to the generated text.
pub(crate) fn is_in_the_protocol(part: &str, drawn: &str) {
    std::println!("{drawn}");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/protocol-jtc.md");
    let text = std::fs::read_to_string(&path).expect("docs/protocol-jtc.md is there");
    let find = |mark: &str| text.find(mark).unwrap_or_else(|| panic!("protocol-jtc.md has no mark {mark}"));
    let begin = format!("<!-- {part} begin -->\n");
    let (begin, end) = (find(&begin) + begin.len(), find(&format!("<!-- {part} end -->")));
    if std::env::var_os("UPDATE_DOCS").is_some() {
        let new = format!("{}{drawn}{}", &text[..begin], &text[end..]);
        std::fs::write(&path, new).expect("docs/protocol-jtc.md can be written");
    } else {
        assert!(
            text[begin..end] == *drawn,
            "docs/protocol-jtc.md differs from the code: look, then `cargo xtask docs`"
        );
    }
}
