//! The HTML page: a frame of text, the vendored plot library, our style and script, and the data as JSON.

use serde_json::{Value, json};

use super::pack::{Thinner, coarse, fine, runs};
use super::{ReportInput, Summary, escape};
use crate::sample::JointSample;

const PAGE: &str = include_str!("assets/page.html");
const STYLE: &str = include_str!("assets/style.css");
const ARM: &str = include_str!("assets/arm.js");
const SCRIPT: &str = include_str!("assets/report.js");
const PLOT_STYLE: &str = include_str!("assets/uPlot.min.css");
const PLOT_SCRIPT: &str = include_str!("assets/uPlot.iife.min.js");

/// The whole page; write it to a file and open it, no network is needed.
pub fn html(input: &ReportInput<'_>) -> String {
    // `<` is escaped so that no text can end the script element.
    let data = data(input).to_string().replace('<', "\\u003c");
    let failure = input.failure.map_or(String::new(), |f| f.html());
    let title = escape(&match input.failure {
        Some(_) => format!("FAILED: {}", title(input)),
        None => title(input),
    });
    let mut page = String::with_capacity(data.len() + 200_000);
    let mut rest = PAGE;
    // Each mark is looked for after the last one only: inserted text is never searched.
    for (mark, text) in [
        ("{{title}}", title.as_str()),
        ("{{plot_style}}", PLOT_STYLE),
        ("{{style}}", STYLE),
        ("{{failure}}", &failure),
        ("{{data}}", &data),
        ("{{plot_script}}", PLOT_SCRIPT),
        ("{{arm}}", ARM),
        ("{{script}}", SCRIPT),
    ] {
        let (before, after) = rest.split_once(mark).unwrap_or((rest, ""));
        page.push_str(before);
        page.push_str(text);
        rest = after;
    }
    page.push_str(rest);
    page
}

fn title(input: &ReportInput<'_>) -> String {
    match (input.info.trajectory.as_str(), input.info.arm.as_str()) {
        ("", "") => "Run".to_owned(),
        ("", arm) => arm.to_owned(),
        (trajectory, "") => trajectory.to_owned(),
        (trajectory, arm) => format!("{trajectory} · {arm}"),
    }
}

fn data(input: &ReportInput<'_>) -> Value {
    let info = input.info;
    let thin = Thinner::new(input.samples);
    let per_joint = |pack: fn(&[f64]) -> Value, value: fn(&JointSample) -> f64| -> Value {
        (0..6).map(|j| pack(&thin.values(|s| value(&s.joints[j])))).collect()
    };
    // Non-finite numbers become `null`, which the page takes for "not known".
    let joints: Value = (0..6)
        .map(|j| {
            let joint = &info.joints[j];
            json!({
                "name": info.joint_name(j),
                "position_min_rad": joint.position_min_rad,
                "position_max_rad": joint.position_max_rad,
                "velocity_max_rad_s": joint.velocity_max_rad_s,
                "torque_max_nm": joint.torque_max_nm,
                "position_error_max_rad": joint.position_error_max_rad,
                "origin": joint.origin,
            })
        })
        .collect();
    let facts: Value = input.facts.iter().map(|f| json!({ "title": f.title, "rows": f.rows })).collect();
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "arm": info.arm,
        "source": info.source,
        "trajectory": info.trajectory,
        "start_unix_ms": info.start_unix_ns / 1_000_000,
        "joints": joints,
        "flange": info.flange,
        "samples": input.samples.len(),
        "thinned": thin.bucket(),
        "summary": Summary::of(info, input.samples),
        "facts": facts,
        "plan": input.plan,
        "failure_s": input.failure.map(|f| f.time_s - input.samples.first().map_or(0.0, |s| s.time_s)),
        "time_s": fine(&relative(&thin.times())),
        "time_start_s": input.samples.first().map_or(0.0, |s| s.time_s),
        "set_position_rad": per_joint(fine, |j| j.set_position),
        "position_rad": per_joint(fine, |j| j.position),
        "set_velocity_rad_s": per_joint(coarse, |j| j.set_velocity),
        "set_acceleration_rad_s2": input.plan.map(|_| per_joint(coarse, |j| j.set_acceleration)),
        "velocity_rad_s": per_joint(coarse, |j| j.velocity),
        "error_mrad": per_joint(coarse, |j| j.position_error() * 1e3),
        "torque_model_nm": per_joint(coarse, |j| j.torque_model),
        "torque_pid_nm": per_joint(coarse, |j| j.torque_p + j.torque_i + j.torque_d),
        "torque_friction_nm": per_joint(coarse, |j| j.torque_friction),
        "torque_nm": per_joint(coarse, |j| j.torque),
        "temperature_c": per_joint(coarse, |j| j.temperature),
        "states": runs(input.samples, |s| u64::from(s.state.byte())),
        "tes": runs(input.samples, |s| u64::from(s.trajectory.byte())),
        "errors": runs(input.samples, |s| u64::from(s.errors)),
    })
}

/// Times from the first sample on: f32 resolves them to microseconds in any run of a few minutes.
fn relative(times: &[f64]) -> Vec<f64> {
    let start = times.first().copied().unwrap_or(0.0);
    times.iter().map(|t| t - start).collect()
}
