//! Tests of the data for the dashboard: arm parameters, trajectory points, commands, explanations of codes, and reports.
use crate::common;

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use common::Served;
use common::program::{Program, event};
use jtc_host::port::sim::LivePort;
use jtc_host::{Arm, Port, PortError, explain, plan};
use jtc_sim::{Fault, FaultKind, FaultPlan, SimConfig, Trigger, World};
use jtc_wire::Joint;
use serde_json::{Value, json};
use test_kit::patience::{Patience, until};

const ZERO: [f64; 6] = [0.0; 6];

/// Returns the text of a trajectory file with a motion from the zero pose to another pose at half of the limits.
fn there() -> String {
    let way = plan::joint_move(&[0.0; 6], &[0.4, -0.2, 0.3, 0.0, 0.2, 0.1], &Arm::avena().config(), 50.0);
    way.expect("it is within the limits").to_exact_csv()
}

fn keep(served: &Served, number: u16) {
    let body = json!({ "name": "there", "text": there() });
    let (status, kept) = served.api(&format!("PUT /api/trajectories/{number}"), None, Some(body));
    assert_eq!(status, 200, "{kept}");
}

fn look(served: &Served, request: &str) -> (u16, Value) {
    served.api_as(Some(&served.tokens.viewer), request, None, None)
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    serde_json::from_value::<Vec<f64>>(value.clone()).expect("numbers").try_into().expect("so many")
}

/// A port that counts the bytes to the controller.
struct Counted(LivePort, Arc<AtomicU64>);

impl Port for Counted {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, PortError> {
        self.0.read(buffer, timeout)
    }

    fn write_all(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.1.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        self.0.write_all(bytes)
    }

    fn now(&self) -> Duration {
        self.0.now()
    }

    fn baud(&self) -> Option<u32> {
        self.0.baud()
    }
}

/// Waits until the agent has read the arm from the controller, and returns this arm.
fn model(served: &Served) -> Value {
    let mut patience = Patience::begin();
    loop {
        let (status, model) = look(served, "GET /api/arm/model");
        assert_eq!(status, 200, "{model}");
        if model["source"] == "controller" {
            return model;
        }
        assert_eq!(model["source"], "agent", "{model}");
        patience.pause(format_args!("the controller's arm: {model}"));
    }
}

#[test]
fn the_arm_is_shown_as_numbers_without_a_question_for_each_who_looks() {
    let sent = Arc::new(AtomicU64::new(0));
    let served = Served::start_on(Counted(common::simulated(921_600), sent.clone()), None, &[]);
    let shown = model(&served);
    let arm = Arm::avena();
    assert_eq!(
        (&shown["name"], &shown["hash"]),
        (&json!("avena"), &look(&served, "GET /api/info").1["hash"])
    );
    let joints = shown["joints"].as_array().expect("joints");
    assert_eq!((joints.len(), shown["links"].as_array().map(Vec::len)), (6, Some(7)));
    for (j, joint) in joints.iter().enumerate() {
        let (limits, frame) = (&arm.joints[j], &arm.model.joints[j]);
        assert_eq!(
            (joint["joint"].as_u64(), joint["name"].as_str()),
            (Some(j as u64 + 1), Some(&*arm.joint_names[j]))
        );
        for (name, value) in [
            ("position_min_rad", limits.position_min),
            ("position_max_rad", limits.position_max),
            ("velocity_max_rad_s", limits.velocity_max),
            ("acceleration_max_rad_s2", limits.acceleration_max),
            ("torque_max_nm", limits.torque_max),
        ] {
            assert!((joint[name].as_f64().expect(name) - value).abs() < 1e-6, "{name}: {joint}");
        }
        assert!((numbers::<3>(&joint["origin_xyz_m"])[2] - frame.xyz[2]).abs() < 1e-6);
        assert!((numbers::<3>(&joint["origin_rpy_rad"])[0] - frame.rpy[0]).abs() < 1e-6);
    }
    let flange = numbers::<3>(&shown["flange"]["origin_xyz_m"]);
    assert!((flange[2] - arm.model.joints[6].xyz[2]).abs() < 1e-6, "{flange:?}");
    assert!((numbers::<3>(&shown["gravity_m_s2"])[2] + 9.81).abs() < 0.01, "{shown}");
    let mass = |shown: &Value, n: usize| shown["links"][n]["mass_kg"].as_f64().expect("a mass");
    assert!((0..7).all(|n| (mass(&shown, n) - arm.model.links[n].mass).abs() < 1e-6), "{shown}");
    let com = numbers::<3>(&shown["links"][2]["com_xyz_m"]);
    assert!(com.iter().zip(&arm.model.links[2].origin.xyz).all(|(a, b)| (a - b).abs() < 1e-6));

    let before = sent.load(Ordering::Relaxed);
    (0..100).for_each(|_| assert_eq!(model(&served), shown));
    let asked = sent.load(Ordering::Relaxed) - before;
    assert!(asked < 1000, "{asked} bytes for a hundred who look within some seconds");

    // The agent shows a changed arm at once, before its next regular request to the controller.
    let anna = Program::new(&served, "anna", 60.0, "continue");
    let slow = json!({ "settings": [{ "name": "velocity_max_rad_s", "joint": 2, "value": 0.25 }] });
    assert_eq!(anna.ask("PUT /api/settings", Some(slow)).0, 204);
    let end = Instant::now() + Duration::from_secs(8);
    let now = loop {
        let now = model(&served);
        if now["hash"] != shown["hash"] {
            break now;
        }
        assert!(Instant::now() < end, "it stays: {now}");
    };
    assert_eq!(now["joints"][1]["velocity_max_rad_s"], 0.25, "{now}");
    assert_eq!(now["hash"], look(&served, "GET /api/info").1["hash"]);
}

