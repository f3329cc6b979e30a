//! Test rig without physics. The nodes answer at once, and the joints are at the positions that the test sets.

use jtc_bus::{Answer, Frame, GripperReport, JointReport, NodeState, Request, Scale, Target};
use jtc_core::recorder::{Block, Recorder};
use jtc_core::{
    BusState, Config, Controller, ControllerState, HOST_LINES, HostEvent, Inputs, Outputs, POINTS_MAX,
    TrajectoryState,
};
use jtc_wire::{
    Answer as HostAnswer, DataStatus, EVENTS_MAX, ExecCommand, FrameRef, FrameType, Info, LinkEvent,
    RawPoint, Response, Status, UrgentCommand, UrgentCommands,
};

mod bodies;
mod node;
mod paths;

pub(crate) use bodies::{floats, frame, model_body, segment_body};
pub(crate) use node::Node;
pub(crate) use paths::{pieces, point, put, rad, raw, rest};

pub(crate) const SCALE: Scale = Scale { velocity: 2.0 };

pub(crate) struct Rig {
    pub controller: Controller<Vec<RawPoint>>,
    pub nodes: [Node; 7],
    pub pump: bool,
    pub torque: [f64; 6],
    pub safety_input: bool,
    /// Number of ticks that are missed before the next tick.
    pub missed_ticks: u16,
    pub acknowledged: bool,
    pub bus_off: bool,
    /// `true` if the joints follow the commanded positions.
    pub follow: bool,
    /// `true` for each joint that does not follow the commanded positions.
    pub apart: [bool; 6],
    /// Frames that the controller has sent, one per tick.
    pub sent: Vec<Request>,
    pub statuses: Vec<Status>,
    pub last: Outputs,
    /// Frames that the controller receives in the next tick instead of the frames of the nodes.
    pub inject: Vec<Frame>,
    answers: Vec<Frame>,
    /// `true` if the serial line can accept a status.
    pub status_free: bool,
    /// Stop and Pause commands that arrive before the next tick.
    urgent: [UrgentCommands; HOST_LINES],
    host: std::collections::VecDeque<Sent>,
    /// The flight recorder, if the test has one.
    pub recorder: Option<Recorder<Vec<Block>, 2>>,
    /// `true` if the next frames of hosts come on plain lines (J-51).
    pub plain: bool,
}

/// Frame that a host has sent and that the controller has not finished yet.
struct Sent {
    line: usize,
    overtaken: bool,
    plain: bool,
    what: What,
}

enum What {
    Frame(FrameType, Vec<u8>),
    Bad(Response),
    Noise(Response),
}

impl Sent {
    fn event(&self) -> HostEvent<'_> {
        let event = match &self.what {
            What::Frame(frame_type, bytes) => LinkEvent::Frame(FrameRef { frame_type: *frame_type, bytes }),
            What::Bad(response) => LinkEvent::Bad(*response),
            What::Noise(response) => LinkEvent::Noise(*response),
        };
        HostEvent { line: self.line, overtaken: self.overtaken, plain: self.plain, event }
    }
}

impl Rig {
    /// Creates a rig whose joints report a speed of zero unless a test sets a speed. The controller does not compare these speeds with
    /// positions (J-35).
    pub(crate) fn new(config: Config) -> Self {
        Self::with_speeds(Config { drive_speed_window_ms: 0, ..config })
    }

    /// Creates a rig for joints whose speeds agree with their positions.
    pub(crate) fn with_speeds(config: Config) -> Self {
        let last = Outputs {
            bus: None,
            safety_output: false,
            status: false,
            record_line: None,
            answer_line: None,
            store: false,
            host_done: 0,
        };
        Self {
            controller: Controller::new(config, vec![RawPoint::default(); POINTS_MAX]),
            nodes: [Node::new(); 7],
            pump: false,
            torque: [0.0; 6],
            safety_input: true,
            missed_ticks: 0,
            acknowledged: true,
            bus_off: false,
            follow: true,
            apart: [false; 6],
            sent: Vec::new(),
            statuses: Vec::new(),
            last,
            inject: Vec::new(),
            answers: Vec::new(),
            status_free: true,
            urgent: [UrgentCommands::NONE; HOST_LINES],
            host: std::collections::VecDeque::new(),
            recorder: None,
            plain: false,
        }
    }

    /// Returns a rig in HoldPos, with every joint enabled and with the default parameters.
    pub(crate) fn holding() -> Self {
        Self::holding_with(Config::avena())
    }

    pub(crate) fn holding_with(config: Config) -> Self {
        Self::held_at(config, [0.0; 6])
    }

