//! `jtc demo` and `jtc sim`: options of the simulator.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use cli_kit::variables::on_off;
use jtc_core::JOINTS;
use jtc_sim::{DriveConfig, Gear};

use super::OverwriteArgs;

/// Speed of virtual time.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum SimSpeed {
    /// Run at the speed of a real arm.
    Realtime,
    /// Run as fast as this computer can.
    Max,
}

/// Support of a simulated arm while its drives do not hold it.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum SimSupport {
    /// No support: the arm falls while its drives are off
    None,
    /// A stand until all drives were enabled once, then no support
    Stand,
    /// Holding brakes that close at once if a drive is not enabled
    Brakes,
}

fn gears(text: &str) -> Result<[f64; JOINTS], String> {
    of_joints(text, Gear::STIFFNESS, "N·m/rad")
}

fn over_speed(text: &str) -> Result<[f64; JOINTS], String> {
    of_joints(text, DriveConfig::OVER_SPEED, "rad/s")
}

/// Parses one number for all joints, or a number for each joint. Each number must be within the limits.
fn of_joints(text: &str, (low, high): (f64, f64), unit: &str) -> Result<[f64; JOINTS], String> {
    let numbers = super::payload::numbers(text)?;
    let all = match numbers[..] {
        [one] => [one; JOINTS],
        _ => <[f64; JOINTS]>::try_from(numbers)
            .map_err(|numbers| format!("{} numbers, expected 1 for all joints or {JOINTS}", numbers.len()))?,
    };
    match all.iter().position(|number| !(low..=high).contains(number)) {
        Some(bad) => {
            Err(format!("joint {}: {} {unit} is out of range ({low}–{high} {unit})", bad + 1, all[bad]))
        }
        None => Ok(all),
    }
}

/// Options of `jtc demo`.
#[derive(Args, Debug)]
pub(crate) struct DemoArgs {
    /// Write recording, report and picture to this directory
    #[arg(long, env = "JTC_DEMO_DIR", value_name = "DIR", default_value = "demo")]
    pub out: PathBuf,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
    /// Set the speed of the simulated time
    #[arg(long, env = "JTC_SPEED", value_enum, default_value_t = SimSpeed::Max)]
    pub speed: SimSpeed,
}

/// Options of `jtc sim`.
#[derive(Args, Debug)]
pub(crate) struct SimArgs {
    /// Create a symbolic link to the pseudo-terminal at this path.
    ///
    /// Without this option, the command prints the name of the pseudo-terminal
    #[arg(long, env = "JTC_SERIAL", value_name = "PATH")]
    pub serial: Option<PathBuf>,
    /// Simulate this arm, TOML or URDF (default: the built-in arm).
    ///
    /// If the file contains all parameters, the simulated controller also has this arm as its stored arm
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Attach a payload that the controller does not know.
    ///
    /// The payload is a point mass. KG is its mass, kg. X,Y,Z is its position in the flange frame, m. Default of the
    /// position: 0,0,0
    #[arg(long, env = "JTC_SIM_PAYLOAD", value_name = "KG[,X,Y,Z]", value_parser = super::payload::carried)]
    pub payload: Option<jtc_core::Payload>,
    /// Choose the support of the arm while its drives are off
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = SimSupport::Brakes)]
    pub support: SimSupport,
    /// Set the gear stiffness between motor and link, N·m/rad.
    ///
    /// Write one number for all joints, or six numbers with commas between them (100 to 1000000). Default: rigid
    #[arg(long, value_name = "K[,K2,…,K6]", value_parser = gears, allow_hyphen_values = true)]
    pub gear_stiffness: Option<[f64; JOINTS]>,
    /// Set the over-speed limit of the drives, rad/s.
    ///
    /// A drive reports a fault if its joint is faster. Write one number for all joints, or six numbers with commas
    /// between them (0.01 to 100). Default: 1.2 times the velocity limit
    #[arg(long, value_name = "V[,V2,…,V6]", value_parser = over_speed, allow_hyphen_values = true)]
    pub over_speed: Option<[f64; JOINTS]>,
    /// Use this file as the non-volatile memory of the controller.
    ///
    /// The simulator reads the stored arm from this file when it starts. `jtc arm push --store` writes the arm to the
    /// file
    #[arg(long, env = "JTC_STORE_FILE", value_name = "FILE")]
    pub store: Option<PathBuf>,
    /// Set the rate of the simulated line, Bd (300 to 15000000).
    ///
    /// Each byte takes as much time as on a real serial line of this rate
    #[arg(long, env = "JTC_BAUD", value_name = "N", default_value_t = 115_200,
          value_parser = clap::value_parser!(u32).range(300..=15_000_000))]
    pub baud: u32,
    /// Send bytes without the delay of a serial line
    #[arg(long, env = "JTC_NO_THROTTLE", value_parser = on_off)]
    pub no_throttle: bool,
    /// Set the speed of the simulated time
    #[arg(long, env = "JTC_SPEED", value_enum, default_value_t = SimSpeed::Realtime)]
    pub speed: SimSpeed,
    /// Set the seed of random numbers.
    ///
    /// Simulations with the same seed produce the same bytes
    #[arg(long, env = "JTC_SEED", value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Inject the faults of this TOML file.
    ///
    /// `jtc explain faults` shows the format
    #[arg(long, env = "JTC_FAULTS", value_name = "FILE")]
    pub faults: Option<PathBuf>,
    /// Also connect the joint bus to the CAN bus at this URL.
    ///
    /// An example is multicast:239.74.163.2:43113
    #[arg(long, env = "JTC_BUS", value_name = "URL")]
    pub bus: Option<String>,
    /// Record one sample per ms to this .mcap or .csv file.
    ///
    /// The recording starts at power-up. The samples contain commanded and measured positions, velocities, torques and
    /// states
    #[arg(long, env = "JTC_SIM_RECORD", value_name = "FILE")]
    pub record: Option<PathBuf>,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_number_is_for_all_joints() {
        assert_eq!(gears("2e4"), Ok([20_000.0; JOINTS]));
        assert_eq!(over_speed("1, 2,3,4,5,6"), Ok([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
        for (given, part) in [
            (gears("1000,2000"), "2 numbers, expected 1 for all joints or 6"),
            (gears("1e4,1e4,99,1e4,1e4,1e4"), "joint 3: 99 N·m/rad is out of range (100–1000000 N·m/rad)"),
            (gears("rigid"), "'rigid' is no number"),
            (over_speed("-1"), "joint 1: -1 rad/s is out of range (0.01–100 rad/s)"),
            (over_speed("nan"), "'nan' is no number"),
            (over_speed(""), "'' is no number"),
        ] {
            let message = given.unwrap_err();
            assert!(message.contains(part), "{message}");
        }
    }
}
