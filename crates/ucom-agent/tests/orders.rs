//! Tests how a Stop, the end of a lease, a disconnection and other clients affect the requests of a client.
use crate::common;

use std::io::Write as _;
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use common::{Served, frame, frame_when};
use serde_json::{Value, json};
use test_kit::http::Http;
use test_kit::patience::until;

fn is(kind: &'static str) -> impl Fn(&Value) -> bool {
    move |event| event["kind"] == kind
}

/// Sends commands to a board that does not answer. Later commands must wait some seconds until the commands to this board have failed.
fn commands_to_nobody(served: &Served, key: &str, count: usize) -> Vec<JoinHandle<()>> {
    let ask = || {
        let (http, key) = (Http::clone(served), key.to_owned());
        let off = Some(json!({ "active": false }));
        std::thread::spawn(move || drop(http.api("PUT /api/boards/31/outputs", Some(&key), off)))
    };
    let all = (0..count).map(|_| ask()).collect();
    std::thread::sleep(Duration::from_millis(100));
    all
}

/// Runs the control loop of board 1 with outputs off, for a client with this policy. Returns the lease key of the client.
fn idle(served: &Served, lasts_s: f64, policy: &str, key: &str) -> String {
    let job = served.job("POST /api/run", key, Some(json!({ "boards": [1] })));
    assert_eq!(job["stage"], "finished", "{job}");
    assert_eq!(served.api("DELETE /api/lease", Some(key), None).0, 204);
    served.lease("bob", lasts_s, policy)
}

/// During the job, another client reads the leases; this has no effect. When the lease lapses, the job ends and all boards are stopped.
#[test]
fn a_run_whose_client_dies_meanwhile_is_stopped() {
    let (served, key) = Served::numbered(6);
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    let key = served.lease("anna", 1.0, "stop");
    let last = served.last_event();
    let job = served.begin("POST /api/run", &key, Some(json!({ "active": true })));
    std::thread::sleep(Duration::from_millis(1100));
    assert_eq!(served.api("PUT /api/lease", Some("none"), None).0, 403);
    let (halted, halt) = served.event(last, "halt", is("halt"));
    assert!(halt["by"].as_str().is_some_and(|by| by.contains("anna")), "{halt}");
    let (ended, end) = served.event(last, "ended", is("ended"));
    assert!(halted < ended && end["outcome"] == "cancelled", "{halted} {ended} {end}");
    assert_eq!(served.over(job)["error"]["code"], "stopped");
    let (_, stopped) = served.event(last, "stopped", is("stopped"));
    assert_eq!(stopped, json!({ "kind": "stopped", "boards": [1, 2, 3, 4, 5, 6], "not_stopped": [] }));
    for number in 1..=6 {
        assert_eq!(served.board(number)["state"], "exloader");
    }
}

/// If a run was cancelled but one of its boards could not be stopped, the agent stops this board before it ends.
#[test]
fn a_run_that_cannot_be_taken_back_counts_as_started() {
    let (served, key) = Served::numbered(3);
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    let key = served.lease("anna", 20.0, "stop");
    let job = served.begin("POST /api/run", &key, Some(json!({ "boards": [1, 2, 3] })));
    served.board_when(1, "started", |board| board["state"] == "started");
    served.chain.fault("silent board=1 for_s=8");
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(served.api(&format!("DELETE /api/jobs/{job}"), Some(&key), None).0, 204);
    let over = served.over(job);
    assert_eq!(over["stage"], "cancelled", "{over}");
    let mut peer = served.chain.peer();
    let mut served = served;
    // Board 1 is still listed as started, so the agent must send a Stop to this board before it ends.
    let ending = std::thread::spawn(move || {
        served.end();
        served
    });
    frame(&mut *peer, 0x601, &[0, 0, 0, 0]);
    drop(ending.join());
}

