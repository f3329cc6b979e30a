//! Order of the joints of a file, by their names.

use jtc_core::JOINTS;

use super::ArmNames;
use crate::file::{FileError, Place, short};

/// Largest number of names in a message.
const LISTED: usize = 12;

/// Returns the names of a list for a message.
pub(super) fn listed<S: AsRef<str>>(names: &[S]) -> String {
    let shown: Vec<String> = names.iter().take(LISTED).map(|name| short(name.as_ref())).collect();
    let more = names.len().saturating_sub(LISTED);
    shown.join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
}

impl ArmNames<'_> {
    /// Returns the index of the joint of the arm that has this name in a file. The arm's own name can precede the name of the joint, in the
    /// file or in the arm.
    pub(super) fn joint(&self, name: &str) -> Option<usize> {
        let bare = |name: &str| self.bare(name).to_owned();
        let exact = self.joints.iter().position(|joint| joint == name);
        exact.or_else(|| self.joints.iter().position(|joint| bare(joint) == bare(name)))
    }

    /// Returns the name of a joint without the arm's own name.
    pub(super) fn bare<'a>(&self, name: &'a str) -> &'a str {
        let same = |a: char, b: char| {
            a.to_lowercase().eq(b.to_lowercase()) || !a.is_alphanumeric() && !b.is_alphanumeric()
        };
        let mut rest = name.chars();
        let begins =
            !self.arm.is_empty() && self.arm.chars().all(|a| rest.next().is_some_and(|b| same(a, b)));
        let rest = rest.as_str();
        match rest.strip_prefix(['_', '/', '-', '.', ':']) {
            Some(joint) if begins && !joint.is_empty() => joint,
            _ => name,
        }
    }
}

/// Returns the index in the file of each joint of the arm, from base to wrist, and notes about the order. Without the names of an arm, the
/// numbers at the ends of the names determine the order.
pub(super) fn joint_order(
    found: &[String],
    names: Option<ArmNames<'_>>,
) -> Result<([usize; JOINTS], Vec<String>), FileError> {
    let wrong = |problem: String| FileError::at(Place::name("joint_names"), problem);
    let mut sorted: Vec<&String> = found.iter().collect();
    sorted.sort_unstable();
    if let Some(pair) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(wrong(format!("{} occurs twice", short(pair[0]))));
    }
    let mut notes = Vec::new();
    let order = match names {
        Some(names) => by_name(found, names)?,
        None => {
            let order = by_number(found).ok_or_else(|| {
                wrong(format!("{} found; expected: six names that end in 1..6", listed(found)))
            })?;
            notes.push(format!("joints in the order of the numbers in their names: {}", listed(found)));
            order
        }
    };
    if found.len() > JOINTS {
        let extra: Vec<&String> =
            found.iter().enumerate().filter(|(i, _)| !order.contains(i)).map(|(_, n)| n).collect();
        notes.push(format!("{} not of this arm: ignored", listed(&extra)));
    }
    if !order.is_sorted() {
        notes.push("the joints of the file have another order: sorted by their names".to_owned());
    }
    Ok((order, notes))
}

fn by_name(found: &[String], names: ArmNames<'_>) -> Result<[usize; JOINTS], FileError> {
    let mut order = [None; JOINTS];
    for (i, name) in found.iter().enumerate() {
        let Some(joint) = names.joint(name) else { continue };
        if let Some(before) = order[joint].replace(i) {
            let problem = format!("{} and {} are the same joint", short(&found[before]), short(name));
            return Err(FileError::at(Place::name("joint_names"), problem));
        }
    }
    let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f)] = order else {
        return Err(other_arm(found, names));
    };
    Ok([a, b, c, d, e, f])
}

/// Returns the error for a file whose names are not the names of the arm.
pub(super) fn other_arm(found: &[String], names: ArmNames<'_>) -> FileError {
    let missing: Vec<&String> = names
        .joints
        .iter()
        .filter(|joint| !found.iter().any(|f| names.bare(f) == names.bare(joint)))
        .collect();
    let which = if missing.len() == JOINTS {
        "none of these names is a joint".to_owned()
    } else {
        format!("{} missing", listed(&missing))
    };
    let of =
        if names.arm.is_empty() { "this arm".to_owned() } else { format!("the arm {}", short(names.arm)) };
    FileError::JointNames {
        path: std::path::PathBuf::new(),
        problem: format!(
            "{} found; {which}, expected the joints of {of}: {}",
            listed(found),
            listed(names.joints)
        ),
        numbered: by_number(found).is_some(),
    }
}

/// Returns the order of six names whose last numbers are consecutive and begin at 0 or 1.
fn by_number(found: &[String]) -> Option<[usize; JOINTS]> {
    let mut ends: Vec<(u32, usize)> =
        found.iter().enumerate().filter_map(|(i, n)| Some((last_number(n)?, i))).collect();
    ends.sort_unstable();
    let first = ends.first().map_or(0, |e| e.0);
    let counted = ends.len() == JOINTS
        && found.len() == JOINTS
        && first <= 1
        && ends.iter().enumerate().all(|(i, e)| e.0 == first + i as u32);
    counted.then(|| std::array::from_fn(|i| ends[i].1))
}

fn last_number(name: &str) -> Option<u32> {
    let digits = name.len() - name.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    name[name.len() - digits..].parse().ok()
}
