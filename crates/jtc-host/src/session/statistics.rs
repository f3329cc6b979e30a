//! What passed over the link.

/// Counters of a session.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct LinkStatistics {
    /// Bytes to the controller.
    pub bytes_sent: u64,
    /// Bytes from the controller.
    pub bytes_received: u64,
    /// Frames to the controller.
    pub frames_sent: u64,
    /// Statuses that arrived whole.
    pub statuses: u64,
    /// Bytes from the controller that belong to no status.
    pub bad_bytes: u64,
    /// Records of frames that arrived damaged at the controller.
    pub bad_frames: u64,
    /// Frames sent again.
    pub retries: u64,
    /// Since the session began, or for how long was counted, s.
    pub time_s: f64,
}

impl LinkStatistics {
    /// What passed since `before`, which is of the same session.
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

    /// Statuses per second.
    pub fn status_rate(&self) -> f64 {
        if self.time_s > 0.0 { self.statuses as f64 / self.time_s } else { 0.0 }
    }
}
