//! Statistics of the link.

/// Counters of a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct LinkStatistics {
    /// Bytes sent to the controller.
    pub bytes_sent: u64,
    /// Bytes received from the controller.
    pub bytes_received: u64,
    /// Frames sent to the controller.
    pub frames_sent: u64,
    /// Complete statuses received.
    pub statuses: u64,
    /// Bytes from the controller that are not part of a status.
    pub bad_bytes: u64,
    /// Number of frames that the controller reported as damaged.
    pub bad_frames: u64,
    /// Frames that were repeated.
    pub retries: u64,
    /// Time since the start of the session, or since an earlier snapshot of the statistics, s.
    pub time_s: f64,
}

impl LinkStatistics {
    /// Returns the statistics since `before`, an earlier snapshot of this session.
    pub fn since(&self, before: &Self) -> Self {
        Self {
            bytes_sent: self.bytes_sent.saturating_sub(before.bytes_sent),
            bytes_received: self.bytes_received.saturating_sub(before.bytes_received),
            frames_sent: self.frames_sent.saturating_sub(before.frames_sent),
            statuses: self.statuses.saturating_sub(before.statuses),
            bad_bytes: self.bad_bytes.saturating_sub(before.bad_bytes),
            bad_frames: self.bad_frames.saturating_sub(before.bad_frames),
            retries: self.retries.saturating_sub(before.retries),
            time_s: self.time_s - before.time_s,
        }
    }

    /// Returns the number of statuses per second.
    pub fn status_rate(&self) -> f64 {
        if self.time_s > 0.0 { self.statuses as f64 / self.time_s } else { 0.0 }
    }
}
