//! `cargo xtask bench`: measures performance figures of this project and reference values of other software (anchors)
//! in one run on one computer.
mod load;
mod table;
mod tracking;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, ensure};
use serde_json::{Value, json};

use load::{Load, OTHERS_MAX};

use crate::python;
use crate::shell::{self, cargo, command, root, run};

/// Execution time of Pinocchio's inverse dynamics, ns, on the computer for which the absolute targets were set. The
/// measurement used the same kind of build.
const PINOCCHIO_WHERE_TARGETS_WERE_SET: f64 = 640.0;

/// Performance figures by name.
type Figures = BTreeMap<String, f64>;

/// Runs `cargo xtask bench`. `arguments` is `tracking`, or any of `--json FILE` and `--quick`.
pub(crate) fn main(arguments: &[String]) -> Result<ExitCode> {
    if let Some(("tracking", rest)) = arguments.split_first().map(|(first, rest)| (first.as_str(), rest)) {
        return tracking::main(rest);
    }
    let mut arguments = arguments.to_vec();
    let json_file = shell::option(&mut arguments, "--json")?;
    let quick = shell::flag(&mut arguments, "--quick");
    shell::nothing_left(&arguments)?;

    let work = shell::target().join("bench");
    std::fs::create_dir_all(&work)?;
    let frames = work.join("ucom-frames.log");
    let kernels = dynamics_program(&work)?;
    let rounds = if quick { 1 } else { 5 };
    // The command builds all programs first, so that builds do not disturb the measurements.
    let mut skipped = Vec::new();
    anchors(&work, &kernels, 0, &mut skipped)?;
    for Example { package, name, .. } in EXAMPLES {
        run(&mut cargo(&["build", "--profile", "dist", "--package", package, "--example", name]))?;
    }
    run(&mut cargo(&["build", "--profile", "dist", "--package", "jtc-plan", "--example", "plans"]))?;
    run(&mut cargo(&["build", "--profile", "dist", "--package", "jtc-client", "--example", "stops"]))?;
    python::environment("requirements.txt")?;
    let mut figures = Figures::new();
    let load = Load::now();
    let mut failed = Failed::default();
    for round in 1..=rounds {
        println!("\nround {round} of {rounds}");
        let mut samples = failed.attempt(ANCHORS, || anchors(&work, &kernels, 2, &mut skipped));
        for example in EXAMPLES {
            samples.append(&mut failed.attempt(example.figures, || example.measure(&frames)));
        }
        samples.append(&mut failed.attempt(&["cantools_"], || cantools(&frames)));
        samples.append(&mut failed.attempt(&["plan."], planned));
        keep_best(&mut figures, samples);
    }
    // The time until a Stop is a worst case, so the command measures it only once. The best of several worst cases
    // would not be a worst case.
    figures.append(&mut stops(quick, &mut failed));
    let others = load.others();
    if let Some(ns) = figures.get("sim_ms_ns").copied() {
        figures.insert("sim_times_real_time".into(), 1e6 / ns);
    }
    let quiet = others.is_none_or(|share| share <= OTHERS_MAX);
    let missed = table::print(&figures, &failed, quiet);
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
    for why in failed.causes() {
        println!("failed: {why}");
    }
    if let Some(file) = json_file {
        let text = serde_json::to_string_pretty(
            &json!({ "figures": figures, "not_measured": skipped, "failed": failed.causes() }),
        )?;
        std::fs::write(&file, text + "\n").with_context(|| file.clone())?;
        println!("wrote {file}");
    }
    if let Some(share) = others.filter(|_| !quiet) {
        println!(
            "no verdict: meanwhile other programs took {:.0} % of a processor, {:.0} % are allowed; run it again on a quiet machine",
            100.0 * share,
            100.0 * OTHERS_MAX
        );
        return Ok(ExitCode::FAILURE);
    }
    println!("{missed} of {} targets missed", table::targets());
    Ok(if missed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Keeps the better of two measurements of each figure, which is the smaller time or size or the greater throughput. The better value
/// is valid, because other programs on the computer can only make a measurement worse.
fn keep_best(figures: &mut Figures, samples: Figures) {
    for (name, value) in samples {
        let throughput = ["_gb_s", "_frames_s"].iter().any(|end| name.ends_with(end));
        let best = figures.entry(name).or_insert(value);
        *best = if throughput { best.max(value) } else { best.min(value) };
    }
}

/// Builds the timing program of jtc-dynamics, copies the program to `work` and returns the path of the copy.
fn dynamics_program(work: &Path) -> Result<PathBuf> {
    run(&mut cargo(&["build", "--profile", "dist", "--package", "jtc-dynamics", "--example", "time"]))?;
    let program = work.join("dynamics_time");
    std::fs::copy(shell::target().join("dist/examples/time"), &program)?;
    Ok(program)
}

/// Failed measurements. Each entry contains the name prefixes of the figures that are missing, and the cause of the
/// failure.
#[derive(Default)]
pub(crate) struct Failed(Vec<(&'static [&'static str], String)>);

impl Failed {
    /// Runs a measurement. If the measurement fails, stores the cause and returns an empty list of figures.
    fn attempt(
        &mut self,
        figures: &'static [&'static str],
        measure: impl FnOnce() -> Result<Figures>,
    ) -> Figures {
        measure().unwrap_or_else(|error| {
            self.note(figures, format!("{error:#}"));
            Figures::new()
        })
    }

    fn note(&mut self, figures: &'static [&'static str], why: String) {
        println!("failed: {why}");
        self.0.push((figures, why));
    }

    /// Returns the reason why this figure could not be measured, in one line.
    pub(crate) fn why(&self, figure: &str) -> Option<&str> {
        let (_, why) = self.0.iter().find(|(names, _)| names.iter().any(|name| figure.starts_with(name)))?;
        why.lines().map(str::trim).rfind(|line| !line.is_empty())
    }

    /// Returns the causes of all failed measurements, one line for each.
    fn causes(&self) -> Vec<String> {
        self.0.iter().map(|(figures, why)| format!("{}: {why}", figures.join(", "))).collect()
    }
}

