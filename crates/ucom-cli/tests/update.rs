//! Tests of `ucom update` with `ucom sim`: outcomes, exit codes, and the files after the update.
#![cfg(unix)]

use crate::common;

use cli_kit::testing::{ended, signal};
use common::{Sim, ended_by, golden, image, outcomes};

fn chain(boards: &str) -> Sim {
    Sim::numbered(&["--boards", boards])
}

fn program_id(sim: &Sim, board: &str) -> serde_json::Value {
    sim.json(&["info", board], 0)["boards"][0]["program_id"].clone()
}

/// U-1 to U-10 with 60 KiB: the first update is verified, and the second update reports the board as up to date. The Program ID of the
/// image is the example value in section 13.3.
#[test]
fn d46_update_is_verified_and_then_up_to_date() {
    let sim = chain("2");
    let file = sim.file("app.bin", &image(60 * 1024, 1));
    let update = sim.json(&["update", "2", &file, "--date", "2009-06-01"], 0);
    assert_eq!(update["outcome"], "verified", "{update}");
    assert_eq!(update["flash_date"], "2009-06-01");
    assert_eq!(program_id(&sim, "2"), update["program_id"]);
    let update = sim.json(&["update", "2", &file, "--date", "2009-06-01"], 0);
    assert_eq!(
        (update["outcome"].as_str(), update["boards"][0]["attempts"].as_u64()),
        (Some("up-to-date"), Some(0))
    );

    let golden = golden();
    let file = sim.file("golden.bin", &golden);
    let update = sim.json(&["update", "1", &file, "--start", "--flash-id", "0x21"], 0);
    assert_eq!((update["outcome"].as_str(), update["program_id"].as_u64()), (Some("running"), Some(0x4B3F)));
}

/// D-41: with `--name-target`, the header of the image is valid only for this board; without it, for any board.
#[test]
fn d41_the_header_names_the_board_if_wanted() {
    let sim = Sim::numbered(&["--boards", "2", "--flash-ids", "0x21,0x42"]);
    let file = sim.file("app.bin", &image(500, 1));
    for (option, expected) in [("--name-target", "4200"), ("--start", "FFFF")] {
        let mut peer = sim.peer();
        let update = sim.spawn(&["update", "2", &file, "--force", option]);
        peer.wait("2C2#4355");
        peer.wait("2C2#");
        // Words 8 to 11 of the header are Program ID, date, target and reserve.
        let third = peer.wait("2C2#");
        ended(update).ends(0);
        assert_eq!(&third[12..16], expected, "{third}");
    }
}

/// D-46: if the exit code is 2 or 4, the command has changed no board.
#[test]
fn d46_refusals_change_nothing() {
    let sim = chain("3");
    let file = sim.file("app.bin", &image(2000, 2));
    let before = program_id(&sim, "1");
    // The flash number of the board is 0x21, but the user expects 0x77. The update must therefore not start.
    let update = sim.json(&["update", "1", &file, "--flash-id", "0x77"], 4);
    assert_eq!(update["boards"][0]["outcome"], "not-started", "{update}");
    assert!(update["boards"][0]["error"]["message"].as_str().unwrap().contains("0x0021"), "{update}");
    sim.ucom(&["update", "1-2", &file, "--flash-id", "0x21"]).ends(2);
    sim.ucom(&["update", "1", &sim.file("half.hex", b":10000000"), "--flash-id", "0x21"]).ends(2);
    sim.ucom(&["update", "1", &file, "--date", "yesterday"]).ends(2);
    // An update of several boards needs their identities from the inventory, so it is refused without an inventory.
    let output = sim.ucom(&["--json", "update", "all", &file, "--inventory", "/nowhere.toml"]).ends(4);
    assert_eq!(output.json()["error"]["code"], "no-inventory");
    let dry = sim.json(&["update", "all", &file, "--dry-run"], 0);
    assert_eq!((dry["dry_run"].as_bool(), dry["boards"].as_array().unwrap().len()), (Some(true), 3));
    // While board 3 runs, the command updates no board, not even board 1.
    let run = sim.spawn(&["--json", "run", "3"]);
    sim.peer().wait("603#01000000");
    sim.ucom(&["update", "1", &file]).ends(4);
    ended_by(run, "-INT").ends(0);
    assert_eq!(program_id(&sim, "1"), before);
    // No board has the number 9, so the board does not answer.
    sim.ucom(&["update", "9", &file, "--flash-id", "0x77"]).ends(3);
}

