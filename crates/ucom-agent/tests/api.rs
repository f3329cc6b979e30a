//! Tests with a client that uses only HTTP. The tests cover numbers, boards, values, control loops, inputs, events, and a Stop.
use crate::common;

use std::time::{Duration, Instant};

use common::{Served, frame};
use serde_json::{Value, json};
use test_kit::patience::{Patience, until};
use test_kit::written::text_with;
use ucom::Profile;
use ucom_agent::Config;
use ucom_host::session::Cache;
use ucom_sim::ChainConfig;

fn value<'a>(values: &'a Value, list: &str, name: &str) -> &'a Value {
    let all = values[list].as_array().expect("a list");
    let is = |value: &&Value| value["name"].as_str().is_some_and(|text| text.starts_with(name));
    all.iter().find(is).unwrap_or_else(|| panic!("{name} in {values}"))
}

/// D-24, D-51: boards get numbers by their position, and the list of boards shows their identities.
#[test]
fn d24_a_chain_is_scanned_numbered_and_listed() {
    let served = Served::start(3);
    let key = served.lease("anna", 60.0, "stop");
    let job = served.job("POST /api/scan", &key, None);
    assert_eq!(job["stage"], "finished", "{job}");
    assert_eq!(job["chain"]["boards"], json!([]), "none has a number yet: {job}");
    assert_eq!(job["chain"]["findings"].as_array().map(Vec::len), Some(3), "{job}");
    let job = served.job("POST /api/init", &key, Some(json!({})));
    assert_eq!((job["stage"].as_str(), &job["chain"]["findings"]), (Some("finished"), &json!([])), "{job}");
    let profile = Profile::default();
    let config = ChainConfig::head(&profile).with_boards(3, &profile);
    let (_, boards) = served.api("GET /api/boards", None, None);
    let found: Vec<(u64, u64)> = boards
        .as_array()
        .expect("boards")
        .iter()
        .filter_map(|board| Some((board["number"].as_u64()?, board["flash_number"].as_u64()?)))
        .collect();
    let places = config.boards.iter().zip(1..).map(|(board, place)| (place, u64::from(board.flash_id)));
    assert_eq!(found, places.collect::<Vec<_>>(), "{boards}");
    // If the chain differs from the expected chain, the job fails. The error of the job lists the boards on the bus.
    let expected = json!({ "expected": [{ "board": 1, "flash_number": 9 }] });
    let job = served.job("POST /api/init", &key, Some(expected));
    assert_eq!(
        (job["stage"].as_str(), job["error"]["code"].as_str()),
        (Some("failed"), Some("init")),
        "{job}"
    );
    let (status, job) = served.api("GET /api/jobs/99", None, None);
    assert!(status == 404 && job["next"].as_str().is_some_and(|next| next.contains("/api/jobs")), "{job}");
}

