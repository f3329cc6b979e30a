//! Tests of `ucom serve`: an agent for a bus or for a simulated chain.
#![cfg(unix)]

use crate::common;

use std::io::{BufRead, BufReader, Read as _};
use std::path::Path;
use std::process::{Child, Stdio};

use cli_kit::testing::{Terminal, program, signal};
use common::Sim;
use serde_json::Value;
use test_kit::http::Http;

/// Starts an agent with the arguments `words`. Returns the process and its first output line, which it prints when it
/// is ready.
fn serve(dir: &Path, words: &[&str]) -> (Child, Value) {
    let mut command = program(env!("CARGO_BIN_EXE_ucom"), "UCOM_");
    command.args(["--json", "serve", "--listen", "127.0.0.1:0"]).args(words);
    command.env("XDG_STATE_HOME", dir.join("state")).env("XDG_CACHE_HOME", dir.join("cache"));
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .current_dir(dir)
        .spawn()
        .expect("ucom serve starts");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("stdout")).read_line(&mut line).expect("a line");
    let ready = serde_json::from_str(&line).unwrap_or_else(|_| panic!("ucom serve prints {line:?}"));
    (child, ready)
}

/// Returns a client that has permission to read the token file.
fn http(ready: &Value) -> Http {
    let url = ready["url"].as_str().expect("its address");
    let tokens = std::fs::read_to_string(ready["token_file"].as_str().expect("its file")).expect("tokens");
    let operator =
        tokens.split_once("operator = \"").and_then(|(_, rest)| rest.split_once('"')).expect("a token").0;
    let address = url.strip_prefix("http://").expect("an address").parse().expect("an address");
    Http { address, operator: operator.to_owned() }
}

fn over(mut child: Child) -> (Option<i32>, String) {
    let mut err = String::new();
    child.stderr.take().expect("stderr").read_to_string(&mut err).expect("text");
    (child.wait().expect("it ends").code(), err)
}

#[test]
fn an_agent_of_a_simulated_chain_is_marked_as_such_and_ends_with_a_signal() {
    let dir = tempfile::tempdir().expect("a directory");
    let (child, ready) = serve(dir.path(), &["--sim", "--boards", "2"]);
    assert_eq!(ready["simulated"], true, "{ready}");
    let (status, body) = http(&ready).api("GET /api/status", None, None);
    assert_eq!(
        (status, body["simulated"].as_bool(), body["role"].as_str()),
        (200, Some(true), Some("operator"))
    );
    signal(&child, "-TERM");
    let (code, err) = over(child);
    assert_eq!(code, Some(0), "{err}");
    assert!(err.contains("new operator's token in") && err.contains("`cat "), "{err}");
    assert!(!err.contains(&http(&ready).operator) && !err.contains("#token="), "{err}");
    // The agent uses the same tokens after it is started again.
    let (child, again) = serve(dir.path(), &["--sim"]);
    assert_eq!(http(&again).operator, http(&ready).operator);
    signal(&child, "-INT");
    let (code, err) = over(child);
    assert_eq!((code, err.contains("token")), (Some(0), false), "{err}");
    // The option `--link` requests the dashboard link. The agent still does not print the link, because a program
    // reads its output and may store the link.
    let (child, again) = serve(dir.path(), &["--sim", "--link"]);
    signal(&child, "-INT");
    let (code, err) = over(child);
    assert!(code == Some(0) && err.contains("`cat "), "{err}");
    assert!(!err.contains(&http(&again).operator) && !err.contains("#token="), "{err}");
}

#[test]
fn the_link_with_the_token_is_printed_on_a_terminal() {
    let dir = tempfile::tempdir().expect("a directory");
    let mut command = program(env!("CARGO_BIN_EXE_ucom"), "UCOM_");
    command.args(["serve", "--sim", "--listen", "127.0.0.1:0", "--token-file", "tokens.toml"]);
    command.env("XDG_STATE_HOME", dir.path()).env("XDG_CACHE_HOME", dir.path()).current_dir(dir.path());
    let mut terminal = Terminal::new(200, 30);
    let mut child = terminal.start(&command);
    terminal.until_it_shows("ready: ");
    let text = terminal.picture.text();
    assert!(text.contains("new operator's token in") && text.contains("/#token="), "{text}");
    terminal.press("\u{3}");
    assert_eq!(terminal.ends(&mut child), 0);
}

/// At its end, the agent stops the boards that it has started. If the bus is lost, the agent ends.
#[test]
fn what_an_agent_has_started_is_stopped_with_it() {
    let sim = Sim::numbered(&["--boards", "2"]);
    let dir = tempfile::tempdir().expect("a directory");
    let log = dir.path().join("commands.jsonl");
    let words = ["--bus", &sim.url, "--command-log", log.to_str().expect("a path")];
    let (child, ready) = serve(dir.path(), &words);
    assert_eq!((ready["simulated"].as_bool(), ready["bus"].as_str()), (Some(false), Some(sim.url.as_str())));
    let agent = http(&ready);
    let (_, grant) = agent.api("POST /api/lease", None, Some(serde_json::json!({ "name": "anna" })));
    let key = grant["key"].as_str().expect("a key");
    let (status, started) = agent.api("POST /api/boards/1/start", Some(key), None);
    assert_eq!((status, started["state"].as_str()), (200, Some("started")), "{started}");
    signal(&child, "-TERM");
    assert_eq!(over(child).0, Some(0));
    assert_eq!(sim.json(&["status", "1"], 0)["boards"][0]["state"], "exloader");
    let logged = std::fs::read_to_string(&log).expect("the log");
    assert!(logged.contains("\"command\":\"start\"") && logged.contains("\"joined\""), "{logged}");
    let (child, _) = serve(dir.path(), &words);
    drop(sim);
    let (code, err) = over(child);
    assert_eq!(code, Some(3), "{err}");
}

#[test]
fn what_does_not_go_together_is_refused_before_anything_is_opened() {
    for (words, part) in [
        (&["--sim", "--bus", "socketcand:127.0.0.1:1/can0"][..], "cannot be used together"),
        (&["--bus", "x", "--boards", "2"], "--boards needs --sim"),
        (&[], "no bus is selected"),
    ] {
        let refused = common::ucom(&[&["serve", "--listen", "127.0.0.1:0"], words].concat()).ends(2);
        assert!(refused.err.contains(part), "{words:?}: {}", refused.err);
    }
}