    /// Returns a rig whose controller holds the arm in this pose, rad.
    pub(crate) fn held_at(config: Config, pose: [f64; 6]) -> Self {
        let mut rig = Self::new(config);
        rig.follow = false;
        for (node, position) in rig.nodes.iter_mut().zip(pose) {
            node.report.position = position;
        }
        rig.defaults();
        // The rig runs until the controller knows the load of the arm, because Teaching waits until then.
        rig.run(700);
        assert_eq!(rig.state(), ControllerState::HoldPos, "{:?}", rig.controller.telemetry());
        assert!(rig.nodes[..6].iter().all(|n| n.report.state == NodeState::ENABLED));
        rig.follow = true;
        rig
    }

    /// Returns a rig in HoldPos whose joint 3 is not enabled yet, because its drive needs a long time to enable.
    pub(crate) fn with_a_slow_drive(config: Config) -> Self {
        let mut rig = Self::new(config);
        rig.nodes[2].slow_enable = true;
        rig.defaults();
        rig.until(300, |r| r.state() == ControllerState::HoldPos);
        rig
    }

    pub(crate) fn defaults(&mut self) {
        use FrameType::*;
        for t in [FrictionPolynomialUseDefault, PidParamUseDefault, ArmModelUseDefault] {
            self.send(t, &[]);
        }
    }

    pub(crate) fn state(&self) -> ControllerState {
        self.controller.telemetry().state
    }

    pub(crate) fn trajectory(&self) -> TrajectoryState {
        self.controller.telemetry().trajectory
    }

    pub(crate) fn errors(&self) -> u16 {
        self.controller.telemetry().errors
    }

    /// Returns the current status as a host would receive it.
    pub(crate) fn status(&mut self) -> Status {
        let before = self.statuses.len();
        while self.statuses.len() == before {
            self.tick();
        }
        *self.statuses.last().unwrap()
    }

    pub(crate) fn send(&mut self, frame_type: FrameType, body: &[u8]) {
        self.send_on(0, frame_type, body);
    }

    /// Sends a frame on this line.
    pub(crate) fn send_on(&mut self, line: usize, frame_type: FrameType, body: &[u8]) {
        let what = What::Frame(frame_type, frame(frame_type, body));
        self.host.push_back(Sent { line, overtaken: false, plain: self.plain, what });
    }

    pub(crate) fn send_bad(&mut self, response: Response) {
        self.host.push_back(Sent { line: 0, overtaken: false, plain: self.plain, what: What::Bad(response) });
    }

    pub(crate) fn send_noise(&mut self, response: Response) {
        self.host.push_back(Sent {
            line: 0,
            overtaken: false,
            plain: self.plain,
            what: What::Noise(response),
        });
    }

    /// Adds a Stop or Pause that arrives on a line. The command takes effect in the next tick, and the frame of the command is queued after
    /// the earlier frames.
    pub(crate) fn urgent(&mut self, line: usize, command: UrgentCommand) {
        self.urgent[line].push(command);
        self.send_on(line, FrameType::TrajSetExecStatus, &[ExecCommand::from(command) as u8]);
        for sent in &mut self.host {
            sent.overtaken = true;
        }
    }

    /// Returns the number of host events that the controller has not completed.
    pub(crate) fn waiting(&self) -> usize {
        self.host.len()
    }

    /// Returns the response records so far, oldest first, without the records of extensions.
    pub(crate) fn records(&self) -> Vec<Response> {
        self.statuses.iter().filter_map(Status::response).filter(|record| record.frame_type < 0x40).collect()
    }

    /// Sends a frame, executes ticks until the controller has completed it, and returns the data status of its response record.
    pub(crate) fn ask(&mut self, frame_type: FrameType, body: &[u8]) -> DataStatus {
        self.send(frame_type, body);
        for _ in 0..1000 {
            self.tick();
            if let Some(s) =
                self.statuses.iter().rev().take(1).find(|s| s.response.frame_type == frame_type as u8)
                && self.last.status
                && self.host.is_empty()
            {
                return s.response.data;
            }
        }
        panic!("no response to {frame_type:?}");
    }

    /// Returns the answer to GetInfo.
    pub(crate) fn info(&mut self) -> Info {
        self.send(FrameType::GetInfo, &[]);
        for _ in 0..1000 {
            self.tick();
            if self.last.answer_line == Some(0)
                && let Some(HostAnswer::Info(info)) =
                    FrameRef::new_checked(self.controller.answer_frame()).and_then(HostAnswer::parse)
            {
                return info;
            }
        }
        panic!("no Info");
    }

    pub(crate) fn exec(&mut self, command: ExecCommand) -> DataStatus {
        self.ask(FrameType::TrajSetExecStatus, &[command as u8])
    }

    pub(crate) fn clear(&mut self, jtc: bool, nodes: u8) -> DataStatus {
        self.ask(FrameType::ClearCurrentErrors, &[u8::from(jtc), nodes, 0, 0])
    }

    pub(crate) fn run(&mut self, ticks: usize) {
        for _ in 0..ticks {
            self.tick();
        }
    }

    /// Presses the emergency stop for `ticks` ticks.
    pub(crate) fn press_stop(&mut self, ticks: usize) {
        self.safety_input = false;
        self.run(ticks);
        self.safety_input = true;
    }

