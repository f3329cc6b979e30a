//! `cargo xtask bench`: figures beside their anchors, all measured in the same run on the same machine.
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use serde_json::{Value, json};

use crate::shell::{self, cargo, command, root, run};
use crate::{python, size};

/// Pinocchio's inverse dynamics where the absolute targets were set, built alike, ns.
const PINOCCHIO_WHERE_TARGETS_WERE_SET: f64 = 640.0;

/// Figures by name.
type Figures = BTreeMap<String, f64>;

/// Whether a figure should stay below its target or reach it.
#[derive(Clone, Copy)]
enum Target {
    /// Ours ≤ factor × anchor.
    Share(f64),
    /// Ours ≤ value.
    AtMost(f64),
    /// Ours ≥ value.
    AtLeast(f64),
    /// Only to look at.
    None,
}

/// One line of the table.
struct Row {
    title: &'static str,
    ours: &'static str,
    /// The smallest of these counts.
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
    row("inverse dynamics / generated code", "ours.inverse", &["casadi.inverse"], Target::Share(0.65), "ns"),
    row("inverse dynamics / best of MuJoCo, KDL, RBDL", "ours.inverse", OTHERS_INVERSE, Target::None, "ns"),
    row("forward dynamics / Pinocchio", "ours.forward", &["pinocchio.forward"], Target::Share(0.2), "ns"),
    row("forward dynamics / generated code", "ours.forward", &["casadi.forward"], Target::Share(1.0), "ns"),
    row("mass matrix / Pinocchio", "ours.mass_matrix", &["pinocchio.mass_matrix"], Target::None, "ns"),
    row(
        "sine and cosine of 6 angles / libm",
        "ours.sin_cos_6",
        &["libm_sin_cos_6"],
        Target::AtMost(10.0),
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
        "tracking, worst joint / PID on straight lines",
        "tracking_worst_rms_mrad",
        &["tracking_plain_worst_rms_mrad"],
        Target::AtMost(2.0),
        "mrad RMS",
    ),
];

