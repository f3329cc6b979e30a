//! Each front end of `jtc` shows a held stop (J-69) with joint, value, limit, age and next step.
#![cfg(target_os = "linux")]

use std::io::{BufRead as _, BufReader};
use std::net::SocketAddr;
use std::process::Stdio;
use std::time::Duration;

use cli_kit::testing::run;
use serde_json::Value;
use test_kit::http::Http;
use test_kit::patience::Patience;

use crate::common::agent::{command_in, serve};
use crate::common::{Sim, jtc};

/// Time from enabling the drives until every joint has settled.
const SETTLES: Duration = Duration::from_secs(8);

/// External torque above which the controller reports a push, N·m. The value is 30 % of the 40 N·m of joint 5.
const LIMIT: f64 = 12.0;

fn until(what: &str, mut ask: impl FnMut() -> Option<Value>) -> Value {
    let mut patience = Patience::begin();
    loop {
        if let Some(value) = ask() {
            return value;
        }
        patience.pause(what);
    }
}

/// Pushes joint 5 with a torque above its friction until `ask` returns a held stop. The joints must have settled after they were enabled.
fn pushed(sim: &mut Sim, mut ask: impl FnMut() -> Option<Value>) -> Value {
    std::thread::sleep(SETTLES);
    let mut looks = 0;
    until("a held stop", || {
        if looks % 20 == 0 {
            sim.write_line("push 5 38 0.5");
        }
        looks += 1;
        ask()
    })
}

/// Checks kind, joint, value and limit of a held stop that a push against joint 5 has caused.
fn is_a_push(stop: &Value) {
    assert_eq!((&stop["kind"], &stop["joint"], &stop["unit"]), (&"push".into(), &5.into(), &"N·m".into()));
    assert_eq!((&stop["number"], &stop["code"]), (&2.into(), &"held-stop-push".into()));
    let number = |key: &str| stop[key].as_f64().expect("a number");
    assert!((number("limit") - LIMIT).abs() < 1e-3 && number("value").abs() > LIMIT, "{stop}");
    assert!(stop["text"].as_str().expect("words").starts_with("joint 5 was pushed"), "{stop}");
}

#[test]
fn j69_the_commands_show_what_was_found_and_what_to_do() {
    let mut sim = Sim::start(&["--no-throttle"]).held();
    assert!(sim.json(&["status"], 0)["held_stop"].is_null());
    let port = sim.port.to_str().expect("a name").to_owned();
    let status = pushed(&mut sim, || {
        let status = jtc(&["--json", "status", "--port", &port]).ends(0).json();
        status["held_stop"].is_object().then_some(status)
    });
    is_a_push(&status["held_stop"]);
    let text = status["held_stop"]["text"].as_str().expect("words");
    assert!(status["next"].as_str().expect("words").contains("then jtc clear"), "{status}");
    let shown = sim.jtc(&["status"]).ends(0).out;
    assert!(shown.contains(&format!("held stop: {text}; ")) && shown.contains(" s ago\n"), "{shown}");
    let found = sim.jtc(&["doctor"]).ends(1).out;
    assert!(
        found.contains(&format!("held stop: {text}; ")) && found.contains("remove what pushes"),
        "{found}"
    );
    assert!(!found.contains("torque over limit"), "{found}");
    sim.jtc(&["clear"]).ends(0);
    let info = sim.json(&["info"], 0);
    is_a_push(&info["reactions"]["last_held_stop"]);
    assert_eq!(info["reactions"]["encoder_jumped"], Value::Array(vec![]));
    let shown = sim.jtc(&["info"]).ends(0).out;
    assert!(shown.contains(&format!("held stop: {text}; ")), "{shown}");
    assert!(sim.json(&["status"], 0)["held_stop"].is_null());
}

#[test]
fn j35_j69_a_jump_of_an_encoder_is_shown_until_its_drive_was_reset() {
    let faults = "format = 2\n[[fault]]\nkind = \"encoder-jump\"\njoint = 3\nrad = 0.02\nin_state = \"hold\"\nafter_s = 10\n";
    let sim = Sim::with_faults(&["--no-throttle"], faults).held();
    let status = until("a held stop", || {
        let status = sim.json(&["status"], 0);
        status["held_stop"].is_object().then_some(status)
    });
    let stop = &status["held_stop"];
    assert_eq!((&stop["kind"], &stop["joint"]), (&"encoder-jump".into(), &3.into()));
    assert!(stop["limit"].is_null() && (stop["value"].as_f64().expect("a number") - 0.02).abs() < 1e-3);
    assert!(status["next"].as_str().expect("words").contains("jtc reset --joints JOINT"), "{status}");
    sim.jtc(&["clear"]).ends(0);
    let found = sim.jtc(&["doctor"]).ends(1).out;
    assert!(found.contains("joint 3: the encoder has jumped"), "{found}");
    assert_eq!(sim.json(&["info"], 0)["reactions"]["encoder_jumped"], Value::from(vec![3]));
}

