//! Command `ucom sim`: simulates a chain of boards, with a server for the socketcand protocol.

use std::time::Duration;

use can_link::BusStats;
use cli_kit::{Failure, Output};
use serde_json::json;
use ucom::Profile;
use ucom_host::master::counted;
use ucom_host::session::CleanupList;
use ucom_sim::{ChainConfig, ChainServer, ChainSim, Fault};

use super::typed::typed;
use crate::args::{LinkArgs, SimArgs};
use crate::interrupt::listen;

/// Interval at which the simulator checks for signals and for lines on stdin.
const LOOK: Duration = Duration::from_millis(50);

/// Serves a simulated chain until SIGINT or SIGTERM.
pub(super) fn sim(args: &SimArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let stop = listen(&CleanupList::default())?;
    let profile = link.profile()?;
    let config = config(args, &profile)?;
    let faults = match &args.faults {
        None => Vec::new(),
        Some(path) => {
            let wrong = |e: &dyn std::fmt::Display| {
                Failure::usage(format!("{}: {e}", path.display())).next("ucom help faults shows the form")
            };
            Fault::from_toml(&std::fs::read_to_string(path).map_err(|e| wrong(&e))?).map_err(|e| wrong(&e))?
        }
    };
    let boards = config.boards.len();
    let chain = ChainSim::new(&config, faults, args.seed, &profile);
    let mut server =
        ChainServer::bind(&args.listen, chain, profile.bitrate, args.seed, |text| out.note(text))
            .map_err(|e| Failure::usage(e).next("--listen 127.0.0.1:0 selects a free port"))?;
    let url = server.url();
    out.result(&json!({ "ready": url, "boards": boards }), || format!("ready: {url}"));
    let typed = typed();
    while !stop.asked() {
        while let Ok(line) = typed.try_recv() {
            server.fault(line.trim());
        }
        server.turn(LOOK);
    }
    let stats = server.stats();
    let load = stats.load_since(&BusStats::default()) * 100.0;
    out.note(format!(
        "ended after {:.1} s; {} on the bus, {load:.1} % load, {}",
        stats.now_ns as f64 * 1e-9,
        counted(stats.frames as usize, "frame"),
        counted(stats.collisions as usize, "collision")
    ));
    Ok(())
}

fn config(args: &SimArgs, profile: &Profile) -> Result<ChainConfig, Failure> {
    let config = match &args.chain {
        Some(path) => ChainConfig::read(path, profile)
            .map_err(|e| Failure::usage(e).next("ucom help sim shows the form of chain files"))?,
        None => ChainConfig::head(profile),
    };
    let count = match args.boards {
        Some(count) => usize::from(count),
        None => config.boards.len().max(args.flash_ids.len()),
    };
    if args.flash_ids.len() > count {
        let (given, wanted) = (args.flash_ids.len(), count);
        return Err(Failure::usage(format!("--flash-ids has {given} entries, but --boards is {wanted}")));
    }
    Ok(config.with_boards(count, profile).with_flash_ids(&args.flash_ids))
}
