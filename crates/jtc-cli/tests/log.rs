//! Tests of the flight recorder (J-56). A user reads its log after a fault, during a motion, and again from a file.

use crate::common;

use common::{Sim, jtc, slow_motion};
use serde_json::Value;

/// Fault file in which joint 3 does not answer in the middle of a motion.
const SILENT: &str =
    "format = 2\n[[fault]]\nkind = \"node-silent\"\njoint = 3\nat_point = 700\nfor_s = 0.5\n";

/// Returns a simulated controller after joint 3 has stopped answering.
fn after_fault() -> Sim {
    let sim = Sim::with_faults(&["--no-throttle"], SILENT).held();
    let file = sim.file("motion.csv", &slow_motion(30));
    sim.jtc(&["traj", "run", &file, "--approach"]).ends(5);
    // The wait ensures that the log also contains events after the fault.
    std::thread::sleep(std::time::Duration::from_millis(500));
    sim
}

fn count(value: &Value, key: &str) -> u64 {
    value[key].as_u64().unwrap_or_else(|| panic!("{key}: {value}"))
}

#[test]
fn j56_after_a_fault_the_log_leads_with_what_broke_first_and_replays_without_a_difference() {
    let sim = after_fault();
    let (recording, page) = (sim.path("fault.mcap"), sim.path("fault.html"));
    let fetched = sim.json(&["log", "fetch", "-o", &recording, "--report", &page], 0);
    assert_eq!(fetched["state"], "stopped after an error");
    let first = &fetched["first"];
    assert_eq!(
        (&first["text"], &first["error"]),
        (&Value::from("joint 3: does not answer"), &Value::from(true))
    );
    assert_eq!(first["joints"], serde_json::json!([3]));
    // The log begins at least two seconds before the fault and ends 0.3 s after the fault, with all measured values.
    let at = first["time_s"].as_f64().unwrap();
    assert!(fetched["from_s"].as_f64().unwrap() < at - 2.0);
    assert!((fetched["to_s"].as_f64().unwrap() - at - 0.3).abs() < 1e-9);
    assert!(fetched["difference"].is_null() && fetched["gaps"].as_array().unwrap().is_empty());
    assert!(count(&fetched, "replayed") > 2_300, "{fetched}");
    assert_eq!((count(&fetched, "other_arm"), count(&fetched, "other_trajectory")), (0, 0));

    // The report page begins with the fault. The recording is a normal recording that also contains the log.
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("after the start of the device: joint 3: does not answer"));
    let report = jtc(&["--json", "report", &recording, "--out", &sim.path("again.html")]).ends(0).json();
    assert_eq!(report["samples"], fetched["ticks"]);
    let replayed = jtc(&["--json", "log", "replay", &recording]).ends(0).json();
    assert_eq!((&replayed["ticks"], &replayed["first"]), (&fetched["ticks"], first));
    let text = jtc(&["log", "replay", &recording]).ends(0).out;
    assert!(text.contains(" replayed, no difference"), "{text}");

    // A request that clears errors does not remove the log. A request that clears the log removes the log.
    sim.jtc(&["recover"]).ends(0);
    assert_eq!(sim.json(&["log", "fetch"], 0)["first"], *first);
    let info = sim.jtc(&["info"]).ends(0).out;
    assert!(info.contains("stopped after an error: jtc log fetch reads the log"), "{info}");
    assert_eq!(sim.json(&["log", "clear"], 0)["before"], "stopped after an error");
    std::thread::sleep(std::time::Duration::from_millis(300));
    let anew = sim.json(&["log", "fetch"], 0);
    assert_eq!((&anew["state"], &anew["first"]), (&Value::from("recording"), &Value::Null));
    // Without `--overwrite`, the command does not overwrite an existing output file.
    sim.jtc(&["log", "fetch", "-o", &recording]).ends(4);
}

#[test]
fn j56_a_log_of_another_arm_asks_for_its_file() {
    let sim = after_fault();
    let another = include_str!("../../../arms/avena.toml").replacen("kd = 80.0", "kd = 75.0", 1);
    let (avena, another) = (
        sim.file("avena.toml", include_str!("../../../arms/avena.toml")),
        sim.file("another.toml", &another),
    );
    sim.jtc(&["arm", "push", &another]).ends(0);
    let recording = sim.path("fault.mcap");
    let fetched = sim.jtc(&["log", "fetch", "-o", &recording]).ends(0).out;
    assert!(
        fetched.contains("only the measured values of these ticks are known")
            && fetched.contains("--arm FILE"),
        "{fetched}"
    );
    let unknown = jtc(&["--json", "log", "replay", &recording]).json();
    assert!(count(&unknown, "other_arm") > 1_000, "{unknown}");
    let known = jtc(&["--json", "log", "replay", &recording, "--arm", &avena]).ends(0).json();
    assert_eq!((count(&known, "other_arm"), &known["difference"]), (0, &Value::Null));
    assert!(count(&known, "replayed") > 2_000);
}

#[test]
fn j56_a_log_without_a_fault_holds_the_motion_that_was() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let file = sim.file("motion.csv", &slow_motion(20));
    sim.jtc(&["traj", "run", &file, "--approach"]).ends(0);
    let fetched = sim.json(&["log", "fetch"], 0);
    assert!(fetched["first"].is_null() && fetched["difference"].is_null());
    assert!(count(&fetched, "replayed") > 2_000, "{fetched}");
    let words = fetched["events"].to_string();
    assert!(words.contains("trajectory Finish"), "{words}");
    // Without an error, the flight recorder continues to record.
    assert_eq!(fetched["state"], "recording");
}

#[test]
fn j56_what_is_no_log_is_refused_with_the_next_command() {
    let sim = Sim::start(&["--no-throttle"]).held();
    let file = sim.file("motion.csv", &slow_motion(10));
    let recording = sim.path("run.mcap");
    sim.jtc(&["traj", "run", &file, "--approach", "--record", &recording]).ends(0);
    let refused = jtc(&["log", "replay", &recording]).ends(2).err;
    assert!(refused.contains("contains no log") && refused.contains("jtc log fetch"), "{refused}");
    sim.jtc(&["log", "fetch", "-o", &sim.path("log.csv")]).ends(2);
    sim.file("broken.mcap", "no recording at all");
    jtc(&["log", "replay", &sim.path("broken.mcap")]).ends(2);
    jtc(&["log", "replay", &sim.path("absent.mcap")]).ends(2);
}