#[test]
fn a_program_runs_boards_gives_inputs_and_reads_what_they_send() {
    let (served, key) = Served::numbered(2);
    assert_eq!(served.board(1)["offers"], Value::Null, "its application is not started: it has no names");
    let (status, error) = served.api("GET /api/boards/1/values", None, None);
    assert!(status == 409 && error["next"].as_str().is_some_and(|n| n.contains("start")), "{error}");
    let (status, started) = served.api("POST /api/boards/1/start", Some(&key), None);
    assert_eq!((status, started["state"].as_str()), (200, Some("started")), "{started}");
    // A value that was neither set nor read is unknown. If it were shown as 0, a client that reads all values and
    // writes them back would write zeros.
    let known = |of: &Value| {
        of["inputs"]
            .as_array()
            .expect("inputs")
            .iter()
            .map(|input| !input["value"].is_null())
            .collect::<Vec<_>>()
    };
    let (_, values) = served.api("GET /api/boards/1/values", None, None);
    assert!(known(&values).len() > 1 && known(&values).iter().all(|known| !known), "{values}");
    let body = Some(json!({ "value": 7 }));
    assert_eq!(served.api("PUT /api/boards/1/inputs/set_position", Some(&key), body).0, 200);
    let (_, values) = served.api("GET /api/boards/1/values", None, None);
    assert_eq!(known(&values).iter().filter(|known| **known).count(), 1, "{values}");
    assert_eq!(value(&values, "inputs", "set_position")["value"], 7.0, "{values}");
    // Each board runs once, even if the request lists the board several times. The agent reads the inputs of a board when the board is
    // started.
    let (mut peer, boards) = (served.chain.peer(), [vec![1; 200], vec![2]].concat());
    let job = served.job("POST /api/run", &key, Some(json!({ "boards": boards, "active": true })));
    assert_eq!(job["stage"], "finished", "{job}");
    let mut asked = 0;
    while let Some(frame) = peer.receive(Duration::ZERO).expect("the bus is there") {
        asked += u32::from(frame.id().value() == 0x201);
    }
    assert!((1..100).contains(&asked), "asked who it is {asked} times");
    let (_, values) = served.api("GET /api/boards/1/values", None, None);
    assert!(known(&values).iter().all(|known| *known), "{values}");
    let board = served.board_when(1, "running", |board| board["state"] == "running");
    assert_eq!(
        (board["heartbeat"].as_str(), board["active"].as_bool()),
        (Some("alive"), Some(true)),
        "{board}"
    );
    assert!(board["heartbeat_age_s"].as_f64().is_some_and(|age| age < 1.6), "{board}");
    let offers: Vec<&str> =
        board["offers"]["inputs"].as_array().expect("names").iter().filter_map(Value::as_str).collect();
    assert!(offers.iter().any(|name| name.starts_with("set_position")), "{offers:?}");
    // A client moves the axis by setting an input by its name. Without the signal table, the values are raw words.
    let set = |value: Value| {
        let request = "PUT /api/boards/1/inputs/set_position";
        served.api(request, Some(&key), Some(json!({ "value": value })))
    };
    let (status, sent) = set(json!(1500));
    assert_eq!((status, sent["value"].as_f64()), (200, Some(1500.0)), "{sent}");
    let mut patience = Patience::begin();
    loop {
        let (status, values) = served.api("GET /api/boards/1/values", None, None);
        assert_eq!(status, 200, "{values}");
        assert_eq!(value(&values, "inputs", "set_position")["value"], 1500.0, "{values}");
        if value(&values, "outputs", "pos")["value"].as_f64().is_some_and(|at| (at - 1500.0).abs() < 30.0) {
            assert_eq!(values["stale"], false, "{values}");
            break;
        }
        patience.pause(format_args!("the position 1500: {values}"));
    }
    // A text that contains a raw word is also a valid value. The agent refuses an invalid name or value with an explanation, and changes
    // nothing.
    assert_eq!(set(json!("0x05DC")).1["value"], 1500.0);
    for (name, given, status, part) in [
        ("set_positon", json!(1), 422, "set_position"),
        ("set_position", json!(99999), 409, "set_position"),
        ("set_position", json!("warm"), 422, "not a value"),
    ] {
        let request = format!("PUT /api/boards/1/inputs/{name}");
        let (got, error) = served.api(&request, Some(&key), Some(json!({ "value": given })));
        let message = error["message"].as_str().unwrap_or_default();
        assert!([status, 409, 422].contains(&got) && message.contains(part), "{got} {error}");
    }
    let (_, values) = served.api("GET /api/boards/1/values", None, None);
    assert_eq!(value(&values, "inputs", "set_position")["value"], 1500.0, "{values}");
    let body = Some(json!({ "value": 120 }));
    let name =
        board["offers"]["parameters"][0].as_str().expect("a name").split(' ').next().unwrap_or_default();
    let (status, sent) = served.api(&format!("PUT /api/boards/1/parameters/{name}"), Some(&key), body);
    assert_eq!((status, sent["value"].as_f64()), (200, Some(120.0)), "{sent}");
    // The test turns the outputs off and stops one board; the other board still runs.
    let off = served.api("PUT /api/boards/1/outputs", Some(&key), Some(json!({ "active": false })));
    assert_eq!(off.0, 204, "{}", off.1);
    served.board_when(1, "inactive", |board| board["active"] == false);
    let (status, stopped) = served.api("POST /api/boards/1/stop", Some(&key), None);
    assert_eq!((status, stopped["state"].as_str()), (200, Some("exloader")), "{stopped}");
    assert_eq!(served.board(2)["state"], "running");
    // After a reset, the board has no number.
    let (status, reset) = served.api("POST /api/boards/1/reset", Some(&key), None);
    assert_eq!((status, reset["reports"].as_array().map(Vec::len)), (200, Some(1)), "{reset}");
    let (status, error) = served.api("POST /api/boards/1/start", Some(&key), None);
    assert_eq!((status, error["code"].as_str()), (409, Some("no-answer")), "{error}");
}

