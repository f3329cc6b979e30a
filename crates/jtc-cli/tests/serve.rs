//! Tests of `jtc serve`, and of all other commands through this agent.
#![cfg(unix)]

use crate::common;

use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};

use cli_kit::testing::{Terminal, run, signal};
use common::Sim;
use common::agent::{self, Agent, command_in};
use serde_json::Value;

#[test]
fn every_command_works_through_an_agent() {
    let agent = Agent::start(&["--sim", "--baud", "921600"]);
    agent.jtc(&["recover", "--defaults"]).ends(0);
    let info = agent.jtc(&["--json", "info"]).ends(0).json();
    assert_eq!(info["arm"], "avena");
    agent.jtc(&["doctor"]).ends(0);
    let report = agent.jtc(&["--json", "traj", "run", &agent.motion(20)]).ends(0).json();
    assert_eq!(report["outcome"], "finished", "{report}");
    agent.jtc(&["gripper", "on"]).ends(0);
    let status = agent.jtc(&["--json", "status"]).ends(0).json();
    assert_eq!(status["state"], "HoldPos");
    assert_eq!(agent.end("-TERM").0, Some(0));
}

#[test]
fn another_terminal_looks_and_stops_while_one_runs() {
    let agent = Agent::start(&["--sim", "--baud", "921600"]);
    agent.jtc(&["recover", "--defaults"]).ends(0);
    let mut runs = agent
        .command(&["--json", "traj", "run", &agent.motion(300)], &agent.url)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("it starts");
    let state = || agent.jtc(&["--json", "status"]).ends(0).json()["trajectory"].clone();
    while state() != "Execute" {
        assert!(runs.try_wait().expect("a child").is_none(), "it ended before it ran");
    }
    let denied = agent.jtc(&["gripper", "on"]).ends(4);
    assert!(denied.err.contains("has held the lease of this arm"), "{}", denied.err);
    agent.jtc(&["traj", "stop"]).ends(0);
    let ended = runs.wait_with_output().expect("it ends");
    let report: Value = serde_json::from_slice(&ended.stdout).expect("an object");
    assert_eq!(report["outcome"], "stopped", "{report}");
}

/// On the computer of the agent, a Stop and a Pause do not need a token.
#[test]
fn no_token_file_keeps_a_stop_away() {
    let agent = Agent::start(&["--sim", "--baud", "921600"]);
    agent.jtc(&["recover", "--defaults"]).ends(0);
    let token = |name: &str, text: &str| {
        let path = agent.dir.path().join(name);
        std::fs::write(&path, text).expect("a file");
        Command::new("chmod").arg("600").arg(&path).status().expect("chmod");
        path.to_str().expect("a name").to_owned()
    };
    let other = format!("operator = \"{}\"\nviewer = \"{}\"\n", "o".repeat(32), "v".repeat(32));
    for file in [token("other.toml", &other), token("bad.toml", "operator = 1"), "/does/not/exist".into()] {
        let refused = agent.jtc(&["gripper", "off", "--token-file", &file]);
        assert_ne!(refused.code, 0, "{}", refused.out);
        for words in [&["stop"][..], &["traj", "stop"]] {
            let stopped = agent.jtc(&[words, &["--token-file", &file]].concat()).ends(0);
            assert!(stopped.out.contains("nothing was moving"), "{}", stopped.out);
        }
        let paused = agent.jtc(&["traj", "pause", "--token-file", &file]).ends(1);
        assert!(paused.err.contains("trajectory"), "{}", paused.err);
    }
}

#[test]
fn a_command_finds_the_agent_that_owns_its_port_and_does_without_one_that_is_gone() {
    let sim = Sim::start(&["--baud", "921600"]);
    let port = sim.port.to_str().expect("a name").to_owned();
    let agent = Agent::start(&["--port", &port, "--baud", "921600"]);
    for _ in 0..3 {
        run(agent.command(&["status", "--baud", "921600"], &port), &[], "").ends(0);
    }
    let log = run(agent.command(&["recover", "--defaults", "--baud", "921600"], &port), &[], "").ends(0);
    assert!(log.out.contains("HoldPos"), "{}", log.out);
    let second = run(agent.command(&["serve", "--listen", "127.0.0.1:0"], &port), &[], "").ends(3);
    assert!(second.err.contains(&agent.url), "{}", second.err);
    // The agent is killed, and its registration file still exists, although no program listens at its address. The
    // next command must then use the port directly.
    Command::new("kill").args(["-KILL", &agent.child.id().to_string()]).status().expect("kill");
    std::thread::sleep(std::time::Duration::from_millis(200));
    run(agent.command(&["status", "--baud", "921600"], &port), &[], "").ends(0);
}

