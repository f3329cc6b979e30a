//! `jtc plan`: plans the fastest trajectory through waypoints that the limits allow.

use std::path::Path;

use cli_kit::{Failure, Output, OutputFile, figure, table};
use jtc_core::Config;
use jtc_host::arm::Arm;
use jtc_host::check::TorqueMargin;
use jtc_host::plan::{Aside, Bound, PlanError, Planned, Planner, WayOptions, WaypointPath};
use jtc_host::report::{Digest, Facts, ReportInput, html};
use jtc_host::waypoints::{WaypointError, WaypointFile};
use jtc_wire::Joint;
use serde_json::json;

use super::job::{stem, typed};
use super::{named_arm, run_report};
use crate::args::PlanArgs;

/// Message if the user specifies `--blend-m`, but the motion has no lines or arcs whose corners the planner could
/// round.
const NO_LINES: &str = "--blend-m has no effect: it rounds corners between lines and arcs, and this motion \
    has no lines or arcs; use --line, or a column `leg`";

/// Plans, checks and writes a trajectory.
pub(super) fn plan(args: &PlanArgs, out: &Output) -> Result<(), Failure> {
    if !(-40.0..=120.0).contains(&args.temperature) {
        return Err(Failure::usage(format!(
            "--temperature is out of range: {} °C, expected -40 to 120 °C",
            args.temperature
        )));
    }
    readable(&args.out)?;
    let arm = named_arm::load(args.arm.as_deref())?;
    named_arm::note_warnings(&arm, out);
    let file = WaypointFile::load(&args.file)?;
    let file = if args.deg { file.in_degrees()? } else { file };
    // The motion is planned before any file is opened. If a line is impossible, no file is created.
    let blend = if args.deg { args.blend.to_radians() } else { args.blend };
    let options = WayOptions { line: args.line, blend, blend_m: args.blend_m };
    let way = WaypointPath::of(&file, &arm, options).map_err(|e| unplanned(&e, &file))?;
    let mut inputs: Vec<&Path> = vec![&args.file];
    inputs.extend(args.arm.as_deref());
    let trajectory = OutputFile::open(&args.out, args.overwrite.overwrite, &inputs)?;
    inputs.push(&args.out);
    let page = args
        .report
        .as_deref()
        .map(|page| OutputFile::open(page, args.overwrite.overwrite, &inputs))
        .transpose()?;
    let config = Config { payload: args.payload.unwrap_or_default(), ..arm.config() };
    let friction = arm.friction();
    let planner = Planner {
        model: Some(&arm.model),
        friction: friction.as_ref(),
        temperature: args.temperature,
        speed_pct: args.speed,
        blend,
        jerk: !args.no_jerk_limit,
        margin_pct: args.margin.percent,
        ..Planner::new(&config)
    };
    let mut planned = way.planned(&planner).map_err(|e| located(&e, &file))?;
    planned.notes.extend(way.off_the_line(&planned, &arm).map(off_the_line));
    if args.blend_m > 0.0 && !way.has_lines() {
        planned.notes.push(NO_LINES.to_owned());
    }
    for note in &planned.notes {
        out.note(format!("note: {note}"));
    }
    for warning in planned.verdict.warnings() {
        out.note(format!("warning: {warning}"));
    }
    note_low_margin(planned.verdict.margin, out);
    trajectory.write(planned.trajectory.to_exact_csv())?;
    if let Some(page) = page {
        page.write(report(&planned, &arm, &planner, args))?;
    }
    print(&planned, file.waypoints.len(), args, out);
    Ok(())
}

/// Describes the distance of the flange from the straight line between two poses.
fn off_the_line(aside: Aside) -> String {
    let (to, mm) = (aside.waypoint, 1e3 * aside.distance_m);
    format!(
        "between waypoints {} and {to} the flange leaves the straight line by up to {mm:.1} mm: legs are \
         straight in joint space; use `--line`, or `line` in a column `leg`, to keep the flange on the line",
        to - 1
    )
}

/// Checks that the output file has the file name extension of CSV. With the extension of another format, most commands could not read the
/// file.
fn readable(out: &Path) -> Result<(), Failure> {
    let ending = out.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    if ["mcap", "yaml", "yml", "json", "toml", "urdf", "xml", "html"].contains(&ending.as_str()) {
        let message = format!(
            "{}: a plan is written as CSV, but .{ending} is the ending of another format",
            out.display()
        );
        let name = typed(&out.with_extension("csv"));
        return Err(Failure::usage(message).next(format!("use a file with the ending .csv: `-o {name}`")));
    }
    if out.as_os_str() == "-" {
        let message = "the output - is not a file: the command writes the trajectory to a file, and its \
            figures to standard output";
        return Err(Failure::usage(message).next("use a file with the ending .csv: `-o motion.csv`"));
    }
    Ok(())
}

/// Adds the line numbers of the waypoints in the file to an error.
fn located(error: &PlanError, file: &WaypointFile) -> Failure {
    Failure { message: file.located(error), ..Failure::of(error) }
}

/// Like [`located`], for all errors of a waypoint file. Adds line numbers only to errors of the path.
fn unplanned(error: &WaypointError, file: &WaypointFile) -> Failure {
    match error {
        WaypointError::Route(e) => located(e, file),
        other => Failure::of(other),
    }
}

