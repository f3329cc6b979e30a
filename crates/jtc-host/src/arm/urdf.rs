//! Arms from URDF: six rotary joints in a chain and a fixed flange. The reader reports properties that the arm model
//! of the controller cannot represent.
//!
//! If the axis of a joint is not +z, the reader rotates the frame of its link. The rotation of the frame does not
//! change positions or torques. A body becomes part of the link that carries it in two cases: its joint is fixed, or
//! its joint is not one of the six joints of the arm.

mod choice;
mod frames;
mod limits;
#[cfg(test)]
mod tests;
mod text;

use jtc_core::JOINTS;
use jtc_dynamics::{ArmModel, Link, Origin};
use urdf_rs::{Joint, JointType, Robot};

use self::choice::{about, choose};
use self::frames::{Body, Frame};
use self::limits::short;
use super::{Arm, ArmChoice, Change, Described, Sources, Warning};
use crate::file::FileError;

/// Chain of joints with the bodies attached to it.
struct Chain<'a> {
    robot: &'a Robot,
    rotary: [&'a Joint; JOINTS],
    /// Joints on the path from the last link to the flange, in this order.
    flange: Vec<&'a Joint>,
    warnings: Vec<Warning>,
    sources: Sources,
    /// Names of the joints without position limits.
    without_ranges: Vec<String>,
}

/// Standard gravity in the frame of the description, m/s². The gravity points downwards, because z of the description points upwards.
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// Reads the arm of a description. `choice` selects the six joints of the arm.
pub(super) fn read(text: &str, choice: &ArmChoice) -> Result<Described, FileError> {
    text::check_depth(text)?;
    let text = text::with_velocities(text);
    let robot = urdf_rs::read_from_string(&text).map_err(|e| text::locate(&text, &e.to_string()))?;
    only_once(&robot)?;
    let mut chain = Chain::of(&robot, choice)?;
    chain.without_ranges = text::without_ranges(&text);
    let model = chain.model()?;
    let joints = chain.limits()?;
    let mut link_names = vec![chain.rotary[0].parent.link.clone()];
    link_names.extend(chain.rotary.map(|j| j.child.link.clone()));
    let gravity = chain.gravity();
    let friction = chain.rotary.map(|j| {
        let given = j.dynamics.as_ref().map_or([0.0; 2], |d| [d.friction, d.damping]);
        given.map(|v| if v > 0.0 && v.is_finite() { v } else { 0.0 })
    });
    let arm = Arm {
        name: robot.name.clone(),
        joint_names: chain.rotary.map(|j| j.name.clone()),
        link_names: link_names.try_into().unwrap_or_default(),
        flange_name: chain.flange.last().map_or_else(|| "flange".to_owned(), |j| j.name.clone()),
        model,
        joints,
        warnings: chain.warnings,
        sources: chain.sources,
        // A URDF file does not contain values for the other fields of the arm.
        ..Arm::nameless()
    };
    Ok(Described { arm, gravity, friction })
}

/// Checks that joint names and link names are unique, and that no link has two parents. The reader rejects a
/// duplicate name, because it cannot know which of the two joints or links is meant.
fn only_once(robot: &Robot) -> Result<(), FileError> {
    fn twice(mut names: Vec<&str>) -> Option<&str> {
        names.sort_unstable();
        names.windows(2).find(|pair| pair[0] == pair[1]).map(|pair| pair[0])
    }
    if let Some(name) = twice(robot.joints.iter().map(|j| j.name.as_str()).collect()) {
        return Err(FileError::form(format!("two joints are named {name}: rename one of them")));
    }
    if let Some(name) = twice(robot.links.iter().map(|l| l.name.as_str()).collect()) {
        return Err(FileError::form(format!("two links are named {name}: rename one of them")));
    }
    if let Some(name) = twice(robot.joints.iter().map(|j| j.child.link.as_str()).collect()) {
        let parents: Vec<&str> =
            robot.joints.iter().filter(|j| j.child.link == name).map(|j| j.name.as_str()).collect();
        return Err(FileError::form(format!(
            "link {name} is the child of joints {}, expected only one parent joint",
            parents.join(" and ")
        )));
    }
    Ok(())
}

