//! Tests of all pairs of an activity of the controller and an event. Each pair must end in the state that docs/safety.md lists.
//! `UPDATE_DOCS=1` updates this page.
use jtc_core::{Config, ControllerState, Parameters, TrajectoryState, settings};
use jtc_dynamics::Payload;
use jtc_wire::{ExecCommand, FrameType, UrgentCommand};

use crate::plant::{LuGre, POSES, Plant, heavier, loaded, standing};
use crate::pushed;
use crate::rig::{Rig, floats};

/// Time after which a test checks the end state, ms.
const WATCH_MS: usize = 6_000;
/// Time without a frame from any host that host supervision tolerates, ms. The start of each activity takes less
/// time, so it does not trigger host supervision.
const HOST_TIMEOUT_MS: u16 = 1_500;

/// Simulated arm without brakes, and its controller.
pub(crate) struct Bench {
    pub arm: Plant,
    pub rig: Rig,
}

impl Bench {
    /// Returns a bench that holds an arm at rest. The true masses are `mass` times the model masses, and the arm has an unmodelled load of
    /// `load` kg.
    pub(crate) fn holding(config: Config, mass: f64, load: f64) -> Self {
        let model = loaded(heavier(Parameters::avena().model, mass), load);
        let mut arm = Plant::new(&model, LuGre::of_avena_times(1.0), POSES[0]);
        let mut rig = arm.holding(config);
        arm.brakes = false;
        arm.run(&mut rig, 3_500);
        Self { arm, rig }
    }

    /// Returns a bench whose joint 2 was pushed and begins to yield.
    fn pushed(config: Config) -> Self {
        let mut bench = Self::holding(config, 1.0, 1.0);
        bench.arm.push[1] = -90.0;
        bench.until("a yield", Self::yields);
        bench
    }

    pub(crate) fn run(&mut self, ms: usize) {
        self.arm.run(&mut self.rig, ms);
    }

    /// Executes ticks until `is` returns `true`.
    pub(crate) fn until(&mut self, what: &str, is: impl Fn(&Rig) -> bool) {
        for _ in 0..20_000 {
            if is(&self.rig) {
                return;
            }
            self.arm.tick(&mut self.rig);
        }
        panic!("never: {what}");
    }

    pub(crate) fn send(&mut self, frame_type: FrameType, body: &[u8]) {
        self.rig.send(frame_type, body);
    }

    /// Executes a motion of joints 2 and 3 from the present position of the arm.
    pub(crate) fn execute(&mut self, way: f64, seconds: f64) {
        let mut to = POSES[0];
        to[1] += 0.6 * way;
        to[2] += 0.9 * way;
        pushed::begin(&mut self.rig, &pushed::motion(&POSES[0], &to, seconds));
    }

    pub(crate) fn moves(rig: &Rig) -> bool {
        rig.state() == ControllerState::Operate && rig.controller.telemetry().point > 20
    }

    fn yields(rig: &Rig) -> bool {
        rig.controller.reactions().yields != 0
    }

    pub(crate) fn jog(&mut self) {
        self.send(FrameType::Jog, &floats([0.2f32, 0.0, 0.0, 0.0, 0.0, 0.0]));
    }

    /// Returns the end state in the words of docs/safety.md.
    fn state(&self) -> &'static str {
        use ControllerState::{Error, HoldPos, Init, Operate, Teaching};
        let t = self.rig.controller.telemetry();
        match (t.state, t.trajectory, t.errors != 0) {
            (Error, ..) => "Error",
            (Init, ..) => "Init",
            (Teaching, ..) => "Teaching",
            (Operate, ..) => "on the path",
            (HoldPos, TrajectoryState::Pause, true) => "held stop, Pause",
            (HoldPos, _, true) => "held stop",
            (HoldPos, TrajectoryState::Pause, false) => "HoldPos, Pause",
            (HoldPos, TrajectoryState::Finish, false) => "HoldPos, Finish",
            (HoldPos, ..) => "HoldPos",
            state => panic!("{state:?}"),
        }
    }
}