fn print(planned: &Planned, waypoints: usize, args: &PlanArgs, out: &Output) {
    let Planned { trajectory, verdict, binding, waypoint_times, notes } = planned;
    let value = json!({
        "file": args.out,
        "duration_s": trajectory.duration_s(),
        "points": trajectory.points.len(),
        "step_ms": trajectory.step_ms,
        "waypoints": waypoints,
        "waypoint_times_s": waypoint_times,
        "binding": binding,
        "joints": verdict.joints,
        "margin": verdict.margin,
        "notes": notes,
        "report": args.report,
    });
    out.result(&value, || {
        let head = ["", "binds", ">peak rad/s", ">peak rad/s²", ">peak N·m"];
        let row = |joint: &Joint| {
            let f = &verdict.joints[joint.index()];
            vec![
                joint.to_string(),
                binds(binding, *joint),
                figure(f.velocity_peak_rad_s, 3),
                figure(f.acceleration_peak_rad_s2, 3),
                f.torque_peak_nm.map_or("-".into(), |t| figure(t, 1)),
            ]
        };
        let rows: Vec<Vec<String>> = Joint::ALL.iter().map(row).collect();
        let page = args
            .report
            .as_deref()
            .map_or(String::new(), |page| format!("\n{}   open it in a browser", page.display()));
        let arm = named_arm::typed_option(args.arm.as_deref());
        format!(
            "{}: {waypoints} waypoints, {:.3} s, {} points every {} ms\n{}{}next: jtc traj run {}{arm} --approach{page}",
            args.out.display(),
            trajectory.duration_s(),
            trajectory.points.len(),
            trajectory.step_ms,
            table(&head, &rows),
            margin_line(verdict.margin),
            typed(&args.out),
        )
    });
}

/// Returns the limits of a joint that constrain the motion, each with the time for which it is the limiting
/// constraint. Returns a dash if no limit constrains the motion.
fn binds(binding: &[Bound], joint: Joint) -> String {
    let mut limits: Vec<(&str, f64)> = Vec::new();
    for bound in binding.iter().filter(|bound| bound.joint == joint) {
        let seconds = bound.to_s - bound.from_s;
        match limits.iter_mut().find(|(limit, _)| *limit == bound.limit) {
            Some((_, all)) => *all += seconds,
            None => limits.push((bound.limit, seconds)),
        }
    }
    limits.sort_by(|a, b| b.1.total_cmp(&a.1));
    let words: Vec<String> = limits.iter().map(|(limit, s)| format!("{limit} {s:.2} s")).collect();
    if words.is_empty() { "-".into() } else { words.join(", ") }
}

/// Returns the smallest torque margin of a motion as a line of text. Returns an empty text if no margin was computed.
pub(super) fn margin_line(margin: Option<TorqueMargin>) -> String {
    margin.map_or(String::new(), |margin| format!("{margin}\n"))
}

/// Prints a warning if the torque margin is low.
pub(super) fn note_low_margin(margin: Option<TorqueMargin>, out: &Output) {
    if let Some(warning) = margin.and_then(|margin| margin.warning()) {
        out.note(format!("warning: {warning}"));
    }
}

/// Describes the torque margin that the user requested, and the torque margin of the planned motion.
fn margin_words(planned: &Planned, percent: f64) -> String {
    let asked = format!("{percent} % of each limit");
    match planned.verdict.margin {
        Some(left) => {
            format!(
                "requested {asked}; remaining: {:.1} % ({} at {:.3} s)",
                left.percent, left.joint, left.time_s
            )
        }
        None => asked,
    }
}

/// Returns the report page of a planned motion, with the commanded values and the limiting constraints.
fn report(planned: &Planned, arm: &Arm, planner: &Planner, args: &PlanArgs) -> String {
    let info = run_report::info(arm, "planned, not run", &stem(&args.out), 0);
    let trajectory = &planned.trajectory;
    let of_plan = [
        ("Duration", format!("{:.3} s", trajectory.duration_s())),
        ("Points", format!("{} every {} ms", trajectory.points.len(), trajectory.step_ms)),
        ("Blend", format!("{} {}, lines {} m", args.blend, if args.deg { "°" } else { "rad" }, args.blend_m)),
        ("Speed", format!("{} % of the limits", args.speed)),
        ("Payload", super::payload::words(&planner.config.payload)),
        ("Torque", format!("by the arm model, with friction at {} °C", args.temperature)),
        ("Torque margin", margin_words(planned, args.margin.percent)),
    ];
    let notes = planned.notes.iter().map(|note| ("Note", note.clone()));
    let rows = of_plan.into_iter().chain(notes).map(|(name, value)| (name.to_owned(), value));
    let of_joint = |joint: Joint| (joint.to_string(), binds(&planned.binding, joint));
    let facts = [
        Facts { title: "Plan".into(), rows: rows.collect() },
        Facts { title: "Limiting constraints and their time".into(), rows: Joint::ALL.map(of_joint).into() },
    ];
    let digest = Digest::of(&planner.samples(trajectory));
    let plan = Some(&planned.binding[..]);
    html(&ReportInput { facts: &facts, plan, ..ReportInput::new(&info, &digest) })
}