/// The exit code is 1 if the board reports an error before the erase, and 5 if it reports an error after the erase.
#[test]
fn d46_errors_before_and_after_the_erase() {
    let mut sim = chain("2");
    // The image is larger than the application area, so the board reports an error before the erase.
    let file = sim.file("large.bin", &image(100 * 1024, 3));
    let before = program_id(&sim, "1");
    let update = sim.json(&["update", "1", &file], 1);
    assert_eq!(update["boards"][0]["attempts"], 1, "P-11: exactly one attempt: {update}");
    assert_eq!(program_id(&sim, "1"), before);
    sim.fault("flash-broken board=1");
    let file = sim.file("app.bin", &image(2000, 4));
    let update = sim.json(&["update", "1", &file], 5);
    assert_eq!(update["boards"][0]["attempts"], 3, "P-11: exactly three attempts: {update}");
}

/// If one of several boards does not answer, the update ends with exit code 3. A later update of all boards writes
/// only the board that does not have the program yet.
#[test]
fn an_update_session_goes_on_and_is_resumed() {
    let mut sim = chain("3");
    let file = sim.file("app.bin", &image(4000, 5));
    sim.fault("silent board=2");
    sim.ucom(&["update", "1-3", &file]).ends(3);
    let infos = sim.json(&["scan"], 0);
    assert_eq!(infos["boards"].as_array().unwrap().len(), 2);
    // The second part of the test uses a new chain. The test first updates only boards 1 and 3. The update of all
    // boards must then write only board 2.
    drop(sim);
    let sim = chain("3");
    // The test uses a fixed date, because U-3 also compares dates. Around midnight, the two runs would have different dates.
    let file = file_in(&sim);
    let update = |boards| sim.json(&["update", boards, &file, "--date", "2009-06-01"], 0);
    assert_eq!(update("1,3")["boards"][1]["outcome"], "verified");
    let all = update("all");
    assert_eq!(outcomes(&all), ["up-to-date", "verified", "up-to-date"]);
}

fn file_in(sim: &Sim) -> String {
    sim.file("session.bin", &image(4000, 6))
}

/// P-12: the test presses Ctrl-C in the middle of a block. The command sends SETSTATUS(04,00) and ends with exit code 5, because the
/// erase has begun. The board can still be used.
#[test]
fn p12_cancel_leaves_the_board_usable() {
    let sim = chain("1");
    let file = sim.file("app.bin", &image(60 * 1024, 7));
    let mut peer = sim.peer();
    let update = sim.spawn(&["--json", "update", "1", &file]);
    // This point of the update is in the second cycle, because the first cycle has 961 blocks with one READY each.
    peer.wait_for(1200, "181#");
    signal(&update, "-INT");
    peer.wait("1C1#0400");
    let output = ended(update).ends(5);
    assert_eq!(output.json()["boards"][0]["outcome"], "incomplete", "{}", output.out);
    let info = sim.json(&["info", "1"], 0);
    assert_eq!(info["boards"][0]["application"], false);
    sim.ucom(&["update", "1", &sim.file("small.bin", &image(2000, 8))]).ends(0);
}

/// P-13: after kill -9 during an update, the next run of the command completes the update.
#[test]
fn p13_a_killed_update_is_recovered_by_the_next() {
    let sim = chain("1");
    let file = sim.file("app.bin", &image(60 * 1024, 9));
    let mut peer = sim.peer();
    let update = sim.spawn(&["update", "1", &file]);
    peer.wait_for(1100, "181#");
    ended_by(update, "-KILL");
    // Frames that the killed process has passed to its adapter are still sent. On a busy computer, sending these frames takes some
    // time. Until these frames end, the next command would detect another PC on the bus.
    while !peer.all(1000).is_empty() {}
    let update = sim.json(&["update", "1", &file], 0);
    assert_eq!(update["outcome"], "verified", "{update}");
}