/// A lease can lapse during a long update; the update continues.
#[test]
fn a_lease_lapses_in_the_middle_of_an_update() {
    use base64::Engine as _;
    let (served, key) = Served::numbered(2);
    served.run(&key, &[1]);
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    let key = served.lease("anna", 1.0, "stop");
    let last = served.last_event();
    let image = base64::engine::general_purpose::STANDARD.encode(vec![0xA5; 60_000]);
    let body = json!({ "boards": [{ "board": 2 }], "image": image, "format": "bin", "force": true });
    let job = served.begin("POST /api/updates", &key, Some(body));
    let (halted, _) = served.event(last, "halt", is("halt"));
    let (ended, end) = served.event(last, "ended", is("ended"));
    assert!(halted < ended && end["outcome"] == "finished", "{halted} {ended} {end}");
    assert_eq!(served.over(job)["update"]["boards"][0]["verified"], true);
    let (_, stopped) = served.event(ended, "stopped", is("stopped"));
    assert_eq!(stopped["not_stopped"], json!([]), "{stopped}");
}

/// If a client loses the lease while its request is queued, the request is not executed.
#[test]
fn what_waits_when_the_lease_lapses_does_not_move_anything() {
    let (served, key) = Served::numbered(1);
    let key = idle(&served, 1.0, "continue", &key);
    let others = commands_to_nobody(&served, &key, 4);
    let reset = std::thread::spawn({
        let (http, key) = (Http::clone(&served), key.clone());
        move || http.api("POST /api/boards/1/reset", Some(&key), None)
    });
    let on = json!({ "active": true });
    let (status, error) = served.api("PUT /api/boards/1/outputs", Some(&key), Some(on));
    assert_eq!((status, error["code"].as_str()), (409, Some("late")), "{error}");
    // The reset was not executed either, so the board still has its number.
    let (status, error) = reset.join().expect("it is answered");
    assert_eq!((status, error["code"].as_str()), (409, Some("late")), "{error}");
    let board = served.board(1);
    assert_eq!((&board["state"], &board["active"]), (&json!("running"), &json!(false)), "{board}");
    others.into_iter().for_each(|other| other.join().expect("it is answered"));
}

/// A queued request of a disconnected client does not move a board. A queued request that ends a motion is executed.
#[test]
fn what_waits_for_a_program_that_has_gone_does_not_move_anything() {
    let (served, key) = Served::numbered(2);
    served.run(&key, &[2]);
    let key = idle(&served, 60.0, "continue", &key);
    let others = commands_to_nobody(&served, &key, 4);
    let hang_up = |board: u8, active: bool| {
        let body = json!({ "active": active }).to_string();
        let (address, token, length) = (served.address, &served.tokens.operator, body.len());
        let mut socket = TcpStream::connect(address).expect("it listens");
        write!(
            socket,
            "PUT /api/boards/{board}/outputs HTTP/1.1\r\nHost: {address}\r\nAuthorization: Bearer {token}\r\n\
             Lease-Key: {key}\r\nContent-Type: application/json\r\nContent-Length: {length}\r\n\r\n{body}"
        )
        .expect("it reads");
        std::thread::sleep(Duration::from_millis(100));
    };
    hang_up(1, true);
    hang_up(2, false);
    others.into_iter().for_each(|other| other.join().expect("it is answered"));
    served.board_when(2, "off", |board| board["active"] == false);
    // The agent processes requests in order. After this later request, it has therefore processed all earlier
    // requests.
    assert_eq!(served.api("PUT /api/boards/2/outputs", Some(&key), Some(json!({ "active": false }))).0, 204);
    assert_eq!(served.board(1)["active"], false);
}

