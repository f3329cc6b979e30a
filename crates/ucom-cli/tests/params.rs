//! Tests of parameter files and signal tables with `ucom sim`.
#![cfg(unix)]

use crate::common;

use common::Sim;
use serde_json::json;

const TABLE: &str = "[program.ci]\nset_position = { scale = 0.01, unit = \"deg\", min = -60, max = 60 }\n\
                     [program.so]\nposition = { scale = 0.01, unit = \"deg\" }\nnobody = {}\n\
                     [program.par]\nkd = { scale = 0.1, unit = \"mA s/deg\" }\nmin_position = { scale = 0.5 }\n";

/// Returns a chain of numbered boards with a signal table for the first board; all applications are started.
fn started() -> (Sim, String) {
    let sim = Sim::numbered(&["--boards", "2"]);
    sim.ucom(&["start", "all"]).ends(0);
    let info = sim.json(&["info", "1"], 0);
    let table = format!("[[program]]\nprogram_id = {}\n{TABLE}", info["boards"][0]["program_id"]);
    let table = sim.file("edges.toml", table.as_bytes());
    (sim, table)
}

/// D-11: values are read and shown in the units of the signal table; a raw word is always a valid value.
#[test]
fn d11_values_have_the_units_of_the_signal_table() {
    let (sim, table) = started();
    let mut peer = sim.peer();
    let ucom = |words: &[&str]| sim.ucom(&[&["--json", "--edges", &table], words].concat());
    let output = ucom(&["ci", "1", "set_position=-15.5deg"]).ends(0).json();
    assert_eq!(output["set"][0]["value"], json!(-15.5));
    assert!(peer.wait("341#").starts_with("341#0000F2F9"), "-1550");
    let refused = ucom(&["ci", "1", "set_position=61deg"]).ends(4).json();
    assert_eq!(
        refused["error"]["message"],
        "board 1: CI `set_position`: 61 deg is outside -60.00..60.00 deg"
    );
    // Without a unit, the number 61 is refused: it could mean 61 degrees, or the raw word 61, which is 0.61 degrees.
    let bare = ucom(&["ci", "1", "set_position=61"]).ends(4).json();
    let message = bare["error"]["message"].as_str().unwrap();
    assert!(message.contains("the word 61 is `0x003D` (0.61 deg)"), "{bare}");
    assert!(message.contains("61 deg is outside -60.00..60.00 deg"), "{bare}");
    let io = ucom(&["io", "1"]).ends(0);
    assert!(io.err.contains("has no SO `nobody`"), "{}", io.err);
    let io = io.json();
    assert_eq!(io["boards"][0]["edges"]["ci"][0]["unit"], "deg");
    assert_eq!(io["boards"][0]["edges"]["ci"][1], json!(null));
    assert_eq!(io["boards"][0]["initial_ci"], json!([0.0, 1000, 900]));
    let so = ucom(&["ci", "1", "set_position=10deg", "--for", "1"]).ends(0).json();
    let position = so["so"]["position"].as_f64().unwrap();
    assert!((9.0..11.0).contains(&position), "{position} deg");
    ucom(&["par", "1", "kd=0x0102", "kp=3"]).ends(0);
    assert_eq!(peer.wait("3C1#"), "3C1#01000201");
    let rounded = ucom(&["par", "1", "kd=0.04mA s/deg"]).ends(0);
    assert!(rounded.err.contains("0.04 mA s/deg → 0.0 mA s/deg"), "{}", rounded.err);
    for words in [["par", "1", "kd=2mA s/deg"], ["ci", "1", "set_position=1deg"]] {
        assert!(ucom(&words).ends(0).err.contains("has no SO `nobody`"), "{words:?}");
    }
    // The table contains a scale but no unit for `min_position`. The command refuses a bare number, because its
    // meaning would depend on the table: with the table it would be a scaled value, without the table a raw word.
    let output = ucom(&["par", "1", "min_position=2"]).ends(4).json();
    assert!(output["error"]["message"].as_str().unwrap().contains("but no unit for this signal"), "{output}");
    ucom(&["par", "1", "min_position=0x0004"]).ends(0);
    // The command refuses a number that would wrap around, like any other invalid value.
    assert!(sim.ucom(&["ci", "1", "set_position=40000"]).ends(4).err.contains("outside -32768..32767"));
    let dbc = sim.ucom(&["--edges", &table, "dbc", "1"]).ends(0);
    assert!(dbc.err.contains("has no SO `nobody`"), "{}", dbc.err);
    let dbc = dbc.out;
    assert!(dbc.contains("set_position m0 : 16|16@1- (0.01,0) [-60|60] \"deg\""), "{dbc}");
    // If a signal table is invalid, the error contains the position in the file.
    let wrong = sim.file("wrong.toml", b"[[program]]\nprogram_id = 1\npar.kp = { scales = 1 }\n");
    assert!(sim.ucom(&["--edges", &wrong, "io", "1"]).ends(2).err.contains("line 3"));
}

