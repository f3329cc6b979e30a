//! Trajectory that passed the check. A session uploads and executes only trajectories of this type.

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

/// Number of the next passed check. Each passed check has its own number, which distinguishes trajectories with equal points.
static PASSED: AtomicU64 = AtomicU64::new(1);

/// Options of the check of a trajectory before its execution.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CheckOptions {
    /// Division of the trajectory into segments for the upload. The check includes the number of segments.
    pub upload: UploadOptions,
    /// `true` if the check accepts an arm whose limits, gravity or rotor inertia differ from the controller. The
    /// caller then confirms that the controller's values are safe for this arm. With `false`, the check refuses such
    /// an arm (J-55).
    pub accept_device_limits: bool,
    /// Settings of the controller. The default is the built-in settings of the controller. For a controller with extensions, use the result
    /// of [`Session::device_config`](crate::Session::device_config).
    pub device: Config,
}

/// Trajectory that may be executed because it passed the check for an arm and for the measured pose of this arm.
///
/// [`Session::upload`](crate::Session::upload) and [`Session::execute`](crate::Session::execute) accept only this type, and only
/// [`CheckedTrajectory::check`] creates it. Therefore a program that runs an unchecked trajectory does not compile:
///
/// ```compile_fail,E0308
/// fn run<P: jtc_host::Port>(session: &mut jtc_host::Session<P>, trajectory: &jtc_host::Trajectory) {
///     session.upload(trajectory, |_| jtc_host::session::Flow::Continue);
/// }
/// ```
///
/// A program cannot create a `CheckedTrajectory` from its fields, and cannot change a `CheckedTrajectory` after the check:
///
/// ```compile_fail,E0616
/// fn faster(checked: &mut jtc_host::CheckedTrajectory) {
///     checked.trajectory.step_ms = 1;
/// }
/// ```
///
/// # Start pose
///
/// The check compares the first point with the pose `start`: no joint may deviate by more than the start tolerance, 0.02 rad (J-34). Pass a
/// pose that was measured immediately before the check, from the status that [`Session::wait_ready`](crate::Session::wait_ready) returns.
/// If the arm is in another pose, [`Planner::to`](crate::plan::Planner::to) plans an approach to the first point. Check and execute the
/// approach like any other trajectory. After the approach, check the motion from the final pose of the approach.
///
/// Before the controller executes the trajectory, the controller compares the pose of the arm with the first point again. If the arm was
/// moved after the check, the controller refuses the execution with data status 8, and the arm does not move.
#[derive(Clone)]
pub struct CheckedTrajectory {
    trajectory: Arc<Trajectory>,
    raw: Arc<[RawPoint]>,
    options: UploadOptions,
    verdict: Verdict,
    delay_ticks: u8,
    number: u64,
    /// Arm and controller settings that were used in the check.
    basis: Arc<(Arm, Config)>,
}

impl fmt::Debug for CheckedTrajectory {
    /// Writes a summary without the points, because a trajectory may have 12 000 points.
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
    /// Checks if `arm` can execute `trajectory` from the measured pose `start` (rad, base to wrist).
    ///
    /// The check uses the stricter of the limits of the arm and the controller ([`Arm::config_on_device`]). The torques are computed with
    /// the model and the friction of the arm, and with the gravity and the rotor inertias of the controller.
    ///
    /// # Errors
    ///
    /// Returns [`CheckError::DeviceLimits`] if the controller and the arm have different values, and the options do not allow the
    /// difference. Returns [`CheckError::Refused`] with the verdict if the trajectory must not be executed. Possible reasons are an
    /// exceeded limit at or between points, a jump, motion at the first or last point, or too much torque. Other reasons are a stop that
    /// takes too long, too many points or segments, or an arm that is not at the first point. Returns [`CheckError::Arm`] if the numbers of
    /// the arm are not physically possible. The check does not send any frame.
    pub fn check(
        trajectory: &Trajectory,
        arm: &Arm,
        start: &[f64; JOINTS],
        options: &CheckOptions,
    ) -> Result<Self, CheckError> {
        // The fields of `Arm` are public, so a caller may have set physically impossible numbers. With such numbers,
        // any torque could pass the check.
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
            // If a number is outside the range of a serial frame, the verdict already contains a problem about this number.
            _ => Err(CheckError::Refused(Box::new(verdict))),
        }
    }

    /// Checks the remainder of the path after the time `from_ms`, with a start at rest. Does nothing if the settings and the payload of the
    /// controller are the same as in the first check (J-36, J-60).
    ///
    /// # Errors
    ///
    /// Returns [`PlanError::Refused`] with the verdict on the remainder of the path.
    pub fn check_rest(&self, device: &Config, from_ms: u32) -> Result<(), PlanError> {
        let (arm, checked_with) = &*self.basis;
        // A change of the path speed needs no new check, because it can only make the motion slower.
        let config = Config { speed: checked_with.speed, ..arm.config_on_device(device) };
        if config == *checked_with {
            return Ok(());
        }
        let friction = arm.friction();
        let planner =
            Planner { model: Some(&arm.model), friction: friction.as_ref(), ..Planner::new(&config) };
        planner.rest(&self.trajectory, from_ms, None).map(drop)
    }

    /// Returns the trajectory that was checked.
    pub fn trajectory(&self) -> &Trajectory {
        &self.trajectory
    }

    /// Returns the verdict of the check, with the values of each joint and with warnings, which do not prevent the execution.
    pub fn verdict(&self) -> &Verdict {
        &self.verdict
    }

    /// Returns the division of the trajectory into segments for the upload.
    pub fn upload_options(&self) -> &UploadOptions {
        &self.options
    }

    /// Returns the time from a measurement until the command that is computed from it takes effect, in ticks (J-62).
    pub(crate) fn delay_ticks(&self) -> u8 {
        self.delay_ticks
    }

    /// Returns the points with the raw numbers that the host sends.
    pub(crate) fn raw(&self) -> &[RawPoint] {
        &self.raw
    }

    /// Returns a shared reference to the trajectory for an observer.
    pub(crate) fn shared(&self) -> Arc<Trajectory> {
        Arc::clone(&self.trajectory)
    }

    /// Returns the number of this check, which is unique in the program.
    pub(crate) fn number(&self) -> u64 {
        self.number
    }
}
