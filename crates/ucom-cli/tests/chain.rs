//! Tests of `ucom` commands with `ucom sim`: the chain, process data and recordings.
#![cfg(unix)]

use crate::common;

use cli_kit::testing::{ended, signal};
use common::{Sim, ended_by};
use serde_json::json;

#[test]
fn the_simulator_ends_with_0_on_a_signal() {
    for name in ["-INT", "-TERM"] {
        assert_eq!(Sim::start(&["--boards", "1"]).end(name), 0, "{name}");
    }
}

/// P-1, D-T1: a scan only sends requests, and finds boards with and without numbers.
#[test]
fn p1_scan_only_asks() {
    let sim = Sim::start(&["--boards", "5", "--flash-ids", "0x21,0x42,0x63,0x04,0x7F"]);
    let mut peer = sim.peer();
    let scan = sim.json(&["scan"], 0);
    assert_eq!(scan["reports"], json!([0x04, 0x21, 0x42, 0x63, 0x7F]));
    assert_eq!(scan["boards"], json!([]));
    let asks = |f: &String| f == "240#" || f.starts_with("20") || f.starts_with("21");
    let received = peer.all(200);
    let of_pc = received.iter().filter(|f| !f.starts_with('4')).collect::<Vec<_>>();
    assert!(of_pc.iter().all(|f| asks(f)) && !of_pc.is_empty(), "{of_pc:?}");
    sim.ucom(&["init"]).ends(0);
    peer.all(100);
    let scan = sim.json(&["scan"], 0);
    assert_eq!(scan["boards"].as_array().unwrap().len(), 5);
    assert_eq!(scan["boards"][4]["flash_number"], 0x7F);
    assert_eq!(scan["findings"], json!([]));
    let of_pc: Vec<String> = peer.all(200).into_iter().filter(|f| f.starts_with('0')).collect();
    assert!(of_pc.is_empty(), "{of_pc:?}");
}

/// P-2: the test uses chains of 0, 1 and 31 boards. The command writes the inventory and compares it with the chain. If the inventory
/// differs from the chain, the file is not changed.
#[test]
fn p2_init_of_chains_and_their_inventory() {
    let sim = Sim::start(&["--boards", "0"]);
    let output = sim.ucom(&["--json", "init"]).ends(3);
    assert_eq!(output.json()["ok"], false);
    drop(sim);

    let sim = Sim::start(&["--boards", "31"]);
    let mut peer = sim.peer();
    let init = sim.json(&["init"], 0);
    assert_eq!(init["boards"].as_array().unwrap().len(), 31);
    assert_eq!(init["boards"][30]["number"], 31);
    let frames = peer.all(100);
    assert!(frames.iter().any(|f| f == "29F#") && frames.iter().all(|f| f != "2A0#"), "no PC_INIT(32)");
    drop(sim);

    let sim = Sim::start(&["--boards", "3"]);
    let init = sim.json(&["init"], 0);
    let first = &init["boards"][0];
    assert_eq!(first["status"], json!(["EXLRUN", "INIT", "OPINIT", "IPINIT"]));
    assert_eq!(first["flash_date"], "2008-03-14");
    let inventory = std::fs::read_to_string(sim.path("inventory.toml")).unwrap();
    assert!(inventory.contains("flash_number = 0x0023"), "{inventory}");
    // In the changed inventory, one board has another flash number, as if the board had been exchanged. The finding
    // of `init` must contain both flash numbers.
    std::fs::write(sim.path("inventory.toml"), inventory.replace("0x0023", "0x0055")).unwrap();
    let output = sim.ucom(&["--json", "init"]).ends(1);
    let text = output.json()["findings"][0].as_str().unwrap().to_owned();
    assert!(text.contains("0x0023") && text.contains("0x0055"), "{text}");
    sim.ucom(&["init", "--renew"]).ends(0);
}

/// D-24, 5.4: the report about a broken init wire contains the position of the fault.
#[test]
fn a_broken_init_wire_is_reported_with_its_place() {
    let mut sim = Sim::start(&["--boards", "4"]);
    sim.fault("wire-broken board=2");
    let init = sim.json(&["init"], 1);
    assert_eq!(init["boards"].as_array().unwrap().len(), 2);
    let text = init["findings"][0].as_str().unwrap();
    assert!(text.contains("after position 2") && text.contains("0x23") && text.contains("0x31"), "{text}");
}

