//! Compares `joint-bus.dbc` with the code. The DBC file must decode the values that the code has encoded.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use can_dbc::{AttributeValue, ByteOrder, Dbc, MessageId, Signal, ValueType};
use jtc_bus::{
    Answer, Frame, GRIPPER, GripperReport, JOINTS, JointReport, NODES, NodeState, Request, Scale, Target,
    config, error, motor_control, warning,
};
use proptest::prelude::*;

static DBC: LazyLock<Dbc> =
    LazyLock::new(|| Dbc::try_from(include_str!("../joint-bus.dbc")).expect("the file is a DBC"));

/// Returns the bits of a signal, highest bit first. A big-endian signal begins at its highest bit and continues with bit 7 of the next
/// byte.
fn bits_of(signal: &Signal) -> impl Iterator<Item = usize> {
    assert_eq!(signal.byte_order, ByteOrder::BigEndian);
    let (byte, bit) = (signal.start_bit as usize / 8, signal.start_bit as usize % 8);
    (byte * 8 + 7 - bit..).take(signal.size as usize).map(|place| place / 8 * 8 + 7 - place % 8)
}

/// Decodes the signals of a frame with the DBC file, in the units of this file.
fn decoded(frame: &Frame) -> BTreeMap<String, f64> {
    let id = MessageId::Standard(frame.id);
    let message = DBC.messages.iter().find(|message| message.id == id).expect("the file has this frame");
    // A report of 16 bytes does not contain the last signals.
    let held = |signal: &&Signal| (signal.start_bit / 8) < frame.data().len() as u64;
    message.signals.iter().filter(held).map(|signal| (signal.name.clone(), value(signal, frame))).collect()
}

fn value(signal: &Signal, frame: &Frame) -> f64 {
    let mut raw = 0_i64;
    for bit in bits_of(signal) {
        raw = raw << 1 | i64::from(frame.data()[bit / 8] >> (bit % 8) & 1);
    }
    if signal.value_type == ValueType::Signed && raw >> (signal.size - 1) & 1 == 1 {
        raw -= 1 << signal.size;
    }
    raw as f64 * signal.factor + signal.offset
}

/// Inserts the bits of a byte under their names in the DBC file.
fn flags(into: &mut BTreeMap<String, f64>, prefix: &str, suffix: &str, byte: u8, names: &[(&str, u8)]) {
    for (name, mask) in names {
        let set = f64::from(u8::from(byte & mask != 0));
        into.insert(format!("{prefix}{name}{suffix}"), set);
    }
}

const MOTOR_CONTROL: [(&str, u8); 8] = [
    ("foc_duration", motor_control::FOC_DURATION),
    ("over_voltage", motor_control::OVER_VOLTAGE),
    ("under_voltage", motor_control::UNDER_VOLTAGE),
    ("over_temperature", motor_control::OVER_TEMPERATURE),
    ("start_up", motor_control::START_UP),
    ("speed_feedback", motor_control::SPEED_FEEDBACK),
    ("over_current", motor_control::OVER_CURRENT),
    ("software", motor_control::SOFTWARE),
];
const ERRORS: [(&str, u8); 4] = [
    ("position_encoder", error::POSITION_ENCODER),
    ("motor_control", error::MOTOR_CONTROL),
    ("over_speed", error::OVER_SPEED),
    ("hardware", error::HARDWARE),
];
const WARNINGS: [(&str, u8); 4] = [
    ("position_not_accurate", warning::POSITION_NOT_ACCURATE),
    ("outside_working_area", warning::OUTSIDE_WORKING_AREA),
    ("magnetic_field", warning::MAGNETIC_FIELD),
    ("safety_line", warning::SAFETY_LINE),
];
const CONFIG: [(&str, u8); 5] = [
    ("working_area", config::WORKING_AREA),
    ("absolute_encoder", config::ABSOLUTE_ENCODER),
    ("safety_line", config::SAFETY_LINE),
    ("bus_watchdog", config::BUS_WATCHDOG),
    ("over_speed_trip", config::OVER_SPEED_TRIP),
];