/// D-37: the agent accepts a Stop from any client, without a token and without the lease. The frames of the Stop are
/// sent at once, and each board confirms the Stop.
#[test]
fn d37_a_stop_needs_no_lease_and_stops_every_board() {
    let (served, key) = Served::numbered(3);
    served.run(&key, &[1, 2, 3]);
    let last = served.last_event();
    let mut peer = served.chain.peer();
    let stopper = std::thread::spawn({
        let http = served.clone();
        move || http.get("POST /api/stop").0
    });
    // The expected frame is MCA_ADMIN_DATA to all boards with all flags 0. The agent sends the frame of a Stop three times, because one
    // frame can be lost.
    for _ in 0..3 {
        frame(&mut *peer, 0x600, &[0, 0, 0, 0]);
    }
    assert_eq!(stopper.join().expect("it is taken"), 200);
    let (number, halt) = served.event(last, "halt", |event| event["kind"] == "halt");
    assert!(halt["by"].as_str().is_some_and(|by| by.starts_with("127.0.0.1")), "{halt}");
    let (_, stopped) = served.event(number, "stopped", |event| event["kind"] == "stopped");
    assert_eq!((&stopped["boards"], &stopped["not_stopped"]), (&json!([1, 2, 3]), &json!([])), "{stopped}");
    for number in 1..=3 {
        let board = served.board_when(number, "stopped", |board| board["state"] == "exloader");
        assert_eq!(board["active"], false, "{board}");
    }
    // After another client's Stop, the agent refuses motion requests during the hold-off and accepts them later.
    let (status, error) = served.api("POST /api/run", Some(&key), Some(json!({ "boards": [1] })));
    assert_eq!((status, error["code"].as_str()), (409, Some("stopped")), "{error}");
    std::thread::sleep(Duration::from_millis(3100));
    served.run(&key, &[1]);
    // A Stop with the client's own key does not cause a hold-off for this client.
    assert_eq!(served.api("POST /api/stop", Some(&key), None).0, 200);
    served.board_when(1, "stopped", |board| board["state"] == "exloader");
    served.run(&key, &[1]);
    text_with(&served.log, &["\"halt\"", "\"command\":\"run\"", "\"joined\""]);
}

/// A Stop ends a job that is in progress before the job moves a board.
#[test]
fn a_run_that_is_stopped_while_it_begins_does_not_begin() {
    let (served, key) = Served::numbered(2);
    let job = served.begin("POST /api/run", &key, Some(json!({ "active": true })));
    assert_eq!(served.api("POST /api/stop", Some(&key), None).0, 200);
    let over = served.over(job);
    assert_eq!(over["stage"], "cancelled", "{over}");
    let (_, stopped) = served.event(0, "stopped", |event| event["kind"] == "stopped");
    assert_eq!(stopped["not_stopped"], json!([]), "{stopped}");
    std::thread::sleep(Duration::from_millis(500));
    for number in 1..=2 {
        assert_eq!(served.board(number)["state"], "exloader");
    }
}

/// D-51: the agent reports a board as late after 1.5 s without a heartbeat, as lost after 3 s, and as back with its
/// next heartbeat.
#[test]
fn d51_a_board_that_dies_is_noticed_in_time_and_so_is_its_return() {
    let (served, key) = Served::numbered(2);
    for board in [1, 2] {
        assert_eq!(served.api(&format!("POST /api/boards/{board}/start"), Some(&key), None).0, 200);
        served.board_when(board, "alive", |board| board["heartbeat"] == "alive");
    }
    let last = served.last_event();
    let begun = host_kit::unix_time().as_secs_f64();
    served.chain.fault("silent board=2 for_s=5");
    let mut at = Vec::new();
    let mut number = last;
    for change in ["late", "lost", "back"] {
        let is = |event: &Value| event["kind"] == "heartbeat" && event["change"] == change;
        let (found, event) = served.event(number, change, is);
        assert_eq!(event["board"], 2, "{event}");
        let (_, all) = served.api(&format!("GET /api/events?after={}", found - 1), None, None);
        at.push(all["events"][0]["unix_s"].as_f64().expect("a time") - begun);
        number = found;
        if change == "lost" {
            assert_eq!(served.board(2)["heartbeat"], "lost");
            assert_eq!(served.board(1)["heartbeat"], "alive");
        }
    }
    // The board sent its last heartbeat up to one second before the fault. The event `late` therefore comes 0.5 to
    // 1.5 s after the fault, and the event `lost` 2 to 3 s after it, with some tolerance.
    assert!((0.4..1.7).contains(&at[0]) && (1.9..3.2).contains(&at[1]), "{at:?}");
    assert!((1.4..1.6).contains(&(at[1] - at[0])) && at[2] < 6.7, "{at:?}");
}

