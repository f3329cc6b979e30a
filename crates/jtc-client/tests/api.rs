//! Tests of the HTTP interface for programs: leases, trajectories, runs, and events that a client can read again after
//! a disconnect.
use crate::common;

use std::time::{Duration, Instant};

use common::Served;
use common::program::{Program, event, over};
use jtc_host::{Arm, plan};
use serde_json::{Value, json};
use test_kit::patience::until;

/// Returns the text of a trajectory file with a motion from the zero pose and back, at `percent` % of the limits.
fn there_and_back(percent: f64) -> String {
    let (arm, to) = (Arm::avena(), [0.3, -0.2, 0.2, 0.3, -0.2, 0.3]);
    let way = |from: &[f64; 6], to: &[f64; 6]| {
        plan::joint_move(from, to, &arm.config(), percent).expect("it is within the limits")
    };
    let (mut there, back) = (way(&[0.0; 6], &to), way(&to, &[0.0; 6]));
    there.points.extend(back.points.into_iter().skip(1));
    there.to_exact_csv()
}

fn trajectory(served: &Served, number: u16, percent: f64) {
    let body = json!({ "name": "there and back", "text": there_and_back(percent) });
    let (status, kept) = served.api(&format!("PUT /api/trajectories/{number}"), None, Some(body));
    assert_eq!(status, 200, "{kept}");
}

fn moves(served: &Served) -> bool {
    served.line.with(|line, _| line.status().is_some_and(|(_, status)| status.is_executing()))
}

#[test]
fn a_program_takes_the_lease_uploads_runs_pauses_goes_on_and_reads_the_result() {
    let served = Served::start(921_600);
    trajectory(&served, 7, 20.0);
    let anna = Program::new(&served, "anna", 5.0, "continue");
    anna.recover();
    let (_, check) = served.api("GET /api/trajectories/7/check", None, None);
    assert_eq!(check["passed"], true, "{check}");
    let job = anna.begin("POST /api/runs", json!({ "trajectory": 7 }));
    let (number, _) = event(&served, 0, "executing");
    // While the job runs, the agent refuses another command, and the error contains the number of the job.
    let (status, busy) = anna.ask("POST /api/gripper", Some(json!({ "on": true })));
    assert!(
        status == 409
            && busy["code"] == "busy"
            && busy["message"].as_str().is_some_and(|m| m.contains("job"))
    );
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(anna.ask("POST /api/pause", None).0, 200);
    // The client that started the run can pause the run, and resume it when the arm is at rest.
    let paused = |event: &Value| event["trajectory"] == "Pause";
    let (mut number, mut state) = event(&served, number, "state");
    while !paused(&state) {
        (number, state) = event(&served, number, "state");
    }
    assert_eq!(anna.ask("PUT /api/speed", Some(json!({ "percent": 80 }))).0, 204);
    assert_eq!(anna.ask("POST /api/resume", None).0, 204);
    let done = anna.over(job);
    assert_eq!((done["stage"].as_str(), done["runs"].as_u64()), (Some("finished"), Some(1)), "{done}");
    let errors = done["result"]["joints"].as_array().expect("joints");
    assert!(
        errors.len() == 6
            && errors.iter().all(|joint| joint["max_error_mrad"].as_f64().is_some_and(|e| e < 20.0))
    );
    // A client can read events by their numbers more than once.
    let (_, all) = served.api(&format!("GET /api/events?after=0&job={job}"), None, None);
    let kinds: Vec<&str> = all["events"]
        .as_array()
        .expect("events")
        .iter()
        .filter_map(|e| e["event"]["kind"].as_str())
        .collect();
    let steps = ["begun", "checked", "uploading", "uploaded", "executing", "finished", "ended"];
    let mut at = kinds.iter();
    for step in steps {
        assert!(at.any(|kind| *kind == step), "{step} in {kinds:?}");
    }
    assert_eq!(anna.ask("DELETE /api/lease", None).0, 204);
    assert_eq!(anna.ask("POST /api/gripper", Some(json!({ "on": true }))).0, 403);
}

