//! Complete sessions with a host and an arm, in virtual time. In every tick, the values of the board must be
//! bit-identical to the values that a controller on the PC computes. The module `rig` checks this.
mod rig;

use jtc_core::{Config, ControllerState, Parameters, TrajectoryState};
use jtc_dynamics::Dynamics;
use jtc_sim::{SimConfig, host as frames};
use jtc_wire::{DataStatus, ExecCommand, FrameStatus, RawPoint, Response, fixed, pid_param};
use openjtc_emulator::{BoardConfig, Port};
use rig::{BOARDS, Rig, fast_elf};

const HOST: Port = Port::Usart2;
const GOAL: [f64; 6] = [0.5, 0.4, -0.5, 0.4, -0.3, 0.6];

/// Returns a motion to another position and back. The motion takes 4 s and has 1001 points, 4 ms apart.
fn motion() -> Vec<RawPoint> {
    let points = frames::there_and_back(&[0.0; 6], &GOAL, 2.0, 1, 4);
    assert_eq!(points.len(), 1001);
    points
}

impl Rig {
    fn upload(&mut self, points: &[RawPoint], step_ms: u16) {
        for segment in frames::trajectory(points, step_ms, 113) {
            self.ask(HOST, &segment);
        }
        assert_eq!(self.telemetry().trajectory, TrajectoryState::Stop);
    }

    fn exec(&mut self, command: ExecCommand) -> Response {
        self.response(HOST, &frames::exec(command))
    }

    /// Returns the largest difference between a joint position of the simulated arm and its commanded position, rad.
    fn following_error(&self) -> f64 {
        let real = self.board.plant().truth().q;
        let joints = self.telemetry().joints;
        (0..6).map(|j| (joints[j].set_position - real[j]).abs()).fold(0.0, f64::max)
    }

    /// Returns the largest joint speed of the simulated arm, rad/s.
    fn speed(&self) -> f64 {
        self.board.plant().truth().qd.iter().fold(0.0, |most: f64, v| most.max(v.abs()))
    }
}

/// Runs the board until the trajectory is in this execution state. Returns the largest following error.
#[track_caller]
fn follow(rig: &mut Rig, until: TrajectoryState, ms: u64) -> f64 {
    let mut worst: f64 = 0.0;
    rig.wait("the end of the motion", ms, |rig| {
        worst = worst.max(rig.following_error());
        rig.telemetry().trajectory == until
    });
    worst
}

fn accepted(response: Response) -> bool {
    (response.status, response.data) == (FrameStatus::NoError, DataStatus::NoError)
}

