//! `jtc arm`: arm files.

use cli_kit::{Failure, Output};
use jtc_host::arm::{Arm, ArmChoice};
use serde_json::json;

use crate::args::{ArmCommand, ImportArgs};
use cli_kit::OutputFile;

/// Does one of the family.
pub fn arm(command: &ArmCommand, out: &Output) -> Result<(), Failure> {
    match command {
        ArmCommand::Import(args) => import(args, out),
    }
}

fn import(args: &ImportArgs, out: &Output) -> Result<(), Failure> {
    let choice = ArmChoice { joints: args.joints.clone(), tip: args.tip.clone() };
    let arm = Arm::import(&args.urdf, &choice)?;
    let file = OutputFile::open(&args.out, args.force.force, &[&args.urdf])?;
    let name = file.name();
    file.write(arm.to_toml())?;
    let missing: Vec<&str> = arm.parameter_set().missing();
    let value = json!({
        "file": name, "arm": arm.name, "joints": arm.joint_names, "warnings": arm.warnings, "missing": missing,
    });
    out.result(&value, || {
        let mut text = format!("{name}: arm {}, joints {}\n", arm.name, arm.joint_names.join(", "));
        for warning in &arm.warnings {
            text += &format!("  {warning}\n");
        }
        if !missing.is_empty() {
            text += &format!("not in a URDF, to be added to the file: {}\n", missing.join(", "));
        }
        text + &format!("look at it: jtc params show {name}")
    });
    Ok(())
}
