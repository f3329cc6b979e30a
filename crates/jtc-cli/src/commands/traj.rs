//! `jtc traj`: trajectories from files.

use serde_json::json;

use crate::args::{LinkArgs, TrajCommand};
use crate::failure::Failure;
use crate::output::Output;

/// Does one of the family.
pub fn traj(command: &TrajCommand, out: &Output) -> Result<(), Failure> {
    match command {
        TrajCommand::Check { .. } | TrajCommand::Info { .. } | TrajCommand::Run(_) => Err(Failure::usage("not yet")),
        TrajCommand::Pause(link) => pause(link, out),
        TrajCommand::Resume(link) => resume(link, out),
        TrajCommand::Stop(link) => stop(link, out),
    }
}

fn pause(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    link.session()?.pause()?;
    out.result(&json!({ "command": "pause", "accepted": true }), || "pausing on the path".into());
    Ok(())
}

fn resume(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    link.session()?.execute()?;
    out.result(&json!({ "command": "resume", "accepted": true }), || "going on".into());
    Ok(())
}

fn stop(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    link.session()?.stop()?;
    out.result(&json!({ "command": "stop", "accepted": true }), || "stopping on the path".into());
    Ok(())
}
