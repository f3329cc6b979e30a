//! Invariants that must hold in every millisecond, and a checker that runs together with a simulation.
use jtc_bus::{Joint, Request, Target};
use jtc_core::{ControllerState, JOINTS, TrajectoryState};
use jtc_wire::{ExecCommand, FrameType};

mod broken;
mod motion;

pub use broken::{Broken, Violation};
use motion::{MotionWatch, powered};

use jtc_sim::{Moment, Worked, World};

/// Minimum number of ticks between two frames that replace Move.
const MOVES_BETWEEN: u32 = 3;

/// Checker of the invariants, with its state from the previous milliseconds.
#[derive(Clone, Debug)]
pub struct Invariants {
    state: ControllerState,
    trajectory: TrajectoryState,
    point: u32,
    controller_ticks: u64,
    since_other: u32,
    cleared: bool,
    execute: bool,
    teach: bool,
    motion: MotionWatch,
}

impl Default for Invariants {
    fn default() -> Self {
        Self {
            state: ControllerState::Start,
            trajectory: TrajectoryState::Null,
            point: 0,
            controller_ticks: 0,
            since_other: MOVES_BETWEEN,
            cleared: false,
            execute: false,
            teach: false,
            motion: MotionWatch::default(),
        }
    }
}

impl Invariants {
    /// Creates a checker for a simulation that is already running. The checker accepts the current state and the
    /// current motion, and checks only the changes that follow.
    pub fn joining(world: &World) -> Self {
        let t = world.telemetry();
        Self {
            state: t.state,
            trajectory: t.trajectory,
            point: t.point,
            controller_ticks: t.tick,
            ..Self::default()
        }
    }

    /// Checks the last millisecond of the simulation.
    pub fn check(&mut self, world: &World) -> Result<(), Violation> {
        self.check_moment(&world.moment())
    }

    /// Checks the data of one millisecond.
    pub fn check_moment(&mut self, moment: &Moment<'_>) -> Result<(), Violation> {
        self.look(moment).map_err(|broken| Violation { time_us: moment.time_us, broken })
    }

    fn look(&mut self, moment: &Moment<'_>) -> Result<(), Broken> {
        if !moment.ticked {
            return Ok(());
        }
        let telemetry = moment.telemetry;
        if telemetry.tick <= self.controller_ticks {
            // After a reset, the controller starts from its initial state, so the checker also restarts.
            *self = Self::default();
        }
        self.controller_ticks = telemetry.tick;
        self.note_commands(moment);
        self.finite(moment)?;
        self.states(moment)?;
        self.frame(moment)?;
        self.motion.check(moment, self.trajectory)?;
        let internal = telemetry.errors & jtc_core::error::INTERNAL != 0;
        if moment.safety_output != (telemetry.state != ControllerState::Start && !internal) {
            return Err(Broken::SafetyOutput { level: moment.safety_output, errors: telemetry.errors });
        }
        self.state = telemetry.state;
        self.trajectory = telemetry.trajectory;
        self.point = telemetry.point;
        Ok(())
    }

    /// Records the commands that permit a change of state.
    fn note_commands(&mut self, moment: &Moment<'_>) {
        const CLEAR_CURRENT: u8 = FrameType::ClearCurrentErrors as u8;
        const CLEAR_OCCURRED: u8 = FrameType::ClearOccurredErrors as u8;
        const EXECUTE: u8 = ExecCommand::Execute as u8;
        const TEACH: u8 = FrameType::TeachingModeEnable as u8;
        for worked in moment.worked {
            match *worked {
                Worked::Frame(CLEAR_CURRENT | CLEAR_OCCURRED) => self.cleared = true,
                Worked::Exec(EXECUTE) => self.execute = true,
                Worked::Frame(TEACH) => self.teach = true,
                _ => {}
            }
        }
    }