/// D-T21: two boards with the same flash number send only one report on the bus, but the command detects them as two boards.
#[test]
fn d07_equal_flash_ids_are_found_out() {
    let sim = Sim::start(&["--boards", "3", "--flash-ids", "0x21,0x22,0x22"]);
    let init = sim.json(&["init"], 1);
    let all = init["findings"].to_string();
    assert!(all.contains("more boards than reports"), "{all}");
}

#[test]
fn status_bits_are_set_and_cleared_by_name() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let status = sim.json(&["status", "2", "--set", "ASTART"], 0);
    assert_eq!(status["boards"][0]["status_byte"], 0x5B);
    let status = sim.json(&["status", "2", "--clear", "astart"], 0);
    assert_eq!(status["boards"][0]["status_byte"], 0x1B);
    // D-T8: the status byte of the board is correct in all states.
    let byte = |words: &[&str]| sim.ucom(words).ends(0).json()["boards"][0]["status_byte"].clone();
    assert_eq!(byte(&["--json", "xreset", "1"]), 0x1F);
    assert_eq!(byte(&["--json", "start", "1"]), 0x8B);
    assert_eq!(byte(&["--json", "stop", "1"]), 0x1B);
    let reset = sim.json(&["reset"], 0);
    assert_eq!(reset["reports"], json!([0x21, 0x22]));
    sim.ucom(&["info", "1"]).ends(3);
}

#[test]
fn names_inputs_and_motion() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let output = sim.ucom(&["--json", "io", "1"]).ends(4);
    assert!(output.json()["error"]["hint"].as_str().unwrap().contains("ucom start 1"), "{}", output.out);
    sim.ucom(&["start", "1"]).ends(0);
    let io = sim.json(&["io", "1"], 0);
    assert_eq!(io["boards"][0]["ci"][0], "set_position [0.01 deg]");
    assert_eq!(io["boards"][0]["initial_ci"], json!([0, 1000, 900]));
    // The board moves to the input 1500, which is 15 degrees, while the command supervises the board.
    let so = sim.json(&["ci", "1", "set_position=1500", "--for", "1.5"], 0);
    let position = so["so"]["position"].as_i64().unwrap();
    assert!((1450..1550).contains(&position), "{so}");
    let status = sim.json(&["status", "1"], 0);
    assert_eq!(status["boards"][0]["state"], "started", "the loop was stopped");
    // D-35: a parameter value after a write is only assumed, because boards do not report parameters.
    let par = sim.json(&["par", "1", "kp=150"], 0);
    assert_eq!(
        (par["par"][0]["assumed"].clone(), par["par"][1]["assumed"].clone()),
        (json!(150), json!(null))
    );
    let output = sim.ucom(&["--json", "ci", "1", "set_positon=3"]).ends(2);
    assert!(output.json()["error"]["message"].as_str().unwrap().contains("set_position"), "{}", output.out);
    let output = sim.ucom(&["--json", "ci", "1", "2.set_position=3"]).ends(2);
    assert!(
        output.json()["error"]["message"].as_str().unwrap().contains("not one of the boards to set"),
        "{}",
        output.out
    );
}

/// P-17, D-08, D-50: while one PC runs the boards, the commands of a second PC are refused. If the first PC is lost, the boards become
/// safe.
#[test]
fn p17_one_master_at_a_time_and_none_is_safe() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let run = sim.spawn(&["--json", "run", "1", "--active", "--ci", "1.set_position=1000"]);
    let mut peer = sim.peer();
    peer.wait("601#01010000");
    // The second PC is allowed to listen to the outputs of the boards. The names were requested before the control
    // loop started, or are already known.
    let so = sim.json(&["so", "1", "--count", "1"], 0);
    assert!(so["so"]["position"].is_i64(), "{so}");
    // The second PC is also allowed to request identities, because the first PC does not misinterpret the answers.
    let scan = sim.json(&["scan"], 0);
    assert_eq!(
        (scan["boards"][0]["state"].as_str(), scan["boards"][1]["state"].as_str()),
        (Some("running"), Some("exloader"))
    );
    let output = sim.ucom(&["--json", "reset"]).ends(4);
    assert_eq!(output.json()["error"]["code"], "foreign-master", "{}", output.out);
    let so = sim.json(&["so", "1", "--count", "1"], 0);
    assert!(so["so"]["current"].is_i64(), "the board still runs: {so}");
    sim.ucom(&["ci", "1", "set_position=5"]).ends(4);
    // After kill -9, the PC sends no stop, so the board itself must stop.
    ended_by(run, "-KILL");
    peer.wait("601#00000000");
    let status = sim.json(&["status", "1"], 0);
    assert_eq!(status["boards"][0]["state"], "started");
}

