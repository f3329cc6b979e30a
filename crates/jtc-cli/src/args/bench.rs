//! `jtc bench`: joints that are not there.

use clap::Subcommand;
use jtc_wire::Joint;

use super::LinkArgs;

/// `jtc bench …`
#[derive(Debug, Subcommand)]
pub enum BenchCommand {
    /// These joints are not there, and no others
    #[command(
        after_help = "Each joint, counted from 1, is given with the angle at which the model has it. In Init or Error only: `jtc disable`\n\
                            takes the torque off before. No node is waited for at these joints, and their torque is zero. While a joint\n\
                            is absent no motion is executed and nothing is taught; the others are held, with the torque that the model has\n\
                            for the whole arm, and can be jogged: push the model of what is on the bench. A drive that answers all the\n\
                            same is an error. It is not stored: after the controller was switched off all joints are expected again.\n\nExamples:\n  \
                            jtc bench absent 3=0.5 4=0\n  jtc bench absent 2=90 3=-45 --deg"
    )]
    Absent {
        /// Joint and angle, rad: 3=0.5
        #[arg(required = true, value_name = "JOINT=RAD", value_parser = joint)]
        joints: Vec<(Joint, f64)>,
        /// The angles are degrees
        #[arg(long)]
        deg: bool,
        #[command(flatten)]
        link: LinkArgs,
    },
    /// All joints are there
    #[command(after_help = "In Init or Error only.\n\nExamples:\n  jtc bench present")]
    Present {
        #[command(flatten)]
        link: LinkArgs,
    },
    /// Which joints are set absent, and where
    #[command(after_help = "Examples:\n  jtc bench show\n  jtc --json bench show | jq .absent")]
    Show {
        #[command(flatten)]
        link: LinkArgs,
    },
}

fn joint(text: &str) -> Result<(Joint, f64), String> {
    let (joint, angle) =
        text.split_once('=').ok_or_else(|| format!("the angle of joint {text} is missing: {text}=0"))?;
    let joint = joint.trim().parse().ok().and_then(Joint::from_number);
    let angle = angle.trim().parse::<f64>().ok().filter(|angle| angle.is_finite());
    match (joint, angle) {
        (Some(joint), Some(angle)) => Ok((joint, angle)),
        (None, _) => Err("joints are 1 to 6".into()),
        (_, None) => Err("the angle is no number".into()),
    }
}
