//! Selection of the arm's six joints in a robot description.
//!
//! Terms: a *rotary* joint is a revolute or a continuous joint. A *held* joint can move but is not one of the six joints of the arm. The
//! importer treats a held joint as fixed at position 0. Examples of held joints are the finger of a gripper, the wheel of a cart, and the
//! seventh joint of a redundant arm.

use jtc_core::JOINTS;

use super::hints::not_six;
use super::robot::{Joint, Kind, Robot};
use crate::arm::ArmChoice;
use crate::file::{FileError, Place};

/// Returns the six joints of the arm, base to wrist. Each joint is attached to the previous joint.
pub(super) fn choose<'a>(robot: &'a Robot, choice: &ArmChoice) -> Result<[&'a Joint; JOINTS], FileError> {
    no_loops(robot)?;
    let candidates: Vec<&Joint> = match (&choice.joints, &choice.tip) {
        (Some(names), _) => named(robot, names)?,
        (None, Some(tip)) => moving(robot, way_to(robot, tip)?),
        (None, None) => moving(robot, robot.joints.iter().collect()),
    };
    let six = <[&Joint; JOINTS]>::try_from(candidates.as_slice()).ok();
    let six = six.filter(|six| six.iter().all(|j| j.kind.is_rotary()) && first_branch(robot, six).is_none());
    let Some(six) = six else { return Err(not_six(robot, &candidates, choice)) };
    if let Some(joint) = six.iter().find(|j| j.is_mimic()) {
        return Err(unfit_joint(
            joint,
            "follows another joint (mimic), so it cannot be one of the six driven joints",
        ));
    }
    if let Some(tip) = &choice.tip
        && !way_to(robot, tip)?.iter().any(|j| j.name == six[JOINTS - 1].name)
    {
        let last = &six[JOINTS - 1].name;
        return Err(unfit(format!("link {tip} is not carried by joint {last}, the last of the six")));
    }
    Ok(six)
}

/// Returns an error about a joint of the description.
pub(super) fn about(joint: &Joint, problem: impl Into<String>) -> FileError {
    FileError::at(Place::name(format!("joint {}", joint.name)), problem)
}

/// Returns an error about the joints or links that the user selected.
pub(super) fn unfit(problem: impl Into<String>) -> FileError {
    FileError::choice(Place::default(), problem)
}

fn unfit_joint(joint: &Joint, problem: impl Into<String>) -> FileError {
    FileError::choice(Place::name(format!("joint {}", joint.name)), problem)
}

/// Returns the joints between `link` and the root, beginning at `link`. The description must not contain loops.
pub(super) fn way_down<'a>(robot: &'a Robot, link: &str) -> impl Iterator<Item = &'a Joint> {
    std::iter::successors(robot.above(link), |j| robot.above(&j.parent))
}

/// Checks that the description does not contain a loop. Without loops, each chain of parent links ends at a root.
fn no_loops(robot: &Robot) -> Result<(), FileError> {
    for joint in &robot.joints {
        let mut at = joint;
        for depth in 0.. {
            let Some(parent) = robot.above(&at.parent) else { break };
            at = parent;
            if depth > robot.joints.len() {
                return Err(about(joint, "its chain of parents forms a loop"));
            }
        }
    }
    Ok(())
}

/// Returns the joints from the root to `link`, in this order.
fn way_to<'a>(robot: &'a Robot, link: &str) -> Result<Vec<&'a Joint>, FileError> {
    if robot.link(link).is_none() {
        let links: Vec<&str> = robot.links.iter().map(|l| l.name.as_str()).collect();
        return Err(unfit(format!("link {link} does not exist; the links are {}", links.join(", "))));
    }
    let mut way: Vec<&Joint> = way_down(robot, link).collect();
    way.reverse();
    Ok(way)
}

/// Returns the joints that can move independently, beginning at the root. Fixed joints and joints that mimic another joint are not
/// included.
fn moving<'a>(robot: &'a Robot, joints: Vec<&'a Joint>) -> Vec<&'a Joint> {
    let driven = |j: &&Joint| j.kind != Kind::Fixed && !j.is_mimic();
    let mut joints: Vec<&Joint> = joints.into_iter().filter(driven).collect();
    joints.sort_by_cached_key(|j| way_down(robot, &j.parent).count());
    joints
}

/// Returns the joints with the names that the user has selected.
fn named<'a>(robot: &'a Robot, wanted: &[String]) -> Result<Vec<&'a Joint>, FileError> {
    let find = |name: &String| -> Result<&'a Joint, FileError> {
        let joint = robot.joint(name).ok_or_else(|| {
            let others = names(&moving(robot, robot.joints.iter().collect())).join(", ");
            unfit(format!("joint {name} does not exist; the moving joints are {others}"))
        })?;
        match joint.kind.is_rotary() {
            true => Ok(joint),
            false => Err(unfit_joint(joint, format!("is {}, not rotary", joint.kind.name()))),
        }
    };
    let joints = wanted.iter().map(find).collect::<Result<Vec<_>, _>>()?;
    if joints.len() != JOINTS {
        return Err(unfit(format!("{} joints are named, expected six", joints.len())));
    }
    if let Some(joint) = first_branch(robot, &joints) {
        return Err(unfit_joint(joint, "is not carried by the joint named before it"));
    }
    Ok(joints)
}

/// Returns the first joint that does not descend from the previous joint in the list.
fn first_branch<'a>(robot: &'a Robot, joints: &[&'a Joint]) -> Option<&'a Joint> {
    joints.windows(2).map(|pair| (pair[0], pair[1])).find_map(|(below, joint)| {
        (!way_down(robot, &joint.parent).any(|j| j.name == below.name)).then_some(joint)
    })
}

pub(super) fn names<'a>(joints: &[&'a Joint]) -> Vec<&'a str> {
    joints.iter().map(|j| j.name.as_str()).collect()
}
