//! Meaning of the names of columns: names of this project, of joints, and of other programs.

use jtc_core::JOINTS;

use super::ArmNames;
use crate::table::{Unit, named};

/// Quantity of a column. The value is the index in a list of channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Channel {
    Position,
    Velocity,
    Acceleration,
}

/// Joint of a column.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Key {
    /// Index in the order of the columns: q1, position0.
    Index(u32),
    /// Joint of the arm, from 0.
    Joint(usize),
    /// Name of a joint with a number that is not a joint of the arm: left_joint_1.
    Name(u32, String),
}

/// Meaning of a column.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Meaning {
    /// Time. The names of times in a message header are used only if no other time exists.
    Time { of_header: bool },
    /// Value of a joint. The group is the text that several columns share, such as "actual".
    Value { group: String, channel: Channel, key: Key },
    /// Name of a joint, as `field.name0` of `rostopic echo -p`.
    JointName { group: String, index: u32 },
    /// Column that is not used.
    Unknown,
}

/// Words of columns that contain other quantities of a joint.
const OTHERS: &[&str] = &[
    "effort",
    "efforts",
    "torque",
    "torques",
    "tau",
    "current",
    "currents",
    "temp",
    "temperature",
    "error",
    "err",
    "mode",
    "status",
    "voltage",
    "force",
    "moment",
    "limit",
    "limits",
    "min",
    "max",
    "std",
    "raw",
    "count",
    "counts",
    "load",
    "pwm",
    "kp",
    "kd",
    "jerk",
    "delay",
    "state_id",
    "enabled",
    "valid",
];

/// Words that can precede the name of a joint.
const BEFORE: &[&str] = &[
    "actual",
    "target",
    "desired",
    "commanded",
    "command",
    "measured",
    "reference",
    "feedback",
    "state",
    "observation",
    "action",
];

/// Word of a name, with the number after the word.
type Word = (String, Option<u32>);

/// Returns the words of a name. A number belongs to the word before the number.
fn words(name: &str) -> Vec<Word> {
    let mut found: Vec<Word> = Vec::new();
    for part in name.split(|c: char| !c.is_alphanumeric()).filter(|part| !part.is_empty()) {
        let word = part.trim_end_matches(|c: char| c.is_ascii_digit());
        let number = part[word.len()..].parse().ok();
        match found.last_mut() {
            Some((_, last @ None)) if word.is_empty() => *last = number,
            _ => found.push((word.to_owned(), number)),
        }
    }
    found
}

fn channel(word: &str) -> Option<Channel> {
    Some(match word {
        "q" | "pos" | "position" | "positions" | "angle" | "angles" => Channel::Position,
        "qd" | "dq" | "qdot" | "vel" | "velocity" | "velocities" | "speed" => Channel::Velocity,
        "qdd" | "ddq" | "qddot" | "acc" | "accel" | "acceleration" | "accelerations" => Channel::Acceleration,
        _ => return None,
    })
}

/// Returns the meaning of a column, and the unit in its name. An unknown unit is an error with the text of the unit.
pub(super) fn meaning(name: &str, names: Option<ArmNames<'_>>) -> (Meaning, Result<Option<Unit>, String>) {
    let (base, unit) = named(name);
    (of_base(&base, names), unit)
}