/// D-37, D-50: if a board leaves its control loop without a command, the agent reports an event, and the values of the board are
/// outdated.
#[test]
fn d50_a_board_that_misses_its_pc_is_an_event_and_its_values_are_stale() {
    let (served, key) = Served::numbered(1);
    served.run(&key, &[1]);
    let last = served.last_event();
    served.chain.fault("deaf board=1 for_s=3");
    let (_, event) = served.event(last, "left", |event| event["kind"] == "loop");
    assert_eq!((event["board"].as_u64(), event["change"].as_str()), (Some(1), Some("left-loop")), "{event}");
    let (_, values) = served.api("GET /api/boards/1/values", None, None);
    assert_eq!(values["stale"], true, "{values}");
}

/// D-08: the agent sends nothing to boards that another PC commands.
#[test]
fn d08_with_another_master_on_the_bus_commands_are_refused() {
    let mut other = Served::start(1);
    other.chain.fault("foreign-master");
    std::thread::sleep(Duration::from_millis(1500));
    let (_, status) = other.api("GET /api/status", None, None);
    assert_eq!(status["competing_master"], true, "{status}");
    let theirs = other.lease("bob", 60.0, "stop");
    // The status reports the other master as long as it is present, not only when its first frame arrives. While the other master is
    // present, a doctor job sends no queries.
    for _ in 0..40 {
        std::thread::sleep(Duration::from_millis(100));
        let (_, status) = other.api("GET /api/status", None, None);
        assert_eq!(status["competing_master"], true, "{status}");
    }
    let mut peer = other.chain.peer();
    let job = other.job("POST /api/doctor", &theirs, None);
    let found = job["findings"].to_string();
    assert!(found.contains("another PC sends on this bus"), "{job}");
    while let Some(frame) = peer.receive(Duration::ZERO).expect("the bus is there") {
        assert!([0x680, 0x21F].contains(&frame.id().value()), "{frame:?}");
    }
    let job = other.job("POST /api/init", &theirs, Some(json!({})));
    assert_eq!(job["stage"], "failed", "{job}");
    assert!(job["error"]["message"].as_str().is_some_and(|m| m.contains("PC")), "{job}");
    other.end();
    // A bus without another master works normally. The test takes this lease only here, because it could lapse during
    // the steps above on a busy computer.
    let (served, key) = Served::numbered(2);
    assert_eq!(served.api("POST /api/boards/1/start", Some(&key), None).0, 200);
    // If another master is present, the agent also sends no queries for a viewer.
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    served.chain.fault("foreign-master");
    std::thread::sleep(Duration::from_millis(1000));
    let mut peer = served.chain.peer();
    assert_eq!(served.api_as(None, "GET /api/boards/1/values", None, None).0, 200, "its names are known");
    let (status, error) = served.api_as(None, "GET /api/boards/2/values", None, None);
    assert_eq!((status, error["code"].as_str()), (409, Some("competing-master")), "{error}");
    while let Some(frame) = peer.receive(Duration::ZERO).expect("the bus is there") {
        assert_ne!(frame.id().value(), 0x202, "{frame:?}");
    }
}

#[test]
fn a_lease_lasts_as_long_as_the_description_says_and_no_longer() {
    let served = Served::start(1);
    let description: Value = serde_json::from_str(&ucom_agent::api::description()).expect("JSON");
    let lasts = &description["components"]["schemas"]["LeaseRequest"]["properties"]["lasts_s"];
    let (least, most) =
        (lasts["minimum"].as_f64().expect("a bound"), lasts["maximum"].as_f64().expect("a bound"));
    for (lasts_s, status) in [(least - 0.01, 422), (least, 200), (most + 0.01, 422), (most, 200)] {
        let body = json!({ "name": "anna", "lasts_s": lasts_s, "ask": true });
        let (got, answer) = served.api("POST /api/lease", None, Some(body));
        assert_eq!(got, status, "{lasts_s}: {answer}");
        let named = answer["message"].as_str().is_some_and(|m| m.contains(&format!("{least} to {most} s")));
        assert_eq!(named, status == 422, "{answer}");
    }
}

