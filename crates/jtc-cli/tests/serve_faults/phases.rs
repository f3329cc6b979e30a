//! Tests of job phases other than upload and motion, and of programs that use only HTTP.
use std::time::Duration;

use serde_json::{Value, json};

use super::cell::{Cell, trajectory};

/// Time after the trajectory check at which the upload of the long motion is in progress. The upload takes five
/// seconds.
pub(super) const IN_UPLOAD: Duration = Duration::from_millis(700);
/// Waiting time that is slightly longer than the hold-off after a Pause of a client or a policy. During the hold-off, no other client
/// can begin a motion.
const CALM: Duration = Duration::from_millis(3100);
/// Observation time during which the arm must stay at rest.
pub(super) const REST: Duration = Duration::from_millis(500);

pub(super) fn state(status: &Value) -> &str {
    status["state"].as_str().unwrap_or_default()
}

pub(super) fn is_taught(status: &Value) -> bool {
    state(status) == "Teaching"
}

/// Returns `true` if all drives are enabled. After the start, enabling takes some seconds.
pub(super) fn is_held(status: &Value) -> bool {
    let enabled = |joint: &Value| joint["state"] == "OperationEnable";
    state(status) == "HoldPos" && status["joints"].as_array().is_some_and(|joints| joints.iter().all(enabled))
}

/// Returns a trajectory file with 1600 points.
pub(super) fn long_motion(cell: &Cell) -> String {
    let text: String = (0..1600)
        .map(|i| {
            let (t, phase) = (0.005 * f64::from(i), std::f64::consts::PI * f64::from(i) / 1599.0);
            let q = 0.2 * phase.sin().powi(4);
            format!("{t:.3},{q},{q},{q},{q},{q},{q}\n")
        })
        .collect();
    let file = cell.dir.path().join("long.csv");
    std::fs::write(&file, format!("t,q1,q2,q3,q4,q5,q6\n{text}")).expect("a file");
    file.to_str().expect("a name").to_owned()
}

/// Waits until the arm has moved, and then pauses the motion.
pub(super) fn pause(cell: &Cell) {
    cell.until("Execute", |status| trajectory(status) == "Execute");
    cell.done(&["traj", "pause"]);
    cell.until("Pause", |status| trajectory(status) == "Pause" && is_held(status));
}

/// Switches off the torque and removes the parameters, so that `recover` must execute all of its steps.
fn disable(cell: &Cell) {
    cell.done(&["disable", "--yes"]);
    cell.until("Init", |status| state(status) == "Init");
}

/// Recovers the arm from any state, in the same way as a user after a fault.
fn recover(cell: &Cell) {
    cell.done(&["recover", "--defaults"]);
    cell.until("a held arm", is_held);
}

#[test]
fn an_agent_that_is_killed_leaves_each_phase_as_it_is_and_another_goes_on_from_there() {
    let mut cell = Cell::new("115200", 50);
    let next = |cell: &mut Cell| {
        cell.kill_agent();
        cell.next_agent();
    };
    cell.until("a held arm", is_held);
    next(&mut cell);
    assert!(is_held(&cell.rests(REST)), "idle");

    let motion = cell.motion.clone();
    let run = cell.at(&["traj", "run", &long_motion(&cell)], "checked");
    std::thread::sleep(IN_UPLOAD);
    next(&mut cell);
    let message = run.ends_without_link();
    assert!(!message.contains("MOVING"), "nothing was begun: {message}");
    assert!(is_held(&cell.rests(REST)), "upload");

    let run = cell.at(&["traj", "run", &motion], "executing");
    pause(&cell);
    next(&mut cell);
    run.ends_without_link();
    assert_eq!(trajectory(&cell.rests(REST)), "Pause");
    cell.done(&["traj", "resume"]);
    cell.until("Finish", |status| trajectory(status) == "Finish");

    cell.done(&["teach", "on"]);
    next(&mut cell);
    assert!(is_taught(&cell.rests(REST)), "nobody ends it");
    cell.done(&["teach", "off"]);
    cell.until("HoldPos", is_held);

    disable(&cell);
    let recovery = cell.at(&["recover", "--defaults"], "step");
    next(&mut cell);
    recovery.ends_without_link();
    cell.rests(REST);
    recover(&cell);
}

#[test]
fn a_command_that_is_killed_leaves_what_it_has_begun_to_its_policy_or_as_it_is() {
    let cell = Cell::new("921600", 50);
    cell.at(&["teach", "record", cell.dir.path().join("taught.csv").to_str().expect("a name")], "teaching")
        .kill();
    assert!(is_taught(&cell.rests(REST)), "nobody ends it");
    cell.done(&["teach", "off"]);
    cell.until("HoldPos", is_held);

    for (policy, left) in [("continue", "Pause"), ("stop", "Stop")] {
        let run = cell.at(&["traj", "run", &cell.motion, "--when-gone", policy, "--approach"], "executing");
        pause(&cell);
        run.kill();
        let status = cell.until(left, |status| trajectory(status) == left);
        assert!(is_held(&status) && trajectory(&cell.rests(REST)) == left, "{policy}");
        std::thread::sleep(CALM);
    }

    disable(&cell);
    cell.at(&["recover", "--defaults"], "step").kill();
    cell.rests(REST);
    recover(&cell);
}

/// Time without a request after which the lease expires.
const LASTS: Duration = Duration::from_millis(1500);

/// HTTP client that sends nothing after its last request.
pub(super) struct Silent<'a> {
    cell: &'a Cell,
    key: String,
}

