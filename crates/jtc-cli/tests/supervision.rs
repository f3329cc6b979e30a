//! Tests of host supervision (J-59) as described in docs/arm.md. Motions of `jtc` run to their end. If the program of a motion is killed,
//! the controller pauses the motion.
#![cfg(unix)]

use crate::common;

use common::{Sim, agent::Agent, moving_while};
use test_kit::patience::Patience;

/// Returns a simulated arm that a controller with host supervision holds.
fn supervised(host_timeout_ms: u32) -> Sim {
    let sim = Sim::start(&[]);
    let arm = include_str!("../../../arms/avena.toml");
    let text = format!("{arm}\n[settings]\nhost_timeout_ms = {host_timeout_ms}\n");
    let arm = sim.file("supervised.toml", &text);
    sim.jtc(&["arm", "push", &arm]).ends(0);
    sim.held()
}

/// Trajectory file whose motion takes 8 s.
const MOTION: &str = "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n8,0.4,0,0,0,0,0\n";

#[test]
fn j59_a_motion_longer_than_the_timeout_comes_to_its_end() {
    // The timeout is longer than the longest delay of a program on a busy computer.
    let sim = supervised(4000);
    let file = sim.file("motion.csv", MOTION);
    assert_eq!(sim.json(&["traj", "run", &file], 0)["outcome"], "finished");
    sim.jtc(&["move", "--to", "0,0,0,0,0,0", "--speed", "5"]).ends(0);
    let agent = Agent::start(&["--port", sim.port.to_str().unwrap()]);
    assert_eq!(agent.jtc(&["--json", "traj", "run", &file]).ends(0).json()["outcome"], "finished");
}

#[test]
fn j59_a_motion_whose_program_was_killed_is_paused() {
    let sim = supervised(1000);
    let file = sim.file("motion.csv", MOTION);
    let mut child = moving_while(&sim, &["traj", "run", &file], 0.5);
    child.kill().unwrap();
    child.wait().unwrap();
    // Status requests of another program do not replace the frames of the killed program, so the controller still
    // pauses the motion.
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

/// The program of the motion is killed before the agent starts. The agent reads the timeout of the controller before
/// it forwards requests, so requests of other clients do not prevent the Pause.
#[test]
fn j59_no_question_stands_for_a_program_that_was_gone_before_the_agent_came() {
    let sim = supervised(3000);
    let file = sim.file("motion.csv", "t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n60,0.6,0,0,0,0,0\n");
    let mut child = moving_while(&sim, &["traj", "run", &file], 0.5);
    child.kill().unwrap();
    child.wait().unwrap();
    let agent = Agent::start(&["--port", sim.port.to_str().unwrap()]);
    let mut patience = Patience::begin();
    loop {
        // If the agent forwarded this request, the controller would receive a frame and would not pause the motion.
        agent.jtc(&["info"]);
        let status = agent.jtc(&["--json", "status"]).ends(0).json();
        if status["trajectory"] == "Pause" {
            break;
        }
        assert_eq!(status["trajectory"], "Execute", "{status}");
        patience.pause(format_args!("a paused motion: {status}"));
    }
}