/// J-20, J-30..J-34, J-25: a session with defaults, upload, execution, pause, resume, stop, execution to the end and
/// Teaching.
#[test]
fn a_whole_session() {
    let mut rig = Rig::new(BOARDS[0]);
    rig.bring_up(HOST);
    let limit = Config::default().joints.map(|j| j.position_error_max).into_iter().fold(f64::MAX, f64::min);
    // J-51: after GetInfo, the controller may use every data status in the records of this upload, including 7 and 8.
    rig.ask(HOST, &fixed::GET_INFO);
    rig.upload(&motion(), 4);

    // J-33: after Pause, the arm slows down along the path and comes to rest. The test then sends Resume and Stop.
    assert!(accepted(rig.exec(ExecCommand::Execute)));
    rig.run(1_000);
    assert_eq!(rig.state(), ControllerState::Operate);
    let moving = rig.speed();
    assert!(moving > 0.1, "the arm moves at {moving} rad/s");
    assert!(accepted(rig.exec(ExecCommand::Pause)));
    let paused = follow(&mut rig, TrajectoryState::Pause, 1_000);
    rig.run(300);
    assert!(rig.speed() < 0.02, "at rest: {} rad/s", rig.speed());
    let held = rig.telemetry().point;
    assert!((500..3_000).contains(&held), "point {held}");
    rig.run(200);
    assert_eq!((rig.telemetry().point, rig.state()), (held, ControllerState::HoldPos));
    assert!(accepted(rig.exec(ExecCommand::Execute)));
    rig.run(500);
    assert!(rig.telemetry().point > held, "it goes on where it was");
    assert!(accepted(rig.exec(ExecCommand::Stop)));
    let stopped = follow(&mut rig, TrajectoryState::Stop, 1_000);
    // J-34: execution cannot start from a position in the middle of the path. J-51: only a host that has recently sent
    // GetInfo receives the reason of the rejection.
    assert_eq!(rig.exec(ExecCommand::Execute).data, DataStatus::IncorrectValue);
    rig.ask(HOST, &fixed::GET_INFO);
    assert_eq!(rig.exec(ExecCommand::Execute).data, DataStatus::StartPositionMismatch);
    assert_eq!(rig.exec(ExecCommand::Pause).data, DataStatus::NotAllowed);

    // J-31: the arm moves to the start position and then executes the complete trajectory.
    let here = rig.telemetry().joints.map(|j| j.set_position);
    rig.upload(&frames::there_and_back(&here, &[0.0; 6], 2.0, 1, 10)[..201], 10);
    assert!(accepted(rig.exec(ExecCommand::Execute)));
    follow(&mut rig, TrajectoryState::Finish, 4_000);
    rig.upload(&motion(), 4);
    assert!(accepted(rig.exec(ExecCommand::Execute)));
    let followed = follow(&mut rig, TrajectoryState::Finish, 6_000);
    assert_eq!(rig.telemetry().point, 4_000, "the last 1 ms point");
    for (name, error) in [("paused", paused), ("stopped", stopped), ("followed", followed)] {
        println!("{name}: {error:.5} rad");
        assert!(error < limit / 2.0, "{name}: {error} rad, the limit is {limit}");
    }

    // J-25: after the last point, the controller can change to Teaching.
    rig.wait("HoldPos after the last point", 10, |rig| rig.state() == ControllerState::HoldPos);
    rig.ask(HOST, &fixed::TEACHING_MODE_ENABLE);
    // Teaching begins when the integral term of the position controller has settled after the motion.
    rig.wait("Teaching", 3_000, |rig| rig.state() == ControllerState::Teaching);
    rig.run(500);
    assert_eq!(rig.state(), ControllerState::Teaching);
    assert!(rig.speed() < 1.2);
    rig.ask(HOST, &fixed::TEACHING_MODE_DISABLE);
    rig.run(300);
    assert_eq!((rig.state(), rig.telemetry().trajectory), (ControllerState::HoldPos, TrajectoryState::Null));
    assert_eq!(rig.status(HOST).occurred, 0, "no error in all that time");
}

