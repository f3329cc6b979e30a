//! Arms from URDF: six revolute joints in a chain and a fixed flange; what the controller's arm model cannot carry is reported.
//!
//! Joints about another axis than +z are carried by turning the frames of their links, which changes neither positions nor
//! torques. Bodies behind fixed joints become part of the link that carries them.

use jtc_core::{Config, JOINTS, JointConfig};
use jtc_dynamics::{ArmModel, Link, Origin};
use urdf_rs::{Joint, JointType, Robot};

use super::frames::{Body, Frame};
use super::{Arm, Warning};
use crate::file::{FileError, Place};

/// Deeper nesting than any description of an arm has.
const DEPTH_MAX: usize = 32;

/// The chain of joints with what hangs on it.
struct Chain<'a> {
    robot: &'a Robot,
    revolute: [&'a Joint; JOINTS],
    flange: Option<&'a Joint>,
    warnings: Vec<Warning>,
}

impl Arm {
    /// From the text of a URDF file.
    pub fn from_urdf(text: &str) -> Result<Self, FileError> {
        let depth = depth(text);
        if depth > DEPTH_MAX {
            return Err(FileError::form(format!("XML nested {depth} deep is no description of an arm")));
        }
        let robot = urdf_rs::read_from_string(text).map_err(|e| FileError::form(format!("URDF: {e}")))?;
        let mut chain = Chain::of(&robot)?;
        let model = chain.model()?;
        let limits = chain.limits()?;
        Ok(Arm {
            name: robot.name.clone(),
            joint_names: chain.revolute.map(|j| j.name.clone()),
            model,
            joints: limits,
            // The form has no place for it.
            rotors_given: [false; JOINTS],
            gravity: None,
            pid: None,
            polynomial: None,
            table: None,
            warnings: chain.warnings,
        })
    }
}

/// Deepest nesting of elements; the reader descends by recursion.
fn depth(text: &str) -> usize {
    let (mut now, mut most) = (0usize, 0);
    for (i, _) in text.match_indices('<') {
        match text.as_bytes().get(i + 1) {
            Some(b'/') => now = now.saturating_sub(1),
            Some(b'!' | b'?') | None => {}
            Some(_) => {
                let end = text[i..].find('>').map_or(text.len(), |e| i + e);
                if !text[..end].ends_with('/') {
                    now += 1;
                }
                most = most.max(now);
            }
        }
    }
    most
}

fn about(joint: &Joint, problem: impl Into<String>) -> FileError {
    FileError::at(Place::name(format!("joint {}", joint.name)), problem)
}

impl<'a> Chain<'a> {
    fn of(robot: &'a Robot) -> Result<Self, FileError> {
        let above = |link: &str| robot.joints.iter().find(|j| j.child.link == link);
        let mut revolute: Vec<(usize, &Joint)> = Vec::new();
        for joint in &robot.joints {
            match joint.joint_type {
                JointType::Revolute => {}
                JointType::Fixed => continue,
                ref other => {
                    let problem =
                        format!("{other:?} joints are not possible: six revolute ones and fixed ones are");
                    return Err(about(joint, problem.to_lowercase()));
                }
            }
            // Joints above it; a loop of joints never ends.
            let mut depth = 0;
            let mut at = joint;
            while let Some(parent) = above(&at.parent.link) {
                depth += 1;
                at = parent;
                if depth > robot.joints.len() {
                    return Err(about(joint, "its chain of parents is a loop"));
                }
            }
            revolute.push((depth, joint));
        }
        revolute.sort_by_key(|(depth, _)| *depth);
        let joints: Vec<&Joint> = revolute.into_iter().map(|(_, j)| j).collect();
        let Ok(revolute) = <[&Joint; JOINTS]>::try_from(joints.as_slice()) else {
            let names: Vec<&str> = joints.iter().map(|j| j.name.as_str()).collect();
            return Err(FileError::form(format!(
                "{} revolute joints ({}), not 6",
                names.len(),
                names.join(", ")
            )));
        };
        let mut chain = Self { robot, revolute, flange: None, warnings: Vec::new() };
        for pair in revolute.windows(2) {
            if chain.fixed_path(&pair[0].child.link, &pair[1].parent.link).is_none() {
                return Err(about(pair[1], format!("is not carried by joint {}", pair[0].name)));
            }
        }
        chain.find_flange();
        Ok(chain)
    }

