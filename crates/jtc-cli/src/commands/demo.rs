//! `jtc demo`: a complete demonstration from parameters to report, on a simulator in this process.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::{Duration, Instant};

use cli_kit::{ErrorKind, Failure, Output, OutputFile};
use jtc_host::arm::Arm;
use jtc_host::port::Port;
use jtc_host::port::sim::SimPort;
use jtc_host::recording::{Ending, RecordingInfo, SampleSink};
use jtc_host::report::{self, Digest, Facts, ReportInput};
use jtc_host::session::{Flow, LinkStatistics, Outcome, UploadReport};
use jtc_host::{CheckOptions, CheckedTrajectory, Sample, Session};
use jtc_sim::{SimConfig, World};
use serde_json::json;

use super::run_report;
use crate::args::{DemoArgs, SimSpeed};
use crate::failure::output_lost;
use crate::progress::Progress;
use crate::tape::Tape;

/// Random seed of the demo. The seed is constant, so that every demo produces the same numbers.
const SEED: u64 = 1;
/// Time that is recorded before and after the motion.
const MARGIN: Duration = Duration::from_millis(400);
/// Longest wait until the drives are enabled. The first enable takes 4 s.
const BRING_UP: Duration = Duration::from_secs(30);

/// Output files of the demo, in the order in which the command lists them.
const NAMES: [&str; 4] = ["report.html", "recording.mcap", "recording.csv", "picture.svg"];

/// Results of the run in the demo.
struct Run {
    info: RecordingInfo,
    samples: Vec<Sample>,
    upload: UploadReport,
    link: LinkStatistics,
    baud: Option<u32>,
    masses: String,
    frictions: String,
}

/// Runs the demo and writes its output files.
pub(super) fn demo(args: &DemoArgs, out: &Output) -> Result<(), Failure> {
    let progress = Progress::begin(out)?;
    std::fs::create_dir_all(&args.out).map_err(|e| Failure::usage(format!("{}: {e}", args.out.display())))?;
    let file = |name: &str| args.out.join(name);
    let open = |name: &str| OutputFile::open(&file(name), args.overwrite.overwrite, &[]);
    let (page, mut mcap, mut csv, picture) =
        (open(NAMES[0])?, open(NAMES[1])?, open(NAMES[2])?, open(NAMES[3])?);
    let begin = Instant::now();
    let info = run_report::info(&Arm::avena(), "simulator", "Six joints, ten seconds", 0);
    let mut tapes = Vec::new();
    for file in [&mut mcap, &mut csv] {
        tapes.push(Tape::begin(file, &info, "the demo continues", out)?);
    }
    let run = execute(args.speed, info, tapes.iter().map(Tape::sink).collect(), &progress, out)?;
    let facts = [
        Facts::of_link(&run.upload, &run.link, run.baud),
        Facts {
            title: "Simulated arm".into(),
            rows: vec![
                ("Masses, relative to the controller's model".into(), run.masses.clone()),
                ("Friction, relative to the controller's model".into(), run.frictions.clone()),
                ("Seed".into(), SEED.to_string()),
            ],
        },
    ];
    let digest = Digest::of(&run.samples);
    let summary = digest.summary(&run.info);
    let ending = Ending { outcome: "finished".into(), ..Ending::default() };
    tapes.into_iter().try_for_each(|tape| tape.finish(&ending))?;
    let input = ReportInput { facts: &facts, ..ReportInput::new(&run.info, &digest) };
    page.write(report::html(&input)).map_err(output_lost)?;
    picture.write(report::picture_svg(&input)).map_err(output_lost)?;
    let files: Vec<String> = NAMES.iter().map(|n| file(n).display().to_string()).collect();
    let value = json!({
        "outcome": "finished",
        "recorded_s": summary.recorded_s,
        "executed_s": summary.executed_s,
        "samples": run.samples.len(),
        "joints": summary.joints,
        "upload": run.upload,
        "link": run.link,
        "files": files,
        "wall_s": begin.elapsed().as_secs_f64(),
    });
    out.result(&value, || {
        format!(
            "\n{}\n{}\n{:.1} s of simulated time in {:.1} s\n\nresults:\n  {}   the report: \
             open it in a browser\n  {}   for Foxglove, PlotJuggler, Rerun\n  {}   \
             for spreadsheets and scripts\n\
             next: jtc sim --serial /tmp/jtc   and then   jtc status --port /tmp/jtc",
            run_report::figures(&summary),
            run_report::link_line(&run.upload, &run.link),
            run.link.time_s,
            begin.elapsed().as_secs_f64(),
            files[0],
            files[1],
            files[2],
        )
    });
    Ok(())
}