/// `arguments`: `--json FILE`, `--quick`.
pub fn main(arguments: &[String]) -> Result<ExitCode> {
    let mut arguments = arguments.to_vec();
    let json_file = shell::option(&mut arguments, "--json")?;
    let quick = shell::flag(&mut arguments, "--quick");
    shell::nothing_left(&arguments)?;

    let work = shell::target().join("bench");
    std::fs::create_dir_all(&work)?;
    let frames = work.join("ucom-frames.log");
    let kernels = dynamics_program(&work)?;
    let rounds = if quick { 1 } else { 3 };
    let mut samples: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut skipped = Vec::new();
    for round in 1..=rounds {
        println!("\nround {round} of {rounds}");
        for (name, value) in own_figures(&frames)? {
            samples.entry(name).or_default().push(value);
        }
    }
    samples.entry("cantools_frames_s".into()).or_default().push(cantools(&frames)?);
    println!("\nanchors, in turn with our own dynamics");
    for (name, value) in anchors(&work, &kernels, rounds, &mut skipped)? {
        samples.entry(name).or_default().push(value);
    }
    let figures: Figures = samples.into_iter().map(|(name, values)| (name, median(values))).collect();
    let missed = print_table(&figures);
    if let Some(ns) = figures.get("pinocchio.inverse") {
        let factor = ns / PINOCCHIO_WHERE_TARGETS_WERE_SET;
        println!(
            "\nthis machine, now: {factor:.2} times the time of the one on which the targets in ns and GB/s were set"
        );
    }
    print_tracking(&figures);
    for why in &skipped {
        println!("not measured: {why}");
    }
    if let Some(file) = json_file {
        let text = serde_json::to_string_pretty(&json!({ "figures": figures, "not_measured": skipped }))?;
        std::fs::write(&file, text + "\n").with_context(|| file.clone())?;
        println!("wrote {file}");
    }
    println!(
        "{missed} of {} targets missed",
        ROWS.iter().filter(|row| !matches!(row.target, Target::None)).count()
    );
    Ok(if missed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The timing program of jtc-dynamics, copied away: other crates have an example of that name too.
fn dynamics_program(work: &Path) -> Result<PathBuf> {
    run(&mut cargo(&["build", "--profile", "dist", "--package", "jtc-dynamics", "--example", "time"]))?;
    let program = work.join("dynamics_time");
    std::fs::copy(shell::target().join("dist/examples/time"), &program)?;
    Ok(program)
}

/// What the crates measure of themselves. The UCoM frames that were read go to `frames`, too.
fn own_figures(frames: &Path) -> Result<Figures> {
    let example = |package: &str, name: &str| {
        let mut example =
            cargo(&["run", "--profile", "dist", "--quiet", "--package", package, "--example", name]);
        shell::read(example.env("OPENJTC_UCOM_FRAMES", frames))
    };
    let mut figures = lines(&example("xtask", "figures")?);
    figures.append(&mut lines(&example("jtc-core", "tick")?));
    if let Some(bytes) = figures.get("controller_bytes").copied() {
        figures.insert("controller_kib".into(), bytes / 1024.0);
    }
    figures.append(&mut object(&example("jtc-wire", "throughput")?)?);
    let speed = object(&example("jtc-sim", "speed")?)?;
    let ns = *speed.get("median_ns").context("the example `speed` of jtc-sim printed no median_ns")?;
    figures.insert("sim_ms_ns".into(), ns);
    figures.insert("sim_times_real_time".into(), 1e6 / ns);
    Ok(figures)
}

/// Those frames of `frames` that python-can and cantools read in a second.
fn cantools(frames: &Path) -> Result<f64> {
    let mut script = command(python::environment("requirements.txt")?);
    script.arg(root().join("references/ucom/read_frames.py")).arg(frames.with_extension("dbc")).arg(frames);
    script.env("PYTHONDONTWRITEBYTECODE", "1");
    shell::read(&mut script)?.trim().parse().context("read_frames.py printed no number")
}

/// The numbers of a JSON object.
fn object(text: &str) -> Result<Figures> {
    let value: Value =
        serde_json::from_str(text.trim()).with_context(|| format!("no JSON object: {text}"))?;
    Ok(numbers(&value))
}

/// The numbers in `value`, an object.
fn numbers(value: &Value) -> Figures {
    let pairs = value.as_object().into_iter().flatten();
    pairs.filter_map(|(name, value)| Some((name.clone(), value.as_f64()?))).collect()
}

/// Lines of a name and a number.
fn lines(text: &str) -> Figures {
    text.lines()
        .filter_map(|line| {
            let (name, value) = line.split_once(' ')?;
            Some((name.to_owned(), value.trim().parse().ok()?))
        })
        .collect()
}

/// Our dynamics and those of others in turn, on the same arm and states.
fn anchors(work: &Path, kernels: &Path, rounds: usize, skipped: &mut Vec<String>) -> Result<Figures> {
    for (header, package) in [
        ("/usr/include/eigen3/Eigen/Core", "libeigen3-dev"),
        ("/usr/include/kdl/chain.hpp", "liborocos-kdl-dev"),
        ("/usr/include/rbdl/rbdl.h", "librbdl-dev"),
    ] {
        if !Path::new(header).exists()
            && let Err(error) = shell::apt_install(&[package])
        {
            println!("without {package}: {error:#}");
        }
    }
    let mut script = command(python::environment("requirements-bench.txt")?);
    script
        .arg(root().join("references/dynamics/anchors.py"))
        .args(["--rounds", &(2 * rounds + 1).to_string(), "--ours"])
        .arg(kernels);
    script.arg("--keep").arg(work.join("anchors")).env("PYTHONDONTWRITEBYTECODE", "1");
    let report: Value =
        serde_json::from_str(&shell::read(&mut script)?).context("anchors.py printed no JSON")?;
    for (name, why) in report["skipped"].as_object().into_iter().flatten() {
        let line = format!("{name}: {}", why.as_str().unwrap_or_default().lines().last().unwrap_or_default());
        if !skipped.contains(&line) {
            skipped.push(line);
        }
    }
    let figures = numbers(&report["figures"]);
    ensure!(figures.contains_key("ours.inverse"), "anchors.py did not measure our own program");
    Ok(figures)
}

/// Prints every row; returns how many targets were missed.
fn print_table(figures: &Figures) -> usize {
    let mut missed = 0;
    let header = ["figure", "ours", "anchor", "ratio", "target", "met"];
    println!(
        "\n| {} | {} | {} | {} | {} | {} |",
        header[0], header[1], header[2], header[3], header[4], header[5]
    );
    println!("|---|---|---|---|---|---|");
    for row in ROWS {
        let ours = figures.get(row.ours).copied();
        let anchor = row
            .anchors
            .iter()
            .filter_map(|name| Some((*name, *figures.get(*name)?)))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let ratio = ours.zip(anchor).map(|(ours, (_, anchor))| ours / anchor);
        let (wanted, met) = match row.target {
            Target::Share(share) => (format!("≤ {share} × anchor"), ratio.map(|ratio| ratio <= share)),
            Target::AtMost(value) => (format!("≤ {}", short(value)), ours.map(|ours| ours <= value)),
            Target::AtLeast(value) => (format!("≥ {}", short(value)), ours.map(|ours| ours >= value)),
            Target::None => ("–".to_owned(), None),
        };
        let verdict = match (row.target, met) {
            (Target::None, _) => "–",
            (_, Some(true)) => "yes",
            (_, Some(false)) => "NO",
            (_, None) => "not measured",
        };
        missed += usize::from(!matches!(row.target, Target::None) && met != Some(true));
        println!(
            "| {} | {} {} | {} | {} | {wanted} | {verdict} |",
            row.title,
            ours.map_or("?".into(), short),
            row.unit,
            anchor.map_or("–".into(), |(name, value)| format!("{} ({name})", short(value))),
            ratio.map_or("–".into(), |ratio| format!("{ratio:.2}")),
        );
    }
    missed
}

/// Each joint, with our control law and with the plain one.
fn print_tracking(figures: &Figures) {
    let figure = |name: String| figures.get(&name).map_or("?".into(), |value| format!("{value:.2}"));
    println!("\ntracking, mrad (RMS, largest) | ours | straight lines, PID and gravity only");
    for joint in 1..=6 {
        println!(
            "  joint {joint} | {}, {} | {}, {}",
            figure(format!("tracking_joint_{joint}_rms_mrad")),
            figure(format!("tracking_joint_{joint}_max_mrad")),
            figure(format!("tracking_plain_joint_{joint}_rms_mrad")),
            figure(format!("tracking_plain_joint_{joint}_max_mrad")),
        );
    }
    let name = if figures.get("tracking_recorded_motion") == Some(&1.0) { "recorded" } else { "smooth" };
    println!("  (the {name} motion; masses and friction of the arm differ from the controller's model)");
    for run in ["tracking", "tracking_plain"] {
        if figures.get(&format!("{run}_finished")) != Some(&1.0) {
            println!("  ({run} did not get to its end: it was stopped by an error)");
        }
    }
}

/// A number with about four significant digits.
fn short(value: f64) -> String {
    match value.abs() {
        v if v >= 1000.0 => format!("{value:.0}"),
        v if v >= 100.0 => format!("{value:.1}"),
        v if v >= 10.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}
