//! Messages about the selection of the arm: which six joints could be the arm, and which link could be the flange.

use std::path::PathBuf;

use jtc_core::JOINTS;

use super::Chain;
use super::choice::{names, unfit, way_down};
use super::robot::{Joint, Kind, Robot};
use crate::arm::{ArmChoice, Change};
use crate::file::FileError;

/// Words in the names of joints that belong to a gripper, a hand, a head, a leg or a wheel.
const TOOLS: [&str; 16] = [
    "finger", "grip", "gripper", "jaw", "thumb", "knuckle", "claw", "wheel", "caster", "steer", "head",
    "neck", "leg", "hip", "knee", "ankle",
];
/// Words in the names of joints that often carry the whole arm. Some arms use such a name for their first joint.
const BELOW: [&str; 9] = ["base", "torso", "waist", "body", "chest", "lift", "column", "track", "rail"];
/// Position of the redundant joint (the elbow) among the seven joints of most redundant arms, from 0.
const REDUNDANT: usize = 2;

/// Returns `true` if the name of a joint contains one of the words.
fn is_named(joint: &Joint, list: &[&str]) -> bool {
    let name = joint.name.to_lowercase();
    let mut words = name.split(|c: char| !c.is_ascii_alphabetic());
    words.any(|word| list.iter().any(|part| word.starts_with(part) && word.len() <= part.len() + 1))
}

/// Returns the rotary joints of the chain to each end of the robot.
fn chains<'a>(robot: &'a Robot, candidates: &[&'a Joint]) -> Vec<Vec<&'a Joint>> {
    let inner: Vec<&str> = candidates
        .iter()
        .filter_map(|c| way_down(robot, &c.parent).find(|j| is_one(candidates, j)))
        .map(|j| j.name.as_str())
        .collect();
    let ends = candidates.iter().filter(|c| !inner.contains(&c.name.as_str()));
    let chain = |end: &&'a Joint| -> Vec<&'a Joint> {
        let mut way: Vec<&Joint> = way_down(robot, &end.child).collect();
        way.reverse();
        way.into_iter().filter(|j| j.kind.is_rotary() && is_one(candidates, j)).collect()
    };
    ends.map(chain).collect()
}

fn is_one(candidates: &[&Joint], joint: &Joint) -> bool {
    candidates.iter().any(|c| std::ptr::eq(*c, joint))
}

/// Returns the joints of the arm in a chain of rotary joints: the joints without those of a gripper, without those of a
/// mobile base or a torso if enough joints remain, and without the redundant joint of an arm with seven joints.
fn arm_of<'a>(chain: &[&'a Joint]) -> Vec<&'a Joint> {
    let longest_without = |joints: &[&'a Joint], words: &[&str]| -> Vec<&'a Joint> {
        let parts = joints.split(|joint| is_named(joint, words));
        parts.max_by_key(|part| part.len()).unwrap_or_default().to_vec()
    };
    let mut arm = longest_without(chain, &TOOLS);
    let above = longest_without(&arm, &BELOW);
    if arm.len() > JOINTS && above.len() >= JOINTS {
        arm = above;
    }
    if arm.len() > JOINTS + 1 {
        arm.drain(..arm.len() - JOINTS - 1);
    }
    if arm.len() == JOINTS + 1 {
        arm.remove(REDUNDANT);
    }
    arm
}

/// Returns an error that explains why the joints are not a six-axis arm and names the option that selects the joints.
pub(super) fn not_six(robot: &Robot, candidates: &[&Joint], choice: &ArmChoice) -> FileError {
    let all = chains(robot, candidates);
    let longest =
        all.iter().rev().max_by_key(|chain| (arm_of(chain).len(), chain.len())).cloned().unwrap_or_default();
    let arm = arm_of(&longest);
    let others: Vec<String> = candidates
        .iter()
        .filter(|c| !is_one(&longest, c))
        .map(|c| format!("{} ({})", c.name, c.kind.name()))
        .collect();
    let mut text = match longest.len() {
        0 => "0 rotary joints, expected six in a chain".to_owned(),
        1 => format!("1 rotary joint ({}), expected six in a chain", names(&longest).join(", ")),
        n => format!("{n} rotary joints form a chain ({}), expected six", names(&longest).join(", ")),
    };
    if !others.is_empty() {
        text += &format!("; {} move{} as well", others.join(", "), if others.len() == 1 { "s" } else { "" });
    }
    if arm.len() < JOINTS {
        if longest.len() >= JOINTS {
            text += "; by their names, not all of these joints belong to an arm";
        } else if choice.tip.is_some() {
            text += "; check that --tip names the last link of the arm";
            return unfit(text);
        }
        return FileError::FewJoints { path: PathBuf::new(), problem: text };
    }
    let alike: Vec<String> = all
        .iter()
        .filter(|chain| chain.last().map(|j| &j.name) != longest.last().map(|j| &j.name))
        .map(|chain| arm_of(chain))
        .filter(|other| other.len() == JOINTS && !is_one(&arm, other[JOINTS - 1]))
        .map(|other| names(&other).join(","))
        .collect();
    if !alike.is_empty() {
        text += &format!("; another arm is --joints {}", alike.join(" or --joints "));
    }
    FileError::Joints { path: PathBuf::new(), problem: text, six: names(&arm).join(",") }
}

impl<'a> Chain<'a> {
    /// Finds the joints from the last link to the flange. With `tip`, these are the joints on the path to the link
    /// `tip`. Without `tip`, this is one fixed joint on the last link: the joint with a usual flange name, or else
    /// the first fixed joint.
    pub(super) fn find_flange(&mut self, tip: Option<&str>) {
        let last = &self.rotary[JOINTS - 1].child;
        if let Some(way) = tip.and_then(|tip| self.rigid_path(last, tip)) {
            self.flange = way;
            return;
        }
        let behind: Vec<&Joint> = self.robot.on(last).filter(|j| j.kind == Kind::Fixed).collect();
        let named = |j: &&&Joint| {
            let words = format!("{} {}", j.name, j.child).to_lowercase();
            ["flange", "gripper", "tool0", "joint_7"].iter().any(|w| words.contains(w))
        };
        let flange = behind.iter().find(named).or(behind.first()).copied();
        self.flange = flange.into_iter().collect();
        match flange {
            None => {
                let mut problem =
                    "carries no fixed flange joint: the flange has the frame of this link".to_owned();
                let links = self.links_behind(last);
                if !links.is_empty() {
                    problem +=
                        &format!("; `jtc arm import` selects a link that it carries with --tip: {links}");
                }
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
        if let Some(flange) = flange {
            let links = self.links_behind(&flange.child);
            if !links.is_empty() {
                let problem = format!(
                    "is the flange; more links follow on it, such as a tool frame: `jtc arm import` selects one of them with --tip: {links}"
                );
                self.warn(Change::Flange, format!("link {}", flange.child), problem);
            }
        }
    }

    /// Returns the names of the links that a link carries on joints that do not move with the arm.
    fn links_behind(&self, link: &str) -> String {
        let mut found: Vec<&str> = Vec::new();
        let mut todo = vec![link];
        while let Some(at) = todo.pop() {
            for joint in self.robot.on(at).filter(|joint| joint.kind == Kind::Fixed) {
                found.push(&joint.child);
                todo.push(&joint.child);
            }
        }
        match found.len() {
            0..=6 => found.join(", "),
            n => format!("{} and {} more", found[..6].join(", "), n - 6),
        }
    }
}