/// A client's own Stop does not shorten the hold-off after an earlier Stop of another client.
#[test]
fn the_calm_of_a_stop_lasts_behind_another_one() {
    let (served, key) = Served::numbered(1);
    assert_eq!(served.get("POST /api/stop").0, 200);
    for _ in 0..2 {
        assert_eq!(served.api("POST /api/stop", Some(&key), None).0, 200);
    }
    let (status, error) = served.api("POST /api/run", Some(&key), Some(json!({ "boards": [1] })));
    assert_eq!((status, error["code"].as_str()), (409, Some("stopped")), "{error}");
    // During the hold-off, the agent also refuses an update.
    let body = json!({ "boards": [{ "board": 1 }], "image": "AAAA", "format": "bin", "start": true });
    let (status, error) = served.api("POST /api/updates", Some(&key), Some(body));
    assert_eq!((status, error["code"].as_str()), (409, Some("stopped")), "{error}");
}

/// A client can cancel a queued job like a running job.
#[test]
fn a_job_that_waits_is_cancelled_and_one_that_is_refused_never_was() {
    let (served, key) = Served::numbered(1);
    let last = served.last_event();
    let others = commands_to_nobody(&served, &key, 4);
    let job = served.begin("POST /api/scan", &key, None);
    for _ in 0..3 {
        assert_eq!(served.api("POST /api/scan", Some(&key), None).1["code"], "busy");
    }
    assert_eq!(served.api(&format!("DELETE /api/jobs/{job}"), Some(&key), None).0, 204);
    assert_eq!(served.over(job)["stage"], "cancelled");
    others.into_iter().for_each(|other| other.join().expect("it is answered"));
    assert_eq!(served.begin("POST /api/scan", &key, None), job + 1);
    served.over(job + 1);
    let (_, all) = served.api(&format!("GET /api/events?after={last}"), None, None);
    let all = all["events"].as_array().expect("events");
    let of = |kind| all.iter().map(|entry| &entry["event"]).filter(move |event| event["kind"] == kind);
    let ended: Vec<(Option<u64>, Option<&str>)> =
        of("ended").map(|event| (event["job"].as_u64(), event["outcome"].as_str())).collect();
    assert_eq!(ended, [(Some(job), Some("cancelled")), (Some(job + 1), Some("finished"))]);
}

/// A board that does not answer during a Stop is not reported as stopped.
#[test]
fn a_board_that_is_silent_at_a_stop_is_named_and_still_counts() {
    let (served, key) = Served::numbered(2);
    served.run(&key, &[1, 2]);
    let last = served.last_event();
    served.chain.fault("silent board=2 for_s=2.5");
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(served.get("POST /api/stop").0, 200);
    let (number, stopped) = served.event(last, "stopped", is("stopped"));
    let silent = &stopped["not_stopped"];
    assert_eq!((&stopped["boards"], silent.as_array().map(Vec::len)), (&json!([1]), Some(1)), "{stopped}");
    assert!(silent[0].as_str().is_some_and(|text| text.starts_with("board 2: ")), "{stopped}");
    std::thread::sleep(Duration::from_secs(2));
    assert_eq!(served.get("POST /api/stop").0, 200);
    let (_, stopped) = served.event(number, "stopped", is("stopped"));
    assert_eq!((&stopped["boards"], &stopped["not_stopped"]), (&json!([1, 2]), &json!([])), "{stopped}");
}

/// Read-only requests do not delay commands, even if they query a silent board again and again.
#[test]
fn questions_keep_no_command_waiting() {
    let (served, key) = Served::numbered(2);
    served.run(&key, &[1]);
    served.chain.fault("silent board=2 for_s=20");
    let look = || {
        let http = Http::clone(&served);
        std::thread::spawn(move || drop(http.api_as(None, "GET /api/boards/2/values", None, None)))
    };
    let viewers: Vec<JoinHandle<()>> = (0..40).map(|_| look()).collect();
    std::thread::sleep(Duration::from_millis(200));
    let begun = Instant::now();
    for active in [false, true, false] {
        let body = Some(json!({ "active": active }));
        let (status, error) = served.api("PUT /api/boards/1/outputs", Some(&key), body);
        assert_eq!(status, 204, "{error}");
    }
    // A command waits at most for the single query that is being executed.
    assert!(begun.elapsed() < Duration::from_secs(3), "{:?}", begun.elapsed());
    viewers.into_iter().for_each(|viewer| viewer.join().expect("it is answered"));
}