#[test]
fn a_trajectory_is_thinned_evenly_and_its_ends_stay() {
    let served = Served::start(921_600);
    keep(&served, 7);
    let whole = look(&served, "GET /api/trajectories/7/points?most=2000").1;
    let all = whole["positions_rad"].as_array().expect("points");
    let (count, duration) = (all.len(), whole["duration_s"].as_f64().expect("a number"));
    assert!(count > 60 && whole["times_s"].as_array().map(Vec::len) == Some(count), "{count}");
    assert_eq!(numbers::<6>(&all[count - 1]), [0.4, -0.2, 0.3, 0.0, 0.2, 0.1]);
    for most in [2, 3, 50] {
        let (status, few) = look(&served, &format!("GET /api/trajectories/7/points?most={most}"));
        let (points, times) = (few["positions_rad"].as_array(), few["times_s"].as_array());
        let (points, times) = (points.expect("points"), times.expect("times"));
        assert_eq!(
            (status, points.len(), times.len(), few["name"].as_str()),
            (200, most, most, Some("there"))
        );
        assert_eq!((&points[0], &points[most - 1]), (&all[0], &all[count - 1]));
        let times: Vec<f64> = times.iter().filter_map(Value::as_f64).collect();
        assert_eq!((times[0], times[most - 1]), (0.0, duration));
        let even = duration / (most - 1) as f64;
        let step = duration / (count - 1) as f64;
        assert!(times.windows(2).all(|two| (two[1] - two[0] - even).abs() <= step + 1e-9), "{times:?}");
    }
    let shown = look(&served, "GET /api/trajectories/7/points").1;
    assert_eq!(shown["times_s"].as_array().map(Vec::len), Some(count.min(500)));
    for (most, limit) in [(1, 2.0), (2001, 2000.0)] {
        let (status, error) = look(&served, &format!("GET /api/trajectories/7/points?most={most}"));
        assert_eq!((status, &error["value"], &error["limit"]), (422, &json!(f64::from(most)), &json!(limit)));
    }
    assert_eq!(look(&served, "GET /api/trajectories/7/points?most=x").0, 400);
    assert_eq!(look(&served, "GET /api/trajectories/8/points").0, 404);
}

#[test]
fn codes_are_explained_by_name_number_and_words() {
    let served = Served::start(921_600);
    let all = look(&served, "GET /api/explain").1;
    let all = all.as_array().expect("pages");
    assert_eq!(all.len(), explain::pages().count());
    for page in explain::pages() {
        let (status, shown) = look(&served, &format!("GET /api/explain/{}", page.name));
        assert_eq!((status, shown["code"].as_str()), (200, Some(page.name)), "{shown}");
        assert_eq!(shown["text"], page.to_string());
        assert!(shown["also"].is_null() && all.contains(&shown), "{shown}");
    }
    for (asked, in_plain) in [
        ("HoldPos", "HoldPos"),
        ("can:0x400", "can:0x400"),
        ("joint%203%3A%20over-current", "joint 3: over-current"),
    ] {
        let shown = look(&served, &format!("GET /api/explain/{asked}")).1;
        assert_eq!(shown["code"], explain::find(in_plain)[0].name, "{shown}");
    }
    let several = look(&served, "GET /api/explain/jtc:0x12").1;
    assert_eq!(several["also"].as_array().map(Vec::len), Some(1), "{several}");
    let (status, error) = look(&served, "GET /api/explain/no-such-thing");
    assert!(
        status == 404 && error["message"].as_str().is_some_and(|m| m.contains("no-such-thing")),
        "{error}"
    );
}

