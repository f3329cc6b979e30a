//! Implementation of the `jtc` commands. Each command or family of commands has a separate file.

mod arm;
mod bench;
mod continued;
mod decode;
mod demo;
mod doctor;
mod dynamics;
mod example;
mod explain;
mod firmware;
mod halt;
mod help;
mod info;
mod job;
mod jog;
mod log;
mod maintain;
mod monitor;
mod moves;
mod named_arm;
mod params;
mod payload;
mod plan;
mod ports;
mod pose;
mod report;
mod reset;
mod resume;
mod run;
mod run_report;
mod serve;
mod sim;
mod simulated;
mod status;
mod teach;
mod traj;

use cli_kit::{Failure, Output, pages};

use crate::args::Command;

/// Runs a `jtc` command.
pub(crate) fn run(command: Command, out: &Output) -> Result<(), Failure> {
    match command {
        Command::Demo(args) => demo::demo(&args, out),
        Command::Sim(args) => sim::sim(&args, out),
        Command::Serve(args) => serve::serve(&args, out),
        Command::Ports => ports::ports(out),
        Command::Doctor(link) => doctor::doctor(&link, out),
        Command::Status(link) => status::status(&link, out),
        Command::Info(link) => info::info(&link, out),
        Command::Disable { yes, link } => info::disable(yes, &link, out),
        Command::Jog(args) => jog::jog(&args, out),
        Command::Monitor(args) => monitor::monitor(&args, out),
        Command::Arm(command) => arm::arm(&command, out),
        Command::Params(command) => params::params(&command, out),
        Command::Firmware(command) => firmware::firmware(&command, out),
        Command::Bench(command) => bench::bench(&command, out),
        Command::Payload(command) => payload::payload(&command, out),
        Command::Plan(args) => plan::plan(&args, out),
        Command::Move(args) => moves::move_to(&args, out),
        Command::Pose(command) => pose::pose(&command, out),
        Command::Stop(link) => halt::stop(&link, out),
        Command::Run(args) => run::run(&args, out),
        Command::Traj(command) => traj::traj(&command, out),
        Command::Teach(command) => teach::teach(&command, out),
        Command::Log(command) => log::log(&command, out),
        Command::Clear(args) => maintain::clear(&args, out),
        Command::Reset(args) => reset::reset(&args, out),
        Command::Gripper(args) => maintain::gripper(&args, out),
        Command::Recover(args) => maintain::recover(&args, out),
        Command::Dynamics(args) => dynamics::dynamics(&args, out),
        Command::Explain(args) => explain::explain(&args, out),
        Command::Example(args) => example::example(&args, out),
        Command::Help(args) => help::help(&args, out),
        Command::Decode => decode::decode(out),
        Command::Report(args) => report::report(&args, out),
        Command::Completions { shell } => {
            pages::completions::<crate::args::Cli>(shell);
            Ok(())
        }
        Command::Man { out: dir } => Ok(pages::man::<crate::args::Cli>(dir.as_deref())?),
    }
}
