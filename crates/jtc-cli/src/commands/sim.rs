//! `jtc sim`: a simulated controller for other programs.

use cli_kit::{Failure, Output};

use crate::args::SimArgs;

/// Notice for a simulated arm with holding brakes. The next two constants are the notices for an arm on a stand, and
/// for an arm without support.
#[cfg(unix)]
const BRAKES: &str =
    "note: simulated holding brakes hold the arm after an error; the known drives have no brakes";
#[cfg(unix)]
const STAND: &str = "note: a stand carries the simulated arm until all drives were enabled once; after that \
    the arm falls without torque, as with the known drives";
#[cfg(unix)]
const NOTHING: &str = "note: nothing supports the simulated arm: it falls without torque, also before its \
    drives are first enabled";

/// Serves a simulated controller until SIGINT or SIGTERM.
#[cfg(unix)]
pub(super) fn sim(args: &SimArgs, out: &Output) -> Result<(), Failure> {
    use std::path::Path;

    use jtc_host::recording::{Ending, Format};
    use jtc_sim::{Gear, SimConfig, Support, World};
    use serde_json::json;

    use super::{run_report, simulated::simulated};
    use crate::args::SimSupport;
    use crate::serve::{Pty, Server, Typed};
    use crate::tape::Tape;
    use cli_kit::OutputFile;
    use cli_kit::Stop;

    if let Some(path) = &args.record {
        Format::of(path)?; // the command reports a wrong file name extension before the simulation starts
    }
    let stop = Stop::listen()?;
    let kept = args.store.as_deref().map(kept).transpose()?.flatten();
    let (arm, config) = simulated(args.arm.as_deref(), kept, out)?;
    let faults = args.faults.as_deref().map(faults).transpose()?.unwrap_or_default();
    let inputs: Vec<&Path> = [&args.arm, &args.faults].into_iter().filter_map(|p| p.as_deref()).collect();
    let file = args
        .record
        .as_deref()
        .map(|path| OutputFile::open(path, args.overwrite.overwrite, &inputs))
        .transpose()?;
    let mut config =
        SimConfig { baud: (!args.no_throttle).then_some(args.baud), seed: args.seed, faults, ..config };
    config.arm.payload = args.payload.unwrap_or_default();
    if let Some(stiffness) = args.gear_stiffness {
        config.arm.gears = stiffness.map(Gear::new);
    }
    if let Some(speeds) = args.over_speed {
        config.drives.iter_mut().zip(speeds).for_each(|(drive, speed)| drive.over_speed = speed);
    }
    let (support, brakes, words) = match args.support {
        SimSupport::Brakes => (Support::Brakes, true, BRAKES),
        SimSupport::Stand => (Support::Stand, false, STAND),
        SimSupport::None => (Support::None, false, NOTHING),
    };
    config.support = support;
    let world = World::new(config);
    let pty = Pty::open(args.serial.as_deref()).map_err(Failure::usage)?;
    let name = pty.name().display().to_string();
    out.note(words);
    let ready = || {
        let value = json!({ "ready": name, "holding_brakes": brakes, "note": words });
        out.result(&value, || format!("ready: {name}"))
    };
    let tap = args.bus.as_deref().map(bus).transpose()?;
    let info = run_report::info(&arm, "simulator", "", 0);
    let begin = |mut file: OutputFile| Tape::begin(&mut file, &info, "the simulation continues", out);
    let tape = file.map(begin).transpose()?;
    let time_s = Server::new(world, pty, tap, Typed::listen())
        .recorded(tape.as_ref().map(Tape::sink))
        .keeping(args.store.clone())
        .run(args.speed, &stop, ready)
        .map_err(Failure::usage)?;
    out.note(format!("ended after {time_s:.1} s of virtual time"));
    let Some(tape) = tape else { return Ok(()) };
    let name = tape.name().to_owned();
    tape.finish(&Ending {
        outcome: "ended".into(),
        reason: "the simulator has ended".into(),
        ..Ending::default()
    })?;
    out.note(format!("{name}: {time_s:.1} s, with every millisecond"));
    Ok(())
}

/// Returns the image of the stored arm from the file. Returns `None` if the file does not exist.
#[cfg(unix)]
fn kept(path: &std::path::Path) -> Result<Option<Vec<u8>>, Failure> {
    let unreadable = |what: String| {
        Failure::usage(format!("{}: {what}", path.display()))
            .next("choose another file; the simulator writes it after `jtc arm push --store`")
    };
    match std::fs::read(path) {
        Ok(image) if jtc_wire::ArmImage::parse(&image).is_some() => Ok(Some(image)),
        Ok(_) => Err(unreadable("the file contains no stored arm".into())),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(e) => Err(unreadable(e.to_string())),
    }
}

#[cfg(unix)]
fn faults(path: &std::path::Path) -> Result<jtc_sim::FaultPlan, Failure> {
    let text =
        std::fs::read_to_string(path).map_err(|e| Failure::usage(format!("{}: {e}", path.display())))?;
    // Files of hand motions are in the same directory as the fault file that refers to them.
    let load = |file: &str| crate::serve::hand(&path.with_file_name(file));
    jtc_sim::FaultPlan::from_toml_with(&text, load)
        .map_err(|e| Failure::usage(format!("{}: {e}", path.display())))
}

/// Connects the joint bus to a CAN bus, so that other programs can use the joint bus.
#[cfg(unix)]
fn bus(url: &str) -> Result<crate::serve::Tap, Failure> {
    let parsed: can_link::CanUrl = url.parse().map_err(Failure::usage)?;
    if matches!(parsed, can_link::CanUrl::Socketcand { .. }) {
        let what = format!(
            "{url}: the joint bus is CAN FD, but the socketcand protocol supports only classic frames"
        );
        return Err(Failure::usage(what)
            .next("use --bus multicast:239.74.163.2:43113, which python-can joins as udp_multicast"));
    }
    // The message of this error already contains the name of the bus.
    let bus = can_link::open_url(&parsed).map_err(Failure::usage)?;
    Ok(jtc_sim::BusTap::new(bus))
}

/// Returns an error, because pseudo-terminals exist only on Unix.
#[cfg(not(unix))]
pub(super) fn sim(_args: &SimArgs, _out: &Output) -> Result<(), Failure> {
    Err(Failure::usage("jtc sim needs pseudo-terminals, but this system has none")
        .next("use jtc demo, which needs no pseudo-terminal"))
}