    /// Moves a joint to `to`, as fast as possible without making its position implausible (J-35).
    pub(crate) fn push(&mut self, joint: usize, to: f64) {
        self.follow = false;
        while self.nodes[joint].report.position != to {
            let way = to - self.nodes[joint].report.position;
            self.nodes[joint].report.position =
                if way.abs() > 0.004 { self.nodes[joint].report.position + 0.004 * way.signum() } else { to };
            self.tick();
        }
    }

    /// Executes ticks until `done` returns `true`, at most `ticks`. Returns the number of executed ticks.
    pub(crate) fn until(&mut self, ticks: usize, mut done: impl FnMut(&Self) -> bool) -> usize {
        for t in 0..ticks {
            if done(self) {
                return t;
            }
            self.tick();
        }
        panic!("not within {ticks} ticks: {:?}", self.controller.telemetry());
    }

    /// Drops the answers of a node that the controller has not received yet.
    pub(crate) fn drop_answers(&mut self, node: usize) {
        self.answers.retain(|frame| usize::from(frame.id & 0x0F) != node);
    }

    pub(crate) fn tick(&mut self) {
        let bus = if self.inject.is_empty() {
            core::mem::take(&mut self.answers)
        } else {
            core::mem::take(&mut self.inject)
        };
        self.answers.clear();
        let host: Vec<_> = self.host.iter().take(EVENTS_MAX).map(Sent::event).collect();
        let inputs = Inputs {
            bus: &bus,
            bus_state: BusState { acknowledged: self.acknowledged, bus_off: self.bus_off },
            safety_input: self.safety_input,
            missed_ticks: core::mem::take(&mut self.missed_ticks),
            urgent: core::mem::take(&mut self.urgent),
            host: &host,
            status_free: self.status_free,
        };
        self.last = self.controller.tick(&inputs);
        if let Some(recorder) = &mut self.recorder {
            recorder.record(&mut self.controller, &inputs, &self.last);
        }
        drop(host);
        self.host.drain(..self.last.host_done);
        if self.last.status {
            let bytes = *self.controller.status_frame();
            self.statuses.push(Status::parse(&bytes).expect("a valid status"));
        }
        let request = Request::parse(&self.last.bus.expect("a frame each tick")).expect("a valid request");
        self.sent.push(request);
        if self.follow {
            for j in 0..6 {
                if self.nodes[j].configured && !self.apart[j] {
                    self.nodes[j].report.position = self.controller.telemetry().joints[j].set_position;
                }
            }
        }
        if self.acknowledged && !self.bus_off {
            self.answer(request);
        }
    }

    fn answer(&mut self, request: Request) {
        for n in 0..7 {
            let node = &mut self.nodes[n];
            node.booting = node.booting.saturating_sub(1);
            if node.booting > 0 || node.silent {
                continue;
            }
            let number = n as u8;
            match request {
                Request::Move { torque, pump } => {
                    self.torque = torque;
                    self.pump = pump;
                    let report = JointReport {
                        position: if node.configured { node.report.position + node.glitch } else { 0.0 },
                        motor_temperature: Some(30),
                        ..node.report
                    };
                    self.answers.push(if n < 6 {
                        Answer::Joint { node: number, report }.emit(SCALE)
                    } else {
                        let gripper = GripperReport {
                            pump,
                            state: report.state,
                            errors: report.errors,
                            ..GripperReport::default()
                        };
                        Answer::Gripper(gripper).emit(SCALE)
                    });
                }
                Request::ChangeFsm { target } => {
                    self.answers.push(Answer::State { node: number, state: node.report.state }.emit(SCALE));
                    node.report.state = match (target[n], node.report.state) {
                        (_, NodeState::READY) if node.stays_ready => NodeState::READY,
                        (_, NodeState::ENABLED) if node.stays_enabled => NodeState::ENABLED,
                        (Target::Init, NodeState::START | NodeState::READY) => NodeState::INIT,
                        (Target::Init, NodeState::FAULT) => {
                            (node.report.errors, node.report.mc_current, node.report.mc_occurred) = (0, 0, 0);
                            NodeState::INIT
                        }
                        (Target::Ready, NodeState::INIT | NodeState::ENABLED) => NodeState::READY,
                        (Target::Enable, NodeState::READY) => {
                            if node.slow_enable {
                                NodeState::new(12)
                            } else {
                                NodeState::ENABLED
                            }
                        }
                        (_, state) => state,
                    };
                }
                Request::ChangeMode { .. } => {
                    let accepted = node.report.state == NodeState::INIT
                        || node.report.state == NodeState::READY && !node.refuses_when_ready;
                    node.configured |= accepted;
                    self.answers.push(Answer::Mode { node: number, accepted }.emit(SCALE));
                }
                Request::ResetAll => node.restart(),
                Request::Reset(which) if which == number => node.restart(),
                Request::Reset(_) => {}
            }
        }
    }
}