/// Returns a port of the simulated controller in `world`. While a recording is active, the port stores a sample at each
/// tick.
fn observed(
    world: World,
    speed: SimSpeed,
    sinks: Vec<SampleSink>,
    samples: &Rc<RefCell<Vec<Sample>>>,
    recording: &Rc<Cell<bool>>,
) -> SimPort {
    let mut port = SimPort::new(world);
    let mut zero = None;
    let (taken, on, start) = (Rc::clone(samples), Rc::clone(recording), Instant::now());
    port.observe(move |world| {
        if on.get() && world.ticked() {
            let now = Sample::from(world.telemetry());
            let zero = *zero.get_or_insert(now.time_s);
            let sample = Sample { time_s: now.time_s - zero, ..now };
            sinks.iter().for_each(|sink| sink.write(&sample));
            taken.borrow_mut().push(sample);
        }
        if speed == SimSpeed::Realtime {
            std::thread::sleep(Duration::from_micros(world.now_us()).saturating_sub(start.elapsed()));
        }
    });
    port
}

fn upload(
    session: &mut Session<SimPort>,
    checked: &CheckedTrajectory,
    progress: &Progress,
    out: &Output,
) -> Result<UploadReport, Failure> {
    let bar = out.bar(1, "upload");
    let upload = session.upload(checked, |p| {
        bar.set_length(p.segments as u64);
        bar.set_position(p.segments_done as u64);
        progress.uploading("motion", p);
        Flow::Continue
    })?;
    bar.finish();
    progress.event("uploaded", run_report::uploaded("motion", &upload));
    out.note(format!(
        "uploaded: {} points in {} segments, {:.2} s on the line",
        upload.points, upload.segments, upload.time_s
    ));
    Ok(upload)
}

fn execute(
    speed: SimSpeed,
    info: RecordingInfo,
    sinks: Vec<SampleSink>,
    progress: &Progress,
    out: &Output,
) -> Result<Run, Failure> {
    let arm = Arm::avena();
    let trajectory = jtc_host::example::demo_motion();
    let world = World::new(SimConfig {
        seed: SEED,
        ..SimConfig::new(arm.config(), &arm.parameters()).with_drive_torques(arm.drive_torque_max)
    });
    let percent = |true_value: f64, believed: f64| {
        let off = if believed > 0.0 { ((true_value / believed - 1.0) * 100.0).round() + 0.0 } else { 0.0 };
        format!("{off:+} %")
    };
    let masses = (0..7)
        .map(|i| percent(world.true_model().links[i].mass, arm.model.links[i].mass))
        .collect::<Vec<_>>();

    let (samples, recording) = (Rc::default(), Rc::default());
    let mut session = Session::new(observed(world, speed, sinks, &samples, &recording));
    progress.watch(&mut session);

    out.note("parameters: friction, gains and arm model over the serial protocol");
    session.push(&arm.parameter_set(), |p| {
        progress.event("parameter", json!(p));
        out.note(format!("  {} confirmed, {} bytes", p.parameter.name(), p.bytes));
    })?;
    out.note("drives: waiting until all six hold the arm");
    let here = session.wait_ready(BRING_UP)?.positions();
    out.note(format!("  HoldPos, drives enabled after {:.1} s", session.now().as_secs_f64()));

    let checked = CheckedTrajectory::check(&trajectory, &arm, &here, &CheckOptions::default())?;
    let upload = upload(&mut session, &checked, progress, out)?;
    recording.set(true);
    wait(&mut session, MARGIN)?;
    let bar = out.motion_bar((trajectory.duration_s() * 1e3) as u64, "motion", "");
    progress.event("executing", json!({ "phase": "motion", "duration_s": trajectory.duration_s() }));
    session.execute(&checked)?;
    let outcome = session.follow(|s| {
        bar.set_position(u64::from(s.point));
        Flow::Continue
    })?;
    bar.finish();
    if !matches!(outcome, Outcome::Finished(_)) {
        return Err(Failure::new(ErrorKind::Fault, "stopped", "the motion was stopped"));
    }
    wait(&mut session, MARGIN)?;
    recording.set(false);
    out.note(format!("executed: {:.2} s of motion, recorded at 1 kHz", trajectory.duration_s()));

    let (link, baud) = (session.statistics(), session.port().baud());
    drop(session);
    Ok(Run {
        info,
        samples: samples.take(),
        upload,
        link,
        baud,
        masses: masses.join(", "),
        frictions: "random within ±20 %".into(),
    })
}

fn wait(session: &mut Session<SimPort>, time: Duration) -> Result<(), Failure> {
    let end = session.now() + time;
    while session.now() < end {
        session.poll(end - session.now())?;
    }
    Ok(())
}