/// The board loses its power in the second cycle. After the power loss, the board boots without an application. The command `init`
/// and a new update repair the board.
#[test]
fn d46_power_loss_in_mid_update() {
    let mut sim = chain("2");
    let file = sim.file("app.bin", &image(20 * 1024, 10));
    sim.fault("power-loss board=1 for_s=0.3 on_id=0x2C1 on_count=4000");
    let first = sim.ucom(&["--json", "update", "1", &file]);
    assert!([0, 5].contains(&first.code), "{}", first.out);
    sim.ucom(&["init"]).ends(0);
    let update = sim.json(&["update", "1", &file], 0);
    assert!(["verified", "up-to-date"].contains(&update["outcome"].as_str().unwrap()), "{update}");
}

/// D-46: if the bus fails after the erase, the exit code is 5. The report of the update is complete, and includes boards whose update
/// is complete. If the bus fails before the erase, the exit code is 3.
#[test]
fn d46_a_bus_that_fails_leaves_the_report() {
    // Each case contains the number of READY frames that board 2 sends before the simulator is killed. The first cycle of an update
    // has 961 READY frames.
    for (blocks, code, outcome) in [(300, 3, "not-started"), (1200, 5, "incomplete")] {
        let sim = chain("2");
        let file = sim.file("app.bin", &image(60 * 1024, 11));
        let mut peer = sim.peer();
        let update = sim.spawn(&["--json", "update", "1,2", &file]);
        peer.wait("101#");
        peer.wait_for(blocks, "182#");
        let dir = sim.kill();
        let output = ended(update).ends(code);
        let report = output.json();
        assert_eq!(report["exit"], code);
        assert_eq!(report["boards"][0]["outcome"], "verified", "{report}");
        assert_eq!(report["boards"][1]["outcome"], outcome, "{report}");
        assert_eq!(report["boards"][1]["error"]["code"], "bus", "{report}");
        drop(dir);
    }
}

/// D-46: if the bus fails during an update, the text output contains the outcome, the cause and the next step.
#[test]
fn d46_a_bus_that_fails_is_told_in_words() {
    let sim = chain("1");
    let file = sim.file("app.bin", &image(60 * 1024, 12));
    let mut peer = sim.peer();
    let update = sim.spawn(&["update", "1", &file]);
    peer.wait_for(1200, "181#");
    let dir = sim.kill();
    let output = ended(update).ends(5);
    for word in ["incomplete", "the bus failed", "run the update again"] {
        assert!(output.out.contains(word), "{word}: {}", output.out);
    }
    drop(dir);
}

/// P-12: the test presses Ctrl-C before the erase. The exit code is 4, the outcome is `cancelled`, and the board keeps its program.
#[test]
fn p12_cancelled_before_the_erase() {
    let sim = chain("1");
    let before = program_id(&sim, "1");
    let file = sim.file("app.bin", &image(60 * 1024, 13));
    let mut peer = sim.peer();
    let update = sim.spawn(&["--json", "update", "1", &file]);
    peer.wait_for(100, "181#");
    signal(&update, "-INT");
    peer.wait("1C1#0400");
    let report = ended(update).ends(4).json();
    assert_eq!(
        (&report["outcome"], &report["boards"][0]["error"]["code"]),
        (&"cancelled".into(), &"cancelled".into())
    );
    assert_eq!(program_id(&sim, "1"), before);
}

/// D-08: a dry run also checks whether another PC is on the bus.
#[test]
fn d08_a_dry_run_sees_another_pc() {
    let mut sim = chain("1");
    let file = sim.file("app.bin", &image(2000, 14));
    sim.ucom(&["update", "1", &file, "--dry-run"]).ends(0);
    sim.fault("foreign-master for_s=20");
    let report = sim.json(&["update", "1", &file, "--dry-run"], 4);
    assert_eq!(report["boards"][0]["error"]["code"], "foreign-master", "{report}");
}

