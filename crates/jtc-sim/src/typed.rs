//! Events that a user types during a simulation, such as `push 3 12 0.5` or `hand FILE`.
use core::fmt;

use jtc_bus::{JOINTS, Joint};

/// Description of the events, for display to the user.
pub const TYPED_EVENTS_HELP: &str =
    "push JOINT TORQUE_NM SECONDS (as in `push 3 12 0.5`), hand FILE (as in `hand lead.csv`)";

/// Largest push, N·m.
pub const PUSH_MAX: f64 = 400.0;
/// Longest push, s.
const PUSH_MAX_S: f64 = 60.0;

/// An event that the user typed.
#[derive(Clone, Debug, PartialEq)]
pub enum TypedEvent {
    /// A push on a joint.
    Push {
        /// Joint that is pushed.
        joint: Joint,
        /// Torque in the joint's positive direction, N·m.
        torque: f64,
        /// Duration of the push, s.
        seconds: f64,
    },
    /// A hand that guides the arm along the joint positions of a trajectory file in Teaching.
    Hand {
        /// File name as the user typed it.
        file: String,
    },
}

impl fmt::Display for TypedEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Push { joint, torque, seconds } => {
                write!(f, "push: {joint} by {torque} N·m for {seconds} s")
            }
            Self::Hand { file } => {
                write!(f, "hand: a hand leads the arm along {file} while the arm is taught")
            }
        }
    }
}

/// Reasons why a typed line is not an event.
#[derive(Clone, Debug, PartialEq)]
pub enum TypedEventError {
    /// The event is unknown.
    Unknown(String),
    /// A push has the wrong number of words. Three words must follow the word `push`.
    PushWords(usize),
    /// A word of a push is invalid. The error contains the permitted range of the word.
    Value {
        /// Name of the value.
        what: &'static str,
        /// Word as the user typed it.
        word: String,
        /// Smallest and largest permitted value.
        allowed: (f64, f64),
    },
    /// A hand event has no file name.
    NoFile,
}

impl fmt::Display for TypedEventError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown(word) => write!(f, "unknown event `{word}`; the events are {TYPED_EVENTS_HELP}"),
            Self::PushWords(count) => write!(
                f,
                "push has {count} words, expected a joint, a torque in N·m and a time in s, as in `push 3 12 0.5`"
            ),
            Self::Value { what: "joint", word, .. } => {
                write!(
                    f,
                    "push: joint `{word}` is out of range, expected 1..{JOINTS}; joints count from 1, at the base"
                )
            }
            Self::Value { what, word, allowed: (low, high) } => {
                write!(f, "push: {what} `{word}` is not a valid number, expected {low}..{high}")
            }
            Self::NoFile => f.write_str("hand takes a trajectory file, as in `hand lead.csv`"),
        }
    }
}

impl std::error::Error for TypedEventError {}

impl TypedEvent {
    /// Returns the event that a line describes. Returns `None` for an empty line or a comment
    /// (`#`).
    pub fn parse(line: &str) -> Result<Option<Self>, TypedEventError> {
        let line = line.trim();
        let (name, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match name {
            "" => Ok(None),
            _ if name.starts_with('#') => Ok(None),
            "push" => push(&rest.split_whitespace().collect::<Vec<_>>()).map(Some),
            "hand" if rest.trim().is_empty() => Err(TypedEventError::NoFile),
            "hand" => Ok(Some(Self::Hand { file: rest.trim().into() })),
            _ => Err(TypedEventError::Unknown(name.into())),
        }
    }
}

fn push(words: &[&str]) -> Result<TypedEvent, TypedEventError> {
    let [joint, torque, seconds] = words else { return Err(TypedEventError::PushWords(words.len())) };
    let value = |what, word: &str, low: f64, high: f64| {
        let number = word.parse().ok().filter(|x: &f64| *x >= low && *x <= high);
        number.ok_or_else(|| TypedEventError::Value { what, word: word.into(), allowed: (low, high) })
    };
    let allowed = (1.0, JOINTS as f64);
    let number = value("joint", joint, allowed.0, allowed.1)?;
    let whole = Some(number as usize).filter(|_| number.fract() == 0.0).and_then(Joint::from_number);
    let joint =
        whole.ok_or_else(|| TypedEventError::Value { what: "joint", word: (*joint).into(), allowed })?;
    Ok(TypedEvent::Push {
        joint,
        torque: value("torque (N·m)", torque, -PUSH_MAX, PUSH_MAX)?,
        seconds: value("time (s)", seconds, 0.001, PUSH_MAX_S)?,
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn events_are_read_and_joints_count_from_1() {
        let push = TypedEvent::Push { joint: Joint::ALL[2], torque: 12.0, seconds: 0.5 };
        assert_eq!(TypedEvent::parse("  push 3 12  0.5 \n"), Ok(Some(push.clone())));
        assert_eq!(push.to_string(), "push: joint 3 by 12 N·m for 0.5 s");
        let hand = TypedEvent::Hand { file: "my lead.csv".into() };
        assert_eq!(TypedEvent::parse("hand my lead.csv"), Ok(Some(hand)));
        assert_eq!(TypedEvent::parse(" # push 3 12 1"), Ok(None));
        assert_eq!(TypedEvent::parse(""), Ok(None));
    }

    #[test]
    fn mistakes_are_named() {
        for (line, part) in [
            ("shove 3 12 1", "unknown event `shove`; the events are push JOINT TORQUE_NM SECONDS"),
            (
                "push 3 12",
                "push has 2 words, expected a joint, a torque in N·m and a time in s, as in `push 3 12 0.5`",
            ),
            ("push 0 12 1", "joint `0` is out of range, expected 1..6; joints count from 1"),
            ("push 7 12 1", "joint `7` is out of range, expected 1..6"),
            ("push 2.5 12 1", "joint `2.5` is out of range, expected 1..6"),
            ("push 2 1e9 1", "torque (N·m) `1e9` is not a valid number, expected -400..400"),
            ("push 2 nan 1", "torque (N·m) `nan` is not a valid number"),
            ("push 2 12 forever", "time (s) `forever` is not a valid number, expected 0.001..60"),
            ("hand", "hand takes a trajectory file"),
        ] {
            let message = TypedEvent::parse(line).unwrap_err().to_string();
            assert!(message.contains(part), "{line}\n→ {message}");
        }
    }

    proptest! {
        #[test]
        fn no_line_makes_the_reader_panic(line in "\\PC{0,60}|push( [-0-9.e]{0,6}){0,4}") {
            let _ = TypedEvent::parse(&line);
        }
    }
}
