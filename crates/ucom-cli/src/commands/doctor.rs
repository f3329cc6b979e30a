//! Commands `ucom doctor` and `ucom probe`: diagnosis of the bus, and measurement of the boards' profile.

use std::time::Duration;

use cli_kit::{ErrorKind, Failure, Output, OutputFile};
use serde_json::json;
use ucom_host::ProfileFile;
use ucom_host::files::{Image, ImageOptions};
use ucom_host::master::doctor::Finding;
use ucom_host::master::probe::ProbeOptions;
use ucom_host::master::{Outcome, Request};
use ucom_host::session::SessionError;

use super::params::open_output;
use crate::args::{LinkArgs, ProbeArgs};
use crate::shape::board_value;

/// Time for which the command only listens before its first request.
const LISTEN: Duration = Duration::from_millis(1500);

/// Checks the bus and all boards. The exit code is 0 without a problem, 3 if no frame was received, and 1 otherwise.
pub(super) fn doctor(link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut driver = link.session()?;
    out.note(format!("listening on {}", link.url()?));
    let seen = driver.examine(LISTEN)?;
    let (all, profile, failure) = (&seen.findings, driver.master.profile(), seen.failure());
    let boards = seen.boards.iter().map(|b| board_value(b, &profile)).collect::<Vec<_>>();
    let value =
        json!({ "bus": link.url()?, "healthy": failure.is_none(), "findings": all, "boards": boards });
    out.result(&value, || all.iter().map(line).collect());
    failure.map_or(Ok(()), |kind| Err(Failure::shown(kind)))
}

fn line(f: &Finding) -> String {
    let mut text = format!("{} {}\n", f.severity.mark(), f.what);
    for (word, more) in [("why", &f.why), ("next", &f.next.to_string())] {
        if !more.is_empty() {
            text += &format!("    {word}: {}\n", more.replace('`', ""));
        }
    }
    text
}

/// Measures the profile of the boards and writes the profile to a file.
pub(super) fn probe(args: &ProbeArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let output = args.out.as_deref().map(|file| open_output(file, args.overwrite.overwrite)).transpose()?;
    let image = match &args.image {
        Some(path) => {
            let image = Image::read(path, &ImageOptions::default()).map_err(Failure::usage)?;
            Some(image.into_bytes().into())
        }
        None => None,
    };
    let mut driver = link.session()?;
    let options = ProbeOptions { init: args.init, alive: args.alive, image, force: args.force.force };
    let report = match driver.run(Request::Probe(options))? {
        Outcome::Probe(report) => report,
        other => return Err(SessionError::from(other).into()),
    };
    if report.boards.is_empty() && report.reports == 0 {
        // Without measurements, the file would contain only default values, which would look like measured values.
        let what = "no board answers: nothing was measured, and no profile was written";
        return Err(
            Failure::new(ErrorKind::NoLink, "no-boards", what).next("find the cause with ucom doctor")
        );
    }
    if report.boards.is_empty() {
        let n = report.reports;
        out.note(format!(
            "{n} board{s} without a number: only reports were measured; use ucom probe --init, or run ucom \
             init first",
            s = if n == 1 { "" } else { "s" }
        ));
    }
    let toml = report.profile.to_toml();
    let file = output.as_ref().map(OutputFile::name);
    output.map_or(Ok(()), |output| output.write(&toml))?;
    let value = json!({ "rows": report.rows, "boards": report.boards, "profile": toml, "file": file });
    out.result(&value, || match &file {
        Some(file) => format!("{}\nprofile: {file}; use it with --profile {file}\n", report.table()),
        None => {
            out.note(report.table());
            toml.clone()
        }
    });
    Ok(())
}
