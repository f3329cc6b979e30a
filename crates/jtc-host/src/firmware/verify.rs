//! Verification after an image was copied to a drive. The verification uses the report of the drive and the flash report of the running
//! program.

use std::fmt;
use std::thread::sleep;
use std::time::Duration;

use jtc_wire::{Info, Program, StoreState};

use super::{Drive, FirmwareError, Image, Places, Written};
use crate::error::LinkError;
use crate::port::{Port, PortError};
use crate::session::{Session, Timeouts};

/// Maximum time that a device needs after its start to read its flash (J-67).
const READ_WITHIN: Duration = Duration::from_secs(3);
/// Tolerances for the comparison of a device's clock with the clock of this computer: the relative clock error, and
/// the maximum delay between the start of the device and its detection.
const CLOCKS_DIFFER: (f64, Duration) = (0.1, Duration::from_millis(250));

/// Time after the copying during which the previous program may still run before the ST-LINK stops it.
const OTHER_STOPS: Duration = Duration::from_secs(10);
/// Maximum time to wait until a controller has read its flash, measured with the clock of the port.
const READS_NOW: Duration = Duration::from_secs(5);

/// Waiting times of the verification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Maximum time to wait until the controller has started with the image.
    pub wait: Duration,
    /// Pause between two attempts to query the controller.
    pub pause: Duration,
}

impl Default for Limits {
    /// Returns 120 s for `wait` and 250 ms for `pause`. The ST-LINK needs about 30 s to write one megabyte. An operating system needs some
    /// more seconds to mount the drive.
    fn default() -> Self {
        Self { wait: Duration::from_secs(120), pause: Duration::from_millis(250) }
    }
}

/// Function that opens the serial port of the board.
pub type OpenPort<'a> = dyn FnMut() -> Result<Box<dyn Port>, PortError> + 'a;

/// Behaviour of the drive after the copying.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DriveAfter {
    /// The drive disappeared and appeared again, which is normal after it has accepted an image.
    CameBack,
    /// The drive disappeared and has not appeared again. This is normal on a system that does not mount drives
    /// automatically.
    Gone,
    /// The drive has not disappeared.
    Stayed,
}

impl fmt::Display for DriveAfter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::CameBack => "the drive disappeared and returned without a report",
            Self::Gone => "the drive disappeared and has not returned",
            Self::Stayed => "the drive has not disappeared, although it must do so after an image",
        })
    }
}

/// Result of a successful verification: a controller runs the image.
#[derive(Clone, Debug, PartialEq)]
pub struct Verification {
    /// Identity of the controller.
    pub info: Info,
    /// Report of the controller about its flash.
    pub program: Program,
    /// Behaviour of the drive after the copying.
    pub drive: DriveAfter,
    /// Time from the start of the copying to the end of the verification.
    pub took: Duration,
}

impl Verification {
    /// Returns `true` if the board stores an arm.
    pub fn stored_arm(&self) -> bool {
        self.info.store == StoreState::Stored
    }
}

/// Observer that repeatedly checks the state of a drive.
struct Watch<'a> {
    places: &'a Places,
    drive: &'a Drive,
    written: &'a Written,
    seen: DriveAfter,
}

impl Watch<'_> {
    /// Returns an error if the drive reports a failure.
    fn look(&mut self) -> Result<(), FirmwareError> {
        let now = self.places.again(self.drive);
        self.seen = match (&now, self.seen) {
            (None, _) => DriveAfter::Gone,
            (Some(now), DriveAfter::Stayed) if now.path == self.drive.path && now.usb == self.drive.usb => {
                DriveAfter::Stayed
            }
            (Some(_), _) => DriveAfter::CameBack,
        };
        let Some(now) = now else { return Ok(()) };
        // A failure report from before the copying stays on the drive until the drive disappears. Such a report is not
        // about the new image, so it is ignored.
        let stale = |text: &String| {
            self.seen == DriveAfter::Stayed && self.written.failure_before.as_ref() == Some(text)
        };
        match now.failure() {
            Some(text) if !stale(&text) => Err(FirmwareError::Refused { drive: now.path, text }),
            _ => Ok(()),
        }
    }
}

/// Waits until the drive has appeared again, at most until the time limit. This function is used for boards without a serial line. A drive
/// that has appeared again does not prove that the image runs.
///
/// # Errors
///
/// Returns [`FirmwareError::Refused`] if the drive reports a failure. Returns [`FirmwareError::NotTaken`] if the drive has not disappeared.
/// Also returns this error if the drive has not appeared again and the operating system could not confirm that all bytes were written.
pub fn wait_for_drive(
    places: &Places,
    drive: &Drive,
    written: &Written,
    limits: Limits,
) -> Result<DriveAfter, FirmwareError> {
    let mut watch = Watch { places, drive, written, seen: DriveAfter::Stayed };
    loop {
        watch.look()?;
        if watch.seen == DriveAfter::CameBack || written.began.elapsed() >= limits.wait {
            break;
        }
        sleep(limits.pause);
    }
    let (seen, doubt) = (watch.seen, written.doubt.clone());
    match seen {
        DriveAfter::CameBack => Ok(seen),
        // If the system does not mount drives automatically, the drive does not appear again.
        DriveAfter::Gone if doubt.is_none() => Ok(seen),
        DriveAfter::Gone | DriveAfter::Stayed => Err(FirmwareError::NotTaken { seen, doubt }),
    }
}

