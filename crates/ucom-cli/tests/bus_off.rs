//! Tests of CAN controllers that go bus-off and recover. The controllers belong to simulated boards and to clients of
//! `ucom sim`.
#![cfg(unix)]

use crate::common;

use common::Sim;

/// ISO 11898-1: when the wire works again, boards and clients that were bus-off recover.
#[test]
fn bus_off_is_not_for_ever() {
    let mut sim = Sim::numbered(&["--boards", "3"]);
    let mut peer = sim.peer();
    sim.fault("disturbed share=1 for_s=2");
    // For 2 s, the bus is disturbed. Each frame is repeated until the CAN controller of its sender is bus-off, so the
    // scan must fail.
    let during = sim.ucom(&["scan"]);
    assert_ne!(during.code, 0, "{}", during.out);
    std::thread::sleep(std::time::Duration::from_millis(2_000));
    peer.send("240#");
    peer.wait("4");
    let boards = sim.json(&["scan"], 0);
    assert_eq!(boards["boards"].as_array().unwrap().len(), 3, "{boards}");
}

/// An error frame informs a client that its controller is bus-off. The command `ucom` prints a message with the next
/// step, and the simulator also reports the bus-off on its stderr.
#[test]
fn the_bus_off_controller_is_named() {
    let mut sim = Sim::numbered(&["--boards", "2"]);
    let (mut sender, mut listener) = (sim.peer(), sim.peer());
    sim.fault("disturbed share=1 for_s=60");
    let output = sim.ucom(&["info", "1"]).ends(3);
    assert!(output.err.contains("the CAN controller of this computer is bus-off"), "{}", output.err);
    assert!(output.err.contains("next: check the bus with `ucom doctor`"), "{}", output.err);
    let output = sim.json(&["info", "1"], 3);
    assert!(output["error"]["message"].as_str().unwrap().contains("was bus-off meanwhile"), "{output}");
    assert!(output["error"]["hint"].as_str().unwrap().contains("ucom doctor"), "{output}");
    let output = sim.json(&["send", "201#"], 3);
    assert_eq!(output["error"]["code"], "bus-off", "{output}");
    let output = sim.json(&["doctor"], 3);
    assert!(output["findings"].to_string().contains("left the bus"), "{output}");
    sender.send("202#");
    assert_eq!(sender.all(500), [""; 0]);
    assert_eq!((sender.times_bus_off(), listener.times_bus_off()), (1, 0));
    assert_eq!(listener.all(100), [""; 0]);
}
