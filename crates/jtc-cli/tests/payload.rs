//! Tests of `jtc payload`, which sets the payload of the arm (J-60).

use crate::common;

use common::{Sim, jtc, moving_while};
use serde_json::Value;

/// Trajectory file whose motion ends in a bent pose, in which shoulder and elbow carry the payload.
const BENT: &str = "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n1.5,0,0.35,0.3,0,0.3,0\n3,0,0.7,0.6,0,0.6,0\n";

/// Returns a trajectory file whose motion ends in a stretched pose.
fn stretched() -> String {
    BENT.replace("0.7,0.6,0,0.6", "1.5,0.1,0,0.1").replace("0.35,0.3,0,0.3", "0.75,0.05,0,0.05")
}

fn mass(value: &Value) -> f64 {
    value["mass_kg"].as_f64().unwrap()
}

/// Returns the magnitude of the torque that the control law adds to the model torque at joint 2, N·m, at two times of
/// a recording. The first time is shortly before the model torque of the held arm changes by more than 2 N·m. The
/// second time is the end of the recording.
fn missing(recording: &str) -> (f64, f64) {
    let mut lines = recording.lines().filter(|line| !line.starts_with('#'));
    let columns: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| columns.iter().position(|column| *column == name).unwrap();
    let (tes, model, whole) = (column("tes"), column("q2_torque_model_nm"), column("q2_torque_nm"));
    let rows: Vec<[f64; 3]> = lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            [tes, model, whole].map(|i| cells[i].parse().unwrap_or(f64::NAN))
        })
        .collect();
    let done = rows.iter().rposition(|row| row[0] == 3.0).expect("a run");
    let held = rows[done + 100];
    let changed =
        done + 100 + rows[done + 100..].iter().position(|row| (row[1] - held[1]).abs() > 2.0).unwrap();
    let last = rows[rows.len() - 1];
    ((rows[changed - 300][2] - rows[changed - 300][1]).abs(), (last[2] - last[1]).abs())
}

/// The integral part of the control law compensates an unknown payload of 3 kg. After the user has set the payload, the arm model
/// compensates the 3 kg.
#[test]
fn j60_a_payload_that_is_given_is_carried() {
    let dir = tempfile::tempdir().unwrap();
    let record = dir.path().join("sim.csv");
    let sim = Sim::start(&["--no-throttle", "--payload", "3,0,0,0.05", "--record", record.to_str().unwrap()])
        .held();
    let file = sim.file("bent.csv", BENT);
    sim.jtc(&["traj", "run", &file]).ends(0);
    assert_eq!(mass(&sim.json(&["payload", "show"], 0)), 0.0);
    let hash = sim.json(&["info"], 0)["hash"].clone();
    std::thread::sleep(std::time::Duration::from_secs(1));

    let set = sim.json(&["payload", "set", "--mass", "3", "--com", "0,0,0.05"], 0);
    assert_eq!((mass(&set), mass(&set["before"])), (3.0, 0.0));
    let info = sim.json(&["info"], 0);
    assert_eq!((mass(&info["payload"]), &info["hash"]), (3.0, &hash), "it is not a part of the arm");
    std::thread::sleep(std::time::Duration::from_secs(2));
    assert_eq!(sim.end("-TERM").0, 0);
    let (before, after) = missing(&std::fs::read_to_string(record).unwrap());
    assert!(before > 8.0 && after < 0.5 * before, "{before} N·m became {after} N·m");
}

/// If the controller rejects a payload, the command reports the joint and its torque. The rejected request changes no
/// setting.
#[test]
fn j60_a_payload_that_cannot_be_is_refused_with_its_reason() {
    let sim = Sim::start(&["--no-throttle", "--speed", "max"]).held();
    let file = sim.file("bent.csv", BENT);
    sim.jtc(&["traj", "run", &file]).ends(0);
    let set = |words: &[&str], code: i32| {
        let all = [&["payload", "set"], words].concat();
        let output = sim.jtc(&all).ends(code);
        assert_eq!(mass(&sim.json(&["payload", "show"], 0)), 1.0, "{words:?}");
        output.err
    };
    sim.jtc(&["payload", "set", "--mass", "1", "--com", "0,0,0"]).ends(0);
    let heavy = set(&["--mass", "49", "--com", "0,0,0.5"], 4);
    assert!(
        heavy.contains("N·m at joint 4") && heavy.contains("limit 60 N·m") && heavy.contains("jtc jog"),
        "{heavy}"
    );
    let bounds = set(&["--mass", "51", "--com", "0,0,0"], 2);
    assert!(bounds.contains("mass of the payload (kg) is 51") && bounds.contains("0 to 50"), "{bounds}");
    let far = set(&["--mass", "2", "--com", "0,0,80"], 2);
    assert!(far.contains("payload_z_m: 80") && far.contains("-5 to 5"), "{far}");
    for (words, what) in [
        (&["--mass", "-2", "--com", "0,0,0"][..], "must not be negative"),
        (&["--mass", "2", "--com", "0,0,0", "--inertia", "0.1,0.1,0.9"], "more than the sum of the others"),
        (&["--mass", "2", "--com", "0,0,0", "--inertia", "0.1,0.1,0.1,0.5,0,0"], "must not be negative"),
        (&["--mass", "2", "--com", "0,0"], "2 numbers instead of x,y,z"),
        (&["--mass", "2"], "--com"),
    ] {
        let refused = set(words, 2);
        assert!(refused.contains(what), "{words:?}: {refused}");
    }
    // The payload is invalid, so the command does not search for a port.
    let none = jtc(&["payload", "set", "--mass", "-2", "--com", "0,0,0", "--port", "/nowhere/tty"]).ends(2);
    assert!(none.err.contains("nothing was sent"), "{}", none.err);
}