impl<'a> Chain<'a> {
    fn of(robot: &'a Robot, choice: &ArmChoice) -> Result<Self, FileError> {
        let rotary = choose(robot, choice)?;
        let (warnings, sources) = (Vec::new(), Sources::default());
        let mut chain =
            Self { robot, rotary, flange: Vec::new(), warnings, sources, without_ranges: Vec::new() };
        chain.find_flange(choice.tip.as_deref());
        for joint in &robot.joints {
            if joint.joint_type != JointType::Fixed && chain.rigid(joint) {
                let kind = format!("{:?}", joint.joint_type).to_lowercase();
                let follows =
                    joint.mimic.as_ref().map_or(String::new(), |m| format!(", follows {}", m.joint));
                let problem =
                    format!("{kind}{follows}: is held at 0, because it is not one of the six joints");
                chain.warn(Change::LeftOut, format!("joint {}", joint.name), problem);
            }
        }
        chain.doubt_gripper(choice);
        Ok(chain)
    }

    /// Returns `true` if the joint is not one of the six joints of the arm. The importer treats such a joint as fixed.
    fn rigid(&self, joint: &Joint) -> bool {
        !self.rotary.iter().any(|r| r.name == joint.name)
    }

    fn warn(&mut self, change: Change, place: impl Into<String>, problem: impl Into<String>) {
        self.warnings.push(Warning::new(change, place, problem));
    }

    /// Warns if the sixth joint may be a gripper: an arm with five axes and a gripper also has six joints.
    fn doubt_gripper(&mut self, choice: &ArmChoice) {
        let last = self.rotary[JOINTS - 1];
        let words = format!("{} {}", last.name, last.child.link).to_lowercase();
        if choice.joints.is_none() && ["gripper", "jaw", "finger"].iter().any(|w| words.contains(w)) {
            let problem = "seems to move a gripper, by its name: it is driven as the sixth axis, because the description has no other";
            self.warn(Change::Doubtful, format!("joint {}", last.name), problem);
        }
    }

    /// Returns the acceleration of gravity in the base frame, m/s².
    fn gravity(&self) -> [f64; 3] {
        let mut frame = Frame::IDENTITY;
        let mut at = &self.rotary[0].parent.link;
        while let Some(joint) = self.robot.joints.iter().find(|j| &j.child.link == at) {
            frame = Frame::of(&origin(&joint.origin)).then(&frame);
            at = &joint.parent.link;
        }
        // The rounding error of a rotation by 90° is set to zero, because it would look like a tilt.
        frame.inverse().direction(&GRAVITY).map(|v| if v.abs() < 1e-9 { 0.0 } else { v })
    }

    /// Finds the joints from the last link to the flange. With `tip`, these are the joints on the path to the link
    /// `tip`. Without `tip`, this is one fixed joint on the last link: the joint with a usual flange name, or else
    /// the first fixed joint.
    fn find_flange(&mut self, tip: Option<&str>) {
        let last = &self.rotary[JOINTS - 1].child.link;
        if let Some(way) = tip.and_then(|tip| self.rigid_path(last, tip)) {
            self.flange = way;
            return;
        }
        let fixed = |j: &&Joint| &j.parent.link == last && j.joint_type == JointType::Fixed;
        let behind: Vec<&Joint> = self.robot.joints.iter().filter(fixed).collect();
        let named = |j: &&&Joint| {
            let words = format!("{} {}", j.name, j.child.link).to_lowercase();
            ["flange", "gripper", "tool0", "joint_7"].iter().any(|w| words.contains(w))
        };
        let flange = behind.iter().find(named).or(behind.first()).copied();
        self.flange = flange.into_iter().collect();
        match flange {
            None => {
                let problem = "carries no fixed flange joint: the flange has the frame of this link";
                self.warn(Change::Flange, format!("link {last}"), problem);
            }
            Some(flange) if behind.len() > 1 => {
                let others: Vec<&str> =
                    behind.iter().filter(|j| j.name != flange.name).map(|j| j.name.as_str()).collect();
                let problem = format!(
                    "is used as the flange, not {}; `jtc arm import` selects another with --tip",
                    others.join(", ")
                );
                self.warn(Change::Flange, format!("joint {}", flange.name), problem);
            }
            Some(_) => {}
        }
    }