/// D-11: if a signal table exists, values need units. If the program of the board is not in the signal table, the
/// command accepts only raw words.
#[test]
fn d11_a_table_without_the_program_refuses_bare_numbers() {
    let (sim, _) = started();
    let table = sim.file("other.toml", b"[[program]]\nprogram_id = 1\npar.kp = { scale = 0.1 }\n");
    let ucom = |words: &[&str]| sim.ucom(&[&["--edges", &table], words].concat());
    let mut peer = sim.peer();
    for words in
        [["ci", "1", "set_position=15"], ["par", "1", "kp=12"], ["run", "1", "--ci=1.set_position=15"]]
    {
        let output = ucom(&words).ends(4).err;
        assert!(
            output.contains("the table does not contain program 0x") && output.contains("0x0000"),
            "{output}"
        );
    }
    let file = "boards:\n  - board: 1\n    flash_number: 0x21\n    program_id: any\n    par:\n      kp: 12\n";
    let output = ucom(&["par", "--apply", &sim.file("bare.yaml", file.as_bytes())]).ends(4).err;
    assert!(output.contains("line 6"), "{output}");
    assert!(!peer.all(100).iter().any(|f| f.starts_with("341#") || f.starts_with("3C1#")));
    ucom(&["par", "1", "kp=0x000C"]).ends(0);
    assert_eq!(peer.wait("3C1#"), "3C1#00000C00");
}

/// The command overwrites an existing file only if the user requests it.
#[test]
fn files_are_not_written_over() {
    let (sim, _) = started();
    let file = sim.file("mine", b"mine");
    let mut peer = sim.peer();
    for words in [&["par", "1", "kp=3", "--save", &file][..], &["io", "1", "--template", &file]] {
        assert!(sim.ucom(words).ends(4).err.contains("already exists"), "{words:?}");
        assert_eq!(std::fs::read(&file).unwrap(), b"mine");
        assert!(!peer.all(50).iter().any(|f| f.starts_with("3C1#")));
        sim.ucom(&[words, &["--overwrite"]].concat()).ends(0);
        peer.all(100);
        assert_ne!(std::fs::read(&file).unwrap(), b"mine");
        sim.file("mine", b"mine");
    }
}

/// If the output file cannot be written, the command detects this before it sends any frame. If the command has no
/// result, it removes the file that it has created.
#[test]
fn outputs_are_opened_before_anything_is_sent() {
    let (sim, _) = started();
    let mut peer = sim.peer();
    let nowhere = sim.path("no/where");
    for words in [
        &["par", "1", "kp=3mA/deg", "--save", &nowhere][..],
        &["io", "1", "--template", &nowhere],
        &["dbc", "all", "--out", &nowhere],
        &["probe", "--init", "--force", "--out", &nowhere],
        &["record", &nowhere],
        &["init", "--force", "--inventory", &nowhere],
    ] {
        let output = sim.ucom(words).ends(2);
        assert!(output.err.contains("nothing was sent"), "{words:?}: {}", output.err);
    }
    // The started boards send a heartbeat every second (D-50). No other frame is on the bus, because no command
    // in this test has sent a frame.
    let sent: Vec<_> =
        peer.all(100).into_iter().filter(|frame| !["681#", "682#"].contains(&frame.as_str())).collect();
    assert_eq!(sent, [""; 0]);
    // Board 9 does not exist, so the command removes the file that it has opened for the result.
    let file = sim.path("new");
    sim.ucom(&["par", "9", "--save", &file]).ends(3);
    sim.ucom(&["dbc", "9", "--out", &file]).ends(3);
    assert!(!std::path::Path::new(&file).exists());
}

