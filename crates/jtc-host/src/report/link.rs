//! Facts about the upload and the link in a report.
use super::Facts;
use crate::session::{LinkStatistics, UploadReport};

impl Facts {
    /// Returns the facts about the upload and the link of a run on a line with the bit rate `baud` (Bd).
    pub fn of_link(upload: &UploadReport, link: &LinkStatistics, baud: Option<u32>) -> Self {
        let share = upload.line_share_percent();
        let share = share.map_or(String::new(), |s| format!(", {s:.1} % of the capacity of the line"));
        let row = |name: &str, value: String| (name.to_owned(), value);
        Self {
            title: "Link".into(),
            rows: vec![
                row("Rate", baud.map_or("not limited".into(), |b| format!("{b} Bd"))),
                row(
                    "Upload",
                    format!(
                        "{} points in {} segments, {} bytes",
                        upload.points, upload.segments, upload.bytes
                    ),
                ),
                row("Upload time", format!("{:.2} s{share}", upload.time_s)),
                row("Segments sent again", upload.retries.to_string()),
                row("Statuses", format!("{}, {:.1} a second", link.statuses, link.status_rate())),
                row("Frames sent", format!("{}, {} of them repeated", link.frames_sent, link.retries)),
                row("Damaged frames", link.bad_frames.to_string()),
                row("Bytes received, outside frames", format!("{}, {}", link.bytes_received, link.bad_bytes)),
            ],
        }
    }
}