/// J-33: after a Stop, an arm with a load of 3.3 kg at the last link comes to rest within about half a second. The
/// arm model of the controller includes this load. At the Stop, the arm lowers the load, and the shoulder needs 95 %
/// of its torque limit.
#[test]
fn j33_a_loaded_arm_stands_within_half_a_second() {
    const SHOULDER: usize = 1;
    let mut parameters = Parameters::avena();
    parameters.model.links[6].mass += 3.3;
    let pose = |angle: f64| [0.0, angle, 0.3, 0.0, 0.0, 0.0];
    let torque = |angle: f64| {
        let dynamics = Dynamics::new(&parameters.model, Config::default().gravity);
        dynamics.inverse(&pose(angle), &[0.0; 6], &[0.0; 6])[SHOULDER]
    };
    let share = 0.95 * Config::default().joints[SHOULDER].torque_max;
    let place = (0..1_400).map(|mrad| -0.001 * f64::from(mrad)).find(|&angle| torque(angle) >= share);
    let place = place.expect("somewhere the arm is heavy enough");
    let sim = SimConfig { start: pose(place + 0.2), ..SimConfig::new(Config::default(), &parameters) };
    let mut rig = Rig::with(BOARDS[0], BoardConfig { sim, ..Default::default() });
    rig.wait("the board is up", 50, |rig| rig.ticks > 0);
    rig.ask(HOST, &fixed::FRICTION_POLYNOMIAL_USE_DEFAULT);
    rig.ask(HOST, &fixed::PID_PARAM_USE_DEFAULT);
    rig.ask(HOST, &frames::arm_model(&parameters.model));
    rig.wait_for_hold(12_000);
    let here = rig.telemetry().joints.map(|j| j.set_position);
    rig.upload(&frames::there_and_back(&here, &pose(place - 0.2), 3.6, 1, 10), 10);
    assert!(accepted(rig.exec(ExecCommand::Execute)));
    rig.wait("the place", 4_000, |rig| rig.telemetry().joints[SHOULDER].set_position <= place);
    assert!(accepted(rig.exec(ExecCommand::Stop)));
    let (mut stopped, mut stands, mut fastest) = (0, 0, 0.0f64);
    for ms in 1..=700 {
        rig.step();
        fastest = fastest.max(rig.speed());
        if rig.telemetry().trajectory == TrajectoryState::Execute {
            stopped = ms;
        }
        if rig.speed() > 0.01 {
            stands = ms;
        }
    }
    println!("stop at {place:.3} rad: commanded {stopped} ms, stands after {stands} ms, {fastest:.3} rad/s");
    assert!(fastest > 0.1, "it moved at {fastest} rad/s");
    assert!(stopped <= 500 && stands <= 520 && fastest < 0.25, "{stopped} ms, {stands} ms, {fastest} rad/s");
    assert_eq!((rig.state(), rig.telemetry().trajectory), (ControllerState::HoldPos, TrajectoryState::Stop));
    assert_eq!(rig.status(HOST).occurred, 0);
}

/// J-40: the host uploads its own parameters and friction tables, limits are exceeded, and errors occur. Every torque
/// is bit-identical to the torque that a PC computes. The bytes of every frame and status are also identical. The rig
/// compares these values in each tick; this test checks that all these cases have occurred.
#[test]
fn j40_torques_have_the_same_bits_as_on_a_pc() {
    let mut rig = Rig::new(BOARDS[0]);
    rig.wait("the board is up", 50, |rig| rig.ticks > 0);
    let mut frame = [0; 200];
    let gains = core::array::from_fn(|j| [7_000.1 + 90.0 * j as f64, 900.7, 61.3, -0.011, 0.013]);
    let n = pid_param(&mut frame, &gains).expect("it fits");
    rig.ask(HOST, &frame[..n]);
    rig.ask(HOST, &fixed::FRICTION_TABLE_USE_DEFAULT);
    rig.ask(HOST, &fixed::ARM_MODEL_USE_DEFAULT);
    rig.wait_for_hold(12_000);
    rig.upload(&motion(), 4);
    assert!(accepted(rig.exec(ExecCommand::Execute)));
    let mut moved = std::collections::BTreeSet::new();
    for _ in 0..1_500 {
        rig.step();
        moved.insert(rig.flight.torque.map(f64::to_bits));
    }
    assert!(moved.len() > 1_000, "{} different torques", moved.len());
    // Joint 2 gets stuck, because its friction is 30 times higher. The stuck joint yields, and the other joints stop
    // on the path (J-66).
    rig.inject(jtc_sim::FaultKind::Friction { joint: jtc_bus::Joint::ALL[1], factor: 30.0 });
    rig.wait("a held stop", 2_000, |rig| rig.state() == ControllerState::HoldPos);
    rig.run(200);
    assert_ne!(rig.status(HOST).joints[1].internal_occurred, 0, "of that joint");
}