fn of_base(base: &str, names: Option<ArmNames<'_>>) -> Meaning {
    let words = words(base);
    let joined = words.iter().map(|(word, _)| word.as_str()).collect::<Vec<_>>().join("_");
    let times = ["t", "time", "timestamp", "stamp", "time_from_start", "time_stamp", "sec", "seconds"];
    if words.iter().all(|(_, number)| number.is_none()) && times.contains(&joined.as_str()) {
        return Meaning::Time { of_header: false };
    }
    if ["header_stamp", "header_stamp_secs"].iter().any(|end| joined.ends_with(end)) {
        return Meaning::Time { of_header: true };
    }
    if let Some(meaning) = names.and_then(|names| of_arm(base, names)) {
        return meaning;
    }
    let is_joint = |word: &str| ["joint", "joints", "j", "axis", "a", "jnt"].contains(&word);
    let is_list = |word: &str| ["state", "action"].contains(&word);
    let names_of = |word: &str| ["name", "names"].contains(&word);
    let Some(at) = words.iter().rposition(|(word, number)| {
        number.is_some() && (channel(word).is_some() || is_joint(word) || is_list(word) || names_of(word))
    }) else {
        return Meaning::Unknown;
    };
    let (word, number) = (&words[at].0, words[at].1.unwrap_or_default());
    let others: Vec<&Word> =
        words.iter().enumerate().filter(|(i, _)| *i != at).map(|(_, word)| word).collect();
    if others.iter().any(|(word, _)| OTHERS.contains(&word.as_str())) {
        return Meaning::Unknown;
    }
    let text = |words: &[&Word]| {
        let one = |(word, number): &&Word| word.clone() + &number.map_or(String::new(), |n| n.to_string());
        words.iter().map(one).collect::<Vec<_>>().join("_")
    };
    if names_of(word) {
        let group: Vec<&Word> = others.iter().copied().filter(|(word, _)| word != "joint").collect();
        return Meaning::JointName { group: text(&group), index: number };
    }
    if is_list(word) {
        return Meaning::Value {
            group: text(&others) + "." + word,
            channel: Channel::Position,
            key: Key::Index(number),
        };
    }
    if let Some(channel) = channel(word) {
        return Meaning::Value { group: text(&others), channel, key: Key::Index(number) };
    }
    let of = others.iter().find_map(|(word, number)| channel_without(word, *number));
    let group: Vec<&Word> =
        others.iter().copied().filter(|(word, number)| channel_without(word, *number).is_none()).collect();
    let joint = Key::Name(number, text(&[group.as_slice(), &[&words[at]]].concat()));
    Meaning::Value { group: text(&group), channel: of.unwrap_or(Channel::Position), key: joint }
}

fn channel_without(word: &str, number: Option<u32>) -> Option<Channel> {
    channel(word).filter(|_| number.is_none())
}

/// Returns the meaning of a name that contains the name of a joint of the arm.
fn of_arm(base: &str, names: ArmNames<'_>) -> Option<Meaning> {
    let is_end = |c: Option<char>| c.is_none_or(|c| !c.is_alphanumeric() && c != '_');
    let begins = |head: &str| {
        let word =
            head.trim_end_matches('_').rsplit(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
        is_end(head.chars().next_back()) || BEFORE.contains(&word) || channel(word).is_some()
    };
    let find = |joint: &str| {
        let joint = joint.to_lowercase();
        let at = base.match_indices(joint.as_str()).find(|(i, _)| {
            let after = base[i + joint.len()..].chars().next();
            // An underscore can separate the name of the joint from a quantity, but not from the name of another arm.
            begins(&base[..*i]) && (is_end(after) || after == Some('_'))
        })?;
        Some((at.0, at.0 + joint.len()))
    };
    let of = |j: usize| {
        let joint = &names.joints[j];
        let bare = names.bare(joint);
        let long = format!("{}_{bare}", names.arm);
        [joint.as_str(), &long, bare].into_iter().filter(|name| name.chars().count() > 1).find_map(find)
    };
    let (j, (from, to)) =
        (0..JOINTS).filter_map(|j| Some((j, of(j)?))).max_by_key(|(_, (from, to))| to - from)?;
    let rest = words(&format!("{} {}", &base[..from], &base[to..]));
    if rest.iter().any(|(word, _)| OTHERS.contains(&word.as_str())) {
        return Some(Meaning::Unknown);
    }
    let channel = rest.iter().find_map(|(word, number)| channel_without(word, *number));
    let group: Vec<String> = rest
        .iter()
        .filter(|(word, number)| channel_without(word, *number).is_none())
        .map(|(word, number)| word.clone() + &number.map_or(String::new(), |n| n.to_string()))
        .collect();
    Some(Meaning::Value {
        group: group.join("_"),
        channel: channel.unwrap_or(Channel::Position),
        key: Key::Joint(j),
    })
}
