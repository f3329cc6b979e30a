//! `jtc plan`, `jtc move`, `jtc pose`: options to plan motions, and to name target poses.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use jtc_host::plan::{MARGIN_PCT, margin_of};
use jtc_wire::JOINTS;

use super::{ExecuteArgs, LinkArgs, OverwriteArgs};

/// Options of `jtc plan`.
#[derive(Args, Debug)]
pub(crate) struct PlanArgs {
    /// Waypoints, CSV or JSON
    pub file: PathBuf,
    /// Write the trajectory to this .csv file
    #[arg(short, long, env = "JTC_PLAN_OUT", value_name = "FILE")]
    pub out: PathBuf,
    /// Round corners within this distance, rad (0 to 0.5).
    ///
    /// The value is the largest distance of a joint from the waypoint. With --deg, the value is in degrees (0 to 28.6).
    /// With 0, the arm stops at each waypoint
    #[arg(long, value_name = "RAD", default_value_t = 0.0, allow_hyphen_values = true)]
    pub blend: f64,
    /// Move the flange along straight lines.
    ///
    /// The option applies to each waypoint without a value in the column `leg`
    #[arg(long)]
    pub line: bool,
    /// Round corners of lines and arcs, m (0 to 0.5).
    ///
    /// The value is the largest distance of the flange from the waypoint. With 0, the arm stops at the waypoint
    #[arg(long, value_name = "M", default_value_t = 0.0, allow_hyphen_values = true)]
    pub blend_m: f64,
    /// Set the speed in percent of the allowed speed (1 to 100)
    #[arg(long, value_name = "PCT", default_value_t = 100.0, allow_hyphen_values = true)]
    pub speed: f64,
    #[command(flatten)]
    pub margin: MarginArgs,
    /// Let the acceleration rise in 20 ms instead of 100 ms.
    ///
    /// The motion is then faster, but increases the stress on gears and load
    #[arg(long)]
    pub no_jerk_limit: bool,
    /// Use limits, masses and poses of this arm, TOML or URDF.
    ///
    /// Default: the built-in arm
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// Read the numbers of the file and --blend as degrees.
    ///
    /// Use this option for files that do not contain units
    #[arg(long)]
    pub deg: bool,
    /// Plan with this payload at the flange, kg.
    ///
    /// X,Y,Z is its position in the flange frame, m
    #[arg(long, value_name = "KG[,X,Y,Z]", value_parser = super::payload::carried, allow_hyphen_values = true)]
    pub payload: Option<jtc_core::Payload>,
    /// Set the lowest expected bearing temperature, °C.
    ///
    /// Cold bearings need more torque. Range: -40 to 120
    #[arg(long, value_name = "C", default_value_t = 20.0, allow_hyphen_values = true)]
    pub temperature: f64,
    /// Write a report page to this .html file.
    ///
    /// The page shows the motion, its limits, and which limit determines the speed at each time
    #[arg(long, env = "JTC_PLAN_REPORT", value_name = "FILE")]
    pub report: Option<PathBuf>,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
}

/// Options of `jtc move`.
#[derive(Args, Debug)]
#[command(group = clap::ArgGroup::new("target").required(true))]
pub(crate) struct MoveArgs {
    /// Move to joint positions, rad, or to a pose of the arm file
    #[arg(
        long,
        value_name = "Q1,…,Q6|NAME",
        value_parser = target,
        allow_hyphen_values = true,
        group = "target"
    )]
    pub to: Option<Target>,
    /// Move the flange to a pose in the base frame.
    ///
    /// X,Y,Z are in m. Roll, pitch and yaw are in rad, or in degrees with --deg
    #[arg(
        long,
        value_name = "X,Y,Z,ROLL,PITCH,YAW",
        value_parser = flange_pose,
        allow_hyphen_values = true,
        group = "target"
    )]
    pub to_flange: Option<[f64; 6]>,
    /// Move the flange along a straight line
    #[arg(long)]
    pub line: bool,
    /// Read positions, or roll, pitch and yaw, as degrees.
    ///
    /// Do not use this option with a named pose, because poses in an arm file are always in rad
    #[arg(long)]
    pub deg: bool,
    /// Set the speed in percent of the allowed speed (1 to 100).
    ///
    /// Default: 10, or 25 in a simulator
    #[arg(long, value_name = "PCT", allow_hyphen_values = true)]
    pub speed: Option<f64>,
    #[command(flatten)]
    pub margin: MarginArgs,
    /// Use poses, limits and masses of this arm file.
    ///
    /// Default: the arm of the controller, or the built-in arm if the controller cannot report its arm. A named pose
    /// needs this option
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    #[command(flatten)]
    pub execute: ExecuteArgs,
}

