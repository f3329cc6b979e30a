//! Upload of a trajectory to the controller. Several segments are sent before the first one is confirmed. Each
//! segment is confirmed, and lost segments are sent again.

use std::collections::VecDeque;
use std::time::Duration;

use jtc_core::{POINTS_MAX, SEGMENTS_MAX};
use jtc_wire::{
    DataStatus, EncodeError, FrameStatus, FrameType, RawPoint, Response, STATUS_LEN, TrajectoryState,
};

use super::{Flow, Session};
use crate::check::CheckedTrajectory;
use crate::error::{Error, LinkError, UploadError, accepted};
use crate::frame;
use crate::port::{Port, PortError, line_time};
use crate::trajectory::UploadOptions;

/// Maximum number of times that a segment is sent.
const SEGMENT_TRIES: u32 = 16;
/// Maximum number of restarts of the complete upload.
const RESTARTS: u32 = 3;
/// Maximum number of segments that are sent but not yet confirmed. The controller can queue one response record more
/// than this number.
const WINDOW_MAX: usize = 7;

/// Progress of an upload.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Progress {
    /// Segments confirmed.
    pub segments_done: usize,
    /// Total number of segments.
    pub segments: usize,
    /// Bytes of confirmed segments.
    pub bytes_done: usize,
    /// Bytes of all segments.
    pub bytes: usize,
    /// Average rate since the start of the upload, bytes/s.
    pub bytes_per_s: f64,
    /// Remaining time at the average rate, s.
    pub left_s: f64,
    /// Number of repeated segments.
    pub retries: u32,
}

/// Statistics of a completed upload.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct UploadReport {
    /// Number of points.
    pub points: usize,
    /// Number of segments.
    pub segments: usize,
    /// Bytes of all segments.
    pub bytes: usize,
    /// Time from the first byte to the last confirmation, s.
    pub time_s: f64,
    /// Bytes per second.
    pub bytes_per_s: f64,
    /// Share of the line capacity that the upload used. `None` if the line has no bit rate.
    pub line_share: Option<f64>,
    /// Number of repeated segments.
    pub retries: u32,
    /// Number of restarts of the complete upload.
    pub restarts: u32,
}

impl UploadReport {
    /// Returns the share of the line capacity that the upload used, %. Returns `None` if the line is faster than its
    /// bit rate, as a pseudo-terminal is.
    pub fn line_share_percent(&self) -> Option<f64> {
        self.line_share.map(|s| s * 100.0).filter(|s| *s < 101.0)
    }
}

struct InFlight {
    /// Time at which the line will have transmitted the frame.
    done: Duration,
}

/// State of an upload.
struct Upload {
    frames: Vec<Vec<u8>>,
    confirmed: usize,
    next: usize,
    in_flight: VecDeque<InFlight>,
    /// Frame that is being written: index of the frame, and number of its bytes that are already written.
    writing: Option<(usize, usize)>,
    line_done: Duration,
    /// `true` while segments are sent one at a time, because it is unknown which segments the controller has
    /// received.
    probing: bool,
    tries: u32,
    retries: u32,
    restarts: u32,
    /// Number of Stops and Pauses of other programs before the upload.
    halts: u64,
    window: usize,
    chunk: usize,
    start: Duration,
    bytes_done: usize,
    bytes: usize,
}

impl Upload {
    fn new(
        points: &[RawPoint],
        step_ms: u16,
        options: &UploadOptions,
        baud: Option<u32>,
        now: Duration,
    ) -> Result<Self, EncodeError> {
        let per_segment = options.segment_points(points.len());
        let count = points.len().div_ceil(per_segment);
        let frames = points
            .chunks(per_segment)
            .enumerate()
            .map(|(i, chunk)| frame::segment(options.number, i as u16, count as u16, step_ms, chunk))
            .collect::<Result<Vec<Vec<u8>>, _>>()?;
        let longest = frames.first().map_or(0, Vec::len);
        // At least 60 ms of data must be in transmission, because USB adapters have a latency. `WINDOW_MAX` can
        // reduce this time.
        let time = line_time(longest, baud).as_secs_f64();
        let window = if time > 0.0 { (0.060 / time).ceil() as usize + 2 } else { WINDOW_MAX };
        Ok(Self {
            bytes: frames.iter().map(Vec::len).sum(),
            frames,
            confirmed: 0,
            next: 0,
            in_flight: VecDeque::new(),
            writing: None,
            line_done: now,
            probing: false,
            tries: 0,
            retries: 0,
            restarts: 0,
            halts: 0,
            window: window.clamp(3, WINDOW_MAX),
            // A write contains at most the bytes that the line transmits in 10 ms, so that the session can receive
            // statuses between two writes.
            chunk: baud.map_or(4096, |b| (b as usize / 1000).clamp(256, 4096)),
            start: now,
            bytes_done: 0,
        })
    }

