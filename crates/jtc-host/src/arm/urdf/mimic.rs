//! Joints that are not among the six joints of the arm: the position at which each of them is held.
//!
//! A joint that mimics another joint moves with its *leader*. If the leader is held, the position of the mimic joint is
//! fixed, too. If the leader is one of the six joints, the mimic joint moves while the arm moves. The arm model cannot
//! represent such a joint.

use std::collections::HashMap;

use jtc_dynamics::Origin;

use super::Chain;
use super::choice::{about, way_down};
use super::frames::Frame;
use super::robot::{Joint, Kind};
use crate::arm::Change;
use crate::file::FileError;

/// Largest mass on joints that follow a joint of the arm, as a share of the mass that the arm moves. The importer
/// holds such a joint, so its mass is at the wrong position.
const FOLLOWING_MAX: f64 = 0.05;

/// Position of a joint that is not one of the six.
pub(super) struct Held<'a> {
    /// Position while all joints of the arm are at 0; rad or m.
    pub position: f64,
    /// Joint of the arm that the joint follows.
    pub leader: Option<&'a Joint>,
}

impl<'a> Chain<'a> {
    /// Returns the position of a joint that is not one of the six.
    pub(super) fn held(&self, joint: &'a Joint) -> Result<Held<'a>, FileError> {
        let (mut at, mut factor, mut position) = (joint, 1.0, 0.0);
        for _ in 0..=self.robot.joints.len() {
            let Some(mimic) = at.mimic()? else {
                let leads = !self.rigid(at) && factor != 0.0;
                return Ok(Held { position, leader: leads.then_some(at) });
            };
            position += factor * mimic.offset;
            factor *= mimic.multiplier;
            if !position.is_finite() || !factor.is_finite() {
                return Err(about(joint, "multiplier or offset of its <mimic> is not finite"));
            }
            // A leader that does not exist cannot move, so the joint stays at its offset.
            let Some(leader) = self.robot.joint(&mimic.leader) else {
                return Ok(Held { position, leader: None });
            };
            at = leader;
        }
        Err(about(joint, "follows itself, through <mimic>: remove one of these elements"))
    }

    /// Returns the frame of the link that a joint moves, relative to the link that carries the joint. The joint is
    /// held at its position.
    pub(super) fn held_frame(&self, joint: &'a Joint) -> Result<Frame, FileError> {
        let frame = Frame::of(&joint.origin()?);
        let position = self.held(joint)?.position;
        if position == 0.0 || !matches!(joint.kind, Kind::Revolute | Kind::Continuous | Kind::Prismatic) {
            return Ok(frame);
        }
        let axis = joint.axis()?;
        let turn = Frame::turning_z_to(axis).ok_or_else(|| {
            about(joint, format!("axis {} {} {} has no direction", axis[0], axis[1], axis[2]))
        })?;
        let moved = if joint.kind == Kind::Prismatic {
            Origin { xyz: [0.0, 0.0, position], rpy: [0.0; 3] }
        } else {
            Origin { xyz: [0.0; 3], rpy: [0.0, 0.0, position] }
        };
        Ok(frame.then(&turn).then(&Frame::of(&moved)).then(&turn.inverse()))
    }

    /// Reports each joint that is held, and refuses an arm that such a joint would change while it moves.
    pub(super) fn hold_others(&mut self) -> Result<(), FileError> {
        let last = &self.rotary[self.rotary.len() - 1].child;
        let mut carrying: Vec<&Joint> =
            way_down(self.robot, last).filter(|joint| self.rigid(joint)).collect();
        carrying.extend(&self.flange);
        for joint in carrying {
            if let Some(leader) = self.held(joint)?.leader {
                let problem = format!(
                    "joint {} follows joint {} (mimic) and is itself a part of the chain: the links do not form a serial chain of six joints, which \
                     is all that the arm model can represent",
                    joint.name, leader.name
                );
                return Err(FileError::few_joints(problem));
            }
        }
        let mut following = Vec::new();
        for joint in &self.robot.joints {
            if joint.kind == Kind::Fixed || !self.rigid(joint) {
                continue;
            }
            let held = self.held(joint)?;
            let follows = joint.mimic()?.map_or_else(String::new, |m| {
                let missing =
                    if self.robot.joint(&m.leader).is_none() { ", which does not exist" } else { "" };
                format!(", follows {}{missing}", m.leader)
            });
            let problem = format!(
                "{}{follows}: is held at {}, because it is not one of the six joints",
                joint.kind.name(),
                held.position
            );
            self.warn(Change::LeftOut, format!("joint {}", joint.name), problem);
            following.extend(held.leader.map(|leader| (joint, leader)));
        }
        self.weigh(&following)
    }

    /// Checks the mass on joints that follow a joint of the arm.
    fn weigh(&mut self, following: &[(&'a Joint, &'a Joint)]) -> Result<(), FileError> {
        if following.is_empty() {
            return Ok(());
        }
        let carried = self.carried()?;
        let mass_on = |link: &str| carried.get(link).copied().unwrap_or_default();
        let moving = mass_on(&self.rotary[0].child);
        for (joint, leader) in following {
            let mass = mass_on(&joint.child);
            if mass == 0.0 {
                continue;
            }
            if mass > FOLLOWING_MAX * moving {
                let problem = format!(
                    "joint {} follows joint {} (mimic) and moves {mass} kg, more than {} % of the {moving} kg that the arm moves: the arm model has \
                     no joint for this mass",
                    joint.name,
                    leader.name,
                    100.0 * FOLLOWING_MAX
                );
                return Err(FileError::few_joints(problem));
            }
            let problem =
                format!("follows joint {}, so its {mass} kg move, but the model holds them", leader.name);
            self.warn(Change::Doubtful, format!("joint {}", joint.name), problem);
        }
        Ok(())
    }

    /// Returns the mass of each link and of everything that the link carries, kg.
    fn carried(&self) -> Result<HashMap<&'a str, f64>, FileError> {
        let mut carried = HashMap::new();
        for link in &self.robot.links {
            let mass = link.body()?.mass;
            let below = way_down(self.robot, &link.name).map(|joint| joint.parent.as_str());
            for carrier in std::iter::once(link.name.as_str()).chain(below) {
                *carried.entry(carrier).or_default() += mass;
            }
        }
        Ok(carried)
    }
}