fn same(decoded: &BTreeMap<String, f64>, expected: &BTreeMap<String, f64>, tolerance: f64) {
    assert!(decoded.keys().eq(expected.keys()), "{decoded:?} is not {expected:?}");
    for (name, value) in expected {
        assert!((decoded[name] - value).abs() <= tolerance, "{name}: {} is not {value}", decoded[name]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..Default::default() })]

    #[test]
    fn j11_requests(
        torque in prop::array::uniform6(-360.0..360.0_f64),
        pump: bool,
        mode in prop::array::uniform6(0..=2_u8),
        bits in prop::array::uniform6(0..0x20_u8),
        gripper in 0..=1_u8,
        targets in prop::array::uniform7(0..=3_u8),
    ) {
        let mut expected: BTreeMap<_, _> =
            (0..JOINTS).map(|joint| (format!("torque_{joint}"), torque[joint])).collect();
        expected.insert("pump".into(), f64::from(u8::from(pump)));
        same(&decoded(&Request::Move { torque, pump }.emit()), &expected, 0.0055);

        let target = targets.map(|byte| Target::from_byte(byte).unwrap());
        let name = |node| if node == GRIPPER { "target_gripper".into() } else { format!("target_{node}") };
        let expected = (0..NODES).map(|node| (name(node), targets[node].into())).collect();
        same(&decoded(&Request::ChangeFsm { target }.emit()), &expected, 0.0);

        let mut expected = BTreeMap::new();
        for joint in 0..JOINTS {
            expected.insert(format!("mode_{joint}"), mode[joint].into());
            flags(&mut expected, "", &format!("_{joint}"), bits[joint], &CONFIG);
        }
        expected.insert("safety_line_gripper".into(), gripper.into());
        let request = Request::ChangeMode { mode, config: bits, gripper: gripper * config::SAFETY_LINE };
        same(&decoded(&request.emit()), &expected, 0.0);
    }

    #[test]
    fn j11_answers(
        node in 0..JOINTS as u8,
        position in -3.1..3.1_f64,
        velocity in -2.0..2.0_f64,
        torque in -360.0..360.0_f64,
        bytes in prop::array::uniform7(any::<u8>()),
        motor_temperature: Option<u8>,
    ) {
        let scale = Scale::CURRENT;
        let [temperature, state, mc_current, mc_occurred, errors, warnings, other] = bytes;
        let report = JointReport {
            position, velocity, torque, temperature, state: NodeState::new(state), mc_current, mc_occurred, errors, warnings,
            motor_temperature,
        };
        let mut status = BTreeMap::from([("fsm".to_owned(), f64::from(state))]);
        flags(&mut status, "error_", "", errors, &ERRORS);
        flags(&mut status, "warning_", "", warnings, &WARNINGS);

        let mut expected = status.clone();
        let numbers = [("position", position), ("velocity", velocity), ("torque", torque)];
        expected.extend(numbers.map(|(name, value)| (name.to_owned(), value)));
        expected.insert("temperature".into(), temperature.into());
        flags(&mut expected, "mc_current_", "", mc_current, &MOTOR_CONTROL);
        flags(&mut expected, "mc_occurred_", "", mc_occurred, &MOTOR_CONTROL);
        expected.extend(motor_temperature.map(|value| ("motor_temperature".to_owned(), value.into())));
        let found = decoded(&Answer::Joint { node, report }.emit(scale));
        same(&found, &expected, 0.0055);
        prop_assert!((found["position"] - position).abs() < 1e-8);
        prop_assert!((found["velocity"] - velocity).abs() < 4e-5);

        let [pump, pressure1, pressure2] = [0, 1, 2].map(|bit| other >> bit & 1 == 1);
        let report = GripperReport { pump, pressure1, pressure2, state: NodeState::new(state), errors, warnings };
        let levels = [("pump", pump), ("pressure1", pressure1), ("pressure2", pressure2)];
        status.extend(levels.map(|(name, on)| (name.to_owned(), f64::from(u8::from(on)))));
        same(&decoded(&Answer::Gripper(report).emit(scale)), &status, 0.0);

        for node in 0..NODES as u8 {
            let expected = BTreeMap::from([("fsm".to_owned(), f64::from(state))]);
            same(&decoded(&Answer::State { node, state: NodeState::new(state) }.emit(scale)), &expected, 0.0);
            let expected = BTreeMap::from([("accepted".to_owned(), f64::from(u8::from(pump)))]);
            same(&decoded(&Answer::Mode { node, accepted: pump }.emit(scale)), &expected, 0.0);
        }
    }
}

#[test]
fn j11_the_file_has_the_frames_of_this_bus_and_no_others() {
    let in_code = |id: u16| {
        let frame = Frame::new(id, &[0; 24]).unwrap();
        Request::parse(&frame).is_ok() || Answer::parse(&frame, Scale::CURRENT).is_ok()
    };
    for id in 0..0x800 {
        let in_file = DBC.messages.iter().any(|message| message.id == MessageId::Standard(id));
        assert_eq!(in_file, in_code(id), "0x{id:03X}");
    }
    // Signals must not overlap.
    for message in &DBC.messages {
        let mut taken = vec![false; 8 * message.size as usize];
        for signal in &message.signals {
            for bit in bits_of(signal) {
                assert!(!std::mem::replace(&mut taken[bit], true), "{}.{}", message.name, signal.name);
            }
        }
    }
}

#[test]
fn j10_every_frame_is_can_fd() {
    for message in &DBC.messages {
        // The attribute value 14 means standard CAN FD.
        let is_fd = DBC.attribute_values_message.iter().any(|attribute| {
            attribute.message_id == message.id
                && attribute.name == "VFrameFormat"
                && attribute.value == AttributeValue::Uint(14)
        });
        assert!(is_fd, "{} is no CAN FD frame by the file", message.name);
    }
}

#[test]
fn states_have_the_same_names() {
    for description in &DBC.value_descriptions {
        let can_dbc::ValueDescription::Signal { name, value_descriptions, .. } = description else {
            continue;
        };
        if name != "fsm" {
            continue;
        }
        for value in value_descriptions {
            assert_eq!(value.description, NodeState::new(u8::try_from(value.id).unwrap()).description());
        }
    }
}