/// Option for the torque that a plan keeps in reserve.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct MarginArgs {
    /// Keep this torque reserve, percent of each limit (0 to 50).
    ///
    /// The reserve is for masses and friction that the arm model does not contain
    #[arg(
        long = "margin",
        alias = "torque-margin",
        value_name = "PERCENT",
        default_value_t = MARGIN_PCT,
        value_parser = margin_of,
        allow_hyphen_values = true
    )]
    pub percent: f64,
}

/// Target of a move.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Target {
    /// Joint positions as the user typed them, from base to wrist.
    Joints([f64; JOINTS]),
    /// Name of a pose in the arm file.
    Pose(String),
}

/// Parses the target of a move: six numbers with commas between them, or the name of a pose.
fn target(text: &str) -> Result<Target, String> {
    let text = text.trim();
    if text.is_empty() {
        return Err("neither six numbers nor the name of a pose".into());
    }
    if !text.contains(',') && text.parse::<f64>().is_err() {
        return Ok(Target::Pose(text.to_owned()));
    }
    let joints = numbers(text)?.try_into().map_err(|all: Vec<f64>| {
        let count = all.len();
        format!("{count} numbers, not 6: expected one number per joint, with commas and without spaces")
    })?;
    Ok(Target::Joints(joints))
}

/// Parses six numbers of a flange pose with commas between them.
fn flange_pose(text: &str) -> Result<[f64; 6], String> {
    numbers(text)?.try_into().map_err(|all: Vec<f64>| {
        format!("{} numbers, not 6: expected x, y, z in m, then roll, pitch and yaw, with commas", all.len())
    })
}

fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |word: &str| {
        let number = word.trim().parse::<f64>().ok().filter(|number| number.is_finite());
        number.ok_or_else(|| format!("'{}' is no number", word.trim()))
    };
    text.split(',').map(number).collect()
}

/// `jtc pose …`
#[derive(Debug, Subcommand)]
pub(crate) enum PoseCommand {
    /// Save the present position in the arm file
    #[command(
        after_help = "The arm must be at rest. The command does not save a pose during a trajectory or a \
            jog. All other contents of the file stay unchanged, including comments.\n\n\
            Examples:\n  \
            jtc pose save home --arm my-arm.toml\n  \
            jtc pose save above-table --arm my-arm.toml --overwrite"
    )]
    Save {
        /// Name of the pose.
        ///
        /// A name starts with a letter, and can continue with letters, digits and the characters . _ -
        name: String,
        #[command(flatten)]
        arm: PoseArm,
        #[command(flatten)]
        link: LinkArgs,
        /// Overwrite a pose of this name
        #[arg(long, alias = "force")]
        overwrite: bool,
    },
    /// List all poses of the arm file
    #[command(
        after_help = "Examples:\n  jtc pose list --arm my-arm.toml\n  jtc --json pose list --arm my-arm.toml | jq .poses_rad.home"
    )]
    List {
        #[command(flatten)]
        arm: PoseArm,
        /// Show positions in degrees
        #[arg(long)]
        deg: bool,
    },
    /// Remove a pose from the arm file
    #[command(after_help = "Examples:\n  jtc pose remove above-table --arm my-arm.toml")]
    Remove {
        /// Name of the pose
        name: String,
        #[command(flatten)]
        arm: PoseArm,
    },
}

/// Option for the arm file that contains the poses.
#[derive(Args, Debug)]
pub(crate) struct PoseArm {
    /// Use this arm file, TOML.
    ///
    /// `jtc example arm` writes an example, and `jtc arm pull` writes the arm of the controller
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: PathBuf,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_six_numbers_or_a_name() {
        assert_eq!(target("0, 0.5,-1,0,0,2e-1"), Ok(Target::Joints([0.0, 0.5, -1.0, 0.0, 0.0, 0.2])));
        assert_eq!(target("home"), Ok(Target::Pose("home".into())));
        for wrong in
            ["", "1", "0,0,0,0,0", "0,0,0,0,0,0,0", "0,0,x,0,0,0", "0,0,nan,0,0,0", "inf", "0,,0,0,0,0"]
        {
            assert!(target(wrong).is_err(), "{wrong}");
        }
    }
}
