//! Tests of the identity of the device, of the points in memory and of a stored arm that is not used (J-50, J-52, J-54, J-56, J-67).
use jtc_wire::Segment;
use jtc_wire::field::image as image_field;

use super::stored::other_arm;
use super::*;
use crate::config::defaults;

#[test]
fn j52_the_capabilities_are_those_of_the_board() {
    let always = capability::SETTINGS | capability::SPEED | capability::JOG | capability::PAYLOAD;
    let always = always | capability::STOP_CAUSE;
    // Every board has the capabilities of bits 0, 2, 3, 4 and 6.
    assert_eq!(always, 1 + 4 + 8 + 16 + 64);
    for (store, log, more) in [
        (StoreState::Absent, LogState::Absent, 0),
        (StoreState::Empty, LogState::Absent, 2),
        (StoreState::Absent, LogState::Recording, 32),
        (StoreState::Failed, LogState::Error, 2 + 32),
    ] {
        let mut bench = Bench::new();
        bench.controller.set_store_state(store, 0);
        bench.controller.extensions.log = log;
        let info = bench.info(0);
        assert_eq!((info.capabilities, info.log), (always + more, log), "{store:?} {log:?}");
    }
}

#[test]
fn j52_the_info_contains_nodes_lost_records_and_reactions() {
    let mut bench = Bench::new();
    // A record of a line that does not exist is lost.
    bench.controller.records.push(9, Response::NONE, false);
    bench.controller.records.push(9, Response::NONE, false);
    bench.controller.config.speed = 0.5;
    let info = bench.info(0);
    assert_eq!((info.nodes_missing, info.lost_records), (0x7F, 2), "no node has answered");
    assert_eq!(info.reactions, Some(bench.controller.reactions()));
    assert!(info.reactions.is_some_and(|reactions| reactions.stop.is_none() && reactions.yields == 0));
}

#[test]
fn j67_a_board_may_read_its_program_after_the_start() {
    let program = Some(Program { bytes: 4_096, crc32: 0x0BAD_CAFE });
    let mut bench = Bench::new();
    assert_eq!(bench.info(0).program, None);
    bench.controller.set_program(program);
    assert_eq!(bench.info(0).program, program);
    bench.controller.set_program(None);
    assert_eq!(bench.info(0).program, None);
}

/// FNV-1a with 64 bits: each byte is combined by XOR, and the result is multiplied by the prime. A zero byte separates the two texts.
#[test]
fn j56_the_hash_of_a_firmware_is_fnv_1a_of_version_and_revision() {
    let fnv = |bytes: &[u8]| {
        bytes.iter().fold(0xCBF2_9CE4_8422_2325, |hash: u64, byte| {
            (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01B3)
        })
    };
    assert_eq!(firmware_hash("1.2.3", "abc"), fnv(b"1.2.3\0abc"));
    assert_eq!(firmware_hash("", ""), fnv(b"\0"));
}

#[test]
fn j50_a_waiting_answer_does_not_refuse_other_commands() {
    let mut bench = Bench::new();
    assert_eq!(bench.at_once(Command::GetSettings { first: 0 }), DataStatus::NoError);
    assert_eq!(bench.at_once(Command::SetName(Name::cut("seven"))), DataStatus::NoError);
    assert_eq!(bench.at_once(Command::GetSettings { first: 0 }), DataStatus::NotAllowed);
}

/// The answer waits while the serial transmitters are busy.
#[test]
fn j50_an_answer_is_not_sent_to_a_busy_line() {
    let mut bench = Bench::new();
    bench.controller.since_status_ms = 0;
    assert_eq!(bench.at_once(Command::GetSettings { first: 0 }), DataStatus::NoError);
    for (status_free, line) in [(false, None), (false, None), (true, Some(0))] {
        let outputs = bench.controller.tick(&Inputs { status_free, ..Inputs::QUIET });
        assert_eq!((outputs.answer_line, outputs.status), (line, false), "{status_free}");
    }
}

