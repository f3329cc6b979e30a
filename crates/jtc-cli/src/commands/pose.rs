//! `jtc pose`: lists and saves named positions in the arm file.

use std::path::Path;

use cli_kit::{Failure, Output};
use jtc_host::arm::{Arm, remove_pose, save_pose};
use serde_json::json;

use super::arm::poses_table;
use super::job::typed;
use crate::args::{LinkArgs, PoseCommand};

/// Runs a `jtc pose` command.
pub(super) fn pose(command: &PoseCommand, out: &Output) -> Result<(), Failure> {
    match command {
        PoseCommand::Save { name, arm, link, overwrite } => save(name, &arm.arm, link, *overwrite, out),
        PoseCommand::List { arm, deg } => list(&arm.arm, *deg, out),
        PoseCommand::Remove { name, arm } => {
            remove_pose(&arm.arm, name)?;
            let value = json!({ "name": name, "file": arm.arm, "removed": true });
            out.result(&value, || format!("{}: pose {name} removed", arm.arm.display()));
            Ok(())
        }
    }
}

fn save(name: &str, file: &Path, link: &LinkArgs, overwrite: bool, out: &Output) -> Result<(), Failure> {
    // The name and the file are checked first, because this check needs no controller.
    let arm = Arm::load(file)?;
    if arm.poses.contains_key(name) && !overwrite {
        let path = file.to_owned();
        return Err(jtc_host::arm::PoseError::Exists { path, name: name.into() }.into());
    }
    let position = link.session()?.standing()?.positions();
    save_pose(file, name, &position, overwrite)?;
    let arm = Arm::load(file)?;
    let saved = arm.poses.get(name).copied().unwrap_or(position);
    // The command still saves a pose outside the limits, because the limits may be wrong.
    if let Err(outside) = arm.pose(name) {
        out.note(format!("warning: {outside}: the arm cannot move there"));
    }
    out.result(&json!({ "name": name, "file": file, "position_rad": saved }), || {
        let cells = saved.map(|v| format!("{v:.4}")).join(", ");
        format!(
            "{}: pose {name} at {cells} rad\nnext: jtc move --to {name} --arm {}",
            file.display(),
            typed(file)
        )
    });
    Ok(())
}

fn list(file: &Path, deg: bool, out: &Output) -> Result<(), Failure> {
    let arm = Arm::load(file)?;
    out.result(&json!({ "file": file, "arm": arm.name, "poses_rad": arm.poses }), || {
        if arm.poses.is_empty() {
            return format!(
                "{}: arm {} has no poses; jtc pose save NAME --arm {} saves the present pose",
                file.display(),
                arm.name,
                typed(file)
            );
        }
        poses_table(&arm, deg)
    });
    Ok(())
}