/// Ctrl-C stops the control loops first, then the applications.
#[test]
fn run_stops_in_order() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let run = sim.spawn(&["--json", "run", "all"]);
    let mut peer = sim.peer();
    peer.wait("602#01000000");
    std::thread::sleep(std::time::Duration::from_millis(1200));
    let output = ended_by(run, "-INT").ends(0);
    assert!(output.out.contains("\"running\"") && output.out.contains("\"stopped\""), "{}", output.out);
    let status = sim.json(&["status"], 0);
    assert_eq!(status["boards"][0]["status_byte"], 0x1B);
    assert_eq!(status["boards"][1]["status_byte"], 0x1B);
}

/// P-19: if the bus load would be too high, the run is refused before any control loop starts.
#[test]
fn p19_load_is_refused() {
    let sim = Sim::numbered(&["--boards", "3"]);
    let profile = sim.file("slow.toml", b"load.limit = 1\n");
    let output = sim.ucom(&["--json", "run", "all", "--profile", &profile, "--for", "1"]).ends(4);
    assert_eq!(output.json()["error"]["code"], "load", "{}", output.out);
}

#[test]
fn monitor_and_doctor_see_what_is_there() {
    let mut sim = Sim::numbered(&["--boards", "3"]);
    let view = sim.json(&["monitor", "--count", "1"], 0);
    assert_eq!(view["boards"].as_array().unwrap().len(), 3, "{view}");
    assert_eq!(view["boards"][2]["description"], "UCoM2 neck roll");
    let doctor = sim.json(&["doctor"], 0);
    assert_eq!(doctor["healthy"], true, "{doctor}");
    sim.fault("foreign-frames for_s=10");
    let view = sim.json(&["monitor", "--count", "1", "--listen-only"], 0);
    assert!(view["foreign_frames"].as_u64().unwrap() > 10, "{view}");
}

#[test]
fn recordings_are_replayed_with_their_timing_and_without_intrusive_frames() {
    let sim = Sim::start(&["--boards", "2"]);
    for name in ["bus.log", "bus.mcap", "bus.fzi"] {
        let record = sim.spawn(&["--json", "record", &sim.path(name), "--for", "4"]);
        std::thread::sleep(std::time::Duration::from_millis(300));
        sim.ucom(&["init", "--renew"]).ends(0);
        let recorded = ended(record).ends(0).json();
        let frames = recorded["frames"].as_u64().unwrap();
        assert!(frames > 20, "{recorded}");
        let decoded = sim.ucom(&["decode", &sim.path(name)]).ends(0);
        assert_eq!(decoded.out.lines().count() as u64, frames, "{name}");
        assert!(decoded.out.contains("PC_RESET") && decoded.out.contains("UCoM2 neck pitch"), "{name}");
        let mut peer = sim.peer();
        let replay = sim.json(&["replay", &sim.path(name), "--speed", "4"], 0);
        assert!(replay["left_out"].as_u64().unwrap() > 5, "{replay}");
        let received = peer.all(300);
        assert!(
            received.iter().any(|f| f == "0C2#02") && received.iter().all(|f| f != "000#" && f != "282#"),
            "{name}"
        );
    }
}

/// P-20: the command `probe` measures the profile of boards that use the other byte order (big endian).
#[test]
fn p20_probe_finds_big_endian_boards() {
    let chain = tempfile::tempdir().unwrap();
    let file = chain.path().join("big.toml");
    let text = "[[board]]\nflash_id = 0x21\ndescription = 'big'\n[board.profile]\nendian = 'big'\nchain.auto_opinit = true\n";
    std::fs::write(&file, text).unwrap();
    let sim = Sim::start(&["--chain", file.to_str().unwrap()]);
    let probe = sim.json(&["probe", "--init", "--out", &sim.path("found.toml")], 0);
    assert!(probe["profile"].as_str().unwrap().contains("endian = \"big\""), "{probe}");
    assert!(probe["profile"].as_str().unwrap().contains("chain.auto_opinit = true"), "{probe}");
    let init = sim.json(&["init", "--profile", &sim.path("found.toml")], 0);
    assert_eq!(init["boards"][0]["flash_number"], 0x21);
}