    fn progress(&self, now: Duration) -> Progress {
        let seconds = (now - self.start).as_secs_f64();
        let rate = if seconds > 0.0 { self.bytes_done as f64 / seconds } else { 0.0 };
        Progress {
            segments_done: self.confirmed,
            segments: self.frames.len(),
            bytes_done: self.bytes_done,
            bytes: self.bytes,
            bytes_per_s: rate,
            left_s: if rate > 0.0 { (self.bytes - self.bytes_done) as f64 / rate } else { 0.0 },
            retries: self.retries,
        }
    }

    fn confirm(&mut self) {
        self.bytes_done += self.frames[self.confirmed].len();
        self.confirmed += 1;
        self.next = self.next.max(self.confirmed);
        self.in_flight.pop_front();
        self.tries = 0;
    }

    /// Returns to the first unconfirmed segment. Afterwards, the upload sends segments one at a time.
    fn go_back(&mut self) {
        self.retries += (self.next - self.confirmed) as u32;
        self.next = self.confirmed;
        self.in_flight.clear();
        self.probing = true;
        self.tries += 1;
    }

    fn restart(&mut self) {
        self.restarts += 1;
        self.confirmed = 0;
        self.bytes_done = 0;
        self.tries = 0;
        self.go_back();
        self.probing = false;
    }

    fn may_send(&self) -> bool {
        self.next < self.frames.len() && self.in_flight.len() < if self.probing { 1 } else { self.window }
    }
}

impl<P: Port> Session<P> {
    /// Uploads a trajectory that passed the check. Returns when the controller reports that the trajectory is complete
    /// (trajectory state Stop). The arm does not move. Calls `progress` after each confirmed segment; `progress` can
    /// cancel the upload with [`Flow::Cancel`].
    ///
    /// The first segment deletes the earlier trajectory in the controller.
    ///
    /// # Errors
    ///
    /// Returns [`UploadError::SegmentRefused`] if the controller rejects a segment, for example because the arm is not in position hold, or
    /// because the controller's check (J-36) found a problem. Returns [`UploadError::Incomplete`] if too many frames were lost. Returns
    /// [`Error::Cancelled`] if `progress` cancelled the upload. Also returns the errors of [`Session::next_status`] if the controller or
    /// the port is lost. After an error the controller has no complete trajectory and cannot execute a motion.
    pub fn upload(
        &mut self,
        checked: &CheckedTrajectory,
        progress: impl FnMut(&Progress) -> Flow,
    ) -> Result<UploadReport, Error> {
        self.uploaded = None;
        self.introduce()?;
        let step_ms = checked.trajectory().step_ms;
        let report = self.send(checked.raw(), step_ms, checked.upload_options(), progress)?;
        self.uploaded = Some(checked.clone());
        Ok(report)
    }

    /// Sends points with the time step `step_ms`.
    fn send(
        &mut self,
        points: &[RawPoint],
        step_ms: u16,
        options: &UploadOptions,
        mut progress: impl FnMut(&Progress) -> Flow,
    ) -> Result<UploadReport, Error> {
        let per_segment = options.segment_points(points.len());
        let segments = points.len().div_ceil(per_segment);
        let refused = |code| Error::from(UploadError::SegmentRefused { segment: 0, segments, code });
        if points.is_empty() {
            return Err(refused(DataStatus::IncorrectValue));
        }
        if points.len() > POINTS_MAX {
            return Err(refused(DataStatus::TooManyPoints));
        }
        if segments > SEGMENTS_MAX {
            return Err(refused(DataStatus::TooManySegments));
        }
        self.forget_the_past()?;
        let (baud, start) = (self.port.baud(), self.port.now());
        let mut up = Upload::new(points, step_ms, options, baud, start)?;
        up.halts = self.port.halts().all;
        loop {
            while up.confirmed < segments {
                if self.advance(&mut up)? && progress(&up.progress(self.port.now())) == Flow::Cancel {
                    return Err(Error::Cancelled);
                }
            }
            if self.complete()? {
                break;
            }
            if up.restarts >= RESTARTS {
                return Err(self.upload_failed(&up).into());
            }
            up.restart();
        }
        let time_s = (self.port.now() - start).as_secs_f64();
        self.statistics.retries += u64::from(up.retries);
        Ok(UploadReport {
            points: points.len(),
            segments,
            bytes: up.bytes,
            time_s,
            bytes_per_s: up.bytes as f64 / time_s.max(1e-9),
            line_share: baud.map(|_| line_time(up.bytes, baud).as_secs_f64() / time_s.max(1e-9)),
            retries: up.retries,
            restarts: up.restarts,
        })
    }

    fn upload_failed(&self, up: &Upload) -> UploadError {
        UploadError::Incomplete {
            confirmed: up.confirmed,
            segments: up.frames.len(),
            restarts: up.restarts,
            trajectory: self.last.map_or(TrajectoryState::Null.into(), |s| s.trajectory),
        }
    }