#[test]
fn somebody_else_stops_a_run_and_it_stays_so() {
    let served = Served::start(921_600);
    trajectory(&served, 1, 10.0);
    let anna = Program::new(&served, "anna", 30.0, "continue");
    anna.recover();
    let job = anna.begin("POST /api/runs", json!({ "trajectory": 1, "repeat": 3 }));
    let (number, _) = event(&served, 0, "executing");
    std::thread::sleep(Duration::from_millis(300));
    // A Pause works without a token and without a lease.
    assert_eq!(served.get("POST /api/pause").0, 200);
    let (_, halt) = event(&served, number, "halt");
    assert_eq!(halt["command"], "pause");
    let (status, denied) = anna.ask("POST /api/resume", None);
    assert!(
        status == 409 && denied["message"].as_str().is_some_and(|m| m.contains("has stopped")),
        "{denied}"
    );
    assert_eq!(served.get("POST /api/stop").0, 200);
    let done = anna.over(job);
    assert_eq!((done["stage"].as_str(), done["runs"].as_u64()), (Some("stopped"), Some(0)), "{done}");
    assert!(!moves(&served));
}

/// If a Stop arrives before the arm has begun to move, the arm does not move.
#[test]
fn a_run_that_was_stopped_before_it_moves_does_not_begin() {
    let served = Served::start(57_600);
    trajectory(&served, 1, 10.0);
    let anna = Program::new(&served, "anna", 30.0, "continue");
    anna.recover();
    let job = anna.begin("POST /api/runs", json!({ "trajectory": 1 }));
    event(&served, 0, "checked");
    assert_eq!(anna.ask("POST /api/stop", None).0, 200);
    let done = anna.over(job);
    assert_eq!(done["stage"], "stopped", "{done}");
    let (_, all) = served.api(&format!("GET /api/events?job={job}"), None, None);
    assert!(
        all["events"].as_array().expect("events").iter().all(|e| e["event"]["kind"] != "executing"),
        "{all}"
    );
}

#[test]
fn a_program_that_goes_leaves_its_motion_to_its_policy() {
    let served = Served::start(921_600);
    trajectory(&served, 1, 15.0);
    for (policy, stage, left) in
        [("continue", "finished", None), ("stop", "stopped", None), ("pause", "running", Some("Pause"))]
    {
        let anna = Program::new(&served, "anna", 1.0, policy);
        // The policy of the previous client may have stopped or paused the arm. During the hold-off after that, the
        // agent refuses a jog, so the test repeats the jog until the hold-off ends.
        let halted =
            || anna.ask("POST /api/jog", Some(json!({ "rates_rad_s": ([0.0; 6]) }))).1["code"] == "denied";
        while halted() {
            std::thread::sleep(Duration::from_millis(700));
        }
        anna.recover();
        let last = served.api("GET /api/status", None, None).1["last_event"].as_u64().expect("a number");
        let job = anna.begin("POST /api/runs", json!({ "trajectory": 1, "approach": true }));
        event(&served, last, "executing");
        // The program sends no more requests. The test itself sends only requests that do not renew the program's
        // lease.
        let ended = || served.api(&format!("GET /api/jobs/{job}"), None, None).1;
        let paused =
            || served.line.with(|line, _| line.status().map(|(_, s)| s.trajectory.name().to_owned()));
        until(format_args!("what {policy} does"), || {
            ended()["stage"] != "running" || (left.is_some() && paused().as_deref() == left)
        });
        assert_eq!(ended()["stage"], stage, "{policy}: {}", ended());
        let (_, status) = served.api("GET /api/status", None, None);
        assert!(status["lease"].is_null(), "{policy}: {status}");
    }
}

#[test]
fn the_lease_is_asked_for_given_and_lapses() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 30.0, "continue");
    let (status, denied) = served.api("POST /api/lease", None, Some(json!({ "name": "bob" })));
    assert!(status == 409 && denied["message"].as_str().is_some_and(|m| m.contains("anna")), "{denied}");
    let (status, grant) =
        served.api("POST /api/lease", None, Some(json!({ "name": "bob", "ask": true, "lasts_s": 1.0 })));
    assert_eq!((status, grant["held"].as_bool()), (200, Some(false)));
    let bob = Program { served: &served, key: grant["key"].as_str().expect("a key").to_owned() };
    let (_, state) = anna.ask("PUT /api/lease", None);
    assert_eq!((state["held"].as_bool(), state["wanted_by"].as_str()), (Some(true), Some("bob")));
    assert_eq!(bob.ask("PUT /api/lease", None).1["held"], false);
    assert_eq!(anna.ask("DELETE /api/lease", None).0, 204);
    assert_eq!(bob.ask("PUT /api/lease", None).1["held"], true);
    // When the lease has expired, another client receives the lease.
    std::thread::sleep(Duration::from_millis(1300));
    let carl = Program::new(&served, "carl", 30.0, "continue");
    assert_eq!(bob.ask("PUT /api/lease", None).1["held"], false);
    assert_eq!(bob.ask("POST /api/gripper", Some(json!({ "on": true }))).0, 409);
    assert_eq!(carl.ask("POST /api/gripper", Some(json!({ "on": true }))).0, 204);
}