/// If the user presses Ctrl-C while a board moves, the command stops the board at once. Without this stop, the board
/// would stop later, when its own supervision detects the loss of the PC.
#[test]
fn an_interrupted_motion_is_stopped() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let mut peer = sim.peer();
    let moving = sim.spawn(&["ci", "1", "set_position=1500", "--for", "60"]);
    peer.wait("601#01010000");
    peer.wait("381#");
    signal(&moving, "-INT");
    // The stop must come from the PC. The board itself would stop only after its timeout of 1.5 s.
    let since = std::time::Instant::now();
    peer.wait("601#00000000");
    assert!(since.elapsed() < std::time::Duration::from_millis(1000), "{:?}", since.elapsed());
    let output = ended(moving);
    assert_eq!(output.code, 0, "{}", output.err);
}

/// D-15, D-34: if this PC does not run the control loop, the command sends only the requested input and no other inputs.
#[test]
fn d34_an_input_leaves_its_neighbours_alone() {
    let sim = Sim::numbered(&["--boards", "1"]);
    sim.ucom(&["start", "1"]).ends(0);
    let mut peer = sim.peer();
    sim.ucom(&["ci", "1", "set_position=1500"]).ends(0);
    assert_eq!(peer.wait("341#"), "341#0000DC05");
}

/// D-36: two boards have the same image, Program ID and date. The command never uses the names of one board to move the other board.
#[test]
fn d36_one_image_on_boards_that_differ() {
    let sim = Sim::numbered(&[]);
    let image = sim.file("same.bin", &common::image(500, 3));
    sim.ucom(&["update", "1,7", &image, "--group"]).ends(0);
    sim.ucom(&["start", "1,7"]).ends(0);
    let io = |words: &[&str]| sim.ucom(words).ends(0).json()["boards"][0].clone();
    let first = io(&["--json", "io", "1"]);
    let other = io(&["--json", "io", "7"]);
    assert_ne!(first["ci"], other["ci"], "the simulator's boards differ");
    assert_eq!(other, io(&["--json", "io", "7", "--fresh"]));
    // The test copies the cached names of board 1 to the cache file of board 7, which has the same program and date.
    // The command must still read the names of board 7 from board 7.
    let kept = |board: &str| {
        let info = sim.json(&["info", board], 0)["boards"][0].clone();
        let end = format!("-{:04X}.json", info["flash_number"].as_u64().unwrap());
        let start = format!("io-{:04X}-", info["program_id"].as_u64().unwrap());
        let mut files = std::fs::read_dir(sim.path("cache")).unwrap().map(|f| f.unwrap().path());
        let fits = |name: &str| name.starts_with(&start) && name.ends_with(&end);
        files.find(|f| fits(f.file_name().unwrap().to_str().unwrap())).expect("it is kept")
    };
    std::fs::copy(kept("1"), kept("7")).unwrap();
    assert_eq!(other, io(&["--json", "io", "7"]), "a board that can be asked is asked");
    sim.ucom(&["stop", "7"]).ends(0);
    let name = other["ci"][0].as_str().unwrap().split(" [").next().unwrap().to_owned();
    sim.ucom(&["ci", "7", &format!("{name}=1"), "--for", "0.5"]).ends(0);
}

/// If one of several boards does not answer, the command ends before any change. If changes were completed before,
/// the command reports them.
#[test]
fn several_boards_are_changed_only_when_all_answer() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let mut peer = sim.peer();
    for words in [
        &["status", "1,31", "--set", "ASTART"][..],
        &["status", "1,31", "--raw", "40:40"],
        &["xreset", "1,31"],
        &["start", "1,31"],
    ] {
        sim.ucom(words).ends(3);
    }
    let received = peer.all(100);
    assert!(!received.iter().any(|f| ["041", "1C1", "301"].contains(&&f[..3])), "{received:?}");
    // The board has lost its number, so its status is unknown. The command `status` shows no status value.
    let output = sim.ucom(&["status", "1", "--clear", "INIT"]).ends(0);
    assert!(output.out.contains("lost its number") && !output.out.contains("0x"), "{}", output.out);
    sim.ucom(&["init"]).ends(0);
    let output = sim.json(&["status", "1", "--clear", "INIT"], 0);
    assert_eq!(output["boards"][0]["status"], json!(["EXLRUN", "IPINIT"]));
    // Board 2 still has its number, but its application is not started, so the hint suggests `ucom start 2`.
    let output = sim.json(&["io", "all"], 4);
    assert!(output["error"]["hint"].as_str().unwrap().contains("ucom start 2"), "{output}");
}

