//! Tests of `jtc serve --record`: the agent records the motions of all clients.
#![cfg(unix)]

use crate::common;

use std::path::{Path, PathBuf};
use std::process::Stdio;

use cli_kit::testing::run;
use common::agent::{Agent, command_in};
use jtc_host::recording::Recording;
use serde_json::Value;
use test_kit::patience::{Patience, until};

/// Starts an agent that records the motions of a simulated controller.
fn recording() -> Agent {
    recording_in(tempfile::tempdir().expect("a directory"))
}

fn recording_in(dir: tempfile::TempDir) -> Agent {
    let place = |name: &str| dir.path().join(name).to_str().expect("a name").to_owned();
    let (recordings, commands) = (place("recordings"), place("commands"));
    let options = ["--sim", "--baud", "921600", "--record", &recordings, "--command-log", &commands];
    let agent = Agent::start_in(dir, &options);
    agent.jtc(&["recover", "--defaults"]).ends(0);
    agent
}

/// Waits for `count` recordings with this file name extension. Returns the paths of the recordings, oldest first.
fn recorded(agent: &Agent, ending: &str, count: usize) -> Vec<PathBuf> {
    let mut patience = Patience::begin();
    loop {
        let found = recordings(&agent.dir, ending);
        if found.len() >= count {
            return found;
        }
        patience.pause(format_args!("{count} {ending} instead of {found:?}"));
    }
}

fn recordings(dir: &tempfile::TempDir, ending: &str) -> Vec<PathBuf> {
    let all = std::fs::read_dir(dir.path().join("recordings")).expect("the directory");
    let mut found: Vec<PathBuf> = all.map(|entry| entry.expect("an entry").path()).collect();
    found.retain(|path| {
        let name = path.file_name().and_then(|name| name.to_str()).expect("a name");
        name.ends_with(ending) && (ending != ".mcap" || !name.ends_with(".part.mcap"))
    });
    found.sort();
    found
}

fn read(path: &Path) -> Recording {
    Recording::read(path).expect("a recording")
}

/// Checks that `jtc report` can create a report page from this recording, and returns the JSON result.
fn is_reported(dir: &tempfile::TempDir, path: &Path) -> Value {
    let words = ["--json", "report", path.to_str().expect("a name"), "--overwrite"];
    run(command_in(dir), &words, "").ends(0).json()
}

#[test]
fn every_motion_has_a_recording_with_the_channels_of_a_run() {
    let agent = recording();
    let own = agent.dir.path().join("own.mcap");
    let (motion, own) = (agent.motion(20), own.to_str().expect("a name").to_owned());
    agent.jtc(&["traj", "run", &motion, "--record", &own]).ends(0);
    let file = recorded(&agent, ".mcap", 1).remove(0);
    let (of_agent, of_run) = (read(&file), read(Path::new(&own)));
    assert_eq!((of_agent.ending.outcome.as_str(), of_agent.cut.as_deref()), ("finished", None));
    let (info, info_of_run) =
        (of_agent.info.as_ref().expect("its arm"), of_run.info.as_ref().expect("its arm"));
    assert_eq!(info.commanded, info_of_run.commanded);
    assert_eq!(
        (&info.joints, &info.gains, &info.hash),
        (&info_of_run.joints, &info_of_run.gains, &info_of_run.hash)
    );
    assert_eq!((&info.description, &info.device), (&info_of_run.description, &info_of_run.device));
    assert!(!info.commanded_by.is_empty() && info_of_run.commanded_by.is_empty(), "{}", info.commanded_by);
    assert!(info.device.is_some() && info.hash.is_some() && info.start_unix_ns > 0);
    // At each point, the commanded values in both recordings are equal. The recording of the agent contains all samples of the run, and
    // also samples from before the run.
    let at = |recording: &Recording, point: u32| {
        let found = recording.samples.iter().find(|s| s.is_operating() && s.point == point);
        found.map(|s| {
            s.joints.map(|joint| (joint.set_position, joint.set_velocity, joint.position, joint.error))
        })
    };
    let moving: Vec<u32> = of_run.samples.iter().filter(|s| s.is_operating()).map(|s| s.point).collect();
    assert!(moving.len() > 5, "{moving:?}");
    for point in moving {
        assert_eq!(at(&of_agent, point), at(&of_run, point), "{point}");
    }
    assert!(of_agent.samples.first().is_some_and(|s| !s.is_operating()));
    assert!(of_agent.samples.is_sorted_by(|a, b| a.time_s <= b.time_s));
    let report = is_reported(&agent.dir, &file);
    assert!(report["joints"][0]["rms_error_mrad"].is_number() && report["failure"].is_null(), "{report}");
    // The agent records a jog and teaching as two further files.
    agent.jtc(&["jog", "1", "0.1", "--duration", "1"]).ends(0);
    agent.jtc(&["teach", "on"]).ends(0);
    agent.jtc(&["teach", "off"]).ends(0);
    let files = recorded(&agent, ".mcap", 3);
    let names: Vec<String> = files.iter().map(|file| read(file).info.expect("its arm").trajectory).collect();
    assert_eq!(names, ["execution", "jog", "teaching"]);
    for file in &files {
        is_reported(&agent.dir, file);
    }
    let (_, dir) = agent.end("-TERM");
    let log = std::fs::read_to_string(dir.path().join("commands")).expect("the log");
    assert_eq!(log.matches("\"what\":\"recorded\"").count(), 3, "{log}");
}

