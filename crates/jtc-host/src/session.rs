//! Session with the controller. Only the session writes to the port. The session receives the stream of statuses, and a
//! response record for each frame that it sends.
//!
//! The controller sends each response record only once (J-04), in exactly one status. The response records are in the
//! order of the frames. The session stores the response records in a queue and passes each of them to the request to
//! which it belongs.

mod bench;
mod capture_pose;
mod clock;
mod commands;
mod extension;
mod follow;
mod jogging;
mod limit;
mod log;
mod params;
mod payload;
mod presence;
mod push_arm;
mod ready;
mod recover;
mod reset;
mod run;
mod settings;
mod statistics;
mod teaching;
mod upload;

use std::collections::VecDeque;
use std::time::Duration;

use extension::Extensions;
pub use jtc_core::Payload;
use jtc_wire::{
    DataStatus, FrameStatus, FrameType, FromDevice, Response, Status, StatusReceiver, TrajectoryState, fixed,
};

pub use clock::StatusClock;
pub use commands::Parameter;
pub use follow::{Flow, Outcome};
pub use jogging::JOG_AGAIN;
use limit::Limit;
pub use log::LogStatus;
pub use params::PushReport;
use presence::Presence;
pub use presence::host_timeout_ms;
pub use push_arm::ArmPart;
pub use ready::BRING_UP;
pub use recover::{ParameterSource, RecoverParameters, RecoverStep};
pub use reset::reset_takes_torque;
pub use run::Run;
pub use statistics::LinkStatistics;
pub use upload::{Progress, UploadReport};

pub use crate::trajectory::UploadOptions;

use crate::check::CheckedTrajectory;
use crate::error::{Error, LinkError, StateError, accepted};
use crate::port::{Port, line_time};

/// Callback that receives the port's time and each status.
type Observer = Box<dyn FnMut(Duration, &Status)>;

/// Timeouts of a session, and maximum number of transmissions of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timeouts {
    /// Time without a status after which the link is considered lost.
    pub status: Duration,
    /// Maximum time until a confirmation, in addition to the transmission time.
    pub confirmation: Duration,
    /// Maximum number of times that a frame is sent before the session reports that the frame is not confirmed.
    pub tries: u32,
}

impl Default for Timeouts {
    fn default() -> Self {
        Self { status: Duration::from_secs(2), confirmation: Duration::from_millis(300), tries: 4 }
    }
}

/// A session over a port.
pub struct Session<P> {
    port: P,
    receiver: StatusReceiver,
    arrived: VecDeque<Status>,
    records: VecDeque<Response>,
    /// Answers to extension requests, in the form in which they were received.
    answers: VecDeque<Vec<u8>>,
    extensions: Extensions,
    presence: Presence,
    last: Option<Status>,
    statistics: LinkStatistics,
    start: Duration,
    last_received: Duration,
    observer: Option<Observer>,
    /// Trajectory that this session uploaded and that is still in the memory of the controller.
    uploaded: Option<CheckedTrajectory>,
    /// Time limits.
    pub timeouts: Timeouts,
}

impl<P: Port> Session<P> {
    /// Creates a session on an open port. This function sends no frame and does not wait.
    pub fn new(port: P) -> Self {
        let start = port.now();
        Self {
            port,
            receiver: StatusReceiver::new(),
            arrived: VecDeque::new(),
            records: VecDeque::new(),
            answers: VecDeque::new(),
            extensions: Extensions::default(),
            presence: Presence::default(),
            last: None,
            statistics: LinkStatistics::default(),
            start,
            last_received: start,
            observer: None,
            uploaded: None,
            timeouts: Timeouts::default(),
        }
    }

    /// Sets `observer`. Each function of the session that receives a status passes the status to this observer.
    pub fn observe(&mut self, observer: impl FnMut(Duration, &Status) + 'static) {
        self.observer = Some(Box::new(observer));
    }

    /// Removes the observer.
    pub fn stop_observing(&mut self) {
        self.observer = None;
    }

    /// Returns the port.
    pub fn port(&self) -> &P {
        &self.port
    }

    /// Returns the port, for calls that the session does not provide. The caller must not write bytes to the port,
    /// because the session would then no longer work correctly.
    pub fn port_mut(&mut self) -> &mut P {
        &mut self.port
    }

    /// Ends the session and returns the port.
    pub fn into_port(self) -> P {
        self.port
    }

    /// Returns the time of the port.
    pub fn now(&self) -> Duration {
        self.port.now()
    }

    /// Returns the statistics of the link so far.
    pub fn statistics(&self) -> LinkStatistics {
        LinkStatistics {
            bad_bytes: self.receiver.counters().skipped_bytes,
            time_s: (self.port.now() - self.start).as_secs_f64(),
            ..self.statistics
        }
    }

    /// Returns the last received status, even if it is old.
    pub fn last(&self) -> Option<&Status> {
        self.last.as_ref()
    }

