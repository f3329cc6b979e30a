//! Tests of the acceptance of parameters, and of the number of slices that each parameter needs (J-06).
extern crate std;
use std::vec::Vec;

use jtc_wire::Floats;

use super::*;

mod checks;
mod read_back;

#[test]
fn j06_a_model_may_need_the_whole_torque_limit() {
    for (times, held) in [(1.0, true), (0.999, false), (1.001, true)] {
        let (mut config, at) = (Config::avena(), [0.0; JOINTS]);
        config.gravity = [9.81, 0.0, 0.0];
        let parameters = HostParameters::new(&config);
        let needed = parameters.dynamics.gravity_torque(&at);
        assert!(needed[1].abs() > 1.0, "{needed:?}");
        for (joint, needed) in config.joints.iter_mut().zip(needed) {
            joint.torque_max = times * needed.abs();
        }
        assert_eq!(parameters.holdable(&at, &config), held, "{times}");
    }
}

/// Each tick processes the table of one joint: each table is checked once and copied once.
#[test]
fn j06_a_table_takes_twelve_ticks() {
    let crate::Friction::Table(tables) = crate::Parameters::avena_friction_table() else {
        panic!("no table")
    };
    let numbers = tables.iter().flat_map(|table| {
        table.velocity.into_iter().chain(table.temperature).chain(table.torque.into_iter().flatten())
    });
    let bytes: Vec<u8> = numbers.flat_map(f32::to_be_bytes).collect();
    let config = Config::avena();
    let (mut parameters, mut progress) = (HostParameters::new(&config), SliceProgress::Begin);
    for tick in 1..=12 {
        match parameters.take_table(&Floats::new(&bytes), progress, &config) {
            SliceOutcome::Unfinished(next) => progress = next,
            SliceOutcome::Done => assert_eq!(tick, 12),
            SliceOutcome::Refused(status) => panic!("{status:?} in tick {tick}"),
        }
        assert_eq!(parameters.friction_is_table, tick == 12, "{tick}");
    }
}