#[test]
fn a_killed_agent_leaves_its_recording_and_the_next_one_goes_on() {
    let agent = recording();
    let motion = agent.motion(300);
    let mut runs = agent
        .command(&["traj", "run", &motion], &agent.url)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("it starts");
    let part = recorded(&agent, ".part.mcap", 1).remove(0);
    let moving = |recording: &Recording| recording.samples.iter().filter(|s| s.is_operating()).count();
    // The recording can be read while the agent still writes it.
    until("20 samples in motion", || Recording::read(&part).is_ok_and(|recording| moving(&recording) >= 20));
    let (_, dir) = agent.end("-KILL");
    runs.wait().expect("it ends");
    let recording = read(&part);
    assert!(moving(&recording) >= 20 && recording.cut.is_some(), "{:?}", recording.cut);
    let report = is_reported(&dir, &part);
    assert!(report["cut"].as_str().is_some_and(|cut| cut.contains("complete")), "{report}");
    assert!(
        report["failure"]["causes"][0].as_str().is_some_and(|why| why.contains("was not recorded")),
        "{report}"
    );

    let agent = recording_in(dir);
    agent.jtc(&["traj", "run", &agent.motion(20)]).ends(0);
    let whole = recorded(&agent, ".mcap", 1).remove(0);
    assert!(part.exists() && whole.to_str().is_some_and(|name| name.ends_with("-000002.mcap")), "{whole:?}");
    // A second agent cannot use the directory in which another agent records.
    let second = command_in(&agent.dir)
        .args(["serve", "--sim", "--listen", "127.0.0.1:0", "--record"])
        .arg(agent.dir.path().join("recordings"))
        .output()
        .expect("it ends");
    assert_eq!(second.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&second.stderr).contains("another agent"), "{second:?}");
}

/// A recording contains the arm of the controller, even after a host has sent a new arm to the controller.
#[test]
fn the_arm_in_a_recording_is_that_of_the_controller() {
    let agent = recording();
    let mut arm = jtc_host::Arm::avena();
    let file = agent.dir.path().join("mine.toml");
    let of_recording = |n: usize| {
        let info = read(&recorded(&agent, ".mcap", n)[n - 1]).info.expect("its arm");
        (info.arm, info.gains.expect("gains")[2].kp, info.hash)
    };
    let of_arm = |arm: &jtc_host::Arm| {
        (arm.name.clone(), arm.pid.expect("gains")[2].kp, arm.hash().expect("it can be sent"))
    };
    agent.jtc(&["jog", "1", "0.1", "--duration", "0.3"]).ends(0);
    assert_eq!(of_recording(1), of_arm(&arm));
    arm.name = "mine".into();
    arm.pid.as_mut().expect("gains")[2].kp = 6000.0;
    std::fs::write(&file, arm.to_toml()).expect("a file");
    let file = file.to_str().expect("a name");
    agent.jtc(&["disable", "--yes"]).ends(0);
    agent.jtc(&["arm", "push", file]).ends(0);
    agent.jtc(&["recover", "--arm", file]).ends(0);
    agent.jtc(&["jog", "1", "0.1", "--duration", "0.3"]).ends(0);
    assert_eq!(of_recording(2), of_arm(&arm));
}
