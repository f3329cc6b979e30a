//! Tests of `ucom update` with boards that already have the program. The record of the last update in the inventory
//! shows whether the command must write the program again (D-62, U-3).
#![cfg(unix)]

use crate::common;

use cli_kit::testing::ended;
use common::{Sim, ended_by, image, outcomes};
use serde_json::Value;

fn hex(address: u16, data: &[u8]) -> String {
    let mut text = String::new();
    for (i, chunk) in data.chunks(16).enumerate() {
        let at = address + 16 * i as u16;
        let mut bytes = vec![chunk.len() as u8, (at >> 8) as u8, at as u8, 0];
        bytes.extend(chunk);
        bytes.push(bytes.iter().fold(0_u8, |sum, b| sum.wrapping_sub(*b)));
        text += &format!(":{}\n", bytes.iter().map(|b| format!("{b:02X}")).collect::<String>());
    }
    text + ":00000001FF\n"
}

fn of(report: &Value) -> (&str, bool) {
    let board = &report["boards"][0];
    (board["outcome"].as_str().unwrap(), board["verified"].as_bool().unwrap())
}

/// D-62: the command writes data memory each time, because the board cannot report the content of this memory.
#[test]
fn d62_data_memory_is_never_taken_as_proven() {
    let profile = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(profile.path(), "[prog]\nplan = \"pmem-xmem\"\n").unwrap();
    let path = profile.path().to_str().unwrap();
    let sim = Sim::start(&["--boards", "2", "--profile", path]);
    sim.ucom(&["--profile", path, "init"]).ends(0);
    let program = sim.file("program.bin", &image(1000, 1));
    for (byte, more) in [(1, &[][..]), (2, &[]), (2, &["--group"]), (3, &["--group"])] {
        let data = sim.file("data.bin", &[byte, 0x80].repeat(100));
        let words = ["--profile", path, "update", "1,2", &program, "--data", &data];
        let report = sim.json(&[&words, more].concat(), 0);
        assert_eq!(outcomes(&report), ["verified", "verified"], "{byte}: {report}");
    }
}

/// D-62: if the same image has another address, the command writes its bytes again. If the inventory has no record of
/// the image, the command sends no program data, and no board counts as verified.
#[test]
fn d62_another_address_is_written() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let path = sim.path("inventory.toml");
    let commented = format!("# cabinet 3\n{}", std::fs::read_to_string(&path).unwrap());
    std::fs::write(&path, &commented).unwrap();
    let low = sim.file("low.hex", hex(0, &image(64, 1)).as_bytes());
    let high = sim.file("high.hex", hex(0x400, &image(64, 1)).as_bytes());
    assert_eq!(of(&sim.json(&["update", "1", &low], 0)), ("verified", true));
    assert_eq!(of(&sim.json(&["update", "1", &low], 0)), ("up-to-date", true));
    assert_eq!(of(&sim.json(&["update", "1", &high], 0)), ("verified", true));
    assert_eq!(of(&sim.json(&["update", "1", &high], 0)), ("up-to-date", true));
    let text = sim.ucom(&["update", "1", &high]).ends(0).out;
    assert!(text.contains("same Program ID and date"), "{text}");
    // The inventory contains the record of the image. `init` keeps this record, so the image is still up to date.
    let kept = std::fs::read_to_string(&path).unwrap();
    assert!(kept.contains("# cabinet 3") && kept.contains("address = 0x200"), "{kept}");
    sim.ucom(&["init"]).ends(0);
    assert_eq!(of(&sim.json(&["update", "1", &high], 0)), ("up-to-date", true));
    // The test restores the old inventory, which has no record of the image. The board then only counts as
    // `program-up-to-date`, which is not verified.
    std::fs::write(&path, &commented).unwrap();
    let mut peer = sim.peer();
    for (more, code) in [(&[][..], 4), (&["--unverified"], 0), (&["--dry-run"], 4)] {
        let report = sim.json(&[&["update", "1", &high], more].concat(), code);
        assert_eq!(of(&report), ("program-up-to-date", false), "{report}");
        assert_eq!(report["exit"], code);
    }
    assert!(!peer.all(50).iter().any(|frame| frame.starts_with("2C1#")), "nothing was sent");
    let text = sim.ucom(&["update", "1", &high]).ends(4).out;
    assert!(text.contains("--rewrite") && !text.contains("--force"), "{text}");
    assert_eq!(of(&sim.json(&["update", "1", &high, "--rewrite"], 0)), ("verified", true));
    // Without an inventory file, a record of the image is missing, so the update is not verified either.
    let nowhere = sim.path("nowhere.toml");
    let words = ["update", "1", &high, "--inventory", &nowhere];
    assert_eq!(of(&sim.json(&words, 4)), ("program-up-to-date", false));
}

