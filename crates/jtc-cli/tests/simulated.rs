//! Tests of commands with `jtc sim` over its pseudo-terminal, in free-running virtual time.
#![cfg(unix)]

use crate::common;

use std::io::{Read, Write};

use common::{Sim, jtc, motion};

#[test]
fn the_simulator_ends_with_0_on_a_signal_and_takes_its_link_away() {
    for signal in ["-INT", "-TERM"] {
        let sim = Sim::start(&["--speed", "max"]);
        assert_eq!(sim.end(signal), (0, false), "{signal}");
    }
}

#[test]
fn a_stale_link_is_replaced_and_a_file_is_not() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("jtc");
    std::fs::write(&path, "precious").unwrap();
    let output = jtc(&["sim", "--serial", path.to_str().unwrap()]).ends(2);
    assert!(output.err.contains("the path is in use: a file"), "{}", output.err);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "precious");
    std::fs::remove_file(&path).unwrap();
    std::os::unix::fs::symlink("/dev/pts/99999", &path).unwrap();
    let sim = Sim::start_in(dir, &["--speed", "max"]);
    sim.jtc(&["status"]).ends(0);
}

#[test]
fn a_port_that_is_served_is_not_taken_over() {
    let sim = Sim::start(&["--speed", "max"]);
    let to = std::fs::read_link(&sim.port).unwrap();
    let output = jtc(&["sim", "--serial", sim.port.to_str().unwrap()]).ends(2);
    assert!(
        output.err.contains("another running simulator") && output.err.contains("another path"),
        "{}",
        output.err
    );
    assert_eq!(std::fs::read_link(&sim.port).unwrap(), to);
    sim.jtc(&["status"]).ends(0);
    // The link of a killed simulator may lead to a pseudo-terminal that now belongs to another program, such as a
    // shell. A new simulator replaces this link.
    let shell =
        rustix::pty::openpt(rustix::pty::OpenptFlags::RDWR | rustix::pty::OpenptFlags::NOCTTY).unwrap();
    rustix::pty::grantpt(&shell).unwrap();
    rustix::pty::unlockpt(&shell).unwrap();
    let name = rustix::pty::ptsname(&shell, Vec::new()).unwrap();
    let dir = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(name.to_str().unwrap(), dir.path().join("jtc")).unwrap();
    Sim::start_in(dir, &["--speed", "max"]).jtc(&["status"]).ends(0);
}

#[test]
fn from_power_up_to_a_recorded_motion() {
    let sim = Sim::start(&["--speed", "max", "--seed", "3"]);
    let status = sim.json(&["status"], 0);
    assert_eq!(status["joints"].as_array().unwrap().len(), 6);
    assert!(status["missing_parameters"].as_array().unwrap().len() == 3, "{status}");

    // The controller cannot execute a motion yet, and the output of the command suggests the next step.
    let file = sim.file("motion.csv", &motion(0.25));
    let output = sim.jtc(&["--json", "traj", "run", &file]).ends(1);
    assert!(output.json()["error"]["hint"].as_str().unwrap().contains("params"), "{}", output.out);

    let arm = concat!(env!("CARGO_MANIFEST_DIR"), "/../../arms/avena.toml");
    let pushed = sim.json(&["params", "push", arm], 0);
    assert_eq!(pushed["missing_parameters"].as_array().unwrap().len(), 0, "{pushed}");

    let (record, page) = (sim.path("run.mcap"), sim.path("run.html"));
    let words = [
        "--json",
        "traj",
        "run",
        &file,
        "--record",
        &record,
        "--report",
        &page,
        "--points-per-segment",
        "50",
    ];
    let run = sim.jtc(&words).ends(0).json();
    assert_eq!(run["outcome"], "finished");
    assert_eq!(run["upload"]["segments"], 3);
    for joint in run["joints"].as_array().unwrap() {
        assert!(joint["rms_error_mrad"].as_f64().unwrap() < 2.0, "{joint}");
        assert!(joint["peak_torque_nm"].as_f64().unwrap() > 0.0, "{joint}");
    }
    assert!(std::fs::metadata(&record).unwrap().len() > 1000);
    assert!(std::fs::read_to_string(&page).unwrap().contains("</html>"));

    let status = sim.json(&["status"], 0);
    assert_eq!((status["state"].as_str(), status["trajectory"].as_str()), (Some("HoldPos"), Some("Finish")));
    // J-34: only a paused motion can be resumed, so the command fails.
    let output = sim.jtc(&["traj", "resume"]).ends(4);
    assert!(
        output.err.contains("no motion is paused") && output.err.contains("trajectory Finish"),
        "{}",
        output.err
    );
    sim.jtc(&["traj", "stop"]).ends(0);
    let output = sim.jtc(&["traj", "resume"]).ends(4);
    assert!(output.err.contains("trajectory Stop") && output.err.contains("jtc traj run"), "{}", output.err);
    sim.jtc(&["traj", "pause"]).ends(1);
    // While the controller holds the arm, a reset needs a confirmation. In Teaching, the command rejects a reset of a
    // joint even with confirmation.
    let output = sim.jtc(&["reset", "--joints", "2"]).ends(4);
    assert!(output.err.contains("joint 2") && output.err.contains("--yes"), "{}", output.err);
    sim.jtc(&["gripper", "on"]).ends(0);
    sim.jtc(&["teach", "on"]).ends(0);
    sim.jtc(&["reset", "--joints", "2", "--yes"]).ends(4);
    sim.jtc(&["teach", "off"]).ends(0);
    let doctor = sim.json(&["doctor"], 0);
    assert_eq!(doctor["healthy"], true, "{doctor}");
    let lines = sim.jtc(&["--json", "monitor", "--count", "5"]).ends(0);
    assert_eq!(lines.out.lines().count(), 5);
    let output = sim.jtc(&["--json", "reset", "--joints", "2", "--yes"]).ends(0);
    assert_eq!(output.json()["reset"], serde_json::json!(["joint 2"]));
}