/// D-T21: two boards with the same flash number send identical reports at the same time, which are a single frame on
/// the bus. `init` detects that there are more boards than reports.
#[test]
fn d_t21_reports_that_are_alike_are_one_frame() {
    let sim = Sim::start(&["--boards", "2", "--flash-ids", "0x21,0x21"]);
    let mut peer = sim.peer();
    // The test waits 0.6 s, because the boards must first boot.
    peer.all(600);
    peer.send("240#");
    let reports: Vec<String> = peer.all(600).into_iter().filter(|f| f.starts_with("441#")).collect();
    assert_eq!(reports, ["441#21"]);
    let output = sim.ucom(&["init"]);
    assert_ne!(output.code, 0);
    assert!(output.out.contains("more boards than reports"), "{}", output.out);
}

/// The command `send` sends single frames unchanged. Frames that change boards need the confirmation `--intrusive`. Either all frames of
/// the command line are sent, or none of them.
#[test]
fn single_frames_can_be_sent() {
    let sim = Sim::numbered(&["--boards", "1"]);
    let mut peer = sim.peer();
    let sent = sim.json(&["send", "201#", "12345678#11"], 0);
    assert_eq!(sent["sent"], json!(["201#", "12345678#11"]));
    peer.wait("201#");
    peer.wait("12345678#11");
    peer.all(300);
    let refused = sim.json(&["send", "201#", "000#"], 4);
    assert_eq!(refused["error"]["code"], "intrusive");
    assert!(peer.all(100).iter().all(|f| f != "000#" && f != "201#"));
    sim.ucom(&["send", "000#", "--intrusive"]).ends(0);
    peer.wait("000#");
    sim.ucom(&["send", "xyz"]).ends(2);
}

/// If the user specifies the same name twice, the command reports an error, because the value is ambiguous.
#[test]
fn a_name_given_twice_is_refused() {
    let sim = Sim::numbered(&["--boards", "1"]);
    sim.ucom(&["start", "1"]).ends(0);
    let mut peer = sim.peer();
    for words in [["par", "1", "kp=5", "KP=6"], ["ci", "1", "set_position=5", "0=6"]] {
        let output = sim.ucom(&words).ends(2);
        assert!(output.err.contains("has two values"), "{words:?}: {}", output.err);
    }
    assert!(peer.all(100).iter().all(|f| !f.starts_with("3C1#") && !f.starts_with("341#")));
}

/// Boards without a number show only the format of their reports. The command `probe` reports that it could not
/// measure anything else.
#[test]
fn a_probe_of_boards_without_numbers_reports_how_little_it_is() {
    let sim = Sim::start(&["--boards", "2"]);
    let file = sim.path("found.toml");
    let output = sim.ucom(&["probe", "--out", &file]).ends(0);
    assert!(
        output.err.contains("only reports were measured") && output.err.contains("--init"),
        "{}",
        output.err
    );
    assert!(std::fs::metadata(file).is_ok());
}

/// A description that a board sends may contain escape sequences of a terminal. The commands print them as codes.
#[test]
fn escape_sequences_of_a_board_are_printed_as_codes() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("chain.toml");
    let text = "[[board]]\nflash_id = 0x21\ndescription = \"X\\u001B[31mR\\u001B]0;t\\u0007Z\"\n";
    std::fs::write(&file, text).unwrap();
    let sim = Sim::start(&["--chain", file.to_str().unwrap()]);
    for words in
        [&["init"][..], &["info", "1"], &["monitor", "--count", "1"], &["--json", "info", "1"], &["doctor"]]
    {
        let output = sim.ucom(words).ends(0);
        let hidden = |c: char| host_kit::is_hidden(c) && c != '\n';
        assert!(
            !output.out.contains(hidden) && !output.err.contains(hidden),
            "{words:?}: {}{}",
            output.out,
            output.err
        );
    }
    let info = sim.ucom(&["info", "1"]).ends(0);
    assert!(info.out.contains(r"X\u001b[31mR\u001b]0;t\u0007Z"), "{}", info.out);
    assert_eq!(sim.json(&["info", "1"], 0)["boards"][0]["description"], "X\u{1b}[31mR\u{1b}]0;t\u{7}Z");
}