    fn warn(&mut self, place: impl Into<String>, problem: impl Into<String>) {
        self.warnings.push(Warning { place: place.into(), problem: problem.into() });
    }

    /// The fixed joint behind the last link; of several the one whose name says so, else the first.
    fn find_flange(&mut self) {
        let last = &self.revolute[JOINTS - 1].child.link;
        let behind: Vec<&Joint> = self.robot.joints.iter().filter(|j| &j.parent.link == last).collect();
        let named = |j: &&&Joint| {
            let words = format!("{} {}", j.name, j.child.link).to_lowercase();
            ["flange", "gripper", "tool0", "joint_7"].iter().any(|w| words.contains(w))
        };
        self.flange = behind.iter().find(named).or(behind.first()).copied();
        match self.flange {
            None => self
                .warn(format!("link {last}"), "no fixed flange joint behind it: the flange is its own frame"),
            Some(flange) if behind.len() > 1 => {
                let others: Vec<&str> =
                    behind.iter().filter(|j| j.name != flange.name).map(|j| j.name.as_str()).collect();
                let problem = format!("is taken as the flange, not {}", others.join(", "));
                self.warn(format!("joint {}", flange.name), problem);
            }
            Some(_) => {}
        }
    }

    /// Fixed joints on the way from link `from` to link `to`, first to last.
    fn fixed_path(&self, from: &str, to: &str) -> Option<Vec<&'a Joint>> {
        let mut path = Vec::new();
        let mut at = to;
        while at != from {
            let joint = self.robot.joints.iter().find(|j| j.child.link == at)?;
            if joint.joint_type != JointType::Fixed || path.len() > self.robot.joints.len() {
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
        let base = self.revolute[0].parent.link.clone();
        self.look_below(&base);
        // Turn of each link's frame against URDF's.
        let mut turn = Frame::IDENTITY;
        model.links[0] = self.link(&base, &turn)?;
        for (i, joint) in self.revolute.into_iter().enumerate() {
            let from = if i == 0 { &base } else { &self.revolute[i - 1].child.link };
            let fixed = self.fixed_path(from, &joint.parent.link).unwrap_or_default();
            for f in &fixed {
                self.warn(format!("joint {}", f.name), "is fixed: merged into the joint behind it");
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
                    "axis {} {} {} is not +z: the frame of link {} is turned, positions and torques keep their sign",
                    axis[0], axis[1], axis[2], joint.child.link
                );
                self.warn(format!("joint {}", joint.name), problem);
            }
            turn = next;
            model.links[i + 1] = self.link(&joint.child.link, &turn)?;
        }
        model.joints[JOINTS] = match self.flange {
            Some(flange) if turn.is_identity() => origin(&flange.origin),
            Some(flange) => turn.inverse().then(&Frame::of(&origin(&flange.origin))).origin(),
            None => turn.inverse().origin(),
        };
        Ok(model)
    }

    /// What lies below the arm's own base: it does not move, but it places the base somewhere else.
    fn look_below(&mut self, base: &str) {
        let mut at = base.to_owned();
        for _ in 0..self.robot.joints.len() {
            let Some(joint) = self.robot.joints.iter().find(|j| j.child.link == at) else { return };
            let o = origin(&joint.origin);
            if o != Origin::default() {
                let problem = format!(
                    "its offset (xyz {:?} rpy {:?}) is not carried: positions count from link {base}; gravity is a setting \
                     of the controller",
                    o.xyz, o.rpy
                );
                self.warn(format!("joint {}", joint.name), problem);
            }
            at = joint.parent.link.clone();
        }
    }