/// D-62: a killed update leaves no record in the inventory; the record of the previous program is also removed.
#[test]
fn d62_a_killed_update_leaves_no_record() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let first = sim.file("first.bin", &image(2000, 1));
    assert_eq!(of(&sim.json(&["update", "1", &first], 0)), ("verified", true));
    let kept = || std::fs::read_to_string(sim.path("inventory.toml")).unwrap().contains("sha256");
    assert!(kept());
    let mut peer = sim.peer();
    let update = sim.spawn(&["update", "1", &sim.file("next.bin", &image(60 * 1024, 2))]);
    // The first READY frame answers the first block of the first cycle. At this time nothing is erased, because the
    // erase begins in the second cycle.
    peer.wait("181#");
    ended_by(update, "-KILL");
    assert!(!kept());
    while !peer.all(1000).is_empty() {}
    assert_eq!(of(&sim.json(&["update", "1", &first], 4)), ("program-up-to-date", false));
}

/// D-62: if the command cannot remove the record of the old program from the inventory, it does not erase the memory.
#[test]
fn d62_a_record_that_cannot_be_removed_ends_the_update() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let (first, next) = (sim.file("first.bin", &image(2000, 1)), sim.file("next.bin", &image(2000, 2)));
    assert_eq!(of(&sim.json(&["update", "1", &first], 0)), ("verified", true));
    let shown = sim.json(&["info", "1"], 0)["boards"][0]["program_id"].clone();
    let mut peer = sim.peer();
    let update = sim.spawn(&["--json", "update", "1", &next]);
    // When the command sends this frame, it has read the inventory but has not yet checked for another PC. The test
    // removes the inventory now, so that the command cannot remove the record in it later.
    peer.wait("201#");
    std::fs::remove_file(sim.path("inventory.toml")).unwrap();
    let output = ended(update).ends(4);
    assert_eq!(of(&output.json()), ("cancelled", false), "{}", output.out);
    assert!(output.err.contains("ends before it erases more memory"), "{}", output.err);
    assert!(!peer.all(50).iter().any(|frame| frame.starts_with("2C1#")), "no program data");
    assert_eq!(sim.json(&["info", "1"], 0)["boards"][0]["program_id"], shown);
}

/// U-3: the command does not write the same image with another date again, unless the user requests this date.
#[test]
fn u3_a_campaign_may_pass_midnight() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let file = sim.file("app.bin", &image(2000, 1));
    sim.ucom(&["update", "1", &file, "--date", "2025-11-25"]).ends(0);
    let output = sim.ucom(&["update", "all", &file]).ends(0).out;
    assert!(output.contains("up-to-date (flashed 2025-11-25)"), "{output}");
    let report = sim.json(&["update", "all", &file], 0);
    assert_eq!(outcomes(&report), ["up-to-date", "up-to-date"]);
    let report = sim.json(&["update", "1", &file, "--date", "2025-11-26"], 0);
    assert_eq!(
        (of(&report), &report["boards"][0]["after"]["flash_date"]),
        (("verified", true), &"2025-11-26".into())
    );
}