    /// Returns the joints on the path from link `from` to link `to`, first to last. Returns `None` if one of the six joints of the arm is
    /// on this path, or if no path exists.
    fn rigid_path(&self, from: &str, to: &str) -> Option<Vec<&'a Joint>> {
        let mut path = Vec::new();
        let mut at = to;
        while at != from {
            let joint = self.robot.joints.iter().find(|j| j.child.link == at)?;
            if !self.rigid(joint) || path.len() > self.robot.joints.len() {
                return None;
            }
            path.push(joint);
            at = &joint.parent.link;
        }
        path.reverse();
        Some(path)
    }

    fn model(&mut self) -> Result<ArmModel, FileError> {
        let mut model = ArmModel::default();
        let base = self.rotary[0].parent.link.clone();
        self.look_below(&base);
        // Rotation from the frame of the link in URDF to the frame of the link in the arm model.
        let mut turn = Frame::IDENTITY;
        model.links[0] = self.link(&base, &turn)?;
        for (i, joint) in self.rotary.into_iter().enumerate() {
            let from = if i == 0 { &base } else { &self.rotary[i - 1].child.link };
            let fixed = self.rigid_path(from, &joint.parent.link).unwrap_or_default();
            for f in fixed.iter().filter(|f| f.joint_type == JointType::Fixed) {
                let problem = format!("is fixed: merged into joint {}, which this joint carries", joint.name);
                self.warn(Change::Merged, format!("joint {}", f.name), problem);
            }
            let axis = joint.axis.xyz.0;
            let next = Frame::turning_z_to(axis).ok_or_else(|| {
                about(joint, format!("axis {} {} {} has no direction", axis[0], axis[1], axis[2]))
            })?;
            let plain = fixed.is_empty() && turn.is_identity() && next.is_identity();
            model.joints[i] = if plain {
                origin(&joint.origin)
            } else {
                let mut frame = turn.inverse();
                for f in fixed.into_iter().chain([joint]) {
                    frame = frame.then(&Frame::of(&origin(&f.origin)));
                }
                frame.then(&next).origin()
            };
            if !next.is_identity() {
                let problem = format!(
                    "axis {} {} {} is not +z: the frame of its link is turned; positions and torques keep their sign",
                    axis[0], axis[1], axis[2]
                );
                self.warn(Change::AxisTurned, format!("joint {}", joint.name), problem);
            }
            turn = next;
            model.links[i + 1] = self.link(&joint.child.link, &turn)?;
        }
        model.joints[JOINTS] = match self.flange.as_slice() {
            [flange] if turn.is_identity() => origin(&flange.origin),
            way => {
                let place = |frame: Frame, joint: &&Joint| frame.then(&Frame::of(&origin(&joint.origin)));
                way.iter().fold(turn.inverse(), place).origin()
            }
        };
        Ok(model)
    }

    /// Warns about each joint between the base of the arm and the root of the description that has an offset. Such a
    /// joint does not move, but its offset changes the position of the base.
    fn look_below(&mut self, base: &str) {
        let mut at = base.to_owned();
        for _ in 0..self.robot.joints.len() {
            let Some(joint) = self.robot.joints.iter().find(|j| j.child.link == at) else { return };
            let o = origin(&joint.origin);
            if o != Origin::default() {
                let problem = format!(
                    "its offset (xyz {:?} rpy {:?}) is not imported: positions refer to link {base}; gravity is a setting of the controller",
                    o.xyz.map(short),
                    o.rpy.map(short)
                );
                self.warn(Change::Base, format!("joint {}", joint.name), problem);
            }
            at = joint.parent.link.clone();
        }
    }

    /// Returns a link in the rotated frame. The link includes all bodies that are attached to it by joints other than the six joints of the
    /// arm.
    fn link(&mut self, name: &str, turn: &Frame) -> Result<Link, FileError> {
        let mut bodies = Vec::new();
        let mut todo = vec![(name.to_owned(), Frame::IDENTITY)];
        while let Some((at, frame)) = todo.pop() {
            let found = self.robot.links.iter().find(|l| l.name == at);
            let link = found.ok_or_else(|| {
                FileError::form(format!("link {at} is named by a joint, but does not exist"))
            })?;
            let inertial = &link.inertial;
            let i = &inertial.inertia;
            let own = Link {
                origin: origin(&inertial.origin),
                inertia: [i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz],
                mass: inertial.mass.value,
            };
            if at != name && own.mass != 0.0 {
                let problem = format!("{} kg: merged into link {name}", own.mass);
                self.warn(Change::Merged, format!("link {at}"), problem);
            }
            if at == name || own.mass != 0.0 {
                bodies.push((own, frame.clone()));
            }
            if bodies.len() + todo.len() > self.robot.links.len() {
                return Err(FileError::form(format!("fixed joints at link {at} form a loop")));
            }
            for joint in &self.robot.joints {
                if joint.parent.link == at && self.rigid(joint) {
                    todo.push((joint.child.link.clone(), frame.then(&Frame::of(&origin(&joint.origin)))));
                }
            }
        }
        if bodies.len() == 1 && turn.is_identity() {
            return Ok(bodies[0].0);
        }
        let mut whole = Body::NONE;
        for (link, frame) in &bodies {
            whole.add(&Body::of(link).seen_from(&turn.inverse().then(frame)));
        }
        Ok(whole.link())
    }
}

fn origin(pose: &urdf_rs::Pose) -> Origin {
    Origin { xyz: pose.xyz.0, rpy: pose.rpy.0 }
}
