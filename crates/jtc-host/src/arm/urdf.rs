//! Arms from URDF: six rotary joints in a chain and a fixed flange; what the controller's arm model cannot carry is reported.
//!
//! Joints about another axis than +z are carried by turning the frames of their links, which changes neither positions nor
//! torques. Bodies behind fixed joints, and behind joints that are none of the six, become part of the link that carries them.

mod choice;
mod frames;

use jtc_core::{Config, JOINTS, JointConfig};
use jtc_dynamics::{ArmModel, Link, Origin};
use urdf_rs::{Joint, JointType, Robot};

use self::choice::{about, choose};
use self::frames::{Body, Frame};
use super::{Arm, ArmChoice, Warning};
use crate::file::FileError;

/// Deeper nesting than any description of an arm has.
const DEPTH_MAX: usize = 32;

/// The chain of joints with what hangs on it.
struct Chain<'a> {
    robot: &'a Robot,
    rotary: [&'a Joint; JOINTS],
    /// From the last link to the flange.
    flange: Vec<&'a Joint>,
    warnings: Vec<Warning>,
}

/// The arm of a description; `choice` selects its joints.
pub(super) fn read(text: &str, choice: &ArmChoice) -> Result<Arm, FileError> {
    let depth = depth(text);
    if depth > DEPTH_MAX {
        return Err(FileError::form(format!("XML nested {depth} deep is no description of an arm")));
    }
    let robot = urdf_rs::read_from_string(text).map_err(|e| FileError::form(format!("URDF: {e}")))?;
    let mut chain = Chain::of(&robot, choice)?;
    let model = chain.model()?;
    let limits = chain.limits()?;
    Ok(Arm {
        name: robot.name.clone(),
        joint_names: chain.rotary.map(|j| j.name.clone()),
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

impl<'a> Chain<'a> {
    fn of(robot: &'a Robot, choice: &ArmChoice) -> Result<Self, FileError> {
        let rotary = choose(robot, choice)?;
        let mut chain = Self { robot, rotary, flange: Vec::new(), warnings: Vec::new() };
        chain.find_flange(choice.tip.as_deref());
        for joint in &robot.joints {
            if joint.joint_type != JointType::Fixed && chain.rigid(joint) {
                let kind = format!("{:?}", joint.joint_type).to_lowercase();
                chain.warn(format!("joint {}", joint.name), format!("{kind}: is held at 0, none of the six"));
            }
        }
        Ok(chain)
    }

    /// What hangs on it does not move against what carries it.
    fn rigid(&self, joint: &Joint) -> bool {
        !self.rotary.iter().any(|r| r.name == joint.name)
    }

    fn warn(&mut self, place: impl Into<String>, problem: impl Into<String>) {
        self.warnings.push(Warning { place: place.into(), problem: problem.into() });
    }

    /// What leads from the last link to the flange: the way to `tip`, or else the fixed joint behind it; of several the one whose
    /// name is one, else the first.
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
            None => self
                .warn(format!("link {last}"), "no fixed flange joint behind it: the flange is its own frame"),
            Some(flange) if behind.len() > 1 => {
                let others: Vec<&str> =
                    behind.iter().filter(|j| j.name != flange.name).map(|j| j.name.as_str()).collect();
                let problem = format!(
                    "is taken as the flange, not {}; `jtc arm import` takes another with --tip",
                    others.join(", ")
                );
                self.warn(format!("joint {}", flange.name), problem);
            }
            Some(_) => {}
        }
    }

    /// Joints on the way from link `from` to link `to`, first to last, if none of them moves.
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
        // Turn of each link's frame against URDF's.
        let mut turn = Frame::IDENTITY;
        model.links[0] = self.link(&base, &turn)?;
        for (i, joint) in self.rotary.into_iter().enumerate() {
            let from = if i == 0 { &base } else { &self.rotary[i - 1].child.link };
            let fixed = self.rigid_path(from, &joint.parent.link).unwrap_or_default();
            for f in fixed.iter().filter(|f| f.joint_type == JointType::Fixed) {
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
        model.joints[JOINTS] = match self.flange.as_slice() {
            [flange] if turn.is_identity() => origin(&flange.origin),
            way => {
                let place = |frame: Frame, joint: &&Joint| frame.then(&Frame::of(&origin(&joint.origin)));
                way.iter().fold(turn.inverse(), place).origin()
            }
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

    fn limits(&mut self) -> Result<[JointConfig; JOINTS], FileError> {
        let default = super::Arm::avena().joints;
        let mut all = default;
        for (i, joint) in self.rotary.into_iter().enumerate() {
            let place = format!("joint {}", joint.name);
            let (to, limit) = (&mut all[i], &joint.limit);
            to.rotor_inertia = 0.0;
            if joint.joint_type == JointType::Continuous
                || limit.lower == 0.0 && limit.upper == 0.0
                || !limit.lower.is_finite()
                || !limit.upper.is_finite()
            {
                if joint.joint_type == JointType::Continuous {
                    // As far as the drives go; whether the mechanism has a stop is not given.
                    (to.position_min, to.position_max) = (-jtc_core::WORKING_AREA, jtc_core::WORKING_AREA);
                }
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

    /// A description gives the limits of the mechanism. Its drives may do less, and the controller refuses limits beyond that
    /// (J-35, J-43).
    fn narrow_to_drives(&mut self, joints: &mut [JointConfig; JOINTS]) {
        let drives = Config::avena();
        let area = jtc_core::WORKING_AREA;
        let fastest = drives.drive_speed_trip.min(drives.velocity_full_scale) / drives.overspeed_factor;
        for (revolute, to) in self.rotary.into_iter().zip(joints) {
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
