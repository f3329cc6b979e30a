//! Tests that a run executes the trajectory that the user saw, and that a request with `new` = `true` replaces no
//! stored trajectory.
use crate::common;

use common::Served;
use common::program::Program;
use serde_json::{Value, json};

/// Returns the text of a trajectory file with a short motion of the base joint by `far_rad` and back.
fn sway(far_rad: f64) -> String {
    let rows = (0..=200).map(|i| {
        let t = f64::from(i) * 0.01;
        let q = far_rad * (1.0 - (std::f64::consts::PI * t).cos()) / 2.0;
        format!("{t},{q},0,0,0,0,0\n")
    });
    format!("t,q1,q2,q3,q4,q5,q6\n{}", rows.collect::<String>())
}

/// Stores a trajectory.
fn put(served: &Served, place: &str, name: &str, far_rad: f64) -> (u16, Value) {
    let body = json!({ "name": name, "text": sway(far_rad) });
    served.api(&format!("PUT /api/trajectories/{place}"), None, Some(body))
}

fn digest(object: &Value) -> String {
    object["digest"].as_str().unwrap_or_else(|| panic!("a digest in {object}")).to_owned()
}

fn get(served: &Served, request: &str) -> Value {
    let (status, object) = served.api(&format!("GET {request}"), None, None);
    assert_eq!(status, 200, "{object}");
    object
}

#[test]
fn a_trajectory_that_was_replaced_since_it_was_looked_at_is_not_run() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    anna.recover();
    let (status, kept) = put(&served, "7", "small", 0.1);
    assert_eq!(status, 200, "{kept}");
    let seen = digest(&kept);
    // All responses contain the same digest.
    assert_eq!(digest(&get(&served, "/api/trajectories")[0]), seen);
    assert_eq!(digest(&get(&served, "/api/trajectories/7/points?most=2")), seen);
    let check = get(&served, "/api/trajectories/7/check");
    assert_eq!((digest(&check), &check["passed"]), (seen.clone(), &json!(true)), "{check}");
    let run = |digest: &str| anna.ask("POST /api/runs", Some(json!({ "trajectory": 7, "digest": digest })));
    let jobs = || get(&served, "/api/jobs").as_array().map(Vec::len);

    // Another client replaces the trajectory.
    let (status, other) = put(&served, "7", "large", 0.4);
    assert_eq!(status, 200, "{other}");
    let before = jobs();
    for wrong in [seen.as_str(), "", "0000000000000000"] {
        let (status, error) = run(wrong);
        assert_eq!((status, error["code"].as_str()), (409, Some("replaced")), "{error}");
        assert!(error["message"].as_str().is_some_and(|m| m.contains("large")), "{error}");
        assert!(error["next"].as_str().is_some_and(|n| n.contains("/api/trajectories/7/points")), "{error}");
    }
    assert_eq!(jobs(), before, "nothing was begun");
    let (status, job) = run(&digest(&other));
    assert_eq!(status, 202, "{job}");
    assert_eq!(anna.over(job["number"].as_u64().expect("a number"))["stage"], "finished");
    // Trajectories with equal points have equal digests, even if their names differ. A run request without a digest
    // executes the stored trajectory.
    assert_eq!(digest(&put(&served, "7", "small again", 0.1).1), seen);
    let (status, job) =
        anna.ask("POST /api/runs", Some(json!({ "trajectory": 7, "approach": true, "digest": seen })));
    assert_eq!(status, 202, "{job}");
    assert_eq!(anna.over(job["number"].as_u64().expect("a number"))["stage"], "finished");
    let job = anna.begin("POST /api/runs", json!({ "trajectory": 7, "approach": true }));
    assert_eq!(anna.over(job)["stage"], "finished");
}

/// J-55: a run on an invalid trajectory moves no joint, even if an approach to the first point is possible.
#[test]
fn j55_no_approach_leads_to_a_trajectory_that_the_check_refuses() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    anna.recover();
    let away = anna
        .begin("POST /api/moves", json!({ "to_rad": [0.3, 0.2, -0.3, 0.0, 0.0, 0.0], "speed_percent": 100 }));
    assert_eq!(anna.over(away)["stage"], "finished");
    let place = || {
        get(&served, "/api/status")["controller"]["joints"][1]["position_rad"].as_f64().expect("a position")
    };
    let before = place();
    // The trajectory exceeds the velocity limit of the base joint. The agent stores it, but the check before the run
    // refuses it.
    assert_eq!(put(&served, "7", "too fast", 2.6).0, 200);
    let job = anna.begin("POST /api/runs", json!({ "trajectory": 7, "approach": true }));
    let ended = anna.over(job);
    assert_eq!((&ended["stage"], &ended["runs"]), (&json!("failed"), &json!(0)), "{ended}");
    assert!(
        ended["error"]["message"].as_str().is_some_and(|m| m.contains("velocity over its limit")),
        "{ended}"
    );
    assert!((place() - before).abs() < 2e-3, "{} after {before}", place());
    assert_eq!(put(&served, "7", "slow enough", 0.4).0, 200);
    let job = anna.begin("POST /api/runs", json!({ "trajectory": 7, "approach": true }));
    assert_eq!(anna.over(job)["stage"], "finished");
}

#[test]
fn what_is_new_replaces_nothing() {
    let served = Served::start(921_600);
    let (status, kept) = put(&served, "7?new=true", "mine", 0.1);
    assert_eq!(status, 200, "{kept}");
    let (status, error) = put(&served, "7?new=true", "yours", 0.2);
    assert_eq!((status, error["code"].as_str()), (409, Some("taken")), "{error}");
    assert!(error["message"].as_str().is_some_and(|m| m.contains("mine")), "{error}");
    let two = "q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0\n0.4,0.2,-0.3,0,0.2,0\n";
    let plan = |number: u16, new: bool| {
        let keep = json!({ "number": number, "name": "planned", "new": new });
        served.api("POST /api/plans", None, Some(json!({ "waypoints": two, "keep": keep })))
    };
    let (status, error) = plan(7, true);
    assert_eq!((status, error["code"].as_str()), (409, Some("taken")), "{error}");
    assert_eq!(digest(&get(&served, "/api/trajectories")[0]), digest(&kept));
    assert_eq!(put(&served, "7?new=perhaps", "yours", 0.2).0, 400);
    // With `new` = `true`, a plan can be stored only under a free number. With `new` = `false`, a request replaces the
    // trajectory under a used number.
    let (status, planned) = plan(8, true);
    assert_eq!(status, 200, "{planned}");
    assert_eq!(digest(&planned["kept"]), digest(&get(&served, "/api/trajectories/8/points")));
    assert_eq!((put(&served, "8?new=false", "yours", 0.2).0, plan(7, false).0), (200, 200));
    let list = get(&served, "/api/trajectories");
    let names: Vec<Option<&str>> =
        list.as_array().expect("a list").iter().map(|one| one["name"].as_str()).collect();
    assert_eq!(names, [Some("planned"), Some("yours")]);
}
