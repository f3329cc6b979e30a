//! Arms from URDF: six rotary joints in a chain and a fixed flange. The reader reports properties that the arm model
//! of the controller cannot represent.
//!
//! If the axis of a joint is not +z, the reader rotates the frame of its link. The rotation of the frame does not
//! change positions or torques. A body becomes part of the link that carries it in two cases: its joint is fixed, or
//! its joint is not one of the six joints of the arm.

mod choice;
mod frames;
mod hints;
mod limits;
mod mimic;
mod robot;
#[cfg(test)]
mod tests;
mod xml;
#[cfg(test)]
mod xml_tests;

use jtc_core::JOINTS;
use jtc_dynamics::{ArmModel, Link, Origin};

use self::choice::{about, choose, way_down};
use self::frames::{Body, Frame};
use self::limits::short;
use self::robot::{Joint, Kind, Robot};
use super::{Arm, ArmChoice, Change, Described, Lacking, Sources, Warning};
use crate::file::FileError;

/// Chain of joints with the bodies attached to it.
struct Chain<'a> {
    robot: &'a Robot,
    rotary: [&'a Joint; JOINTS],
    /// Joints on the path from the last link to the flange, in this order.
    flange: Vec<&'a Joint>,
    warnings: Vec<Warning>,
    sources: Sources,
    /// Masses and inertias that the description does not contain.
    lacking: Vec<Lacking>,
}

/// Standard gravity in the frame of the description, m/s². The gravity points downwards, because z of the description points upwards.
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// Reads the arm of a description. `choice` selects the six joints of the arm.
pub(super) fn read(text: &str, choice: &ArmChoice) -> Result<Described, FileError> {
    let robot = xml::read(text)?;
    let mut chain = Chain::of(&robot, choice)?;
    let model = chain.model()?;
    let joints = chain.limits()?;
    let mut link_names = vec![chain.rotary[0].parent.clone()];
    link_names.extend(chain.rotary.map(|j| j.child.clone()));
    let gravity = chain.gravity()?;
    let mut friction = [[0.0; 2]; JOINTS];
    for (to, joint) in friction.iter_mut().zip(chain.rotary) {
        *to = joint.friction()?;
    }
    let arm = Arm {
        name: robot.name.clone(),
        joint_names: chain.rotary.map(|j| j.name.clone()),
        link_names: link_names.try_into().unwrap_or_default(),
        flange_name: chain.flange.last().map_or_else(|| "flange".to_owned(), |j| j.name.clone()),
        model,
        joints,
        warnings: chain.warnings,
        sources: chain.sources,
        lacking: chain.lacking,
        // A URDF file does not contain values for the other fields of the arm.
        ..Arm::nameless()
    };
    Ok(Described { arm, gravity, friction })
}

impl<'a> Chain<'a> {
    fn of(robot: &'a Robot, choice: &ArmChoice) -> Result<Self, FileError> {
        let rotary = choose(robot, choice)?;
        let (warnings, sources) = (Vec::new(), Sources::default());
        let mut chain = Self { robot, rotary, flange: Vec::new(), warnings, sources, lacking: Vec::new() };
        chain.find_flange(choice.tip.as_deref());
        chain.hold_others()?;
        chain.doubt_gripper(choice);
        chain.doubt_axes()?;
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
        let words = format!("{} {}", last.name, last.child).to_lowercase();
        if choice.joints.is_none() && ["gripper", "jaw", "finger"].iter().any(|w| words.contains(w)) {
            let problem = "seems to move a gripper, by its name: it is driven as the sixth axis, because the description has no other";
            self.warn(Change::Doubtful, format!("joint {}", last.name), problem);
        }
    }

