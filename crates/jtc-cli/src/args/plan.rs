//! `jtc plan`, `jtc move`, `jtc pose`: motions made here, and the poses that they lead to.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use jtc_host::plan::{MARGIN_PCT, margin_of};
use jtc_wire::JOINTS;

use super::{ExecuteArgs, LinkArgs, OverwriteArgs};

/// Options of `jtc plan`.
#[derive(Args, Debug)]
pub struct PlanArgs {
    /// Waypoints, CSV or JSON
    pub file: PathBuf,
    /// Trajectory to write, .csv
    #[arg(short, long, env = "JTC_PLAN_OUT", value_name = "FILE")]
    pub out: PathBuf,
    /// How far from a waypoint its corner may be rounded, up to 0.5 rad (with --deg: degrees) of the joint that is furthest; 0: the arm stops at each
    #[arg(long, value_name = "RAD", default_value_t = 0.0, allow_hyphen_values = true)]
    pub blend: f64,
    /// The flange keeps to a straight line on each leg of which the file does not say how the arm moves
    #[arg(long)]
    pub line: bool,
    /// How far from a waypoint the corner between two lines or arcs may be rounded, up to 0.5 m; 0: the arm stops there
    #[arg(long, value_name = "M", default_value_t = 0.0, allow_hyphen_values = true)]
    pub blend_m: f64,
    /// Speed in percent of what the limits allow, 1 to 100
    #[arg(long, value_name = "PCT", default_value_t = 100.0, allow_hyphen_values = true)]
    pub speed: f64,
    #[command(flatten)]
    pub margin: MarginArgs,
    /// Let the acceleration change within 20 ms instead of 100 ms: faster, and harder on gears and load
    #[arg(long)]
    pub no_jerk_limit: bool,
    /// Arm whose limits, masses and poses count, TOML or URDF; default: the built-in one
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    /// The numbers of the file and --blend are degrees, for files that do not name their unit
    #[arg(long)]
    pub deg: bool,
    /// What the arm carries at its flange: kg, or kg and its place in the flange frame in m
    #[arg(long, value_name = "KG[,X,Y,Z]", value_parser = super::payload::carried, allow_hyphen_values = true)]
    pub payload: Option<jtc_core::Payload>,
    /// Lowest bearing temperature at which it will be run, °C: cold bearings take more torque
    #[arg(long, value_name = "C", default_value_t = 20.0, allow_hyphen_values = true)]
    pub temperature: f64,
    /// Write a page with the motion, its limits and what binds when, .html
    #[arg(long, env = "JTC_PLAN_REPORT", value_name = "FILE")]
    pub report: Option<PathBuf>,
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
}

/// Options of `jtc move`.
#[derive(Args, Debug)]
#[command(group = clap::ArgGroup::new("target").required(true))]
pub struct MoveArgs {
    /// Joint positions, rad, or the name of a pose of the arm file
    #[arg(
        long,
        value_name = "Q1,…,Q6|NAME",
        value_parser = target,
        allow_hyphen_values = true,
        group = "target"
    )]
    pub to: Option<Target>,
    /// A pose of the flange in the base frame instead: m, and roll, pitch and yaw in rad
    #[arg(
        long,
        value_name = "X,Y,Z,ROLL,PITCH,YAW",
        value_parser = flange_pose,
        allow_hyphen_values = true,
        group = "target"
    )]
    pub to_flange: Option<[f64; 6]>,
    /// The flange keeps to a straight line
    #[arg(long)]
    pub line: bool,
    /// The positions, or roll, pitch and yaw, are degrees; not for poses by name, whose unit is known
    #[arg(long)]
    pub deg: bool,
    /// Speed in percent of what the limits allow, 1 to 100; default: 10, and 25 in a simulator
    #[arg(long, value_name = "PCT", allow_hyphen_values = true)]
    pub speed: Option<f64>,
    #[command(flatten)]
    pub margin: MarginArgs,
    /// Arm file with the poses, whose limits and masses count; default: the arm of the controller
    #[arg(long, env = "JTC_ARM", value_name = "FILE")]
    pub arm: Option<PathBuf>,
    #[command(flatten)]
    pub execute: ExecuteArgs,
}

/// Torque that a plan leaves.
#[derive(Args, Clone, Copy, Debug)]
pub struct MarginArgs {
    /// Torque to leave for what the model does not know, percent of each limit, 0 to 50
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

/// Where a move leads.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// As typed, base to wrist.
    Joints([f64; JOINTS]),
    /// Name of a pose.
    Pose(String),
}

/// Six numbers with commas between them, or a name.
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
        format!("{count} numbers, not 6: one for each joint, with commas between them and without blanks")
    })?;
    Ok(Target::Joints(joints))
}

/// Six numbers with commas between them.
fn flange_pose(text: &str) -> Result<[f64; 6], String> {
    numbers(text)?.try_into().map_err(|all: Vec<f64>| {
        format!("{} numbers, not 6: x, y, z in m, roll, pitch and yaw, with commas between them", all.len())
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
pub enum PoseCommand {
    /// Save where the arm is into the arm file
    #[command(
        after_help = "The arm stands still meanwhile: while a trajectory is executed or a joint is jogged it is refused. The rest of the file stays as it is, comments included.\n\nExamples:\n  \
                            jtc pose save home --arm my-arm.toml\n  jtc pose save above-table --arm my-arm.toml --overwrite"
    )]
    Save {
        /// A letter, then letters, digits, _, - and .
        name: String,
        #[command(flatten)]
        arm: PoseArm,
        #[command(flatten)]
        link: LinkArgs,
        /// Write over a pose of this name
        #[arg(long, alias = "force")]
        overwrite: bool,
    },
    /// All poses of the arm file
    #[command(
        after_help = "Examples:\n  jtc pose list --arm my-arm.toml\n  jtc --json pose list --arm my-arm.toml | jq .poses_rad.home"
    )]
    List {
        #[command(flatten)]
        arm: PoseArm,
        /// Positions in degrees
        #[arg(long)]
        deg: bool,
    },
    /// Take a pose out of the arm file
    #[command(after_help = "Examples:\n  jtc pose remove above-table --arm my-arm.toml")]
    Remove {
        /// Name of the pose
        name: String,
        #[command(flatten)]
        arm: PoseArm,
    },
}

/// The file that holds the poses.
#[derive(Args, Debug)]
pub struct PoseArm {
    /// Arm file, TOML; `jtc example arm` writes one, `jtc arm pull` that of the controller
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