/// Activity of the controller: a function that begins it.
pub(crate) type Begin = fn(Config) -> Bench;
pub(crate) const UNDER_WAY: [(&str, Begin); 11] = [
    ("holds", |config| Bench::holding(config, 1.0, 1.0)),
    ("moves along a path", |config| {
        let mut bench = Bench::holding(config, 1.0, 0.0);
        bench.execute(1.0, 4.0);
        bench.until("the path", Bench::moves);
        bench
    }),
    ("slows the path down (J-75)", |mut config| {
        // The torque limit is just sufficient for a slow motion.
        let friction = LuGre::avena(1, 1.2).coulomb;
        config.joints[1].torque_max =
            standing(&Parameters::avena().model, &POSES[0])[1].abs() + friction + 12.0;
        let mut bench = Bench::holding(config, 1.0, 0.0);
        bench.execute(-1.0, 1.6);
        bench.until("held back", |rig| rig.controller.reactions().held_back_ms > 0);
        bench
    }),
    ("slows down after a Stop", |config| {
        let mut bench = Bench::holding(config, 1.0, 0.0);
        bench.execute(1.0, 4.0);
        bench.until("the path", Bench::moves);
        bench.rig.urgent(0, UrgentCommand::Stop);
        bench.run(30);
        bench
    }),
    ("jogs", |config| {
        let mut bench = Bench::holding(config, 1.0, 0.0);
        bench.jog();
        bench.run(60);
        bench.jog();
        bench.run(20);
        bench
    }),
    ("yields to a push (J-68)", |config| {
        let mut bench = Bench::pushed(config);
        bench.run(50);
        bench
    }),
    ("is in a held stop (J-69)", |config| {
        let mut bench = Bench::pushed(config);
        bench.arm.push[1] = 0.0;
        bench.run(2_000);
        bench
    }),
    ("lowers a load (J-70)", |config| {
        let (limits, mut load) = (config.joints.map(|joint| joint.torque_max), 0.0);
        let shares = |load: f64| {
            let torque = standing(&loaded(Parameters::avena().model, load), &POSES[0]);
            (0..6).map(|j| torque[j].abs() / limits[j]).fold(0.0, f64::max)
        };
        while shares(load) < 1.05 {
            load += 0.05;
        }
        let model = loaded(Parameters::avena().model, load);
        let mut arm = Plant::new(&model, LuGre::of_avena_times(0.3), POSES[0]);
        let mut rig = Rig::with_speeds(config);
        rig.follow = false;
        arm.report(&mut rig);
        rig.defaults();
        while rig.nodes[..6].iter().any(|node| node.report.state != jtc_bus::NodeState::ENABLED) {
            arm.tick(&mut rig);
        }
        arm.brakes = false;
        let mut bench = Bench { arm, rig };
        bench.until("a load that is lowered", Bench::yields);
        bench.run(300);
        bench
    }),
    ("teaches", |config| {
        let mut bench = Bench::holding(config, 1.0, 1.0);
        bench.send(FrameType::TeachingModeEnable, &[]);
        bench.until("Teaching", |rig| rig.state() == ControllerState::Teaching);
        bench.run(200);
        bench
    }),
    ("has gains on trial (J-71)", |config| {
        let mut bench = Bench::holding(config, 1.0, 1.0);
        gains(&mut bench);
        bench.run(300);
        bench
    }),
    ("has found an encoder that jumped (J-35)", |config| {
        let mut bench = Bench::holding(config, 1.0, 0.0);
        bench.rig.nodes[5].glitch = 0.05;
        bench.run(500);
        bench
    }),
];

/// Sends half of the arm's gains to the controller.
fn gains(bench: &mut Bench) {
    let all = Parameters::avena().pid;
    let numbers =
        all.iter().flat_map(|g| [0.5 * g.kp, g.ki, 0.5 * g.kd, g.int_min, g.int_max].map(|x| x as f32));
    bench.send(FrameType::PidParam, &floats(numbers));
}

/// Event: its name, its action, and `true` if it releases the arm.
type Event = (&'static str, fn(&mut Bench), bool);
const EVENTS: [Event; 16] = [
    ("nothing", |_| {}, false),
    ("a push at joint 5", |bench| bench.arm.push[4] = 25.0, false),
    ("Stop", |bench| bench.rig.urgent(0, UrgentCommand::Stop), false),
    ("Pause", |bench| bench.rig.urgent(0, UrgentCommand::Pause), false),
    ("Execute", |bench| bench.send(FrameType::TrajSetExecStatus, &[ExecCommand::Execute as u8]), false),
    ("a clear", |bench| bench.send(FrameType::ClearCurrentErrors, &[1, 0, 0, 0]), false),
    ("a jog", Bench::jog, false),
    ("teaching on", |bench| bench.send(FrameType::TeachingModeEnable, &[]), false),
    ("teaching off", |bench| bench.send(FrameType::TeachingModeDisable, &[]), false),
    ("other gains", gains, false),
    (
        "a payload",
        |bench| {
            let payload = Payload { mass: 1.0, ..Payload::NONE };
            let body: Vec<u8> = settings::payload_values(&payload).flat_map(|value| value.emit()).collect();
            bench.send(FrameType::SetSettings, &body);
        },
        false,
    ),
    ("an encoder jumps", |bench| bench.rig.nodes[0].glitch = 0.05, false),
    ("the host is silent", |_| {}, false),
    ("Disable", |bench| bench.send(FrameType::Disable, &[]), true),
    ("the safety input", |bench| bench.rig.safety_input = false, true),
    ("a drive's fault", |bench| bench.rig.nodes[3].fault(), true),
];

/// Returns the name of the state in which a pair ends.
fn end((doing, begin): (&str, Begin), (name, event, releases): Event) -> &'static str {
    let mut config = Config::avena();
    if name == "the host is silent" {
        config.host_timeout_ms = HOST_TIMEOUT_MS;
    }
    let about = format!("{doing}, {name}");
    let mut bench = begin(config);
    event(&mut bench);
    for k in 0..WATCH_MS {
        if k == 500 {
            bench.arm.push = [0.0; 6];
            bench.rig.safety_input = true;
        }
        bench.arm.tick(&mut bench.rig);
        let held = bench.rig.state().has_torque() && bench.rig.last.safety_output;
        assert!(held || releases, "{about}: {:?} after {k} ms", bench.rig.controller.telemetry());
    }
    let state = bench.state();
    let speed = bench.arm.v.iter().fold(0.0f64, |most, v| most.max(v.abs()));
    let rests = state.starts_with("HoldPos") || state.starts_with("held stop");
    assert!(!rests || speed < 0.03, "{about}: {state} at {speed} rad/s");
    state
}

#[test]
fn j66_whatever_comes_during_a_reaction_ends_in_a_named_state() {
    let mut table = format!("| event |{}\n", UNDER_WAY.map(|(doing, _)| format!(" {doing} |")).concat());
    table += &format!("|---|{}\n", "---|".repeat(UNDER_WAY.len()));
    for event in EVENTS {
        let ends = UNDER_WAY.map(|under_way| format!(" {} |", end(under_way, event)));
        table += &format!("| {} |{}\n", event.0, ends.concat());
    }
    println!("{table}");
    test_kit::page::part("safety.md", "pairs", &table);
}
