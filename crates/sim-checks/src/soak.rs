//! Soak run: hours of simulated time with random commands and faults. The invariants are checked in every
//! millisecond.
use jtc_bus::Joint;
use jtc_core::{ControllerState, JOINTS, JointConfig, JointTelemetry, TrajectoryState};
use jtc_dynamics::JointVec;
use jtc_wire::{ExecCommand, FrameType, RawPoint};

use crate::invariants::{Invariants, Violation};
use jtc_sim::{
    DriveConfig, Fault, FaultKind, PUSH_MAX, SimConfig, Statistics, Support, Trigger, World,
    host::{self, Listener},
};

/// Time between two points of the trajectories, ms.
pub const PATH_STEP_MS: u16 = 10;

/// Returns a random trajectory of the soak run, which depends on the seed: from `from` (rad) to a near position and back. All
/// trajectories pass the check of the host (`jtc traj check`), so a stop on them must end in time.
pub fn path(from: &JointVec, seed: u64) -> Vec<RawPoint> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let to = from.map(|q| (q + 1.2 * (rng.f64() - 0.5)).clamp(-1.4, 1.4));
    host::there_and_back(from, &to, 1.6 + 2.0 * rng.f64(), 1, PATH_STEP_MS)
}

/// Report of a soak run.
#[derive(Clone, Debug, Default)]
pub struct SoakReport {
    /// Simulated time, s.
    pub seconds: f64,
    /// Number of entries into each state.
    pub entered: [u64; 6],
    /// Time in each state, ms.
    pub spent_ms: [u64; 6],
    /// Number of finished trajectories.
    pub finished: u64,
    /// Number of injected faults.
    pub faults: u64,
    /// Time with a torque at its limit, ms.
    pub limited_ms: u64,
    /// Number of commands that were sent.
    pub commands: u64,
    /// Counters of the simulation.
    pub statistics: Statistics,
    /// Invariant that was violated; a violation ends the run.
    pub violation: Option<Violation>,
}

impl core::fmt::Display for SoakReport {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let names = ["Start", "Init", "HoldPos", "Operate", "Teaching", "Error"];
        writeln!(f, "{:.3} h of virtual time", self.seconds / 3600.0)?;
        for (n, name) in names.iter().enumerate() {
            let share = self.spent_ms[n] as f64 / (self.seconds * 10.0);
            writeln!(f, "  {name:<9} entered {:>8} times, {share:5.1} % of the time", self.entered[n])?;
        }
        writeln!(
            f,
            "  {} commands, {} faults, {} motions finished, {} ms with a torque at its limit",
            self.commands, self.faults, self.finished, self.limited_ms
        )?;
        let s = &self.statistics;
        writeln!(
            f,
            "  bus: {} frames, load {:.1} %, {} lost, {} repeated, {} bus-offs; host: {} good and {} bad frames; \
             {} watchdog resets",
            s.bus.frames,
            100.0 * s.bus_load(),
            s.bus.lost,
            s.bus.repeated,
            s.bus.bus_offs,
            s.good_frames,
            s.bad_frames,
            s.watchdog_resets
        )?;
        match &self.violation {
            None => write!(f, "every invariant held"),
            Some(violation) => write!(f, "BROKEN {violation}"),
        }
    }
}

/// Soak run that can be continued.
pub struct Soak {
    world: World,
    listener: Listener,
    invariants: Invariants,
    rng: fastrand::Rng,
    report: SoakReport,
    state: ControllerState,
    trajectory: TrajectoryState,
    /// Time of the next command, ms. `next_fault` is the time of the next fault, ms.
    next_command: u64,
    next_fault: u64,
    now: u64,
}