    /// Returns `true` if the controller reports that the trajectory is complete.
    fn complete(&mut self) -> Result<bool, Error> {
        if self.last.is_some_and(|s| s.trajectory == TrajectoryState::Stop) {
            return Ok(true);
        }
        for _ in 0..8 {
            if self.next_status()?.trajectory == TrajectoryState::Stop {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Writes the next part of a frame or waits for a response record. Returns `true` if a segment was confirmed.
    fn advance(&mut self, up: &mut Upload) -> Result<bool, Error> {
        if up.writing.is_none() && up.may_send() {
            if up.next == 0 {
                // Without an extension request before segment 0, the controller assumes that the host does not know the
                // extensions (J-30).
                self.introduce()?;
            }
            up.writing = Some((up.next, 0));
            let now = self.port.now();
            up.line_done = up.line_done.max(now) + line_time(up.frames[up.next].len(), self.port.baud());
            up.in_flight.push_back(InFlight { done: up.line_done });
            up.next += 1;
        }
        let mut wait = Duration::ZERO;
        if let Some((index, at)) = up.writing {
            let frame = &up.frames[index];
            let end = frame.len().min(at + up.chunk);
            self.port.write_all(&frame[at..end])?;
            self.statistics.bytes_sent += (end - at) as u64;
            up.writing = (end < frame.len()).then_some((index, end));
            self.statistics.frames_sent += u64::from(end == frame.len());
        } else {
            wait = self.deadline(up).saturating_sub(self.port.now());
        }
        if self.records.is_empty() {
            self.read(wait)?;
        }
        let confirmed = up.confirmed;
        while let Some(record) = self.records.pop_front() {
            if up.confirmed >= up.frames.len() {
                break;
            }
            self.take_record(up, record)?;
        }
        if up.writing.is_none() && !up.in_flight.is_empty() && self.port.now() >= self.deadline(up) {
            self.overdue(up)?;
        }
        Ok(up.confirmed > confirmed)
    }

    fn deadline(&self, up: &Upload) -> Duration {
        let oldest = up.in_flight.front().map_or(self.port.now(), |f| f.done);
        oldest + line_time(2 * STATUS_LEN, self.port.baud()) + self.timeouts.confirmation
    }

    fn take_record(&mut self, up: &mut Upload, record: Response) -> Result<(), Error> {
        if record.status != FrameStatus::NoError {
            return self.start_over(up);
        }
        if record.frame_type != jtc_wire::FrameType::Trajectory as u8 || up.in_flight.is_empty() {
            return Ok(());
        }
        if accepted(&record) {
            up.confirm();
            up.probing = false;
            return Ok(());
        }
        match record.data {
            // Only one segment is in flight, and the controller rejects it because its number is out of order.
            // Therefore the segment had already arrived, and only its confirmation was lost.
            DataStatus::IncorrectSegmentOrder if up.probing && up.confirmed > 0 => {
                up.confirm();
                Ok(())
            }
            DataStatus::IncorrectSegmentOrder => self.start_over(up),
            code => {
                if let Some(reason) = self.port.take_denial() {
                    return Err(LinkError::Denied { request: FrameType::Trajectory, reason }.into());
                }
                if self.port.halts().all != up.halts {
                    // The controller dropped the upload because of another program's Stop. This segment was sent just
                    // before the port began to block segments.
                    return Err(LinkError::Port(PortError::Halted { by: None }).into());
                }
                Err(UploadError::SegmentRefused { segment: up.confirmed, segments: up.frames.len(), code }
                    .into())
            }
        }
    }

    /// Handles a response record that did not arrive in time.
    fn overdue(&mut self, up: &mut Upload) -> Result<(), Error> {
        if self.port.now() - self.last_received > self.timeouts.status {
            self.next_status()?;
        }
        // All segments are sent, and the status shows that the trajectory is complete, so only confirmations were
        // lost. The status is not an old one: since the confirmation of segment 0, the trajectory state was Null
        // until now.
        if up.next == up.frames.len()
            && up.confirmed > 0
            && self.last.is_some_and(|s| s.trajectory == TrajectoryState::Stop)
        {
            while up.confirmed < up.frames.len() {
                up.confirm();
            }
            return Ok(());
        }
        self.start_over(up)
    }

    /// Waits for the response records of the frames in flight. Then the upload continues with the first segment that
    /// is not confirmed.
    fn start_over(&mut self, up: &mut Upload) -> Result<(), Error> {
        if up.tries >= SEGMENT_TRIES {
            return Err(self.upload_failed(up).into());
        }
        if let Some((index, at)) = up.writing.take() {
            self.port.write_all(&up.frames[index][at..])?;
            self.statistics.bytes_sent += (up.frames[index].len() - at) as u64;
        }
        let quiet = up.line_done.max(self.port.now()) + line_time(2 * STATUS_LEN, self.port.baud());
        // The controller sends a response record directly after it has received the frame. The wait includes one more
        // status period for a response record that is late.
        let end = quiet + Duration::from_millis(60);
        loop {
            let now = self.port.now();
            if now >= end {
                break;
            }
            self.read(end - now)?;
        }
        while let Some(record) = self.records.pop_front() {
            let trajectory = record.frame_type == jtc_wire::FrameType::Trajectory as u8;
            if trajectory && accepted(&record) && !up.in_flight.is_empty() {
                up.confirm();
            }
        }
        up.go_back();
        Ok(())
    }
}