#[test]
fn j56_points_are_read_from_the_requested_point() {
    let mut bench = Bench::new();
    let mut body = [0, 1, 0, 0, 0, 1, 0, 10].to_vec();
    let points: [RawPoint; 3] =
        core::array::from_fn(|i| RawPoint { position: [i as i16 + 1; JOINTS], ..RawPoint::default() });
    points.iter().for_each(|point| body.extend(point.emit()));
    let segment = Segment::parse(&body).expect("a segment");
    bench.controller.store.begin(&segment, false, false);
    bench.controller.store.copy(&segment, 0, 3);
    let passed = bench.controller.check.passed();
    bench.controller.store.commit(&segment, passed);
    for (asked, expected) in [(0, &points[..]), (1, &points[1..]), (3, &[])] {
        assert_eq!(bench.at_once(Command::GetPoints { first: asked }), DataStatus::NoError);
        bench.run(1);
        let (line, bytes) = bench.answers.pop().expect("an answer");
        let Some(Answer::Points { first, total, points }) =
            FrameRef::new_checked(&bytes).and_then(Answer::parse)
        else {
            panic!("no Points")
        };
        assert_eq!((line, first, total), (0, asked, 3));
        assert_eq!(points.iter().collect::<Vec<_>>(), expected, "{asked}");
    }
}

/// The stored arm is discarded only if the board reports that it could not write this arm. The arm is kept if the
/// board reports a failure without having written anything, or a successful end of writing.
#[test]
fn j54_only_a_storage_that_failed_discards_the_stored_arm() {
    let (image, _) = other_arm();
    for (before, state, kept) in [
        (StoreState::Empty, StoreState::Failed, true),
        (StoreState::Busy, StoreState::Stored, true),
        (StoreState::Stored, StoreState::Stored, true),
        (StoreState::Busy, StoreState::Failed, false),
    ] {
        let mut bench = Bench::new();
        assert!(bench.controller.load_arm(&image));
        bench.controller.set_store_state(before, 1);
        bench.controller.set_store_state(state, 2);
        assert_eq!(!bench.controller.stored_arm().is_empty(), kept, "{before:?} {state:?}");
        let expected = if kept { DataStatus::NoError } else { DataStatus::NotAllowed };
        assert_eq!(bench.send(0, &fixed::PID_PARAM_USE_DEFAULT), expected, "{before:?} {state:?}");
    }
}

/// The image contains other settings, another name, a friction table and other gains. A value is not finite, so the
/// controller refuses the image and changes nothing.
#[test]
fn j54_an_image_that_is_refused_changes_nothing() {
    let (image, _) = other_arm();
    for at in [image_field::PID.start, image_field::MODEL.start, image_field::FRICTION] {
        let mut image = image.clone();
        image[at..at + 4].copy_from_slice(&f32::NAN.to_be_bytes());
        let mut bench = Bench::new();
        assert!(!bench.controller.load_arm(&image), "{at}");
        assert_eq!(bench.controller.config(), &Config::avena(), "{at}");
        assert_eq!(bench.controller.stored_arm(), &[] as &[u8], "{at}");
        let parameters = &bench.controller.parameters;
        assert_eq!(parameters.pid, defaults::PID, "{at}");
        assert_eq!(parameters.built_in(), [true; 3], "{at}");
        assert!(parameters.tables.iter().all(|table| table.velocity == [0.0; 20]), "{at}");
        assert_eq!(bench.info(0).arm.as_str(), "avena", "{at}");
    }
}

/// After the stored arm was loaded, a host can read its gains, even before it has requested the parameters.
#[test]
fn j54_the_values_of_a_loaded_arm_are_kept_for_the_request() {
    let (image, _) = other_arm();
    let mut bench = Bench::new();
    assert!(bench.controller.load_arm(&image));
    assert_eq!(bench.controller.parameters.pid[5].kp, 900.0);
    assert_eq!(bench.controller.parameters.missing(), 7);
}

/// Parameters that a host sends in a frame are used even if an arm is stored. Only the UseDefault frames select the
/// parameters of the stored arm.
#[test]
fn j54_parameters_in_a_frame_are_used_also_if_an_arm_is_stored() {
    let (image, _) = other_arm();
    let mut gains = vec![0; 126];
    jtc_wire::pid_param(&mut gains, &[[800.0, 1.0, 2.0, -3.0, 3.0]; JOINTS]).expect("it fits");
    for unusable in [false, true] {
        let mut bench = Bench::new();
        assert!(bench.controller.load_arm(&image));
        bench.controller.extensions.unusable = unusable;
        assert_eq!(bench.send(0, &gains), DataStatus::NoError, "{unusable}");
        assert_eq!(bench.controller.parameters.pid[3].kp, 800.0, "{unusable}");
    }
}
