//! Command `ucom help`: prints help pages about the files that `ucom` reads.

use clap::CommandFactory;
use cli_kit::{Failure, Output};
use serde_json::json;

use crate::args::{Cli, Topic};

/// Prints a help page, or the help of `ucom` itself.
pub(super) fn help(topic: Option<Topic>, out: &Output) -> Result<(), Failure> {
    let text = match topic {
        Some(Topic::Profile) => ucom_host::profile_help(),
        Some(Topic::Sim) => ucom_sim::help(),
        Some(Topic::Faults) => ucom_sim::FAULT_HELP.to_owned(),
        Some(Topic::Signals) => ucom_host::files::signals::SIGNAL_HELP.to_owned(),
        Some(Topic::Params) => ucom_host::files::params::PARAMS_HELP.to_owned(),
        None => Cli::command().render_long_help().to_string(),
    };
    out.result(&json!({ "text": text }), || text.clone());
    Ok(())
}
