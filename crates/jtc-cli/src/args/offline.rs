//! `jtc dynamics`, `explain`, `report`: options of commands that need no controller.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::OverwriteArgs;

/// Options of `jtc dynamics`.
#[derive(Args, Debug)]
pub(crate) struct DynamicsArgs {
    /// Quantity to compute
    pub what: DynamicsKind,
    /// Use this arm, TOML or URDF (default: the built-in arm)
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Set gravity in the base frame, m/s².
    ///
    /// Default: the gravity of the arm file
    #[arg(long, value_name = "X,Y,Z", value_parser = gravity, allow_hyphen_values = true)]
    pub gravity: Option<[f64; 3]>,
    /// Include the reflected rotor inertias of the arm file
    #[arg(long)]
    pub rotors: bool,
}

/// Kinds of dynamics.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum DynamicsKind {
    /// Compute the torques of a motion.
    Inverse,
    /// Compute the accelerations that torques cause.
    Forward,
    /// Compute the mass matrix, row by row.
    Mass,
}

/// Options of `jtc explain`.
#[derive(Args, Debug)]
pub(crate) struct ExplainArgs {
    /// Name, number or words of the code, as shown on the screen.
    ///
    /// `faults` explains the format of fault files. Without a code, the command lists all codes
    pub code: Vec<String>,
}

/// Options of `jtc example`.
#[derive(Args, Debug)]
pub(crate) struct ExampleArgs {
    /// Name of the example.
    ///
    /// Without a name, or with the name `list`, the command lists all examples
    pub name: Option<String>,
    /// Write to this directory (default: the current directory)
    #[arg(short = 'o', long = "out", env = "JTC_EXAMPLE_DIR", value_name = "DIR")]
    pub dir: Option<PathBuf>,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
}

/// Options of `jtc help`.
#[derive(Args, Debug)]
pub(crate) struct HelpArgs {
    /// Page (files, faults, events), or a command such as traj run
    pub topic: Vec<String>,
}

/// Options of `jtc report`.
#[derive(Args, Debug)]
pub(crate) struct ReportArgs {
    /// Recording, .mcap or .csv
    pub file: PathBuf,
    /// Write this report page (default: next to the recording)
    #[arg(long, env = "JTC_REPORT_OUT", value_name = "FILE")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
    /// Use the limits of this arm, TOML or URDF.
    ///
    /// Default: the limits in the recording. A CSV recording does not contain limits; its default is the built-in arm
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
}

fn gravity(text: &str) -> Result<[f64; 3], String> {
    let values: Vec<f64> =
        text.split(',').filter_map(|v| v.trim().parse().ok()).filter(|v: &f64| v.is_finite()).collect();
    let count = text.split(',').count();
    match <[f64; 3]>::try_from(values) {
        Ok(values) if count == 3 => Ok(values),
        _ => Err("not a valid vector: expected three numbers with commas, for example 0,0,-9.81".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gravity_is_checked() {
        assert_eq!(gravity("0,0,-9.81"), Ok([0.0, 0.0, -9.81]));
        assert!(gravity("0,0").is_err() && gravity("0,0,x").is_err() && gravity("0,0,1,2").is_err());
    }
}
