//! Boards and buses from which nothing comes: what was asked, where, why, and the next command are always reported.

mod common;

use cli_kit::trial::ended;
use common::Sim;

/// A recorder of a silent bus reports so once, to people only; with frames there is nothing to report.
#[test]
fn a_recorder_of_a_silent_bus_reports_it_once() {
    let sim = Sim::start(&["--boards", "2"]);
    let file = sim.path("silent.log");
    let output = sim.ucom(&["record", &file, "--for", "4"]).ends(0);
    assert_eq!(output.err.matches("nothing has come of the bus yet").count(), 1, "{}", output.err);
    assert!(output.err.contains("ucom doctor"), "{}", output.err);
    let piped = sim.ucom(&["record", "-", "--for", "3"]).ends(0);
    assert!(piped.out.is_empty() && piped.err.contains("nothing has come"), "{}", piped.err);
    let program = sim.ucom(&["--json", "record", &file, "--for", "3", "--force"]).ends(0);
    assert!(program.err.is_empty(), "{}", program.err);
    let mut peer = sim.peer();
    let child = sim.spawn(&["record", &file, "--count", "1", "--force"]);
    let ask = std::thread::spawn(move || {
        // Until the recorder is on the bus.
        for _ in 0..40 {
            peer.send("240#");
            std::thread::sleep(std::time::Duration::from_millis(25));
        }
    });
    let output = ended(child).ends(0);
    ask.join().unwrap();
    assert!(!output.err.contains("nothing has come"), "{}", output.err);
}
