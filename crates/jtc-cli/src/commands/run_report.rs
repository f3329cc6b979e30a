//! Report at the end of a run, with the output files and the results per joint as a table and as JSON.

use cli_kit::table;
use jtc_host::arm::Arm;
use jtc_host::recording::RecordingInfo;
use jtc_host::report::{RunFailure, Summary};
use jtc_host::session::{LinkStatistics, UploadReport};
use jtc_wire::{Joint, Status, TrajectoryState};

/// Returns the description of the arm and the motion that a recording contains.
pub(super) fn info(arm: &Arm, source: &str, trajectory: &str, start_unix_ns: u64) -> RecordingInfo {
    RecordingInfo {
        source: source.to_owned(),
        trajectory: trajectory.to_owned(),
        start_unix_ns,
        ..RecordingInfo::of(arm)
    }
}

/// Returns the text of the first failure, if a failure occurred, and the results of each joint.
pub(super) fn verdict(failure: Option<&RunFailure>, summary: &Summary) -> String {
    let Some(failure) = failure else { return figures(summary) };
    let rows: Vec<Vec<String>> = failure.rows().into_iter().map(|row| row.to_vec()).collect();
    let head = RunFailure::HEAD
        .map(|head| if matches!(head, "state" | "errors") { head.into() } else { format!(">{head}") });
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let others = match failure.causes.get(1..) {
        Some(others) if !others.is_empty() => format!("with it: {}\n", others.join(", ")),
        _ => String::new(),
    };
    format!(
        "{}\n{others}{}\nfigures up to the failure\n{}",
        failure.headline(),
        table(&head, &rows),
        figures(summary)
    )
}

/// Returns the results per joint as a table.
pub(super) fn figures(summary: &Summary) -> String {
    let rows: Vec<Vec<String>> = Joint::ALL
        .iter()
        .zip(&summary.joints)
        .map(|(joint, s)| {
            vec![
                joint.to_string(),
                figure(s.rms_error_mrad, 3),
                figure(s.max_error_mrad, 3),
                figure(s.peak_velocity_rad_s, 3),
                figure(s.peak_torque_nm, 1),
                figure(s.torque_limit_nm, 0),
                figure(s.torque_share.map(|v| v * 100.0), 0),
            ]
        })
        .collect();
    let head = ["", ">RMS mrad", ">max mrad", ">peak rad/s", ">peak N·m", ">limit N·m", ">share %"];
    table(&head, &rows)
}

/// Formats a value with `digits` decimals, or as a dash if the value is unknown.
fn figure(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".into(), |v| cli_kit::figure(v, digits))
}

/// Returns the result of an upload as a JSON event.
pub(super) fn uploaded(phase: &str, upload: &UploadReport) -> serde_json::Value {
    let mut value = serde_json::to_value(upload).unwrap_or_default();
    value["phase"] = phase.into();
    value
}

/// Describes the upload and the statistics of the link in one line.
pub(super) fn link_line(upload: &UploadReport, link: &LinkStatistics) -> String {
    let share = upload.line_share_percent().map_or(String::new(), |s| format!(" ({s:.1} % of the line)"));
    format!(
        "upload {} points in {:.2} s{share}; {} statuses, {} frames sent again, {} damaged",
        upload.points, upload.time_s, link.statuses, link.retries, link.bad_frames
    )
}

/// Describes a motion in one line below the progress bar. The line contains the state and the joint that is closest to
/// a limit.
pub(super) fn motion_line(s: &Status) -> String {
    let what = match s.trajectory.known() {
        Some(TrajectoryState::Stop) => "stopped",
        Some(TrajectoryState::Pause) => "paused; press space to resume",
        Some(TrajectoryState::Execute) => "moving",
        Some(TrajectoryState::Finish) => "finished",
        Some(TrajectoryState::Null | TrajectoryState::TransNullToStop) | None => "not moving",
    };
    let torques = Joint::ALL.iter().zip(s.joints.map(|joint| joint.torque));
    let most = torques.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    let torque = most.map_or(String::new(), |(joint, torque)| {
        format!(", most torque: {joint} {} N·m", cli_kit::figure(torque.into(), 0))
    });
    format!("{what}{}", if s.is_executing() { &torque } else { "" })
}
