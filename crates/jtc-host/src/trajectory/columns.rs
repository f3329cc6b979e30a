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

/// Words that can be next to a joint. A column with another word is not used: the word can change the meaning of the numbers.
const ALLOWED: &[&str] = &[
    "act",
    "action",
    "actual",
    "cmd",
    "command",
    "commanded",
    "commands",
    "controller",
    "data",
    "des",
    "desired",
    "feedback",
    "field",
    "goal",
    "jnt",
    "joint",
    "joints",
    "meas",
    "measured",
    "message",
    "msg",
    "observation",
    "output",
    "ref",
    "reference",
    "setpoint",
    "state",
    "states",
    "target",
    "trajectory",
    "value",
    "values",
];

/// Words for one of several arms. These words can be next to a joint if the numbers determine the order of the joints.
const SIDES: &[&str] = &["arm", "l", "left", "r", "right", "robot"];

/// Returns `true` if the word does not change the meaning of the numbers.
fn allowed((word, number): &Word, arm: &[Word]) -> bool {
    number.is_none() && (ALLOWED.contains(&word.as_str()) || channel(word).is_some())
        || arm.iter().any(|own| own.0 == *word && own.1 == *number)
}

/// Returns the only quantity that the words name. Words for several quantities are an error.
fn quantity(words: &[&Word], own: Option<Channel>) -> Result<Channel, ()> {
    let mut found = own;
    for (word, _) in words {
        let Some(next) = channel(word) else { continue };
        match found {
            None | Some(Channel::Position) => found = Some(next),
            Some(before) if next != before && next != Channel::Position => return Err(()),
            Some(_) => {}
        }
    }
    Ok(found.unwrap_or(Channel::Position))
}

/// Word of a name, with the number after the word.
type Word = (String, Option<u32>);

/// Returns the words of a name. A number belongs to the word before the number.
fn words(name: &str) -> Vec<Word> {
    let mut found: Vec<Word> = Vec::new();
    for part in name.split(|c: char| !c.is_alphanumeric()).filter(|part| !part.is_empty()) {
        let word = part.trim_end_matches(|c: char| c.is_ascii_digit());
        let number = part[word.len()..].parse().ok();
        if number.is_none() && word.len() < part.len() {
            // The number is too large for an index.
            found.push((part.to_owned(), None));
            continue;
        }
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

/// Returns `true` if the first column contains seconds, and the second column contains the rest of the same time in ns.
pub(super) fn is_rest(seconds: &str, rest: &str) -> bool {
    let split = |name: &str, ends: &[&str]| {
        let mut words = words(&name.to_lowercase());
        let ended = words.pop_if(|(word, _)| ends.contains(&word.as_str())).is_some();
        (words, ended)
    };
    let (head, _) = split(seconds, &["s", "sec", "secs", "second", "seconds"]);
    let nanos = ["ns", "nsec", "nsecs", "nanos", "nanosec", "nanosecs", "nanosecond", "nanoseconds"];
    let (other, ended) = split(rest, &nanos);
    ended && head == other
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
    let plain = |c: char| c.is_alphanumeric() || "_/.-:[]() %".contains(c);
    if base.starts_with('-') || !base.chars().all(plain) {
        return Meaning::Unknown;
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
    let side = |word: &Word| is_joint(&words[at].0) && SIDES.contains(&word.0.as_str());
    if !names_of(word) && others.iter().any(|word| !allowed(word, &[]) && !side(word)) {
        return Meaning::Unknown;
    }
    let Ok(quantity) = quantity(&others, channel(word)) else { return Meaning::Unknown };
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
            channel: quantity,
            key: Key::Index(number),
        };
    }
    if channel(word).is_some() {
        return Meaning::Value { group: text(&others), channel: quantity, key: Key::Index(number) };
    }
    let group: Vec<&Word> =
        others.iter().copied().filter(|(word, number)| channel_without(word, *number).is_none()).collect();
    let joint = Key::Name(number, text(&[group.as_slice(), &[&words[at]]].concat()));
    Meaning::Value { group: text(&group), channel: quantity, key: joint }
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
        is_end(head.chars().next_back()) || ALLOWED.contains(&word) || channel(word).is_some()
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
    let own = words(&names.arm.to_lowercase());
    if rest.iter().any(|word| !allowed(word, &own)) {
        return Some(Meaning::Unknown);
    }
    let Ok(quantity) = quantity(&rest.iter().collect::<Vec<_>>(), None) else {
        return Some(Meaning::Unknown);
    };
    let group: Vec<String> = rest
        .iter()
        .filter(|(word, number)| channel_without(word, *number).is_none())
        .map(|(word, number)| word.clone() + &number.map_or(String::new(), |n| n.to_string()))
        .collect();
    Some(Meaning::Value { group: group.join("_"), channel: quantity, key: Key::Joint(j) })
}
