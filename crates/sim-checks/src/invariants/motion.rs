//! Invariants of the motion: a stop ends in time, no joint is too fast for long, and a torque does not remain at its limit.
use jtc_bus::{Joint, NodeState};
use jtc_core::{ControllerState, JOINTS, TrajectoryState};
use jtc_wire::ExecCommand;

use super::broken::Broken;
use jtc_sim::{Moment, Worked};

/// Additional time after the longest time of J-33, ms. The commanded motion has ended by then, and the arm needs this
/// time to come to rest.
const REST_MS: u32 = 20;
/// Speed below which a joint counts as being at rest, rad/s.
const STANDS: f64 = 0.02;
/// Number of ticks in which the checker counts the ticks with a torque at the limit.
const WINDOW: u32 = 100;

/// State of the motion checks, which is kept from one millisecond to the next.
#[derive(Clone, Debug, Default)]
pub(super) struct MotionWatch {
    /// Number of ticks since a Pause or Stop was commanded on the path. `None` if no stop is in progress.
    stopping: Option<u32>,
    /// `true` if, since the Pause or Stop, a push has been so strong that a torque reached its limit.
    overpowered: bool,
    /// Number of consecutive measurements above the speed limit, for each joint.
    fast: [u16; JOINTS],
    /// Number of ticks since each joint was enabled.
    enabled: [u16; JOINTS],
    /// Bit mask for each joint: the recent ticks in which the torque of the joint was at its limit. Bit 0 is the last tick.
    saturated: [u128; JOINTS],
}

impl MotionWatch {
    /// Checks a tick; `before` is the execution state in the previous tick.
    pub(super) fn check(&mut self, moment: &Moment<'_>, before: TrajectoryState) -> Result<(), Broken> {
        self.stop(moment, before)?;
        self.speed(moment)?;
        self.torque(moment)
    }

    /// Checks J-33: after a Pause or Stop, the arm comes to rest in time, unless an error removes the torque. If the
    /// torque for a push leaves too little for braking, the time limit is `braking_ms_max` instead of `stop_ms`.
    fn stop(&mut self, moment: &Moment<'_>, before: TrajectoryState) -> Result<(), Broken> {
        let t = moment.telemetry;
        let ends = |worked: &Worked| {
            let pause = Worked::Exec(ExecCommand::Pause as u8);
            *worked == pause || *worked == Worked::Exec(ExecCommand::Stop as u8)
        };
        let commanded = before == TrajectoryState::Execute && (t.braking || moment.worked.iter().any(ends));
        let executes_again = before != TrajectoryState::Execute && t.trajectory == TrajectoryState::Execute;
        let powered = matches!(t.state, ControllerState::HoldPos | ControllerState::Operate);
        let stands =
            t.trajectory != TrajectoryState::Execute && moment.truth.qd.iter().all(|v| v.abs() < STANDS);
        let braking = u32::from(moment.config.braking_ms_max);
        self.stopping = match self.stopping {
            _ if !powered || stands || executes_again => None,
            None => commanded.then_some(0),
            // After `braking_ms_max`, the controller holds the arm against the push. The arm can still move, and only
            // the other invariants apply.
            Some(ticks)
                if self.overpowered && t.trajectory != TrajectoryState::Execute && ticks >= braking =>
            {
                None
            }
            Some(ticks) => Some(ticks + 1),
        };
        self.overpowered = self.stopping.is_some() && (self.overpowered || overpowered(moment));
        let allowed = if self.overpowered { braking } else { u32::from(moment.config.stop_ms) };
        match self.stopping {
            Some(ticks) if ticks > allowed + REST_MS => Err(Broken::NoStop { ticks }),
            _ => Ok(()),
        }
    }

    /// Checks J-35. A predicted velocity neither increases nor resets the counted ticks.
    fn speed(&mut self, moment: &Moment<'_>) -> Result<(), Broken> {
        let config = moment.config;
        for (joint, t) in moment.telemetry.joints.iter().enumerate() {
            let powered = powered(moment.telemetry.state) && t.state == NodeState::ENABLED;
            let within = t.velocity.abs() <= config.overspeed_factor * config.joints[joint].velocity_max;
            let ticks = self.fast[joint];
            self.fast[joint] = match (powered, t.fresh) {
                (false, _) => 0,
                (true, false) => ticks,
                (true, true) if within => 0,
                (true, true) => ticks + 1,
            };
            if self.fast[joint] > config.overspeed_ms {
                return Err(Broken::Speed {
                    joint: Joint::ALL[joint],
                    velocity: t.velocity,
                    ticks: self.fast[joint],
                });
            }
        }
        Ok(())
    }

    /// Checks J-43. A torque at the limit is allowed while a stop brakes, and while a joint that was just enabled catches its load.
    fn torque(&mut self, moment: &Moment<'_>) -> Result<(), Broken> {
        let t = moment.telemetry;
        for joint in 0..JOINTS {
            let enabled = powered(t.state) && t.joints[joint].state == NodeState::ENABLED;
            self.enabled[joint] = if enabled { self.enabled[joint].saturating_add(1) } else { 0 };
            let caught = (1..=moment.config.catch_ms_max).contains(&self.enabled[joint]);
            let catching = caught && t.state != ControllerState::Teaching;
            let counted = at_limit(moment, joint) && powered(t.state) && !t.braking && !catching;
            self.saturated[joint] = self.saturated[joint] << 1 | u128::from(counted);
            let ticks = (self.saturated[joint] << (u128::BITS - WINDOW)).count_ones();
            if ticks > u32::from(moment.config.torque_over_ms) {
                return Err(Broken::Saturated { joint: Joint::ALL[joint], ticks });
            }
        }
        Ok(())
    }
}

/// Returns true if a joint is pushed and its torque is at its limit.
fn overpowered(moment: &Moment<'_>) -> bool {
    (0..JOINTS).any(|j| moment.truth.outside[j] != 0.0 && at_limit(moment, j))
}

fn at_limit(moment: &Moment<'_>, joint: usize) -> bool {
    moment.telemetry.joints[joint].torque.abs() >= moment.config.joints[joint].torque_max
}

/// Returns true if the state commands torque.
pub(super) fn powered(state: ControllerState) -> bool {
    matches!(state, ControllerState::HoldPos | ControllerState::Operate | ControllerState::Teaching)
}