/// The agent prints the token only on a terminal, because other users may read the journal of the system or a log
/// file.
#[test]
fn the_operators_token_is_printed_on_a_terminal_alone() {
    let dir = tempfile::tempdir().expect("a directory");
    let tokens = dir.path().join("own-tokens.toml");
    let words = [
        "serve",
        "--sim",
        "--listen",
        "127.0.0.1:0",
        "--link",
        "--token-file",
        tokens.to_str().expect("a name"),
    ];
    // The first start creates the token, and the second start uses it again. In both starts, the option `--link`
    // requests the link. The output is not a terminal, so the agent must not print the token.
    for begun in 0..2 {
        let mut command = command_in(&dir);
        let mut child =
            command.args(words).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("stdout")).read_line(&mut line).expect("a line");
        assert!(line.starts_with("ready: "), "{line}");
        signal(&child, "-INT");
        let ended = child.wait_with_output().expect("it ends");
        let (err, file) =
            (String::from_utf8_lossy(&ended.stderr), std::fs::read_to_string(&tokens).expect("tokens"));
        let secrets: Vec<&str> =
            file.split('"').filter(|part| part.len() >= 20 && !part.contains('\n')).collect();
        assert!(secrets.len() == 2 && secrets.iter().all(|token| !err.contains(token)), "{begun}: {err}");
        assert!(err.contains("`cat ") && !err.contains("#token="), "{begun}: {err}");
    }
    let mut command = command_in(&dir);
    command.args(words);
    let mut terminal = Terminal::new(200, 30);
    let mut child = terminal.start(&command);
    terminal.until_it_shows("ready: ");
    assert!(terminal.picture.text().contains("/#token="), "{}", terminal.picture.text());
    terminal.press("\u{3}");
    assert_eq!(terminal.ends(&mut child), 0);
}

#[test]
fn an_agent_without_a_port_and_with_wrong_words_says_what_to_do() {
    let dir = tempfile::tempdir().expect("a directory");
    let jtc = |words: &[&str]| run(command_in(&dir), words, "");
    let none = jtc(&["serve", "--port", "/dev/does-not-exist", "--listen", "127.0.0.1:0"]).ends(3);
    assert!(none.err.contains("port does not exist"), "{}", none.err);
    jtc(&["serve", "--sim", "--port", "/dev/null"]).ends(2);
    jtc(&["serve", "--port", "http://127.0.0.1:1", "--listen", "127.0.0.1:0"]).ends(2);
    let gone = jtc(&["status", "--port", "http://127.0.0.1:1"]).ends(3);
    assert!(gone.err.contains("jtc serve"), "{}", gone.err);
    let tokens = dir.path().join("tokens.toml");
    std::fs::write(&tokens, "operator = \"short\"\nviewer = \"short\"\n").expect("a file");
    let open =
        jtc(&["serve", "--sim", "--listen", "127.0.0.1:0", "--token-file", tokens.to_str().expect("a name")])
            .ends(2);
    assert!(open.err.contains("chmod 600"), "{}", open.err);
}

/// Writes two arm files. The first arm has another name, and the second arm contains gains that a frame cannot
/// transmit.
fn arm_files(dir: &tempfile::TempDir) -> [String; 2] {
    let avena = include_str!("../../../arms/avena.toml");
    let file = |name: &str, text: String| {
        let path = dir.path().join(name);
        std::fs::write(&path, text).expect("a file");
        path.to_str().expect("a name").to_owned()
    };
    [
        file("good.toml", avena.replacen("name = \"avena\"", "name = \"other\"", 1)),
        file("bad.toml", avena.replacen("kp = 8000.0", "kp = 1e39", 1)),
    ]
}

/// With `--arm`, `jtc serve --sim` and `jtc sim` simulate the specified arm, and the controller has stored it. Both
/// commands reject an arm that a controller cannot store.
#[test]
fn an_arm_is_simulated_as_by_jtc_sim() {
    let dir = tempfile::tempdir().expect("a directory");
    let [good, bad] = arm_files(&dir);
    let agent = Agent::start(&["--sim", "--baud", "921600", "--arm", &good]);
    assert_eq!(agent.jtc(&["--json", "info"]).ends(0).json()["arm"], "other");
    assert_eq!(agent.jtc(&["--json", "arm", "diff", &good]).ends(0).json()["equal"], true);
    let sim = Sim::start(&["--baud", "921600", "--arm", &good]);
    assert_eq!(sim.json(&["info", "--baud", "921600"], 0)["arm"], "other");
    for simulator in [&["serve", "--sim", "--listen", "127.0.0.1:0"][..], &["sim"]] {
        let words = [simulator, &["--arm", &bad]].concat();
        let refused = run(command_in(&dir), &words, "").ends(2);
        assert!(
            refused.err.contains("bad.toml") && refused.err.contains("not a number that a frame can carry"),
            "{words:?}: {}",
            refused.err
        );
    }
}

/// Modbus has no tokens. The Modbus server is off by default, and rejects other computers unless the user allows their
/// addresses.
#[test]
fn modbus_is_there_for_those_who_are_named() {
    let dir = tempfile::tempdir().expect("a directory");
    let serve = |words: &[&str]| {
        let mut serve = command_in(&dir);
        serve.args(["serve", "--sim", "--listen", "127.0.0.1:0"]).args(words);
        run(serve, &[], "")
    };
    let refused = serve(&["--modbus", "0.0.0.0:0"]).ends(2);
    assert!(refused.err.contains("--modbus-allow"), "{}", refused.err);
    let refused = serve(&["--modbus", "127.0.0.1:0", "--modbus-allow", "10.0.0.0/33"]).ends(2);
    assert!(refused.err.contains("10.0.0.0/33"), "{}", refused.err);
    serve(&["--modbus-allow", "10.0.0.0/24"]).ends(2);
    let ready = |words: &[&str]| {
        let (mut child, ready) = agent::serve(&dir, &[&["--sim"], words].concat());
        let connects = ready["modbus"].as_str().map(|at| std::net::TcpStream::connect(at).is_ok());
        child.kill().ok();
        child.wait().ok();
        connects
    };
    assert_eq!(ready(&[]), None);
    assert_eq!(ready(&["--modbus", "127.0.0.1:0"]), Some(true));
}