impl Soak {
    /// Creates a simulation whose model errors, drives, line rate and start pose depend on the seed.
    pub fn new(seed: u64) -> Self {
        let mut rng = fastrand::Rng::with_seed(seed ^ 0x736F_616B);
        let mut config = SimConfig { seed, log_entries: 200, ..SimConfig::default() };
        config.start = core::array::from_fn(|_| 1.6 * (rng.f64() - 0.5));
        config.baud = [Some(115_200), Some(921_600), Some(3_000_000), None][rng.usize(0..4)];
        config.support = if rng.u8(0..8) == 0 { Support::None } else { Support::Brakes };
        config.gripper = true;
        // In half of the runs, the motor alignment is short, so that more time remains for other events.
        let quick = rng.bool();
        let mut drive = if rng.u8(0..3) == 0 { DriveConfig::older() } else { DriveConfig::default() };
        drive.first_enable_ms = if quick { 300 } else { 4000 };
        config.controller.velocity_full_scale = drive.velocity_full_scale;
        config.drives = [drive; JOINTS];
        Self {
            world: World::new(config),
            listener: Listener::default(),
            invariants: Invariants::default(),
            rng,
            report: SoakReport::default(),
            state: ControllerState::Start,
            trajectory: TrajectoryState::Null,
            next_command: 0,
            next_fault: 20_000,
            now: 0,
        }
    }

    /// Simulates `ms` milliseconds. Returns false if an invariant was violated.
    pub fn run(&mut self, ms: u64) -> bool {
        for _ in 0..ms {
            if self.report.violation.is_some() {
                return false;
            }
            self.step();
        }
        true
    }

    /// Returns the report of the run up to now.
    pub fn report(&self) -> SoakReport {
        SoakReport {
            seconds: self.now as f64 * 1e-3,
            statistics: self.world.statistics(),
            ..self.report.clone()
        }
    }

    /// Clears the log of the flight recorder.
    pub fn clear_log(&mut self) {
        self.world.clear_log();
    }

    /// Returns the simulation, so that the caller can analyse a violation.
    pub fn world(&self) -> &World {
        &self.world
    }

    fn step(&mut self) {
        if self.now >= self.next_command {
            self.command();
        }
        if self.now >= self.next_fault {
            self.throw();
        }
        self.world.step();
        self.now += 1;
        self.listener.listen(&mut self.world);
        self.listener.responses.clear();
        let telemetry = self.world.telemetry();
        if telemetry.state != self.state {
            self.state = telemetry.state;
            self.report.entered[self.state as usize] += 1;
        }
        self.report.spent_ms[self.state as usize] += 1;
        let limits = &self.world.config().controller.joints;
        let limited = |(t, limit): (&JointTelemetry, &JointConfig)| t.torque.abs() >= limit.torque_max;
        self.report.limited_ms += u64::from(telemetry.joints.iter().zip(limits).any(limited));
        if telemetry.trajectory != self.trajectory {
            self.trajectory = telemetry.trajectory;
            self.report.finished += u64::from(self.trajectory == TrajectoryState::Finish);
        }
        if let Err(violation) = self.invariants.check(&self.world) {
            self.report.violation = Some(violation);
        }
    }

    /// Sends a command. Most commands are useful in the current state; some are random.
    fn command(&mut self) {
        let waiting = self.world.host_write_pending() > 0;
        self.next_command = self.now + self.rng.u64(5..1500);
        if waiting && self.rng.u8(0..20) != 0 {
            return;
        }
        let bytes = if self.rng.u8(0..5) == 0 { self.anything() } else { self.sensible() };
        self.report.commands += 1;
        self.world.host_write(&bytes);
    }

    fn sensible(&mut self) -> Vec<u8> {
        use ExecCommand::{Execute, Pause, Stop};
        match (self.state, self.trajectory) {
            (ControllerState::Error, _) => host::clear_all(),
            (ControllerState::Init | ControllerState::Start, _) => host::use_defaults(),
            (ControllerState::Teaching, _) => host::frame(FrameType::TeachingModeDisable, &[]),
            (_, TrajectoryState::Null) if self.rng.u8(0..6) == 0 => {
                host::frame(FrameType::TeachingModeEnable, &[])
            }
            (_, TrajectoryState::Null) => self.motion(),
            (_, TrajectoryState::Execute) => match self.rng.u8(0..16) {
                0 => host::exec(Pause),
                1 => host::exec(Stop),
                _ => Vec::new(),
            },
            (_, TrajectoryState::Finish) if self.rng.bool() => self.motion(),
            (_, TrajectoryState::Stop) if self.rng.u8(0..6) == 0 => self.motion(),
            _ => host::exec(Execute),
        }
    }