/// A session works on all other boards and on the other serial line.
#[test]
fn a_short_session_on_every_board() {
    let points = frames::there_and_back(&[0.0; 6], &GOAL.map(|q| q / 4.0), 0.5, 1, 5);
    for board in BOARDS {
        let mut rig = Rig::new(board);
        rig.bring_up(Port::Usart3);
        rig.upload(&points, 5);
        assert!(accepted(rig.exec(ExecCommand::Execute)));
        follow(&mut rig, TrajectoryState::Finish, 2_500);
        assert_eq!((rig.telemetry().point, rig.status(HOST).occurred), (1000, 0), "{board}");
    }
}

/// The firmware for fast serial lines behaves like the firmware for the default bit rate.
#[test]
fn a_short_session_at_15_mbd() {
    let points = frames::there_and_back(&[0.0; 6], &GOAL.map(|q| q / 4.0), 0.5, 1, 5);
    let mut rig = Rig::of(fast_elf(), &BoardConfig { baud: 15_000_000, ..Default::default() });
    rig.bring_up(HOST);
    rig.upload(&points, 5);
    assert!(accepted(rig.exec(ExecCommand::Execute)));
    follow(&mut rig, TrajectoryState::Finish, 2_500);
}

/// J-12: the board enables and holds an arm with older drives, without errors. Older drives use another velocity
/// scale, handle one message per interrupt, and answer ChangeFsm with the code of the state transition.
#[test]
fn j12_older_drives_are_not_left_behind() {
    let sim = SimConfig {
        drives: [jtc_sim::DriveConfig { velocity_full_scale: 2.0, ..jtc_sim::DriveConfig::older() }; 6],
        ..SimConfig::default()
    };
    let mut rig = Rig::with(BOARDS[0], BoardConfig { sim, ..Default::default() });
    rig.bring_up(HOST);
    rig.run(500);
    assert_eq!(rig.state(), ControllerState::HoldPos);
    assert_eq!(rig.status(HOST).occurred, 0);
}

/// J-12: in each millisecond, the joint bus carries one broadcast of the controller and the answers to this broadcast.
/// The broadcast begins within microseconds of the tick.
#[test]
fn j12_one_broadcast_a_tick_and_its_answers() {
    let mut rig = Rig::new(BOARDS[0]);
    rig.bring_up(HOST);
    rig.upload(&motion(), 4);
    assert!(accepted(rig.exec(ExecCommand::Execute)));
    let mut entries = Vec::new();
    for ms in 0..1_500 {
        rig.step();
        let own = rig.bus.iter().filter(|e| e.from_controller).count();
        assert_eq!(own, 1, "ms {ms}");
        entries.extend(rig.bus.iter().cloned());
    }
    // The test groups the frames by ticks, from one broadcast to the next. A tick does not need to begin at the start
    // of a millisecond of this test.
    let first = entries.iter().position(|e| e.from_controller).expect("a broadcast");
    let rounds: Vec<_> = entries[first..].chunk_by(|_, next| !next.from_controller).collect();
    let mut starts = Vec::new();
    for round in &rounds[..rounds.len() - 1] {
        let (own, others) = (&round[0], &round[1..]);
        assert_eq!(others.len(), 7, "seven answers, at {}", own.start);
        starts.push(own.start);
        let request = own.frame.id().value();
        assert!(others.iter().all(|e| e.frame.id().value() & !7 == request | 0x200), "at {}", own.start);
        let length = others[6].end - own.start;
        assert!(length < 700 * openjtc_emulator::clock::MICROSECOND, "{length} at {}", own.start);
    }
    let period = openjtc_emulator::clock::MILLISECOND;
    for pair in starts.windows(2) {
        // The time from the start of the tick to the transmit request depends on the number of executed instructions.
        // Therefore the period between two broadcasts may differ from 1 ms by up to 30 µs.
        let off = (pair[1] - pair[0]).abs_diff(period);
        assert!(off < 30 * openjtc_emulator::clock::MICROSECOND, "{off}");
    }
}
