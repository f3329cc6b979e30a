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
    /// Since the session began, s.
    pub time_s: f64,
}

impl LinkStatistics {
    /// Statuses per second.
    pub fn status_rate(&self) -> f64 {
        if self.time_s > 0.0 { self.statuses as f64 / self.time_s } else { 0.0 }
    }
}
