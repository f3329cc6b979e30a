//! What is taken for firmware: records, raw bytes in a `.bin`, and nothing else unasked.
#![cfg(unix)]

mod common;

use common::{Sim, image};

/// A text is refused with its place before anything is sent, and what goes where is shown.
#[test]
fn d40_a_text_is_never_flashed() {
    let sim = Sim::numbered(&["--boards", "1", "--flash-ids", "0x21"]);
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
        let output = sim.ucom(&["--json", "update", "1", &file, "--flash-id", "0x21"]).ends(2);
        assert!(output.out.contains(place) && output.out.contains("--raw"), "{name}: {}", output.out);
    }
    let other = sim.file("app.img", &image(500, 1));
    let output = sim.ucom(&["update", "1", &other, "--flash-id", "0x21"]).ends(2);
    assert!(output.err.contains("--raw"), "{}", output.err);
    assert!(peer.all(50).is_empty(), "nothing was sent");
    let output = sim.ucom(&["update", "1", &other, "--flash-id", "0x21", "--raw", "--dry-run"]).ends(0);
    let shown = output.err.contains("app.img: raw bytes, 500 bytes")
        && output.err.contains("onto board 1 (flash number 0x0021)");
    assert!(shown, "{}", output.err);
    let file = sim.file("good.hex", hex.as_bytes());
    let output = sim.ucom(&["update", "1", &file, "--flash-id", "0x21"]).ends(0);
    assert!(output.err.contains("good.hex: Intel HEX, 4 bytes"), "{}", output.err);
}

/// S-records of the boards' tool chain count words, those of other tools bytes: the records show which, or `--addresses` does.
#[test]
fn s_records_count_words_or_bytes() {
    let sim = Sim::numbered(&["--boards", "1", "--flash-ids", "0x21"]);
    let line = |address: u16, data: &[u8]| {
        let mut bytes = vec![data.len() as u8 + 3, (address >> 8) as u8, address as u8];
        bytes.extend(data);
        let sum: u32 = bytes.iter().map(|b| u32::from(*b)).sum();
        bytes.push(!(sum as u8));
        format!("S1{}\n", bytes.iter().map(|b| format!("{b:02X}")).collect::<String>())
    };
    let content = image(64, 3);
    let file = |step: usize, records: usize| {
        let lines = content.chunks(16).take(records).enumerate();
        lines.map(|(i, data)| line((0x40 + i * step) as u16, data)).collect::<String>() + "S9030000FC\n"
    };
    let mut peer = sim.peer();
    let update = |name: &str, text: String, more: &[&str], code: i32| {
        let file = sim.file(name, text.as_bytes());
        sim.ucom(&[&["update", "1", &file, "--flash-id", "0x21", "--dry-run"], more].concat()).ends(code).err
    };
    let output = update("words.s19", file(8, 4), &[], 0);
    assert!(output.contains("64 bytes from word 0x40, addresses in words"), "{output}");
    let output = update("bytes.s19", file(16, 4), &[], 0);
    assert!(output.contains("64 bytes from word 0x20, addresses in bytes"), "{output}");
    assert!(output.contains("only so the records follow each other"), "{output}");
    // Two records may have a hole between them that is meant.
    peer.all(100);
    let output = update("two.s19", file(16, 2), &[], 2);
    assert!(output.contains("0x48") && output.contains("--addresses byte"), "{output}");
    assert!(peer.all(50).is_empty(), "nothing was sent");
    let output = update("two.s19", file(16, 2), &["--addresses", "byte"], 0);
    assert!(output.contains("32 bytes from word 0x20, addresses in bytes"), "{output}");
    let output = update("bytes.s19", file(16, 4), &["--addresses", "word"], 2);
    assert!(output.contains("are in no record"), "{output}");
}
