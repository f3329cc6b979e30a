//! Tests of clients that use all connections of the agent. These tests are a separate program, because they open many
//! connections.
#[allow(dead_code, reason = "the suite uses more")]
mod common;

use common::Served;

#[test]
fn a_stop_is_answered_whoever_takes_all_connections() {
    let served = Served::start(921_600);
    let stops = ["POST /api/stop", "POST /api/pause"];
    test_kit::flood::stops_are_answered_in_every_flood(&served, "POST /api/gripper", &stops);
}