#[test]
fn the_lease_is_asked_for_given_and_its_policy_stops_what_runs() {
    let (served, key) = Served::numbered(1);
    let (status, denied) = served.api("POST /api/lease", None, Some(json!({ "name": "bob" })));
    assert!(status == 409 && denied["message"].as_str().is_some_and(|m| m.contains("anna")), "{denied}");
    let ask = json!({ "name": "bob", "ask": true, "lasts_s": 5.0 });
    let (status, grant) = served.api("POST /api/lease", None, Some(ask));
    assert_eq!((status, grant["held"].as_bool()), (200, Some(false)));
    let bob = grant["key"].as_str().expect("a key").to_owned();
    let (_, state) = served.api("PUT /api/lease", Some(&key), None);
    assert_eq!((state["held"].as_bool(), state["wanted_by"].as_str()), (Some(true), Some("bob")));
    assert_eq!(served.api("POST /api/boards/1/start", Some(&bob), None).0, 409);
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    assert_eq!(served.api("GET /api/status", None, None).1["lease"]["holder"], "bob");
    // By default, the agent stops the boards of a client after the client has disconnected.
    served.run(&bob, &[1]);
    let last = served.last_event();
    let (number, halt) = served.event(last, "halt", |event| event["kind"] == "halt");
    assert!(halt["by"].as_str().is_some_and(|by| by.contains("bob")), "{halt}");
    served.event(number, "stopped", |event| event["kind"] == "stopped" && event["boards"] == json!([1]));
    // With the policy `continue`, the boards of the client continue to run.
    let carl = served.lease("carl", 1.0, "continue");
    std::thread::sleep(Duration::from_millis(3100));
    let carl = match served.api("PUT /api/lease", Some(&carl), None).1["held"].as_bool() {
        Some(true) => carl,
        _ => served.lease("carl", 1.0, "continue"),
    };
    let last = served.last_event();
    served.run(&carl, &[1]);
    served.event(last, "nobody commands", |event| event["kind"] == "lease" && event["holder"].is_null());
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(served.board(1)["state"], "running");
}

#[test]
fn a_stream_has_bus_boards_values_and_events_as_they_come() {
    let (served, key) = Served::numbered(1);
    served.run(&key, &[1]);
    let (mut kinds, mut last) = (std::collections::BTreeMap::new(), 0);
    served.stream("/api/stream?after=0", |message| {
        let kind = message["kind"].as_str().expect("a kind").to_owned();
        if kind == "events" {
            for event in message["events"].as_array().expect("events") {
                last += 1;
                assert_eq!(event["number"], last, "{event}");
            }
        }
        if kind == "values" {
            assert_eq!(message["values"][0]["board"], 1, "{message}");
            assert!(!message["values"][0]["outputs"].as_array().expect("outputs").is_empty(), "{message}");
        }
        *kinds.entry(kind).or_insert(0) += 1;
        kinds.len() == 4 && kinds["values"] >= 20
    });
    assert!(last > 3, "{kinds:?}");
}

/// D-01: board numbers are 0 to 31. The agent refuses board numbers above 31 before it sends any frame, and continues to work.
#[test]
fn d01_numbers_that_no_board_can_have_are_refused() {
    let (served, key) = Served::numbered(1);
    for (request, body) in [
        ("POST /api/boards/32/start", None),
        ("POST /api/boards/143/reset", None),
        ("POST /api/boards/255/stop", None),
        ("PUT /api/boards/143/inputs/x", Some(json!({ "value": 1 }))),
        ("PUT /api/boards/32/outputs", Some(json!({ "active": true }))),
        ("POST /api/run", Some(json!({ "boards": [1, 32] }))),
        ("POST /api/init", Some(json!({ "expected": [{ "board": 32, "flash_number": 1 }] }))),
        ("POST /api/updates", Some(json!({ "boards": [{ "board": 32 }], "image": "AAAA", "format": "bin" }))),
    ] {
        let (status, error) = served.api(request, Some(&key), body);
        assert_eq!((status, error["code"].as_str()), (422, Some("board")), "{request}: {error}");
    }
    assert_eq!(served.api("POST /api/boards/1/start", Some(&key), None).0, 200);
}

#[test]
fn a_bus_that_is_gone_is_named() {
    let (mut served, key) = Served::numbered(1);
    served.chain.end();
    until("the loss of the bus", || !served.api("GET /api/status", None, None).1["lost"].is_null());
    let (status, error) = served.api("POST /api/stop", None, None);
    assert_eq!((status, error["code"].as_str()), (503, Some("no-link")), "{error}");
    assert_eq!(served.api("POST /api/boards/1/start", Some(&key), None).0, 503);
    served.event(0, "lost", |event| event["kind"] == "lost");
}