#[test]
fn j69_the_pages_of_held_stops_are_explained() {
    for (code, says) in [("held-stop", "holds it"), ("encoder-jumped", "marks"), ("held-stop-push", "pushes")]
    {
        let page = jtc(&["explain", code]).ends(0).out;
        assert!(page.starts_with(&format!("{code} - ")) && page.contains(says), "{page}");
    }
}

#[test]
fn j69_the_agent_asks_for_the_cause_and_shows_it() {
    let mut sim = Sim::start(&["--baud", "921600"]).with_parameters();
    let dir = tempfile::tempdir().expect("a directory");
    let port = sim.port.to_str().expect("a name").to_owned();
    let (mut agent, ready) = serve(&dir, &["--port", &port, "--baud", "921600"]);
    let url = ready["url"].as_str().expect("its address").to_owned();
    let tokens = std::fs::read_to_string(ready["token_file"].as_str().expect("a file")).expect("tokens");
    let token = tokens.lines().find_map(|line| line.strip_prefix("operator = \"")?.strip_suffix('"'));
    let address: SocketAddr = url.strip_prefix("http://").expect("an address").parse().expect("an address");
    let http = Http { address, operator: token.expect("the operator's").to_owned() };
    let get = |path: &str| http.api(&format!("GET {path}"), None, None).1;
    let recover = |words: &[&str]| {
        let mut command = command_in(&dir);
        command.args(words).args(["--port", &url]);
        run(command, &[], "").ends(0);
    };
    recover(&["recover", "--defaults"]);
    assert!(get("/api/status")["controller"]["held_stop"].is_null());
    let controller = pushed(&mut sim, || {
        let controller = get("/api/status")["controller"].take();
        controller["held_stop"].is_object().then_some(controller)
    });
    let stop = &controller["held_stop"];
    is_a_push(stop);
    assert!(stop["since_s"].as_f64().is_some_and(|s| (0.0..600.0).contains(&s)), "{stop}");
    assert!(stop["remedy"].as_str().expect("words").starts_with("remove what pushes"), "{stop}");
    assert!(controller["next"].as_str().expect("words").contains("remove what pushes"), "{controller}");
    assert_eq!(get("/api/explain/held-stop-push")["code"], "held-stop-push");
    assert!(
        get("/api/doctor")["findings"][0]["what"].as_str().expect("words").starts_with("held stop: joint 5")
    );
    std::thread::sleep(Duration::from_millis(600));
    recover(&["clear"]);
    assert!(get("/api/status")["controller"]["held_stop"].is_null());
    is_a_push(&get("/api/info")["reactions"]["last_held_stop"]);
    agent.kill().expect("it is there");
    agent.wait().expect("it ends");
}

/// A command that sends gains to an arm with torque waits until the controller has tested the gains. If the
/// controller rejects the gains, the command reports the reason.
#[test]
fn j71_params_push_waits_for_the_trial_of_its_gains() {
    let mut sim = Sim::start(&["--no-throttle"]).held();
    std::thread::sleep(SETTLES);
    let avena = include_str!("../../../arms/avena.toml");
    let arm =
        |kp: &str| sim.file(&format!("{kp}.toml"), &avena.replace("kp = 4000.0", &format!("kp = {kp}")));
    let (first, second) = (arm("3900.0"), arm("3800.0"));
    let tried = sim.json(&["params", "push", &first], 0);
    assert_eq!(tried["gains_tried"], true, "{tried}");

    let mut push = sim.command(&["--json", "params", "push", &second]);
    let mut push = push.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let told = BufReader::new(push.stderr.take().expect("a pipe")).lines();
    let mut told = told.map(|line| line.expect("text"));
    assert!(told.any(|line| line.contains("tries the gains")));
    sim.write_line("push 5 38 0.5");
    let output = push.wait_with_output().expect("it ends");
    let failure: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(failure["error"]["code"], "held-stop", "{failure}");
    let status = sim.json(&["status"], 0);
    assert_eq!(status["held_stop"]["code"], "held-stop-gains", "{status}");
}
