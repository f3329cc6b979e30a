//! `jtc bench`: options to declare absent joints.

use clap::Subcommand;
use jtc_wire::Joint;

use super::LinkArgs;

/// `jtc bench …`
#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// Declare these joints absent, and all other joints present
    #[command(
        after_help = "For each absent joint, write its number, counted from 1, and the angle that the joint \
            has in the model. The controller accepts this command only in Init or Error. Switch off the \
            torque first with `jtc disable`.\n\n\
            The controller does not wait for the nodes of absent joints, and the torque of absent joints is \
            zero. While a joint is absent, the controller does not execute trajectories, and teaching is not \
            possible. The controller holds the other joints, and you can jog these joints. The controller \
            computes the torque of these joints from the model of the whole arm. Therefore, push a model of \
            the arm that is on the bench.\n\n\
            If a drive answers at an absent joint, the controller reports an error. The setting is not \
            stored: after a power cycle, the controller expects all joints again.\n\n\
            Examples:\n  \
            jtc bench absent 3=0.5 4=0\n  \
            jtc bench absent 2=90 3=-45 --deg"
    )]
    Absent {
        /// Joint and its angle in rad, for example 3=0.5
        #[arg(required = true, value_name = "JOINT=RAD", value_parser = joint)]
        joints: Vec<(Joint, f64)>,
        /// Read the angles as degrees
        #[arg(long)]
        deg: bool,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Declare all joints present
    #[command(after_help = "The controller accepts this command only in Init or Error.\n\n\
        Examples:\n  \
        jtc bench present")]
    Present {
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Show the absent joints and their angles
    #[command(after_help = "Examples:\n  jtc bench show\n  jtc --json bench show | jq .absent")]
    Show {
        #[command(flatten)]
        link: LinkArgs,
    },
}

fn joint(text: &str) -> Result<(Joint, f64), String> {
    let (joint, angle) = text
        .split_once('=')
        .ok_or_else(|| format!("the angle of joint {text} is missing: write {text}=0"))?;
    let joint = joint.trim().parse().ok().and_then(Joint::from_number);
    let angle = angle.trim().parse::<f64>().ok().filter(|angle| angle.is_finite());
    match (joint, angle) {
        (Some(joint), Some(angle)) => Ok((joint, angle)),
        (None, _) => Err("not a valid joint: expected 1 to 6".into()),
        (_, None) => Err("the angle is not a number".into()),
    }
}
