//! Tests with clients that use up all connections of the agent. These tests are a separate program, because they open
//! as many connections as a process may open.
#[allow(dead_code, reason = "the suite uses more")]
mod common;

use common::Served;

#[test]
fn a_stop_is_answered_whoever_takes_all_connections() {
    let served = Served::start(1);
    test_kit::flood::stops_are_answered_in_every_flood(
        &served,
        "PUT /api/boards/1/outputs",
        &["POST /api/stop"],
    );
}
