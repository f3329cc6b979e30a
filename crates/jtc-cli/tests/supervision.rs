//! Host supervision (J-59) as docs/arm.md sets it: motions of `jtc` come to their end, and one whose program was killed is paused.
#![cfg(unix)]

mod common;

use common::{Sim, agent::Agent, moving_while};

/// An arm that is held by a controller that supervises its host.
fn supervised() -> Sim {
    let sim = Sim::start(&[]);
    let text = include_str!("../../../arms/avena.toml").to_owned() + "\n[settings]\nhost_timeout_ms = 1000\n";
    let arm = sim.file("supervised.toml", &text);
    sim.jtc(&["arm", "push", &arm]).ends(0);
    sim.held()
}

/// A motion of 4 s.
const MOTION: &str = "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n4,0.4,0,0,0,0,0\n";

#[test]
fn j59_a_motion_longer_than_the_timeout_comes_to_its_end() {
    let sim = supervised();
    let file = sim.file("motion.csv", MOTION);
    assert_eq!(sim.json(&["traj", "run", &file], 0)["outcome"], "finished");
    sim.jtc(&["move", "--to", "0,0,0,0,0,0", "--speed", "5"]).ends(0);
    let agent = Agent::start(&["--port", sim.port.to_str().unwrap()]);
    assert_eq!(agent.jtc(&["--json", "traj", "run", &file]).ends(0).json()["outcome"], "finished");
}

#[test]
fn j59_a_motion_whose_program_was_killed_is_paused() {
    let sim = supervised();
    let file = sim.file("motion.csv", MOTION);
    let mut child = moving_while(&sim, &["traj", "run", &file], 0.5);
    child.kill().unwrap();
    child.wait().unwrap();
    // A program that only watches does not keep it going.
    loop {
        let status = sim.json(&["status"], 0);
        let (state, trajectory) = (status["state"].as_str(), status["trajectory"].as_str());
        if (state, trajectory) == (Some("HoldPos"), Some("Pause")) {
            assert_eq!(status["errors"].as_array().map(Vec::len), Some(0), "{status}");
            break;
        }
        assert_eq!(trajectory, Some("Execute"), "{status}");
    }
}