#[test]
fn who_may_look_changes_nothing_and_what_is_wrong_is_named() {
    let served = Served::start(921_600);
    let as_viewer =
        |request: &str, body: Option<Value>| served.api_as(Some(&served.tokens.viewer), request, None, body);
    assert_eq!(as_viewer("POST /api/lease", Some(json!({ "name": "eve" }))).0, 403);
    let text = json!({ "name": "x", "text": there_and_back(10.0) });
    assert_eq!(as_viewer("PUT /api/trajectories/1", Some(text)).0, 403);
    assert_eq!(as_viewer("GET /api/trajectories", None).1, json!([]));
    for request in
        ["GET /api/status", "GET /api/info", "GET /api/payload", "GET /api/jobs", "GET /api/events"]
    {
        assert_eq!(as_viewer(request, None).0, 200, "{request}");
    }
    // A request with a wrong key is refused. A request with the right key but without the token of the operator is also refused.
    let anna = Program::new(&served, "anna", 30.0, "continue");
    for (token, key) in [(&served.tokens.operator, "x"), (&served.tokens.viewer, anna.key.as_str())] {
        let (status, error) = served.api_as(Some(token), "POST /api/clear", Some(key), None);
        assert!(status == 403 && error["next"].as_str().is_some_and(|next| !next.is_empty()), "{error}");
    }
    let (status, error) =
        served.api("PUT /api/trajectories/1", None, Some(json!({ "name": "x", "text": "t,q1\n0,a" })));
    assert!(
        status == 422 && error["message"].as_str().is_some_and(|m| m.contains("line")),
        "{status} {error}"
    );
    // The error of a trajectory contains joint, point, value and limit as numbers.
    let far = "t,q1,q2,q3,q4,q5,q6\n0,0,9,0,0,0,0\n1,0,9,0,0,0,0\n";
    assert_eq!(
        served.api("PUT /api/trajectories/2", None, Some(json!({ "name": "far", "text": far }))).0,
        200
    );
    anna.recover();
    // A check and a plan each report the joint, its value and the limit.
    for (request, body, code) in [
        ("POST /api/runs", json!({ "trajectory": 2 }), "check"),
        ("POST /api/moves", json!({ "to_rad": [0.0, 9.0, 0.0, 0.0, 0.0, 0.0] }), "plan"),
    ] {
        let job = anna.begin(request, body);
        let done = anna.over(job);
        let error = &done["error"];
        assert_eq!(
            (done["stage"].as_str(), error["code"].as_str(), error["joint"].as_u64()),
            (Some("failed"), Some(code), Some(2)),
            "{done}"
        );
        assert!(
            error["value"].as_f64().zip(error["limit"].as_f64()).is_some_and(|(value, limit)| value > limit),
            "{error}"
        );
        assert!(error["cause"].as_str().is_some_and(|cause| !cause.is_empty()), "{error}");
    }
}

#[test]
fn behind_somebody_elses_stop_nothing_is_begun_for_three_seconds() {
    let served = Served::start(115_200);
    trajectory(&served, 1, 5.0);
    let anna = Program::new(&served, "anna", 30.0, "continue");
    anna.recover();
    assert_eq!(served.get("POST /api/stop").0, 200);
    let zeros = [0.0; 6];
    for (request, body) in [
        ("POST /api/runs", json!({ "trajectory": 1 })),
        ("POST /api/moves", json!({ "to_rad": zeros })),
        ("POST /api/jog", json!({ "rates_rad_s": zeros })),
        ("POST /api/teach", json!({ "on": true })),
        ("POST /api/recover", json!({})),
    ] {
        let (status, denied) = anna.ask(request, Some(body));
        assert_eq!((status, denied["code"].as_str()), (409, Some("denied")), "{request}: {denied}");
    }
    // The hold-off also applies after a reconnect. Repeated jog requests extend the hold-off; other repeated requests
    // do not.
    assert_eq!(anna.ask("DELETE /api/lease", None).0, 204);
    let anna = Program::new(&served, "anna", 30.0, "continue");
    let asked = Instant::now();
    // Repeated jog requests, as from a key that stays pressed, extend the hold-off.
    while asked.elapsed() < Duration::from_secs(5) {
        assert_eq!(anna.ask("POST /api/jog", Some(json!({ "rates_rad_s": zeros }))).0, 409);
        std::thread::sleep(Duration::from_millis(50));
    }
    assert_eq!(served.get("POST /api/stop").0, 200);
    until("the end of the hold-off", || anna.ask("POST /api/recover", Some(json!({}))).0 != 409);
    assert!(!moves(&served));
}

