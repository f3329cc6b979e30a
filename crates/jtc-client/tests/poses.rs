//! Tests of named poses by HTTP. Named poses are poses of the arm file and saved poses.
use crate::common;

use common::Served;
use common::program::Program;
use jtc_agent::jobs::Store;
use jtc_host::Arm;
use jtc_host::arm::Poses;
use serde_json::{Value, json};
use test_kit::written::text_with;

const ZERO: [f64; 6] = [0.0; 6];

/// Starts an agent with an arm file that contains one pose. `directory` contains the trajectories and the saved poses.
fn served(directory: &std::path::Path) -> Served {
    let poses = Poses::from([("home".to_owned(), [0.0, 0.1, 0.0, 0.0, 0.0, 0.0])]);
    let arm = Arm { poses, ..Arm::avena() };
    let store = Store::open(directory).expect("its own files");
    Served::start_with_store(common::simulated(921_600), None, &[], store, arm)
}

fn poses(served: &Served) -> Vec<Value> {
    let (status, all) = served.api_as(Some(&served.tokens.viewer), "GET /api/poses", None, None);
    assert_eq!(status, 200, "{all}");
    all.as_array().expect("poses").clone()
}

#[test]
fn poses_are_saved_used_deleted_and_outlast_the_agent() {
    let directory = tempfile::tempdir().expect("a directory");
    let first = served(directory.path());
    let home = json!({ "name": "home", "positions_rad": [0.0, 0.1, 0.0, 0.0, 0.0, 0.0], "from": "arm file" });
    assert_eq!(poses(&first), [home]);
    let put = |name: &str, body: Option<Value>| first.api(&format!("PUT /api/poses/{name}"), None, body);
    let above = json!({ "positions_rad": [0.2, 0.1, 0.1234564, 0.0, 0.0, 0.0] });
    let (status, saved) = put("above-table", Some(above.clone()));
    assert_eq!(status, 200, "{saved}");
    assert_eq!((&saved["from"], &saved["positions_rad"][2]), (&json!("agent"), &json!(0.123456)), "{saved}");
    assert!(saved["warning"].is_null(), "{saved}");
    // A pose that the arm cannot reach causes a warning but is saved, because the limits may be wrong.
    let (_, far) = put("far", Some(json!({ "positions_rad": [0, 2, 0, 0, 0, 0] })));
    assert!(far["warning"].as_str().is_some_and(|w| w.contains("joint 2: 2 rad is outside")), "{far}");
    // A pose without positions saves the current position of the arm, which is known only after the recovery. While
    // the arm moves, the agent refuses this request.
    let anna = Program::new(&first, "anna", 60.0, "continue");
    anna.recover();
    let job = anna
        .begin("POST /api/moves", json!({ "to_rad": [0.3, 0.0, 0.0, 0.0, 0.0, 0.0], "speed_percent": 20 }));
    common::program::event(&first, 0, "executing");
    std::thread::sleep(std::time::Duration::from_millis(300));
    let (status, error) = put("here", None);
    assert_eq!((status, error["code"].as_str()), (409, Some("moving")), "{error}");
    assert_eq!(anna.over(job)["stage"], "finished");
    for body in [None, Some(json!({}))] {
        let (status, here) = put("here", body);
        assert_eq!(status, 200, "{here}");
        let first_joint = here["positions_rad"][0].as_f64().expect("a number");
        assert!((first_joint - 0.3).abs() < 0.01, "{here}");
    }
    // A plan can use a pose of the arm file and a saved pose.
    let through = json!({ "waypoints": "pose\nhome\nabove-table\n" });
    assert_eq!(first.api("POST /api/plans", None, Some(through)).0, 200);
    text_with(&first.log, &["\"what\":\"pose\"", "above-table"]);
    drop(first);

    let again = served(directory.path());
    let names: Vec<Value> = poses(&again).iter().map(|pose| pose["name"].clone()).collect();
    assert_eq!(names, ["above-table", "far", "here", "home"]);
    assert_eq!(again.api("DELETE /api/poses/far", None, None).0, 204);
    assert_eq!(again.api("DELETE /api/poses/far", None, None).0, 404);
    assert_eq!(poses(&again).len(), 3);
    assert_eq!(Store::open(directory.path()).expect("its own files").poses.list().len(), 2);
}

#[test]
fn what_is_no_pose_and_who_is_no_operator_changes_nothing() {
    let directory = tempfile::tempdir().expect("a directory");
    let served = served(directory.path());
    let body = json!({ "positions_rad": ZERO });
    for (request, body) in [("PUT /api/poses/up", Some(body.clone())), ("DELETE /api/poses/home", None)] {
        for token in [Some(&served.tokens.viewer), None] {
            let (status, error) = served.api_as(token, request, None, body.clone());
            assert_eq!(status, 403, "{request}: {error}");
        }
    }
    for name in ["1", "a%20b", "-x", "nan", &"a".repeat(65), "%0A"] {
        let (status, error) = served.api(&format!("PUT /api/poses/{name}"), None, Some(body.clone()));
        assert_eq!((status, error["code"].as_str()), (422, Some("pose-name")), "{name}: {error}");
    }
    for request in ["PUT /api/poses/home", "DELETE /api/poses/home"] {
        let (status, error) = served.api(request, None, Some(body.clone()));
        assert_eq!((status, error["code"].as_str()), (409, Some("read-only")), "{error}");
        assert!(error["next"].as_str().is_some_and(|next| !next.is_empty()));
    }
    let nowhere = json!({ "positions_rad": [0, 0, 0, 1e300, 0, 0] });
    let (status, error) = served.api("PUT /api/poses/up", None, Some(nowhere));
    assert_eq!((status, &error["joint"], &error["limit"]), (422, &json!(4), &json!(100.0)), "{error}");
    for wrong in [json!({ "positions_rad": [0, 0, 0] }), json!({ "position_rad": ZERO })] {
        assert!(matches!(served.api("PUT /api/poses/up", None, Some(wrong)).0, 400 | 422));
    }
    assert_eq!(poses(&served).len(), 1);
    assert!(!directory.path().join("poses.json").exists());
}