/// When the agent ends, it stops the running boards before a job undoes its own steps on other boards.
#[test]
fn the_end_stops_what_runs_before_a_job_is_undone() {
    let (mut served, key) = Served::numbered(5);
    served.run(&key, &[1]);
    served.begin("POST /api/run", &key, Some(json!({ "boards": [2, 3, 4, 5] })));
    served.board_when(4, "started", |board| board["state"] == "started");
    (2..=5).for_each(|board| served.chain.fault(&format!("silent board={board} for_s=4")));
    std::thread::sleep(Duration::from_millis(100));
    let mut peer = served.chain.peer();
    let ending = std::thread::spawn(move || {
        served.end();
        served
    });
    let stopped = frame(&mut *peer, 0x601, &[0, 0, 0, 0]);
    assert!(stopped < Duration::from_millis(1500), "{stopped:?}");
    drop(ending.join());
}

/// A command that has waited in the queue for more than 5 s is refused, because its HTTP request times out after 10
/// s. Otherwise, the client might not see the effect of the command.
#[test]
fn what_waits_too_long_does_not_move_anything() {
    let (served, key) = Served::numbered(1);
    let key = idle(&served, 60.0, "continue", &key);
    let others = commands_to_nobody(&served, &key, 12);
    let on = json!({ "active": true });
    let (status, error) = served.api("PUT /api/boards/1/outputs", Some(&key), Some(on));
    assert_eq!((status, error["code"].as_str()), (409, Some("busy")), "{error}");
    assert_eq!(served.board(1)["active"], false);
    others.into_iter().for_each(|other| other.join().expect("it is answered"));
}

/// D-24: a board that does not receive the reset of an init continues to run. The agent stops this board, and the init fails.
#[test]
fn d24_a_board_that_misses_the_reset_of_an_init_is_stopped() {
    let (served, key) = Served::numbered(2);
    served.run(&key, &[1, 2]);
    // The board misses the reset. This board receives frames again before the end of the 1 s in which the agent
    // collects reports after the reset.
    served.chain.fault("deaf board=2 for_s=0.9");
    let job = served.job("POST /api/init", &key, Some(json!({})));
    assert_eq!((&job["stage"], &job["error"]["code"]), (&json!("failed"), &json!("init")), "{job}");
    let message = job["error"]["message"].as_str().unwrap_or_default();
    assert!(message.contains("board 2") && message.contains("PC_RESET"), "{job}");
    let board = served.board(2);
    assert_eq!((&board["state"], &board["active"]), (&json!("exloader"), &json!(false)), "{board}");
    let again = served.job("POST /api/init", &key, Some(json!({})));
    assert_eq!(again["stage"], "finished", "{again}");
}

/// D-34: the agent sends the inputs of a running board repeatedly, so it does not wait for an answer to a single input. If a board has
/// no power, the agent refuses to set its inputs.
#[test]
fn d34_an_input_of_a_board_without_power_is_no_success() {
    let (served, key) = Served::numbered(1);
    served.run(&key, &[1]);
    let first = served.board(1)["offers"]["inputs"][0].as_str().expect("a name").to_owned();
    let input = format!("PUT /api/boards/1/inputs/{}", first.split(' ').next().unwrap_or_default());
    let set = || served.api(&input, Some(&key), Some(json!({ "value": 7 })));
    let (status, error) = set();
    assert_eq!(status, 200, "{error}");
    served.chain.fault("power-loss board=1 for_s=60");
    // Outputs that are at most 0.5 s old still count as outputs of a running board, so the test waits longer.
    std::thread::sleep(Duration::from_millis(600));
    let (status, error) = set();
    assert_eq!(status, 409, "{error}");
}

