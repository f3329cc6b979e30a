//! Tests of the stored arm, which the board keeps without power (J-54).
use super::*;
use crate::extension::arm::IMAGE_PER_TICK;

/// Returns the image of an arm other than the built-in arm, and the hash of this arm.
pub(super) fn other_arm() -> (Vec<u8>, u64) {
    let mut bench = Bench::new();
    assert_eq!(bench.set(33, 0, 3.0), DataStatus::NoError);
    assert_eq!(bench.set(8, 4, 1.3), DataStatus::NoError);
    bench.send(0, &fixed::set_name(&Name::cut("other")));
    bench.use_defaults();
    let mut gains = vec![0; 126];
    jtc_wire::pid_param(&mut gains, &[[900.0, 1.0, 2.0, -3.0, 3.0]; JOINTS]).expect("it fits");
    bench.send(0, &gains);
    bench.send(0, &fixed::FRICTION_TABLE_USE_DEFAULT);
    let hash = bench.info(0).hash;
    assert_eq!(bench.send(0, &fixed::STORE_ARM), DataStatus::NoError);
    assert_eq!(bench.info(0).store, StoreState::Busy);
    (bench.controller.stored_arm().to_vec(), hash)
}

#[test]
fn j54_a_stored_arm_is_what_the_defaults_mean_after_the_next_start() {
    let (image, hash) = other_arm();
    let mut bench = Bench::new();
    assert!(bench.controller.load_arm(&image));
    let info = bench.info(0);
    assert_eq!((info.missing, info.arm.as_str(), info.defaults_stored), (7, "other", true));
    assert_eq!(bench.controller.config.gravity[1], 3.0);
    assert_ne!(info.hash, hash, "its parameters are not in use yet");
    // A host can request default friction as a polynomial or as a table. The friction of the stored arm is a table,
    // and the controller uses it for both requests.
    bench.use_defaults();
    let info = bench.info(0);
    assert_eq!((info.hash, info.missing), (hash, 0));
    assert!(bench.controller.parameters.friction_is_table);
    assert_eq!(bench.image(), image);
}

#[test]
fn j54_storing_is_asked_of_the_board_once_and_in_init_or_error_only() {
    let mut bench = Bench::new();
    bench.info(0);
    assert_eq!(bench.send(0, &fixed::STORE_ARM), DataStatus::NotAllowed, "nobody gave parameters");
    bench.use_defaults();
    // The parameters that the host has sent can be stored even after the controller has withdrawn them, for example
    // because of Disable.
    bench.controller.parameters.withdraw_all();
    for state in [ControllerState::HoldPos, ControllerState::Operate, ControllerState::Teaching] {
        bench.controller.state = state;
        assert_eq!(bench.at_once(Command::StoreArm), DataStatus::NotAllowed, "{state:?}");
    }
    bench.controller.state = ControllerState::Init;
    bench.controller.set_store_state(StoreState::Absent, 0);
    assert_eq!(bench.at_once(Command::StoreArm), DataStatus::NotAllowed, "no memory");
    bench.controller.set_store_state(StoreState::Failed, 3);
    let frame = FrameRef::new_checked(&fixed::STORE_ARM).expect("a good frame");
    let host = [HostEvent { line: 0, overtaken: false, plain: false, event: LinkEvent::Frame(frame) }];
    let (mut asked, mut ticks) = (0, 0);
    loop {
        let outputs = bench.tick(&host);
        ticks += 1;
        asked += usize::from(outputs.store);
        if outputs.host_done > 0 {
            assert!(outputs.store, "in the tick in which it is whole");
            break;
        }
    }
    let length = bench.controller.stored_arm().len();
    assert_eq!((asked, ticks), (1, length.div_ceil(IMAGE_PER_TICK)));
    bench.run(100);
    assert_eq!(bench.send(0, &fixed::STORE_ARM), DataStatus::NotAllowed, "it is busy");
}

/// The controller loads an image only if it would also accept the same values in single frames.
#[test]
fn j54_an_image_with_any_bit_flipped_is_refused_or_another_arm_that_is_taken() {
    let mut bench = Bench::new();
    bench.use_defaults();
    let image = bench.image();
    let hash = Hash::of_image(&image);
    for at in 0..image.len() {
        for bit in [0, 3, 7] {
            let mut image = image.clone();
            image[at] ^= 1 << bit;
            let mut bench = Bench::new();
            let before = bench.info(0);
            if bench.controller.load_arm(&image) {
                if bench.asks_for_defaults().contains(&DataStatus::IncorrectValue) {
                    // The controller refuses the parameters of this arm, because its joints have too little inertia
                    // for its gains (J-71).
                    let (own, config) = (&bench.controller.parameters, &bench.controller.config);
                    assert!(own.gains_were_too_much(config), "byte {at}");
                    assert_ne!(own.missing(), 0, "byte {at}");
                    continue;
                }
                let info = bench.info(0);
                // The flipped bit may replace the number of a setting by the number of another setting. If the
                // replaced setting had its default value, the arm is unchanged.
                let same = bench.controller.config() == &Config::avena();
                assert!(info.hash != hash || at >= image.len() - 32 || same, "byte {at}");
                assert!(bench.controller.config.check().is_ok());
            } else {
                assert_eq!(bench.info(0).hash, before.hash, "byte {at}");
                assert_eq!(bench.controller.config(), &Config::avena());
            }
        }
    }
}

/// If the controller cannot use the stored arm, it does not use the built-in arm instead.
#[test]
fn j54_defaults_are_refused_where_the_stored_arm_cannot_be_used() {
    let (mut image, _) = other_arm();
    image[8..12].copy_from_slice(&f32::NAN.to_be_bytes());
    let mut bench = Bench::new();
    bench.info(0);
    assert!(!bench.controller.load_arm(&image));
    let refused = |bench: &mut Bench| bench.send(0, &fixed::PID_PARAM_USE_DEFAULT);
    assert_eq!(refused(&mut bench), DataStatus::NotAllowed);
    // If the board reports that it could not write the arm, the UseDefault frames are refused. After the next start
    // of the board, they would refer to another arm.
    let mut bench = Bench::new();
    bench.use_defaults();
    bench.info(0);
    assert_eq!(bench.send(0, &fixed::STORE_ARM), DataStatus::NoError);
    assert_eq!(refused(&mut bench), DataStatus::NoError);
    bench.controller.set_store_state(StoreState::Failed, 0);
    assert_eq!(refused(&mut bench), DataStatus::NotAllowed);
    assert!(!bench.info(0).defaults_stored);
    assert_eq!(bench.send(0, &fixed::STORE_ARM), DataStatus::NoError, "what is in use can be stored again");
}