impl<'a> Silent<'a> {
    fn come(cell: &'a Cell, policy: &str) -> Self {
        Self::come_for(cell, policy, LASTS)
    }

    pub(super) fn come_for(cell: &'a Cell, policy: &str, lasts: Duration) -> Self {
        let lease = json!({ "name": "cell 3", "lasts_s": lasts.as_secs_f64(), "policy": policy });
        let (status, grant) = cell.http().api("POST /api/lease", None, Some(lease));
        assert_eq!((status, grant["held"].as_bool()), (200, Some(true)), "{grant}");
        Self { cell, key: grant["key"].as_str().expect("a key").to_owned() }
    }

    pub(super) fn ask(&self, request: &str, body: Value) -> Value {
        let (status, answer) = self.cell.http().api(request, Some(&self.key), Some(body));
        assert!((200..300).contains(&status), "{request}: {answer}");
        answer
    }

    /// Sends the last request of this client. The request starts a job.
    fn begins(self, request: &str, body: Value) -> Job<'a> {
        let last = self.cell.http().api("GET /api/status", None, None).1["last_event"].as_u64();
        let job = self.ask(request, body)["number"].as_u64().expect("a number");
        Job { cell: self.cell, job, last: last.expect("a number") }
    }
}

/// Job whose client does not send any more requests.
struct Job<'a> {
    cell: &'a Cell,
    job: u64,
    last: u64,
}

impl Job<'_> {
    fn reports(&mut self, kind: &str) {
        let found = self.cell.http().event(self.last, kind, |event| event["kind"] == kind);
        self.last = found.0;
    }

    /// Waits for the end of the job and returns it.
    fn ends(mut self) -> Value {
        self.reports("ended");
        self.cell.http().api(&format!("GET /api/jobs/{}", self.job), None, None).1
    }
}

#[test]
fn a_program_by_http_that_falls_silent_leaves_its_run_to_its_policy() {
    let cell = Cell::new("115200", 50);
    cell.until("a held arm", is_held);
    for (number, motion) in [(7, long_motion(&cell)), (8, cell.motion.clone())] {
        let text = std::fs::read_to_string(motion).expect("the motion");
        let body = json!({ "name": "motion", "text": text });
        let kept = cell.http().api(&format!("PUT /api/trajectories/{number}"), None, Some(body));
        assert_eq!(kept.0, 200, "{}", kept.1);
    }

    // The last event that the client received is the start of the check or the start of the upload, depending on the
    // speed of this computer. In both cases, the job must be stopped.
    let job = Silent::come(&cell, "pause").begins("POST /api/runs", json!({ "trajectory": 7 }));
    let ended = job.ends();
    assert_eq!(ended["stage"], "stopped", "{ended}");
    assert!(is_held(&cell.rests(CALM)), "{ended}");
    // With the policy `continue`, the motion continues as if the client were still connected.
    let mut job = Silent::come(&cell, "continue").begins("POST /api/runs", json!({ "trajectory": 8 }));
    job.reports("executing");
    pause(&cell);
    assert_eq!(trajectory(&cell.rests(2 * LASTS)), "Pause", "it stays at its position");
    cell.done(&["traj", "stop"]);
    assert_eq!(job.ends()["stage"], "stopped");
}

#[test]
fn a_program_by_http_that_falls_silent_leaves_teaching_to_its_policy_and_a_recovery_goes_on() {
    let cell = Cell::new("115200", 50);
    for (policy, taught) in [("continue", true), ("pause", false)] {
        Silent::come(&cell, policy).ask("POST /api/teach", json!({ "on": true }));
        cell.until("Teaching", is_taught);
        if taught {
            std::thread::sleep(2 * LASTS);
            assert!(is_taught(&cell.status()), "{policy}");
            cell.done(&["teach", "off"]);
        }
        cell.until("HoldPos", is_held);
        if !taught {
            std::thread::sleep(CALM);
        }
    }

    disable(&cell);
    let job = Silent::come(&cell, "continue").begins("POST /api/recover", json!({ "defaults": true }));
    assert_eq!(job.ends()["stage"], "finished");
    cell.until("a held arm", is_held);
}

#[test]
fn a_controller_that_is_gone_ends_the_agent_and_all_its_programs_in_each_phase() {
    let gone = |phase: &str| {
        let mut cell = Cell::new("115200", 50);
        let (motion, long) = (cell.motion.clone(), long_motion(&cell));
        let taught = cell.dir.path().join("taught.csv").to_str().expect("a name").to_owned();
        let program = match phase {
            "upload" => Some(cell.at(&["traj", "run", &long], "checked")),
            "pause" => Some(cell.at(&["traj", "run", &motion], "executing")),
            "teaching" => Some(cell.at(&["teach", "record", &taught], "teaching")),
            "recover" => {
                disable(&cell);
                Some(cell.at(&["recover", "--defaults"], "step"))
            }
            _ => None,
        };
        if phase == "pause" {
            pause(&cell);
        }
        if phase == "upload" {
            std::thread::sleep(IN_UPLOAD);
        }
        drop(cell.sim.take());
        if let Some(program) = program {
            program.ends_without_link();
        }
        assert_eq!(cell.agent.wait().expect("it ends").code(), Some(3), "{phase}");
    };
    std::thread::scope(|scope| {
        for phase in ["idle", "upload", "pause", "teaching", "recover"] {
            scope.spawn(move || gone(phase));
        }
    });
}
