//! Tests with silent boards and buses. The report about silence always contains the request, the affected boards, the reason and the
//! next command.

use crate::common;

use cli_kit::testing::ended;
use common::Sim;

/// If the bus is silent, the command `record` reports the silence once, and only to users. If frames arrive, the command `record`
/// does not report silence.
#[test]
fn a_recorder_of_a_silent_bus_reports_it_once() {
    let sim = Sim::start(&["--boards", "2"]);
    let file = sim.path("silent.log");
    let output = sim.ucom(&["record", &file, "--for", "4"]).ends(0);
    assert_eq!(output.err.matches("no frame was received yet").count(), 1, "{}", output.err);
    assert!(output.err.contains("ucom doctor"), "{}", output.err);
    let piped = sim.ucom(&["record", "-", "--for", "3"]).ends(0);
    assert!(piped.out.is_empty() && piped.err.contains("no frame was received"), "{}", piped.err);
    let program = sim.ucom(&["--json", "record", &file, "--for", "3", "--overwrite"]).ends(0);
    assert!(!program.err.contains("no frame was received"), "{}", program.err);
    let mut peer = sim.peer();
    let child = sim.spawn(&["record", &file, "--count", "1", "--overwrite"]);
    let recorded = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
    let its = recorded.clone();
    let ask = std::thread::spawn(move || {
        // The test sends frames until the recorder has received one, because a slow computer starts the recorder late.
        while !its.load(std::sync::atomic::Ordering::Relaxed) {
            peer.send("240#");
            std::thread::sleep(std::time::Duration::from_millis(25));
        }
    });
    let output = ended(child).ends(0);
    recorded.store(true, std::sync::atomic::Ordering::Relaxed);
    ask.join().unwrap();
    assert!(!output.err.contains("no frame was received"), "{}", output.err);
}

/// The command reports each board without names, with the cause and the next command.
#[test]
fn every_board_without_names_is_reported() {
    let sim = Sim::start(&["--boards", "3"]);
    sim.ucom(&["init"]).ends(0);
    let one = sim.ucom(&["io", "2"]).ends(4);
    assert!(
        one.err.contains("names of inputs, outputs and parameters are not known: board 2: its application"),
        "{}",
        one.err
    );
    assert!(one.err.contains("`ucom start 2`"), "{}", one.err);
    let all = sim.ucom(&["io", "all"]).ends(4);
    for board in 1..=3 {
        assert!(
            all.err.contains(&format!(
                "board {board}: its application is not started; next: `ucom start {board}`"
            )),
            "{}",
            all.err
        );
    }
    assert!(all.err.contains("`ucom start 1,2,3`"), "{}", all.err);
    sim.ucom(&["start", "1"]).ends(0);
    let mixed = sim.ucom(&["--json", "io", "1-2,9"]).ends(4).json();
    let message = mixed["error"]["message"].as_str().unwrap();
    assert!(!message.contains("board 1") && message.contains("board 2: its application"), "{message}");
    assert!(message.contains("board 9 does not answer"), "{message}");
}
