//! Tests of moves by HTTP to joint positions, to a named pose, and to a flange pose. Some moves are straight lines of
//! the flange.
use crate::common;

use common::Served;
use common::program::{Program, event};
use serde_json::{Value, json};

/// Distance of the downward move of the flange, m.
const DOWN: f64 = 0.2;

fn positions(served: &Served) -> Vec<f64> {
    let status = served.api("GET /api/status", None, None).1;
    let joints = status["controller"]["joints"].as_array().expect("joints").clone();
    joints.iter().map(|joint| joint["position_rad"].as_f64().expect("a position")).collect()
}

fn is_at(served: &Served, place: [f64; 6]) {
    let at = positions(served);
    assert!(at.iter().zip(place).all(|(at, to)| (at - to).abs() < 0.01), "{at:?}");
}

#[test]
fn a_move_leads_to_positions_a_named_pose_or_a_pose_of_the_flange() {
    let served = Served::start(921_600);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    anna.recover();
    let moved = |body: Value| {
        let job = anna.begin("POST /api/moves", body);
        let done = anna.over(job);
        assert_eq!(done["stage"], "finished", "{done}");
        done
    };
    let bent = [0.2, 0.4, -0.5, 0.1, 0.3, 0.0];
    let save = json!({ "positions_rad": bent });
    assert_eq!(served.api("PUT /api/poses/bent", None, Some(save)).0, 200);
    let done = moved(json!({ "to_pose": "bent" }));
    assert_eq!(done["what"], "move to bent");
    is_at(&served, bent);
    // The test itself computes the flange pose of these joint positions.
    let arm = jtc_host::Arm::avena();
    let flange = jtc_host::plan::kinematics::Kinematics::new(&arm.model, &[(-3.0, 3.0); 6]).flange(&bent);
    let rpy = jtc_host::plan::kinematics::rpy_of(&flange);
    let [x, y, z] = flange.position;
    // The flange moves down on a straight line, and the arm moves back in joint space. The closure returns the largest distance of the
    // flange from the line.
    let beside = |body: Value| {
        let job = anna.begin("POST /api/moves", body);
        let mut most = 0.0f64;
        let done = common::program::over(&served, job, || {
            let at = positions(&served).try_into().expect("six");
            let at = jtc_host::plan::kinematics::Kinematics::new(&arm.model, &[(-3.0, 3.0); 6]).flange(&at);
            most = most.max((at.position[0] - x).hypot(at.position[1] - y));
        });
        assert_eq!(done["stage"], "finished", "{done}");
        (done, most)
    };
    let down = json!({ "xyz_m": [x, y, z - DOWN], "rpy_rad": rpy });
    let (done, off_line) = beside(json!({ "to_flange": down, "line": true, "speed_percent": 30 }));
    assert!(
        done["what"].as_str().is_some_and(|w| w.starts_with("move to flange") && w.ends_with("straight")),
        "{done}"
    );
    let there = positions(&served);
    let there: [f64; 6] = there.try_into().expect("six");
    let reached = jtc_host::plan::kinematics::Kinematics::new(&arm.model, &[(-3.0, 3.0); 6]).flange(&there);
    let off: Vec<f64> = reached.position.iter().zip([x, y, z - DOWN]).map(|(a, b)| (a - b).abs()).collect();
    assert!(off.iter().all(|off| *off < 0.005), "{off:?}");
    let back = json!({ "to_flange": { "xyz_m": [x, y, z], "rpy_rad": rpy }, "speed_percent": 30 });
    let (_, off_arc) = beside(back);
    assert!(off_line < 0.002 && off_arc > 0.005, "{off_line} m, {off_arc} m");
    is_at(&served, bent);
    moved(json!({ "to_rad": [0, 0, 0, 0, 0, 0] }));

    let before = event(&served, 0, "ended").0;
    for wrong in [
        json!({}),
        json!({ "to_pose": "bent", "to_rad": bent }),
        json!({ "to_pose": "bend" }),
        json!({ "to_rad": [0, 0, 0] }),
        json!({ "to_flange": { "xyz_m": [0.3, 0, 0.3] } }),
    ] {
        let (status, error) = anna.ask("POST /api/moves", Some(wrong.clone()));
        assert!(matches!(status, 400 | 422), "{wrong}: {status} {error}");
        assert!(error["next"].as_str().is_some_and(|next| !next.is_empty()), "{error}");
    }
    let (_, error) = anna.ask("POST /api/moves", Some(json!({ "to_pose": "bend" })));
    assert!(error["message"].as_str().is_some_and(|m| m.contains("bent")), "{error}");
    // The target is out of reach. The job reports this, and no joint moves.
    let far = json!({ "to_flange": { "xyz_m": [5.0, 0.0, 0.3], "rpy_rad": [0.0, 0.0, 0.0] } });
    let failed = anna.over(anna.begin("POST /api/moves", far));
    assert_eq!(failed["stage"], "failed", "{failed}");
    assert!(failed["error"]["next"].as_str().is_some_and(|next| !next.is_empty()), "{failed}");
    is_at(&served, [0.0; 6]);
    assert!(before > 0);
}