/// A group update is a single transfer for several boards. A board outside the group keeps its program.
#[test]
fn d46_a_group_is_one_transfer() {
    let sim = chain("4");
    let before = program_id(&sim, "3");
    let file = sim.file("app.bin", &image(2000, 15));
    sim.ucom(&["xreset", "3"]).ends(0);
    let mut peer = sim.peer();
    let update = sim.spawn(&["--json", "update", "1,2,4", &file, "--group"]);
    peer.wait("2C0#");
    let report = ended(update).ends(0).json();
    assert_eq!(outcomes(&report), ["verified"; 3], "{report}");
    assert!(peer.all(100).iter().all(|f| !f.starts_with("2C1#")), "one transfer only");
    assert_eq!(program_id(&sim, "3"), before);
}

/// With two images, each image is written to the target that the plan in the profile specifies. The report contains both images. The
/// command refuses invalid combinations of image files and options.
#[test]
fn d40_two_images_by_plan() {
    let files = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: &[u8]| {
        let path = files.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (app, other) = (file("app.bin", &image(2000, 16)), file("other.bin", &image(256, 17)));
    let cases = [("exloader-app", "--exloader", "ram", 1), ("pmem-xmem", "--data", "data", 2)];
    for (plan, option, memory, cycle) in cases {
        let profile = file("profile.toml", format!("[prog]\nplan = \"{plan}\"\n").as_bytes());
        let sim = Sim::start(&["--boards", "1", "--profile", &profile]);
        sim.ucom(&["--profile", &profile, "init"]).ends(0);
        let words = ["--json", "--profile", &profile, "update", "1", &app, option, &other];
        let report = sim.ucom(&words).ends(0).json();
        assert_eq!(report["outcome"], "verified", "{report}");
        let images = report["images"].as_array().unwrap();
        assert_eq!(
            (&images[0]["file"], &images[0]["bytes"]),
            (&app.clone().into(), &2000.into()),
            "{report}"
        );
        assert_eq!(
            (&images[1]["file"], &images[1]["bytes"]),
            (&other.clone().into(), &256.into()),
            "{report}"
        );
        assert_eq!(
            (&images[1]["memory"], &images[1]["address_words"]),
            (&memory.into(), &0.into()),
            "{report}"
        );
        assert_eq!(images[1]["cycles"], serde_json::json!([cycle]));
        assert!(
            images[0]["program_id"] == report["program_id"]
                && images[1]["program_id"] != report["program_id"]
        );
        // Each of these commands is refused: an image is missing, or an option belongs to another plan.
        let output = sim.ucom(&["--profile", &profile, "update", "1", &app]).ends(2);
        assert!(output.err.contains(option) && output.err.contains(plan), "{}", output.err);
        let output = sim.ucom(&["--profile", &profile, "update", "1", &app, "--second", &other]).ends(2);
        assert!(output.err.contains("raw") && output.err.contains(plan), "{}", output.err);
        let output = sim.ucom(&["update", "1", &app, option, &other]).ends(2);
        assert!(output.err.contains("verify-write"), "{}", output.err);
    }
}

/// U-10 with raw files: the command writes the program, and reports that the program is not verified. If the user specifies a Program
/// ID, the command verifies the program with it.
#[test]
fn u10_raw_files_are_verified_when_their_program_id_is_named() {
    let profile = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(profile.path(), "[prog]\nplan = \"raw\"\n").unwrap();
    let profile = profile.path().to_str().unwrap();
    let sim = Sim::start(&["--boards", "1", "--profile", profile]);
    sim.ucom(&["--profile", profile, "init"]).ends(0);
    // The test builds the files that a tool chain would write: one file per cycle, each with its header and the data.
    let golden = golden();
    let cycle = |cycle, date| {
        let header = ucom::Header {
            cycle,
            memory: 0,
            address: 0,
            length: 500,
            program_id: 0x4B3F,
            date,
            target: 0xFFFF,
        };
        [&header.build(ucom::Endian::Little)[..], &golden].concat()
    };
    let (first, second) = (sim.file("1.bin", &cycle(1, 0x3AC1)), sim.file("2.bin", &cycle(2, 0x3AC1)));
    let words = ["--profile", profile, "update", "1", &first, "--second", &second];
    let output = sim.ucom(&words).ends(5);
    for word in ["written", "NOT verified", "0x4B3F, 2009-06-01", "--expect-program-id", "--unverified"] {
        assert!(output.out.contains(word), "{word}: {}", output.out);
    }
    let with = |more: &[&'static str]| {
        let words: Vec<&str> = ["--json"].iter().chain(&words).chain(more).copied().collect();
        sim.ucom(&words)
    };
    let report = with(&["--start", "--unverified"]).ends(0).json();
    assert_eq!((&report["outcome"], &report["boards"][0]["verified"]), (&"running".into(), &false.into()));
    assert_eq!(
        (&report["boards"][0]["changed"], &report["program_id"]),
        (&false.into(), &serde_json::Value::Null)
    );
    assert!(report["unverifiable"]["hint"].as_str().unwrap().contains("--expect-program-id"), "{report}");
    // The answer of the board does not cover the second file, so the command writes this file each time (D-62).
    let report = with(&["--expect-program-id", "0x4B3F"]).ends(0).json();
    assert_eq!((&report["outcome"], &report["boards"][0]["verified"]), (&"verified".into(), &true.into()));
    let report = with(&["--expect-program-id", "0x4B3F", "--force"]).ends(0).json();
    assert_eq!((&report["outcome"], &report["boards"][0]["verified"]), (&"verified".into(), &true.into()));
    let report = with(&["--expect-program-id", "0x4B40"]).ends(5).json();
    assert_eq!(report["boards"][0]["error"]["code"], "not-verified", "{report}");
}

/// `all` includes the boards of the inventory. If boards have lost their numbers, the command reports them as missing and does not
/// skip them.
#[test]
fn all_is_the_inventory_too() {
    let sim = chain("4");
    for board in ["2", "4"] {
        sim.ucom(&["reset", board]).ends(0);
    }
    let output = sim.ucom(&["--json", "update", "all", &file_in(&sim)]).ends(3);
    let report = output.json();
    assert_eq!(outcomes(&report), ["verified", "not-started", "verified", "not-started"], "{report}");
    assert_eq!(report["boards"][1]["error"]["code"], "no-answer", "{report}");
    assert!(output.err.contains("has no number"), "{}", output.err);
    // The command `start all` also reports the missing boards.
    let output = sim.ucom(&["start", "all"]).ends(0);
    assert!(
        output.err.contains("0x42") || output.err.matches("has no number").count() == 2,
        "{}",
        output.err
    );
}

/// P-12: the test presses Ctrl-C during the identification. No board was erased, the exit code is 4, and the outcome is `cancelled`.
#[test]
fn p12_cancelled_while_it_scans() {
    let sim = chain("2");
    let file = file_in(&sim);
    let mut peer = sim.peer();
    let update = sim.spawn(&["--json", "update", "all", &file]);
    peer.wait("240#");
    signal(&update, "-INT");
    let report = ended(update).ends(4).json();
    for board in report["boards"].as_array().unwrap() {
        assert_eq!((&board["outcome"], &board["error"]["code"]), (&"cancelled".into(), &"cancelled".into()));
    }
    assert_eq!(report["boards"].as_array().unwrap().len(), 2, "{report}");
}

/// If the known Program ID of an image differs from the requested one, the command refuses the update before it sends any frame.
#[test]
fn a_named_program_id_is_compared_with_the_image() {
    let sim = chain("1");
    let golden = golden();
    let file = sim.file("golden.bin", &golden);
    let output = sim.ucom(&["update", "1", &file, "--expect-program-id", "0x4B40"]).ends(4);
    assert!(output.err.contains("0x4B3F") && output.err.contains("0x4B40"), "{}", output.err);
    sim.ucom(&["update", "1", &file, "--expect-program-id", "0x4B3F"]).ends(0);
}