    /// Warns if one of the six joints has several axes that differ: the first axis is used.
    fn doubt_axes(&mut self) -> Result<(), FileError> {
        for joint in self.rotary {
            let axes: Vec<&str> = joint.axes().map(|axis| axis.text("xyz").unwrap_or("1 0 0")).collect();
            if let Some(other) = axes.iter().find(|axis| **axis != axes[0]) {
                let problem = format!(
                    "has {} axes: the first one, {}, is used, not {other}; remove the wrong one",
                    axes.len(),
                    axes[0]
                );
                self.warn(Change::Doubtful, format!("joint {}", joint.name), problem);
            }
        }
        Ok(())
    }

    /// Returns the acceleration of gravity in the base frame, m/s².
    fn gravity(&self) -> Result<[f64; 3], FileError> {
        let mut frame = Frame::IDENTITY;
        for joint in way_down(self.robot, &self.rotary[0].parent) {
            frame = self.held_frame(joint)?.then(&frame);
        }
        // The rounding error of a rotation by 90° is set to zero, because it would look like a tilt.
        Ok(frame.inverse().direction(&GRAVITY).map(|v| if v.abs() < 1e-9 { 0.0 } else { v }))
    }

    /// Returns the joints on the path from link `from` to link `to`, first to last. Returns `None` if one of the six joints of the arm is
    /// on this path, or if no path exists.
    fn rigid_path(&self, from: &str, to: &str) -> Option<Vec<&'a Joint>> {
        let mut path = Vec::new();
        let mut at = to;
        while at != from {
            let joint = self.robot.above(at)?;
            if !self.rigid(joint) || path.len() > self.robot.joints.len() {
                return None;
            }
            path.push(joint);
            at = &joint.parent;
        }
        path.reverse();
        Some(path)
    }

    fn model(&mut self) -> Result<ArmModel, FileError> {
        let mut model = ArmModel::default();
        let base = self.rotary[0].parent.clone();
        self.look_below(&base)?;
        // Rotation from the frame of the link in URDF to the frame of the link in the arm model.
        let mut turn = Frame::IDENTITY;
        model.links[0] = self.base(&base)?;
        for (i, joint) in self.rotary.into_iter().enumerate() {
            let from = if i == 0 { &base } else { &self.rotary[i - 1].child };
            let fixed = self.rigid_path(from, &joint.parent).unwrap_or_default();
            for f in fixed.iter().filter(|f| f.kind == Kind::Fixed) {
                let problem = format!("is fixed: merged into joint {}, which this joint carries", joint.name);
                self.warn(Change::Merged, format!("joint {}", f.name), problem);
            }
            let axis = joint.axis()?;
            let next = Frame::turning_z_to(axis).ok_or_else(|| {
                about(joint, format!("axis {} {} {} has no direction", axis[0], axis[1], axis[2]))
            })?;
            let plain = fixed.is_empty() && turn.is_identity() && next.is_identity();
            model.joints[i] = if plain {
                joint.origin()?
            } else {
                let mut frame = turn.inverse();
                for f in fixed {
                    frame = frame.then(&self.held_frame(f)?);
                }
                frame.then(&Frame::of(&joint.origin()?)).then(&next).origin()
            };
            if !next.is_identity() {
                let problem = format!(
                    "axis {} {} {} is not +z: the frame of its link is turned; positions and torques keep their sign",
                    axis[0], axis[1], axis[2]
                );
                self.warn(Change::AxisTurned, format!("joint {}", joint.name), problem);
            }
            turn = next;
            model.links[i + 1] = self.link(i + 1, &joint.child, &turn)?;
        }
        model.joints[JOINTS] = match self.flange.as_slice() {
            [flange] if turn.is_identity() && flange.kind == Kind::Fixed => flange.origin()?,
            way => {
                let mut frame = turn.inverse();
                for joint in way {
                    frame = frame.then(&self.held_frame(joint)?);
                }
                frame.origin()
            }
        };
        Ok(model)
    }

    /// Warns about each joint between the base of the arm and the root of the description that has an offset. Such a
    /// joint does not move, but its offset changes the position of the base.
    fn look_below(&mut self, base: &str) -> Result<(), FileError> {
        for joint in way_down(self.robot, base) {
            let o = self.held_frame(joint)?.plain_origin(joint.origin()?);
            if o != Origin::default() {
                let problem = format!(
                    "its offset (xyz {:?} rpy {:?}) is not imported: positions refer to link {base}; gravity is a setting of the controller",
                    o.xyz.map(short),
                    o.rpy.map(short)
                );
                self.warn(Change::Base, format!("joint {}", joint.name), problem);
            }
        }
        Ok(())
    }

    /// Returns the body of the base. The base does not move, so a body that cannot exist does not matter: it is left
    /// out with a warning.
    fn base(&mut self, name: &str) -> Result<Link, FileError> {
        let mut body = self.link(0, name, &Frame::IDENTITY)?;
        let problem = |body: &Link| {
            let good = Arm::avena().model;
            let mut links = good.links;
            links[0] = *body;
            ArmModel { links, ..good }.check().err()
        };
        if let Some(error) = problem(&body) {
            let text = error.to_string();
            let what = text.split_once(": ").map_or(text.as_str(), |(_, what)| what);
            body.inertia = [0.0; 6];
            let whole = problem(&body).is_some();
            if whole {
                body = Link::default();
            }
            let left_out = if whole { "its mass and inertia are" } else { "its inertia is" };
            let problem = format!("{what}: {left_out} left out, because the base does not move");
            self.warn(Change::NotCarried, format!("link {name}"), problem);
        }
        Ok(body)
    }

    /// Returns a link in the rotated frame. The link includes all bodies that are attached to it by joints other than the six joints of the
    /// arm.
    fn link(&mut self, index: usize, name: &str, turn: &Frame) -> Result<Link, FileError> {
        let mut bodies = Vec::new();
        let mut pointlike = Vec::new();
        let mut todo = vec![(name.to_owned(), Frame::IDENTITY)];
        while let Some((at, frame)) = todo.pop() {
            let link = self.robot.link(&at).ok_or_else(|| {
                FileError::form(format!("link {at} is named by a joint, but does not exist"))
            })?;
            let own = link.body()?;
            if own.mass != 0.0 && !link.has_inertia()? {
                pointlike.push(at.clone());
            }
            if at != name && own.mass != 0.0 {
                let problem = format!("{} kg: merged into link {name}", own.mass);
                self.warn(Change::Merged, format!("link {at}"), problem);
            }
            if at == name || own.mass != 0.0 {
                bodies.push((own, frame.clone()));
            }
            for joint in self.robot.on(&at).filter(|joint| self.rigid(joint)) {
                todo.push((joint.child.clone(), frame.then(&self.held_frame(joint)?)));
            }
        }
        let whole = if bodies.len() == 1 && turn.is_identity() {
            bodies[0].0
        } else {
            let mut whole = Body::NONE;
            for (link, frame) in &bodies {
                whole.add(&Body::of(link).seen_from(&turn.inverse().then(frame)));
            }
            whole.link()
        };
        self.find_lacking(index, name, &whole, &pointlike);
        Ok(whole)
    }

    /// Finds the mass and the inertia that the description does not contain. The base and the last link may be
    /// without a body.
    fn find_lacking(&mut self, index: usize, name: &str, whole: &Link, pointlike: &[String]) {
        if index == 0 {
            return;
        }
        if whole.mass == 0.0 && index < JOINTS {
            self.lacking.push(Lacking::Mass(index));
            self.lacking.push(Lacking::Inertia(index));
        } else if pointlike.iter().any(|link| link == name) {
            self.lacking.push(Lacking::Inertia(index));
        }
        for link in pointlike.iter().filter(|link| *link != name) {
            let problem = format!("has a mass but no inertia: merged into link {name} as a point mass");
            self.warn(Change::Doubtful, format!("link {link}"), problem);
        }
    }
}
