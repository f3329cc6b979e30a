//! What is taken for firmware: records, raw bytes in a `.bin`, and nothing else unasked.
#![cfg(unix)]

mod common;

use common::{Sim, image};

/// A text is refused with its place before anything is sent, and what goes where is shown.
#[test]
fn d40_a_text_is_never_flashed() {
    let sim = Sim::start(&["--boards", "1", "--flash-ids", "0x21"]);
    sim.ucom(&["init"]).ends(0);
    let hex = ":0400000001020304F2\n:00000001FF\n";
    let files = [
        ("comment.hex", format!("; made by hand\n{hex}"), "line 1, column 1"),
        ("mark.hex", format!("\u{feff}{hex}"), "byte 1"),
        ("cut.hex", ":0400000001020304F2\n".into(), "no end record"),
        ("notes.bin", "dear reader, this is no firmware\n".into(), "dear reader"),
        ("notes.txt", "dear reader, this is no firmware\n".into(), "dear reader"),
        ("half.s19", "S1zz\n".into(), "line 1"),
    ];
    let mut peer = sim.peer();
    for (name, content, place) in &files {
        let file = sim.file(name, content.as_bytes());
        let said = sim.ucom(&["--json", "update", "1", &file, "--flash-id", "0x21"]).ends(2);
        assert!(said.out.contains(place) && said.out.contains("--raw"), "{name}: {}", said.out);
    }
    let other = sim.file("app.img", &image(500, 1));
    let said = sim.ucom(&["update", "1", &other, "--flash-id", "0x21"]).ends(2);
    assert!(said.err.contains("--raw"), "{}", said.err);
    assert!(peer.all(50).is_empty(), "nothing was sent");
    let said = sim.ucom(&["update", "1", &other, "--flash-id", "0x21", "--raw", "--dry-run"]).ends(0);
    let shown = said.err.contains("app.img: raw bytes, 500 bytes")
        && said.err.contains("onto board 1 (flash number 0x0021)");
    assert!(shown, "{}", said.err);
    let file = sim.file("good.hex", hex.as_bytes());
    let said = sim.ucom(&["update", "1", &file, "--flash-id", "0x21"]).ends(0);
    assert!(said.err.contains("good.hex: Intel HEX, 4 bytes"), "{}", said.err);
}