/// D-35: a board does not answer parameter frames, so the command then checks that the application still answers. If the
/// application does not answer, the value is unknown.
#[test]
fn d35_a_board_that_stops_answering_while_it_is_written_to_is_a_fault() {
    let (mut sim, _) = started();
    sim.fault("crash board=2 on_id=0x3C2 on_count=1");
    let output = sim.json(&["par", "all", "kp=3"], 5);
    let message = output["error"]["message"].as_str().unwrap_or_default();
    assert!(message.contains("board 2") && message.contains("unknown"), "{output}");
    assert!(message.contains("already written: board 1"), "{output}");
}

/// D-35: the command stores the values that it has written, but never shows them later as current values.
#[test]
fn d35_a_parameter_is_assumed_once_and_then_only_remembered() {
    let (sim, _) = started();
    let first = |output: cli_kit::testing::CommandOutput| output.ends(0).json()["par"][0].clone();
    let wrote = first(sim.ucom(&["--json", "par", "1", "kp=120"]));
    assert_eq!((&wrote["assumed"], &wrote["last_written"]["value"]), (&json!(120), &json!(120)));
    let later = first(sim.ucom(&["--json", "par", "1"]));
    assert_eq!((&later["assumed"], &later["last_written"]["value"]), (&json!(null), &json!(120)));
    let text = sim.ucom(&["par", "1", "--save", "-"]).ends(0).out;
    assert!(text.contains("\n      kp: 0x0078   # 120;") && text.contains("\n      # kd:"), "{text}");
}

/// The command checks the complete file before it writes any parameter; every error contains its line.
#[test]
fn a_file_is_applied_whole_or_not_at_all() {
    let (sim, _) = started();
    sim.ucom(&["par", "all", "kp=120"]).ends(0);
    let file = sim.path("head.yaml");
    sim.ucom(&["par", "all", "--save", &file]).ends(0);
    let good = std::fs::read_to_string(&file).unwrap();
    let mut peer = sim.peer();
    let checked = sim.json(&["par", "--apply", &file, "--dry-run"], 0);
    assert_eq!(checked["written"], false);
    let apply = |text: &str| sim.ucom(&["par", "--apply", &sim.file("bad.yaml", text.as_bytes())]);
    // The error is in the part for the second board, but the first board receives no parameters either.
    let end = good.rfind("kp: 0x0078").unwrap();
    let of_second = |with: &str| format!("{}{with}{}", &good[..end], &good[end + 10..]);
    let output = apply(&of_second("kq: 1")).ends(4);
    assert!(
        output.err.contains("bad.yaml: line 21") && output.err.contains("similar: `kp [mA/deg]`"),
        "{}",
        output.err
    );
    assert!(apply(&of_second("kp: 70000")).ends(4).err.contains("70000 is outside"));
    assert!(
        apply(&good.replace("0x0022", "0x0055"))
            .ends(4)
            .err
            .contains("flash number is 0x0022, but the file is for 0x0055")
    );
    let program = good.find("program_id: 0x").unwrap() + 14;
    let other = format!("{}0001{}", &good[..program], &good[program + 4..]);
    assert!(apply(&other).ends(4).err.contains("belong to 0x0001"));
    assert!(
        apply(&good.replace("board: 2", "board: 7"))
            .ends(4)
            .err
            .contains("board 7: the board does not answer")
    );
    assert!(apply(&of_second("kp: [1")).ends(2).err.contains("line"));
    assert!(apply(&of_second("kp: x")).ends(2).err.contains("board 2, `kp`"));
    // Without quotation marks, YAML reads the line that begins with `#0` (selection of a signal by its number) as a
    // comment. The file then contains no value.
    let empty = "boards:\n  - board: 1\n    flash_number: 0x21\n    program_id: any\n    par:\n      #0: 5\n";
    assert!(apply(empty).ends(2).err.contains("the file contains no value"));
    sim.ucom(&["par", "3", "--apply", &file]).ends(2);
    sim.ucom(&["par", "1", "kp=1", "--apply", &file]).ends(2);
    sim.ucom(&["par", "1", "--dry-run"]).ends(2);
    let received = peer.all(100);
    assert!(!received.iter().any(|f| f.starts_with("3C")), "{received:?}");
    let output = sim.json(&["par", "--apply", &file], 0);
    assert_eq!((&output["written"], &output["boards"][1]["par"][0]["word"]), (&json!(true), &json!(120)));
    let received = peer.all(100);
    let written: Vec<&String> = received.iter().filter(|f| f.starts_with("3C")).collect();
    assert_eq!(written, ["3C1#00007800", "3C2#00007800"]);
}

