//! Longest time of a tick. The program records the inputs of a motion in the simulator, and replays these inputs with new
//! controllers. The motion uses a friction table, and a segment arrives while the arm moves.
use std::hint::black_box;

use jtc_bus::Frame;
use jtc_core::{Config, Controller, ControllerState, HostEvent, Inputs, POINTS_MAX};
use jtc_host::frame;
use jtc_sim::{SimConfig, World};
use jtc_wire::{Command, ExecCommand, FRAME_MAX, FrameRef, LinkEvent, RawPoint};
use test_kit::clock::CpuTime;

use crate::world::Result;
use crate::{path, print};

/// Number of ticks of the motion.
const MOVING: usize = 5_000;
/// Number of replays of the recorded inputs.
const ROUNDS: usize = 15;

/// Inputs of the controller in one tick.
struct Seen {
    bus: Vec<Frame>,
    /// Index of the frame that the host offers to the controller in this tick. The host offers a frame until the
    /// controller has handled it.
    host: Option<usize>,
}

/// Returns a command as the bytes of its frame.
fn bytes(command: &Command<'_>) -> Result<Vec<u8>> {
    let mut bytes = vec![0; FRAME_MAX];
    let length = command.emit(&mut bytes)?;
    bytes.truncate(length);
    Ok(bytes)
}

/// Returns the frames of a host. Each entry also contains the state of the controller in which the host offers the
/// frame.
fn script() -> Result<Vec<(ControllerState, Vec<u8>)>> {
    use Command::{ArmModelUseDefault, FrictionTableUseDefault, PidParamUseDefault, TrajSetExecStatus};
    let mut frames = Vec::new();
    for command in [FrictionTableUseDefault, PidParamUseDefault, ArmModelUseDefault] {
        frames.push((ControllerState::Init, bytes(&command)?));
    }
    if let Some(friction) = jtc_host::Arm::avena().friction() {
        frames.push((ControllerState::HoldPos, frame::friction(&friction)?));
    }
    let points = path::raw(&path::smooth(MOVING / usize::from(path::STEP_MS) + 200))?;
    frames.push((ControllerState::HoldPos, frame::segment(1, 0, 1, path::STEP_MS, &points)?));
    frames.push((ControllerState::HoldPos, bytes(&TrajSetExecStatus(ExecCommand::Execute))?));
    Ok(frames)
}

fn controller() -> Controller<Vec<RawPoint>> {
    Controller::new(Config::avena(), vec![RawPoint::default(); POINTS_MAX])
}

fn event(bytes: &[u8]) -> Option<HostEvent<'_>> {
    let event = LinkEvent::Frame(FrameRef::new_checked(bytes)?);
    Some(HostEvent { line: 0, overtaken: false, plain: false, event })
}

fn inputs<'a>(bus: &'a [Frame], host: &'a Option<HostEvent<'a>>) -> Inputs<'a> {
    Inputs { bus, host: host.as_slice(), ..Inputs::QUIET }
}

/// Records the inputs of a complete session: start-up, parameters, upload, motion. The simulated drives answer the
/// simulator's own controller. A second controller receives the same inputs, and the host sends each frame when the
/// second controller is in the required state.
fn record(frames: &[(ControllerState, Vec<u8>)]) -> Vec<Seen> {
    let mut world = World::new(SimConfig { baud: None, ..SimConfig::default() });
    let mut shadow = controller();
    let (mut seen, mut next, mut moving) = (Vec::new(), 0, 0);
    let mut sent = 0;
    while moving < MOVING {
        let state = shadow.telemetry().state;
        let offered = (next < frames.len() && frames[next].0 == state).then_some(next);
        if let Some(index) = offered
            && index >= sent
        {
            world.host_write(&frames[index].1);
            sent = index + 1;
        }
        let bus: Vec<Frame> =
            world.bus_frames().iter().map(|timed| timed.frame).filter(|frame| frame.id >= 0x200).collect();
        let host = offered.and_then(|index| event(&frames[index].1));
        next += shadow.tick(&inputs(&bus, &host)).host_done;
        seen.push(Seen { bus, host: offered });
        world.step();
        moving += usize::from(state == ControllerState::Operate);
        assert!(seen.len() < 60_000, "the run does not get to its motion: {:?}", shadow.telemetry());
    }
    seen
}

pub(crate) fn figures() -> Result<()> {
    let frames = script()?;
    let seen = record(&frames);
    // For each tick, the program uses the minimum over all rounds, because the minimum does not include the time of
    // other programs on the computer.
    let mut least = vec![f64::INFINITY; seen.len()];
    for _ in 0..ROUNDS {
        let mut controller = controller();
        for (tick, least) in seen.iter().zip(&mut least) {
            let host = tick.host.and_then(|index| event(&frames[index].1));
            let start = CpuTime::now();
            black_box(controller.tick(&inputs(&tick.bus, &host)));
            *least = least.min(start.elapsed_ns());
        }
        assert_eq!(
            controller.telemetry().state,
            ControllerState::Operate,
            "the run given again ends as the first did"
        );
    }
    let (quiet, moving) = least.split_at(seen.len() - MOVING);
    print("tick_longest_moving_ns", moving.iter().copied().fold(0.0, f64::max));
    print("tick_longest_with_host_frames_ns", quiet.iter().copied().fold(0.0, f64::max));
    Ok(())
}
