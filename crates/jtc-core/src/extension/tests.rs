//! Tests of the extensions with the frames, statuses and answers that a host sends and receives (J-50 to J-61).
extern crate std;
use std::boxed::Box;
use std::vec;
use std::vec::Vec;

use jtc_bus::Target;
use jtc_wire::{
    ArmImage, BootCause, EncodeError, FrameRef, FrameStatus, Hash, LinkEvent, PAGE_BYTES, Response,
    SettingValue, Status, UrgentCommand, fixed, missing_parameter, set_settings,
};

use super::*;
use crate::nodes::Nodes;
use crate::{HostEvent, Inputs, JOINTS, Outputs};

mod changes;
mod identity;
mod jogs;
mod motion;
mod setting_frames;
mod stored;
mod two_hosts;

/// Controller on two host lines, and its outputs.
struct Bench {
    controller: Box<Controller<[RawPoint; 8]>>,
    /// Answers that the controller has sent, each with the index of its line.
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

    /// Sends a frame on a line, and executes ticks until the response record is sent. Returns the data status of the response record.
    fn send(&mut self, line: usize, bytes: &[u8]) -> DataStatus {
        self.send_as(false, line, bytes)
    }

    /// Sends a frame on a line. If `plain` is `true`, the line is plain (J-51).
    fn send_as(&mut self, plain: bool, line: usize, bytes: &[u8]) -> DataStatus {
        let frame = FrameRef::new_checked(bytes).expect("a good frame");
        let host = [HostEvent { line, overtaken: false, plain, event: LinkEvent::Frame(frame) }];
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
        assert_eq!(self.asks_for_defaults(), [DataStatus::NoError; 3]);
    }

    /// Sends the three UseDefault frames to the controller. Returns the data status of each frame.
    fn asks_for_defaults(&mut self) -> [DataStatus; 3] {
        let frames = [
            fixed::FRICTION_POLYNOMIAL_USE_DEFAULT,
            fixed::PID_PARAM_USE_DEFAULT,
            fixed::ARM_MODEL_USE_DEFAULT,
        ];
        frames.map(|frame| self.send(1, &frame))
    }

    /// Reads the whole arm image, page by page.
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

    /// Executes a command directly, without a frame and without ticks. The simulated nodes need not be in the state
    /// that the test has set.
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
    // A request without an answer frame still has a response record.
    assert_eq!(bench.send(0, &fixed::set_name(&Name::cut("seven"))), DataStatus::NoError);
    bench.run(500);
    assert!(bench.answers.is_empty());
    assert_eq!(bench.info(0).arm.as_str(), "seven");
}

#[test]
fn j51_on_a_plain_line_no_data_status_is_above_6() {
    let mut bench = Bench::new();
    for line in [0, 1] {
        // The first frame is Execute without a trajectory, the second frame is a request that is not allowed in Init.
        for frame in [&fixed::EXECUTE[..], &fixed::TEACHING_MODE_ENABLE] {
            assert_eq!(bench.send_as(true, line, frame), DataStatus::IncorrectValue);
            assert_eq!(bench.send_as(false, line, frame), DataStatus::NotAllowed);
        }
    }
    // On a plain line, a data status up to 6 is unchanged, and each higher status is replaced by a status up to 6.
    for data in DataStatus::ALL {
        let plain = crate::host::in_plain_words(data);
        assert!(plain as u8 <= 6 && (plain == data || data as u8 > 6), "{data:?}: {plain:?}");
    }
}

#[test]
fn j52_j67_the_info_is_what_the_board_gave_the_controller() {
    let mut bench = Bench::new();
    bench.controller.set_identity(Identity {
        board: "bench",
        firmware: "1.2.3",
        revision: "0123456789abcdef-too-long",
        boots: 7,
        boot_cause: BootCause::Watchdog,
        program: Some(Program { bytes: 279_328, crc32: 0x1234_5678 }),
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
    assert_eq!(info.program, Some(Program { bytes: 279_328, crc32: 0x1234_5678 }), "J-67");
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
    // The hash of the arm does not include the name or the speed override. The hash of the arm includes each setting of the arm.
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
    // The next frames contain the gains, both kinds of friction, and the model.
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

/// The controller refuses a request while the answer to an earlier request waits to be sent. Otherwise the new answer
/// would replace the earlier one.
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
