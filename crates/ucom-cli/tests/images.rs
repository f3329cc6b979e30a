//! Tests of firmware files: record files, raw binary in a `.bin` file, and other files only on request.
#![cfg(unix)]

use crate::common;

use common::{Sim, image};

/// The command refuses a text file before it sends any frame; the error contains the position in the file. The command shows the images
/// and the targets of the update.
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
        assert!(output.out.contains(place), "{name}: {}", output.out);
        assert!(output.out.contains("make the file again"), "{name}: {}", output.out);
        assert!(!output.out.contains("--raw"), "{name}: {}", output.out);
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

/// The hint about a damaged record file never suggests to write the characters of the file to the board. The option `--raw` does not write
/// the characters of a record file either.
#[test]
fn d46_raw_does_not_flash_records() {
    let sim = Sim::numbered(&["--boards", "1", "--flash-ids", "0x21"]);
    let hex = ":0400000001020304F2\n:00000001FF\n";
    let srec = "S107000001020304EE\nS9030000FC\n";
    let files: [(&str, Vec<u8>); 10] = [
        ("checksum.hex", hex.replace("F2", "F3").into()),
        ("checksum.s19", srec.replace("EE", "EF").into()),
        ("cut.hex", ":0400000001020304F2\n".into()),
        ("z.hex", [hex.as_bytes(), b"\x1Amade by hand\n"].concat()),
        ("nul.hex", [&hex.as_bytes()[..20], &[0; 16]].concat()),
        ("colon.hex", hex.replace(':', "").into()),
        ("odd.hex", hex.replace("0102", "012").into()),
        ("mark.hex", format!("\u{feff}{hex}").into()),
        ("wide.hex", hex.encode_utf16().flat_map(u16::to_le_bytes).collect()),
        ("behind.s19", format!("{srec}made by hand\n").into()),
    ];
    let mut peer = sim.peer();
    for (name, content) in &files {
        for name in [(*name).to_owned(), format!("{name}.bin")] {
            let file = sim.file(&name, content);
            for raw in [&[][..], &["--raw"]] {
                let words = [&["update", "1", &file, "--flash-id", "0x21"], raw].concat();
                let output = sim.ucom(&words).ends(2);
                assert!(output.err.contains("make the file again"), "{name} {raw:?}: {}", output.err);
                for word in ["--raw", "rename", "--force"] {
                    assert!(!output.err.contains(word), "{name} {raw:?}: {}", output.err);
                }
            }
        }
    }
    let renamed = sim.file("bytes.hex", &image(500, 1));
    let output = sim.ucom(&["update", "1", &renamed, "--flash-id", "0x21", "--raw"]).ends(2);
    assert!(output.err.contains("rename the file to .bin"), "{}", output.err);
    assert!(peer.all(50).is_empty(), "nothing was sent");
}

/// A count record with the correct number may end a file of S-records. The command fills gaps in an image on request, and its hint names
/// the option `--fill-gaps`.
#[test]
fn count_records_and_gaps() {
    let sim = Sim::numbered(&["--boards", "1", "--flash-ids", "0x21"]);
    let data = "S10700000102030EE4\n";
    let data = data.replace("0102030EE4", "01020304EE");
    let dry = |name: &str, text: String, more: &[&str], code: i32| {
        let file = sim.file(name, text.as_bytes());
        sim.ucom(&[&["update", "1", &file, "--flash-id", "0x21", "--dry-run"], more].concat()).ends(code).err
    };
    let output = dry("count.s19", format!("{data}S5030001FB\n"), &[], 0);
    assert!(output.contains("the count record confirms all 1 data records"), "{output}");
    let output = dry("wrong.s19", format!("{data}S5030002FA\n"), &[], 2);
    assert!(output.contains("line 2") && output.contains("make the file again"), "{output}");
    let hole = ":0400000001020304F2\n:0400100001020304E2\n:00000001FF\n";
    let output = dry("hole.hex", hole.into(), &[], 2);
    assert!(
        output.contains("12 bytes at word address 0x2") && output.contains("--fill-gaps 0xFF"),
        "{output}"
    );
    assert!(!output.contains("--addresses"), "{output}");
    let output = dry("hole.hex", hole.into(), &["--fill-gaps", "0xFF"], 0);
    assert!(output.contains("gap of 12 bytes at word address 0x2 filled with FF"), "{output}");
    let output = dry("hole.hex", hole.into(), &["--fill-gaps", "0"], 0);
    assert!(output.contains("gap of 12 bytes at word address 0x2 filled with 00"), "{output}");
    for wrong in [&["--fill-gaps"][..], &["--fill-gaps", "FF"], &["--fill-gaps", "256"]] {
        dry("hole.hex", hole.into(), wrong, 2);
    }
    let odd = ":020001000102FA\n:00000001FF\n";
    let output = dry("odd.hex", odd.into(), &[], 2);
    assert!(output.contains("the 1 byte at word address 0x0") && output.contains("--fill-gaps"), "{output}");
    dry("odd.hex", odd.into(), &["--fill-gaps", "0xFF"], 0);
}

/// A file is complete with its end record. ^Z and NUL after the end record, and CR as line end, do not damage the file.
#[test]
fn the_characters_of_old_tools_are_no_damage() {
    let sim = Sim::numbered(&["--boards", "1", "--flash-ids", "0x21"]);
    let hex = ":0400000001020304F2\r\n:00000001FF\r\n";
    for (name, text) in [
        ("z.hex", format!("{hex}\x1A")),
        ("nul.hex", format!("{hex}{}", "\0".repeat(16))),
        ("cr.hex", hex.replace('\n', "")),
    ] {
        let file = sim.file(name, text.as_bytes());
        let output = sim.ucom(&["update", "1", &file, "--flash-id", "0x21", "--dry-run"]).ends(0);
        assert!(output.err.contains("Intel HEX, 4 bytes from word 0x0"), "{name}: {}", output.err);
    }
}

/// The tool chain of the boards counts S-record addresses in words; other tools count addresses in bytes. The command determines the unit
/// of the addresses from the records, or from `--addresses`.
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
    assert!(output.contains("because only then the records are contiguous"), "{output}");
    // With only two records, a gap between them may be intended. The command cannot determine the unit of the
    // addresses, and refuses the file.
    peer.all(100);
    let output = update("two.s19", file(16, 2), &[], 2);
    assert!(output.contains("0x48") && output.contains("--addresses byte"), "{output}");
    assert!(peer.all(50).is_empty(), "nothing was sent");
    let output = update("two.s19", file(16, 2), &["--addresses", "byte"], 0);
    assert!(output.contains("32 bytes from word 0x20, addresses in bytes"), "{output}");
    let output = update("bytes.s19", file(16, 4), &["--addresses", "word"], 2);
    assert!(output.contains("no record contains the"), "{output}");
}