/// A stream of statuses ends without an error when its reader has closed the pipe.
#[test]
fn monitor_ends_with_its_reader() {
    use std::io::BufRead;
    let sim = Sim::start(&["--speed", "max", "--no-throttle"]);
    let mut child = sim.command(&["monitor"]).stdout(std::process::Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    std::io::BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert!(line.contains("Init"), "{line}");
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

/// J-55: `recover` uses the defaults only if the user requests them.
#[test]
fn j55_recover_of_a_fresh_controller_needs_to_know_whose_numbers() {
    let sim = Sim::start(&["--speed", "max", "--no-throttle"]);
    let output = sim.jtc(&["--json", "recover"]).ends(4);
    assert_eq!(output.json()["error"]["code"], "no-parameters");
    let status = sim.json(&["status"], 0);
    assert_eq!(status["missing_parameters"].as_array().unwrap().len(), 3, "{status}");
    let output = sim.jtc(&["--json", "recover", "--defaults"]).ends(0);
    assert!(output.err.contains("the defaults of the controller"), "{}", output.err);
    assert_eq!(output.json()["status"]["state"], "HoldPos");
    let output = sim.jtc(&["recover"]).ends(0);
    assert!(output.err.contains("received them before"), "{}", output.err);
}

#[test]
fn a_start_elsewhere_is_refused_until_it_is_approached() {
    let sim = Sim::start(&["--speed", "max", "--no-throttle"]).with_parameters();
    let file = sim.path("away.csv");
    let shifted: String = motion(0.2)
        .lines()
        .enumerate()
        .map(|(i, l)| {
            let mut cells: Vec<String> = l.split(',').map(String::from).collect();
            if i > 0 {
                cells[1] = (cells[1].parse::<f64>().unwrap() + 0.3).to_string();
            }
            cells.join(",") + "\n"
        })
        .collect();
    std::fs::write(&file, shifted).unwrap();
    let output = sim.jtc(&["--json", "traj", "run", &file]).ends(4);
    assert!(output.out.contains("start_pose"), "{}", output.out);
    let output = sim.jtc(&["--json", "traj", "run", &file, "--approach", "--speed", "50"]).ends(0);
    assert_eq!(output.json()["outcome"], "finished");
}

#[test]
fn a_fault_while_running_ends_with_5_and_recover_leads_back() {
    let sim = Sim::with_faults(&["--speed", "max"], FAULT).with_parameters();
    let file = sim.file("motion.csv", &motion(0.25));
    let (record, page) = (sim.path("run.mcap"), sim.path("run.html"));
    let output = sim.jtc(&["--json", "traj", "run", &file, "--record", &record, "--report", &page]).ends(5);
    let value = output.json();
    assert_eq!(value["outcome"], "fault");
    // The command reports the first failure first, with the joint and the values before and after the failure.
    assert_eq!(value["failure"]["joint"], 3, "{}", value["failure"]);
    assert!(value["failure"]["causes"][0].as_str().unwrap().starts_with("joint 3: "), "{}", value["failure"]);
    // The fault occurs at 500 ms. The reported time is less accurate: statuses arrive every 40 ms, and each sample
    // has the time at which its status arrived.
    let at_ms = value["failure"]["at_ms"].as_f64().unwrap();
    assert!((440.0..700.0).contains(&at_ms), "{}", value["failure"]);
    let text = std::fs::read_to_string(&page).unwrap();
    assert!(text.contains("<title>FAILED: ") && text.contains("ms into the run: joint 3: "));
    // A report that is created later from the recording shows the same failure.
    let again = sim.path("again.html");
    let output = jtc(&["report", &record, "--out", &again]).ends(0);
    assert!(
        output.out.starts_with("FAILED ") && output.out.contains("figures up to the failure"),
        "{}",
        output.out
    );
    assert!(std::fs::read_to_string(&again).unwrap().contains("<title>FAILED: "));
    let output = sim.jtc(&["--json", "recover"]).ends(0);
    assert_eq!(output.json()["status"]["state"], "HoldPos", "{}", output.out);
}

/// The command records and reports a fault during the approach like any other fault. The report states that the fault occurred in the
/// approach.
#[test]
fn a_fault_on_the_approach_is_recorded_and_named() {
    let sim = Sim::with_faults(&["--speed", "max"], &FAULT.replace("at_point = 500", "at_point = 200"))
        .with_parameters();
    let (file, record, page) = (sim.path("away.csv"), sim.path("run.csv"), sim.path("run.html"));
    let mut text = String::from("t,q1,q2,q3,q4,q5,q6\n");
    for i in 0..=120 {
        let q = 0.2 * (std::f64::consts::PI * f64::from(i) / 120.0).sin().powi(4);
        text += &format!("{:.3},{},{q},{q},{q},{q},{q}\n", f64::from(i) * 0.01, 0.3 + q);
    }
    std::fs::write(&file, text).unwrap();
    let words = [
        "--json",
        "traj",
        "run",
        &file,
        "--approach",
        "--speed",
        "50",
        "--record",
        &record,
        "--report",
        &page,
    ];
    let value = sim.jtc(&words).ends(5).json();
    assert_eq!(
        (value["outcome"].as_str(), value["phase"].as_str()),
        (Some("fault"), Some("approach")),
        "{value}"
    );
    assert_eq!(value["failure"]["joint"], 3, "{value}");
    assert!(value["error"]["message"].as_str().unwrap().starts_with("during the approach"), "{value}");
    assert!(std::fs::read_to_string(&page).unwrap().contains("<title>FAILED: "));
    let recording = std::fs::read_to_string(&record).unwrap();
    assert!(
        recording.lines().count() > 5
            && recording.contains("\n# outcome: fault\n# reason: during the approach")
    );
}

#[test]
fn typed_events_happen_and_mistakes_are_named() {
    let mut sim = Sim::start(&["--speed", "max"]);
    let lead = sim.path("lead.csv");
    std::fs::write(&lead, motion(0.2)).unwrap();
    let lines = [
        ("push 3 12 0.5", "push: joint 3 by 12 N·m for 0.5 s".to_owned()),
        (
            "# a comment, then an empty line\n\npush 0 12 0.5",
            "joint `0` is out of range, expected 1..6".to_owned(),
        ),
        ("shove", "unknown event `shove`; the events are push".to_owned()),
        (&format!("hand {lead}"), format!("hand: a hand leads the arm along {lead}")),
        ("hand /no/such/file.csv", "/no/such/file.csv".to_owned()),
    ];
    assert!(sim.error_line().contains("holding brakes"), "announced at the start");
    for (line, expected) in lines {
        sim.write_line(line);
        let answer = sim.error_line();
        assert!(answer.contains(&expected), "{line}\n→ {answer}");
    }
    sim.jtc(&["status"]).ends(0);
}

#[test]
fn the_arm_can_be_taught_by_hand() {
    let mut sim = Sim::start(&["--speed", "max"]).with_parameters();
    // The trajectory moves joint 1 to 0.3 rad in 2 s. Joint 1 rotates about the vertical axis, so the joint keeps its position when its
    // torque is switched off.
    let rows = (0..=200).map(|i| {
        let q = 0.15 - 0.15 * (std::f64::consts::PI * f64::from(i) / 200.0).cos();
        format!("{:.2},{q},0,0,0,0,0\n", f64::from(i) * 0.01)
    });
    let lead = sim.path("lead.csv");
    std::fs::write(&lead, "t,q1,q2,q3,q4,q5,q6\n".to_owned() + &rows.collect::<String>()).unwrap();
    sim.write_line(&format!("hand {lead}"));
    sim.jtc(&["teach", "on"]).ends(0);
    let position = |sim: &Sim| sim.json(&["status"], 0)["joints"][0]["position_rad"].as_f64().unwrap();
    let led = (0..100).any(|_| position(&sim) > 0.25);
    assert!(led, "joint 1 is at {} rad", position(&sim));
    sim.jtc(&["teach", "off"]).ends(0);
}

#[test]
fn a_fault_file_that_counted_from_0_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let faults = dir.path().join("faults.toml");
    std::fs::write(&faults, FAULT.replace("format = 2", "")).unwrap();
    let output = jtc(&["sim", "--faults", faults.to_str().unwrap()]).ends(2);
    assert!(
        output.err.contains("format = 2") && output.err.contains("add 1 to every `joint`"),
        "{}",
        output.err
    );
}

/// A drive reports a fault 0.5 s after the start of the motion.
const FAULT: &str = r#"
format = 2
[[fault]]
kind = "motor-fault"
joint = 3
bits = 4
at_point = 500
for_s = 0.1
"#;

/// The example motion runs from the start position of the simulator. With the example faults, the controller tolerates the push and the
/// noise, and the run ends when a drive stops answering.
#[test]
fn the_examples_run_in_the_simulator() {
    let dir = tempfile::tempdir().unwrap();
    let to = dir.path().to_str().unwrap();
    for name in ["motion", "faults"] {
        jtc(&["example", name, "-o", to]).ends(0);
    }
    let (motion, faults) = (dir.path().join("motion.csv"), dir.path().join("faults.toml"));
    let motion = motion.to_str().unwrap();
    let sim = Sim::start(&["--speed", "max"]).with_parameters();
    sim.jtc(&["traj", "run", motion]).ends(0);
    let sim = Sim::start(&["--speed", "max", "--faults", faults.to_str().unwrap()]).with_parameters();
    let output = sim.jtc(&["traj", "run", motion]).ends(5);
    assert!(output.err.contains("joint 2"), "{}", output.err);
    let point = output.err.split("point ").nth(1).and_then(|t| t.split(|c: char| !c.is_ascii_digit()).next());
    // The drive stops answering at point 4000. The last status before the fault is up to 40 ms old.
    assert!(point.and_then(|p| p.parse().ok()).is_some_and(|p: u32| p >= 3_950), "{}", output.err);
}

/// A user can replay a recorded motion. The recording of the replay contains the same motion.
#[test]
fn a_recording_is_looked_at_checked_and_run_again() {
    // The simulator runs in real time. With free-running time, a busy computer would receive too few positions to plan the return path
    // to the start.
    let sim = Sim::start(&["--no-throttle"]).held();
    jtc(&["example", "motion", "-o", sim.dir.path().to_str().unwrap()]).ends(0);
    let motion = sim.path("motion.csv");
    for name in ["run.mcap", "run.csv"] {
        let run = sim.path(name);
        sim.jtc(&["traj", "run", &motion, "--record", &run]).ends(0);
        let info = |file: &str| jtc(&["--json", "traj", "info", file]).ends(0).json();
        let (of_motion, of_run) = (info(&motion), info(&run));
        assert_eq!((&of_run["form"], &of_run["duration_s"]), (&"recording".into(), &of_motion["duration_s"]));
        jtc(&["traj", "check", &run]).ends(0);
        sim.jtc(&["traj", "replay", &run]).ends(0);
        jtc(&["traj", "replay", &motion, "--port", "/nowhere/tty"]).ends(2);
    }
}

/// If a host sends a frame byte by byte, the arm is not delayed, and statuses still arrive.
#[test]
fn time_goes_on_while_a_frame_arrives() {
    // The test sends 160 parts in at least 320 ms (2 ms per part). In real time, a status arrives every 40 ms, so at
    // least 8 statuses arrive. With a single tick of 1 ms per part, only 4 statuses would arrive.
    for (options, least) in [(&["--no-throttle"][..], 8), (&["--speed", "max", "--no-throttle"], 50)] {
        let sim = Sim::start(options);
        let mut port = std::fs::OpenOptions::new().read(true).write(true).open(&sim.port).unwrap();
        let mut reader = port.try_clone().unwrap();
        let (send, bytes) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let mut buffer = [0; 1024];
            while let Ok(count @ 1..) = reader.read(&mut buffer)
                && send.send(count).is_ok()
            {}
        });
        // Each write is the start of a trajectory segment of 1000 bytes. The simulator therefore always waits for the
        // rest of a frame, even after a gap that ends the previous frame.
        let start = [0x9B, 0x0A, 0x03, 0xE8];
        port.write_all(&start).unwrap();
        std::thread::sleep(std::time::Duration::from_millis(1));
        let before: usize = bytes.try_iter().sum();
        for _ in 0..160 {
            port.write_all(&start).unwrap();
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        let meanwhile: usize = bytes.try_iter().sum();
        let statuses = meanwhile / jtc_wire::STATUS_LEN;
        assert!(statuses >= least, "{options:?}: {before} bytes, then {statuses} statuses");
        drop(sim);
    }
}

