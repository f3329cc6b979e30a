//! `jtc pose`: named positions in the arm file.

use std::path::Path;
use std::time::Duration;

use cli_kit::{ErrorKind, Failure, Output};
use jtc_host::arm::{Arm, remove_pose, save_pose};
use jtc_host::{Session, sample, words};
use jtc_wire::{Joint, Status};
use serde_json::json;

use super::arm::poses_table;
use super::job::typed;
use crate::args::{LinkArgs, PoseCommand};
use crate::link::LinkPort;

/// What moves by less than this within [`WATCHED`] stands, rad: the slowest jog moves twice as far.
const STILL: f64 = 1.2e-3;
/// So long the arm is watched: a slow jog is in no status.
const WATCHED: Duration = Duration::from_millis(250);

/// Does one of the family.
pub fn pose(command: &PoseCommand, out: &Output) -> Result<(), Failure> {
    match command {
        PoseCommand::Save { name, arm, link, force } => save(name, &arm.arm, link, *force, out),
        PoseCommand::List { arm, deg } => list(&arm.arm, *deg, out),
        PoseCommand::Remove { name, arm } => {
            remove_pose(&arm.arm, name)?;
            let value = json!({ "name": name, "file": arm.arm, "removed": true });
            out.result(&value, || format!("{}: pose {name} removed", arm.arm.display()));
            Ok(())
        }
    }
}

fn save(name: &str, file: &Path, link: &LinkArgs, force: bool, out: &Output) -> Result<(), Failure> {
    // Before the controller is asked: what is wrong with name or file is wrong without it.
    let arm = Arm::load(file)?;
    if arm.poses.contains_key(name) && !force {
        let path = file.to_owned();
        return Err(jtc_host::arm::PoseError::Exists { path, name: name.into() }.into());
    }
    let position = standing(&mut link.session()?)?.positions();
    save_pose(file, name, &position, force)?;
    let arm = Arm::load(file)?;
    let saved = arm.poses.get(name).copied().unwrap_or(position);
    // Saved all the same: limits may be what is wrong.
    if let Err(outside) = arm.pose(name) {
        out.note(format!("warning: {outside}: no motion leads there"));
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

/// The arm stands, for as long as it is watched; else where it moves is the reason why nothing is saved.
fn standing(session: &mut Session<LinkPort>) -> Result<Status, Failure> {
    let begin = session.fresh_status()?;
    let (start, mut now) = (session.now(), begin);
    loop {
        stands(&begin, &now)?;
        if session.now() - start >= WATCHED {
            return Ok(now);
        }
        now = session.next_status()?;
    }
}

fn stands(begin: &Status, now: &Status) -> Result<(), Failure> {
    let moving = |what: String| {
        let message = format!("{what}, and a pose is where the arm stands; nothing was saved");
        Err(Failure::new(ErrorKind::Refused, "moving", message)
            .hint("wait until it stands, or `jtc traj pause`"))
    };
    // Also where it begins, turns round or ends, and has no speed for a moment.
    if now.is_executing() {
        return moving("the arm is on the path of a trajectory".into());
    }
    for joint in Joint::ALL {
        let j = joint.index();
        if !sample::is_measured(now, j) || words::is_absent(now, j) {
            let message = format!("{joint}: its position is not known; nothing was saved");
            return Err(Failure::new(ErrorKind::Device, "not-measured", message)
                .hint("`jtc status` shows the joints, `jtc recover` brings them up"));
        }
    }
    if let Some((joint, speed)) = words::moving_joint(now) {
        return moving(format!("{joint} moves at {speed:.2} rad/s"));
    }
    for joint in Joint::ALL {
        let j = joint.index();
        let way = now.positions()[j] - begin.positions()[j];
        if way.abs() > STILL {
            return moving(format!("{joint} moves slowly, by {:.1} mrad since a moment ago", way * 1e3));
        }
    }
    Ok(())
}

fn list(file: &Path, deg: bool, out: &Output) -> Result<(), Failure> {
    let arm = Arm::load(file)?;
    out.result(&json!({ "file": file, "arm": arm.name, "poses_rad": arm.poses }), || {
        if arm.poses.is_empty() {
            return format!(
                "{}: arm {} has no poses; jtc pose save NAME --arm {} saves where the arm is",
                file.display(),
                arm.name,
                typed(file)
            );
        }
        poses_table(&arm, deg)
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use jtc_wire::TrajectoryState;

    use super::*;

    /// A slow jog is in no field of the status: places that differ show it.
    #[test]
    fn an_arm_that_is_jogged_slowly_does_not_stand() {
        let at = |q: f32| {
            let mut status = Status::default();
            status.joints[3].position = q;
            status.joints.iter_mut().for_each(|joint| joint.velocity = 0.01);
            status
        };
        stands(&at(0.5), &at(0.5005)).unwrap();
        for (begin, now) in [(0.5, 0.5025), (0.5025, 0.5)] {
            let failure = stands(&at(begin), &at(now)).unwrap_err();
            assert!(failure.message.starts_with("joint 4 moves slowly"), "{}", failure.message);
        }
        let executing = Status { trajectory: TrajectoryState::Execute.into(), ..at(0.5) };
        assert_eq!(stands(&executing, &executing).unwrap_err().kind, ErrorKind::Refused);
        // Led by hand, or paused, it may stand.
        stands(&at(0.5), &Status { trajectory: TrajectoryState::Pause.into(), ..at(0.5) }).unwrap();
    }
}
