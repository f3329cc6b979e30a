//! Test of the start of the arm from power-on to position hold, with the real protocol.
use jtc_core::ControllerState;
use jtc_sim::host::{Listener, use_defaults};
use jtc_sim::{SimConfig, World};

#[test]
fn j20_power_up_to_hold_position() {
    let config = SimConfig { start: [0.1, -0.4, 0.9, 0.2, -0.3, 0.5], ..SimConfig::default() };
    let mut world = World::new(config);
    world.host_write(&use_defaults());
    let mut host = Listener::default();
    let mut held_at = None;
    for _ in 0..6_000 {
        world.step();
        host.listen(&mut world);
        if world.telemetry().state == ControllerState::HoldPos
            && world.node_states()[..6] == [jtc_bus::NodeState::ENABLED; 6]
        {
            held_at.get_or_insert(world.now_us());
        }
    }
    for entry in world.log().entries() {
        println!("{entry}");
    }
    println!("{:?}", world.statistics());
    let held_at = held_at.expect("the arm is held");
    assert!((4_200_000..5_200_000).contains(&held_at), "held after {held_at} µs");
    for j in 0..6 {
        let error = world.truth().q[j] - world.config().start[j];
        assert!(error.abs() < 2e-3, "joint {j} is {error} rad away from where it started");
    }
    assert_eq!(host.responses.len(), 3);
    assert_eq!(host.last.map(|s| s.state), Some(ControllerState::HoldPos.into()));
}

#[test]
fn j20_boot_of_all_nodes_is_no_transmit_timeout() {
    let mut world = World::new(SimConfig::default());
    for _ in 0..300 {
        world.step();
        assert_eq!(world.telemetry().state, ControllerState::Init, "at {} µs", world.now_us());
    }
}