    /// Returns the next status. Returns `None` if no status arrives within `timeout`.
    ///
    /// # Errors
    ///
    /// Returns [`LinkError::Port`] if the port is lost.
    pub fn poll(&mut self, timeout: Duration) -> Result<Option<Status>, LinkError> {
        let end = self.port.now() + timeout;
        loop {
            if let Some(status) = self.arrived.pop_front() {
                return Ok(Some(status));
            }
            let wait = end.saturating_sub(self.port.now()).min(self.show_presence()?);
            if self.read(wait)? == 0 && self.port.now() >= end {
                return Ok(None);
            }
        }
    }

    /// Returns the next status. Returns an error if the controller sends no status.
    ///
    /// # Errors
    ///
    /// Returns [`LinkError::NoLink`] if no status arrives within [`Timeouts::status`]. Returns [`LinkError::Port`] if the port is lost.
    pub fn next_status(&mut self) -> Result<Status, LinkError> {
        let (start, bytes) = (self.port.now(), self.statistics.bytes_received);
        let mut limit = Limit::new(self.timeouts.status);
        while let Some(wait) = limit.next_wait() {
            let begun = self.port.now();
            if let Some(status) = self.poll(wait)? {
                return Ok(status);
            }
            limit.waited(wait, self.port.now() - begun);
        }
        Err(LinkError::NoLink {
            port: self.port.name(),
            baud: self.port.baud(),
            waited_s: (self.port.now() - start).as_secs_f64(),
            bytes: self.statistics.bytes_received - bytes,
        })
    }

    /// Returns a status that arrives after this call. Discards the statuses that arrived before the call.
    ///
    /// # Errors
    ///
    /// Returns the errors of [`Session::next_status`].
    pub fn fresh_status(&mut self) -> Result<Status, LinkError> {
        self.catch_up()?;
        self.next_status()
    }

    /// Reads all bytes that have arrived, without waiting.
    fn catch_up(&mut self) -> Result<(), LinkError> {
        // The number of reads is limited, so that a line with continuous data cannot block this loop.
        for _ in 0..64 {
            if self.read(Duration::ZERO)? == 0 {
                break;
            }
        }
        self.arrived.clear();
        Ok(())
    }

    /// Reads all received bytes, and discards response records and denials of earlier frames. Otherwise they could be
    /// mistaken for the answer to the next frame.
    fn forget_the_past(&mut self) -> Result<(), LinkError> {
        self.catch_up()?;
        self.records.clear();
        self.port.take_denial();
        Ok(())
    }

    fn read(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        let mut buffer = [0; 4096];
        let n = self.port.read(&mut buffer, timeout)?;
        self.statistics.bytes_received += n as u64;
        let before = self.arrived.len();
        let mut rest = &buffer[..n];
        while let Some(frame) = self.receiver.next_frame(&mut rest) {
            match frame {
                FromDevice::Status(status) => self.arrived.push_back(status),
                FromDevice::Answer(answer) => {
                    if let Some(at) = self.presence.take_answer(&answer) {
                        self.extensions = Extensions::Asked(at);
                    }
                    let mut bytes = vec![0; jtc_wire::ANSWER_MAX];
                    // The buffer is large enough, because the encoded answer is as long as the received answer.
                    let n = answer.emit(&mut bytes).unwrap_or(0);
                    bytes.truncate(n);
                    self.answers.push_back(bytes);
                }
            }
        }
        // Limits the queue in case no caller reads the answers.
        while self.answers.len() > 64 {
            self.answers.pop_front();
        }
        let now = self.port.now();
        for status in self.arrived.iter().skip(before) {
            self.statistics.statuses += 1;
            if status.response.status != FrameStatus::Idle {
                self.statistics.bad_frames += u64::from(status.response.status != FrameStatus::NoError);
                self.records.push_back(status.response);
            }
            if let Some(observer) = &mut self.observer {
                observer(now, status);
            }
            if status.trajectory == TrajectoryState::Null {
                self.uploaded = None;
            }
            self.presence.take_status(status, now);
            self.last = Some(*status);
            self.last_received = now;
        }
        // Limits the queue in case no caller reads the statuses.
        while self.arrived.len() > 256 {
            self.arrived.pop_front();
        }
        Ok(n)
    }

    fn write(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.port.write_all(frame)?;
        self.statistics.bytes_sent += frame.len() as u64;
        self.statistics.frames_sent += 1;
        Ok(())
    }

    /// Returns the maximum time until the confirmation of a frame of `len` bytes must arrive.
    fn confirmation_time(&self, len: usize) -> Duration {
        // The confirmation time covers the transmission of the frame, of a status that is already being sent, and of
        // the status with the response record.
        line_time(len + 2 * jtc_wire::STATUS_LEN, self.port.baud()) + self.timeouts.confirmation
    }

