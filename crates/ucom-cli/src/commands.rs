//! Commands of `ucom`. Each file in this folder contains one command or one group of commands.

mod boards;
mod chain;
pub(crate) mod conformance;
mod decode;
mod doctor;
mod explain;
mod help;
mod io;
mod monitor;
mod monitor_boards;
mod monitor_view;
mod outputs;
mod params;
mod record;
mod repair;
mod run;
mod send;
mod serve;
mod sim;
mod typed;
mod update;
mod update_bar;
mod update_files;
mod update_report;

use cli_kit::{Failure, Output, pages};

use crate::args::{Command, LinkArgs};

/// Runs a command of `ucom`.
pub(crate) fn run(command: Command, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    match command {
        Command::Sim(args) => sim::sim(&args, link, out),
        Command::Scan => chain::scan(link, out),
        Command::Init(args) => chain::init(&args, link, out),
        Command::Info(args) => boards::info(&args, link, out),
        Command::Status(args) => boards::status(&args, link, out),
        Command::Reset(args) => boards::reset(&args, link, out),
        Command::Xreset(args) => boards::xreset(&args, link, out),
        Command::Start(args) => boards::start(&args, link, out),
        Command::Stop(args) => boards::stop(&args, link, out),
        Command::Update(args) => update::update(&args, link, out),
        Command::Repair(args) => repair::repair(&args, link, out),
        Command::Io(args) => io::io(&args, link, out),
        Command::Ci(args) => io::ci(&args, link, out),
        Command::Par(args) => params::par(&args, link, out),
        Command::So(args) => outputs::so(&args, link, out),
        Command::Run(args) => run::run(&args, link, out),
        Command::Serve(args) => serve::serve(&args, link, out),
        Command::Monitor(args) => monitor::monitor(&args, link, out),
        Command::Conformance(args) => conformance::conformance(&args, link, out),
        Command::Explain(args) => explain::explain(&args, out),
        Command::Doctor => doctor::doctor(link, out),
        Command::Probe(args) => doctor::probe(&args, link, out),
        Command::Dbc(args) => io::dbc(&args, link, out),
        Command::Record(args) => record::record(&args, link, out),
        Command::Replay(args) => record::replay(&args, link, out),
        Command::Send(args) => send::send(&args, link, out),
        Command::Decode(args) => decode::decode(&args, link, out),
        Command::Help { topic } => help::help(topic, out),
        Command::Completions { shell } => {
            pages::completions::<crate::args::Cli>(shell);
            Ok(())
        }
        Command::Man { out: dir } => Ok(pages::man::<crate::args::Cli>(dir.as_deref())?),
    }
}
