//! Measures the time of one control tick in Operate, and the memory that the controller needs. The program prints one `name value` pair per
//! line. Times are in ns, and sizes are in bytes.
use std::collections::VecDeque;
use std::hint::black_box;

use jtc_bus::{Answer, Frame, GripperReport, JointReport, NodeState, Request, Scale, Target};
use jtc_core::{Config, Controller, ControllerState, HostEvent, Inputs, POINTS_MAX};
use jtc_wire::{FrameRef, FrameType, LinkEvent, RawPoint, crc16};
use test_kit::clock::CpuTime;

const SCALE: Scale = Scale { velocity: 2.0 };

fn frame(frame_type: FrameType, body: &[u8]) -> Vec<u8> {
    let n = (body.len() + 6) as u16;
    let mut bytes = vec![0x9B, frame_type as u8, (n >> 8) as u8, n as u8];
    bytes.extend_from_slice(body);
    bytes.extend_from_slice(&crc16(&bytes).to_be_bytes());
    bytes
}

/// Ticks over which the drives average their speed.
const WINDOW: usize = 10;

/// Returns the answers of simulated nodes, which answer at once and follow their set values exactly. `position` contains the positions of
/// the joints in the last ticks, rad, newest first.
fn answers(request: &Request, state: &mut [NodeState; 7], position: &VecDeque<[f64; 6]>) -> Vec<Frame> {
    let at = |j: usize, ago: usize| position.get(ago).or(position.back()).map_or(0.0, |position| position[j]);
    let mut out = Vec::new();
    for n in 0..7u8 {
        let node = &mut state[usize::from(n)];
        let answer = match request {
            Request::Move { .. } if n < 6 => Answer::Joint {
                node: n,
                report: JointReport {
                    position: at(n.into(), 0),
                    velocity: (at(n.into(), 0) - at(n.into(), WINDOW)) / (WINDOW as f64 * 1e-3),
                    temperature: 30,
                    state: *node,
                    motor_temperature: Some(30),
                    ..JointReport::default()
                },
            },
            Request::Move { .. } => {
                Answer::Gripper(GripperReport { state: *node, ..GripperReport::default() })
            }
            Request::ChangeFsm { target } => {
                let before = *node;
                *node = match target[usize::from(n)] {
                    Target::NoChange => before,
                    other => NodeState::new(other as u8),
                };
                Answer::State { node: n, state: before }
            }
            Request::ChangeMode { .. } => Answer::Mode { node: n, accepted: true },
            Request::ResetAll | Request::Reset(_) => {
                *node = NodeState::INIT;
                continue;
            }
        };
        out.push(answer.emit(SCALE));
    }
    out
}

fn main() {
    // The joints move forward and back twice in 1,499 steps of 10 ms, and are at rest at both ends of the path (J-36).
    let pace = 2.0 * std::f64::consts::TAU / 14.99;
    let points: Vec<RawPoint> = (0..1500i32)
        .map(|i| {
            let phase = f64::from(i) * 0.01 * pace;
            let wave = |scale: f64, x: f64| [(x / scale * 32767.0) as i16; 6];
            RawPoint {
                position: wave(3.141592, 0.3 * (1.0 - phase.cos())),
                velocity: wave(6.283185, 0.3 * pace * phase.sin()),
                acceleration: wave(12.566370, 0.3 * pace * pace * phase.cos()),
            }
        })
        .collect();
    let mut body: Vec<u8> = [0u16, 0, 1, 10].iter().flat_map(|x| x.to_be_bytes()).collect();
    for p in &points {
        for v in p.position.iter().chain(&p.velocity).chain(&p.acceleration) {
            body.extend_from_slice(&v.to_be_bytes());
        }
    }
    let commands = [
        (FrameType::FrictionPolynomialUseDefault, vec![]),
        (FrameType::PidParamUseDefault, vec![]),
        (FrameType::ArmModelUseDefault, vec![]),
        (FrameType::Trajectory, body),
        (FrameType::TrajSetExecStatus, vec![3]),
    ];
    let mut queue: VecDeque<_> = commands.iter().map(|(t, b)| (*t, frame(*t, b))).collect();

    let mut controller = Controller::new(Config::avena(), vec![RawPoint::default(); POINTS_MAX]);
    let mut nodes = [NodeState::INIT; 7];
    let mut positions = VecDeque::new();
    let mut bus = Vec::new();
    let mut recorded: Vec<Vec<Frame>> = Vec::new();
    let mut start = None;
    let mut ticks = 0;
    while recorded.len() < 4_000 {
        // The last two commands of the queue are sent only in HoldPos.
        let ready = queue.len() > 2 || controller.telemetry().state == ControllerState::HoldPos;
        let host = queue
            .front()
            .filter(|_| ready)
            .map(|(t, bytes)| LinkEvent::Frame(FrameRef { frame_type: *t, bytes }))
            .map(|event| HostEvent { line: 0, overtaken: false, plain: false, event });
        if controller.telemetry().point == 1000 && start.is_none() {
            start = Some(controller.clone());
        }
        if start.is_some() {
            recorded.push(bus.clone());
        }
        let outputs = controller.tick(&Inputs { bus: &bus, host: host.as_slice(), ..Inputs::QUIET });
        queue.drain(..outputs.host_done);
        ticks += 1;
        assert!(ticks < 60_000, "the trajectory is not executed: {:?}", controller.violation());
        let request = Request::parse(&outputs.bus.expect("a frame each tick")).expect("a request");
        positions.push_front(controller.telemetry().joints.map(|j| j.set_position));
        positions.truncate(WINDOW + 1);
        bus = answers(&request, &mut nodes, &positions);
    }
    let start = start.expect("the trajectory was executed");

    let mut least = f64::INFINITY;
    for _ in 0..100 {
        let mut controller = start.clone();
        let begin = CpuTime::now();
        for bus in &recorded {
            black_box(controller.tick(black_box(&Inputs { bus, ..Inputs::QUIET })));
        }
        least = least.min(begin.elapsed_ns() / recorded.len() as f64);
        assert_eq!(controller.telemetry().state, ControllerState::Operate);
    }
    println!("control_tick_ns {least:.1}");
    println!("controller_bytes {}", size_of::<Controller<[RawPoint; POINTS_MAX]>>());
}