/// If a run fails in the middle, the agent has explanation pages for its errors and shows the commanded values. The
/// report of the run begins with the first failure.
#[test]
fn a_run_that_fails_has_pages_for_its_errors_and_a_report_and_so_has_one_that_goes_well() {
    let arm = Arm::avena();
    let stuck = FaultKind::Friction { joint: Joint::ALL[2], factor: 100.0 };
    let fault = Fault { kind: stuck, trigger: Trigger::AtPoint(200), duration_ms: Some(500) };
    let faults = FaultPlan { faults: vec![fault], ..FaultPlan::default() };
    let config = SimConfig { baud: Some(921_600), faults, ..SimConfig::new(arm.config(), &arm.parameters()) };
    let served = Served::start_on(LivePort::new(World::new(config)), None, &[]);
    keep(&served, 7);
    let anna = Program::new(&served, "anna", 60.0, "continue");
    let recovered = anna.begin("POST /api/recover", json!({ "defaults": true }));
    assert!(anna.over(recovered)["report"].is_null());
    let report = |job: u64| look(&served, &format!("GET /api/jobs/{job}/report"));
    assert_eq!((report(recovered).0, report(99).0), (404, 404));
    let controller = || look(&served, "GET /api/status").1["controller"].clone();
    assert!(controller()["commanded_rad"].is_null() && controller()["error_codes"] == json!([]));

    let job = anna.begin("POST /api/runs", json!({ "trajectory": 7 }));
    event(&served, 0, "executing");
    let (status, error) = report(job);
    assert_eq!((status, error["code"].as_str()), (409, Some("busy")), "{error}");
    let failed = anna.over(job);
    assert_eq!(failed["stage"], "failed", "{failed}");
    let now = controller();
    let (errors, codes) =
        (now["errors"].as_array().expect("errors"), now["error_codes"].as_array().expect("codes"));
    assert!(!errors.is_empty() && errors.len() == codes.len(), "{now}");
    assert!(codes.contains(&json!("internal-joint-error")), "{now}");
    let third = &now["joints"][2];
    assert_eq!(third["error_codes"], json!(["joint-torque"]), "{now}");
    assert!(now["causes"][0] == "joint 3: torque over limit", "{now}");
    for (words, code) in errors.iter().zip(codes).chain([(&third["errors"][0], &third["error_codes"][0])]) {
        let page = look(&served, &format!("GET /api/explain/{}", code.as_str().expect("a code"))).1;
        assert_eq!(&page["title"], words, "{page}");
    }
    let page = |job: &Value| {
        let path = job["report"].as_str().expect("a report");
        assert_eq!(path, format!("/api/jobs/{}/report", job["number"]));
        let (status, head, body) = served.bytes_as(Some(&served.tokens.viewer), &format!("GET {path}"));
        let head = head.to_ascii_lowercase();
        assert_eq!(status, 200, "{head}");
        for line in ["content-type: text/html", "content-security-policy: sandbox", "nosniff"] {
            assert!(head.contains(line), "{line} in {head}");
        }
        String::from_utf8(body).expect("text")
    };
    let broken = page(&failed);
    assert!(
        broken.contains("<title>FAILED: run of trajectory 7, there")
            && broken.contains("joint 3: torque over limit")
    );

    // The next run succeeds.
    anna.recover();
    let (after, _) = event(&served, 0, "ended");
    let job = anna.begin("POST /api/runs", json!({ "trajectory": 7, "approach": true, "speed_percent": 50 }));
    let mut patience = Patience::begin();
    let followed = loop {
        let now = controller();
        if !now["commanded_rad"].is_null() {
            break now;
        }
        patience.pause(format_args!("a commanded position: {now}"));
    };
    let commanded = numbers::<6>(&followed["commanded_rad"]);
    for (joint, commanded) in followed["joints"].as_array().expect("joints").iter().zip(commanded) {
        let measured = joint["position_rad"].as_f64().expect("a position");
        assert!((measured - commanded).abs() < 0.03, "{followed}");
    }
    event(&served, after, "executing");
    let done = anna.over(job);
    assert_eq!(done["stage"], "finished", "{done}");
    let good = page(&done);
    assert!(
        !good.contains("FAILED") && good.contains("anna") && good.contains("\"Number\""),
        "{}",
        good.len()
    );
    // The path ends before the arm has settled. Until it has settled, the controller commands the end point of the
    // path.
    until("nothing is commanded", || controller()["commanded_rad"].is_null());

    // A stopped motion also has a report, and earlier reports are kept.
    let job = anna.begin("POST /api/moves", json!({ "to_rad": ZERO, "speed_percent": 20 }));
    event(&served, event(&served, 0, "executing").0, "finished");
    until("Operate", || controller()["state"] == "Operate");
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(anna.ask("POST /api/stop", None).0, 200);
    let stopped = anna.over(job);
    assert_eq!(stopped["stage"], "stopped", "{stopped}");
    assert!(page(&stopped).contains("\"stopped\""));
    assert_eq!(page(&failed), broken);
}
