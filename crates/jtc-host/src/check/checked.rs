//! A trajectory that passed the check, the only kind that a session uploads and executes.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use jtc_core::{Config, JOINTS};
use jtc_wire::RawPoint;

use super::{Checker, Verdict};
use crate::arm::Arm;
use crate::error::CheckError;
use crate::plan::{PlanError, Planner};
use crate::trajectory::{Trajectory, UploadOptions};

/// Counts the checks that were passed, so that two trajectories are never taken for one another.
static PASSED: AtomicU64 = AtomicU64::new(1);

/// How a trajectory is checked for a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CheckOptions {
    /// Segments that it will be sent in; their number is part of the check.
    pub upload: UploadOptions,
    /// The values of the arm file that no frame carries (limits, gravity, rotor inertia) may differ from those of
    /// the controller, and those of the controller are safe for this arm. Without it such an arm is refused (J-55).
    pub accept_device_limits: bool,
    /// Settings of the controller: by default those that are built in, and what [`Session::device_config`](crate::Session::device_config)
    /// returns for one with extensions.
    pub device: Config,
}

/// A trajectory that may be run: it passed the check against an arm, from the pose in which the arm stood.
///
/// [`Session::upload`](crate::Session::upload) and [`Session::execute`](crate::Session::execute) take nothing else, and
/// [`CheckedTrajectory::check`] is the only way to make one, so a program that runs an unchecked trajectory does not compile:
///
/// ```compile_fail,E0308
/// fn run<P: jtc_host::Port>(session: &mut jtc_host::Session<P>, trajectory: &jtc_host::Trajectory) {
///     session.upload(trajectory, |_| jtc_host::session::Flow::Continue);
/// }
/// ```
///
/// Nor can one be put together from its parts, or be changed after the check:
///
/// ```compile_fail,E0616
/// fn faster(checked: &mut jtc_host::CheckedTrajectory) {
///     checked.trajectory.step_ms = 1;
/// }
/// ```
///
/// # Start pose
///
/// The check compares the first point with the pose that it is given: no joint may be further from it than the start tolerance,
/// 0.02 rad (J-34). Give it the pose that was measured just before, from the status that
/// [`Session::wait_ready`](crate::Session::wait_ready) returns. An arm that stands elsewhere is moved to the first point by a
/// trajectory of its own, which [`Planner::to`](crate::plan::Planner::to) makes and which is checked in the same way; after it the
/// motion is checked from the pose that the approach ended in.
///
/// The controller compares once more at the moment of execution. An arm that was moved after the check does not move by it:
/// execution is refused with data status 8.
#[derive(Clone)]
pub struct CheckedTrajectory {
    trajectory: Arc<Trajectory>,
    raw: Arc<[RawPoint]>,
    options: UploadOptions,
    verdict: Verdict,
    delay_ticks: u8,
    number: u64,
    /// What it was checked with.
    basis: Arc<(Arm, Config)>,
}

impl fmt::Debug for CheckedTrajectory {
    /// Without its points, which are up to 12 000.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Verdict { points, step_ms, duration_s, .. } = self.verdict;
        write!(
            f,
            "CheckedTrajectory {{ number: {}, points: {points}, step_ms: {step_ms}, duration_s: {duration_s} }}",
            self.number
        )
    }
}

impl CheckedTrajectory {
    /// Checks `trajectory` for a run by `arm` from the measured pose `start` (rad, base to wrist).
    ///
    /// The limits are the tighter ones of the arm and of the controller ([`Arm::config_on_device`]); the torques are those of the
    /// arm model with the arm's friction, gravity and rotor inertia as the controller computes with them.
    ///
    /// # Errors
    ///
    /// [`CheckError::DeviceLimits`] when the arm has values that the controller uses otherwise, unless the options accept them.
    /// [`CheckError::Refused`] with the verdict when anything forbids to run it: a limit exceeded at or between points, a jump, not at rest
    /// at its ends, too much torque, no room to stop, too many points or segments, or the arm not at the first point. An arm whose
    /// numbers are not physical is [`CheckError::Arm`]. Nothing is sent in either case.
    pub fn check(
        trajectory: &Trajectory,
        arm: &Arm,
        start: &[f64; JOINTS],
        options: &CheckOptions,
    ) -> Result<Self, CheckError> {
        // The fields of an arm are public: numbers that make the dynamics senseless would pass for any torque.
        arm.is_physical()?;
        let differences = arm.device_differences(&options.device);
        if !differences.is_empty() && !options.accept_device_limits {
            return Err(CheckError::DeviceLimits { arm: arm.name.clone(), differences });
        }
        let (config, friction) = (arm.config_on_device(&options.device), arm.friction());
        let checker = Checker {
            model: Some(&arm.model),
            friction: friction.as_ref(),
            start: Some(*start),
            upload: options.upload,
            ..Checker::new(&config)
        };
        let verdict = checker.check(trajectory);
        match trajectory.raw() {
            Ok(raw) if verdict.is_ok() => Ok(Self {
                trajectory: Arc::new(trajectory.clone()),
                raw: raw.into(),
                options: options.upload,
                verdict,
                delay_ticks: config.delay_ticks,
                number: PASSED.fetch_add(1, Ordering::Relaxed),
                basis: Arc::new((arm.clone(), config)),
            }),
            // A number that no frame carries is among the problems of the verdict.
            _ => Err(CheckError::Refused(Box::new(verdict))),
        }
    }

    /// Checks what remains of it from `from_ms` of its path on, at rest there, where the controller's settings or the payload are not
    /// those any more that it was checked with (J-36, J-60).
    ///
    /// # Errors
    ///
    /// [`PlanError::Refused`] with the verdict of the rest.
    pub fn check_rest(&self, device: &Config, from_ms: u32) -> Result<(), PlanError> {
        let (arm, checked_with) = &*self.basis;
        // The speed on the path changes with no check: it can only be lower.
        let config = Config { speed: checked_with.speed, ..arm.config_on_device(device) };
        if config == *checked_with {
            return Ok(());
        }
        let friction = arm.friction();
        let planner =
            Planner { model: Some(&arm.model), friction: friction.as_ref(), ..Planner::new(&config) };
        planner.rest(&self.trajectory, from_ms, None).map(drop)
    }

    /// What was checked.
    pub fn trajectory(&self) -> &Trajectory {
        &self.trajectory
    }

    /// What the check found: figures of each joint, and warnings that do not forbid the run.
    pub fn verdict(&self) -> &Verdict {
        &self.verdict
    }

    /// The segments that it will be sent in.
    pub fn upload_options(&self) -> &UploadOptions {
        &self.options
    }

    /// Age of the controller's measurements, ticks (J-62).
    pub(crate) fn delay_ticks(&self) -> u8 {
        self.delay_ticks
    }

    /// As the wire carries it.
    pub(crate) fn raw(&self) -> &[RawPoint] {
        &self.raw
    }

    /// The trajectory, to be kept by an observer.
    pub(crate) fn shared(&self) -> Arc<Trajectory> {
        Arc::clone(&self.trajectory)
    }

    /// The number of this check; no other of the program has it.
    pub(crate) fn number(&self) -> u64 {
        self.number
    }
}