/// Name prefixes of the figures that the command measures together with the anchors (reference values of other
/// software).
const ANCHORS: &[&str] = &["ours.", "pinocchio", "casadi", "mujoco", "kdl", "rbdl", "libm_sin_cos_6"];

/// Program that measures the performance of a crate.
struct Example {
    package: &'static str,
    name: &'static str,
    /// Name prefixes of the figures that the program prints.
    figures: &'static [&'static str],
}

const EXAMPLES: [Example; 4] = [
    Example {
        package: "xtask",
        name: "figures",
        figures: &["upload_", "ucom_", "recording.", "tracking", "controller_"],
    },
    Example { package: "jtc-core", name: "tick", figures: &["control_tick_", "tick_"] },
    Example { package: "jtc-wire", name: "throughput", figures: &["crc16_", "crate_", "stream_parser_"] },
    Example { package: "jtc-sim", name: "speed", figures: &["sim_"] },
];

impl Example {
    /// Runs the program and returns the figures that it prints. The program writes the UCoM frames that it has decoded
    /// to `frames`.
    fn measure(&self, frames: &Path) -> Result<Figures> {
        let Self { package, name, .. } = *self;
        let mut example =
            cargo(&["run", "--profile", "dist", "--quiet", "--package", package, "--example", name]);
        let text = shell::read(example.env("OPENJTC_UCOM_FRAMES", frames))?;
        // Some programs print a JSON object, and other programs print lines with a name and a number.
        let mut figures = if text.trim_start().starts_with('{') { object(&text)? } else { lines(&text) };
        if let Some(bytes) = figures.get("controller_bytes").copied() {
            figures.insert("controller_kib".into(), bytes / 1024.0);
        }
        if let Some(ns) = figures.remove("ns") {
            figures.insert("sim_ms_ns".into(), ns);
        }
        ensure!(!figures.is_empty(), "the example {name} of {package} printed no figure");
        Ok(figures)
    }
}

/// Measures the number of frames from the file `frames` that the Python libraries python-can and cantools decode per
/// second.
fn cantools(frames: &Path) -> Result<Figures> {
    let mut script = command(python::environment("requirements.txt")?);
    script.arg(root().join("references/ucom/read_frames.py")).arg(frames.with_extension("dbc")).arg(frames);
    script.env("PYTHONDONTWRITEBYTECODE", "1");
    let rate = shell::read(&mut script)?.trim().parse().context("read_frames.py printed no number")?;
    Ok(Figures::from([("cantools_frames_s".to_owned(), rate)]))
}

/// Measures planned motions of our planner, and of the planners toppra and Ruckig.
fn planned() -> Result<Figures> {
    let mut script = command(python::environment("requirements.txt")?);
    script.arg(root().join("references/plan/bench_plan.py")).arg(shell::target().join("dist/examples/plans"));
    script.env("PYTHONDONTWRITEBYTECODE", "1");
    object(&shell::read(&mut script)?)
}

/// Measures the time until an agent has sent a Stop on its serial line: while the agent is idle, with viewers, and
/// during an upload.
fn stops(quick: bool, failed: &mut Failed) -> Figures {
    const LOADS: [(&str, &[&str]); 3] = [
        ("idle", &["stop.idle_", "bare.idle_"]),
        ("viewers", &["stop.viewers_", "bare.viewers_"]),
        ("upload", &["stop.upload_", "bare.upload_"]),
    ];
    println!("\nStops of an agent");
    let count = if quick { "40" } else { "200" };
    let mut causes = Value::Null;
    let figures = failed.attempt(&["stop.", "bare."], || {
        let text = shell::read(command(shell::target().join("dist/examples/stops")).arg(count))?;
        causes = serde_json::from_str::<Value>(text.trim())?["failed"].take();
        object(&text)
    });
    for (load, names) in LOADS {
        if let Some(why) = causes[load].as_str() {
            failed.note(names, why.to_owned());
        }
    }
    figures
}

/// Returns the numbers in a JSON object, which is given as text.
fn object(text: &str) -> Result<Figures> {
    let value: Value =
        serde_json::from_str(text.trim()).with_context(|| format!("no JSON object: {text}"))?;
    Ok(numbers(&value))
}

/// Returns the numbers in the JSON object `value`.
fn numbers(value: &Value) -> Figures {
    let pairs = value.as_object().into_iter().flatten();
    pairs.filter_map(|(name, value)| Some((name.clone(), value.as_f64()?))).collect()
}

/// Returns the figures in lines that consist of a name and a number.
fn lines(text: &str) -> Figures {
    text.lines()
        .filter_map(|line| {
            let (name, value) = line.split_once(' ')?;
            Some((name.to_owned(), value.trim().parse().ok()?))
        })
        .collect()
}

/// Measures the dynamics of this project and of other libraries alternately, with the same arm and states. If `rounds` is
/// 0, the function only builds the programs.
fn anchors(work: &Path, kernels: &Path, rounds: u32, skipped: &mut Vec<String>) -> Result<Figures> {
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
        .args(["--rounds", &rounds.to_string(), "--ours"])
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
    ensure!(
        rounds == 0 || figures.contains_key("ours.inverse"),
        "anchors.py did not measure our own program"
    );
    Ok(figures)
}

/// Prints the position errors of each joint for our control law with and without feed-forward.
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