/// D-08, D-50: the agent sends heartbeats only for its own commands. If another PC is lost, the agent does not send heartbeats for the
/// boards that the other PC has started.
#[test]
fn d50_heartbeats_end_with_the_lease_and_what_was_started_and_a_stop_begins_none() {
    let (served, key) = Served::numbered(1);
    let status = || served.api("GET /api/status", None, None).1;
    let is_master =
        |wanted: bool| until(format_args!("is_master {wanted}"), || status()["is_master"] == wanted);
    is_master(true);
    // Running boards need heartbeats even if no client holds the lease.
    served.run(&key, &[1]);
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    std::thread::sleep(Duration::from_millis(500));
    is_master(true);
    let stop = || {
        let last = served.last_event();
        assert_eq!(served.api("POST /api/stop", None, None).0, 200);
        served.event(last, "stopped", |event| event["kind"] == "stopped" && event["boards"] == json!([1]));
    };
    stop();
    is_master(false);
    // Another PC is now the master of the bus. The agent does not become the master by a Stop, nor by a lease without commands.
    served.chain.fault("foreign-master");
    std::thread::sleep(Duration::from_millis(1500));
    for lease in [false, true] {
        if lease {
            served.lease("bob", 60.0, "stop");
        }
        stop();
        is_master(false);
        // Bob's lease of 60 s must still be valid at this check.
        assert_eq!(status()["lease"].is_null(), !lease, "{}", status());
        let beat = |frame: &can_link::CanFrame| frame.id().value() == 0x680 && frame.data().is_empty();
        let (mut peer, begun, mut beats) = (served.chain.peer(), Instant::now(), 0);
        while begun.elapsed() < Duration::from_millis(1500) {
            let received = peer.receive(Duration::from_millis(100)).expect("the bus is there");
            beats += u32::from(received.is_some_and(|frame| beat(&frame)));
        }
        assert!((1..=4).contains(&beats), "those of the other PC alone: {beats}");
    }
}

/// A disk that does not respond does not delay a Stop, a heartbeat or a query.
#[cfg(unix)]
#[test]
fn a_stop_does_not_wait_for_the_disk_with_the_names() {
    let dir = tempfile::tempdir().expect("a directory");
    let config = Config { cache: Cache::new(Some(dir.path().into()), false), ..Config::default() };
    let (served, key) = Served::numbered_as(2, config);
    served.run(&key, &[1]);
    let kept = || std::fs::read_dir(dir.path()).expect("a directory").flatten().next();
    until("the names of board 1 on the disk", || kept().is_some());
    // The test replaces the names file of board 2 by a pipe. Opening the pipe blocks, like a disk that does not
    // respond.
    let name = kept().expect("a file").file_name().into_string().expect("a name");
    let date = name.split('-').nth(2).expect("a date");
    let board = served.board(2);
    let number = |key: &str| board[key].as_u64().expect("a number");
    let file = format!("io-{:04X}-{date}-{:04X}.json", number("program_id"), number("flash_number"));
    let pipe = dir.path().join(file);
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().is_ok_and(|made| made.success()));
    let asker = std::thread::spawn({
        let http = served.clone();
        // This thread makes the agent read and write the names of board 2.
        move || {
            [http.get("GET /api/boards/2/values").0, http.api("POST /api/boards/2/start", Some(&key), None).0]
        }
    });
    std::thread::sleep(Duration::from_millis(2500));
    let mut peer = served.chain.peer();
    let last = served.last_event();
    assert_eq!(served.api("POST /api/stop", None, None).0, 200);
    let stop = (0..200).any(|_| {
        let received = peer.receive(Duration::from_millis(10)).expect("the bus is there");
        received.is_some_and(|frame| frame.id().value() == 0x600)
    });
    // The disk responds again when the test opens the pipe.
    drop(std::fs::OpenOptions::new().read(true).write(true).open(&pipe));
    assert!(stop, "a Stop waits for the disk");
    assert_eq!(asker.join().expect("it is answered"), [409, 200]);
    let (_, stopped) = served.event(last, "stopped", |event| event["kind"] == "stopped");
    assert_eq!(stopped["boards"], json!([1, 2]), "{stopped}");
}
