//! `jtc bench`: options to declare absent joints.

use clap::Subcommand;
use jtc_wire::Joint;

use super::LinkArgs;

/// `jtc bench …`
#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    /// Declare these joints absent, and all other joints present
    #[command(
        after_help = "For each absent joint, write its number (1 to 6) and its angle in the arm model. The \
            controller accepts this command only in the states Init and Error. Switch off the torque first \
            with `jtc disable`.\n\n\
            The controller does not wait for the drives of absent joints, and commands zero torque for these \
            joints. While a joint is absent, the controller refuses trajectories and teaching. The \
            controller holds the present joints, and you can jog them. The controller computes their torques \
            with the model of the whole arm. Therefore, send a model that matches the arm on the bench (`jtc \
            arm push`).\n\n\
            If the drive of an absent joint answers, the controller reports an error. The controller does \
            not store the absent joints. After a power cycle, it expects all joints again.\n\n\
            Examples:\n  \
            jtc bench absent 3=0.5 4=0\n  \
            jtc bench absent 2=90 3=-45 --deg"
    )]
    Absent {
        /// Joint and its angle (-6.2832 to 6.2832 rad), such as 3=0.5
        #[arg(required = true, value_name = "JOINT=RAD", value_parser = joint)]
        joints: Vec<(Joint, f64)>,
        /// Read the angles as degrees
        #[arg(long)]
        deg: bool,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Declare all joints present
    #[command(after_help = "The controller accepts this command only in the states Init and Error.\n\n\
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