/// Section 7: the board first receives its initial inputs, then the inputs and parameters of the file. The control loop
/// starts only after the board has received all inputs and parameters. Values on the command line replace values of the
/// file.
#[test]
fn a_run_takes_parameters_and_first_inputs_from_a_file() {
    let (sim, _) = started();
    // This command reads the signal names of the board into the cache.
    sim.ucom(&["io", "1"]).ends(0);
    sim.ucom(&["stop", "all"]).ends(0);
    let file = |value: &str| {
        let text = format!(
            "boards:\n  - board: 1\n    flash_number: 0x21\n    program_id: any\n    par:\n      kp: 121\n      kd: 5\n    ci:\n      set_position: {value}\n"
        );
        sim.file("run.yaml", text.as_bytes())
    };
    let mut peer = sim.peer();
    let output = sim.ucom(&["--json", "run", "1", "--params", &file("70000"), "--for", "1"]).ends(4);
    assert_eq!(output.json()["error"]["code"], "params");
    let received = peer.all(100);
    assert!(!received.iter().any(|f| ["301", "341", "3C1", "541"].contains(&&f[..3])), "{received:?}");
    // With `--fresh`, the signal names are unknown. The command starts the application to read them, refuses the
    // invalid value in the file, and stops the application again.
    let words = ["--json", "run", "1", "--fresh", "--params", &file("70000"), "--for", "1"];
    assert_eq!(sim.ucom(&words).ends(4).json()["error"]["code"], "params");
    assert!(!peer.all(100).iter().any(|f| ["341", "3C1", "541"].contains(&&f[..3])));
    assert_eq!(sim.json(&["status", "1"], 0)["boards"][0]["status_byte"], 0x1B);
    peer.all(100);
    sim.ucom(&["run", "1", "--params", &file("1500"), "--par", "1.kd=6", "--for", "1"]).ends(0);
    let received = peer.all(100);
    let at = |start: &str| {
        let found = received.iter().position(|f| f.starts_with(start));
        found.unwrap_or_else(|| panic!("no {start} in {received:?}"))
    };
    assert!(at("341#0000DC05") < at("3C1#00007900") && at("3C1#01000600") < at("541#"), "{received:?}");
    assert!(!received.iter().any(|f| f.starts_with("3C1#01000500")), "{received:?}");
}

#[test]
fn pages_and_templates() {
    let (sim, _) = started();
    assert!(sim.ucom(&["help", "params"]).ends(0).out.contains("flash_number"));
    assert!(sim.ucom(&["help", "edges"]).ends(0).out.contains("program_id"));
    let table = sim.path("template.toml");
    sim.ucom(&["io", "all", "--template", &table]).ends(0);
    let io = sim.json(&["--edges", &table, "io", "2"], 0);
    assert_eq!(io["boards"][0]["edges"]["so"][0]["scale"], 0.01);
}

/// If a board in the parameter file does not answer, the command refuses to run all boards.
#[test]
fn a_run_of_all_boards_misses_those_of_the_file() {
    let (sim, _) = started();
    let board = |n: u8| {
        format!("  - board: {n}\n    flash_number: 0x21\n    program_id: any\n    par:\n      kp: 7\n")
    };
    let file = sim.file("absent.yaml", format!("boards:\n{}{}", board(1), board(31)).as_bytes());
    let mut peer = sim.peer();
    let output = sim.json(&["run", "all", "--params", &file, "--for", "0.2"], 4);
    assert!(output["error"]["message"].as_str().unwrap().contains("31"), "{output}");
    assert!(!peer.all(100).iter().any(|f| ["341", "3C1", "541"].contains(&&f[..3])));
    // If the command line lists boards, the other boards of the file do not need to answer.
    sim.ucom(&["run", "1", "--params", &file, "--for", "0.2"]).ends(0);
}