/// Each kind of support either holds the simulated arm or lets it fall, before the drives are enabled and after an
/// error. The first line of the output mentions the support.
#[test]
fn the_support_of_the_arm_is_chosen() {
    for (options, note, falls_first, falls_later) in [
        (&[][..], "note: simulated holding brakes", false, false),
        (&["--support", "brakes"], "note: simulated holding brakes", false, false),
        (&["--support", "stand"], "note: a stand carries the simulated arm until", false, true),
        (&["--support", "none"], "note: nothing supports the simulated arm", true, true),
    ] {
        // The test needs the payload, because friction alone would hold the upright arm.
        let options = [&["--speed", "max", "--payload", "3,0.2,0.2,0.2"], options].concat();
        let error = "format = 2\n[[fault]]\nkind = \"safety-input\"\nin_state = \"hold\"\nafter_s = 8\n";
        let mut sim = Sim::with_faults(&options, error);
        let line = sim.error_line();
        assert!(line.starts_with(note), "{options:?}: {line}");
        let sim = sim.with_parameters();
        // `first` is the largest position of any joint before the error, and `later` is the largest position after
        // the error, rad.
        let (mut first, mut later) = (0.0f64, 0.0f64);
        for _ in 0..600 {
            let status = sim.json(&["status"], 0);
            let joints = status["joints"].as_array().unwrap();
            let furthest =
                joints.iter().map(|joint| joint["position_rad"].as_f64().unwrap().abs()).fold(0.0, f64::max);
            if status["state"] == "Error" {
                later = later.max(furthest);
            } else {
                first = first.max(furthest);
            }
            if falls_first && first > 0.2 || later > 0.2 || later > 0.0 && !falls_later {
                break;
            }
        }
        assert_eq!(first > 0.2, falls_first, "{options:?}: {first} rad before its drives are enabled");
        if !falls_first {
            assert!(later > 0.0, "{options:?}: the safety input is an error");
            assert_eq!(later > 0.2, falls_later, "{options:?}: {later} rad after the error");
        }
    }
}

/// Simulates elastic gears, and drives with a separate speed limit. With a speed limit of 0.05 rad/s, the drives trip during a normal
/// motion.
#[test]
fn gears_and_drives_of_the_simulated_arm_are_chosen() {
    let sim = Sim::start(&["--speed", "max", "--gear-stiffness", "20000"]).held();
    let motion_file = sim.file("motion.csv", &motion(0.2));
    sim.jtc(&["traj", "run", &motion_file]).ends(0);
    let sim = Sim::start(&["--speed", "max", "--over-speed", "0.05"]).held();
    let output = sim.jtc(&["traj", "run", &motion_file]).ends(5);
    assert!(output.err.contains("speed"), "{}", output.err);
    for (words, part) in [
        (["--support", "rope"], "possible values: none, stand, brakes"),
        (["--gear-stiffness", "5"], "5 N·m/rad is out of range (100–1000000 N·m/rad)"),
        (["--over-speed", "1,2"], "2 numbers, expected 1 for all joints or 6"),
    ] {
        let output = jtc(&[&["sim"][..], &words].concat()).ends(2);
        assert!(output.err.contains(part), "{}", output.err);
    }
}
