//! Tests of `ucom repair` with `ucom sim`: one board gets its lost number again, and the other boards keep their
//! numbers.
#![cfg(unix)]

use crate::common;

use common::Sim;
use test_kit::patience::Patience;

/// Returns a chain of three boards; the second board has lost its number.
fn rebooted() -> Sim {
    let mut sim = Sim::numbered(&["--boards", "3"]);
    sim.fault("power-loss board=2 for_s=0.2");
    let mut patience = Patience::begin();
    loop {
        let there = sim.json(&["scan"], 0);
        let (boards, reports) =
            (there["boards"].as_array().unwrap().len(), there["reports"].as_array().unwrap().len());
        if (boards, reports) == (2, 3) {
            return sim;
        }
        patience.pause(format_args!("two boards that have numbers of three that report: {there}"));
    }
}

/// Section 5.4: the command first switches off the outgoing init pins (OPINIT) of number 2 and of all other numbers
/// except 1, three times. The board then gets its number, and its identity is read. At the end, its pin is switched on
/// and read back. The test compares the frames to number 2. The command reads the flash number from the inventory.
#[test]
fn d21_a_board_gets_its_number_back() {
    let sim = rebooted();
    let mut peer = sim.peer();
    let output = sim.json(&["repair", "2"], 0);
    assert_eq!((&output["repaired"], &output["board"]["number"]), (&true.into(), &2.into()), "{output}");
    let sent: Vec<String> =
        peer.all(100).into_iter().filter(|f| ["1C2#", "282#"].iter().any(|s| f.starts_with(s))).collect();
    assert_eq!(sent, ["1C2#0200", "1C2#0200", "1C2#0200", "282#", "1C2#0202"]);
    let all = sim.json(&["scan"], 0);
    assert_eq!(all["boards"].as_array().unwrap().len(), 3, "{all}");
    // If the board still has its number, the command changes neither the board nor its neighbours.
    let output = sim.ucom(&["repair", "2"]).ends(0);
    assert!(output.out.contains("board 2 has its number"), "{}", output.out);
    assert_eq!(sim.json(&["scan"], 0)["boards"], all["boards"]);
}

/// The exit code is 4 if another board answers, 3 if no board answers, and 2 if the board is ambiguous.
#[test]
fn repairs_that_are_refused() {
    let sim = rebooted();
    let output = sim.json(&["repair", "1", "--flash-id", "0x77"], 4);
    assert_eq!(output["error"]["code"], "wrong-board", "{output}");
    // The board that accepts the number has the wrong identity, so it does not keep the number.
    let output = sim.json(&["repair", "2", "--flash-id", "0x77"], 4);
    assert_eq!(output["error"]["code"], "wrong-board", "{output}");
    assert_eq!(sim.json(&["scan"], 0)["boards"].as_array().unwrap().len(), 2);
    let output = sim.ucom(&["repair", "9"]).ends(2);
    assert!(output.err.contains("--flash-id"), "{}", output.err);
    sim.ucom(&["repair", "2", "--inventory", "/nowhere.toml"]).ends(2);
    sim.ucom(&["repair", "2"]).ends(0);
    // All boards have numbers, so no board accepts the number 9.
    let output = sim.json(&["repair", "9", "--flash-id", "0x77"], 3);
    assert_eq!(output["error"]["code"], "no-answer", "{output}");
}
