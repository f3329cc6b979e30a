//! The extensions from the outside: frames in, statuses and answers out (J-50 to J-61).
extern crate std;
use std::boxed::Box;
use std::vec;
use std::vec::Vec;

use jtc_bus::Target;
use jtc_wire::{
    EncodeError, FrameRef, FrameStatus, LinkEvent, Response, Status, UrgentCommand, fixed, missing_parameter,
    set_settings,
};

use super::*;
use crate::nodes::Nodes;
use crate::{HostEvent, Inputs, JOINTS, Outputs};

/// A controller on two lines, and what came out of it.
struct Bench {
    controller: Box<Controller<[RawPoint; 8]>>,
    /// Answers by line.
    answers: Vec<(usize, Vec<u8>)>,
    records: Vec<(usize, Response)>,
}

impl Bench {
    fn new() -> Self {
        let controller = Box::new(Controller::new(Config::avena(), [RawPoint::default(); 8]));
        let mut bench = Self { controller, answers: Vec::new(), records: Vec::new() };
        bench.tick(&[]);
        bench.controller.set_store_state(StoreState::Empty, 0);
        bench
    }

    fn tick(&mut self, host: &[HostEvent<'_>]) -> Outputs {
        let outputs = self.controller.tick(&Inputs { host, ..Inputs::QUIET });
        if let Some(line) = outputs.answer_line {
            assert!(!outputs.status, "a waiting status goes first");
            self.answers.push((line, self.controller.answer_frame().to_vec()));
        }
        if outputs.status {
            let status = Status::parse(self.controller.status_frame()).expect("a status");
            self.records.extend(outputs.record_line.map(|line| (line, status.response)));
        }
        outputs
    }

    /// Sends a frame on a line and runs until its record; returns its data status.
    fn send(&mut self, line: usize, bytes: &[u8]) -> DataStatus {
        let frame = FrameRef::new_checked(bytes).expect("a good frame");
        let host = [HostEvent { line, overtaken: false, event: LinkEvent::Frame(frame) }];
        let before = self.records.len();
        for _ in 0..100 {
            if self.tick(&host).host_done > 0 {
                break;
            }
        }
        self.run(3);
        let records = &self.records[before..];
        assert_eq!(records.len(), 1, "one record a frame");
        assert_eq!((records[0].0, records[0].1.status), (line, FrameStatus::NoError));
        records[0].1.data
    }

    fn run(&mut self, ticks: usize) {
        for _ in 0..ticks {
            self.tick(&[]);
        }
    }

    fn info(&mut self, line: usize) -> Info {
        assert_eq!(self.send(line, &fixed::GET_INFO), DataStatus::NoError);
        let (at, bytes) = self.answers.pop().expect("an answer");
        assert_eq!((at, self.answers.len()), (line, 0));
        let Some(Answer::Info(info)) = FrameRef::new_checked(&bytes).and_then(Answer::parse) else {
            panic!("no Info")
        };
        info
    }

    fn set(&mut self, setting: u8, joint: u8, value: f64) -> DataStatus {
        self.send(0, &settings_frame(&[SettingValue { setting, joint, value }]).expect("it fits"))
    }

    fn use_defaults(&mut self) {
        for frame in [
            fixed::FRICTION_POLYNOMIAL_USE_DEFAULT,
            fixed::PID_PARAM_USE_DEFAULT,
            fixed::ARM_MODEL_USE_DEFAULT,
        ] {
            assert_eq!(self.send(1, &frame), DataStatus::NoError);
        }
    }

    /// The whole arm image, page by page.
    fn image(&mut self) -> Vec<u8> {
        let mut image = Vec::new();
        loop {
            assert_eq!(self.send(0, &fixed::get_arm(image.len() as u16)), DataStatus::NoError);
            let (_, bytes) = self.answers.pop().expect("an answer");
            let Some(Answer::Arm { offset, total, bytes }) =
                FrameRef::new_checked(&bytes).and_then(Answer::parse)
            else {
                panic!("no Arm")
            };
            assert_eq!(usize::from(offset), image.len());
            image.extend(bytes);
            if image.len() >= usize::from(total) {
                assert_eq!(image.len(), usize::from(total));
                return image;
            }
            assert_eq!(bytes.len(), PAGE_BYTES);
        }
    }

    fn force(&mut self, state: ControllerState) {
        self.controller.state = state;
        self.controller.nodes = Nodes::enabled_at([0.0; JOINTS], [0.0; JOINTS]);
    }

    /// Carries out a command at once, in a state that the bus does not bear out.
    fn at_once(&mut self, command: Command<'_>) -> DataStatus {
        match self.controller.carry_out_extension(0, command) {
            SliceOutcome::Done => DataStatus::NoError,
            SliceOutcome::Refused(status) => status,
            SliceOutcome::Unfinished(_) => DataStatus::Idle,
        }
    }
}

fn settings_frame(values: &[SettingValue]) -> Result<Vec<u8>, EncodeError> {
    let mut out = vec![0; 6 + VALUE_LEN * values.len().max(1)];
    set_settings(&mut out, values.iter().copied())?;
    Ok(out)
}

#[test]
fn j50_nothing_but_statuses_is_sent_before_a_request_and_then_on_its_line_only() {
    let mut bench = Bench::new();
    bench.run(500);
    assert!(bench.answers.is_empty());
    for line in [1, 0, 1] {
        let info = bench.info(line);
        assert_eq!((info.version, info.missing), (1, 7));
    }
    // A request that returns nothing has its record all the same.
    assert_eq!(bench.send(0, &fixed::set_name(&Name::cut("seven"))), DataStatus::NoError);
    bench.run(500);
    assert!(bench.answers.is_empty());
    assert_eq!(bench.info(0).arm.as_str(), "seven");
}

#[test]
fn j51_a_line_that_asked_is_told_what_others_are_not() {
    let mut bench = Bench::new();
    bench.info(1);
    assert_eq!(bench.send(0, &fixed::EXECUTE), DataStatus::IncorrectValue);
    assert_eq!(bench.send(1, &fixed::EXECUTE), DataStatus::NotAllowed);
    bench.run(10_000);
    assert_eq!(bench.send(1, &fixed::EXECUTE), DataStatus::IncorrectValue);
    // Any extension request is enough, also one that is refused.
    bench.force(ControllerState::Init);
    assert_eq!(bench.send(1, &fixed::DISABLE), DataStatus::NotAllowed);
    assert_eq!(bench.send(1, &fixed::EXECUTE), DataStatus::NotAllowed);
}

#[test]
fn j52_the_info_tells_what_the_board_told_the_controller() {
    let mut bench = Bench::new();
    bench.controller.set_identity(Identity {
        board: "bench",
        firmware: "1.2.3",
        revision: "0123456789abcdef-too-long",
        boots: 7,
        boot_cause: BootCause::Watchdog,
    });
    bench.controller.set_store_state(StoreState::Stored, 41);
    let info = bench.info(0);
    assert_eq!(
        (info.board.as_str(), info.firmware(), info.revision()),
        ("bench", "1.2.3", "0123456789abcdef")
    );
    assert_eq!(
        (info.boots, info.boot_cause, info.store, info.sequence),
        (7, BootCause::Watchdog, StoreState::Stored, 41)
    );
    assert_eq!((info.arm.as_str(), info.defaults_stored), ("avena", false));
    let later = bench.info(0);
    assert!(later.uptime_ms > info.uptime_ms);
}

#[test]
fn j52_the_hash_is_that_of_the_image_and_of_all_that_decides_how_the_arm_moves() {
    let mut bench = Bench::new();
    bench.use_defaults();
    let first = bench.info(0).hash;
    let image = bench.image();
    assert_eq!(Hash::of_image(&image), first);
    assert!(ArmImage::parse(&image).is_some());
    // Neither the name nor the speed override is part of it; each setting of the arm is.
    bench.send(0, &fixed::set_name(&Name::cut("another")));
    assert_eq!(bench.set(128, 0, 0.5), DataStatus::NoError);
    assert_eq!(bench.info(0).hash, first);
    let mut seen = vec![first];
    for value in settings::values(&Config::avena(), 0, true).collect::<Vec<_>>() {
        let row = settings::setting(value.setting).expect("a row");
        let steps = if row.whole { [1.0, -1.0] } else { [1e-6, -1e-6] };
        let taken = steps
            .iter()
            .any(|step| bench.set(value.setting, value.joint, value.value + step) == DataStatus::NoError);
        assert!(taken, "{} {}", row.name, value.joint);
        let hash = bench.info(0).hash;
        assert!(!seen.contains(&hash), "{} {}", row.name, value.joint);
        seen.push(hash);
        assert_eq!(bench.set(value.setting, value.joint, value.value), DataStatus::NoError, "{}", row.name);
        assert_eq!(bench.info(0).hash, first, "{}", row.name);
    }
    // Gains, friction of either kind, model.
    let mut gains = vec![0; 126];
    jtc_wire::pid_param(&mut gains, &[[900.0, 1.0, 2.0, -3.0, 3.0]; JOINTS]).expect("it fits");
    assert_eq!(bench.send(0, &gains), DataStatus::NoError);
    assert_ne!(bench.info(0).hash, first);
    bench.send(0, &fixed::PID_PARAM_USE_DEFAULT);
    assert_eq!(bench.info(0).hash, first);
    assert_eq!(bench.send(0, &fixed::FRICTION_TABLE_USE_DEFAULT), DataStatus::NoError);
    let table = bench.info(0).hash;
    assert_ne!(table, first);
    assert_eq!(Hash::of_image(&bench.image()), table);
}

#[test]
fn j53_settings_are_read_page_by_page() {
    let mut bench = Bench::new();
    let mut values = Vec::new();
    while values.len() < settings::count(false) {
        bench.send(1, &fixed::get_settings(values.len() as u16));
        let (line, bytes) = bench.answers.pop().expect("an answer");
        let frame = FrameRef::new_checked(&bytes).expect("a good frame");
        let Some(Answer::Settings { first, total, values: page }) = Answer::parse(frame) else {
            panic!("no Settings")
        };
        assert_eq!((line, usize::from(first), usize::from(total)), (1, values.len(), settings::count(false)));
        values.extend(page.iter());
    }
    assert_eq!(values, settings::values(&Config::avena(), 0, false).collect::<Vec<_>>());
}

#[test]
fn j53_settings_change_whole_and_without_torque_only() {
    let mut bench = Bench::new();
    bench.info(0);
    let good = SettingValue { setting: 34, joint: 0, value: 9.81 };
    let bad = SettingValue { setting: 3, joint: 2, value: -1.0 };
    let both = settings_frame(&[good, bad]).expect("it fits");
    assert_eq!(bench.send(0, &both), DataStatus::IncorrectValue);
    assert_eq!(bench.controller.config(), &Config::avena(), "nothing is half changed");
    for (state, taken) in [
        (ControllerState::Init, true),
        (ControllerState::Error, true),
        (ControllerState::HoldPos, false),
        (ControllerState::Teaching, false),
        (ControllerState::Operate, false),
    ] {
        let expected = if taken { DataStatus::NoError } else { DataStatus::NotAllowed };
        bench.controller.state = state;
        let frame = settings_frame(&[good]).expect("it fits");
        let values = Values::parse(&frame[4..frame.len() - 2]).expect("values");
        assert_eq!(bench.at_once(Command::SetSettings(values)), expected, "{state:?}");
        assert_eq!(bench.controller.config.gravity[2], if taken { 9.81 } else { -9.81 });
        // The speed override changes in every state.
        let frame = settings_frame(&[SettingValue { setting: 128, joint: 0, value: 0.5 }]).expect("it fits");
        let values = Values::parse(&frame[4..frame.len() - 2]).expect("values");
        assert_eq!(bench.at_once(Command::SetSettings(values)), DataStatus::NoError, "{state:?}");
        let name = Command::SetName(Name::default());
        assert_eq!(bench.at_once(name), expected, "{state:?}");
        bench.controller.use_settings(Config::avena());
    }
}

/// Gravity decides the torque of the model from the next tick on.
#[test]
fn j53_gravity_that_is_set_is_computed_with() {
    let mut bench = Bench::new();
    bench.use_defaults();
    let at = [0.0, 0.7, 0.3, 0.0, 0.2, 0.0];
    let before = bench.controller.parameters.dynamics.gravity_torque(&at);
    assert_eq!(bench.set(34, 0, 9.81), DataStatus::NoError);
    let after = bench.controller.parameters.dynamics.gravity_torque(&at);
    assert!(before.iter().zip(after).all(|(b, a)| (b + a).abs() < 1e-9) && before[1].abs() > 10.0);
}

/// What was received must also fit to the settings that come later.
#[test]
fn j53_settings_that_the_parameters_contradict_are_refused() {
    for (setting, value) in [(96, 7_000.0), (101, 0.5), (103, 0.001)] {
        let mut bench = Bench::new();
        assert_eq!(bench.set(setting, 0, value), DataStatus::NoError, "nothing was received yet");
        let mut bench = Bench::new();
        bench.use_defaults();
        assert_eq!(bench.set(setting, 0, value), DataStatus::IncorrectValue, "{setting}");
    }
    // And the other way round.
    let mut bench = Bench::new();
    bench.set(96, 0, 7_000.0);
    assert_eq!(bench.send(0, &fixed::PID_PARAM_USE_DEFAULT), DataStatus::IncorrectValue);
}

#[test]
fn j53_disable_is_for_an_arm_that_is_held_at_rest() {
    for (state, speed, taken) in [
        (ControllerState::HoldPos, 0.0, true),
        (ControllerState::HoldPos, 0.019, true),
        (ControllerState::HoldPos, 0.1, false),
        (ControllerState::Operate, 0.0, false),
        (ControllerState::Teaching, 0.0, false),
        (ControllerState::Init, 0.0, false),
        (ControllerState::Error, 0.0, false),
    ] {
        let mut bench = Bench::new();
        bench.use_defaults();
        bench.force(state);
        bench.controller.nodes = Nodes::enabled_at([0.0; JOINTS], [0.0, 0.0, speed, 0.0, 0.0, 0.0]);
        let expected = if taken { DataStatus::NoError } else { DataStatus::NotAllowed };
        assert_eq!(bench.at_once(Command::Disable), expected, "{state:?} {speed}");
        let all = missing_parameter::FRICTION | missing_parameter::PID | missing_parameter::MODEL;
        assert_eq!(bench.controller.parameters.missing(), if taken { all } else { 0 });
        if taken {
            bench.controller.choose_state();
            assert_eq!(bench.controller.state, ControllerState::Init);
        }
    }
    // What is jogged is not at rest.
    let mut bench = Bench::new();
    bench.use_defaults();
    bench.force(ControllerState::HoldPos);
    bench.controller.motion.set.jog(&[0.1; JOINTS]);
    assert_eq!(bench.at_once(Command::Disable), DataStatus::NotAllowed);
}

/// An arm that is not the one built in, as a stored image.
fn other_arm() -> (Vec<u8>, u64) {
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
    // Its friction is a table, whichever default an existing host asks for.
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
    // They may have been withdrawn since, as Disable does.
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
    let host = [HostEvent { line: 0, overtaken: false, event: LinkEvent::Frame(frame) }];
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

/// Whatever is loaded is an arm that the controller would have taken frame by frame.
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
                bench.use_defaults();
                let info = bench.info(0);
                // A value that is given twice, and left out elsewhere where it is the default, makes the same arm.
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

#[test]
fn j59_hosts_that_are_silent_end_teaching_and_pause_the_path() {
    use crate::execution::phase::Phase;
    for (limit, silent, ends) in [(0, 60_000, false), (500, 499, false), (500, 500, true)] {
        let mut bench = Bench::new();
        bench.controller.config.host_timeout_ms = limit;
        bench.controller.extensions.hosts_silent_ms = silent - 1;
        (bench.controller.teaching, bench.controller.trajectory) = (true, TrajectoryState::Execute);
        bench.controller.phase = Phase::Running { leave: None };
        bench.controller.watch_hosts(&Inputs::QUIET, 0);
        assert_eq!(bench.controller.teaching, !ends, "{limit} {silent}");
        let leave = ends.then_some(TrajectoryState::Pause);
        assert_eq!(bench.controller.phase, Phase::Running { leave }, "{limit} {silent}");
    }
    // A valid frame of any host is a sign of life, noise is none.
    let frame = FrameRef::new_checked(&fixed::GET_INFO).expect("a good frame");
    let noise = LinkEvent::Noise(Response::bad(0, FrameStatus::IncorrectHeader, 0));
    for (event, left) in [(LinkEvent::Frame(frame), 0), (noise, 78)] {
        let mut bench = Bench::new();
        bench.controller.extensions.hosts_silent_ms = 77;
        let host = [HostEvent { line: 1, overtaken: false, event }];
        bench.controller.watch_hosts(&Inputs { host: &host, ..Inputs::QUIET }, 1);
        assert_eq!(bench.controller.extensions.hosts_silent_ms, left);
    }
}

#[test]
fn j61_drives_are_asked_for_the_joint_torque_times_the_gain() {
    let mut bench = Bench::new();
    for (j, joint) in bench.controller.config.joints.iter_mut().enumerate() {
        joint.torque_gain = 1.0 + 0.1 * j as f64;
    }
    bench.force(ControllerState::HoldPos);
    let torque = [10.0, -20.0, 5.0, -1.0, 30.0, 8.0];
    let frame = bench.controller.frame(ControllerState::HoldPos, torque);
    let Ok(jtc_bus::Request::Move { torque: asked, .. }) = jtc_bus::Request::parse(&frame) else {
        panic!("{frame:?} is no Move: {:?}", Target::NoChange)
    };
    for j in 0..JOINTS {
        let expected = torque[j] * (1.0 + 0.1 * j as f64);
        assert!((asked[j] - expected).abs() < 0.02, "{} {expected}", asked[j]);
    }
    // What a drive reports is told as torque of the joint.
    let status = bench.controller.status(Response::NONE);
    let report = bench.controller.nodes.node(2).report.torque;
    assert!((f64::from(status.joints[2].torque) * 1.2 - report).abs() < 1e-6);
}

/// J-04, J-58: whoever wants the arm to stand ends a jog, too, and what was jogged before that does not begin again.
#[test]
fn j04_j58_a_stop_or_a_pause_ends_a_jog_and_cancels_those_before_it() {
    for command in [UrgentCommand::Stop, UrgentCommand::Pause] {
        let mut bench = Bench::new();
        bench.force(ControllerState::HoldPos);
        bench.controller.motion.set.hold_for_test();
        let mut frame = [0; 30];
        jtc_wire::floats(&mut frame, jtc_wire::FrameType::Jog, [0.3; JOINTS]).expect("it fits");
        let jog = FrameRef::new_checked(&frame).expect("a good frame");
        let host = |overtaken| [HostEvent { line: 0, overtaken, event: LinkEvent::Frame(jog) }];
        bench.controller.serve_host(&Inputs { host: &host(false), ..Inputs::QUIET });
        assert!(bench.controller.motion.set.jogging());
        let mut position = [0.0; JOINTS];
        for _ in 0..50 {
            bench.controller.motion.set.hold(&Config::avena());
        }
        let mut urgent = [jtc_wire::UrgentCommands::NONE; 2];
        urgent[1].push(command);
        bench.controller.serve_host(&Inputs { urgent, host: &host(true), ..Inputs::QUIET });
        let before = bench.controller.motion.set.point.velocity[2];
        for _ in 0..2_000 {
            bench.controller.motion.set.hold(&Config::avena());
            position = bench.controller.motion.set.point.position;
            // The acceleration has to turn first.
            assert!(bench.controller.motion.set.point.velocity[2] <= before + 0.1, "{before}");
        }
        assert!(!bench.controller.motion.set.jogging() && position[2] > 0.0);
    }
}

/// J-06: what changes the torque does so at standstill only.
#[test]
fn j58_parameters_and_resets_wait_for_the_end_of_a_jog() {
    let mut bench = Bench::new();
    bench.force(ControllerState::HoldPos);
    bench.controller.motion.set.hold_for_test();
    bench.controller.motion.set.jog(&[0.1; JOINTS]);
    for command in [
        Command::FrictionPolynomialUseDefault,
        Command::FrictionTableUseDefault,
        Command::PidParamUseDefault,
        Command::ArmModelUseDefault,
        Command::ResetCanDevices { nodes: 1 },
        Command::TrajSetExecStatus(jtc_wire::ExecCommand::Execute),
    ] {
        let outcome = bench.controller.carry_out(0, command);
        assert!(matches!(outcome, SliceOutcome::Refused(DataStatus::NotAllowed)), "{command}");
    }
}

/// A stored arm that cannot be used does not make the built-in one the arm that is meant.
#[test]
fn j54_defaults_are_refused_where_the_stored_arm_cannot_be_used() {
    let (mut image, _) = other_arm();
    image[8..12].copy_from_slice(&f32::NAN.to_be_bytes());
    let mut bench = Bench::new();
    bench.info(0);
    assert!(!bench.controller.load_arm(&image));
    let refused = |bench: &mut Bench| bench.send(0, &fixed::PID_PARAM_USE_DEFAULT);
    assert_eq!(refused(&mut bench), DataStatus::NotAllowed);
    // One that could not be written is another one after the next start.
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

/// What was given is checked, also when it was withdrawn since.
#[test]
fn j53_settings_fit_to_what_disable_has_withdrawn() {
    let mut bench = Bench::new();
    bench.use_defaults();
    bench.controller.parameters.withdraw_all();
    assert_eq!(bench.set(96, 0, 7_000.0), DataStatus::IncorrectValue);
    // Friction tables, too: one a tick.
    let mut bench = Bench::new();
    bench.use_defaults();
    bench.send(0, &fixed::FRICTION_TABLE_USE_DEFAULT);
    assert_eq!(bench.set(103, 0, 0.001), DataStatus::IncorrectValue);
    let before = bench.controller.telemetry().tick;
    assert_eq!(bench.set(34, 0, 9.81), DataStatus::NoError);
    assert!(bench.controller.telemetry().tick - before >= 6);
}

/// What is asked while an answer waits is refused rather than lost.
#[test]
fn j50_a_second_request_waits_for_the_first_answer() {
    let mut bench = Bench::new();
    bench.info(0);
    assert_eq!(bench.at_once(Command::GetSettings { first: 0 }), DataStatus::NoError);
    for command in [Command::GetInfo, Command::GetSettings { first: 0 }, Command::GetArm { offset: 0 }] {
        assert_eq!(bench.at_once(command), DataStatus::NotAllowed, "{command}");
    }
    bench.run(1);
    assert_eq!(bench.answers.len(), 1);
    assert_eq!(bench.at_once(Command::GetInfo), DataStatus::NoError);
}

/// In motion a few values are taken, not hundreds.
#[test]
fn j07_j53_settings_in_motion_are_few() {
    let value = SettingValue { setting: settings::SPEED, joint: 0, value: 0.5 };
    for (count, taken) in [(1, true), (LIVE_MAX, true), (LIVE_MAX + 1, false), (200, false)] {
        let mut bench = Bench::new();
        bench.controller.state = ControllerState::Operate;
        let frame = settings_frame(&vec![value; count]).expect("it fits");
        let values = Values::parse(&frame[4..frame.len() - 2]).expect("values");
        let outcome = bench.at_once(Command::SetSettings(values));
        assert_eq!(outcome, if taken { DataStatus::NoError } else { DataStatus::NotAllowed }, "{count}");
    }
}

#[test]
fn j33_settings_under_which_stops_fail_are_refused() {
    let mut bench = Bench::new();
    bench.info(0);
    for (setting, value, taken) in [(53, 501.0, false), (54, 999.0, false), (54, 1000.0, true)] {
        let expected = if taken { DataStatus::NoError } else { DataStatus::IncorrectValue };
        assert_eq!(bench.set(setting, 0, value), expected, "{setting} = {value}");
        bench.controller.use_settings(Config::avena());
    }
}