    /// A link with all that fixed joints hang on it, in the turned frame.
    fn link(&mut self, name: &str, turn: &Frame) -> Result<Link, FileError> {
        let mut bodies = Vec::new();
        let mut todo = vec![(name.to_owned(), Frame::IDENTITY)];
        while let Some((at, frame)) = todo.pop() {
            let found = self.robot.links.iter().find(|l| l.name == at);
            let link = found
                .ok_or_else(|| FileError::form(format!("link {at} is named by a joint and not there")))?;
            let inertial = &link.inertial;
            let i = &inertial.inertia;
            let own = Link {
                origin: origin(&inertial.origin),
                inertia: [i.ixx, i.ixy, i.ixz, i.iyy, i.iyz, i.izz],
                mass: inertial.mass.value,
            };
            if at != name && own.mass != 0.0 {
                self.warn(format!("link {at}"), format!("{} kg: made part of link {name}", own.mass));
            }
            if at == name || own.mass != 0.0 {
                bodies.push((own, frame.clone()));
            }
            if bodies.len() + todo.len() > self.robot.links.len() {
                return Err(FileError::form(format!("fixed joints at link {at} are a loop")));
            }
            for joint in &self.robot.joints {
                if joint.parent.link == at && joint.joint_type == JointType::Fixed {
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

    fn limits(&mut self) -> Result<[JointConfig; JOINTS], FileError> {
        let default = super::Arm::avena().joints;
        let mut all = default;
        for (i, joint) in self.revolute.into_iter().enumerate() {
            let place = format!("joint {}", joint.name);
            let (to, limit) = (&mut all[i], &joint.limit);
            to.rotor_inertia = 0.0;
            if limit.lower == 0.0 && limit.upper == 0.0
                || !limit.lower.is_finite()
                || !limit.upper.is_finite()
            {
                let problem =
                    format!("no position limits: {}..{} rad are used", to.position_min, to.position_max);
                self.warn(&place, problem);
            } else if limit.lower >= limit.upper {
                return Err(about(
                    joint,
                    format!("lower limit {} is not below upper {}", limit.lower, limit.upper),
                ));
            } else {
                (to.position_min, to.position_max) = (limit.lower, limit.upper);
            }
            let positive = |v: f64| v > 0.0 && v.is_finite();
            if positive(limit.velocity) {
                to.velocity_max = limit.velocity;
            } else {
                let used = to.velocity_max;
                self.warn(&place, format!("velocity limit {}: {used} rad/s is used", limit.velocity));
            }
            if positive(limit.effort) {
                to.torque_max = limit.effort;
            } else {
                let used = to.torque_max;
                self.warn(&place, format!("effort limit {}: {used} N·m is used", limit.effort));
            }
            if positive(limit.acceleration) {
                to.acceleration_max = limit.acceleration;
            }
            if joint.mimic.is_some() {
                return Err(about(joint, "follows another joint (mimic): not possible"));
            }
            if joint.dynamics.is_some() {
                self.warn(&place, "damping and friction are not carried: friction is a parameter of its own");
            }
            if joint.safety_controller.is_some() {
                self.warn(&place, "safety_controller is not carried");
            }
        }
        self.narrow_to_drives(&mut all);
        Ok(all)
    }

    /// A description says what the mechanism can do. Its drives may do less, and the controller refuses limits beyond that
    /// (J-35, J-43).
    fn narrow_to_drives(&mut self, joints: &mut [JointConfig; JOINTS]) {
        let drives = Config::avena();
        let area = jtc_core::WORKING_AREA;
        let fastest = drives.drive_speed_trip.min(drives.velocity_full_scale) / drives.overspeed_factor;
        for (revolute, to) in self.revolute.into_iter().zip(joints) {
            let place = format!("joint {}", revolute.name);
            if to.position_min < -area || to.position_max > area {
                let (min, max) = (to.position_min, to.position_max);
                (to.position_min, to.position_max) = (min.clamp(-area, area), max.clamp(-area, area));
                let used = format!("{}..{} rad are used", to.position_min, to.position_max);
                let problem = format!("position limits {min}..{max} leave the drives' working area: {used}");
                self.warn(&place, problem);
            }
            if to.velocity_max > fastest {
                let problem = format!(
                    "velocity limit {}: {fastest} rad/s is used, above {} rad/s the drives trip",
                    to.velocity_max, drives.drive_speed_trip
                );
                to.velocity_max = fastest;
                self.warn(&place, problem);
            }
        }
    }
}

fn origin(pose: &urdf_rs::Pose) -> Origin {
    Origin { xyz: pose.xyz.0, rpy: pose.rpy.0 }
}