#[test]
fn a_speed_that_is_none_is_refused_and_one_that_is_shows_in_the_motion() {
    let served = Served::start(921_600);
    trajectory(&served, 1, 10.0);
    let anna = Program::new(&served, "anna", 30.0, "continue");
    anna.recover();
    let job = anna.begin("POST /api/runs", json!({ "trajectory": 1 }));
    event(&served, 0, "executing");
    for percent in [0, 4, 101] {
        assert_eq!(anna.ask("PUT /api/speed", Some(json!({ "percent": percent }))).0, 422);
    }
    let (_, denied) = anna.ask("POST /api/resume", None);
    assert_eq!(denied["code"], "not-paused", "{denied}");
    let point = || served.line.with(|line, _| line.status().map_or(0, |(_, status)| status.point));
    assert_eq!(anna.ask("PUT /api/speed", Some(json!({ "percent": 10 }))).0, 204);
    std::thread::sleep(Duration::from_millis(500));
    let (began, from) = (Instant::now(), point());
    std::thread::sleep(Duration::from_secs(1));
    let way = f64::from(point() - from) / 1000.0 / began.elapsed().as_secs_f64();
    assert!(way < 0.3, "{way} of its speed");
    assert_eq!(served.get("POST /api/stop").0, 200);
    assert_eq!(anna.over(job)["stage"], "stopped");
}

#[test]
fn an_arm_in_motion_is_recovered_and_the_policy_of_one_run_is_that_of_one_run() {
    let served = Served::start(921_600);
    trajectory(&served, 1, 20.0);
    let anna = Program::new(&served, "anna", 1.5, "stop");
    anna.recover();
    let job = anna.begin("POST /api/runs", json!({ "trajectory": 1, "policy": "continue" }));
    assert_eq!(anna.over(job)["stage"], "finished");
    let last = served.api("GET /api/status", None, None).1["last_event"].as_u64().expect("a number");
    let job = anna.begin("POST /api/runs", json!({ "trajectory": 1 }));
    event(&served, last, "executing");
    assert_eq!(over(&served, job, || {})["stage"], "stopped", "by its lease's own policy");
    // A client without the lease pauses bob's run, and the Stop of bob then ends the run.
    std::thread::sleep(Duration::from_secs(3));
    let bob = Program::new(&served, "bob", 30.0, "continue");
    let job = bob.begin("POST /api/runs", json!({ "trajectory": 1, "approach": true }));
    let last = served.api("GET /api/status", None, None).1["last_event"].as_u64().expect("a number");
    event(&served, last, "moving");
    drop(served.get("POST /api/pause"));
    std::thread::sleep(Duration::from_secs(4));
    assert_eq!(served.api("GET /api/jobs", None, None).1.as_array().map(|jobs| jobs.is_empty()), Some(false));
    assert_eq!(bob.ask("POST /api/stop", None).0, 200);
    assert_eq!(bob.over(job)["stage"], "stopped");
    bob.recover();
}

#[test]
fn a_program_that_is_begun_again_and_again_keeps_nobody_out() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    for n in 0..40 {
        let (status, grant) =
            served.api("POST /api/lease", None, Some(json!({ "name": "again", "ask": true })));
        if n == 0 {
            assert_eq!((status, grant["held"].as_bool()), (200, Some(false)), "{grant}");
        } else {
            // The first client is still waiting for the lease, so the agent refuses this request.
            assert_eq!((status, grant["code"].as_str()), (409, Some("denied")), "{grant}");
            assert!(
                grant["message"]
                    .as_str()
                    .is_some_and(|m| m.contains("again already waits for the lease of anna"))
            );
        }
    }
    assert_eq!(anna.ask("PUT /api/lease", None).1["held"], true);
    assert_eq!(served.api("POST /api/lease", None, Some(json!({ "name": "x", "lasts_s": 61 }))).0, 422);
}

#[test]
fn numbers_at_the_end_of_all_numbers_are_answered() {
    let served = Served::start(921_600);
    let last = u64::MAX;
    let (status, found) = served.api(&format!("GET /api/events?after={last}"), None, None);
    assert_eq!((status, found["events"].clone()), (200, json!([])));
    assert_eq!(served.api(&format!("GET /api/jobs/{last}"), None, None).0, 404);
}