    /// Returns a trajectory from the current position to a near position and back.
    fn motion(&mut self) -> Vec<u8> {
        let from = self.world.telemetry().joints.map(|j| j.position);
        host::trajectory(&path(&from, self.rng.u64(..)), PATH_STEP_MS, 113).concat()
    }

    fn anything(&mut self) -> Vec<u8> {
        let any = |rng: &mut fastrand::Rng, n: usize| -> Vec<u8> { (0..n).map(|_| rng.u8(..)).collect() };
        let rng = &mut self.rng;
        match rng.u8(0..10) {
            0 => {
                let n = rng.usize(0..200);
                any(rng, n)
            }
            1 => host::frame(FrameType::ResetCanDevices, &[rng.u8(..), 0, 0, 0]),
            2 => host::frame(FrameType::GripperControl, &[rng.u8(0..3), 0, 0, 0]),
            3 => host::frame(FrameType::TrajSetExecStatus, &[rng.u8(0..5)]),
            4 => host::frame(FrameType::ClearOccurredErrors, &[]),
            5 => host::frame(FrameType::ClearCurrentErrors, &[rng.u8(0..2), rng.u8(..), 0, 0]),
            6 => {
                let n = [120, 96, 144, 532][rng.usize(0..4)];
                let types = [
                    FrameType::PidParam,
                    FrameType::FrictionPolynomial,
                    FrameType::ArmModel,
                    FrameType::Trajectory,
                ];
                let t = types[rng.usize(0..4)];
                host::frame(t, &any(rng, n))
            }
            7 => host::frame(FrameType::FrictionTableUseDefault, &[]),
            8 => host::frame(FrameType::FrictionPolynomialUseDefault, &[]),
            _ => {
                // The frame is an Execute with one flipped bit.
                let mut bytes = host::exec(ExecCommand::Execute);
                let at = rng.usize(0..bytes.len());
                bytes[at] ^= 1 << rng.u8(0..8);
                bytes
            }
        }
    }

    fn throw(&mut self) {
        let rng = &mut self.rng;
        self.next_fault = self.now + rng.u64(500..25_000);
        let joint = Joint::ALL[usize::from(rng.u8(0..6))];
        let node = rng.u8(0..7);
        let small = rng.f64() * 0.05;
        let kind = match rng.u8(0..24) {
            0 => FaultKind::NodeSilent { node },
            1 => FaultKind::NodeReboot { node },
            2 => FaultKind::MotorFault { joint, bits: 1 << rng.u8(0..8) },
            3 => FaultKind::HardwareFault { joint },
            4 => FaultKind::FaultState { joint },
            5 => FaultKind::EncoderJump { joint, rad: 0.4 * (rng.f64() - 0.5) },
            6 => FaultKind::NotAccurate { joint },
            7 => FaultKind::Friction { joint, factor: 3.0 * rng.f64() },
            8 => FaultKind::Temperature { joint, celsius: 90.0 * rng.f64() - 10.0 },
            9 => FaultKind::FramesLost { probability: small },
            10 => FaultKind::FramesCorrupted { probability: 4.0 * small },
            11 => FaultKind::FramesGarbled { probability: small },
            12 => FaultKind::BusOff,
            13 => FaultKind::NoAcknowledge,
            14 => FaultKind::SafetyInput,
            15 => FaultKind::SafetyLine { node },
            16 => FaultKind::SerialLost { probability: small },
            17 => FaultKind::SerialFlipped { probability: small },
            18 => FaultKind::SerialDelayed,
            19 => FaultKind::TickOverrun,
            // Most pushes are weak; some exceed every torque limit.
            _ => FaultKind::Push { joint, torque: PUSH_MAX * (2.0 * rng.f64() - 1.0).powi(3) },
        };
        // Half of the faults last less than 12 ms.
        let duration = if rng.bool() { rng.u64(1..12) } else { rng.u64(12..1500) };
        self.report.faults += 1;
        let fault = Fault { kind, trigger: Trigger::At(self.now), duration_ms: Some(duration) };
        self.world.inject(fault);
    }
}
