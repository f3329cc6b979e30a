//! Goal of a run, which is a trajectory or a pose.
use std::sync::Arc;

use jtc_core::{Config, JOINTS};

use crate::arm::Arm;
use crate::plan::kinematics::Target;
use crate::plan::{MoveSpeed, PlanError, Planner, at_speed};
use crate::trajectory::Trajectory;

/// Goal of a run.
#[derive(Clone, Debug)]
pub enum Course {
    /// Motion along a trajectory.
    Along(Arc<Trajectory>),
    /// Motion from the current position of the arm to a pose.
    To {
        /// Target pose.
        target: Target,
        /// `true` if the flange moves along a straight line. `false` if the joints move in proportion to each other, or in another motion
        /// that is faster.
        line: bool,
        /// Torque margin of the move, % of each limit.
        margin_pct: f64,
    },
}

/// Trajectory of a run.
#[derive(Clone, Debug)]
pub struct Planned {
    /// Trajectory at the requested speed.
    pub trajectory: Arc<Trajectory>,
    /// Messages of the planner for the user.
    pub notes: Vec<String>,
}

impl Course {
    /// Returns the message for an error of [`Course::planned`].
    pub fn message(&self, error: &PlanError) -> String {
        match self {
            Self::Along(_) => error.to_string(),
            Self::To { .. } => error.of_move(),
        }
    }

    /// Returns the trajectory for an arm at `here` (rad) on a controller with the settings `device`. `speed_pct` is the speed for an
    /// existing trajectory, % of the speed in this trajectory. `move_speed` is the speed of a move to a pose. `option` is the name of the
    /// option that sets this speed.
    ///
    /// # Errors
    ///
    /// Returns a [`PlanError`], whose message [`Course::message`] returns.
    pub fn planned(
        &self,
        arm: &Arm,
        device: &Config,
        here: &[f64; JOINTS],
        speed_pct: Option<f64>,
        (move_speed, option): (MoveSpeed, &str),
    ) -> Result<Planned, PlanError> {
        match self {
            Self::Along(trajectory) => {
                let trajectory = match speed_pct {
                    None | Some(100.0) => Arc::clone(trajectory),
                    Some(percent) => Arc::new(at_speed(trajectory, percent)?),
                };
                Ok(Planned { trajectory, notes: Vec::new() })
            }
            Self::To { target, line, margin_pct } => {
                let (config, friction) = (arm.config_on_device(device), arm.friction());
                let planner = Planner {
                    model: Some(&arm.model),
                    friction: friction.as_ref(),
                    speed_pct: move_speed.percent,
                    margin_pct: *margin_pct,
                    ..Planner::new(&config)
                };
                let planned = planner.to_target(&arm.model, here, target, *line)?;
                let of_speed = move_speed.note(option).map(|words| format!("move {words}"));
                let low = planned.verdict.margin.and_then(|margin| margin.warning());
                let notes = planned.notes.into_iter().chain(of_speed).chain(low).collect();
                Ok(Planned { trajectory: Arc::new(planned.trajectory), notes })
            }
        }
    }
}
