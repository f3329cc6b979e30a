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

/// Number that the next passed check receives. The number distinguishes trajectories that are otherwise equal.
static PASSED: AtomicU64 = AtomicU64::new(1);

/// Options for the check of a trajectory before its execution.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CheckOptions {
    /// Division into segments for the upload; the check includes the number of segments.
    pub upload: UploadOptions,
    /// `true` if the settings that are not sent with friction, gains and arm model (limits, gravity, rotor inertia) may differ between the
    /// arm file and the controller. With this option the caller confirms that the controller's values are safe for this arm. If `false`,
    /// the check refuses an arm with different values (J-55).
    pub accept_device_limits: bool,
    /// Settings of the controller. By default, these are the built-in settings of the controller. For a controller with extensions, use the
    /// result of [`Session::device_config`](crate::Session::device_config).
    pub device: Config,
}

/// Trajectory that may be executed, because it passed the check for an arm and for the pose of the arm at that time.
///
/// [`Session::upload`](crate::Session::upload) and [`Session::execute`](crate::Session::execute) accept only this type, and
/// only [`CheckedTrajectory::check`] creates it. So a program that runs an unchecked trajectory does not compile:
///
/// ```compile_fail,E0308
/// fn run<P: jtc_host::Port>(session: &mut jtc_host::Session<P>, trajectory: &jtc_host::Trajectory) {
///     session.upload(trajectory, |_| jtc_host::session::Flow::Continue);
/// }
/// ```
///
/// A program cannot build a `CheckedTrajectory` from parts, or change one after the check:
///
/// ```compile_fail,E0616
/// fn faster(checked: &mut jtc_host::CheckedTrajectory) {
///     checked.trajectory.step_ms = 1;
/// }
/// ```
///
/// # Start pose
///
/// The check compares the first point with the given pose: no joint may deviate by more than the start tolerance, 0.02 rad (J-34). Pass a
/// pose that was measured immediately before the check, from the status that [`Session::wait_ready`](crate::Session::wait_ready) returns.
/// If the arm is in another pose, [`Planner::to`](crate::plan::Planner::to) plans a trajectory to the first point. Check and execute this
/// approach in the same way. Then check the motion from the final pose of the approach.
///
/// The controller compares the pose with the first point again when it executes the trajectory. If the arm was moved after the check, the
/// controller refuses the execution with data status 8, and the arm does not move.
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
    /// Writes a summary without the points, of which there may be 12 000.
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
    /// Checks `trajectory` for its execution by `arm` from the measured pose `start` (rad, base to wrist).
    ///
    /// The check uses the stricter of the limits of the arm and the controller ([`Arm::config_on_device`]). The torques are computed from
    /// the arm model with the friction of the arm, and with the gravity and rotor inertia of the controller.
    ///
    /// # Errors
    ///
    /// [`CheckError::DeviceLimits`] if the controller and the arm have different values, and the options do not allow the difference.
    /// [`CheckError::Refused`] with the verdict if the trajectory must not be executed. Possible reasons are an exceeded limit at or
    /// between points, a jump, motion at the first or last point, too much torque, too long a stop, too many points or segments, or an arm
    /// that is not at the first point. [`CheckError::Arm`] if the numbers of the arm are not physically possible. After each of these
    /// errors, no frame was sent.
    pub fn check(
        trajectory: &Trajectory,
        arm: &Arm,
        start: &[f64; JOINTS],
        options: &CheckOptions,
    ) -> Result<Self, CheckError> {
        // The fields of `Arm` are public, so the check cannot rely on valid numbers. With physically impossible numbers, any torque could
        // pass the check.
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
            // The verdict already contains a problem for each number that is outside the range of a serial frame.
            _ => Err(CheckError::Refused(Box::new(verdict))),
        }
    }

    /// Checks the remainder of the path from `from_ms` on, starting at rest. Does nothing if the settings of the controller and the payload
    /// are the same as in the first check (J-36, J-60).
    ///
    /// # Errors
    ///
    /// [`PlanError::Refused`] with the verdict on the remainder.
    pub fn check_rest(&self, device: &Config, from_ms: u32) -> Result<(), PlanError> {
        let (arm, checked_with) = &*self.basis;
        // A change of the path speed needs no check, because the path speed can only slow down the motion.
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

    /// Returns the verdict, with the values of each joint and the warnings that do not prevent execution.
    pub fn verdict(&self) -> &Verdict {
        &self.verdict
    }

    /// Returns the division into segments for the upload.
    pub fn upload_options(&self) -> &UploadOptions {
        &self.options
    }

    /// Returns the age of the controller's measurements in ticks (J-62).
    pub(crate) fn delay_ticks(&self) -> u8 {
        self.delay_ticks
    }

    /// Returns the points in the form in which the host sends them.
    pub(crate) fn raw(&self) -> &[RawPoint] {
        &self.raw
    }

    /// Returns a shared copy of the trajectory for an observer.
    pub(crate) fn shared(&self) -> Arc<Trajectory> {
        Arc::clone(&self.trajectory)
    }

    /// Returns the number of this check, which is unique in the program.
    pub(crate) fn number(&self) -> u64 {
        self.number
    }
}
