//! Tests of changed settings, and of joints that are marked as absent (J-53).
use super::*;

/// Returns settings in which joint 3 is absent at 0.5 rad.
fn without_joint_3() -> Config {
    let mut config = Config::avena();
    (config.absent[2], config.absent_position[2]) = (true, 0.5);
    config
}

fn tick_with(nodes: &mut Nodes, bus: &[Frame], config: &Config) {
    nodes.take(&inputs(bus, GOOD), config, Goal::Ready, &Commanded::default());
}

/// A joint is absent as soon as the settings say so. The states of the other joints do not change.
#[test]
fn j53_a_joint_is_absent_at_once_and_the_others_stay() {
    let (config, before) = (without_joint_3(), Config::avena());
    let mut nodes = ready();
    (nodes.velocity[2], nodes.nodes[2].unasked) = (0.25, Some(NodeState::READY));
    assert!(!nodes.use_settings(&config, &before));
    let node = nodes.node(2);
    assert!(node.absent() && !node.misbehaved && node.unasked.is_none());
    assert_eq!((nodes.positions()[2], nodes.velocities()[2]), (0.5, 0.0));
    assert_eq!(node.state(), NodeState::START);
    for n in [0, 1, 3, 4, 5, GRIPPER] {
        let node = nodes.node(n);
        assert!(node.seen && node.valid && !node.absent() && node.boot_left == 0, "node {n}");
    }
}

/// A joint that was absent before starts like every other joint: it must accept a configuration, and missing answers
/// are not an error while it starts.
#[test]
fn j53_a_joint_that_is_no_longer_absent_is_brought_up() {
    let (config, before) = (Config::avena(), without_joint_3());
    let mut nodes = ready();
    nodes.use_settings(&before, &config);
    assert!(!nodes.use_settings(&config, &before));
    let node = nodes.node(2);
    assert!(!node.absent() && !node.configured && !node.valid && !node.seen);
    assert_eq!(node.boot_left, config.node_boot_ms);
    assert!([0, 1, 3, 4, 5, GRIPPER].iter().all(|&n| nodes.node(n).valid && nodes.node(n).boot_left == 0));
    // The next tick must not treat the joint as absent again.
    tick_with(&mut nodes, &[], &config);
    assert!(!nodes.node(2).absent() && !nodes.node(2).valid);
}

/// If the drive of an absent joint answers, this is an error in each tick with an answer. The error remains if the
/// settings are applied again.
#[test]
fn j53_a_drive_of_an_absent_joint_that_answers_is_an_error_while_it_answers() {
    let config = without_joint_3();
    let mut nodes = ready();
    nodes.use_settings(&config, &Config::avena());
    for answers in [false, true, true, false, true, false, false] {
        let bus = [joint(2, NodeState::ENABLED)];
        tick_with(&mut nodes, if answers { &bus } else { &[] }, &config);
        let (misbehaved, target) = (nodes.node(2).misbehaved, nodes.node(2).request(Goal::Ready));
        let wanted = if answers { Target::Ready } else { Target::NoChange };
        assert_eq!((misbehaved, target), (answers, wanted));
        nodes.use_settings(&config, &config);
        assert_eq!((nodes.node(2).misbehaved, nodes.node(2).request(Goal::Ready)), (answers, wanted));
        assert_eq!(nodes.positions()[2], 0.5);
    }
}

/// The nodes must accept a new configuration if a setting changes that the controller sends to them, or if the full
/// scale of their speed changes. Other settings do not require a new configuration.
#[test]
fn j53_only_settings_of_the_nodes_require_a_new_configuration() {
    type Change = fn(&mut Config);
    let changes: [(Change, bool); 6] = [
        (|_| {}, false),
        (|config| config.ramp_ms += 1, false),
        (|config| config.joint_config_bits ^= 1, true),
        (|config| config.gripper_config_bits ^= 1, true),
        (|config| config.gripper = false, true),
        (|config| config.velocity_full_scale = 4.0, true),
    ];
    for (n, (change, again)) in changes.into_iter().enumerate() {
        let (before, mut config) = (Config::avena(), Config::avena());
        change(&mut config);
        let mut nodes = ready();
        assert_eq!(nodes.use_settings(&config, &before), again, "change {n}");
        assert!(nodes.nodes.iter().all(|node| node.configured != again && node.valid != again), "change {n}");
        assert_eq!(nodes.present(), if config.gripper { NODES } else { JOINTS });
    }
}

/// A clear returns `true` if a node in its mask has an error.
#[test]
fn j21_a_clear_tells_if_a_node_has_an_error() {
    for (mask, errors, any) in [
        (0x7F, [0; JOINTS], false),
        (0x7F, [0, 0, 0, 1, 0, 0], true),
        (0x7F, [1, 0, 0, 0, 0, 0], true),
        (0x7F, [0, 0, 0, 0, 0, 1], true),
        (0x77, [0, 0, 0, 1, 0, 0], false),
        (0x09, [1, 1, 1, 1, 1, 1], true),
    ] {
        let mut nodes = ready();
        (0..JOINTS).for_each(|n| nodes.nodes[n].report.errors = errors[n]);
        assert_eq!(nodes.clear(mask, false), any, "{mask:#x} {errors:?}");
    }
}
