//! The table of `cargo xtask bench`: performance figures, their anchors and their targets.
use super::{Failed, Figures};
use crate::size;

/// Target value of a performance figure.
#[derive(Clone, Copy)]
enum Target {
    /// The value of our software must be at most this factor times the smallest anchor (reference value).
    Share(f64),
    /// The value of our software must be at most this value.
    AtMost(f64),
    /// The value of our software must be at least this value.
    AtLeast(f64),
    /// The figure has no target and is for information only.
    None,
}

/// Row of the table, which compares one performance figure.
struct Row {
    title: &'static str,
    ours: &'static str,
    /// Anchors (reference values) of the figure. The table compares the figure with the smallest anchor, and also lists
    /// anchors that could not be measured.
    anchors: &'static [&'static str],
    target: Target,
    unit: &'static str,
}

const fn row(
    title: &'static str,
    ours: &'static str,
    anchors: &'static [&'static str],
    target: Target,
    unit: &'static str,
) -> Row {
    Row { title, ours, anchors, target, unit }
}

const OTHERS_INVERSE: &[&str] = &["mujoco.inverse", "kdl.inverse", "rbdl.inverse"];

const ROWS: &[Row] = &[
    row("inverse dynamics / Pinocchio", "ours.inverse", &["pinocchio.inverse"], Target::Share(0.25), "ns"),
    row(
        "inverse dynamics / Pinocchio built for this processor",
        "ours.inverse",
        &["pinocchio_native.inverse"],
        Target::None,
        "ns",
    ),
    row("inverse dynamics / generated code", "ours.inverse", &["casadi.inverse"], Target::Share(0.65), "ns"),
    row(
        "inverse dynamics / generated code built for this processor",
        "ours.inverse",
        &["casadi_native.inverse"],
        Target::None,
        "ns",
    ),
    row("inverse dynamics / best of MuJoCo, KDL, RBDL", "ours.inverse", OTHERS_INVERSE, Target::None, "ns"),
    row("forward dynamics / Pinocchio", "ours.forward", &["pinocchio.forward"], Target::Share(0.2), "ns"),
    row(
        "forward dynamics / Pinocchio built for this processor",
        "ours.forward",
        &["pinocchio_native.forward"],
        Target::None,
        "ns",
    ),
    row("forward dynamics / generated code", "ours.forward", &["casadi.forward"], Target::Share(1.0), "ns"),
    row(
        "forward dynamics / generated code built for this processor",
        "ours.forward",
        &["casadi_native.forward"],
        Target::None,
        "ns",
    ),
    row("mass matrix / Pinocchio", "ours.mass_matrix", &["pinocchio.mass_matrix"], Target::None, "ns"),
    row(
        "sine and cosine of 6 angles / libm",
        "ours.sin_cos_6",
        &["libm_sin_cos_6"],
        Target::AtMost(26.0),
        "ns",
    ),
    row("control tick", "control_tick_ns", &[], Target::AtMost(250.0), "ns"),
    row("longest tick while moving", "tick_longest_moving_ns", &[], Target::None, "ns"),
    row(
        "longest tick with friction table, segment",
        "tick_longest_with_host_frames_ns",
        &[],
        Target::None,
        "ns",
    ),
    row(
        "simulated millisecond / MuJoCo RK4",
        "sim_ms_ns",
        &["mujoco.step_rk4"],
        Target::AtMost(2500.0),
        "ns",
    ),
    row("simulator, multiple of real time", "sim_times_real_time", &[], Target::AtLeast(400.0), "×"),
    row("CRC-16 / crc crate, 16 tables", "crc16_gb_s", &["crate_slice16_gb_s"], Target::AtLeast(4.0), "GB/s"),
    row("stream parser", "stream_parser_gb_s", &[], Target::None, "GB/s"),
    row(
        "upload of 12 000 points at 115 200 Bd",
        "upload_115200_share",
        &[],
        Target::AtLeast(0.98),
        "of the line",
    ),
    row(
        "upload of 12 000 points at 921 600 Bd",
        "upload_921600_share",
        &[],
        Target::AtLeast(0.98),
        "of the line",
    ),
    row(
        "upload of 12 000 points at 3 MBd",
        "upload_3000000_share",
        &[],
        Target::AtLeast(0.98),
        "of the line",
    ),
    row(
        "controller with its trajectory",
        "controller_kib",
        &[],
        Target::AtMost(size::LIMIT as f64 / 1024.0),
        "KiB",
    ),
    row(
        "UCoM: numbers for 31 boards / time on the bus",
        "ucom_init_31_s",
        &["ucom_init_31_bus_s"],
        Target::None,
        "s",
    ),
    row(
        "UCoM: update of 60 KiB / time on the bus, without a frame gap",
        "ucom_update_60k_no_gap_share",
        &[],
        Target::AtMost(1.25),
        "×",
    ),
    row(
        "UCoM: the same with the gap of 200 µs that boards are given",
        "ucom_update_60k_share",
        &[],
        Target::None,
        "×",
    ),
    row("UCoM: frames read / cantools", "ucom_decode_frames_s", &["cantools_frames_s"], Target::None, "1/s"),
    row("UCoM: memory of a board's node", "ucom_node_bytes", &[], Target::AtMost(4096.0), "B"),
    row(
        "100 waypoints of 6 joints planned, torque and jerk limited",
        "plan.ms_100",
        &[],
        Target::AtMost(50.0),
        "ms",
    ),
    row(
        "400 waypoints / four times 100",
        "plan.ms_400",
        &["plan.four_times_ms_100"],
        Target::Share(1.3),
        "ms",
    ),
    row("motions along paths / toppra", "plan.path_s", &["plan.toppra_s"], Target::Share(1.02), "s"),
    row("planning them / toppra", "plan.path_ms", &["plan.toppra_ms"], Target::None, "ms"),
    row("motions from point to point / Ruckig", "plan.moves_s", &["plan.ruckig_s"], Target::Share(1.01), "s"),
    row(
        "report of an hour at 1 kHz, MCAP / unpacking the file",
        "recording.report_mcap_hour_s",
        &["recording.read_mcap_hour_s"],
        Target::AtMost(15.0),
        "s",
    ),
    row(
        "report of an hour at 1 kHz, CSV / reading the file",
        "recording.report_csv_hour_s",
        &["recording.read_csv_hour_s"],
        Target::AtMost(15.0),
        "s",
    ),
    row("memory of a report, MCAP", "recording.report_mcap_mb", &[], Target::AtMost(100.0), "MB"),
    row("memory of a report, CSV", "recording.report_csv_mb", &[], Target::AtMost(100.0), "MB"),
    row(
        "Stop to the line, idle, median / HTTP alone",
        "stop.idle_first_median_ms",
        &["bare.idle_http_median_ms"],
        Target::None,
        "ms",
    ),
    row(
        "Stop to the line, idle, 99 % / HTTP alone",
        "stop.idle_first_99_ms",
        &["bare.idle_http_99_ms"],
        Target::None,
        "ms",
    ),
    row(
        "Stop to the line, idle, worst / HTTP alone",
        "stop.idle_first_worst_ms",
        &["bare.idle_http_worst_ms"],
        Target::AtMost(5.0),
        "ms",
    ),
    row(
        "Stop to the line, 62 look, median / HTTP alone",
        "stop.viewers_first_median_ms",
        &["bare.viewers_http_median_ms"],
        Target::None,
        "ms",
    ),
    row(
        "Stop to the line, 62 look, 99 % / HTTP alone",
        "stop.viewers_first_99_ms",
        &["bare.viewers_http_99_ms"],
        Target::None,
        "ms",
    ),
    row(
        "Stop to the line, 62 look, worst / HTTP alone",
        "stop.viewers_first_worst_ms",
        &["bare.viewers_http_worst_ms"],
        Target::AtMost(5.0),
        "ms",
    ),
    row(
        "Stop on the line in an upload, 62 look, median / HTTP alone",
        "stop.upload_last_median_ms",
        &["bare.upload_http_median_ms"],
        Target::None,
        "ms",
    ),
    row(
        "Stop on the line in an upload, 62 look, 99 % / HTTP alone",
        "stop.upload_last_99_ms",
        &["bare.upload_http_99_ms"],
        Target::None,
        "ms",
    ),
    row(
        "Stop on the line in an upload, 62 look, worst / HTTP alone",
        "stop.upload_last_worst_ms",
        &["bare.upload_http_worst_ms"],
        Target::AtMost(40.0),
        "ms",
    ),
    row("queued in an upload, most", "stop.upload_queued_bytes", &[], Target::AtMost(256.0), "B"),
    row("silence behind an abandoned frame, least", "stop.upload_gap_ms", &[], Target::AtLeast(5.0), "ms"),
    row("statuses to each of 50 who look, fewest", "stop.viewers_hz", &[], Target::AtLeast(24.0), "1/s"),
    row(
        "tracking, worst joint / PID on straight lines",
        "tracking_worst_rms_mrad",
        &["tracking_plain_worst_rms_mrad"],
        Target::AtMost(2.0),
        "mrad RMS",
    ),
];

