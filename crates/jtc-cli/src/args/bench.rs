//! `jtc bench`: options to declare absent joints.

use clap::Subcommand;
use jtc_wire::Joint;

use super::LinkArgs;

/// `jtc bench …`
#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// Set these joints absent, and all others present
    #[command(
        after_help = "Name each absent joint, counted from 1, with the angle that it has in the model. The \
            controller accepts this only in Init or Error. Switch off the torque first with `jtc \
            disable`.\n\n\
            The controller does not wait for nodes at these joints, and their torque is zero. While a joint \
            is absent, the controller does not execute trajectories, and you cannot teach. The controller \
            holds the other joints, and you can jog them. The controller computes their torque from the \
            model of the whole arm: push a model of the arm that is on the bench.\n\n\
            A drive that answers at an absent joint is an error. The setting is not stored: after a power \
            cycle, the controller expects all joints again.\n\n\
            Examples:\n  \
            jtc bench absent 3=0.5 4=0\n  \
            jtc bench absent 2=90 3=-45 --deg"
    )]
    Absent {
        /// Joint and its angle in rad, as 3=0.5
        #[arg(required = true, value_name = "JOINT=RAD", value_parser = joint)]
        joints: Vec<(Joint, f64)>,
        /// Read the angles as degrees
        #[arg(long)]
        deg: bool,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Set all joints present
    #[command(after_help = "The controller accepts this only in Init or Error.\n\n\
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