    /// Sends a frame and waits for its response record. If the frame arrived damaged, or if no response record
    /// arrives, the session sends the frame again.
    ///
    /// The session repeats Execute and TeachingModeEnable only if the frame arrived damaged. If only the response
    /// record is missing, the controller may have executed the frame, and a Stop from another line may then have
    /// stopped the arm. The function `request` is not public, because a frame can start a motion.
    fn request(&mut self, frame: &[u8]) -> Result<Response, LinkError> {
        let kind = type_byte(frame);
        let once = frame == fixed::EXECUTE || frame == fixed::TEACHING_MODE_ENABLE;
        let halts = frame == fixed::STOP || frame == fixed::PAUSE;
        let (mut bad, mut due) = (None, true);
        self.forget_the_past()?;
        for attempt in 0..self.timeouts.tries {
            if due {
                self.statistics.retries += u64::from(attempt > 0);
                self.write(frame)?;
            }
            let begun = self.port.now();
            match self.record_for(kind, frame.len())? {
                Some(record) if record.status == FrameStatus::NoError => return Ok(record),
                // A response record with the error "unknown frame type" may mean that the frame was damaged on the
                // line. If the repeated frame gets an equal response record, the device does not know the frame type.
                Some(record) if record.status == FrameStatus::IncorrectFrameType && bad == Some(record) => {
                    break;
                }
                Some(record) => (bad, due) = (Some(record), true),
                // If neither a response record nor a status has arrived, the device is probably only late and has not
                // lost the frame. Therefore the session does not repeat the frame, unless it is a Stop or a Pause.
                None if !halts && self.last_received < begun => {
                    due = false;
                    self.next_status()?;
                }
                None => due = !once,
            }
        }
        if self.port.now() - self.last_received > self.timeouts.status {
            self.next_status()?;
        }
        Err(LinkError::NotConfirmed { request: frame_type(kind), tries: self.timeouts.tries, last: bad })
    }

    /// Returns the response record of the frame that was just sent. Returns `None` if no response record arrived in
    /// time.
    fn record_for(&mut self, kind: u8, len: usize) -> Result<Option<Response>, LinkError> {
        let mut limit = Limit::new(self.confirmation_time(len));
        loop {
            while let Some(record) = self.records.pop_front() {
                // A response record without an error that belongs to another frame type answers an earlier request,
                // which has timed out. Such a record is ignored.
                if record.status != FrameStatus::NoError || record.frame_type == kind {
                    return Ok(Some(record));
                }
            }
            if !self.wait_within(&mut limit)? {
                return Ok(None);
            }
        }
    }

    /// Reads bytes for the next part of the time `limit`, and subtracts this part from the limit. Returns `false` if
    /// no time is left.
    fn wait_within(&mut self, limit: &mut Limit) -> Result<bool, LinkError> {
        let Some(wait) = limit.next_wait() else { return Ok(false) };
        let begun = self.port.now();
        self.read(wait)?;
        limit.waited(wait, self.port.now() - begun);
        Ok(true)
    }

    /// Sends a command. Returns an error if the command is rejected.
    fn command(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.introduce()?;
        let record = self.request(frame)?;
        if accepted(&record) { Ok(()) } else { Err(self.refused(record)) }
    }

    /// Returns the error for the request that this response record rejects. Either the device or an agent that shares
    /// the line has rejected the request.
    fn refused(&mut self, record: Response) -> LinkError {
        if let Some(reason) = self.port.take_denial() {
            return LinkError::Denied { request: frame_type(record.frame_type), reason };
        }
        let last = self.last.unwrap_or_default();
        LinkError::Refused {
            request: frame_type(record.frame_type),
            code: record.data,
            state: last.state,
            trajectory: last.trajectory,
        }
    }

    /// Waits until `reached` returns `true`. `what` describes the condition in the error.
    ///
    /// # Errors
    ///
    /// Returns [`StateError::Timeout`] with the last status. Also returns the errors of [`Session::next_status`].
    pub fn wait_for(
        &mut self,
        what: &'static str,
        timeout: Duration,
        mut reached: impl FnMut(&Status) -> bool,
    ) -> Result<Status, Error> {
        let start = self.port.now();
        loop {
            let status = self.next_status()?;
            if reached(&status) {
                return Ok(status);
            }
            let waited = self.port.now() - start;
            if waited >= timeout {
                let waited_s = waited.as_secs_f64();
                return Err(StateError::Timeout { what, waited_s, status: Box::new(status) }.into());
            }
        }
    }
}

/// Returns the type byte of a frame. If the bytes are too short for a frame, returns 0, which is not a valid type.
fn type_byte(frame: &[u8]) -> u8 {
    frame.get(1).copied().unwrap_or(0)
}

/// Returns the type of a request that this library sent itself.
fn frame_type(kind: u8) -> FrameType {
    FrameType::from_byte(kind).unwrap_or(FrameType::JtcStatus)
}

/// Returns `true` if the controller rejects the request because of its state.
fn not_allowed(record: &Response) -> bool {
    record.status == FrameStatus::NoError && record.data == DataStatus::NotAllowed
}