/// Returns the number of figures that have a target.
pub(super) fn targets() -> usize {
    ROWS.iter().filter(|row| !matches!(row.target, Target::None)).count()
}

/// Prints every row of the table, and the cause of each failed measurement. Returns the number of missed targets. If
/// the computer was not `quiet`, the function does not compare the measurements with their targets.
pub(super) fn print(figures: &Figures, failed: &Failed, quiet: bool) -> usize {
    println!("\n| figure | ours | anchor | ratio | target | met |\n|---|---|---|---|---|---|");
    let mut missed = 0;
    for row in ROWS {
        let (text, misses) = row.judge(figures, failed, quiet);
        println!("{text}");
        missed += usize::from(misses);
    }
    missed
}

impl Row {
    /// Returns the row of the table, and `true` if the target of the row was missed.
    fn judge(&self, figures: &Figures, failed: &Failed, quiet: bool) -> (String, bool) {
        let ours = figures.get(self.ours).copied();
        let anchor = self
            .anchors
            .iter()
            .filter_map(|name| Some((*name, *figures.get(*name)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let ratio = ours.zip(anchor).map(|(ours, (_, anchor))| ours / anchor);
        let (wanted, met) = match self.target {
            Target::Share(share) => (format!("≤ {share} × anchor"), ratio.map(|ratio| ratio <= share)),
            Target::AtMost(value) => (format!("≤ {}", short(value)), ours.map(|ours| ours <= value)),
            Target::AtLeast(value) => (format!("≥ {}", short(value)), ours.map(|ours| ours >= value)),
            Target::None => ("–".to_owned(), None),
        };
        let verdict = match (self.target, met) {
            _ if ours.is_none() && failed.why(self.ours).is_some() => {
                format!("FAILED: {}", failed.why(self.ours).unwrap_or_default())
            }
            (Target::None, _) => "–".to_owned(),
            (_, Some(_)) if !quiet => "not judged".to_owned(),
            (_, Some(true)) => "yes".to_owned(),
            (_, Some(false)) => "NO".to_owned(),
            (_, None) => "not measured".to_owned(),
        };
        let without: Vec<&str> =
            self.anchors.iter().copied().filter(|name| !figures.contains_key(*name)).collect();
        let without =
            if without.is_empty() { String::new() } else { format!(" without {}", without.join(", ")) };
        let text = format!(
            "| {} | {} {} | {}{without} | {} | {wanted} | {verdict} |",
            self.title,
            ours.map_or("?".into(), short),
            self.unit,
            anchor.map_or("–".into(), |(name, value)| format!("{} ({name})", short(value))),
            ratio.map_or("–".into(), |ratio| format!("{ratio:.2}")),
        );
        (text, !matches!(self.target, Target::None) && met != Some(true))
    }
}

/// Formats a number with about four significant digits.
fn short(value: f64) -> String {
    match value.abs() {
        v if v >= 1000.0 => format!("{value:.0}"),
        v if v >= 100.0 => format!("{value:.1}"),
        v if v >= 10.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If one measurement fails, the table still contains all rows. The rows of the failed measurement show its
    /// cause, and all other rows show their values.
    #[test]
    fn a_failed_measurement_is_printed_with_its_cause_and_all_other_rows_are_printed() {
        let names = ROWS.iter().flat_map(|row| row.anchors.iter().copied().chain([row.ours]));
        let mut figures: Figures = names.map(|name| (name.to_owned(), 1.0)).collect();
        figures.retain(|name, _| !name.starts_with("stop.upload_"));
        let mut failed = Failed::default();
        failed.note(&["stop.upload_", "bare.upload_"], "bytes of an upload: none within 60 s".into());
        let (mut gone, mut there) = (0, 0);
        for row in ROWS {
            let (text, misses) = row.judge(&figures, &failed, true);
            if row.ours.starts_with("stop.upload_") {
                assert!(text.ends_with("| FAILED: bytes of an upload: none within 60 s |"), "{text}");
                assert_eq!(misses, !matches!(row.target, Target::None), "{text}");
                gone += 1;
            } else {
                assert!(text.contains("| 1.000 ") && !text.contains("FAILED"), "{text}");
                there += 1;
            }
        }
        assert!(gone > 0 && there > 20, "{gone} {there}");
        // A figure that was not measured does not miss its target.
        let (text, _) = ROWS[0].judge(&Figures::new(), &Failed::default(), true);
        assert!(text.ends_with("| not measured |"), "{text}");
    }
}