/// If the arm cannot follow a path with its payload, the command rejects the path before it sends any frame.
#[test]
fn j60_a_run_is_checked_with_the_payload() {
    let sim = Sim::start(&["--no-throttle", "--speed", "max"]).held();
    let file = sim.file("bent.csv", BENT);
    let far = sim.file("far.csv", &stretched());
    sim.json(&["traj", "run", &far], 0);
    sim.json(&["traj", "run", &file, "--approach"], 0);
    jtc(&["traj", "check", &far]).ends(0);
    jtc(&["traj", "check", &far, "--payload", "6,0,0,0.1"]).ends(4);
    jtc(&["traj", "check", &file, "--payload", "6,0,0,0.1"]).ends(0);
    jtc(&["traj", "check", &file, "--payload", "-6"]).ends(2);
    sim.jtc(&["payload", "set", "--mass", "6", "--com", "0,0,0.1"]).ends(0);
    let run = sim.jtc(&["traj", "run", &file, "--approach"]).ends(0);
    assert!(run.err.contains("payload of the controller, 6 kg at (0, 0, 0.1) m"), "{}", run.err);
    let refused = sim.json(&["traj", "run", &far, "--approach"], 4);
    let kinds: Vec<_> =
        refused["verdict"]["problems"].as_array().unwrap().iter().map(|p| p["kind"].to_string()).collect();
    assert!(kinds.iter().any(|kind| kind.contains("torque")), "{kinds:?}");
    assert_eq!(mass(&sim.json(&["payload", "clear"], 0)["before"]), 6.0);
    let text = sim.jtc(&["payload", "show"]).ends(0).out;
    assert!(text.contains("payload: none"), "{text}");
    sim.json(&["traj", "run", &far, "--approach"], 0);
}

/// The command checks the remainder of a paused motion with a new payload. If the motion is unknown, the command
/// reports that it does not check the motion.
#[cfg(unix)]
#[test]
fn j60_a_paused_motion_goes_on_with_another_payload_only_if_it_can() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let (far, other) = (sim.file("far.csv", &stretched()), sim.file("bent.csv", BENT));
    let mut run = moving_while(&sim, &["traj", "run", &far], 0.4);
    cli_kit::testing::signal(&run, "-KILL");
    run.wait().unwrap();
    sim.jtc(&["traj", "pause"]).ends(0);
    std::thread::sleep(std::time::Duration::from_millis(1000));
    sim.jtc(&["payload", "set", "--mass", "6", "--com", "0,0,0.1"]).ends(0);
    let refused = sim.jtc(&["traj", "resume", "--trajectory", &far]).ends(4);
    assert!(refused.err.contains("torque over its limit: joint 2"), "{}", refused.err);
    assert!(refused.err.contains("nothing was sent"), "{}", refused.err);
    let refused = sim.jtc(&["traj", "resume", "--trajectory", &other]).ends(4);
    assert!(refused.err.contains("the arm is not at that point"), "{}", refused.err);
    let slower = sim.jtc(&["traj", "resume", "--trajectory", &far, "--speed", "50"]).ends(4);
    assert!(slower.err.contains("the arm is not at that point"), "{}", slower.err);
    assert_eq!(sim.json(&["status"], 0)["trajectory"], "Pause");
    sim.jtc(&["payload", "set", "--mass", "0.2", "--com", "0,0,0.1"]).ends(0);
    let resumed = sim.json(&["traj", "resume", "--trajectory", &far], 0);
    assert_eq!(resumed["checked"], true);
    sim.jtc(&["traj", "pause"]).ends(0);
    std::thread::sleep(std::time::Duration::from_millis(1000));
    let resumed = sim.jtc(&["--json", "traj", "resume"]).ends(0);
    assert!(resumed.err.contains("not checked") && resumed.err.contains("0.2 kg"), "{}", resumed.err);
    assert_eq!(resumed.json()["checked"], false);
}