/// A client cannot release its lease while its run starts. Otherwise, the agent would enable outputs later, when no
/// client holds the lease.
#[test]
fn the_lease_is_not_let_go_while_a_run_begins() {
    let (served, key) = Served::numbered(1);
    let job = served.begin("POST /api/run", &key, Some(json!({ "active": true })));
    let (status, error) = served.api("DELETE /api/lease", Some(&key), None);
    assert_eq!((status, error["code"].as_str()), (409, Some("busy")), "{error}");
    assert_eq!(served.over(job)["stage"], "finished");
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    assert_eq!(served.board(1)["active"], true);
}

/// Waits until the agent is not the master any more, because no client holds the lease and no board runs.
fn heartbeats_end(served: &Served) {
    until("the end of the heartbeats", || served.api("GET /api/status", None, None).1["is_master"] == false);
}

/// D-50: read-only requests do not keep the agent's heartbeats going, even if the requests are frequent. If no client
/// holds the lease, the boards become safe.
#[test]
fn d50_questions_do_not_keep_the_heartbeats_going() {
    let (served, key) = Served::numbered(1);
    let asked_enough = Arc::new(AtomicBool::new(false));
    let look = || {
        let (http, enough) = (Http::clone(&served), asked_enough.clone());
        std::thread::spawn(move || {
            while !enough.load(Ordering::Relaxed) {
                // The application of the board is not started, so the names of its values are unknown.
                assert_eq!(http.api_as(None, "GET /api/boards/1/values", None, None).0, 409);
            }
        })
    };
    let viewers: Vec<JoinHandle<()>> = (0..8).map(|_| look()).collect();
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    heartbeats_end(&served);
    asked_enough.store(true, Ordering::Relaxed);
    viewers.into_iter().for_each(|viewer| viewer.join().expect("it is answered"));
}

/// If a run was started and then undone, its boards are not listed as started.
#[test]
fn a_run_that_was_cancelled_and_taken_back_does_not_count_as_started() {
    let (served, key) = Served::numbered(2);
    let job = served.begin("POST /api/run", &key, Some(json!({ "active": true })));
    served.board_when(1, "started", |board| board["state"] == "started");
    assert_eq!(served.api(&format!("DELETE /api/jobs/{job}"), Some(&key), None).0, 204);
    assert_eq!(served.over(job)["stage"], "cancelled");
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    heartbeats_end(&served);
}

/// D-50: another PC has started the control loop of a board. If this agent stops that control loop, it does not treat
/// the board as one that it has started.
#[test]
fn d50_a_stopped_loop_of_another_pc_does_not_keep_the_heartbeats_going() {
    let (served, key) = Served::numbered(1);
    let mut peer = served.chain.peer();
    for (id, awaited) in [(0x301, 0x501), (0x541, 0x601)] {
        let id = can_link::Id::standard(id).expect("11 bits");
        peer.send(&can_link::CanFrame::classic(id, &[]).expect("no data")).expect("the bus is there");
        // The test does not check the data of the frame.
        frame_when(&mut *peer, &format!("{awaited:03X}"), |frame| frame.id().value() == awaited);
    }
    let (status, error) = served.api("POST /api/boards/1/stop?level=loop", Some(&key), None);
    assert_eq!(status, 200, "{error}");
    served.board_when(1, "started", |board| board["state"] == "started");
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    heartbeats_end(&served);
    // For a board that it has started itself, the agent still sends heartbeats. Before this agent can start the board, the other PC
    // must be silent for some time (D-08).
    std::thread::sleep(Duration::from_millis(1_500));
    let key = served.lease("anna", 60.0, "continue");
    served.run(&key, &[1]);
    assert_eq!(served.api("POST /api/boards/1/stop?level=loop", Some(&key), None).0, 200);
    assert_eq!(served.api("DELETE /api/lease", Some(&key), None).0, 204);
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(served.api("GET /api/status", None, None).1["is_master"], true);
}