/// Waits until the controller on the serial line has started with the image, and verifies the image.
///
/// # Errors
///
/// Returns [`FirmwareError::Refused`] if the drive reports a failure. Returns [`FirmwareError::OtherProgram`] if another program runs, and
/// [`FirmwareError::NotReported`] if the program does not report its flash. Returns [`FirmwareError::NotStarted`] if no program started in
/// time.
pub fn verify_program(
    places: &Places,
    image: &Image,
    drive: &Drive,
    written: &Written,
    open: &mut OpenPort<'_>,
    limits: Limits,
) -> Result<Verification, FirmwareError> {
    let mut watch = Watch { places, drive, written, seen: DriveAfter::Stayed };
    loop {
        watch.look()?;
        let last = match open().map_err(LinkError::from).and_then(|port| ask(port, limits)) {
            Ok(Some(info)) if !started_since(&info, written.began.elapsed()) => {
                "the previous program still runs".into()
            }
            Ok(Some(info)) if still_reads(&info) => "the controller still reads its flash".into(),
            Ok(Some(info)) => match compare(image, &info) {
                Ok(program) => {
                    // During the request, the drive may have appeared again with a failure report.
                    watch.look()?;
                    return Ok(Verification {
                        info,
                        program,
                        drive: watch.seen,
                        took: written.began.elapsed(),
                    });
                }
                Err(error) if settled(&watch, limits) => return Err(error),
                Err(error) => error.to_string(),
            },
            Ok(None) => "a controller without extensions answers".into(),
            Err(e) => e.to_string(),
        };
        if written.began.elapsed() >= limits.wait {
            let waited_s = written.began.elapsed().as_secs_f64();
            return Err(FirmwareError::NotStarted { waited_s, last, doubt: written.doubt.clone() });
        }
        sleep(limits.pause);
    }
}

/// Returns `true` if the ST-LINK has finished and will not replace the running program any more. Until then, an
/// answer may come from the previous program, which can restart before the ST-LINK writes or after a reset without a
/// write.
fn settled(watch: &Watch<'_>, limits: Limits) -> bool {
    let written = watch.written;
    watch.seen == DriveAfter::CameBack
        || written.ended.elapsed() >= OTHER_STOPS
        || written.began.elapsed() >= limits.wait
}

/// Returns `true` if the device certainly started during the last `time`, even with the clock tolerances
/// [`CLOCKS_DIFFER`].
fn started_since(info: &Info, time: Duration) -> bool {
    let (share, late) = CLOCKS_DIFFER;
    Duration::from_millis(info.uptime_ms) + time.mul_f64(share) + late < time
}

/// Returns `true` if the device has just started, so that it may still be reading its flash to compute its report.
fn still_reads(info: &Info) -> bool {
    info.program.is_none() && Duration::from_millis(info.uptime_ms) < READ_WITHIN
}

/// Returns the identity of the controller after the controller has read its flash, at the latest after five seconds. Returns `None` for a
/// device without extensions.
///
/// # Errors
///
/// Returns the same errors as [`Session::info`].
pub fn info_with_program<P: Port>(session: &mut Session<P>) -> Result<Option<Info>, LinkError> {
    let end = session.now() + READS_NOW;
    loop {
        match session.info()? {
            Some(info) if still_reads(&info) && session.now() < end => drop(session.next_status()?),
            info => return Ok(info),
        }
    }
}

/// Requests and returns the identity of the controller. The timeouts are short, because the caller repeats the request.
fn ask(port: Box<dyn Port>, limits: Limits) -> Result<Option<Info>, LinkError> {
    let mut session = Session::new(port);
    session.timeouts = Timeouts { status: limits.pause * 4, confirmation: limits.pause * 2, tries: 2 };
    // The first status shows that the processor runs. While the ST-LINK keeps the processor stopped, a request would only time out.
    session.next_status()?;
    session.info()
}

/// Checks that the program reported by the controller is the program of the image (J-67).
///
/// # Errors
///
/// Returns [`FirmwareError::OtherProgram`] if another program runs, and [`FirmwareError::NotReported`] if the program does not report its
/// flash.
pub fn compare(image: &Image, info: &Info) -> Result<Program, FirmwareError> {
    let runs = format!("{} on {}", info.firmware_and_revision(), info.board);
    let Some(program) = info.program else {
        return Err(FirmwareError::NotReported { runs });
    };
    match image.is_what_runs(program) {
        Ok(()) => Ok(program),
        Err(why) => Err(FirmwareError::OtherProgram { path: image.path().to_owned(), runs, why }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_before_the_copying_is_none_since() {
        let since = |uptime_ms, time_s| {
            started_since(&Info { uptime_ms, ..Info::default() }, Duration::from_secs_f64(time_s))
        };
        // First case: the copying began 10 s ago, and the device had started 50 ms before. The clock of the device is
        // 5 % slow, so it reports about 9.55 s. This must not count as a start after the copying.
        assert!(!since(50 + 9_500, 10.0) && !since(10, 0.2) && !since(3_600_000, 10.0));
        assert!(since(1_000, 10.0) && since(0, 0.4));
    }

    #[test]
    fn j67_a_device_that_has_just_started_may_still_read_its_flash() {
        let program = Some(Program { bytes: 1, crc32: 1 });
        let reads = |uptime_ms, program| still_reads(&Info { uptime_ms, program, ..Info::default() });
        assert!(reads(0, None) && reads(2_999, None));
        assert!(!reads(3_000, None) && !reads(0, program));
    }
}
