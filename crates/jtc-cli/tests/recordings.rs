//! Tests of the recordings of runs, the simulator and the demo, for killed programs, full disks and second runs.
#![cfg(unix)]

use crate::common;

use common::{Sim, jtc, motion};
use std::io::{BufRead, BufReader};
use std::process::Stdio;
use test_kit::patience::until;

fn ready(options: &[&str]) -> Sim {
    Sim::start(options).with_parameters()
}

fn json(words: &[&str]) -> serde_json::Value {
    jtc(&[&["--json"], words].concat()).ends(0).json()
}

/// The simulator records each millisecond of a motion that a host commands over the serial port. A user can read the recording while the
/// simulator runs and after `kill -9`, and can replay the motion.
#[test]
fn the_simulator_records_each_millisecond() {
    for name in ["sim.mcap", "sim.csv"] {
        let dir = tempfile::tempdir().unwrap();
        let record = dir.path().join(name).to_str().unwrap().to_owned();
        // The simulator runs in real time. With free-running time, the file would grow by many megabytes per second.
        let sim = ready(&["--no-throttle", "--record", &record]);
        let file = sim.file("motion.csv", &motion(0.2));
        sim.jtc(&["traj", "run", &file]).ends(0);
        // The recording file exists already, because the simulator has started it. A second simulator does not
        // overwrite this file.
        let output = jtc(&["sim", "--record", &record]).ends(4);
        assert!(output.err.contains("already exists"), "{}", output.err);
        // The file may lack the last 0.2 s, so the test waits until the recording contains all 1201 points.
        until("1201 places", || jtc(&["traj", "info", &record]).err.contains("at 1201 places"));
        assert_eq!(sim.end("-KILL").0, -1);
        let info = json(&["traj", "info", &record]);
        assert_eq!((&info["form"], &info["duration_s"]), (&"recording".into(), &1.2.into()), "{info}");
        let notes = info["notes"].to_string();
        assert!(notes.contains("at 1201 places at most 1 ms apart"), "{notes}");
        assert!(
            name == "sim.csv" || notes.contains("not completed") || notes.contains("is incomplete"),
            "{notes}"
        );
        jtc(&["traj", "check", &record]).ends(0);
        let report = json(&["report", &record]);
        assert!(report["samples"].as_u64().unwrap() > 5_000, "{report}");
        for joint in report["joints"].as_array().unwrap() {
            assert!(joint["rms_error_mrad"].as_f64().is_some_and(|e| e < 2.0), "{joint}");
        }
        let other = ready(&["--speed", "max", "--no-throttle"]);
        other.jtc(&["traj", "replay", &record]).ends(0);
    }
}

#[test]
fn a_simulator_that_is_ended_completes_its_recording() {
    let dir = tempfile::tempdir().unwrap();
    let record = dir.path().join("sim.mcap").to_str().unwrap().to_owned();
    let sim = ready(&["--no-throttle", "--record", &record]);
    let file = sim.file("motion.csv", &motion(0.2));
    sim.jtc(&["traj", "run", &file]).ends(0);
    assert_eq!(sim.end("-TERM").0, 0);
    let info = json(&["traj", "info", &record]);
    assert!(!info["notes"].to_string().contains("completed"), "{info}");
}

/// If a program is killed while it records a motion, the recording lacks only the last moments of the motion.
#[test]
fn a_run_that_is_killed_leaves_its_recording() {
    for name in ["run.mcap", "run.csv"] {
        let sim = ready(&["--no-throttle"]);
        let (file, record) = (sim.path("motion.csv"), sim.path(name));
        jtc(&["example", "motion", "-o", sim.dir.path().to_str().unwrap()]).ends(0);
        let mut run = sim
            .command(&["traj", "run", &file, "--speed", "20", "--record", &record])
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        until(format_args!("a second of the motion in {name}"), || recorded_ms(&record) > 1_000);
        run.kill().unwrap();
        run.wait().unwrap();
        let info = json(&["traj", "info", &record]);
        let seen = info["duration_s"].as_f64().unwrap();
        // An MCAP file contains the complete trajectory, which takes 30 s (6 s at 20 % speed). A CSV file contains
        // only the part that the controller has executed.
        assert!(
            if name == "run.mcap" { (seen - 30.0).abs() < 0.1 } else { (1.0..30.0).contains(&seen) },
            "{info}"
        );
        let notes = info["notes"].to_string();
        assert!(notes.contains("is incomplete") || notes.contains("not completed"), "{notes}");
        let output = jtc(&["report", &record]).ends(0);
        assert!(
            output.err.contains("is incomplete") || output.err.contains("not completed"),
            "{}",
            output.err
        );
        assert!(output.out.starts_with("FAILED "), "{}", output.out);
    }
}

/// Returns the path time in ms that a recording has reached while a program still writes it.
fn recorded_ms(record: &str) -> u64 {
    let samples = jtc_host::recording::Recording::read(std::path::Path::new(record)).map(|read| read.samples);
    samples.unwrap_or_default().iter().map(|sample| u64::from(sample.point)).max().unwrap_or(0)
}

/// The command detects a disk without free space before the arm moves.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_found_before_anything_moves() {
    let sim = ready(&["--speed", "max", "--no-throttle"]);
    let (file, full, page) = (sim.path("motion.csv"), sim.path("full.mcap"), sim.path("page.html"));
    std::fs::write(&file, motion(0.2)).unwrap();
    std::os::unix::fs::symlink("/dev/full", &full).unwrap();
    let output = sim.jtc(&["traj", "run", &file, "--record", &full, "--report", &page]).ends(2);
    assert!(
        output.err.contains("No space left") && output.err.contains("the motion was not started"),
        "{}",
        output.err
    );
    assert!(!std::path::Path::new(&page).exists());
    let status = sim.json(&["status"], 0);
    assert_eq!((status["state"].as_str(), status["point"].as_u64()), (Some("HoldPos"), Some(0)), "{status}");
    let output = jtc(&["sim", "--record", &full]).ends(2);
    assert!(output.err.contains("No space left") && output.out.is_empty(), "{}", output.err);
}

/// If the disk becomes full during a motion, the command reports the full disk at once. The motion continues to its end, and the exit code
/// shows the loss of data.
#[test]
fn a_recording_that_breaks_off_on_the_way_is_an_error_although_the_run_was_good() {
    let sim = ready(&["--speed", "max", "--no-throttle"]);
    let (file, pipe, page) = (sim.path("motion.csv"), sim.path("pipe.csv"), sim.path("page.html"));
    std::fs::write(&file, motion(0.2)).unwrap();
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    // The reader reads only the first line and then closes the pipe, so the remaining recording cannot be written.
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || {
            let mut line = String::new();
            BufReader::new(std::fs::File::open(pipe).unwrap()).read_line(&mut line).unwrap();
            line
        }
    });
    let output = sim.jtc(&["--json", "traj", "run", &file, "--record", &pipe, "--report", &page]).ends(5);
    assert!(reader.join().unwrap().starts_with("time_s,"));
    let value = output.json();
    assert_eq!(
        (value["outcome"].as_str(), value["error"]["code"].as_str()),
        (Some("finished"), Some("output-lost"))
    );
    assert!(output.err.contains("no more data are recorded, the motion continues"), "{}", output.err);
    // The report page is complete, because only the recording was lost.
    assert_eq!(value["files"], serde_json::json!([page]));
}