    fn finite(&self, moment: &Moment<'_>) -> Result<(), Broken> {
        let truth = moment.truth;
        for (joint, t) in moment.telemetry.joints.iter().enumerate() {
            let commanded = [t.set_position, t.set_velocity, t.set_acceleration, t.torque];
            let parts =
                [t.torque_model, t.torque_p, t.torque_i, t.torque_d, t.torque_friction, t.torque_other];
            let measured = [t.position, t.velocity, t.temperature];
            let real = [truth.q[joint], truth.qd[joint], truth.torque[joint]];
            let bad = |values: &[f64]| values.iter().any(|x| !x.is_finite());
            let what = if bad(&commanded) {
                "commanded value"
            } else if bad(&parts) {
                "part of the torque"
            } else if bad(&measured) {
                "measured value"
            } else if bad(&real) {
                "true value"
            } else {
                continue;
            };
            return Err(Broken::NotFinite { what, joint: Joint::ALL[joint] });
        }
        Ok(())
    }

    /// Checks J-24 (no motion without a command) and J-31 (the point index does not decrease).
    fn states(&mut self, moment: &Moment<'_>) -> Result<(), Broken> {
        let telemetry = moment.telemetry;
        let (from, to) = (self.state, telemetry.state);
        if from == ControllerState::Error && to != ControllerState::Error && !self.cleared {
            return Err(Broken::LeftErrorAlone { to });
        }
        if to == ControllerState::Error {
            // A command that was sent before the error must not permit an action after the error.
            self.execute = false;
            self.teach = false;
        } else {
            self.cleared = false;
        }
        if telemetry.trajectory == TrajectoryState::Execute
            && self.trajectory != TrajectoryState::Execute
            && !core::mem::take(&mut self.execute)
        {
            return Err(Broken::ExecutionAlone { to: telemetry.trajectory });
        }
        if to == ControllerState::Operate && telemetry.trajectory == TrajectoryState::Null {
            return Err(Broken::MovedAlone);
        }
        if to == ControllerState::Teaching
            && from != ControllerState::Teaching
            && !core::mem::take(&mut self.teach)
        {
            return Err(Broken::TaughtAlone);
        }
        // A Stop ends the run and returns the index to the first point.
        let executing =
            (self.trajectory, telemetry.trajectory) == (TrajectoryState::Execute, TrajectoryState::Execute);
        let running = (from, to) == (ControllerState::Operate, ControllerState::Operate) && executing;
        if running && telemetry.point < self.point {
            return Err(Broken::IndexFell { from: self.point, to: telemetry.point });
        }
        Ok(())
    }

    /// Checks J-12, J-13, J-16 and J-21 for the frame on the joint bus.
    fn frame(&mut self, moment: &Moment<'_>) -> Result<(), Broken> {
        let state = moment.telemetry.state;
        let Some(frame) = moment.sent else {
            return if state == ControllerState::Start { Ok(()) } else { Err(Broken::Silent { state }) };
        };
        let Ok(request) = Request::parse(frame) else { return Err(Broken::UnknownFrame { id: frame.id }) };
        let Request::Move { torque, .. } = request else {
            if state == ControllerState::Error && self.state != ControllerState::Error {
                return Err(Broken::ErrorWithoutZero);
            }
            if self.since_other < MOVES_BETWEEN {
                return Err(Broken::NoMove { ticks: self.since_other });
            }
            self.since_other = 0;
            return self.targets(state, &request);
        };
        self.since_other = self.since_other.saturating_add(1);
        let powered = powered(state);
        for joint in 0..JOINTS {
            if torque[joint] != 0.0 && !powered {
                return Err(Broken::Torque { state, joint: Joint::ALL[joint], torque: torque[joint] });
            }
            let limit = moment.config.joints[joint].torque_max;
            // The bus has a limited resolution, so rounding may increase the torque by one step.
            if torque[joint].abs() > limit + 0.02 {
                return Err(Broken::TorqueLimit { joint: Joint::ALL[joint], torque: torque[joint], limit });
            }
        }
        Ok(())
    }

    fn targets(&self, state: ControllerState, request: &Request) -> Result<(), Broken> {
        let Request::ChangeFsm { target } = request else { return Ok(()) };
        let powered = powered(state);
        match target.iter().position(|&t| t == Target::Enable) {
            Some(node) if !powered => Err(Broken::Enabled { state, node }),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
#[path = "invariants_tests.rs"]
mod tests;
