//! HTML page that consists of a template, the vendored plot library, the style and script of this project, and the data as JSON.

use serde_json::{Value, json};

use super::curves::Curve;
use super::pack::{coarse, fine};
use super::{ReportInput, escape};

const PAGE: &str = include_str!("assets/page.html");
const STYLE: &str = include_str!("assets/style.css");
const ARM: &str = include_str!("assets/arm.js");
const SCRIPT: &str = include_str!("assets/report.js");
const PLOT_STYLE: &str = include_str!("assets/uPlot.min.css");
const PLOT_SCRIPT: &str = include_str!("assets/uPlot.iife.min.js");

/// Returns the complete HTML page. The page can be written to a file and opened without a network.
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
    // The search for a placeholder starts after the previous placeholder. Inserted text is therefore never searched.
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
    let (digest, curves) = (input.digest, &input.digest.curves);
    let per_joint = |pack: fn(&[f64]) -> Value, curve: Curve| -> Value {
        (0..6).map(|j| pack(&curves.values(curve, j))).collect()
    };
    let start_s = digest.span_s().map_or(0.0, |(first, _)| first);
    // JSON has no NaN. NaN becomes `null`, which the page shows as unknown.
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
        "commanded_by": info.commanded_by,
        "trajectory": info.trajectory,
        "start_unix_ms": info.start_unix_ns / 1_000_000,
        "joints": joints,
        "flange": info.flange,
        "samples": digest.samples(),
        "thinned": curves.bucket(),
        "summary": digest.summary(info),
        "facts": facts,
        "plan": input.plan,
        "failure_s": input.failure.map(|f| f.time_s - start_s),
        "time_s": fine(&relative(&curves.times())),
        "time_start_s": start_s,
        "set_position_rad": per_joint(fine, Curve::SetPosition),
        "position_rad": per_joint(fine, Curve::Position),
        "set_velocity_rad_s": per_joint(coarse, Curve::SetVelocity),
        "set_acceleration_rad_s2": input.plan.map(|_| per_joint(coarse, Curve::SetAcceleration)),
        "velocity_rad_s": per_joint(coarse, Curve::Velocity),
        "error_mrad": per_joint(coarse, Curve::Error),
        "torque_model_nm": per_joint(coarse, Curve::TorqueModel),
        "torque_pid_nm": per_joint(coarse, Curve::TorquePid),
        "torque_friction_nm": per_joint(coarse, Curve::TorqueFriction),
        "torque_nm": per_joint(coarse, Curve::Torque),
        "temperature_c": per_joint(coarse, Curve::Temperature),
        "states": digest.states.as_slice(),
        "tes": digest.trajectory.as_slice(),
        "errors": digest.errors.as_slice(),
    })
}

/// Returns times relative to the first sample. An f32 has a resolution of microseconds only for times up to a few minutes.
fn relative(times: &[f64]) -> Vec<f64> {
    let start = times.first().copied().unwrap_or(0.0);
    times.iter().map(|t| t - start).collect()
}
